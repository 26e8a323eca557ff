//! Measurement of one point, that is one frequency of a stepped sine: amplitudes, phase, RMS, maxima and steadiness.

use super::approach::{Approach, FitLimit, modulus};
use super::batches::Batches;
use super::lock_in::LockIn;
use super::noise::{NoiseMeter, raised_maximum};
use super::steadiness::{Evidence, IRREGULAR, Steadiness, SteadyLimits};
use super::sum::Sum;
use super::trend::Trend;
use crate::io::{Readings, SensorSet, TICK_HZ};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The result of one frequency. Lengths in m, angles in rad; every value is over the dwell's whole cycles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PointResult {
    /// Index in the whole experiment's frequency list, from 0.
    pub index: u16,
    /// Drive frequency, Hz; of a tracked resonance its mean over the dwell.
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
    pub rms_x_m: f32,
    /// Mean over the cycles of max |x| in each, m: the source document's "average maximum displacement". |x| is a tick's
    /// mean; by how much the sensor's noise raises its maxima is subtracted.
    pub mean_cycle_max_m: f32,
    /// max |x| of all samples, m, noise included.
    pub max_abs_x_m: f32,
    /// max |x| in the last cycle, m, as in the mean.
    pub last_cycle_max_m: f32,
    /// RMS noise of a tick's x, m.
    pub x_noise_rms_m: f32,
    /// Relative change of the cycle maxima per cycle over the second half of the dwell.
    pub change_per_cycle: f32,
    /// Relative RMS scatter of the cycle maxima about that trend.
    pub scatter: f32,
    /// Whole cycles measured.
    pub cycles: u32,
    /// Relative deviation of X/Z from its limit, extrapolated from the amplitudes of x and z and from how far the cycle maxima are above
    /// those of x; X is the mean cycle maximum.
    pub deviation: f32,
    /// Uncertainty of that deviation (95 %), relative to X/Z; too small where a point off resonance is more than 3 % from its limit.
    pub deviation_uncertainty: f32,
    /// Half-width of the 95 % interval of X/Z as a mean over cycles, relative.
    pub interval: f32,
    /// The verdict on all of these.
    pub steadiness: Steadiness,
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
    last_square: f32,
    cycle_max: f32,
    sum_of_maxima: Sum,
    /// Of each cycle's maximum above its amplitude at the drive frequency: over the dwell and over its second half.
    excess: Sum,
    late_excess: Sum,
    max: f32,
    last_max: f32,
    /// Of the cycle maxima: over the second half of the dwell, and in batches.
    trend: Trend,
    /// First cycle of the second half.
    late_from: u32,
    maxima: Batches,
    /// Of each cycle's amplitudes at the drive frequency.
    x_approach: Approach,
    z_approach: Approach,
    x_noise: NoiseMeter,
    cycles: u32,
    cycle_samples: f32,
    samples: f32,
    /// Fraction of a sample by which the first cycle began before its first sample.
    missing: f32,
}

impl PointMeter {
    /// A meter for a dwell of `cycles` whole cycles, which began a fraction `missing` of a sample (0 to 1) before the
    /// first sample.
    #[must_use]
    pub fn new(cycles: u32, missing: f32) -> Self {
        Self { late_from: cycles / 2, missing, ..Self::default() }
    }

    /// Whole cycles so far.
    #[must_use]
    pub fn cycles(&self) -> u32 {
        self.cycles
    }

    /// Mean frequency of the drive over these cycles, Hz.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        if self.samples > 0.0 { self.cycles as f32 / self.samples * TICK_HZ } else { 0.0 }
    }

    fn lock_ins(&mut self) -> impl Iterator<Item = &mut LockIn> {
        [&mut self.x, &mut self.z, &mut self.drive].into_iter().chain(&mut self.z_harmonics)
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
        self.x_noise.push(x);
        self.last_square = x * x;
        self.cycle_squares += self.last_square;
        self.cycle_max = x.abs().max(self.cycle_max);
        self.max = readings.x.peak_m.max(self.max);
        self.cycle_samples += 1.0;
        if self.missing > 0.0 {
            let missing = core::mem::take(&mut self.missing);
            self.lock_ins().for_each(|lock_in| lock_in.extend_last(missing));
            self.cycle_squares += missing * self.last_square;
            self.cycle_samples += missing;
        }
    }

    /// Closes a cycle, of which `over`, a fraction of the last sample (0 to 1), belongs to the next one.
    pub fn end_cycle(&mut self, over: f32) {
        let samples = self.cycle_samples - over;
        let scaled = |(sine, cosine): (f32, f32)| (2.0 / samples * sine, 2.0 / samples * cosine);
        let x = scaled(self.x.end_cycle(over));
        self.x_approach.push(x);
        let z = scaled(self.z.end_cycle(over));
        self.z_approach.push(z);
        self.drive.end_cycle(over);
        for lock_in in &mut self.z_harmonics {
            lock_in.end_cycle(over);
        }
        self.squares.push(self.cycle_squares - over * self.last_square);
        self.sum_of_maxima.push(self.cycle_max);
        self.last_max = self.cycle_max;
        self.maxima.push(self.cycle_max);
        let excess = self.cycle_max - modulus(x);
        self.excess.push(excess);
        if self.cycles >= self.late_from {
            self.late_excess.push(excess);
            self.trend.push(self.cycle_max);
        }
        self.samples += samples;
        self.cycles += 1;
        self.cycle_squares = over * self.last_square;
        self.cycle_max = 0.0;
        self.cycle_samples = over;
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
        let noise = self.x_noise.rms();
        let raised = raised_maximum(noise, x_amplitude, core::f32::consts::TAU * place.frequency_hz / TICK_HZ);
        let mean_max = (self.sum_of_maxima.value() / self.cycles.max(1) as f32 - raised).max(0.0);
        let evidence = self.evidence(mean_max, noise, raised, z_amplitude, scatter);
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
            rms_x_m: Scalar::sqrt(self.squares.value() / self.samples.max(1.0)),
            mean_cycle_max_m: mean_max,
            max_abs_x_m: self.max,
            last_cycle_max_m: (self.last_max - raised).max(0.0),
            x_noise_rms_m: noise,
            change_per_cycle: change,
            scatter,
            cycles: self.cycles,
            deviation: evidence.deviation,
            deviation_uncertainty: evidence.uncertainty,
            interval: evidence.interval,
            steadiness: evidence.verdict(limits),
            impacts_per_cycle: place.impacts as f32 / self.cycles.max(1) as f32,
            start_tick: place.start_tick,
            end_tick: place.end_tick,
        }
    }

    /// What the dwell says about the limit of X/Z. `raised` is the noise's share in the cycle maxima.
    ///
    /// A cycle's maximum is the larger of two peaks of |x|, so a free vibration that beats with the drive raises it in the first
    /// order. The maxima are therefore extrapolated too: their part above the amplitude at the drive frequency decays with it.
    fn evidence(&self, mean_max: f32, noise: f32, raised: f32, z_amplitude: f32, scatter: f32) -> Evidence {
        let limit =
            |approach: &Approach| approach.limit().filter(|limit| limit.amplitude > 0.0).unwrap_or(FitLimit::UNKNOWN);
        let (x, z) = (limit(&self.x_approach), limit(&self.z_approach));
        let is_known = x.amplitude > 0.0 && z.amplitude > 0.0 && z_amplitude > 0.0 && mean_max > 0.0;
        let (deviation, uncertainty) = if is_known {
            let late_cycles = self.cycles.saturating_sub(self.late_from).max(1);
            let excess = self.excess.value() / self.cycles as f32;
            let late_excess = self.late_excess.value() / late_cycles as f32;
            let x_amplitude =
                if x.unexplained >= IRREGULAR { self.x_approach.modulus_of_mean() } else { mean_max + raised - excess };
            let moved = x_amplitude / x.amplitude * (z.amplitude / z_amplitude) - 1.0;
            let risen = x.above_limit(excess, late_excess) / mean_max;
            let (of_x, of_z) = (x.uncertainty / x.amplitude, z.uncertainty / z.amplitude);
            let of_limits = 2.0 * Scalar::sqrt(of_x * of_x + of_z * of_z);
            let (of_fit, of_rise) = (of_limits + UNCERTAINTY_OF_FIT * moved.abs(), UNCERTAINTY_OF_FIT * risen);
            let of_both = Scalar::sqrt(of_fit * of_fit + of_rise * of_rise);
            (moved + risen, of_both + UNCERTAINTY_OF_RAISED * noise / mean_max)
        } else {
            (f32::MAX, f32::MAX)
        };
        let relative = |value: f32| if mean_max > 0.0 { value / mean_max } else { f32::MAX };
        Evidence {
            deviation,
            uncertainty,
            converges: x.converges,
            unexplained: x.unexplained,
            scatter,
            noise: relative(MAXIMUM_SCATTER * noise),
            interval: self.maxima.half_width().map_or(f32::MAX, relative),
            drifts: self.maxima.drifts(),
        }
    }
}

/// Relative uncertainty of each part of an extrapolated deviation (95 %): a nonlinear system does not approach its limit exponentially,
/// and a dwell has only some phases of a beat.
const UNCERTAINTY_OF_FIT: f32 = 0.3;

/// Uncertainty of [`raised_maximum`] over the RMS noise of a tick (95 %): the noise is known to about 5 %.
const UNCERTAINTY_OF_RAISED: f32 = 0.3;

/// RMS scatter of a cycle's maximum over the RMS noise of a tick.
const MAXIMUM_SCATTER: f32 = 0.5;

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
        let (mut phase, mut meter) = (Phase::default(), PointMeter::new(20, 0.0));
        while meter.cycles() < 20 {
            let multiple = |n: u32| Phase(phase.0.wrapping_mul(n)).sin_cos();
            let (first, second, fifth) = (multiple(1), multiple(2), multiple(5));
            let z = 1e-3 * (first.0 + 0.03 * second.1 + 0.04 * fifth.0) + 2e-4;
            let readings = Readings { z: Reading::still(z), ..Readings::default() };
            meter.push(&readings, 2e-3 * first.1, first);
            if phase.advance(increment) {
                meter.end_cycle(0.0);
            }
        }
        let result = meter.result(&Place::default(), &SteadyLimits::default());
        // Cycles end on a tick. One tick of 20 × 400 adds 2 · 1.2/8000 to a harmonic.
        assert!((result.z_distortion - 0.05).abs() < 3e-4, "{}", result.z_distortion);
        assert!((result.drive_amplitude_m / 2e-3 - 1.0).abs() < 3e-4, "{}", result.drive_amplitude_m);
    }

    /// The result of 30 cycles of x at 2.5 Hz whose amplitude in cycle n is `amplitude(n)`.
    fn measured(amplitude: impl Fn(u32) -> f32) -> PointResult {
        let increment = Phase::increment(2.5, 1000.0);
        let (mut phase, mut meter) = (Phase::default(), PointMeter::new(30, 0.0));
        while meter.cycles() < 30 {
            let wave = phase.sin_cos();
            let (x, z) = (amplitude(meter.cycles()) * wave.0, 1e-3 * wave.0);
            let readings = Readings { x: Reading::still(x), z: Reading::still(z), ..Readings::default() };
            meter.push(&readings, z, wave);
            if phase.advance(increment) {
                meter.end_cycle(0.0);
            }
        }
        meter.result(&Place { frequency_hz: 2.5, ..Place::default() }, &SteadyLimits::default())
    }

    #[test]
    fn a_motion_that_repeats_after_two_cycles_is_stationary_and_one_that_alternates_less_and_less_is_not() {
        let sign = |n: u32| if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        let lasting = measured(|n| 5e-3 * (1.0 + 0.04 * sign(n)));
        assert_eq!(lasting.steadiness, Steadiness::Stationary, "{lasting:?}");
        let decaying = measured(|n| 5e-3 * (1.0 + 0.2 * sign(n) * libm::powf(0.95, n as f32)));
        assert_eq!(decaying.steadiness, Steadiness::NotSteady, "{decaying:?}");
        let same = measured(|_| 5e-3);
        assert_eq!(same.steadiness, Steadiness::Steady, "{same:?}");
        assert!(same.deviation.abs() < 1e-4 && same.deviation_uncertainty < 1e-3, "{same:?}");
    }
}
