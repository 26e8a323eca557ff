//! Events of the rig: in order, bounded, and lost ones are counted.

use damprig_core::control::experiment::Experiment;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine, SteppedSinePlan};
use damprig_core::io::{Sensors, WALL_SUBSAMPLES, WallCounts};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::{Command, Event, Rig};

fn running() -> Rig {
    let sine = SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.1,
        settle_s: 1.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        points: [2.5].into_iter().collect(),
        first_index: 0,
    };
    let mut rig = Rig::new();
    rig.handle(Command::Configure(Experiment::SteppedSine(SteppedSinePlan::new(sine).unwrap()))).unwrap();
    rig.handle(Command::Start).unwrap();
    rig
}

/// Short pulses alternating between both walls: seven per wall in a block.
fn chattering() -> Sensors {
    let mut sensors = Sensors::default();
    for (n, pair) in sensors.walls.iter_mut().enumerate() {
        let force = if n % 7 == 0 { 1000 } else { 0 };
        *pair = WallCounts::new(pair.of(0) + force, pair.of(1) + force);
    }
    sensors
}

#[test]
fn impacts_beyond_the_queue_are_counted_as_lost_and_a_fault_of_the_same_tick_is_reported() {
    let mut rig = running();
    assert!(rig.events().next().is_none());
    let stopped = Sensors { emergency_stop: true, ..chattering() };
    rig.tick(&stopped, &[]);
    let events: Vec<Event> = std::iter::from_fn(|| rig.pop_event()).collect();
    let (fault, impacts) = events.split_last().unwrap();
    assert!(matches!(fault, Event::Fault(fault) if fault.cause == FaultCause::EmergencyStop), "{fault:?}");
    assert_eq!(impacts.len(), 8);
    assert!(impacts.iter().all(|event| matches!(event, Event::Impact(_))), "{impacts:?}");
    // The last pulse of a block does not end in it.
    let pulses = 2 * (WALL_SUBSAMPLES / 7) as u32;
    assert_eq!(rig.status().events_lost, pulses - 8);
}
