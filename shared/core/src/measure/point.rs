//! Measurement of one point, that is one frequency of a stepped sine: amplitudes, phase, RMS, maxima and steadiness.

use super::lock_in::LockIn;
use super::sum::Sum;
use super::trend::Trend;
use crate::io::{Readings, SensorSet};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Limits for a point to count as steady.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SteadyLimits {
    /// Largest relative change of the cycle maxima per cycle, over the second half of the dwell.
    pub change_per_cycle: f32,
    /// Largest relative RMS scatter of the cycle maxima about that trend.
    pub scatter: f32,
}

impl Default for SteadyLimits {
    fn default() -> Self {
        Self { change_per_cycle: 2e-4, scatter: 1e-2 }
    }
}

/// The result of one frequency. Lengths in m, angles in rad; every value is over the dwell's whole cycles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PointResult {
    /// Index in the whole experiment's frequency list, from 0.
    pub index: u16,
    /// Drive frequency, Hz.
    pub frequency_hz: f32,
    /// Base amplitude Z at the drive frequency (lock-in), m.
    pub z_amplitude_m: f32,
    /// Distortion of the base: the amplitudes of the 2nd to 5th harmonics (root of the sum of squares) over Z. The
    /// resolution is about 1/(cycles × ticks per cycle).
    pub z_distortion: f32,
    /// Drive amplitude at the drive frequency, m: the demanded amplitude at constant drive, the amplitude that the loop
    /// applied in closed loop.
    pub drive_amplitude_m: f32,
    /// The drive was at its limit during the dwell: Z may be below its target.
    pub drive_saturated: bool,
    /// Sensors that were clipped during the dwell: a sample was at a rail of its converter.
    pub clipped: SensorSet,
    /// Structure amplitude at the drive frequency (lock-in), m.
    pub x_amplitude_m: f32,
    /// Phase of x relative to z, −π to π, rad.
    pub phase_rad: f32,
    /// RMS of x, m.
    pub x_rms_m: f32,
    /// Mean over the cycles of max |x| in each, m: the source document's "average maximum displacement".
    pub x_mean_cycle_max_m: f32,
    /// max |x|, m.
    pub x_max_m: f32,
    /// max |x| in the last cycle, m.
    pub x_last_cycle_max_m: f32,
    /// Relative change of the cycle maxima per cycle over the second half of the dwell.
    pub change_per_cycle: f32,
    /// Relative RMS scatter of the cycle maxima about that trend.
    pub scatter: f32,
    /// Whole cycles measured.
    pub cycles: u32,
    /// Both limits of [`SteadyLimits`] are met.
    pub steady: bool,
    /// Measured impacts on both walls, per cycle.
    pub impacts_per_cycle: f32,
    /// Tick of the first measured sample.
    pub start_tick: u32,
    /// Tick after the last measured sample.
    pub end_tick: u32,
}

/// Measures one point, one tick at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointMeter {
    x: LockIn,
    z: LockIn,
    drive: LockIn,
    z_harmonics: [LockIn; 4],
    cycle_squares: f32,
    squares: Sum,
    cycle_max: f32,
    sum_of_maxima: Sum,
    max: f32,
    last_max: f32,
    trend: Trend,
    trend_from: u32,
    cycles: u32,
    cycle_samples: u32,
    samples: u32,
}

impl PointMeter {
    /// A meter for a dwell of `cycles` whole cycles. The trend is taken over the second half.
    #[must_use]
    pub fn new(cycles: u32) -> Self {
        Self { trend_from: cycles / 2, ..Self::default() }
    }

    /// Whole cycles so far.
    #[must_use]
    pub fn cycles(&self) -> u32 {
        self.cycles
    }

    /// Takes one tick's readings and drive (m) with the drive's sine and cosine at that tick.
    #[inline]
    pub fn push(&mut self, readings: &Readings, drive_m: f32, reference: (f32, f32)) {
        let (x, z) = (readings.x.mean_m, readings.z.mean_m);
        self.x.push(x, reference);
        self.z.push(z, reference);
        self.drive.push(drive_m, reference);
        let mut harmonic = reference;
        for lock_in in &mut self.z_harmonics {
            harmonic = (
                harmonic.0 * reference.1 + harmonic.1 * reference.0,
                harmonic.1 * reference.1 - harmonic.0 * reference.0,
            );
            lock_in.push(z, harmonic);
        }
        self.cycle_squares += x * x;
        self.cycle_max = readings.x.peak_m.max(self.cycle_max);
        self.cycle_samples += 1;
    }

    /// Closes a cycle.
    pub fn end_cycle(&mut self) {
        self.x.end_cycle();
        self.z.end_cycle();
        self.drive.end_cycle();
        self.z_harmonics.iter_mut().for_each(LockIn::end_cycle);
        self.squares.push(self.cycle_squares);
        self.sum_of_maxima.push(self.cycle_max);
        self.max = self.max.max(self.cycle_max);
        self.last_max = self.cycle_max;
        if self.cycles >= self.trend_from {
            self.trend.push(self.cycle_max);
        }
        self.samples += self.cycle_samples;
        self.cycles += 1;
        self.cycle_squares = 0.0;
        self.cycle_max = 0.0;
        self.cycle_samples = 0;
    }

    /// The result over the closed cycles.
    #[must_use]
    pub fn result(&self, place: &Place, limits: &SteadyLimits) -> PointResult {
        let (x_amplitude, x_phase) = self.x.amplitude_and_phase(self.samples);
        let (z_amplitude, z_phase) = self.z.amplitude_and_phase(self.samples);
        let mut harmonics = 0.0;
        for lock_in in &self.z_harmonics {
            harmonics += lock_in.squared_amplitude(self.samples);
        }
        let distortion = if z_amplitude > 0.0 { Scalar::sqrt(harmonics) / z_amplitude } else { 0.0 };
        let (change, scatter) = self.trend.slope_and_scatter().unwrap_or((f32::MAX, f32::MAX));
        PointResult {
            index: place.index,
            frequency_hz: place.frequency_hz,
            z_amplitude_m: z_amplitude,
            z_distortion: distortion,
            drive_amplitude_m: Scalar::sqrt(self.drive.squared_amplitude(self.samples)),
            drive_saturated: place.drive_saturated,
            clipped: place.clipped,
            x_amplitude_m: x_amplitude,
            phase_rad: wrapped(x_phase - z_phase),
            x_rms_m: Scalar::sqrt(self.squares.value() / self.samples.max(1) as f32),
            x_mean_cycle_max_m: self.sum_of_maxima.value() / self.cycles.max(1) as f32,
            x_max_m: self.max,
            x_last_cycle_max_m: self.last_max,
            change_per_cycle: change,
            scatter,
            cycles: self.cycles,
            steady: libm::fabsf(change) <= limits.change_per_cycle && scatter <= limits.scatter,
            impacts_per_cycle: place.impacts as f32 / self.cycles.max(1) as f32,
            start_tick: place.start_tick,
            end_tick: place.end_tick,
        }
    }
}

/// Index, time and counts of a measured point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Index in the whole experiment's frequency list.
    pub index: u16,
    /// Drive frequency, Hz.
    pub frequency_hz: f32,
    /// Tick of the first measured sample.
    pub start_tick: u32,
    /// Tick after the last measured sample.
    pub end_tick: u32,
    /// The drive was at its limit during the measurement.
    pub drive_saturated: bool,
    /// Sensors that were clipped during the measurement.
    pub clipped: SensorSet,
    /// Measured impacts.
    pub impacts: u32,
}

/// An angle wrapped into −π … π.
fn wrapped(angle: f32) -> f32 {
    use core::f32::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Reading, Readings};
    use crate::sine::Phase;

    #[test]
    fn the_distortion_of_a_known_wave_is_measured() {
        let increment = Phase::increment(2.5, 1000.0);
        let (mut phase, mut meter) = (Phase::default(), PointMeter::new(20));
        while meter.cycles() < 20 {
            let multiple = |n: u32| Phase(phase.0.wrapping_mul(n)).sin_cos();
            let (first, second, fifth) = (multiple(1), multiple(2), multiple(5));
            let z = 1e-3 * (first.0 + 0.03 * second.1 + 0.04 * fifth.0) + 2e-4;
            let readings = Readings { z: Reading::still(z), ..Readings::default() };
            meter.push(&readings, 2e-3 * first.1, first);
            if phase.advance(increment) {
                meter.end_cycle();
            }
        }
        let result = meter.result(&Place::default(), &SteadyLimits::default());
        // Cycles end on a tick. One tick of 20 × 400 adds 2 · 1.2/8000 to a harmonic.
        assert!((result.z_distortion - 0.05).abs() < 3e-4, "{}", result.z_distortion);
        assert!((result.drive_amplitude_m / 2e-3 - 1.0).abs() < 3e-4, "{}", result.drive_amplitude_m);
    }
}
