//! Standard uncertainty of the measured values, from the sensors. docs/COMPARE.md derives each.

use std::f64::consts::TAU;

use damprig_core::io::{SUBSAMPLES, TICK_HZ};
use damprig_core::measure::noise::raised_maximum;

use super::metric::{MetricValues, WallKind};
use crate::identify::sensors::{Sensors, rectangular};
use crate::quantity::Quantity;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::transients::TransientRow;

/// Noise of a force sensor on a wall, N, and the largest of many readings above it: five times.
const WALL_NOISE_N: f64 = 0.2;

/// Largest error of a measured impulse (`measure::impacts`).
const IMPULSE_ERROR: f64 = 8e-3;

/// Assumed for the peak force of a soft wall: a force that begins with a jump is sampled up to 20 µs late.
const JUMP_ERROR: f64 = 0.125;

/// Relative rounding of a value in single precision, over some operations.
const ROUNDING: f64 = 1e-6;

fn root_sum(parts: &[f64]) -> f64 {
    parts.iter().map(|u| u * u).sum::<f64>().sqrt()
}

/// Standard uncertainty of a lock-in amplitude over `ticks` readings of this noise, m.
fn of_lock_in_m(sensors: &Sensors, noise_m: f64, ticks: f64) -> f64 {
    (2.0 / ticks).sqrt() * noise_m.hypot(sensors.step_m / 12.0_f64.sqrt())
}

/// Standard uncertainty of the largest |x| of many sub-samples: the noise raises it by up to four times its RMS.
fn of_largest_m(sensors: &Sensors, noise_m: f64) -> f64 {
    rectangular(4.0 * noise_m * (SUBSAMPLES as f64).sqrt() + 0.5 * sensors.step_m)
}

/// Standard uncertainty of an RMS of x, m.
fn of_rms_m(sensors: &Sensors, rms_m: f64, noise_m: f64, ticks: f64) -> f64 {
    let bias_m = if rms_m > 0.0 { noise_m * noise_m / (2.0 * rms_m) } else { noise_m };
    root_sum(&[rms_m * sensors.scale, bias_m, of_lock_in_m(sensors, noise_m, ticks) / 2.0_f64.sqrt(), rms_m * ROUNDING])
}

/// Of the values of a point.
pub(super) fn of_result(sensors: &Sensors, row: &ResultRow, values: &MetricValues, kind: WallKind) -> MetricValues {
    let ticks = (row.end_tick.saturating_sub(row.start_tick)).max(1) as f64;
    let cycles = f64::from(row.cycles.max(1));
    let noise_m = positive(f64::from(row.x_noise_rms_m));
    let (x_m, z_m) = (f64::from(row.x_amplitude_m), f64::from(row.z_amplitude_m));
    let maxima_m = f64::from(row.mean_cycle_max_m);
    let omega = TAU * row.frequency_hz;
    let raised_m = f64::from(raised_maximum(noise_m as f32, row.x_amplitude_m, omega as f32 / TICK_HZ));
    // The noise of a maximum, the correction for the noise to 15 % (95 %), and a step of the converter.
    let of_maxima_m =
        root_sum(&[0.5 * noise_m / cycles.sqrt(), 0.5 * 0.15 * raised_m, sensors.step_m / 12.0_f64.sqrt()]);
    let of_x_m = of_lock_in_m(sensors, noise_m, ticks);
    let of_z = of_x_m / z_m;
    let of_scales = 2.0_f64.sqrt() * sensors.scale;
    let ratio = |value: f64, own: f64| value * root_sum(&[own, of_z, of_scales, ROUNDING]);
    let of = |metric: Quantity, value: f64| match metric {
        Quantity::XOverZ => ratio(value, of_maxima_m / maxima_m),
        Quantity::XOverZLockIn => ratio(value, of_x_m / x_m),
        Quantity::PhaseRad => root_sum(&[of_x_m / x_m, of_z, rectangular(omega * sensors.skew_s), ROUNDING]),
        Quantity::MaxAbsXM => root_sum(&[value * sensors.scale, of_largest_m(sensors, noise_m), value * ROUNDING]),
        Quantity::RmsXM => of_rms_m(sensors, value, noise_m, ticks),
        other => of_walls(other, value, cycles, kind),
    };
    values.iter().map(|(metric, value)| (*metric, of(*metric, *value))).collect()
}

/// Of the values of a record, a pulse or a free vibration. `noise_m`: RMS noise of a tick's x.
pub(super) fn of_transient(
    sensors: &Sensors,
    row: &TransientRow,
    values: &MetricValues,
    noise_m: f64,
    kind: WallKind,
) -> MetricValues {
    let ticks = (row.end_tick.saturating_sub(row.start_tick)).max(1) as f64;
    let frequency_hz = if row.frequency_hz > 0.0 { row.frequency_hz } else { 1.0 };
    let omega = TAU * frequency_hz;
    let cycles = f64::from(row.cycles.max(1));
    // The last peak: noise, what it raises a maximum by, and a step of the converter.
    let end_m = positive(row.end_m);
    let of_end = (3.0 * noise_m + sensors.step_m / 12.0_f64.sqrt()) / end_m;
    // Each of both crossings is off by the noise over the speed there.
    let of_crossings_s = 2.0_f64.sqrt() * (noise_m + sensors.step_m / 12.0_f64.sqrt()) / (omega * end_m);
    let largest_m = f64::from(row.max_abs_x_m);
    let of = |metric: Quantity, value: f64| match metric {
        Quantity::MaxAbsXM => root_sum(&[value * sensors.scale, of_largest_m(sensors, noise_m), value * ROUNDING]),
        Quantity::MaxAbsXMinusZM => {
            let scales = 2.0_f64.sqrt() * sensors.scale;
            root_sum(&[value * scales, 2.0_f64.sqrt() * of_largest_m(sensors, noise_m), value * ROUNDING])
        }
        Quantity::RmsXM => of_rms_m(sensors, value, noise_m, ticks),
        // Near its peak x stays within the noise for this time.
        Quantity::MaxAbsXTimeS => {
            let flat_s = (2.0 * (3.0 * noise_m + sensors.step_m) / largest_m).sqrt() / omega;
            root_sum(&[rectangular(flat_s), rectangular(0.5 / f64::from(TICK_HZ))])
        }
        Quantity::DampingRatio => root_sum(&[of_end / (TAU * cycles), value * ROUNDING]),
        Quantity::DecayFrequencyHz => value * root_sum(&[of_crossings_s * value / cycles, ROUNDING]),
        other => of_walls(other, value, 1.0, kind),
    };
    values.iter().map(|(metric, value)| (*metric, of(*metric, *value))).collect()
}

/// Of impacts and forces on the walls.
fn of_walls(metric: Quantity, value: f64, cycles: f64, kind: WallKind) -> f64 {
    match metric {
        // An impact at either end of the window may fall inside or outside.
        Quantity::ImpactsPerCycle | Quantity::Impacts => rectangular(1.0) / cycles,
        Quantity::MaxImpulseNS => root_sum(&[rectangular(IMPULSE_ERROR * value), 0.1 * WALL_NOISE_N * 1e-3]),
        Quantity::PeakContactForceN => {
            let jump = if kind == Some(true) { JUMP_ERROR } else { 0.0 };
            root_sum(&[rectangular(jump * value), rectangular(5.0 * WALL_NOISE_N)])
        }
        _ => f64::NAN,
    }
}

/// A number of at least 0; 0 for NaN.
fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { 0.0 }
}
