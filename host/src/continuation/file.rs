//! Reads a continuation file and the case that it names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use damprig_continuation::{NoStart, Steps, StructureTask, System, Task, Ties};
use damprig_core::integrator::exact::Excitation;
use damprig_structures::NoDerivatives;
use toml::Value;

use super::found::{FoundBranches, FoundCurve, no_orbit};
use super::keys::{file, second};
use super::of_structure::{NotFollowed, OverKey};
use crate::failure::Failure;
use crate::input::key::KeyedQuantity;
use crate::input::{Number, Problem, Section, Source, Span, Text, near, resolve};
use crate::setup::StatedContact;
use crate::simulation::analysis::WrittenCase;
use crate::simulation::case::default_name;
use crate::simulation::parameters::{PARAMETERS, ParameterKey};
use crate::simulation::set_values::{numbers_of, without_numbers};
use crate::simulation::{Case, SetValues};

/// Most orbits of a branch of a structure in one direction: each takes milliseconds, and short steps are near an end.
const MAX_ORBITS: usize = 400;

/// A validated continuation.
#[derive(Clone, Debug)]
pub struct Continuation {
    /// The case.
    pub case: Case,
    /// Its file.
    pub case_file: PathBuf,
    /// Its text.
    pub case_text: String,
    start_at: f64,
    followed: Followed,
}

/// What is followed.
#[derive(Clone, Debug)]
enum Followed {
    /// A system of one degree of freedom over one of its parameters, with the second parameter and its range.
    OneDegree(Box<OverParameter>),
    /// A structure with several places.
    Structure(OverKey),
}

/// A system of one degree of freedom over a parameter.
#[derive(Clone, Debug)]
struct OverParameter {
    system: System,
    parameter: ParameterKey,
    second: Option<(ParameterKey, (f64, f64))>,
    task: Task,
}

/// A parameter and its range, as the file has them.
struct ParameterRange {
    key: Text,
    from: Number,
    to: Number,
}

/// What the file says before the case is read.
struct ContinuationRequest {
    case_file: PathBuf,
    over: ParameterRange,
    start_at: Option<Number>,
    switch: bool,
    second: Option<ParameterRange>,
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
        case.refuse_other_engines(text, &SetValues::default(), "a continuation", true)?;
        if case.harvests() {
            return Err(Failure::Input(format!(
                "{name}: a motion between piezoelectric walls has no derivatives, by which a continuation follows it\n  \
                 `damprig study bifurcation` follows it by simulation"
            )));
        }
        let case = case.without_hertz();
        if !case.is_under_a_sine() {
            return Err(Failure::Input(format!(
                "{name}: `base` or `force` must be a sine: only then does a motion repeat with the drive\n  \
                 write base = {{ kind = \"sine\", amplitude_m = …, frequency_hz = … }}"
            )));
        }
        let followed = match &case.multi_degree {
            Some(_) => Self::structure(source, &wanted, &case_source),
            None => Self::one_degree(source, &wanted, &case, &case_source)?,
        };
        source.verdict()?;
        let (start_at, followed) =
            followed.ok_or_else(|| Failure::Input(format!("{}: the file could not be read", path.display())))?;
        Ok(Self { case, case_file: name.into(), case_text: case_source.text().to_string(), start_at, followed })
    }

    /// What is followed of a case of one degree of freedom, and where it starts; problems are reported to `source`.
    fn one_degree(
        source: &Source,
        wanted: &ContinuationRequest,
        case: &Case,
        case_source: &Source,
    ) -> Result<Option<(f64, Followed)>, Failure> {
        let name = case_source.name();
        let system = System::new(&case.set_up, &case.excitation, ties(case_source.text()))
            .map_err(|invalid| Failure::Input(format!("{name}: {invalid}")))?;
        let of_this = of_this(&system, case);
        let over = wanted.over.parameter(source, "parameter", name, &of_this);
        let second = wanted.second.as_ref().map(|second| second.parameter(source, "second.parameter", name, &of_this));
        let Some((parameter, range)) = over else { return Ok(None) };
        let second = match second {
            None => None,
            Some(None) => return Ok(None),
            Some(Some(second)) => Some(second),
        };
        if let (Some((other, (low, high))), Some(written)) = (second, &wanted.second) {
            if other.parameter == parameter.parameter {
                written.report(source, &written.key.span, "must be another parameter than that of the file itself");
            }
            let value = system.value(other.parameter);
            if !(low..=high).contains(&value) {
                let allowed =
                    format!("the range must contain {value}, {} of the case: the curves start there", other.key);
                written.report(source, &written.to.span, &allowed);
            }
        }
        let (low, high) = range;
        let start_at = wanted.start_at.as_ref().map(|start| start.value);
        let start_at = start_at.unwrap_or_else(|| system.value(parameter.parameter).clamp(low, high));
        let phase_rad = match case.excitation {
            Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } => phase_rad,
            _ => 0.0,
        };
        let task = Task {
            parameter: parameter.parameter,
            range,
            start_at,
            initial: case.initial,
            phase_rad,
            most_periods: wanted.settle as u64,
            switch: wanted.switch,
            most_restarts: wanted.restarts as usize,
            steps: Steps { longest: wanted.step, ..Steps::default() },
        };
        Ok(Some((start_at, Followed::OneDegree(Box::new(OverParameter { system, parameter, second, task })))))
    }

    /// What is followed of a structure with several places, and where it starts; problems are reported to `source`.
    fn structure(source: &Source, wanted: &ContinuationRequest, case_source: &Source) -> Option<(f64, Followed)> {
        let ParameterRange { key, from, to } = &wanted.over;
        if let Some(second) = &wanted.second {
            second.report(
                source,
                &second.key.span,
                "damprig has no curves in two parameters of a structure with several places: leave out [second]",
            );
            return None;
        }
        let nothing = SetValues::default();
        let mut numbers = numbers_of(case_source.text(), &nothing);
        numbers.retain(|(known, _)| !known.starts_with("run."));
        // A list of one table needs no number.
        let of_one = || {
            let mut those = numbers.iter().filter(|(known, _)| without_numbers(known) == key.value);
            those.next().filter(|_| those.next().is_none())
        };
        let Some((key, own)) = numbers.iter().find(|(known, _)| *known == key.value).or_else(of_one) else {
            let known = || numbers.iter().map(|(known, _)| known.as_str());
            let allowed = format!(
                "{} has no such number; allowed: {}",
                case_source.name(),
                known().collect::<Vec<_>>().join(", ")
            );
            wanted.over.refuse(source, "parameter", &allowed, near_one_of(&key.value, known()));
            return None;
        };
        let (low, high) = wanted.over.ends(source)?;
        if low <= 0.0 && high >= 0.0 {
            wanted.over.report(source, &from.span, "the range must not contain 0: derivatives are of relative changes");
            return None;
        }
        let written = WrittenCase { name: case_source.name(), text: case_source.text(), values: &nothing };
        for end in [from, to] {
            if let Err(why) = written.read(key, end.value, &Arc::default()) {
                // The line that the value would stand in is not in the file.
                let why = why.to_string();
                let allowed = reason(&why);
                wanted.over.report(source, &end.span, &format!("{key} = {} is refused: {allowed}", end.value));
            }
        }
        let start_at = wanted.start_at.as_ref().map_or(own.clamp(low, high), |start| start.value);
        let task = StructureTask {
            start_at,
            most_periods: wanted.settle as u64,
            switch: wanted.switch,
            most_restarts: wanted.restarts as usize,
            steps: Steps { longest: wanted.step, most_orbits: MAX_ORBITS },
        };
        Some((start_at, Followed::Structure(OverKey { key: key.clone(), range: (low, high), task })))
    }

    /// Key of the parameter, and of the second one.
    #[must_use]
    pub fn keys(&self) -> (&str, Option<&str>) {
        match &self.followed {
            Followed::OneDegree(over) => (over.parameter.key, over.second.map(|(second, _)| second.key)),
            Followed::Structure(over) => (&over.key, None),
        }
    }

    /// Follows the orbits, while `goes_on` is true; of a structure it sees the value of the parameter that is looked at.
    ///
    /// # Errors
    /// Why there is no orbit to start from, with the value of the parameter and what to try; that it was stopped.
    pub fn follow(&self, goes_on: &dyn Fn(f64) -> bool) -> Result<FoundBranches, Failure> {
        let mut found = match &self.followed {
            Followed::OneDegree(over) => self.of_one_degree(over)?,
            Followed::Structure(over) => {
                let (name, nothing) = (self.case_file.display().to_string(), SetValues::default());
                let written = WrittenCase { name: &name, text: &self.case_text, values: &nothing };
                over.follow(&self.case, &written, goes_on).map_err(|why| match why {
                    NotFollowed::Failure(failure) => failure,
                    NotFollowed::NoOrbit(NoDerivatives::Stopped) => Failure::stopped(),
                    NotFollowed::NoOrbit(why) => self.no_start(
                        &no_orbit(&why),
                        "give another `start_at`, where the motion is periodic, or a larger `settle_periods`",
                    ),
                })?
            }
        };
        found.case_text.clone_from(&self.case_text);
        found.walls = self.case.hertz_as_hard();
        let range = match &self.followed {
            Followed::OneDegree(over) => over.task.range,
            Followed::Structure(over) => over.range,
        };
        found.not_covered = found.parts_not_covered(range);
        Ok(found)
    }

    fn of_one_degree(&self, over: &OverParameter) -> Result<FoundBranches, Failure> {
        let OverParameter { system, parameter, second, task } = over;
        let diagram = system.explore(task).map_err(|why| {
            let fix = match why {
                NoStart::NoRepetition { .. } => {
                    "give another `start_at`, where the motion is periodic, or a larger `settle_periods`"
                }
                NoStart::Chatter | NoStart::TooManyEvents { .. } => {
                    "give another `start_at`, where the motion is simpler"
                }
                NoStart::NotIsolated => {
                    "give another `start_at`, or a case whose start makes the particle meet its walls"
                }
                NoStart::Invalid(_) => "give another `start_at` or range",
                NoStart::NoConvergence => "give a slightly different `start_at`",
            };
            self.no_start(&why.to_string(), fix)
        })?;
        let reference = self.case.reference_m().map_or("Z", |(_, symbol)| symbol);
        let mut found = FoundBranches::of(&self.case.name, parameter, reference, &diagram);
        if let Some((second, range)) = second {
            let parameters = [parameter.parameter, second.parameter];
            let ranges = [task.range, *range];
            found.second_parameter = Some(second.key.into());
            for (number, branch) in diagram.branches.iter().enumerate() {
                for (_, special) in &branch.specials {
                    let curve = system.curve(&branch.sequence, special, parameters, ranges, task.steps);
                    found.curves.extend(curve.map(|curve| FoundCurve::of(number + 1, &curve)));
                }
            }
        }
        Ok(found)
    }

    fn no_start(&self, why: &str, fix: &str) -> Failure {
        Failure::Input(format!(
            "no periodic orbit of {} found at {} = {}: {why}\n  {fix}",
            self.case_file.display(),
            self.keys().0,
            self.start_at
        ))
    }
}

/// Keys of the parameters that a case of one degree of freedom has.
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

/// What a message says of its marked line; its first line if none is marked.
fn reason(message: &str) -> &str {
    let marked = message.lines().find_map(|line| line.rsplit_once('^').map(|(_, said)| said.trim()));
    marked.unwrap_or_else(|| message.lines().next().unwrap_or_default())
}

fn near_one_of<'k>(key: &str, known: impl Iterator<Item = &'k str>) -> Option<String> {
    near(key, known).first().map(|key| format!("did you mean {key:?}?"))
}

impl ParameterRange {
    /// Reports what is not allowed at a place of the file.
    fn report(&self, source: &Source, span: &Span, allowed: &str) {
        let title = format!("{} from {} to {} is not allowed", self.key.value, self.from.value, self.to.value);
        source.report(Problem { title, span: span.clone(), allowed: allowed.into(), help: None });
    }

    /// Reports that there is no such parameter.
    fn refuse(&self, source: &Source, name: &str, allowed: &str, help: Option<String>) {
        let title = format!("`{name}` = {:?} is not allowed", self.key.value);
        source.report(Problem { title, span: self.key.span.clone(), allowed: allowed.into(), help });
    }

    /// The parameter of a case of one degree of freedom that has these, with the range that it allows.
    fn parameter(
        &self,
        source: &Source,
        name: &str,
        case: &str,
        of_this: &[&'static str],
    ) -> Option<(ParameterKey, (f64, f64))> {
        let known = PARAMETERS.iter().find(|known| known.key == self.key.value && of_this.contains(&known.key));
        let Some(parameter) = known else {
            let allowed = format!("the case {case} has no such parameter; allowed: {}", of_this.join(", "));
            self.refuse(source, name, &allowed, near_one_of(&self.key.value, of_this.iter().copied()));
            return None;
        };
        for end in [&self.from, &self.to] {
            if let Some(refusal) = parameter.refusal(end.value) {
                self.report(source, &end.span, &format!("{} {refusal}", parameter.key));
                return None;
            }
        }
        Some((*parameter, self.ends(source)?))
    }

    /// Its ends, in order.
    fn ends(&self, source: &Source) -> Option<(f64, f64)> {
        let Self { from, to, .. } = self;
        if from.value < to.value {
            return Some((from.value, to.value));
        }
        let help = (from.value > to.value).then(|| format!("swap them: from = {}, to = {}", to.value, from.value));
        source.report(Problem {
            title: format!("the range from {} to {} is empty", from.value, to.value),
            span: to.span.clone(),
            allowed: "`to` must be greater than `from`".into(),
            help,
        });
        None
    }
}

fn read(root: &Section, path: &Path) -> Option<ContinuationRequest> {
    let case_file = root.text_of(&file::CASE).map(|text| resolve(path, &text.value));
    let over = range(root, [&file::PARAMETER, &file::FROM, &file::TO]);
    let start_at = root.placed(&file::START_AT);
    if let (Some(start), Some(ParameterRange { from, to, .. })) = (&start_at, &over)
        && from.value < to.value
        && !(from.value..=to.value).contains(&start.value)
    {
        let (low, high) = (from.value, to.value);
        root.refuse("start_at", &start.span, format!("must be from {low} to {high}: within `from` and `to`"), None);
    }
    let branches = root.word(&file::BRANCHES);
    let numbers = [&file::RESTARTS, &file::STEP, &file::SETTLE].map(|quantity| root.scalar(quantity));
    let second = root.table_of(&file::SECOND, None).map(|section| {
        let over = range(&section, [&second::PARAMETER, &second::FROM, &second::TO]);
        section.finish();
        over
    });
    let [restarts, step, settle] = numbers;
    Some(ContinuationRequest {
        case_file: case_file?,
        over: over?,
        second: match second {
            Some(second) => Some(second?),
            None => None,
        },
        start_at,
        switch: branches? == 1,
        restarts: restarts?,
        step: step?,
        settle: settle?,
    })
}

fn range(section: &Section, [key, from, to]: [&KeyedQuantity; 3]) -> Option<ParameterRange> {
    let (key, from, to) = (section.text_of(key), section.placed(from), section.placed(to));
    Some(ParameterRange { key: key?, from: from?, to: to? })
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
