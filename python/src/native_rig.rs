//! The virtual rig: the controller's code and a simulated plant in this process, driven by campaigns or tick by tick.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use damprig::campaign::{Campaign, CampaignSetUp};
use damprig::client::link::VirtualRig;
use damprig::client::session::{DeviceReport, Session};
use damprig::failure::Failure;
use damprig::host_time;
use damprig::input::Source;
use damprig::prediction::CampaignPrediction;
use damprig::recorded_run::{RecordedRun, RunStart, begin_entry};
use damprig::run_folder::ResultRow;
use damprig::run_folder::journal::JournalEntry;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::schema::results;
use damprig::run_folder::schema::transients::{self, TransientRow};
use damprig::run_folder::write::OutputFolder;
use damprig::run_folder::write::recorder::{PointRows, Recording};
use damprig::runner::rehearsal::accept;
use damprig::runner::{Run, RunError, Selection, Watcher};
use damprig_core::control::fault::Fault;
use damprig_core::io::TICK_HZ;
use damprig_core::rig::Status;
use damprig_core::settings::Settings;
use damprig_protocol::{Event, Request, Telemetry};
use damprig_simulator::messages::ToSimulator;
use damprig_simulator::plant::InjectedFault;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};

use crate::columns::Columns;
use crate::failure::{Raised, work};
use crate::interrupt::Interrupt;
use crate::source::Given;

/// Time without a message after which the session counts as lost; in one process it never is.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Most ticks between two looks for Ctrl-C.
const TICKS_PER_LOOK: u32 = 1000;

/// The rig with its session.
struct Bench {
    session: Session,
    is_emergency_stop_pressed: bool,
    /// Places in the signal table of the values in a row.
    places: Vec<usize>,
    /// What has arrived since the last report to Python.
    ticks: Vec<u32>,
    rows: Vec<Vec<f32>>,
    events: Vec<Value>,
    /// Of the campaigns since Python asked for them.
    warnings: Vec<String>,
}

impl Bench {
    fn new(settings: Option<&Settings>, single: bool) -> Result<Self, Raised> {
        let session = Session::over(Box::new(VirtualRig::new(single, settings)), "virtual".into(), TIMEOUT)?;
        Ok(Self {
            session,
            is_emergency_stop_pressed: false,
            places: Vec::new(),
            ticks: Vec::new(),
            rows: Vec::new(),
            events: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// A campaign that this rig accepts, with its predictions. Keeps the warnings.
    fn prepared(&mut self, source: Source) -> Result<Prepared, Raised> {
        if self.is_emergency_stop_pressed {
            return Err(
                Failure::Failed("the emergency stop is pressed: release it, then clear the fault".into()).into()
            );
        }
        let mut campaign = Campaign::parse(source)?;
        self.warnings.extend(campaign.source.warnings());
        let (selection, warnings) = accept(&mut campaign, &self.session)?;
        self.warnings.extend(warnings);
        let predicted = CampaignPrediction::of(&campaign)?;
        let drive_m = f64::from(self.session.settings.calibration.drive.range().amplitude_m());
        self.warnings.extend(predicted.check(&campaign, drive_m)?);
        Ok(Prepared { campaign, selection, predicted })
    }

    /// Runs a campaign without a folder.
    fn measure(&mut self, source: Source) -> Result<Measured, Raised> {
        let Prepared { campaign, selection, .. } = self.prepared(source)?;
        let stop = AtomicBool::new(false);
        let mut watch = Watch::new(&stop);
        let (mut nowhere, journal) = (Unrecorded, JournalState::default());
        let run = Run::new(&campaign, &mut self.session, &mut nowhere, &mut watch, &stop, selection, journal);
        let (_, result) = run.carry_out();
        let Watch { interrupt, points, transients, .. } = watch;
        interrupt.check()?;
        result?;
        let table = |made: Result<_, Failure>| Columns::of(&[made?]);
        Ok(Measured { points: table(results::table(&points))?, transients: table(transients::table(&transients))? })
    }

    /// Runs a campaign into a folder; returns where it is.
    fn run(&mut self, source: Source, out: Option<&Path>) -> Result<PathBuf, Raised> {
        let Prepared { campaign, selection, predicted } = self.prepared(source)?;
        let now = host_time::now();
        let folder = match out {
            Some(path) => OutputFolder::create_at(path),
            None => OutputFolder::create_dated(Path::new("."), &campaign.name, &now),
        }?;
        let journal = folder.keep_campaign(&campaign)?;
        let begin = begin_entry(&campaign, &self.session, &selection, folder.records(&campaign)?, &now);
        let (taken, withdrawn) = (JournalState::default(), Vec::new());
        let start = RunStart { begin, journal, taken, withdrawn, waits_for_room: true };
        let mut recorded = RecordedRun::begin(&campaign, &predicted, &folder, start)?;
        let (stop, taken) = (AtomicBool::new(false), recorded.taken().clone());
        let mut watch = Watch::new(&stop);
        let recorder = &mut recorded.recorder;
        let run = Run::new(&campaign, &mut self.session, recorder, &mut watch, &stop, selection, taken);
        let (tally, result) = run.carry_out();
        let Some(ended) = recorded.end(tally, result) else {
            return Err(Failure::Storage("the recorder thread has stopped; the run is incomplete".into()).into());
        };
        watch.interrupt.check()?;
        ended.result?;
        ended.written?;
        ended.drawn?;
        Ok(folder.path().to_path_buf())
    }

    /// Starts the campaign's first experiment on its first set-up; [`Bench::advance`] follows it.
    fn start(&mut self, source: Source) -> Result<(), Raised> {
        let Prepared { campaign, selection, .. } = self.prepared(source)?;
        let stop = AtomicBool::new(false);
        let mut watch = Watch::new(&stop);
        let (mut nowhere, journal) = (Unrecorded, JournalState::default());
        let run = Run::new(&campaign, &mut self.session, &mut nowhere, &mut watch, &stop, selection, journal);
        let started = run.start_experiment(&campaign.set_ups[0], &campaign.experiments[0]);
        watch.interrupt.check()?;
        self.places = started?;
        self.ticks.clear();
        self.events.clear();
        self.rows = vec![Vec::new(); self.places.len()];
        Ok(())
    }

    /// Lets ticks pass and keeps what the controller sends.
    fn advance(&mut self, ticks: u32) -> Result<(), Raised> {
        let mut interrupt = Interrupt::new();
        let mut left = ticks;
        while left > 0 && interrupt.goes_on() {
            let part = left.min(TICKS_PER_LOOK);
            self.session.advance(part)?;
            left -= part;
            self.take_reports();
        }
        interrupt.check()
    }

    fn take_reports(&mut self) {
        while let Some(report) = self.session.report_at_hand() {
            match report {
                DeviceReport::Telemetry(message) => self.take_rows(&message),
                DeviceReport::Event { tick, event } => self.events.push(described(tick, &event)),
            }
        }
    }

    fn take_rows(&mut self, message: &Telemetry) {
        let width = usize::from(message.width);
        if width != self.rows.len() || width == 0 {
            // Of an experiment before.
            return;
        }
        let mut tick = message.first_tick;
        for row in message.values.chunks_exact(width) {
            self.ticks.push(tick);
            self.rows.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
            tick = tick.saturating_add(u32::from(message.every_ticks));
        }
    }

    /// Presses or releases the emergency stop.
    fn emergency_stop(&mut self, pressed: bool) -> Result<(), Raised> {
        let message = ToSimulator::Inject(InjectedFault::EmergencyStop { pressed });
        self.session.execute("press or release the emergency stop", message.request())?;
        self.is_emergency_stop_pressed = pressed;
        Ok(())
    }

    /// Stops, waits for rest and clears a fault.
    fn rest(&mut self) -> Result<(), Raised> {
        if self.is_emergency_stop_pressed {
            return Err(
                Failure::Failed("the emergency stop is pressed: release it, then clear the fault".into()).into()
            );
        }
        self.session.bring_to_idle(|_| (), &AtomicBool::new(false))?;
        self.take_reports();
        Ok(())
    }
}

/// A campaign ready to run.
struct Prepared {
    campaign: Campaign,
    selection: Selection,
    predicted: CampaignPrediction,
}

/// The results of a campaign without a folder.
struct Measured {
    points: Columns,
    transients: Columns,
}

/// Keeps the results of a run, and stops it at Ctrl-C.
struct Watch<'a> {
    stop: &'a AtomicBool,
    interrupt: Interrupt,
    points: Vec<ResultRow>,
    transients: Vec<TransientRow>,
}

impl<'a> Watch<'a> {
    fn new(stop: &'a AtomicBool) -> Self {
        Self { stop, interrupt: Interrupt::new(), points: Vec::new(), transients: Vec::new() }
    }
}

impl Watcher for Watch<'_> {
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<bool, RunError> {
        Ok(false)
    }

    fn progress(&mut self, _: f64) {
        if !self.interrupt.goes_on() {
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    fn point(&mut self, row: &ResultRow) {
        self.points.push(row.clone());
    }

    fn transient(&mut self, row: &TransientRow) {
        self.transients.push(row.clone());
    }

    fn link(&mut self, _: &str) {}
}

/// A run without a folder.
struct Unrecorded;

impl Recording for Unrecorded {
    fn check(&self) -> Result<(), Failure> {
        Ok(())
    }

    fn note(&self, _: JournalEntry) {}

    fn rows(&mut self, _: PointRows, _: &AtomicBool) {}

    fn dropped_rows(&self) -> u64 {
        0
    }
}

/// An event as a dict: its kind, tick and time, and its own values.
fn described(tick: u32, event: &Event) -> Value {
    let (kind, values) = match event {
        Event::Point(result) => ("point", json!(result)),
        Event::Finished { points, rows_dropped } => {
            ("finished", json!({"points": points, "rows_dropped": rows_dropped}))
        }
        Event::Fault(fault) => ("fault", described_fault(fault)),
        Event::Spring(happening) => ("spring", json!({"what": happening})),
        Event::Impact(impact) => ("impact", json!(impact)),
        Event::Transient(result) => ("transient", json!(result)),
    };
    let mut all = json!({"event": kind, "tick": tick, "time": time_s(tick)});
    if let (Value::Object(all), Value::Object(values)) = (&mut all, values) {
        for (key, value) in values {
            all.entry(key).or_insert(value);
        }
    }
    all
}

fn described_fault(fault: &Fault) -> Value {
    json!({"cause": fault.cause.text(), "tick": fault.tick, "value": fault.value, "limit": fault.limit})
}

fn described_status(status: &Status) -> Value {
    let spring = &status.spring;
    json!({
        "state": status.state.text(),
        "tick": status.tick,
        "time": status.time_s(),
        "points": status.points,
        "fault": status.fault.as_ref().map(described_fault),
        "safety": status.safe.text(),
        "lost_sensors": status.sensors.lost.to_string(),
        "spring": {
            "stage": spring.stage.text(),
            "position_m": spring.position_m,
            "force_n": spring.force_n,
            "target_force_n": spring.target_force_n,
            "fault": spring.fault.as_ref().map(described_fault),
        },
    })
}

fn time_s(tick: u32) -> f64 {
    f64::from(tick) / f64::from(TICK_HZ)
}

/// The rig as Python sees it. Calls from several threads wait for each other.
#[pyclass(frozen, module = "damprig._damprig")]
pub struct NativeRig(Mutex<Bench>);

impl NativeRig {
    /// A panic is an error for its caller; the session is used as it is.
    fn bench(&self) -> MutexGuard<'_, Bench> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl NativeRig {
    /// A rig with these settings (a path or a dict), or as delivered; in single precision as on the board, or in double.
    #[new]
    fn new(py: Python<'_>, settings: Option<&Bound<'_, PyAny>>, single: bool) -> PyResult<Self> {
        let given = settings.map(|settings| Given::of("settings", settings)).transpose()?;
        work(py, || {
            let read = |given: Given| -> Result<Settings, Raised> {
                Ok(damprig::settings::from_toml(&given.source()?, &Settings::default())?)
            };
            let settings = given.map(read).transpose()?;
            Ok(Self(Mutex::new(Bench::new(settings.as_ref(), single)?)))
        })
    }

    /// Names and units of all signals.
    fn signals(&self, py: Python<'_>) -> PyResult<Vec<(String, String)>> {
        work(py, || {
            let bench = self.bench();
            Ok(bench.session.signals.iter().map(|s| (s.name.to_string(), s.unit.to_string())).collect())
        })
    }

    /// The warnings since the last call.
    fn take_warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        work(py, || Ok(std::mem::take(&mut self.bench().warnings)))
    }

    /// Checks a campaign without a prediction.
    fn check(&self, py: Python<'_>, campaign: &Bound<'_, PyAny>) -> PyResult<()> {
        let given = Given::of("campaign", campaign)?;
        work(py, || {
            let mut campaign = Campaign::parse(given.source()?)?;
            let mut bench = self.bench();
            campaign.on_board(&bench.session.settings, true)?;
            bench.warnings.extend(campaign.source.warnings());
            Ok(())
        })
    }

    /// Runs a campaign; returns its results and transients.
    fn measure<'py>(&self, py: Python<'py>, campaign: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let given = Given::of("campaign", campaign)?;
        let done = work(py, || self.bench().measure(given.source()?))?;
        let dict = PyDict::new(py);
        dict.set_item("points", done.points.into_dict(py)?)?;
        dict.set_item("transients", done.transients.into_dict(py)?)?;
        Ok(dict)
    }

    /// Runs a campaign into a folder; returns where it is.
    fn run(&self, py: Python<'_>, campaign: &Bound<'_, PyAny>, out: Option<PathBuf>) -> PyResult<PathBuf> {
        let given = Given::of("campaign", campaign)?;
        work(py, || self.bench().run(given.source()?, out.as_deref()))
    }

    /// Starts the campaign's first experiment on its first set-up.
    fn start(&self, py: Python<'_>, campaign: &Bound<'_, PyAny>) -> PyResult<()> {
        let given = Given::of("campaign", campaign)?;
        work(py, || self.bench().start(given.source()?))
    }

    /// Lets ticks pass; returns `time`, the `signals` by name with their `units`, and the `events` as JSON.
    fn advance<'py>(&self, py: Python<'py>, ticks: u32) -> PyResult<Bound<'py, PyDict>> {
        let (times_s, columns, events) = work(py, || {
            let mut bench = self.bench();
            bench.advance(ticks)?;
            let times_s: Vec<f64> = std::mem::take(&mut bench.ticks).into_iter().map(time_s).collect();
            let names = bench.places.iter().map(|place| bench.session.signals[*place].clone()).collect::<Vec<_>>();
            let rows = bench.rows.iter_mut().map(std::mem::take).collect::<Vec<_>>();
            let events = Value::Array(std::mem::take(&mut bench.events)).to_string();
            Ok((times_s, names.into_iter().zip(rows).collect::<Vec<_>>(), events))
        })?;
        let (signals, units) = (PyDict::new(py), PyDict::new(py));
        for (signal, values) in columns {
            units.set_item(signal.name.as_str(), signal.unit.as_str())?;
            signals.set_item(signal.name.as_str(), values.into_pyarray(py))?;
        }
        let dict = PyDict::new(py);
        dict.set_item("time", times_s.into_pyarray(py))?;
        dict.set_item("signals", signals)?;
        dict.set_item("units", units)?;
        dict.set_item("events", events)?;
        Ok(dict)
    }

    /// The values of all signals in the last tick.
    fn values(&self, py: Python<'_>) -> PyResult<Vec<f32>> {
        work(py, || Ok(self.bench().session.signal_values()?))
    }

    /// State, tick, fault, safety and spring, as JSON.
    fn status(&self, py: Python<'_>) -> PyResult<String> {
        work(py, || {
            let (status, _) = self.bench().session.status()?;
            Ok(described_status(&status).to_string())
        })
    }

    /// Ends the experiment and waits until the drive is off; a fault stays latched.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        work(py, || Ok(self.bench().session.stop_drive()?))
    }

    /// Presses or releases the emergency stop.
    fn emergency_stop(&self, py: Python<'_>, pressed: bool) -> PyResult<()> {
        work(py, || self.bench().emergency_stop(pressed))
    }

    /// Clears a latched fault; refused until the rig is safe.
    fn clear_fault(&self, py: Python<'_>) -> PyResult<()> {
        work(py, || Ok(self.bench().session.execute("clear the fault", Request::ClearFault)?))
    }

    /// Stops, waits until the structure is at rest and clears a fault.
    fn rest(&self, py: Python<'_>) -> PyResult<()> {
        work(py, || self.bench().rest())
    }
}
