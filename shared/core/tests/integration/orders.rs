//! An order waits for a tick that has time for it, so that no tick has everything to do at once.

use damprig_core::control::experiment::Experiment;
use damprig_core::control::stepped_sine::{Drive, Plan, Start, SteppedSine};
use damprig_core::measure::impacts::Pair;
use damprig_core::measure::point::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::{Command, LONGEST_WAIT, Reading, Readings, Rig, SIGNALS, Sensors, State};
use damprig_core::twin::{TwinConfig, TwinPlan};

/// A rig at work.
fn running() -> Rig {
    let sine = SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-3,
        drive: Drive::Constant,
        ramp_s: 0.1,
        settle_s: 1.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        frequencies_hz: [2.5].into_iter().collect(),
        first_index: 0,
    };
    let mut rig = Rig::new();
    rig.handle(&mut Command::Configure(Some(Experiment::SteppedSine(Plan::new(sine).unwrap())))).unwrap();
    rig.handle(&mut Command::Start).unwrap();
    assert!(matches!(rig.state(), State::Running(_)));
    rig
}

/// A force on one wall that does not end.
fn touched() -> Sensors {
    let quiet = Sensors::default();
    Sensors { walls: quiet.walls.map(|pair| Pair::new(pair.of(0), pair.of(1) + 400)), ..quiet }
}

/// Ticks until the rig has time for an order that comes now.
fn waits(rig: &mut Rig, mut sensors: impl FnMut(u32) -> Sensors) -> u32 {
    for tick in 1..1000 {
        rig.expect_order();
        rig.tick(&sensors(tick), &[]);
        if rig.has_time() {
            return tick;
        }
    }
    panic!("the order is never served");
}

#[test]
fn a_quiet_tick_has_time_for_an_order_and_only_for_one_that_is_expected() {
    let mut rig = running();
    assert_eq!(waits(&mut rig, |_| Sensors::default()), 1);
    rig.tick(&Sensors::default(), &[]);
    assert!(!rig.has_time());
}

#[test]
fn an_order_waits_until_a_contact_is_over() {
    let mut rig = running();
    // The pulse ends in the 13th tick, is looked at in the 14th and told in the 15th.
    assert_eq!(waits(&mut rig, |tick| if tick <= 12 { touched() } else { Sensors::default() }), 16);
}

#[test]
fn a_contact_that_does_not_end_holds_no_order_up_for_long() {
    let mut rig = running();
    for _ in 0..3 {
        assert_eq!(waits(&mut rig, |_| touched()), u32::from(LONGEST_WAIT));
    }
}

#[test]
fn a_flood_of_orders_leaves_the_twin_its_time() {
    let mut rig = Rig::new();
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
    let plan = TwinPlan::new(&TwinConfig::new(set_up)).unwrap();
    rig.handle(&mut Command::SetTwin(Some(plan))).unwrap();
    let mut served = 0;
    for tick in 0..4000u32 {
        rig.expect_order();
        let readings = Readings { z: Reading::still(1e-3 * libm::sinf(tick as f32 * 0.0157)), ..Readings::default() };
        rig.tick(&Sensors { readings, ..Sensors::default() }, &[]);
        served += u32::from(rig.has_time());
    }
    // A sample of two ticks wants one tick.
    assert!((1990..=2010).contains(&served), "{served} of 4000");
    // The twin of a structure that does not move where its base does: it is there.
    let residual = rig.signals()[SIGNALS.iter().position(|(name, _)| *name == "twin_residual").unwrap()];
    assert!(residual > 1e-5, "{residual}");
}

#[test]
fn an_order_waits_until_a_cycle_is_evaluated() {
    let mut rig = running();
    let waited: Vec<u32> = (0..3000).map(|_| waits(&mut rig, |_| Sensors::default())).collect();
    assert!(waited.iter().all(|ticks| *ticks <= 4), "{:?}", waited.iter().max());
    assert!(waited.iter().any(|ticks| *ticks > 1), "no cycle ended");
}
