//! Reads a continuation file and the case that it names.

use std::path::{Path, PathBuf};

use damprig_continuation::{NoStart, Steps, System, Task, Ties};
use damprig_core::integrator::exact::Excitation;
use toml::Value;

use super::found::{Found, FoundCurve};
use super::keys::{file, second};
use crate::failure::Failure;
use crate::input::key::Quantity;
use crate::input::{Problem, Section, Source, near};
use crate::motion_record::resolve;
use crate::setup::StatedContact;
use crate::simulation::case::default_name;
use crate::simulation::parameters::{PARAMETERS, ParameterKey};
use crate::simulation::{Case, SetValues};

/// A validated continuation.
#[derive(Clone, Debug)]
pub struct Continuation {
    /// The case.
    pub case: Case,
    /// Its file.
    pub case_file: PathBuf,
    /// Its text.
    pub case_text: String,
    /// The parameter.
    pub parameter: ParameterKey,
    /// The second parameter and its range.
    second: Option<(ParameterKey, (f64, f64))>,
    task: Task,
    system: System,
    name: String,
}

/// What the file says before the case is read.
struct Wanted {
    case_file: PathBuf,
    parameter: ParameterKey,
    range: (f64, f64),
    start_at: Option<f64>,
    switch: bool,
    second: Option<(ParameterKey, (f64, f64))>,
    restarts: f64,
    step: f64,
    settle: f64,
}

impl Continuation {
    /// Reads a file.
    ///
    /// # Errors
    /// Lists all problems of the file: file, line, key, value, allowed values, likely fix; or those of the case.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::parse(&Source::read(path)?, path, None)
    }

    /// Reads a text as [`Continuation::read`] does: its case is relative to `path`; `case` takes the place of the file that it names.
    ///
    /// # Errors
    /// As [`Continuation::read`].
    pub fn parse(source: &Source, path: &Path, case: Option<&Source>) -> Result<Self, Failure> {
        let wanted = source.read_toml(source.text(), "this is not TOML", |root| read(root, path));
        source.verdict()?;
        let wanted = wanted.ok_or_else(|| Failure::Input(format!("{}: the file could not be read", path.display())))?;
        let case_source = match case {
            Some(given) => Source::new(given.name(), given.text()),
            None => Source::read(&wanted.case_file)?,
        };
        let case = Case::parse(&case_source, &default_name(Path::new(case_source.name())))?;
        let name = case_source.name().to_string();
        let text = (case_source.name(), case_source.text());
        case.refuse_other_engines(text, &SetValues::default(), "a continuation", false)?;
        let case = case.without_hertz();
        if !matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. }) || case.record.is_some() {
            return Err(Failure::Input(format!(
                "{name}: `base` or `force` must be a sine: only then does a motion repeat with the drive\n  \
                 write base = {{ kind = \"sine\", amplitude_m = …, frequency_hz = … }}"
            )));
        }
        let ties = ties(case_source.text());
        let system = System::new(&case.set_up, &case.excitation, ties)
            .map_err(|invalid| Failure::Input(format!("{name}: {invalid}")))?;
        let of_this = Self::of_this(&system, &case);
        let second = wanted.second.map(|(parameter, _)| ("second.parameter", parameter));
        for (key, parameter) in [("parameter", wanted.parameter)].into_iter().chain(second) {
            if !of_this.contains(&parameter.key) {
                return Err(Failure::Input(format!(
                    "{}: `{key}` = {:?} is not allowed: the case {name} has no such parameter\n  allowed: {}",
                    path.display(),
                    parameter.key,
                    of_this.join(", ")
                )));
            }
        }
        if let Some((parameter, (low, high))) = wanted.second {
            let value = system.value(parameter.parameter);
            if !(low..=high).contains(&value) {
                return Err(Failure::Input(format!(
                    "{}: the range of `second`, from {low} to {high}, is not allowed: {} = {value} of the case must lie in it\n  \
                     change `second.from` or `second.to`: the curves start at the value of the case",
                    path.display(),
                    parameter.key
                )));
            }
        }
        let (low, high) = wanted.range;
        let start_at = wanted.start_at.unwrap_or_else(|| system.value(wanted.parameter.parameter).clamp(low, high));
        let phase_rad = match case.excitation {
            Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } => phase_rad,
            _ => 0.0,
        };
        let task = Task {
            parameter: wanted.parameter.parameter,
            range: wanted.range,
            start_at,
            initial: case.initial,
            phase_rad,
            most_periods: wanted.settle as u64,
            switch: wanted.switch,
            most_restarts: wanted.restarts as usize,
            steps: Steps { longest: wanted.step, ..Steps::default() },
        };
        Ok(Self {
            name: case.name.clone(),
            case,
            case_file: case_source.name().into(),
            case_text: case_source.text().to_string(),
            parameter: wanted.parameter,
            second: wanted.second,
            task,
            system,
        })
    }

    /// Both parameters, if the file has a second one.
    #[must_use]
    pub fn curve_parameters(&self) -> Option<[ParameterKey; 2]> {
        self.second.map(|(second, _)| [self.parameter, second])
    }

    /// Keys of the parameters that a case has.
    fn of_this(system: &System, case: &Case) -> Vec<&'static str> {
        // The keys of a Hertz wall are not those of the hard wall in its place.
        let hertz = [("particle.wall.", 0), ("particle.positive_wall.", 1)]
            .map(|(wall, side)| matches!(case.contacts[side], Some(StatedContact::HertzWall(_))).then_some(wall));

        let drive = if case.excitation.moves_base() { "force." } else { "base." };
        let other = if case.set_up.tmd.is_some() { "particle." } else { "tmd." };
        let absent =
            |key: &str| [drive, other].into_iter().chain(hertz.into_iter().flatten()).any(|of| key.starts_with(of));
        let has = |p: &&ParameterKey| !absent(p.key) && system.has(p.parameter);
        PARAMETERS.iter().filter(has).map(|p| p.key).collect()
    }

    /// Follows the orbits.
    ///
    /// # Errors
    /// Why there is no orbit to start from, with the value of the parameter and what to try.
    pub fn follow(&self) -> Result<Found, Failure> {
        let diagram = self.system.explore(&self.task).map_err(|why| self.no_start(&why))?;
        let mut found = Found::of(&self.name, &self.parameter, &diagram);
        found.case_text.clone_from(&self.case_text);
        found.walls = self.case.hertz_as_hard();
        if let Some((parameter, range)) = &self.second {
            let parameters = [self.parameter.parameter, parameter.parameter];
            let ranges = [self.task.range, *range];
            found.second_parameter = Some(parameter.key);
            found.curve_parameters = Some([self.parameter, *parameter]);
            for (number, branch) in diagram.branches.iter().enumerate() {
                for (_, special) in &branch.specials {
                    let curve = self.system.curve(&branch.sequence, special, parameters, ranges, self.task.steps);
                    found.curves.extend(curve.map(|curve| FoundCurve::of(number + 1, &curve)));
                }
            }
        }
        Ok(found)
    }

    fn no_start(&self, why: &NoStart) -> Failure {
        let fix = match why {
            NoStart::NoRepetition { .. } => {
                "give another `start_at`, where the motion is periodic, or a larger `settle_periods`"
            }
            NoStart::Chatter | NoStart::TooManyEvents { .. } => "give another `start_at`, where the motion is simpler",
            NoStart::NotIsolated => "give another `start_at`, or a case whose start makes the particle meet its walls",
            NoStart::Invalid(_) => "give another `start_at` or range",
            NoStart::NoConvergence => "give a slightly different `start_at`",
        };
        Failure::Input(format!(
            "no periodic orbit of {} found at {} = {}: {why}\n  {fix}",
            self.case_file.display(),
            self.parameter.key,
            self.task.start_at
        ))
    }
}

fn read(root: &Section, path: &Path) -> Option<Wanted> {
    let case_file = root.text_of(&file::CASE).map(|text| resolve(path, &text.value));
    let parameter = parameter(root, &file::PARAMETER);
    let range = range(root, parameter, (&file::FROM, &file::TO));
    let start_at = root.placed(&file::START_AT);
    if let (Some(start), Some((low, high))) = (&start_at, range)
        && !(low..=high).contains(&start.value)
    {
        root.refuse("start_at", &start.span, format!("must be from {low} to {high}: within `from` and `to`"), None);
    }
    let branches = root.word(&file::BRANCHES);
    let numbers = [&file::RESTARTS, &file::STEP, &file::SETTLE].map(|quantity| root.scalar(quantity));
    let second = root.table_of(&file::SECOND, None).map(|section| {
        let parameter = self::parameter(&section, &second::PARAMETER);
        let range = self::range(&section, parameter, (&second::FROM, &second::TO));
        section.finish();
        parameter.zip(range)
    });
    if let (Some(Some((other, _))), Some(parameter)) = (&second, parameter)
        && other.parameter == parameter.parameter
    {
        root.reject("second", "must have another parameter than the file itself", None);
    }
    let [restarts, step, settle] = numbers;
    Some(Wanted {
        case_file: case_file?,
        parameter: parameter?,
        range: range?,
        second: match second {
            Some(second) => Some(second?),
            None => None,
        },
        start_at: start_at.map(|start| start.value),
        switch: branches? == 1,
        restarts: restarts?,
        step: step?,
        settle: settle?,
    })
}

/// Reads the key of a parameter.
fn parameter(section: &Section, quantity: &Quantity) -> Option<ParameterKey> {
    let text = section.text_of(quantity)?;
    let found = PARAMETERS.iter().find(|known| known.key == text.value).copied();
    if found.is_none() {
        let keys = || PARAMETERS.iter().map(|known| known.key);
        let help = near(&text.value, keys()).first().map(|key| format!("did you mean {key:?}?"));
        let allowed = format!("must be one of {}", keys().collect::<Vec<_>>().join(", "));
        section.refuse(quantity.name(), &text.span, allowed, help);
    }
    found
}

/// Reads a range, whose values the parameter allows.
fn range(section: &Section, parameter: Option<ParameterKey>, ends: (&Quantity, &Quantity)) -> Option<(f64, f64)> {
    let (from, to) = (section.placed(ends.0), section.placed(ends.1));
    let (from, to) = (from?, to?);
    for (quantity, number) in [(ends.0, &from), (ends.1, &to)] {
        if let Some(refusal) = parameter.and_then(|parameter| parameter.refusal(number.value)) {
            let key = parameter.map_or("the parameter", |parameter| parameter.key);
            section.refuse(quantity.name(), &number.span, format!("{key} {refusal}"), None);
            return None;
        }
    }
    if from.value < to.value {
        return Some((from.value, to.value));
    }
    let help = (from.value > to.value)
        .then(|| format!("swap them: {} = {}, {} = {}", ends.0.name(), to.value, ends.1.name(), from.value));
    section.source().report(Problem {
        title: format!("the range from {} to {} is empty", from.value, to.value),
        span: to.span,
        allowed: format!("`{}` must be greater than `{}`", ends.1.name(), ends.0.name()),
        help,
    });
    None
}

/// The ratios that the text of a case states: they stay while another parameter changes.
fn ties(text: &str) -> Ties {
    let from_json = || serde_json::from_str::<serde_json::Value>(text).ok().and_then(|v| Value::try_from(v).ok());
    let document = toml::from_str::<Value>(text).ok().or_else(from_json);
    let ratio = |table: &str, key: &str| {
        let value = document.as_ref()?.get(table)?.get(key)?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    };
    Ties {
        clearance_ratio: ratio("particle", "clearance_ratio"),
        damper_force_ratio: ratio("friction_damper", "friction_ratio"),
        link_frequency_ratio: ratio("tmd", "frequency_ratio"),
        link_damping_ratio: ratio("tmd", "damping_ratio"),
    }
}
