//! Holding a running stepped sine at its present point, over the link; and the values of all signals.

use std::time::Duration;

use damprig::client::link::Address;
use damprig::client::session::{DeviceReport, Session, SessionError};
use damprig_core::control::outcome::ExperimentStage;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::RigState;
use damprig_protocol::{Event, Request};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::PlantConfig;

/// 15 cycles at 5 Hz, measured.
const DWELL_S: f32 = 3.0;

/// A virtual rig that runs a stepped sine of three points.
fn running() -> Session {
    let mut session = Session::open(&Address::VIRTUAL, Duration::from_secs(60)).expect("the virtual rig answers");
    let plant = PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.05)));
    session.execute("take a plant", set_plant(plant)).expect("a plant");
    let sine = SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 2.0,
        dwell_s: DWELL_S,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [4.0, 5.0, 6.0].into_iter().collect(),
    };
    session.execute("take the experiment", Request::Configure(sine)).expect("an experiment");
    session.start().expect("it starts");
    session
}

/// Follows the experiment until `until` says so, or to its end; returns the results.
fn follow(session: &mut Session, mut until: impl FnMut(&Event) -> bool) -> Vec<PointResult> {
    let mut points = Vec::new();
    loop {
        if let Some(DeviceReport::Event { event, .. }) = session.next_report().expect("the link is intact") {
            if let Event::Point(result) = event {
                points.push(result);
            }
            if until(&event) || matches!(event, Event::Finished { .. }) {
                return points;
            }
        }
    }
}

/// Lets this many grants of ticks pass: nothing is reported while a point is held.
fn pass(session: &mut Session, turns: u32) {
    for _ in 0..turns {
        let report = session.next_report().expect("the link is intact");
        assert!(report.is_none(), "{report:?}");
        session.use_up_credit().expect("the link is intact");
    }
}

#[test]
fn a_point_that_is_held_for_long_has_its_whole_dwell_after_the_release() -> Result<(), SessionError> {
    let free = follow(&mut running(), |_| false);
    let mut session = running();
    let first = follow(&mut session, |event| matches!(event, Event::Point(_)));
    session.execute("hold the point", Request::Hold(true))?;
    let begun = session.status()?.0.tick;
    pass(&mut session, 20);
    let (status, _) = session.status()?;
    assert!(status.tick - begun > 10 * (1e3 * DWELL_S) as u32, "held for much longer than the point takes");
    assert_eq!((status.held, status.points, status.state), (true, 1, RigState::Running(ExperimentStage::Settle)));
    session.execute("release the point", Request::Hold(false))?;
    let rest = follow(&mut session, |_| false);
    let points: Vec<_> = first.into_iter().chain(rest).collect();
    assert_eq!((points.len(), points[0]), (3, free[0]));
    assert!(points[1].start_tick >= status.tick);
    for (held, free) in points.iter().zip(&free) {
        assert_eq!(held.frequency_hz, free.frequency_hz);
        assert!((held.end_tick - held.start_tick).abs_diff((1e3 * DWELL_S) as u32) <= 1);
    }
    // The last point begins from rest, so it is the same but for its time.
    let shift = points[2].start_tick - free[2].start_tick;
    let (start_tick, end_tick) = (free[2].start_tick + shift, free[2].end_tick + shift);
    assert_eq!(points[2], PointResult { start_tick, end_tick, ..free[2] });
    Ok(())
}

#[test]
fn an_idle_rig_refuses_a_hold_in_words() {
    let mut session = Session::open(&Address::VIRTUAL, Duration::from_secs(60)).expect("the virtual rig answers");
    let refused = session.execute("hold the point", Request::Hold(true)).expect_err("nothing runs").to_string();
    assert!(refused.contains("only a running stepped sine can be held"), "{refused}");
}

#[test]
fn the_values_of_all_signals_can_be_read_while_idle_and_while_running() -> Result<(), SessionError> {
    let value = |session: &mut Session, name: &str| -> Result<f32, SessionError> {
        let place = session.signals.iter().position(|signal| signal.name == name).expect("a signal");
        let values = session.signal_values()?;
        assert_eq!(values.len(), session.signals.len());
        Ok(values[place])
    };
    let mut idle = Session::open(&Address::VIRTUAL, Duration::from_secs(60))?;
    assert_eq!(value(&mut idle, "frequency")?, 0.0);
    let mut session = running();
    let points = follow(&mut session, |event| matches!(event, Event::Point(_)));
    session.use_up_credit()?;
    assert_eq!(value(&mut session, "frequency")?, if session.status()?.0.points == 1 { 5.0 } else { 6.0 });
    assert!(value(&mut session, "z_amplitude")? > 0.9 * points[0].z_amplitude_m);
    Ok(())
}
