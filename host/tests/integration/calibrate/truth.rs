//! Gain and zero of every channel against the truth that a seed draws.
//!
//! Normal runs take a handful of seeds, and no error may be one that a stated uncertainty makes less likely than one in ten
//! thousand. With DAMPRIG_FULL 100 seeds are taken, and the truth lies in the 95 % interval of 90 to 99 of them.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use damprig::calibrate::guide::{self, CalibrationPlan};
use damprig::calibrate::readings::KeptFile;
use damprig::calibrate::record::{CalibrationRecord, Validity};
use damprig::calibrate::rehearsal::{SimulatedOperator, Truth};
use damprig::calibrate::rig::CalibratedRig;
use damprig::calibrate::solve::{Solved, solve};
use damprig::calibrate::{CalibrationPoint, Channel};
use damprig::client::link::Address;
use damprig::client::session::Session;
use damprig::identify::statistics::student_tail;
use damprig_core::settings::Settings;
use damprig_protocol::Request;

use crate::common::is_full;

/// A rehearsed calibration: what was found, what is true, and the points of a check after the new settings are in use.
struct Rehearsed {
    solved: Solved,
    points: usize,
    truth: Truth,
    old: Settings,
    record: CalibrationRecord,
    checked: Vec<CalibrationPoint>,
}

fn rehearse(channel: Channel, seed: u64) -> Rehearsed {
    let mut session = Session::open(&Address::VIRTUAL, Duration::from_secs(10)).unwrap();
    let old = session.settings;
    let stop = AtomicBool::new(false);
    let mut rig = CalibratedRig::new(&mut session, &stop).unwrap();
    let truth = Truth::draw(channel, seed, &old);
    let mut operator = SimulatedOperator::new(truth, &mut rig, |_| {}).unwrap();
    let plan = CalibrationPlan {
        channel,
        references: channel.default_references(&old),
        measure_s: 1.0,
        blows: 10,
        amplitude_m: if channel == Channel::Drive { 5e-4 } else { 2e-3 },
        frequencies_hz: Vec::new(),
    };
    let folder = tempfile::tempdir().unwrap();
    let kept = KeptFile::create(folder.path().join("kept.csv"), channel).unwrap();
    let points = guide::measure(&plan, &mut rig, &mut operator, &kept).unwrap();
    let solved = solve(channel, &points, &old, false).unwrap();
    let validity = Validity { date_days: 20_574.0, valid_days: 365.0 };
    let count = points.len();
    let record = CalibrationRecord::new(channel, "test".into(), points, solved.clone(), &old, validity).unwrap();
    rig.session.execute("use the settings", Request::SetSettings(*record.settings())).unwrap();
    rig.session.settings = *record.settings();
    let checked = guide::check(&plan, &mut rig, &mut operator).unwrap();
    Rehearsed { solved, points: count, truth, old, record, checked }
}

/// The true value of an estimate.
fn true_value(channel: Channel, quantity: &str, truth: &Truth) -> Option<f64> {
    let scales = &truth.scales;
    let value = match (channel, quantity) {
        (Channel::X, "gain") => scales.x.metres_per_count,
        (Channel::X, "zero") => scales.x.zero_counts,
        (Channel::Z | Channel::Match, "gain") => scales.z.metres_per_count,
        (Channel::Z, "zero") => scales.z.zero_counts,
        (Channel::Match, "lead of z") => return Some(truth.lead_s),
        (Channel::Spring, "gain") => scales.spring.newtons_per_count,
        (Channel::Spring, "zero") => scales.spring.zero_counts,
        (Channel::Walls, "gain") => scales.walls[0].newtons_per_count,
        (Channel::Drive, "gain") => scales.drive.metres_per_count,
        (Channel::Drive, "zero") => scales.drive.zero_counts,
        (Channel::FrictionSpring, "stiffness") => return Some(truth.stiffness_n_per_m),
        _ => return None,
    };
    Some(f64::from(value))
}

/// Checks the estimates of a channel over seeds.
fn agrees_with_the_truth(channel: Channel) {
    let seeds = if is_full() { 100 } else { 5 };
    let mut hits: Vec<(&str, u32)> = Vec::new();
    for seed in 0..seeds {
        let rehearsed = rehearse(channel, seed);
        for estimate in &rehearsed.solved.estimates {
            let Some(value) = true_value(channel, estimate.quantity, &rehearsed.truth) else { continue };
            let off = (estimate.value - value) / estimate.standard_uncertainty;
            // The drive's line goes through nine steps.
            let nu = if channel == Channel::Drive { 7 } else { rehearsed.points as u32 - 2 };
            let tail = student_tail(off, nu);
            println!("{channel} {seed} {}: {:e} for {value:e}, {off:+.2} u", estimate.quantity, estimate.value);
            assert!(tail > 1e-4, "{channel}, seed {seed}, {}: {off} standard uncertainties off", estimate.quantity);
            let [low, high] = estimate.interval_95;
            let is_hit = (low..=high).contains(&value);
            match hits.iter_mut().find(|(name, _)| *name == estimate.quantity) {
                Some((_, count)) => *count += u32::from(is_hit),
                None => hits.push((estimate.quantity, u32::from(is_hit))),
            }
        }
        reads_the_truth(channel, seed, &rehearsed);
    }
    assert!(!hits.is_empty());
    println!("{channel}: {hits:?} of {seeds} in the 95 % interval");
    if is_full() {
        for (quantity, count) in hits {
            assert!(
                (90..=99).contains(&count),
                "{channel}: {quantity} lies in its interval in {count} of {seeds} seeds"
            );
        }
    }
}

/// With the new settings the readings agree with what is true, within the residuals of the fit.
fn reads_the_truth(channel: Channel, seed: u64, rehearsed: &Rehearsed) {
    let Rehearsed { record, checked, old, .. } = rehearsed;
    assert!(!record.changes.is_empty() && *record.settings() != *old);
    assert_eq!(checked.is_empty(), channel == Channel::FrictionSpring);
    for point in checked {
        let off = point.reading - point.reference;
        // A new point scatters as the others do. At the end of the span the line itself adds two fifths of the variance; the
        // scatter of a blow is a share of its size, 0.11 N·s in the mean. The sine of the check loses (ωτ)²/2 = 1.2e-4 of its
        // amplitude in the sensor (drive), or nothing (match).
        let share = if channel == Channel::Walls { point.reference / 0.11 } else { 1.2 };
        let lag = if channel == Channel::Drive { 2e-4 * point.reference } else { 0.0 };
        let off = (off.abs() - lag).max(0.0);
        let nu = if channel == Channel::Drive { 7 } else { rehearsed.points as u32 - 2 };
        let tail = student_tail(off / (share * record.residual), nu);
        assert!(tail > 1e-4, "{channel}, seed {seed}: off by {off:e} with a residual of {:e}", record.residual);
    }
}

#[test]
fn x_is_found_with_its_zero() {
    agrees_with_the_truth(Channel::X);
}

#[test]
fn z_is_found_with_its_zero() {
    agrees_with_the_truth(Channel::Z);
}

#[test]
fn the_gain_ratio_and_the_lead_of_two_lasers_on_one_target_are_found() {
    agrees_with_the_truth(Channel::Match);
}

#[test]
fn the_force_sensor_is_found_by_weights() {
    agrees_with_the_truth(Channel::Spring);
}

#[test]
fn the_wall_sensors_are_found_by_blows() {
    agrees_with_the_truth(Channel::Walls);
}

#[test]
fn the_drive_is_found_with_its_zero() {
    agrees_with_the_truth(Channel::Drive);
}

#[test]
fn the_stiffness_of_the_friction_spring_is_found() {
    agrees_with_the_truth(Channel::FrictionSpring);
}
