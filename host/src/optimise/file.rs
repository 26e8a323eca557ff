//! Reads an optimisation file: the case, its variables, the band, the objective and the constraints.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cases::Direct;
use super::keys::{constraint, ensemble, optimisation as keys, variable};
use crate::input::{Files, Problem, Refusal, Section, Source, Span};
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::simulation::case::default_name;
use crate::study::axis::{self, Axis, Reduction, Value, Values};
use crate::study::band::{self, Band};
use crate::study::file::{corners, read_case, read_record};
use crate::study::metric::{self, METRICS};
use crate::study::simulate::Record;
use crate::study::varied_case::VariedCase;

/// Evaluations for each variable, unless the file states their number.
const EVALUATIONS_PER_VARIABLE: u64 = 2_000;

/// Tolerance of a variable as a share of its value, unless the file states one.
pub const TOLERANCE: f64 = 1e-3;

/// Most variables.
const MAX_VARIABLES: usize = 12;

/// Several starts of the particle at each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Starts {
    /// Places of the particle at the start as shares of the clearance from the centre, −1 to 1.
    pub shares: Vec<f64>,
    /// The quantile over them that is optimised: 0 is the smallest value, 1 the largest.
    pub quantile: f64,
}

/// What a constraint asks of its metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At most this.
    AtMost(f64),
    /// At least this.
    AtLeast(f64),
    /// This.
    Equals(f64),
}

/// A constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The metric.
    pub metric: Quantity,
    /// What is asked of it.
    pub limit: Limit,
    span: Span,
}

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
    /// The variables, then the axes of the band, each in the order of the file.
    pub axes: Vec<Axis>,
    /// Number of variables.
    pub variables: usize,
    /// How closely each variable can be set, in the key's unit, where the file says so.
    pub tolerances: Vec<Option<f64>>,
    /// The band as the objective is reduced over it,
    pub reduced_band: Band,
    /// and as a constraint is judged over it.
    pub constraint_band: Band,
    /// What is counted; as the case's `run` says without one.
    pub record: Option<Record>,
    /// Several starts, if any.
    pub starts: Option<Starts>,
    /// The objective.
    pub objective: Quantity,
    /// The largest value is the best.
    pub is_maximum: bool,
    /// The constraints.
    pub constraints: Vec<Constraint>,
    /// Most points that are evaluated.
    pub evaluations: u64,
    /// Of the random numbers.
    pub seed: u64,
    /// The files that the case names, each read once.
    files: Arc<Files>,
    pub(super) direct: Direct,
}

impl Limit {
    /// By how much a value is beyond it, in the metric's unit; below 0 within it, infinite for a value that does not exist.
    #[must_use]
    pub fn excess(self, value: f64) -> f64 {
        match self {
            _ if value.is_nan() => f64::INFINITY,
            Self::AtMost(limit) => value - limit,
            Self::AtLeast(limit) => limit - value,
            Self::Equals(limit) => (value - limit).abs(),
        }
    }

    /// By how much a value misses it, as a share of the limit (as a number where the limit is 0); 0 if it is kept.
    #[must_use]
    pub fn violation(self, value: f64) -> f64 {
        let (Self::AtMost(limit) | Self::AtLeast(limit) | Self::Equals(limit)) = self;
        self.excess(value).max(0.0) / if limit == 0.0 { 1.0 } else { limit.abs() }
    }

    /// In words, with a limit as `number` writes it.
    #[must_use]
    pub fn words(self, number: impl Fn(f64) -> String) -> String {
        match self {
            Self::AtMost(limit) => format!("at most {}", number(limit)),
            Self::AtLeast(limit) => format!("at least {}", number(limit)),
            Self::Equals(limit) => format!("equal to {}", number(limit)),
        }
    }
}

impl Optimisation {
    /// Reads an optimisation and its case, and checks the case at the ends of every range.
    ///
    /// # Errors
    /// Lists all problems of the file, or those of the case with values of the variables.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        Self::parse(&Source::read(path)?, path, None)
    }

    /// Reads a text as [`Optimisation::read`] does: its files are relative to `path`; `case` takes the place of the file that it
    /// names.
    ///
    /// # Errors
    /// As [`Optimisation::read`].
    pub fn parse(source: &Source, path: &Path, case: Option<&Source>) -> Result<Self, Refusal> {
        let read = source.read_toml(source.text(), "this is not TOML", |root| read_root(root, path, case));
        source.verdict()?;
        let mut read =
            read.ok_or_else(|| Refusal(format!("{}: the optimisation could not be read", path.display())))?;
        read.check(source)?;
        read.direct = Direct::of(&read);
        Ok(read)
    }

    /// The variables.
    #[must_use]
    pub fn variables(&self) -> &[Axis] {
        &self.axes[..self.variables]
    }

    /// The axes of the band.
    #[must_use]
    pub fn band(&self) -> &[Axis] {
        &self.axes[self.variables..]
    }

    /// Points of the band.
    #[must_use]
    pub fn band_points(&self) -> usize {
        self.band().iter().map(Axis::count).product()
    }

    /// The values of the band's axes at one of its points, of which the last axis varies fastest.
    #[must_use]
    pub fn band_values(&self, point: usize) -> Vec<Value> {
        band::values_at(self.band(), point)
    }

    /// Simulations of a point.
    #[must_use]
    pub fn simulations_per_point(&self) -> usize {
        self.band_points() * self.starts.as_ref().map_or(1, |starts| starts.shares.len())
    }

    /// The case with values of the variables and of the band's axes.
    ///
    /// # Errors
    /// Names the key, its value and what is allowed.
    pub fn case_with(&self, values: &[Value]) -> Result<Case, Refusal> {
        self.varied_case().with(values)
    }

    fn varied_case(&self) -> VariedCase<'_> {
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

    /// The least and the largest value of a variable.
    #[must_use]
    pub fn range(&self, variable: usize) -> (f64, f64) {
        match self.axes[variable].values {
            Values::Drawn { from, to, .. } => (from, to),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// How far from this value a variable may be mounted, to either side, in the key's unit.
    #[must_use]
    pub fn tolerance(&self, variable: usize, value: f64) -> f64 {
        let (from, to) = self.range(variable);
        self.tolerances[variable].unwrap_or(TOLERANCE * if value == 0.0 { to - from } else { value.abs() })
    }

    /// Whether `new` is a better value of the objective than `old`.
    #[must_use]
    pub fn is_better(&self, new: f64, old: f64) -> bool {
        if self.is_maximum { new > old } else { new < old }
    }

    fn check(&self, source: &Source) -> Result<(), Refusal> {
        for corner in corners(&self.axes) {
            let case = self.varied_case().checked(source, &corner)?;
            self.check_case(&case, &corner)?;
            self.check_metrics(source, &case)?;
        }
        // The values of an axis between its ends, with the variables at their first ends.
        let first: Vec<Value> = self.axes.iter().map(|axis| axis.checked_values().swap_remove(0)).collect();
        for (place, axis) in self.axes.iter().enumerate() {
            for value in axis.checked_values() {
                let mut values = first.clone();
                values[place] = value;
                self.varied_case().checked(source, &values)?;
            }
        }
        Ok(())
    }

    fn check_case(&self, case: &Case, values: &[Value]) -> Result<(), Refusal> {
        let path = self.case_path.display();
        let text = (&*path.to_string(), self.case_text.as_str());
        case.refuse_other_engines(text, &self.varied_case().set_values(values), "an optimisation", true)?;
        if self.starts.is_some() && !case.has_particle() {
            return Err(Refusal(format!("[ensemble] is for a particle, and {path} has none\n  leave it out")));
        }
        if self.record.is_some() && case.record.is_some() {
            let why = format!("[record] counts cycles, and the base of {path} follows a record");
            return Err(Refusal(format!("{why}\n  leave it out: the whole record counts")));
        }
        Ok(())
    }

    fn check_metrics(&self, source: &Source, case: &Case) -> Result<(), Refusal> {
        let objective = (self.objective, source.locate(&[crate::input::locate::Step::Key(keys::OBJECTIVE.name())]));
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
    let case = root.text_of(&keys::CASE).and_then(|case| read_case(root, path, &case, given));
    let objective = root.word(&keys::OBJECTIVE).map(|place| METRICS[place]);
    let goal = root.word(&keys::GOAL);
    let (evaluations, seed) = (root.scalar(&keys::EVALUATIONS), root.scalar(&keys::SEED));
    let variables: Vec<Option<(Axis, Option<f64>)>> =
        root.tables_of(&keys::VARIABLE).iter().map(read_variable).collect();
    let band: Vec<Option<Axis>> = root.tables_of(&keys::AXIS).iter().map(read_axis).collect();
    let constraints: Vec<_> = root.tables_of(&keys::CONSTRAINT).iter().map(read_constraint).collect();
    let record = root.table_of(&keys::RECORD, None).map(|s| read_record(&s));
    let is_maximum = goal? == 1;
    let starts = root.table_of(&keys::ENSEMBLE, None).map(|s| read_starts(&s, is_maximum));
    let (mut axes, tolerances): (Vec<Axis>, Vec<_>) =
        variables.into_iter().collect::<Option<Vec<_>>>()?.into_iter().unzip();
    let variables = axes.len();
    let band = band.into_iter().collect::<Option<Vec<Axis>>>()?;
    axes.extend(band.iter().cloned());
    check_axes(root, &axes, variables)?;
    let (case_path, case_text) = case?;
    Some(Optimisation {
        name,
        text: root.source().text().to_string(),
        case_path,
        case_text,
        axes,
        variables,
        tolerances,
        constraint_band: Band::of_largest(&band),
        reduced_band: Band::of(band),
        record: record.unwrap_or(Some(None))?,
        starts: starts.unwrap_or(Some(None))?,
        objective: objective?,
        is_maximum,
        constraints: constraints.into_iter().collect::<Option<Vec<_>>>()?,
        evaluations: evaluations.map_or(EVALUATIONS_PER_VARIABLE * variables as u64, |count| count as u64),
        seed: seed? as u64,
        files: Arc::default(),
        direct: Direct::default(),
    })
}

/// A variable and its tolerance.
fn read_variable(s: &Section) -> Option<(Axis, Option<f64>)> {
    let key = s.text_of(&variable::KEY);
    let tolerance = s.is_given(&variable::TOLERANCE).then(|| s.scalar(&variable::TOLERANCE));
    let (from, to) = (s.placed(&variable::FROM), s.placed(&variable::TO));
    let is_log = s.word(&variable::SCALE) == Some(1);
    s.finish();
    let key = axis::checked_key(s, key?)?;
    let (from, to) = (from?, to?);
    axis::checked_range(s, &from, &to, is_log, "leave the variable out, and state it in the case")?;
    let values = Values::Drawn { from: from.value, to: to.value, is_log };
    let tolerance = match tolerance {
        Some(tolerance) => Some(tolerance?),
        None => None,
    };
    if tolerance.is_some_and(|tolerance| tolerance >= to.value - from.value) {
        let allowed = format!("must be below the range, {}", to.value - from.value);
        s.reject(variable::TOLERANCE.name(), allowed, Some("it is in the unit of the key, not in %".into()));
        return None;
    }
    let value_spans = vec![from.span, to.span];
    Some((Axis { key: key.value, values, is_log, reduce: None, span: key.span, value_spans }, tolerance))
}

fn read_axis(s: &Section) -> Option<Axis> {
    let axis = axis::read(s, false, "give `count`")?;
    if axis.reduce.is_none() {
        let help = "add reduce = \"maximum\" for the worst case over the band, or make it a [[variable]]";
        s.refuse("key", &axis.span, "has no `reduce`: the points of an axis must become one", Some(help.into()));
        return None;
    }
    Some(axis)
}

fn read_constraint(s: &Section) -> Option<Constraint> {
    let metric = s.word(&constraint::METRIC);
    let limit = s.one_of(&constraint::LIMIT);
    s.finish();
    let (place, value) = limit?;
    let limit = [Limit::AtMost, Limit::AtLeast, Limit::Equals][place](value);
    Some(Constraint { metric: METRICS[metric?], limit, span: s.span_of(constraint::METRIC.name()) })
}

fn read_starts(s: &Section, is_maximum: bool) -> Option<Option<Starts>> {
    let count = s.scalar(&ensemble::STARTS);
    let quantile = match s.written(&ensemble::OVER).map(|key| key.name) {
        None => Some(if is_maximum { 0.0 } else { 1.0 }),
        Some("over_starts") => s.word(&ensemble::OVER).map(|place| [1.0, 0.5, 0.0][place]),
        Some(_) => s.scalar(&ensemble::OVER),
    };
    s.finish();
    let last = count? - 1.0;
    let shares = (0..=last as usize).map(|n| 2.0 * (n as f64 / last) - 1.0).collect();
    Some(Some(Starts { shares, quantile: quantile? }))
}

fn check_axes(root: &Section, axes: &[Axis], variables: usize) -> Option<()> {
    if variables == 0 {
        root.source().report(Problem {
            title: "`variable` is missing".into(),
            span: root.span(),
            allowed: "an optimisation varies at least one key of its case".into(),
            help: Some("add a table [[variable]] with `key`, `from` and `to`".into()),
        });
        return None;
    }
    if variables > MAX_VARIABLES {
        root.reject(keys::VARIABLE.name(), format!("at most {MAX_VARIABLES} variables can be searched"), None);
        return None;
    }
    for (place, axis) in axes.iter().enumerate() {
        if axes[..place].iter().any(|other| other.key == axis.key) {
            root.refuse("key", &axis.span, "is varied twice", Some("leave one of the two tables out".into()));
            return None;
        }
    }
    let points = axes[variables..].iter().try_fold(1usize, |points, axis| points.checked_mul(axis.count()));
    if points.is_none_or(|points| points > 1_000_000) {
        root.reject(keys::AXIS.name(), "has more than a million points", None);
        return None;
    }
    Some(())
}
