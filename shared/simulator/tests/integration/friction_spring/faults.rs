//! Faults of the friction spring: each ends in the safe state with its cause.

use super::*;

fn homing(broken: impl Fn(&mut Bench), cause: SpringFaultCause) {
    let mut bench = Bench::new();
    broken(&mut bench);
    bench.command(SpringCommand::Home);
    bench.until_safe(cause);
    bench.command(SpringCommand::ClearFault);
    assert_eq!(bench.spring.stage(), SpringStage::Unhomed);
}

#[test]
fn a_jammed_motor_never_finds_the_switch() {
    homing(|bench| bench.plant.broken.jammed = true, SpringFaultCause::SwitchNotFound);
}

#[test]
fn a_switch_stuck_open_is_never_found() {
    homing(|bench| bench.plant.broken.switch_stuck = Some(false), SpringFaultCause::SwitchNotFound);
}

#[test]
fn a_switch_stuck_closed_is_never_left() {
    homing(|bench| bench.plant.broken.switch_stuck = Some(true), SpringFaultCause::SwitchStuck);
}

#[test]
fn a_nan_reading_ends_homing() {
    homing(|bench| bench.reads_n = Some(f32::NAN), SpringFaultCause::SensorLost);
}

#[test]
fn without_a_structure_no_touch_is_found_and_the_block_goes_back() {
    let mut bench = Bench::new();
    bench.command(SpringCommand::Home);
    bench.until(SpringStage::Homed);
    bench.plant.broken.nothing_there = true;
    bench.command(SpringCommand::TouchOff);
    bench.until_safe(SpringFaultCause::NoTouch);
    assert!((bench.plant.position_m() - 1e-3).abs() < 1e-5);
    bench.command(SpringCommand::ClearFault);
    assert_eq!(bench.spring.stage(), SpringStage::Homed, "the position is still known");
}

#[test]
fn a_motor_that_jams_on_the_way_finds_no_touch() {
    let mut bench = Bench::new();
    bench.command(SpringCommand::Home);
    bench.until(SpringStage::Homed);
    bench.plant.broken.jammed = true;
    bench.command(SpringCommand::TouchOff);
    bench.until_safe(SpringFaultCause::NoTouch);
}

#[test]
fn a_motor_that_stalls_right_after_the_touch_makes_the_spring_implausible() {
    let mut bench = Bench::new();
    bench.command(SpringCommand::Home);
    bench.until(SpringStage::Homed);
    bench.plant.broken.stalls_above_n = Some(0.3);
    bench.command(SpringCommand::TouchOff);
    bench.until_safe(SpringFaultCause::SpringImplausible);
    assert!(bench.plant.normal_force_n() == 0.0);
}

#[test]
fn a_stall_on_the_way_to_a_target_is_noticed_and_stops_the_motor() {
    let mut bench = Bench::ready();
    bench.plant.broken.stalls_above_n = Some(4.0);
    bench.set(Target::Force { force_n: 10.0 });
    bench.until_safe(SpringFaultCause::ForceDoesNotFollow);
    assert!(bench.plant.normal_force_n() < 4.1);
    bench.command(SpringCommand::ClearFault);
    assert_eq!(bench.spring.stage(), SpringStage::Unhomed, "the position is no longer trusted");
}

#[test]
fn a_stall_that_corrections_run_against_is_noticed() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 4.0 });
    bench.until(SpringStage::Holding);
    bench.plant.broken.stalls_above_n = Some(3.9);
    bench.set(Target::Force { force_n: 4.3 });
    bench.until_safe(SpringFaultCause::ForceDoesNotFollow);
}

#[test]
fn lost_steps_are_corrected_up_to_the_tolerance_and_then_a_fault() {
    let mut bench = Bench::ready();
    bench.plant.broken.loses_every = 50;
    bench.set(Target::Force { force_n: 5.0 });
    bench.until(SpringStage::Setting);
    bench.until(SpringStage::Holding);
    assert!((bench.plant.normal_force_n() - 5.0).abs() < 0.022, "a loss of 2 % of the steps is corrected");
    bench.plant.broken.loses_every = 4;
    bench.set(Target::Force { force_n: 10.0 });
    bench.until_safe(SpringFaultCause::ForceDoesNotFollow);
}

#[test]
fn a_force_above_its_limit_releases_the_block() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 5.0 });
    bench.until(SpringStage::Holding);
    bench.plant.set_stiffness(3000.0);
    bench.until_safe(SpringFaultCause::ForceAboveLargest);
    assert_eq!(bench.plant.normal_force_n(), 0.0);
    bench.command(SpringCommand::ClearFault);
    assert_eq!(bench.spring.stage(), SpringStage::Homed, "the zero reading must be found again");
}

#[test]
fn a_lost_sensor_releases_the_block() {
    let lost = SensorVerdict::Lost { reading: -5.5, edge: -5.0 };
    for (reads_n, verdict) in [(Some(f32::NAN), SensorVerdict::Reads), (Some(-5.5), lost)] {
        let mut bench = Bench::ready();
        bench.set(Target::Force { force_n: 5.0 });
        bench.until(SpringStage::Setting);
        bench.run(500);
        (bench.reads_n, bench.force_sensor) = (reads_n, verdict);
        bench.until_safe(SpringFaultCause::SensorLost);
        assert_eq!(bench.plant.normal_force_n(), 0.0);
    }
}

/// Four ticks at a rail are not a fault, and their readings are ignored.
#[test]
fn while_the_sensor_is_at_a_rail_the_motor_stops_and_then_continues() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 5.0 });
    bench.run(400);
    (bench.reads_n, bench.force_sensor) = (Some(-5.5), SensorVerdict::AtRail);
    let before = bench.plant.position_m();
    bench.run(4);
    // Braking distance: the step under way, and 4 ticks at less than a step each.
    assert!(bench.plant.position_m() - before < 5.5 * 5e-6);
    assert!(bench.spring.status().fault.is_none());
    (bench.reads_n, bench.force_sensor) = (None, SensorVerdict::Reads);
    bench.until(SpringStage::Holding);
    assert!((bench.plant.normal_force_n() - 5.0).abs() < 0.022);
}

#[test]
fn a_motor_that_runs_the_wrong_way_is_noticed_by_the_rising_force() {
    // The seat is 1 mm from the structure, and the motor turns in the wrong direction.
    let mut bench = Bench::with(&SpringConfig::default(), &SpringPlant { start_m: 11.3e-3, ..SpringPlant::default() });
    bench.plant.broken.reversed = true;
    bench.command(SpringCommand::Home);
    bench.until_safe(SpringFaultCause::WrongDirection);
    // The tolerance of 0.5 N, and the sensor's lag of a few ticks at 1 N/s.
    assert!(bench.plant.normal_force_n() < 0.52, "{}", bench.plant.normal_force_n());
}

#[test]
fn a_force_sensor_of_the_wrong_sign_ends_the_touch_off() {
    let mut bench = Bench::new();
    bench.reversed = true;
    bench.command(SpringCommand::Home);
    bench.until(SpringStage::Homed);
    bench.command(SpringCommand::TouchOff);
    let mut most_n = 0.0f32;
    while bench.spring.stage() != SpringStage::Faulted {
        bench.tick();
        most_n = most_n.max(bench.plant.normal_force_n());
    }
    bench.until_safe(SpringFaultCause::WrongSign);
    assert!(most_n < 0.52, "it pressed with {most_n} N");
    assert_eq!(bench.plant.normal_force_n(), 0.0, "the block has moved away");
}

#[test]
fn a_sensor_that_sticks_within_its_range_is_found_by_the_next_move() {
    let mut bench = Bench::ready();
    bench.reads_n = Some(0.4);
    bench.set(Target::Deflection { deflection_m: 4e-3 });
    bench.until_safe(SpringFaultCause::ForceDoesNotFollow);
}

#[test]
fn a_switch_that_closes_unexpectedly_stops_the_motor() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 5.0 });
    bench.run(300);
    bench.plant.broken.switch_stuck = Some(true);
    bench.until_safe(SpringFaultCause::LimitReached);
}

#[test]
fn a_fault_is_not_cleared_while_the_block_moves_away() {
    let mut bench = Bench::ready();
    bench.reads_n = Some(f32::NAN);
    bench.until(SpringStage::Faulted);
    assert!(matches!(bench.spring.handle(SpringCommand::ClearFault), Err(SpringRejected::WrongStage { .. })));
}

/// The count of steps may be wrong: the switch protects the screw.
#[test]
fn a_release_after_a_fault_ends_at_the_switch() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 5.0 });
    bench.until(SpringStage::Holding);
    bench.reads_n = Some(f32::NAN);
    bench.until(SpringStage::Faulted);
    bench.run(300);
    assert!(bench.log.iter().rev().take(100).any(|&steps| steps < 0), "the block moves away");
    bench.plant.broken.switch_stuck = Some(true);
    bench.run(2);
    let stopped_m = bench.plant.position_m();
    bench.run(2_000);
    assert_eq!((bench.plant.position_m(), bench.drive.enabled), (stopped_m, false));
    bench.command(SpringCommand::ClearFault);
    assert_eq!(bench.spring.stage(), SpringStage::Unhomed, "the position is no longer trusted");
}
