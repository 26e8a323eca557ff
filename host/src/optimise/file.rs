//! Reads an optimisation file: the case, its variables, the band, the objective and the constraints.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::alternative::{self, Alternative, read_case};
use super::constraint::{self, Constraint};
use super::front::{self, Second};
use super::keys::{ensemble, optimisation as keys};
use super::variable::{self, UncertainVariable, Variable};
use crate::failure::Failure;
use crate::input::{self, Files, Problem, Section, Source};
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::simulation::case::default_name;
use crate::study::axis::{self, AxisValue, Reduction, StudyAxis};
use crate::study::band::{self, Band, Smoothness};
use crate::study::direct::Direct;
use crate::study::file::read_record;
use crate::study::metric::{self, METRICS};
use crate::study::over::Over;
use crate::study::samples;
use crate::study::simulate::SimulationRecord;
use crate::study::varied_case::VariedCase;

/// Evaluations for each variable, unless the file states their number.
const EVALUATIONS_PER_VARIABLE: u64 = 2_000;

/// Evaluations for each variable where each is one of several cases, unless the file states their number.
const EVALUATIONS_OF_SEVERAL: u64 = 500;

/// Most variables, and most uncertain keys.
const MAX_VARIABLES: usize = 12;

/// An optimisation as read.
#[derive(Clone, Debug)]
pub struct Optimisation {
    /// Name.
    pub name: String,
    /// Its text.
    pub text: String,
    /// Path of the case.
    pub case_path: PathBuf,
    /// Text of the case.
    pub case_text: String,
    /// The variables, then what is uncertain, then the axes of the band, each in the order of the file.
    pub axes: Vec<StudyAxis>,
    /// What the variables can be made as.
    pub variables: Vec<Variable>,
    /// What is uncertain.
    pub uncertain: Vec<UncertainVariable>,
    /// The band as the objective is reduced over it,
    pub reduced_band: Band,
    /// and as a constraint is judged over it.
    pub constraint_band: Band,
    /// What is counted; as the case's `run` says without one.
    pub record: Option<SimulationRecord>,
    /// Places of the particle at the start as shares of the clearance from the centre, −1 to 1; none for the case's own start.
    pub starts: Option<Vec<f64>>,
    /// What counts of starts, tolerances and uncertain values.
    pub over: Over,
    /// The objective.
    pub objective: Quantity,
    /// The largest value is the best.
    pub is_maximum: bool,
    /// The constraints; the last one of those with a front tells the second objective.
    pub constraints: Vec<Constraint>,
    /// Most points that are evaluated.
    pub evaluations: u64,
    /// Of the random numbers.
    pub seed: u64,
    /// A second objective, for a front of both.
    pub second: Option<Second>,
    /// Whether what is around the optimum is computed: starts, small changes, other dampers.
    pub has_surroundings: bool,
    /// Other dampers under the same rules.
    pub alternatives: Vec<Self>,
    /// The files that the case names, each read once.
    files: Arc<Files>,
    pub(super) direct: Direct,
}

impl Optimisation {
    /// Reads an optimisation and its case, and checks the case at the ends of every range.
    ///
    /// # Errors
    /// Lists all problems of the file, or those of the case with values of the variables.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::parse(&Source::read(path)?, path, None)
    }

    /// Reads a text as [`Optimisation::read`] does: its files are relative to `path`; `case` takes the place of the file that it
    /// names.
    ///
    /// # Errors
    /// As [`Optimisation::read`].
    pub fn parse(source: &Source, path: &Path, case: Option<&Source>) -> Result<Self, Failure> {
        let read = source.read_toml(source.text(), "this is not TOML", |root| read_root(root, path, case));
        source.verdict()?;
        let mut read =
            read.ok_or_else(|| Failure::Input(format!("{}: the optimisation could not be read", path.display())))?;
        read.check(source)?;
        read.prepare()?;
        for alternative in &mut read.alternatives {
            alternative.adapt();
            alternative.check(source)?;
            alternative.prepare()?;
        }
        Ok(read)
    }

    /// The axes of the variables.
    #[must_use]
    pub fn variable_axes(&self) -> &[StudyAxis] {
        &self.axes[..self.variables.len()]
    }

    /// The axes of what is uncertain.
    #[must_use]
    pub fn uncertain_axes(&self) -> &[StudyAxis] {
        &self.axes[self.variables.len()..self.set()]
    }

    /// Number of the variables and of what is uncertain.
    #[must_use]
    pub fn set(&self) -> usize {
        self.variables.len() + self.uncertain.len()
    }

    /// The axes of the band.
    #[must_use]
    pub fn band(&self) -> &[StudyAxis] {
        &self.axes[self.set()..]
    }

    /// The same with a place of the band on its grid: the value of the axis that is searched between its values.
    #[must_use]
    pub fn with_place_in_band(&self, place: &[AxisValue]) -> Self {
        let mut with = self.clone();
        let set = self.set();
        for (axis, value) in with.axes[set..].iter_mut().zip(place).filter(|(axis, _)| axis.is_refined()) {
            if let AxisValue::Number(number) = value {
                axis.insert(*number);
                with.reduced_band = with.reduced_band.with_value(*number);
                with.constraint_band = with.constraint_band.with_value(*number);
            }
        }
        with
    }

    /// Whether the objective counts over tolerances or uncertain values.
    #[must_use]
    pub fn is_robust(&self) -> bool {
        !self.uncertain.is_empty() || self.variables.iter().any(|variable| variable.stated.is_some())
    }

    /// Points of the band.
    #[must_use]
    pub fn band_points(&self) -> usize {
        self.band().iter().map(StudyAxis::count).product()
    }

    /// The values of the band's axes at one of its points, of which the last axis varies fastest.
    #[must_use]
    pub fn band_values(&self, point: usize) -> Vec<AxisValue> {
        band::values_at(self.band(), point)
    }

    /// Simulations of a point.
    #[must_use]
    pub fn simulations_per_point(&self) -> usize {
        self.band_points() * self.starts.as_ref().map_or(1, Vec::len)
    }

    /// The case with values of the variables and of the band's axes.
    ///
    /// # Errors
    /// Names the key, its value and what is allowed.
    pub fn case_with(&self, values: &[AxisValue]) -> Result<Case, Failure> {
        self.varied_case().with(values)
    }

    /// The case at the first values of all axes.
    ///
    /// # Errors
    /// As [`Self::case_with`].
    pub fn first_case(&self) -> Result<Case, Failure> {
        self.case_with(&self.first_values())
    }

    fn first_values(&self) -> Vec<AxisValue> {
        samples::corners(&self.axes).swap_remove(0)
    }

    fn prepare(&mut self) -> Result<(), Failure> {
        self.direct = Direct::of(self.varied_case(), samples::corners(&self.axes), |axis| axis >= self.set());
        let smoothness = Smoothness::of(&self.first_case()?, self.record);
        (self.reduced_band.smoothness, self.constraint_band.smoothness) = (smoothness, smoothness);
        Ok(())
    }

    pub(super) fn varied_case(&self) -> VariedCase<'_> {
        VariedCase {
            path: &self.case_path,
            text: &self.case_text,
            files: &self.files,
            axes: &self.axes,
            origin: "the variables and axes",
        }
    }

    /// Whether the objective can be better between the values of the band's grid than on it.
    #[must_use]
    pub fn can_improve_between(&self) -> bool {
        let refined = self.reduced_band.refined();
        refined.is_some_and(|reduction| self.is_maximum == (reduction != Reduction::Minimum))
    }

    /// Whether the objective is the worst of simulations without jumps, and nothing else bounds it.
    #[must_use]
    pub fn has_slopes(&self) -> bool {
        let is_worst = |axis: &StudyAxis| {
            axis.reduce != Some(Reduction::Mean) && self.is_maximum == (axis.reduce == Some(Reduction::Minimum))
        };
        let counts_worst = self.over == Over::Worst || (self.starts.is_none() && !self.is_robust());
        self.reduced_band.smoothness > Smoothness::Jumps
            && counts_worst
            && self.constraints.is_empty()
            && self.band().iter().all(is_worst)
    }

    /// Whether `new` is a better value of the objective than `old`.
    #[must_use]
    pub fn is_better(&self, new: f64, old: f64) -> bool {
        if self.is_maximum { new > old } else { new < old }
    }

    /// Leaves out what a damper without a particle has not: starts, and constraints on impacts and the forces of contacts, which it
    /// keeps.
    fn adapt(&mut self) {
        let Ok(case) = self.first_case() else { return };
        if !case.has_impacts() {
            self.constraints.retain(|constraint| !metric::needs_impacts(constraint.metric));
        }
        if !case.has_particle() {
            self.starts = None;
        }
    }

    fn check(&self, source: &Source) -> Result<(), Failure> {
        for corner in samples::corners(&self.axes) {
            let case = self.varied_case().checked(source, &corner)?;
            self.check_case(&case, &corner)?;
            self.check_metrics(source, &case)?;
        }
        self.check_tolerances(source)?;
        let first = self.first_values();
        for values in samples::each_alone(&self.axes, &first) {
            self.varied_case().checked(source, &values)?;
        }
        Ok(())
    }

    /// Checks the case at the ends of the tolerances that the file states, which may lie outside the ranges.
    fn check_tolerances(&self, source: &Source) -> Result<(), Failure> {
        let first = self.first_values();
        for (place, variable) in self.variables.iter().enumerate().filter(|(_, variable)| variable.stated.is_some()) {
            for (end, side) in [(variable.range.0, -1.0), (variable.range.1, 1.0)] {
                let made = end + side * variable.tolerance(end);
                let mut values = first.clone();
                values[place] = AxisValue::Number(made);
                let Err(refusal) = self.varied_case().with(&values) else { continue };
                let key = &self.axes[place].key;
                let why = refusal.to_string();
                let why = why.lines().next().unwrap_or_default();
                source.report(Problem {
                    title: format!("the tolerance of `{key}` reaches {made}"),
                    span: self.axes[place].value_spans[usize::from(side > 0.0)].clone(),
                    allowed: format!("the case refuses that: {why}"),
                    help: Some("narrow the range, or the tolerance".into()),
                });
            }
        }
        source.verdict()
    }

    fn check_case(&self, case: &Case, values: &[AxisValue]) -> Result<(), Failure> {
        let path = self.case_path.display();
        let text = (&*path.to_string(), self.case_text.as_str());
        case.refuse_other_engines(text, &self.varied_case().set_values(values), "an optimisation", true)?;
        if self.starts.is_some() && !case.has_particle() {
            return Err(Failure::Input(format!(
                "`starts` of [ensemble] are those of a particle, and {path} has none\n  leave it out"
            )));
        }
        if self.record.is_some() && case.record.is_some() {
            let why = format!("[record] counts cycles, and the base of {path} follows a record");
            return Err(Failure::Input(format!("{why}\n  leave it out: the whole record counts")));
        }
        Ok(())
    }

    fn check_metrics(&self, source: &Source, case: &Case) -> Result<(), Failure> {
        let objective = (self.objective, source.locate(&[crate::input::locate::PathStep::Key(keys::OBJECTIVE.name())]));
        let constraints = self.constraints.iter().map(|constraint| (constraint.metric, Some(constraint.span.clone())));
        for (metric, span) in std::iter::once(objective).chain(constraints) {
            if let Some(why) = metric::refusal(metric, case) {
                source.report(Problem {
                    title: format!("the metric {:?} does not go with this case", metric.name()),
                    span: span.unwrap_or_default(),
                    allowed: why.into(),
                    help: None,
                });
            }
        }
        source.verdict()
    }
}

fn read_root(root: &Section, path: &Path, given: Option<&Source>) -> Option<Optimisation> {
    let name = root.text_of(&keys::NAME).map_or_else(|| default_name(path), |text| text.value);
    let case = read_case(root, &keys::CASE, path, given, None);
    let objective = root.word(&keys::OBJECTIVE).map(|place| METRICS[place]);
    let goal = root.word(&keys::GOAL);
    let (evaluations, seed) = (root.scalar(&keys::EVALUATIONS), root.scalar(&keys::SEED));
    let set = read_set(root, &keys::VARIABLE, &keys::UNCERTAIN);
    let band: Vec<Option<StudyAxis>> = root.tables_of(&keys::AXIS).iter().map(read_axis).collect();
    let constraints: Vec<_> = root.tables_of(&keys::CONSTRAINT).iter().map(constraint::read).collect();
    let record = root.table_of(&keys::RECORD, None).map(|s| read_record(&s));
    let second = root.table_of(&keys::FRONT, None).map(|s| front::read(&s));
    let ensemble = root.table_of(&keys::ENSEMBLE, None).map(|s| read_ensemble(&s));
    let own = case.as_ref().map(|(_, text)| text.as_str());
    let alternatives = alternative::read(&root.tables_of(&keys::ALTERNATIVE), path, &name, own);
    let band = band.into_iter().collect::<Option<Vec<StudyAxis>>>()?;
    let set = set?;
    check_variables(root, &set)?;
    let (starts, over) = ensemble.unwrap_or(Some((None, Over::Worst)))?;
    let (record, objective, goal, seed) = (record.unwrap_or(Some(None))?, objective?, goal?, seed?);
    let constraints = constraints.into_iter().collect::<Option<Vec<Constraint>>>()?;
    let (case_path, case_text) = case?;
    let optimisation = |section: &Section, name: String, case_path, case_text, set: Set| {
        let (mut axes, variables): (Vec<StudyAxis>, Vec<_>) = set.variables.into_iter().unzip();
        let (uncertain_axes, uncertain): (Vec<StudyAxis>, Vec<_>) = set.uncertain.into_iter().unzip();
        axes.extend(uncertain_axes);
        axes.extend(band.iter().cloned());
        check_axes(section, &axes, variables.len() + uncertain.len())?;
        let is_robust = !uncertain.is_empty() || variables.iter().any(|variable| variable.stated.is_some());
        let each = if is_robust { EVALUATIONS_OF_SEVERAL } else { EVALUATIONS_PER_VARIABLE };
        Some(Optimisation {
            name,
            text: root.source().text().to_string(),
            case_path,
            case_text,
            axes,
            evaluations: evaluations.map_or(each * variables.len().max(1) as u64, |count| count as u64),
            variables,
            uncertain,
            constraint_band: Band::of_extreme(&band, Reduction::Maximum),
            reduced_band: Band::of(band.clone()),
            record,
            starts: starts.clone(),
            over,
            objective,
            is_maximum: goal == 1,
            constraints: constraints.clone(),
            seed: seed as u64,
            second: None,
            has_surroundings: true,
            alternatives: Vec::new(),
            files: Arc::default(),
            direct: Direct::default(),
        })
    };
    let mut read = optimisation(root, name, case_path, case_text, set)?;
    if let Some(second) = second {
        let second = second?;
        read.constraints.push(second.told());
        read.second = Some(second);
    }
    for alternative in alternatives {
        let Alternative { name, case: (path, text), set } = alternative?;
        read.alternatives.push(optimisation(root, name, path, text, set)?);
    }
    Some(read)
}

/// What is set: variables and uncertain keys with their axes.
pub(super) struct Set {
    variables: Vec<(StudyAxis, Variable)>,
    uncertain: Vec<(StudyAxis, UncertainVariable)>,
}

pub(super) fn read_set(
    s: &Section,
    variables: &input::key::KeyedQuantity,
    uncertain: &input::key::KeyedQuantity,
) -> Option<Set> {
    let tables = [variables, uncertain].map(|quantity| {
        let tables = s.tables_of(quantity);
        let is_possible = tables.len() <= MAX_VARIABLES;
        if !is_possible {
            let count = tables.len();
            s.reject(quantity.name(), format!("has {count} tables; at most {MAX_VARIABLES} are possible"), None);
        }
        is_possible.then_some(tables)
    });
    let [variables, uncertain] = tables;
    let variables: Vec<_> = variables?.iter().map(variable::read).collect();
    let uncertain: Vec<_> = uncertain?.iter().map(variable::read_uncertain).collect();
    Some(Set {
        variables: variables.into_iter().collect::<Option<_>>()?,
        uncertain: uncertain.into_iter().collect::<Option<_>>()?,
    })
}

fn read_axis(s: &Section) -> Option<StudyAxis> {
    let axis = axis::read(s, false, "give `count`")?;
    if axis.reduce.is_none() {
        let help = "add reduce = \"maximum\" for the worst case over the band, or make it a [[variable]]";
        s.refuse("key", &axis.span, "has no `reduce`: the points of an axis must become one", Some(help.into()));
        return None;
    }
    Some(axis)
}

/// The starts and what counts.
fn read_ensemble(s: &Section) -> Option<(Option<Vec<f64>>, Over)> {
    let count = s.is_given(&ensemble::STARTS).then(|| s.scalar(&ensemble::STARTS));
    let over = s.word(&ensemble::OVER).map(|place| Over::ALL[place]);
    s.finish();
    let starts = match count {
        Some(count) => {
            let last = count? - 1.0;
            Some((0..=last as usize).map(|n| 2.0 * (n as f64 / last) - 1.0).collect())
        }
        None => None,
    };
    Some((starts, over?))
}

fn check_variables(root: &Section, set: &Set) -> Option<()> {
    if set.variables.is_empty() {
        root.source().report(Problem {
            title: "`variable` is missing".into(),
            span: root.span(),
            allowed: "an optimisation varies at least one key of its case".into(),
            help: Some("add a table [[variable]] with `key`, `from` and `to`".into()),
        });
        return None;
    }
    Some(())
}

fn check_axes(root: &Section, axes: &[StudyAxis], set: usize) -> Option<()> {
    for (place, axis) in axes.iter().enumerate() {
        if axes[..place].iter().any(|other| other.key == axis.key) {
            root.refuse("key", &axis.span, "is varied twice", Some("leave one of the two tables out".into()));
            return None;
        }
    }
    let points = axes[set..].iter().try_fold(1usize, |points, axis| points.checked_mul(axis.count()));
    if points.is_none_or(|points| points > 1_000_000) {
        root.reject(keys::AXIS.name(), "has more than a million points", None);
        return None;
    }
    Some(())
}
