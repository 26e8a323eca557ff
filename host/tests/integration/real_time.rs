//! The real-time virtual rig: a board with its own clock, whose cable can be pulled and whose faults can be injected.
//!
//! The tests of this process use different speeds, so each has a rig of its own.

use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use assert_cmd::cargo::CommandCargoExt;
use damprig::campaign::{Campaign, CampaignSetUp};
use damprig::client::link::{Address, Speed, cable};
use damprig::client::session::{DeviceReport, Session};
use damprig::input::Source;
use damprig::run_folder::ResultRow;
use damprig::run_folder::journal::Journal;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::recorder::Recorder;
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};
use damprig::runner::{Reconnect, Run, RunError, Selection, Watcher};
use damprig_core::control::fault::FaultCause;
use damprig_core::control::safety::SafeStage;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::Sensor;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::RigState;
use damprig_protocol::{Clock, Event, PlantKind, Request};
use damprig_simulator::messages::ToSimulator;
use damprig_simulator::plant::{InjectedFault, SensorFault};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{PATIENCE, damprig, folder_with, manifest, read_parquet, short};

fn rig(speed: f64) -> Address {
    Address::RealTime { single: false, board: None, speed: Speed::new(speed).expect("an allowed speed") }
}

/// Starts a stepped sine on the idle rig, without a campaign.
fn drive(session: &mut Session) {
    let sine = SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 1.0,
        settle_s: 1.0,
        dwell_s: 600.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0].into_iter().collect(),
    };
    session.execute("take the experiment", Request::Configure(sine)).expect("an experiment");
    session.start().expect("it starts");
}

/// Waits for a state of the rig.
fn wait_for(session: &mut Session, is_reached: impl Fn(RigState, SafeStage) -> bool) {
    let begun = Instant::now();
    while !session.status().map(|(status, _)| is_reached(status.state, status.safe)).expect("it answers") {
        assert!(begun.elapsed() < PATIENCE, "{:?}", session.status());
        session.next_report().expect("the link is intact");
    }
}

/// Injects a fault while the rig is driven; returns the fault that it reports. It ends in the safe state, with the drive off.
fn fault_after(speed: f64, injected: InjectedFault) -> FaultCause {
    let mut session = Session::open(&rig(speed), Duration::from_secs(60)).expect("the rig answers");
    assert_eq!((session.description.clock, session.description.plant), (Clock::RealTime, PlantKind::SimulatedF64));
    drive(&mut session);
    wait_for(&mut session, |_, _| true);
    session.execute("inject a fault", ToSimulator::Inject(injected).request()).expect("it is possible while running");
    let begun = Instant::now();
    let fault = loop {
        if let Some(DeviceReport::Event { event: Event::Fault(fault), .. }) = session.next_report().expect("a link") {
            break fault;
        }
        assert!(begun.elapsed() < PATIENCE);
    };
    wait_for(&mut session, |state, safe| {
        state == RigState::Faulted && matches!(safe, SafeStage::Ringing | SafeStage::Safe)
    });
    let place = session.signals.iter().position(|signal| signal.name == "drive").expect("a signal");
    assert_eq!(session.signal_values().expect("the values")[place], 0.0);
    fault.cause
}

#[test]
fn the_emergency_stop_pressed_while_driving_ends_in_the_safe_state() {
    let cause = fault_after(4.0, InjectedFault::EmergencyStop { pressed: true });
    assert_eq!(cause.text(), "the emergency stop is pressed");
}

#[test]
fn an_unplugged_sensor_ends_in_the_safe_state_and_is_named() {
    let cause = fault_after(5.0, InjectedFault::Sensor { sensor: Sensor::X, fault: Some(SensorFault::Unplugged) });
    assert_eq!(cause, FaultCause::SensorAtRail(Sensor::X));
}

#[test]
fn a_second_session_reaches_the_same_rig_after_the_first_one_was_closed() {
    let address = rig(6.0);
    assert!(cable(&address).is_none(), "no rig before the first session");
    let open = || Session::open(&address, Duration::from_secs(60));
    let mut first = open().expect("the rig answers");
    drive(&mut first);
    let refused = open().err().expect("a cable has one user").to_string();
    assert!(refused.contains("another session of this program"), "{refused}");
    drop(first);
    let mut second = open().expect("the rig answers");
    let (status, _) = second.status().expect("it answers");
    assert!(matches!(status.state, RigState::Running(_)), "{status:?}");
    second.stop_drive().expect("it stops");
}

#[test]
fn an_idle_rig_shows_its_resting_sensors() {
    let mut session = Session::open(&rig(7.0), Duration::from_secs(60)).expect("the rig answers");
    let mut read = |name: &str| {
        let place = session.signals.iter().position(|signal| signal.name == name).expect("a signal");
        session.signal_values().expect("the values")[place]
    };
    let begun = Instant::now();
    // The noise of the data sheets, and no motion.
    while read("x") == 0.0 {
        assert!(begun.elapsed() < PATIENCE);
    }
    assert!(read("x").abs() < 1e-3 && read("z").abs() < 1e-3);
    assert_eq!(session.status().expect("it answers").0.fault, None);
}

/// Two long points, with the shortest time of silence that a campaign may set, on a structure that comes to rest soon.
const LONG: &str = r#"
name = "long"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.05
[rig]
host_silent_s = 5
[[set_up]]
name = "one"
base_amplitude_m = 0.001
[[experiment]]
kind = "stepped_sine"
frequencies_hz = [2.4, 2.6]
start = "from_rest"
settle_s = 1.0
dwell_s = 20.0
[telemetry]
rate_hz = 100
signals = ["x"]
"#;

/// Pulls the cable in the first point.
struct Puller<'a> {
    address: &'a Address,
    points: Vec<ResultRow>,
    was_pulled: bool,
}

impl Watcher for Puller<'_> {
    fn mount(&mut self, _: &CampaignSetUp, simulated: bool) -> Result<bool, RunError> {
        assert!(simulated, "nobody is asked to mount a simulated set-up");
        Ok(false)
    }

    fn progress(&mut self, rig_s: f64) {
        if rig_s > 3.0 && !self.was_pulled {
            self.was_pulled = true;
            cable(self.address).expect("a rig").pull();
        }
    }

    fn point(&mut self, row: &ResultRow) {
        self.points.push(row.clone());
    }

    fn link(&mut self, _: &str) {}
}

#[test]
fn a_cable_pulled_for_too_long_trips_the_rig_and_the_run_goes_on_after_it_is_plugged_in() {
    let (address, folder) = (rig(10.0), TempDir::new().expect("a folder"));
    let campaign = Campaign::parse(Source::new("long.toml", LONG)).expect("a campaign");
    let open = || Session::open(&address, Duration::from_secs(1));
    let mut session = open().expect("the rig answers");
    let selection = Selection::of(&campaign, &session).expect("its signals");
    let layout = RecordLayout {
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        tick_hz: 1000.0,
        order: campaign.in_order(),
        about: Default::default(),
    };
    let journal = Journal::open(folder.path()).expect("a journal");
    let writer = RunWriter::new(folder.path(), journal, layout, JournalState::default()).expect("a writer");
    let mut recorder = Recorder::start(writer, false);
    let mut watcher = Puller { address: &address, points: vec![], was_pulled: false };
    let stop = AtomicBool::new(false);
    let (mut refusals, mut faults) = (vec![], vec![]);
    let reopen = || {
        // The cable was pulled a second ago: ten seconds for the rig.
        open()
            .inspect_err(|error| {
                refusals.push(error.to_string());
                cable(&address).expect("a rig").plug();
            })
            .and_then(|mut session| {
                faults.extend(session.status()?.0.fault.map(|fault| fault.cause));
                Ok(session)
            })
    };
    let reconnect = Reconnect { within: PATIENCE, open: Box::new(reopen) };
    let (tally, result) =
        Run::new(&campaign, &mut session, &mut recorder, &mut watcher, &stop, selection, JournalState::default())
            .with_reconnect(Some(reconnect))
            .carry_out();
    result.expect("the run is complete");
    assert!(refusals[0].ends_with("the cable is pulled; plug it in"), "{refusals:?}");
    assert_eq!(faults, [FaultCause::HostSilent]);
    assert_eq!(tally.counters.interruptions, 1);
    let frequencies: Vec<f64> = watcher.points.iter().map(|row| row.frequency_hz).collect();
    assert_eq!(frequencies, [2.4, 2.6]);
}

#[test]
fn the_results_are_those_of_the_virtual_rig() {
    // The same code on the same ticks.
    let folder = folder_with(&short());
    for (out, rig) in [("granted", vec!["virtual"]), ("clocked", vec!["virtual:realtime", "--speed", "10"])] {
        damprig(&folder).args(["run", "test.toml", "--out", out, "--rig"]).args(rig).assert().success();
    }
    let [granted, clocked] = ["granted", "clocked"].map(|out| {
        let batches = read_parquet(folder.path().join(out).join("results.parquet"));
        batches.iter().map(|batch| format!("{batch:?}")).collect::<String>()
    });
    assert_eq!(granted, clocked);
    let manifest = manifest(&folder.path().join("clocked"));
    assert_eq!(manifest["device"]["clock"], "real time");
    assert_eq!(manifest["device"]["simulated"], true);
    assert_eq!(manifest["device"]["link"], "virtual:realtime");
}

#[test]
fn a_speed_out_of_range_or_of_another_rig_is_refused_by_name() {
    let folder = folder_with(&short());
    for speed in ["0", "-1", "nan", "inf", "0.49", "20.1", "1e9"] {
        let answer =
            damprig(&folder).args(["run", "test.toml", "--rig", "virtual:realtime", "--speed", speed]).assert();
        answer.code(2).stderr(contains("--speed").and(contains("from 0.5 to 20 rig seconds per second")));
    }
    for rig in [&["--rig", "virtual"][..], &["--rig", "tcp:127.0.0.1:1"], &[]] {
        let answer = damprig(&folder).args(["run", "test.toml", "--speed", "2"]).args(rig).assert();
        answer.code(2).stderr(contains("--speed 2").and(contains("only --rig virtual:realtime has a speed")));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_run_long_before_its_rig_time_is_over() {
    // Ten minutes of rig time at the pace of the wall clock.
    let folder = folder_with(&short().replace("dwell_s = 4.0", "dwell_s = 100.0"));
    let mut run = std::process::Command::cargo_bin("damprig").expect("the binary");
    run.current_dir(folder.path()).args(["run", "test.toml", "--rig", "virtual:realtime", "--out", "out"]);
    let mut run = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut lines = BufReader::new(run.stdout.take().expect("its output")).lines();
    assert!(lines.any(|line| line.expect("text").starts_with("Rig virtual:realtime")));
    let begun = Instant::now();
    let killed = std::process::Command::new("kill").args(["-INT", &run.id().to_string()]).status();
    assert!(killed.expect("kill").success());
    lines.for_each(drop);
    assert_eq!(run.wait().expect("it ends").code(), Some(130));
    assert!(begun.elapsed() < PATIENCE);
    let mut told = String::new();
    run.stderr.take().expect("its messages").read_to_string(&mut told).expect("text");
    assert!(told.contains("continue with `damprig run --resume out`"), "{told}");
}
