//! Studies, optimisations and continuations, from their files or from dicts.

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use damprig::continuation::Continuation;
use damprig::failure::Failure;
use damprig::optimise::file::Optimisation;
use damprig::report::{basins_files, bifurcation_files};
use damprig::run_folder::read::parquet_file;
use damprig::simulation::{Case, SetValues};
use damprig::study::Study;
use damprig::study::axis::AxisValue;
use damprig::study::basins::{self as starts, Grid};
use damprig::study::bifurcation::{self as sweep, Direction, Sweep, SweepAxis};
use damprig::study::data_set::{DataSet, StudyManifest, TABLE};
use damprig::study::evaluate::{UNRESOLVED, main_column};
use damprig::study::given_points::GivenPoints;
use damprig::study::run::{self, StudyEnding, StudyProgress};
use damprig::study::sensitivity::SensitivityIndices;
use damprig::study::store::Store;
use damprig::study::table::StudyTable;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns::Columns;
use crate::failure::{Raised, work};
use crate::interrupt::{EVERY, Interrupt};
use crate::source::{Design, Given};

/// Does work that asks whether to go on, on a thread of its own, while this one looks for Ctrl-C: Python runs the handlers of signals in
/// its main thread alone.
fn watched<T: Send>(work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send) -> Result<T, Raised> {
    watched_and_told(|_| Ok(()), work)
}

/// As [`watched`]; meanwhile `tell` is called again and again.
fn watched_and_told<T: Send>(
    tell: impl Fn(Python<'_>) -> PyResult<()>,
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send,
) -> Result<T, Raised> {
    let (stop, mut interrupt) = (AtomicBool::new(false), Interrupt::new());
    let (ended, end) = mpsc::channel::<()>();
    let stop_at = &stop;
    let done = thread::scope(|scope| {
        let worker = scope.spawn(move || {
            // Dropped at the end of the work, by a panic too.
            let _ended = ended;
            work(&|| !stop_at.load(Ordering::Relaxed))
        });
        while end.recv_timeout(EVERY) == Err(RecvTimeoutError::Timeout) {
            interrupt.call(&tell);
            if !interrupt.goes_on() {
                stop.store(true, Ordering::Relaxed);
            }
        }
        worker.join()
    });
    interrupt.check()?;
    done.map_err(|panic| resume_unwind(panic))
}

fn opened(design: &Design, out: &Path) -> Result<(Study, DataSet), Raised> {
    let study = design.read(Study::read, Study::parse)?;
    let data_set = DataSet::open(&study, Store::at(out)?)?;
    Ok((study, data_set))
}

/// Computes what is missing of a study; `tell` gets the rows that are done and all rows.
#[pyfunction]
pub fn study_run(
    py: Python<'_>,
    study: &Bound<'_, PyAny>,
    out: PathBuf,
    tell: Option<Bound<'_, PyAny>>,
) -> PyResult<()> {
    let design = Design::of("study", study)?;
    let tell = tell.map(Bound::unbind);
    work(py, || {
        let (study, data_set) = opened(&design, &out)?;
        let (done, rows) = (AtomicU64::new(0), data_set.manifest().rows);
        let told = |py: Python<'_>| match &tell {
            Some(tell) => tell.call1(py, (done.load(Ordering::Relaxed), rows)).map(drop),
            None => Ok(()),
        };
        let ended = watched_and_told(told, |goes_on| {
            run::run(&study, &data_set, &|progress: &StudyProgress| {
                // Told by several threads: a late one does not take back what another has told.
                done.fetch_max(progress.done, Ordering::Relaxed);
                goes_on()
            })
        })??;
        match ended {
            (StudyEnding::Complete, _) => Ok(Python::attach(told)?),
            (StudyEnding::Stopped, _) => Err(Failure::stopped().into()),
        }
    })
}

/// The parts of a study that are not there, with the rows of each, and all rows of the study.
#[pyfunction]
pub fn study_missing(py: Python<'_>, study: &Bound<'_, PyAny>, out: PathBuf) -> PyResult<(Vec<(u64, u64)>, u64)> {
    let design = Design::of("study", study)?;
    work(py, || {
        let (_, data_set) = opened(&design, &out)?;
        let rows = |part: u64| {
            let rows = data_set.manifest().rows_of(part);
            (part, rows.end - rows.start)
        };
        Ok((data_set.missing()?.into_iter().map(rows).collect(), data_set.manifest().rows))
    })
}

/// The rows of a part, and the digest of the study's manifest: study, case, version and revision of damprig.
type Rows = (String, Vec<Vec<f64>>);

/// Computes a part of a study; writes nothing. `at_once` parts are computed on this machine at the same time, in as many processes: each
/// takes its share of the cores, unless `RAYON_NUM_THREADS` says how many.
#[pyfunction]
pub fn study_rows(py: Python<'_>, study: &Bound<'_, PyAny>, part: u64, at_once: usize) -> PyResult<Rows> {
    let design = Design::of("study", study)?;
    work(py, || {
        let study = design.read(Study::read, Study::parse)?;
        let manifest = StudyManifest::of(&study);
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads = if std::env::var_os("RAYON_NUM_THREADS").is_some() { 0 } else { (cores / at_once.max(1)).max(1) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| Failure::Failed(format!("cannot start {threads} threads: {error}")))?;
        let rows = watched(|goes_on| pool.install(|| run::compute(&study, manifest.rows_of(part), &|_| goes_on())))??;
        Ok((manifest.sha256.unwrap_or_default(), rows.ok_or_else(Failure::stopped)?))
    })
}

/// Writes a part that [`study_rows`] has computed, maybe elsewhere.
#[pyfunction]
pub fn study_write(py: Python<'_>, study: &Bound<'_, PyAny>, out: PathBuf, part: u64, rows: Rows) -> PyResult<()> {
    let design = Design::of("study", study)?;
    work(py, || {
        let (study, data_set) = opened(&design, &out)?;
        let (digest, rows) = rows;
        if data_set.manifest().sha256 != Some(digest) {
            let what = "a worker has another study, case, version or build of damprig";
            return Err(Failure::Input(format!("{what}: give all workers the same files and version")).into());
        }
        Ok(data_set.write_part(&study, part, &rows)?)
    })
}

/// The best point of a study: its row, the objective there, and the values of the axes.
type Best = (u64, f64, Vec<(String, Option<f64>, Option<String>)>);

/// The table of a study, the keys of its axes with whether each is logarithmic, the column of its objective, its best point, sensitivity indices as
/// JSON, and where the table is.
type Joined = (ParquetTable, Vec<(String, bool)>, String, Option<Best>, String, String);

/// Opens the joined table of a study, if it is there as it was written.
#[pyfunction]
pub fn study_open(py: Python<'_>, study: &Bound<'_, PyAny>, out: PathBuf) -> PyResult<Option<Joined>> {
    let design = Design::of("study", study)?;
    work(py, || {
        let study = design.read(Study::read, Study::parse)?;
        match DataSet::existing(&study, Store::at(&out)?)? {
            Some(data_set) if data_set.is_joined()? => Ok(Some(joined(&study, &data_set)?)),
            _ => Ok(None),
        }
    })
}

/// Joins the parts of a study.
#[pyfunction]
pub fn study_join(py: Python<'_>, study: &Bound<'_, PyAny>, out: PathBuf) -> PyResult<Joined> {
    let design = Design::of("study", study)?;
    work(py, || {
        let (study, data_set) = opened(&design, &out)?;
        data_set.join(&study, |_, _| ())?;
        Ok(joined(&study, &data_set)?)
    })
}

/// Of the joined table.
fn joined(study: &Study, data_set: &DataSet) -> Result<Joined, Failure> {
    let table = ParquetTable(data_set.table_path());
    let shown = table.0.display().to_string();
    let sensitivity = if study.sampling.is_some() {
        let bytes = data_set.store().get(TABLE)?.ok_or_else(|| Failure::Storage(format!("{shown} is missing")))?;
        SensitivityIndices::of(study, &StudyTable::read(&shown, bytes)?)
    } else {
        Vec::new()
    };
    let sensitivity = serde_json::to_string(&sensitivity).map_err(Failure::from)?;
    let objective = main_column(study, study.objective);
    let (mut progress, mut row) = (StudyProgress::none(study.rows()), 0);
    for batch in parquet_file::read_columns(&table.0, &[&objective])? {
        for value in batch?.column(0).as_primitive::<Float64Type>() {
            progress.meet(study, row, value.unwrap_or(f64::NAN));
            row += 1;
        }
    }
    let place = |row: u64| {
        let values = study.points.values(&study.axes, row, 0);
        let kept = study.points.kept().iter();
        let value = |axis: &usize| match &values[*axis] {
            AxisValue::Number(number) => (study.axes[*axis].key.clone(), Some(*number), None),
            AxisValue::Word(word) => (study.axes[*axis].key.clone(), None, Some(word.clone())),
        };
        kept.map(value).collect()
    };
    let axes =
        study.points.kept().iter().map(|axis| (study.axes[*axis].key.clone(), study.axes[*axis].is_log)).collect();
    let best = progress.best.map(|(row, value)| (row, value, place(row)));
    Ok((table, axes, objective, best, sensitivity, shown))
}

/// A table in a Parquet file, whose columns are read one by one.
#[pyclass(frozen, module = "damprig._damprig")]
pub struct ParquetTable(PathBuf);

#[pymethods]
impl ParquetTable {
    /// A file.
    #[new]
    fn new(path: PathBuf) -> Self {
        Self(path)
    }

    /// For pickle.
    fn __getnewargs__(&self) -> (PathBuf,) {
        (self.0.clone(),)
    }

    /// Its columns without rows, with their units and descriptions.
    fn head<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        work(py, || Ok(Columns::of(&[parquet_file::columns(&self.0)?])?))?.into_dict(py)
    }

    /// A column, as a table of it alone.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        let read = || Columns::of(&parquet_file::read_columns(&self.0, &[name])?.collect::<Result<Vec<_>, _>>()?);
        work(py, || Ok(read()?))?.into_dict(py)
    }
}

/// The metrics of a study at points from outside: a row for each point, a column for each metric and one for how often too many events fell
/// on one instant.
#[pyfunction]
pub fn evaluate<'py>(
    py: Python<'py>,
    study: &Bound<'py, PyAny>,
    keys: Vec<String>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let design = Design::of("evaluate", study)?;
    let points: Vec<Vec<f64>> = points.as_array().outer_iter().map(|point| point.to_vec()).collect();
    let rows = work(py, || {
        let count = points.len() as u64;
        let points = GivenPoints::new(keys, points).map_err(|why| Failure::Input(format!("points: {why}")))?;
        let Design::Texts(source, case) = &design else {
            return Err(Failure::Input("evaluate takes the keys of a study".into()).into());
        };
        let study = Study::parse_at(source, Path::new(source.name()), case.as_deref(), Some(points))?;
        if study.rows() != count {
            return Err(Failure::Input(
                "axis: every axis must have `reduce`: a point has one value of each metric".into(),
            )
            .into());
        }
        let rows = watched(|goes_on| run::compute(&study, 0..count, &|_| goes_on()))??.ok_or_else(Failure::stopped)?;
        let names = study.metrics.iter().map(|metric| main_column(&study, *metric)).chain([UNRESOLVED.into()]);
        let places: Vec<usize> = names.map(|name| run::place_of(&study, &name)).collect();
        let wanted = |row: Vec<f64>| places.iter().map(|place| row[*place]).collect::<Vec<f64>>();
        Ok(rows.into_iter().map(wanted).collect::<Vec<_>>())
    })?;
    PyArray2::from_vec2(py, &rows).map_err(|error| PyRuntimeError::new_err(error.to_string()))
}

/// A bifurcation diagram of a case: a row for each sampled cycle.
#[pyfunction]
pub fn bifurcation<'py>(
    py: Python<'py>,
    case: &Bound<'py, PyAny>,
    key: String,
    values: Vec<f64>,
    directions: Vec<String>,
    counts: (u32, u32),
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of("case", case)?;
    let columns = work(py, || {
        let name = given.name();
        let source = given.source()?;
        let (settle_cycles, cycles) = counts;
        let sweep = Sweep { key, values, settle_cycles, cycles };
        let set = SetValues { origin: "key and values".into(), lines: String::new() };
        let cases = sweep::cases(source.name(), source.text(), &name, &sweep, &set)?;
        let directions: Vec<Direction> = [Direction::Up, Direction::Down]
            .into_iter()
            .filter(|of| directions.iter().any(|name| name == of.name()))
            .collect();
        let samples = watched(|goes_on| sweep::run_all(&cases, &sweep, &directions, &|_| goes_on()))??;
        let batch = bifurcation_files::batch(&samples, &sweep.key, &cases[0]);
        Ok(Columns::of(&[batch?])?)
    })?;
    columns.into_dict(py)
}

/// Basins of attraction of a case: the table of the starts, that of the attractors, and the number of motions with instants of too many events.
#[pyfunction]
pub fn basins<'py>(
    py: Python<'py>,
    case: &Bound<'py, PyAny>,
    axes: [(String, Vec<f64>); 2],
    most_cycles: u32,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, usize)> {
    let given = Given::of("case", case)?;
    let (ends, attractors, unresolved) = work(py, || {
        let name = given.name();
        let source = given.source()?;
        let grid = Grid { axes: axes.map(|(key, values)| SweepAxis { key, values }), most_cycles };
        let set = SetValues { origin: "starts".into(), lines: String::new() };
        let texts = (source.name(), source.text(), name.as_str());
        let found =
            watched(|goes_on| starts::run(texts, &grid, &set, &|_| goes_on()))??.ok_or_else(Failure::stopped)?;
        let case = Case::parse(&source, &name)?;
        let table = |batch: Result<_, Failure>| Columns::of(&[batch?]);
        Ok((
            table(basins_files::starts(&found, &grid, &case))?,
            table(basins_files::attractors(&found, &case))?,
            found.unresolved,
        ))
    })?;
    Ok((ends.into_dict(py)?, attractors.into_dict(py)?, unresolved))
}

/// Optimises: the answer as JSON.
#[pyfunction]
pub fn optimise(py: Python<'_>, optimisation: &Bound<'_, PyAny>) -> PyResult<String> {
    let design = Design::of("optimisation", optimisation)?;
    work(py, || {
        let optimisation = design.read(Optimisation::read, Optimisation::parse)?;
        let (_, answer) = watched(|goes_on| damprig::optimise::run::run(&optimisation, &|_| goes_on()))??;
        if answer.is_stopped { Err(Failure::stopped().into()) } else { json(&answer) }
    })
}

/// Follows periodic orbits: what was found as JSON.
#[pyfunction]
pub fn continuation(py: Python<'_>, continuation: &Bound<'_, PyAny>) -> PyResult<String> {
    let design = Design::of("continuation", continuation)?;
    work(py, || {
        let continuation = design.read(Continuation::read, Continuation::parse)?;
        json(&watched(|goes_on| continuation.follow(&|_| goes_on()))??)
    })
}

fn json(answer: &impl serde::Serialize) -> Result<String, Raised> {
    Ok(serde_json::to_string(answer)?)
}
