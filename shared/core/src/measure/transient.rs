//! Measurement of a transient motion: a record played on the base, or a free vibration.
//!
//! It measures peaks and RMS of x, z and x − z, and how well the base follows its demand. The base follows late, by a
//! delay that depends on the shaker and the converters. The error e(t) = z(t) − w(t) from the demand w is therefore
//! taken at the delay that makes it smallest. With e against the demand of [`NOMINAL_DELAY_TICKS`] earlier, z ≈ w − τw′
//! gives in closed form
//!
//! ```text
//! τ = −Σ e w′ / Σ w′²,      Σ (z − w + τw′)² = Σ e² − (Σ e w′)² / Σ w′²
//! ```
//! Sums are [`Sum`]s, so the difference resolves 10⁻³ of the largest |e|. The linear approximation leaves (Ωτ)²/2 of
//! the amplitude, 3·10⁻⁵ at 2.5 Hz and half a tick.

use super::sum::Sum;
use crate::io::{Readings, SensorSet, TICK_HZ};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Ticks from a demand to the reading that it is compared with, before the best delay is determined.
pub const NOMINAL_DELAY_TICKS: f32 = 2.0;

/// The result of one record, or of one free vibration. Lengths in m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct TransientResult {
    /// Index in the whole experiment, from 0.
    pub index: u16,
    /// Tick of the first measured sample.
    pub start_tick: u32,
    /// Tick after the last measured sample.
    pub end_tick: u32,
    /// max |x| over every sample, m.
    pub max_abs_x_m: f32,
    /// RMS of x, m.
    pub rms_x_m: f32,
    /// max |z| over every sample, m.
    pub max_abs_z_m: f32,
    /// RMS of z, m.
    pub rms_z_m: f32,
    /// max |x − z| over the means of the ticks, m.
    pub max_abs_x_minus_z_m: f32,
    /// RMS of x − z, m.
    pub rms_x_minus_z_m: f32,
    /// RMS of the demanded displacement, m.
    pub wanted_rms_m: f32,
    /// RMS of z minus the demand, at the delay that makes it smallest, m.
    pub base_error_rms_m: f32,
    /// Delay from the demand to the reading at which that error is smallest, s; 0 without a demand.
    pub base_delay_s: f32,
    /// The demand was cut at its limit.
    pub drive_saturated: bool,
    /// Sensors that were clipped: a sample was at a rail of its converter.
    pub clipped: SensorSet,
    /// Measured impacts on both walls.
    pub impacts: u32,
    /// Decay of a free vibration; all zero for a record.
    pub decay: Decay,
}

/// The decay of a free vibration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Decay {
    /// |x| at the release, m.
    pub start_m: f32,
    /// max |x| after `cycles` whole cycles, on the side where the vibration began, m.
    pub end_m: f32,
    /// Whole cycles between the two: the number requested, or the number before |x| fell to a hundredth of its start.
    pub cycles: u16,
    /// Duration of these cycles, s; 0 if there are none.
    pub span_s: f32,
}

/// Measures a transient, one tick at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransientMeter {
    /// Sums of x², z², (x − z)², e², e w′, w′², w².
    sums: [Sum; 7],
    x_peak: f32,
    z_peak: f32,
    relative_peak: f32,
    /// The demands of this tick and of the three before, newest first.
    demands: [f32; 4],
    ticks: u32,
}

impl TransientMeter {
    /// Takes one tick's readings and the displacement demanded in it, m.
    pub fn push(&mut self, readings: &Readings, demand_m: f32) {
        let (x, z) = (readings.x.mean_m, readings.z.mean_m);
        self.demands = [demand_m, self.demands[0], self.demands[1], self.demands[2]];
        let [_, after, then, before] = self.demands;
        let rate = 0.5 * (after - before);
        let (error, relative) = (z - then, x - z);
        for (sum, (a, b)) in self.sums.iter_mut().zip([
            (x, x),
            (z, z),
            (relative, relative),
            (error, error),
            (error, rate),
            (rate, rate),
            (then, then),
        ]) {
            sum.push(a * b);
        }
        self.x_peak = readings.x.peak_m.max(self.x_peak);
        self.z_peak = readings.z.peak_m.max(self.z_peak);
        self.relative_peak = libm::fabsf(relative).max(self.relative_peak);
        self.ticks += 1;
    }

    /// Ticks taken.
    #[must_use]
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// The result. The caller fills in index, ticks, saturation, clipping, impacts and decay.
    #[must_use]
    pub fn result(&self) -> TransientResult {
        let per_tick = 1.0 / self.ticks.max(1) as f32;
        let rms = |sum: f32| Scalar::sqrt(sum * per_tick);
        let [x, z, relative, error, along, rate, wanted] = self.sums.map(|sum| sum.value());
        let late = if rate > 0.0 { -along / rate } else { 0.0 };
        // Rounding can make a zero error negative.
        let error = (error + late * along).max(0.0);
        let delay = if rate > 0.0 { (NOMINAL_DELAY_TICKS + late) * (1.0 / TICK_HZ) } else { 0.0 };
        TransientResult {
            max_abs_x_m: self.x_peak,
            rms_x_m: rms(x),
            max_abs_z_m: self.z_peak,
            rms_z_m: rms(z),
            max_abs_x_minus_z_m: self.relative_peak,
            rms_x_minus_z_m: rms(relative),
            wanted_rms_m: rms(wanted),
            base_error_rms_m: rms(error),
            base_delay_s: delay,
            ..TransientResult::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Reading, SUBSAMPLES};

    fn reading(value: f32) -> Reading {
        Reading::of(&[value; SUBSAMPLES])
    }

    fn measured(late_ticks: f64, distortion: f32) -> TransientResult {
        let mut meter = TransientMeter::default();
        let wave = |tick: f64| libm::sin(core::f64::consts::TAU * 2.5e-3 * tick.max(0.0)) as f32;
        for tick in 0..4000u16 {
            let z = wave(f64::from(tick) - late_ticks);
            let other = distortion * libm::sin(core::f64::consts::TAU * 10e-3 * f64::from(tick)) as f32;
            let readings = Readings { x: reading(3.0 * z), z: reading(z + other), ..Readings::default() };
            meter.push(&readings, wave(f64::from(tick)));
        }
        meter.result()
    }

    #[test]
    fn rms_and_peaks_of_sines_agree_with_their_closed_forms() {
        let result = measured(2.0, 0.0);
        for (value, expected) in
            [(result.rms_x_m, 3.0), (result.rms_z_m, 1.0), (result.rms_x_minus_z_m, 2.0), (result.wanted_rms_m, 1.0)]
        {
            assert!((value * core::f32::consts::SQRT_2 / expected - 1.0).abs() < 1e-3, "{value} for {expected}/√2");
        }
        assert!((result.max_abs_x_m - 3.0).abs() < 1e-3 && (result.max_abs_x_minus_z_m - 2.0).abs() < 1e-3);
    }

    #[test]
    fn a_delay_is_measured_and_does_not_count_as_error() {
        for late in [1.0, 1.6, 2.0, 2.45, 3.2] {
            let result = measured(late, 0.0);
            assert!((f64::from(result.base_delay_s) * 1e3 - late).abs() < 2e-2, "{late}: {}", result.base_delay_s);
            // The linear approximation's (Ωτ)²/2 with |τ| up to 1.2 ticks, and the first ticks.
            assert!(result.base_error_rms_m < 7e-4, "{late}: {}", result.base_error_rms_m);
        }
    }

    #[test]
    fn motion_that_the_base_adds_counts_as_error() {
        let result = measured(2.45, 0.02);
        assert!((result.base_error_rms_m / (0.02 / core::f32::consts::SQRT_2) - 1.0).abs() < 5e-3);
    }
}
