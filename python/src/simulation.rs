//! Simulates a case and hands its motion over as arrays.

use damprig::failure::Failure;
use damprig::input::Source;
use damprig::simulation::{
    AccumulationRecord, Case, ImpactRecord, RunOptions, SetValues, SimulationResult, Viewer,
    analysis::{Analysis, WrittenCase},
    cost,
    motion::{ContactRecord, Piece},
    simulate as run,
};
use damprig_core::integrator::exact::Observer;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{Raised, work};
use crate::interrupt::Interrupt;
use crate::source::Given;

/// Most rows of a motion: 2 GB.
const MAX_ROWS: f64 = 4e7;

/// The times at which the motion is kept.
enum Times {
    Given(Vec<f64>),
    /// Rows per second, from 0 to the end.
    Rate(f64),
}

impl Times {
    fn at(&self, row: usize) -> Option<f64> {
        match self {
            Self::Given(times_s) => times_s.get(row).copied(),
            Self::Rate(rate_hz) => Some(row as f64 / rate_hz),
        }
    }
}

/// Keeps the motion at given times.
struct Motion {
    times: Times,
    duration_s: f64,
    t_s: Vec<f64>,
    /// x, v, y, u and z.
    columns: [Vec<f64>; 5],
}

impl Motion {
    fn new(times: Times, duration_s: f64) -> Self {
        Self { times, duration_s, t_s: Vec::new(), columns: Default::default() }
    }
}

impl Viewer for Motion {
    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let end_s = start_s + length_s;
        // The sum of the pieces' lengths may be short of the duration by rounding, which must not lose a row.
        let rounding_s = 1e-12 * self.duration_s;
        let is_last = end_s + rounding_s >= self.duration_s;
        while let Some(t_s) = self.times.at(self.t_s.len()) {
            let rounding_s = if is_last { 2.0 * rounding_s } else { 0.0 };
            if t_s - start_s > length_s + rounding_s {
                return;
            }
            let at = piece.at((t_s - start_s).clamp(0.0, length_s));
            let row = [at.state.x_m, at.state.v_m_per_s, at.state.y_m(), at.state.u_m_per_s(), at.z_m];
            self.t_s.push(t_s);
            self.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
    }
}

/// Reads the case with values that are set from outside; also its text, which has the warnings of unusual values.
fn read(given: Given, set: &SetValues) -> Result<(Case, Source), Raised> {
    let name = given.name();
    let source = given.source()?;
    Ok((Case::parse_changed(&source, &name, set)?, source))
}

/// The times that are wanted: given ones, a rate, those of the case, or the usual rate.
fn times(case: &Case, times_s: Option<Vec<f64>>, rate_hz: Option<f64>) -> Result<Times, Raised> {
    let duration_s = case.run.duration_s;
    if let Some(times_s) = times_s {
        let is_allowed =
            |i: usize, t_s: f64| (0.0..=duration_s * (1.0 + 1e-12)).contains(&t_s) && (i == 0 || times_s[i - 1] <= t_s);
        if let Some((i, t_s)) = times_s.iter().enumerate().find(|(i, t_s)| !is_allowed(*i, **t_s)) {
            let allowed = format!("must be in rising order, from 0 to duration_s = {duration_s}");
            return Err(Failure::Input(format!("sample_times[{i}] = {t_s} is not allowed: {allowed}")).into());
        }
        return Ok(Times::Given(times_s));
    }
    let rate_hz = match rate_hz {
        Some(rate_hz) if rate_hz > 0.0 && rate_hz.is_finite() => rate_hz,
        Some(rate_hz) => {
            return Err(Failure::Input(format!("rate_hz = {rate_hz} is not allowed: must be above 0")).into());
        }
        None if !case.run.sample_times_s.is_empty() => return Ok(Times::Given(case.run.sample_times_s.clone())),
        None => case.usual_rate_hz(),
    };
    let rows = duration_s * rate_hz;
    if rows > MAX_ROWS {
        return Err(Failure::Input(format!(
            "rate_hz = {rate_hz} over duration_s = {duration_s} gives {rows:.3e} rows: must be {MAX_ROWS:.0e} or fewer; \
             lower rate_hz, or let `damprig simulate --out` write a file"
        )).into());
    }
    Ok(Times::Rate(rate_hz))
}

/// Lets an analysis end at Ctrl-C.
struct Watch(Interrupt);

impl Observer for Watch {
    const ARCS: bool = false;

    fn goes_on(&mut self, _: f64) -> bool {
        self.0.goes_on()
    }
}

/// Energy balance, steady state, periodic orbit and sensitivities of a case, as JSON; also the warnings of unusual values.
#[pyfunction]
pub fn analyse(py: Python<'_>, case: &Bound<'_, PyAny>) -> PyResult<(Vec<String>, String)> {
    let given = Given::of("case", case)?;
    work(py, || {
        let (case, source) = read(given, &SetValues::default())?;
        let text = (source.name(), source.text());
        case.refuse_other_engines(text, &SetValues::default(), "analyse", true)?;
        let mut watch = Watch(Interrupt::new());
        let written = WrittenCase { name: source.name(), text: source.text(), values: &SetValues::default() };
        let analysis = Analysis::complete(&case, &written, &mut watch);
        watch.0.check()?;
        let text = serde_json::to_string(&analysis)?;
        Ok((source.warnings(), text))
    })
}

/// A simulated case.
struct Simulated {
    case: Case,
    warnings: Vec<String>,
    motion: Motion,
    result: SimulationResult,
}

fn simulated(
    given: Given,
    set: &[String],
    times_s: Option<Vec<f64>>,
    rate_hz: Option<f64>,
) -> Result<Simulated, Raised> {
    let (mut case, source) = read(given, &SetValues::of("set", set)?)?;
    let times = times(&case, times_s, rate_hz)?;
    let rate_hz = if let Times::Rate(rate_hz) = times { Some(rate_hz) } else { None };
    // The states are kept here.
    case.run.sample_times_s.clear();
    let mut motion = Motion::new(times, case.run.duration_s);
    let mut interrupt = Interrupt::new();
    let longest_part_s = cost::longest_part_s(&case, rate_hz)?;
    let options = RunOptions { keep: true, longest_part_s, go_on: &mut |_| interrupt.goes_on() };
    let result = run(&case, &mut motion, options)?;
    interrupt.check()?;
    Ok(Simulated { case, warnings: source.warnings(), motion, result })
}

/// Simulates a case: `case` is a path or a dict, `set` has texts `key=value`.
#[pyfunction]
#[pyo3(signature = (case, set, times_s, rate_hz))]
pub fn simulate<'py>(
    py: Python<'py>,
    case: &Bound<'py, PyAny>,
    set: Vec<String>,
    times_s: Option<Vec<f64>>,
    rate_hz: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of("case", case)?;
    let done = work(py, || simulated(given, &set, times_s, rate_hz))?;
    let dict = PyDict::new(py);
    dict.set_item("name", &done.case.name)?;
    dict.set_item("warnings", done.warnings)?;
    dict.set_item("time", done.motion.t_s.into_pyarray(py))?;
    for (name, column) in ["x", "v", "y", "u", "z"].into_iter().zip(done.motion.columns) {
        dict.set_item(name, column.into_pyarray(py))?;
    }
    dict.set_item("impacts", impacts(py, &done.result.impacts)?)?;
    dict.set_item("contacts", contacts(py, &done.result.contacts)?)?;
    dict.set_item("accumulations", accumulations(py, &done.result.accumulations)?)?;
    dict.set_item("summary", json(&done.result.summary)?)?;
    dict.set_item("several_places", json(&done.result.multi_degree)?)?;
    dict.set_item("parameters", parameters(&done.case)?)?;
    Ok(dict)
}

fn impacts<'py>(py: Python<'py>, impacts: &[ImpactRecord]) -> PyResult<Bound<'py, PyDict>> {
    let column = |value: fn(&ImpactRecord) -> f64| impacts.iter().map(value).collect::<Vec<f64>>().into_pyarray(py);
    let dict = PyDict::new(py);
    dict.set_item("time", column(|impact| impact.t_s))?;
    dict.set_item("side", impacts.iter().map(|impact| impact.side).collect::<Vec<i8>>().into_pyarray(py))?;
    dict.set_item("approach_speed", column(|impact| impact.approach_speed_m_per_s))?;
    dict.set_item("y", column(|impact| impact.y_m))?;
    dict.set_item("damper", dampers(impacts.iter().map(|impact| impact.damper)).into_pyarray(py))?;
    Ok(dict)
}

/// The numbers of impact dampers, from 1.
fn dampers(all: impl Iterator<Item = Option<u32>>) -> Vec<u32> {
    all.map(|damper| damper.unwrap_or(1)).collect()
}

fn contacts<'py>(py: Python<'py>, contacts: &[ContactRecord]) -> PyResult<Bound<'py, PyDict>> {
    let column = |value: fn(&ContactRecord) -> f64| contacts.iter().map(value).collect::<Vec<f64>>().into_pyarray(py);
    let dict = PyDict::new(py);
    dict.set_item("time", column(|contact| contact.t_s))?;
    dict.set_item("side", contacts.iter().map(|contact| contact.side).collect::<Vec<i8>>().into_pyarray(py))?;
    dict.set_item("approach_speed", column(|contact| contact.approach_speed_m_per_s))?;
    dict.set_item("duration", column(|contact| contact.duration_s))?;
    dict.set_item("peak_force", column(|contact| contact.peak_force_n))?;
    dict.set_item("restitution", column(|contact| contact.restitution.unwrap_or(f64::NAN)))?;
    dict.set_item("damper", dampers(contacts.iter().map(|contact| contact.damper)).into_pyarray(py))?;
    Ok(dict)
}

fn accumulations<'py>(py: Python<'py>, all: &[AccumulationRecord]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("time", all.iter().map(|it| it.t_s).collect::<Vec<f64>>().into_pyarray(py))?;
    dict.set_item("side", all.iter().map(|it| it.side).collect::<Vec<i8>>().into_pyarray(py))?;
    Ok(dict)
}

/// The set-up as the integrator has it, in SI units.
fn parameters(case: &Case) -> PyResult<String> {
    json(&serde_json::json!({
        "set_up": case.set_up,
        "natural_frequency_hz": 1.0 / case.natural_period_s(),
        "duration_s": case.run.duration_s,
        "cycle_s": case.cycle_s(),
        "reference_m": case.reference_m().map(|(reference_m, _)| reference_m),
    }))
}

fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))
}
