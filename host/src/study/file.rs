//! Reads a study file: the case, its axes, and what is computed.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::axis::{self, AxisValue, StudyAxis};
use super::direct::{Direct, DirectCases};
use super::ensemble::{self, Ensemble};
use super::given_points::GivenPoints;
use super::keys::{overlay as overlay_keys, record, sampling, study as keys};
use super::metric::{self, METRICS};
use super::overlay::{self, Overlay};
use super::points::{Scattered, StudyPoints};
use super::samples;
use super::sampling::{Sampling, SamplingMethod};
use super::simulate::{Counted, SimulationRecord};
use super::varied_case::VariedCase;
use crate::failure::Failure;
use crate::input::regular::read_input;
use crate::input::section::Text;
use crate::input::{Files, Problem, Section, Source, near};
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::simulation::case::default_name;
use crate::simulation::settling;

/// What to do about a range without a `count`.
const MISSING_COUNT: &str = "give `count`, or draw from the range with a table [sampling]";

/// Least `count` of base points or trajectories: the uncertainty of indices is that of their scatter.
const MIN_FOR_INDICES: usize = 4;

/// Most points that are drawn: they are kept in memory.
const MAX_DRAWN: usize = 100_000_000;

/// A study as read.
#[derive(Clone, Debug)]
pub struct Study {
    /// Name, as figures show it.
    pub name: String,
    /// Its text.
    pub text: String,
    /// Path of the case.
    pub case_path: PathBuf,
    /// Text of the case.
    pub case_text: String,
    /// Axes in the order of the file.
    pub axes: Vec<StudyAxis>,
    /// What its points are.
    pub points: StudyPoints,
    /// How points are drawn, if they are.
    pub sampling: Option<Sampling>,
    /// What is counted; as the case's `run` says without one.
    pub record: Option<SimulationRecord>,
    /// Several starts, if any.
    pub ensemble: Option<Ensemble>,
    /// Curves over the map; they change no result.
    pub overlays: Vec<Overlay>,
    /// What is computed, in the order of the file.
    pub metrics: Vec<Quantity>,
    /// The metric whose best value is marked.
    pub objective: Quantity,
    /// The largest value is the best.
    pub is_maximum: bool,
    /// Rows of a part of the results, if the study states them.
    pub rows_per_part: Option<u64>,
    /// The files that the case names, each read once.
    pub files: Arc<Files>,
    /// SHA-256 of all that the results follow from: study, case, and the files that the case names.
    pub identity: String,
    pub(super) direct: Direct,
}

impl Study {
    /// Reads a study and its case, and checks the case at the ends of every axis.
    ///
    /// # Errors
    /// Lists all problems of the file, or those of the case with values of the axes.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::parse(&Source::read(path)?, path, None)
    }

    /// Reads a text as [`Study::read`] does: its files are relative to `path`; `case` takes the place of the file that it names.
    ///
    /// # Errors
    /// As [`Study::read`].
    pub fn parse(source: &Source, path: &Path, case: Option<&Source>) -> Result<Self, Failure> {
        Self::parse_at(source, path, case, None)
    }

    /// As [`Study::parse`]; `points` take the place of the file that it names.
    ///
    /// # Errors
    /// As [`Study::read`].
    pub fn parse_at(
        source: &Source,
        path: &Path,
        case: Option<&Source>,
        points: Option<GivenPoints>,
    ) -> Result<Self, Failure> {
        let mut study = Self::parse_unchecked(source, path, case, points)?;
        study.check(source)?;
        study.identity = study.digest();
        study.direct = Direct::of(study.varied_case(), study.samples(), |axis| study.points.reduced().contains(&axis));
        Ok(study)
    }

    /// Reads a study without checking its case and without identity, which takes seconds where the case has noise: to show what it is.
    ///
    /// # Errors
    /// Lists all problems of the file.
    pub fn read_unchecked(path: &Path) -> Result<Self, Failure> {
        Self::parse_unchecked(&Source::read(path)?, path, None, None)
    }

    fn parse_unchecked(
        source: &Source,
        path: &Path,
        case: Option<&Source>,
        points: Option<GivenPoints>,
    ) -> Result<Self, Failure> {
        let study = source.read_toml(source.text(), "this is not TOML", |root| read_root(root, path, case, points));
        source.verdict()?;
        study.ok_or_else(|| Failure::Input(format!("{}: the study could not be read", path.display())))
    }

    /// Rows of the table.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.points.rows(&self.axes).unwrap_or(u64::MAX)
    }

    /// Simulations behind each row.
    #[must_use]
    pub fn simulations_per_row(&self) -> u64 {
        let starts = self.ensemble.as_ref().map_or(1, |ensemble| ensemble.shares.len()) as u64;
        self.points.points_per_row(&self.axes).unwrap_or(u64::MAX).saturating_mul(starts)
    }

    /// The case with values of the axes.
    ///
    /// # Errors
    /// Names the key, its value and what is allowed.
    pub fn case_with(&self, values: &[AxisValue]) -> Result<Case, Failure> {
        self.varied_case().with(values)
    }

    /// The cases of a row.
    ///
    /// # Errors
    /// As [`Self::case_with`].
    pub fn cases(&self, row: u64) -> Result<DirectCases<'_>, Failure> {
        self.direct.at(self.varied_case(), &self.points.values(&self.axes, row, 0))
    }

    fn varied_case(&self) -> VariedCase<'_> {
        VariedCase {
            path: &self.case_path,
            text: &self.case_text,
            files: &self.files,
            axes: &self.axes,
            origin: "the axes of the study",
        }
    }

    /// A warning if the structure's free vibration is not decayed when the counted cycles begin, for the corner of the axes where most of it
    /// is left.
    ///
    /// # Errors
    /// As [`Self::case_with`].
    pub fn settling(&self) -> Result<Option<String>, Failure> {
        let mut worst: Option<(f64, Option<String>)> = None;
        for values in self.samples() {
            let case = self.case_with(&values)?;
            let counted = Counted::of(&case, self.record);
            let structure = &case.set_up.structure;
            let decays = structure.damping_ratio()
                * structure.angular_frequency_rad_per_s()
                * counted.first_cycle
                * counted.cycle_s;
            let key = if self.record.is_some() { "settle_cycles" } else { "steady_from_cycle" };
            let text = settling::warning(&case, key, counted.first_cycle, [counted.cycle_s, counted.end_s]);
            if text.is_some() && worst.as_ref().is_none_or(|(least, _)| decays < *least) {
                worst = Some((decays, text));
            }
        }
        Ok(worst.and_then(|(_, text)| text))
    }

    /// Whether `new` is a better value of the objective than `old`.
    #[must_use]
    pub fn is_better(&self, new: f64, old: f64) -> bool {
        if self.is_maximum { new > old } else { new < old }
    }

    fn samples(&self) -> Vec<Vec<AxisValue>> {
        samples::of(&self.axes, &self.points)
    }

    /// Checks the corners of the grid, and each value of each axis with the first values of the others.
    fn check(&self, source: &Source) -> Result<(), Failure> {
        let samples = self.samples();
        self.check_metrics(source, &samples[0])?;
        samples.iter().try_for_each(|values| self.check_at(source, values))?;
        samples::each_alone(&self.axes, &samples[0]).iter().try_for_each(|values| self.check_at(source, values))
    }

    fn check_at(&self, source: &Source, values: &[AxisValue]) -> Result<(), Failure> {
        let case = self.varied_case().checked(source, values)?;
        if self.ensemble.is_some() && !case.has_particle() {
            return Err(Failure::Input(format!(
                "[ensemble] is for a particle, and {} has none\n  leave it out",
                self.case_path.display()
            )));
        }
        if self.record.is_some() && case.record.is_some() {
            return Err(Failure::Input(format!(
                "[record] counts cycles, and the base of {} follows a record\n  leave it out: the whole record counts",
                self.case_path.display()
            )));
        }
        Ok(())
    }

    fn check_metrics(&self, source: &Source, values: &[AxisValue]) -> Result<(), Failure> {
        let case = self.varied_case().checked(source, values)?;
        for metric in &self.metrics {
            if let Some(why) = metric::refusal(*metric, &case) {
                source.report(Problem {
                    title: format!("the metric {:?} does not go with this case", metric.name()),
                    span: source
                        .locate(&[crate::input::locate::PathStep::Key(keys::METRICS.name())])
                        .unwrap_or_default(),
                    allowed: why.into(),
                    help: None,
                });
            }
        }
        source.verdict()
    }

    fn digest(&self) -> String {
        let mut digest = Sha256::new();
        for part in [super::data_set::FORMAT, crate::VERSION_LINE, &self.text, &self.case_text] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        if let Some(rows) = self.points.given() {
            digest.update((rows.len() as u64).to_le_bytes());
            self.axes.iter().for_each(|axis| digest.update(&axis.key));
            rows.iter().flatten().for_each(|value| digest.update(value.to_le_bytes()));
        }
        // The other files that the case names. Only words name files, so every combination of them is read; one that is refused here is
        // refused at its point.
        for values in samples::combinations_of_words(&self.axes, &self.samples()[0]) {
            let _ = self.case_with(&values);
        }
        let folder = self.case_path.parent().unwrap_or(Path::new(""));
        for (path, content) in self.files.digests() {
            // As the case names it: the same study in another folder is the same.
            let name = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned();
            digest.update((name.len() as u64).to_le_bytes());
            digest.update(&name);
            digest.update(content);
        }
        digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

fn read_root(root: &Section, path: &Path, given: Option<&Source>, points: Option<GivenPoints>) -> Option<Study> {
    let name = root.text_of(&keys::NAME).map_or_else(|| default_name(path), |text| text.value);
    let case = root.text_of(&keys::CASE).and_then(|case| read_case(root, path, &case, given));
    let metrics = read_metrics(root);
    let objective = root.word(&keys::OBJECTIVE).map(|place| METRICS[place]);
    let goal = root.word(&keys::GOAL);
    let rows_per_part = root.scalar(&keys::PART);
    let points = match (root.text_of(&keys::POINTS), points) {
        (None, points) => Some(points),
        (Some(_), Some(points)) => Some(Some(points)),
        (Some(named), None) => read_points(root, path, &named).map(Some),
    };
    let sampling_section = root.table_of(&keys::SAMPLING, None);
    let sampling = sampling_section.as_ref().and_then(read_sampling);
    let has_points = points.as_ref().is_none_or(Option::is_some);
    let missing_count = if has_points { "give `count`" } else { MISSING_COUNT };
    let axes: Vec<Option<StudyAxis>> =
        root.tables_of(&keys::AXIS).iter().map(|s| axis::read(s, sampling_section.is_some(), missing_count)).collect();
    let record = root.table_of(&keys::RECORD, None).map(|s| read_record(&s));
    let ensemble = root.table_of(&keys::ENSEMBLE, None).map(|s| ensemble::read(&s, goal == Some(1)));
    let overlays: Vec<Option<(Text, Overlay)>> =
        root.tables_of(&keys::OVERLAY).iter().map(|s| overlay::read(s, path)).collect();
    let points = points?;
    let mut all = points.as_ref().map_or_else(Vec::new, |points| points.axes(&root.span_of(keys::POINTS.name())));
    all.extend(axes.into_iter().collect::<Option<Vec<StudyAxis>>>()?);
    let axes = all;
    if !check_axes(root, &axes, sampling) {
        return None;
    }
    let (metrics, (case_path, case_text)) = (metrics?, case?);
    let overlays = overlays.into_iter().collect::<Option<Vec<_>>>()?;
    for (named, overlay) in &overlays {
        if let Some((what, help)) = overlay.mismatch(&axes, &case_path, &case_text) {
            root.refuse(overlay_keys::CONTINUATION.name(), &named.span, what, Some(help));
        }
    }
    let objective = objective.or(metrics.first().copied())?;
    if !metrics.contains(&objective) {
        let help = Some(format!("add {:?} to `metrics`", objective.name()));
        root.reject(keys::OBJECTIVE.name(), "must be one of the metrics", help);
    }
    let scattered = points.map(Scattered::Given).or(sampling.map(Scattered::Drawn));
    let points = StudyPoints::new(&axes, scattered);
    if points.rows(&axes).is_none() || points.points_per_row(&axes).is_none() {
        root.reject(keys::AXIS.name(), "has more points than a program can count", None);
    }
    Some(Study {
        name,
        text: root.source().text().to_string(),
        case_path,
        case_text,
        points,
        sampling,
        axes,
        record: record.unwrap_or(Some(None))?,
        ensemble: ensemble.unwrap_or(Some(None))?,
        overlays: overlays.into_iter().map(|(_, overlay)| overlay).collect(),
        metrics,
        objective,
        is_maximum: goal? == 1,
        rows_per_part: rows_per_part.map(|rows| rows as u64),
        files: Arc::default(),
        identity: String::new(),
        direct: Direct::default(),
    })
}

/// Reads the file of points that the study at `path` names.
fn read_points(root: &Section, path: &Path, named: &Text) -> Option<GivenPoints> {
    let file = path.parent().unwrap_or(Path::new("")).join(&named.value);
    match GivenPoints::of_csv(read_input(&file)) {
        Ok(points) => Some(points),
        Err(why) => {
            let allowed = format!("must name a file of points: {}: {why}", file.display());
            root.refuse(keys::POINTS.name(), &named.span, allowed, None);
            None
        }
    }
}

/// Path and text of the case that the file at `path` names, or of the one that is `given` in its place.
pub(crate) fn read_case(root: &Section, path: &Path, case: &Text, given: Option<&Source>) -> Option<(PathBuf, String)> {
    if let Some(given) = given {
        return Some((given.name().into(), given.text().to_string()));
    }
    let case_path = path.parent().unwrap_or(Path::new("")).join(&case.value);
    match Source::read(&case_path) {
        Ok(source) => Some((case_path, source.text().to_string())),
        Err(error) => {
            let help = "write the path of a case relative to this file".to_string();
            root.refuse("case", &case.span, error.to_string().replace('\n', ";"), Some(help));
            None
        }
    }
}

fn read_metrics(root: &Section) -> Option<Vec<Quantity>> {
    let texts = root.texts_of(&keys::METRICS)?;
    let mut metrics = Vec::new();
    for text in &texts {
        let Some(metric) = METRICS.into_iter().find(|metric| metric.name() == text.value) else {
            let names = METRICS.map(Quantity::name);
            let help = near(&text.value, names).first().map(|name| format!("did you mean {name:?}?"));
            root.refuse(keys::METRICS.name(), &text.span, format!("must be of {}", names.join(", ")), help);
            return None;
        };
        if metrics.contains(&metric) {
            root.refuse(keys::METRICS.name(), &text.span, "is named twice", None);
            return None;
        }
        metrics.push(metric);
    }
    if metrics.is_empty() {
        root.reject(keys::METRICS.name(), "must name at least one metric", None);
        return None;
    }
    Some(metrics)
}

/// Reports what is wrong with the axes together; answers whether points can be drawn.
fn check_axes(root: &Section, axes: &[StudyAxis], sampling: Option<Sampling>) -> bool {
    if axes.is_empty() {
        root.source().report(Problem {
            title: "`axis` is missing".into(),
            span: root.span(),
            allowed: "a study varies at least one key of its case".into(),
            help: Some("add a table [[axis]] with `key` and `values`, or `points` with a file".into()),
        });
    }
    for (place, axis) in axes.iter().enumerate() {
        if axes[..place].iter().any(|other| other.key == axis.key) {
            root.refuse(keys::AXIS.name(), &axis.span, "two axes have this key", Some("leave one out".into()));
        }
    }
    if sampling.is_some() && !axes.iter().any(StudyAxis::is_scattered) {
        let help = "leave out the `count` of the axes that are to be drawn from, or this table";
        root.reject(keys::SAMPLING.name(), "there is no range to draw from", Some(help.into()));
        return false;
    }
    let Some(sampling) = sampling else { return true };
    let (ranges, name) = (axes.iter().filter(|axis| axis.is_scattered()).count(), sampling.method.name());
    let is_grid = |axis: &&StudyAxis| sampling.method.is_for_indices() && !axis.is_scattered() && axis.reduce.is_none();
    if let Some(axis) = axes.iter().find(is_grid) {
        let allowed = format!("has listed values, and method = {name:?} draws every axis");
        let help = "give `from` and `to` without `count`, add `reduce`, or make a study of each value";
        root.refuse(keys::AXIS.name(), &axis.span, allowed, Some(help.into()));
        return false;
    }
    if ranges > sampling.method.most_ranges() {
        let allowed = format!("has {ranges} ranges; at most {} with method = {name:?}", sampling.method.most_ranges());
        root.reject(keys::AXIS.name(), allowed, None);
        return false;
    }
    let is_too_many = sampling.points(ranges).is_none_or(|points| points > MAX_DRAWN);
    if is_too_many {
        let allowed = format!("draws more than {MAX_DRAWN:e} points from {ranges} ranges with method = {name:?}");
        root.reject(keys::SAMPLING.name(), allowed, Some("make `count` smaller".into()));
    }
    !is_too_many
}

fn read_sampling(s: &Section) -> Option<Sampling> {
    let method = s.word(&sampling::METHOD);
    let count = s.scalar(&sampling::COUNT);
    let seed = s.scalar(&sampling::SEED);
    s.finish();
    let (method, count) = (SamplingMethod::ALL[method?], count? as usize);
    if method.is_for_indices() && count < MIN_FOR_INDICES {
        let allowed = format!("must be at least {MIN_FOR_INDICES} with method = {:?}", method.name());
        s.reject(
            sampling::COUNT.name(),
            allowed,
            Some("a power of two, as 512, for sobol_indices; 20 for morris".into()),
        );
        return None;
    }
    Some(Sampling { method, count, seed: seed.unwrap_or(1.0) as u64 })
}

/// Reads `[record]`.
pub(crate) fn read_record(s: &Section) -> Option<Option<SimulationRecord>> {
    let length = s.one_of(&record::LENGTH);
    let settle = s.one_of(&record::SETTLE);
    s.finish();
    let (length, settle) = (length?, settle?);
    Some(Some(SimulationRecord {
        cycles: (length.0 == 0).then_some(length.1),
        duration_s: (length.0 == 1).then_some(length.1),
        settle_cycles: if settle.0 == 0 { settle.1 } else { 0.0 },
        settle_s: if settle.0 == 1 { settle.1 } else { 0.0 },
    }))
}
