//! Base motion tick by tick: as the campaign commands it, and as the run measured it.
//!
//! **Commanded**: the drive is computed as on the board, with its phase accumulator and ramp. The simulated base follows it
//! exactly, two ticks late, as a base that follows its drive exactly does on the virtual rig, and later by the delay of the sensors,
//! which read x and z later by it.
//!
//! **Measured**: z is read as the mean of a tick, whose middle is 0.45 ticks before the tick's end. The integrator needs z at the ends
//! of the ticks. A parabola through the readings of ± m ticks gives it: m = 1, or more for a friction damper, to keep the sensor's
//! noise out of the base's velocity, on which the damper slips. With the angular frequency Ω of the motion in rad per tick, it lowers
//! an amplitude by about (mΩ)⁴/93, and it spreads a jump of the base's velocity over ± m ticks.

use damprig_core::control::outcome::{ExperimentStage, TickInputs};
use damprig_core::control::transient::playback::{PlaybackPlan, PlaybackRunner};
use damprig_core::io::{DriveRange, Readings, SensorSet, TICK_HZ};
use damprig_core::sine::Phase;
use damprig_motion::read_run::TICK_S;

use crate::campaign::Playback;

/// Ticks from a drive to the end of the tick in which an ideal base has followed it.
const FOLLOWS_AFTER: i64 = 2;

/// Ticks from the middle of a tick's sub-samples to the tick's end.
const MEAN_TO_END: f64 = 0.45;

/// Mean of the squared distances of a tick's ten sub-samples from their middle: the mean of a parabola t² over them.
const MEAN_OF_SQUARES: f64 = 0.0825;

/// Half-widths of the parabola, ticks: without noise, and for a friction damper under noise, which would break its sticking.
const INTERPOLATED: usize = 1;
const SMOOTHED: usize = 12;

/// Noise of z above which a friction damper's base is smoothed, m: rounding is below.
const MIN_NOISE_M: f64 = 1e-8;

/// Base motion over some ticks: z at their ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BaseMotion {
    /// From two ticks before the first tick to one tick after the last, m.
    pub(super) ends_m: Vec<f64>,
    /// The same, read with a parabola of another width: a friction damper slips on the base's velocity, which is known as well as both
    /// readings agree.
    pub(super) otherwise_m: Option<Vec<f64>>,
}

impl BaseMotion {
    /// A base at rest for this many ticks.
    pub(super) fn at_rest(ticks: usize) -> Self {
        Self { ends_m: vec![0.0; ticks + 3], otherwise_m: None }
    }

    /// The base that follows a drive exactly, as sensors of this delay read it. Between its ticks the drive is a parabola: with Ω in rad
    /// per tick, it shifts a phase by at most Ω³/16, and leaves an amplitude as it is within Ω⁴/42.
    pub(super) fn following(drive_m: &[f32], delay_s: f64) -> Self {
        let at = |n: i64| usize::try_from(n).ok().and_then(|n| drive_m.get(n)).map_or(0.0, |z| f64::from(*z));
        let last = drive_m.len() as i64;
        let late = delay_s / TICK_S;
        let (whole, rest) = (late.round() as i64, late - late.round());
        let end = |n: i64| {
            let [before, own, after] = [-1, 0, 1].map(|beside| at(n - FOLLOWS_AFTER - whole + beside));
            own + rest * (0.5 * (before - after) + 0.5 * rest * (before - 2.0 * own + after))
        };
        Self { ends_m: (-2..=last).map(end).collect(), otherwise_m: None }
    }

    /// The base as measured. `z_m` has the readings of the ticks, and `beyond` more at either end for the parabolas. `slips`: under a
    /// friction damper.
    pub(super) fn measured(z_m: &[f32], beyond: usize, slips: bool, z_noise_m: f64) -> Self {
        let (width, other) = match (slips, z_noise_m > MIN_NOISE_M) {
            (false, _) => (INTERPOLATED, None),
            (true, false) => (INTERPOLATED, Some(2 * INTERPOLATED)),
            (true, true) => (SMOOTHED, Some(SMOOTHED / 2)),
        };
        Self { ends_m: read(z_m, beyond, width), otherwise_m: other.map(|width| read(z_m, beyond, width)) }
    }

    /// The same motion times a factor.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        let scaled = |ends_m: &Vec<f64>| ends_m.iter().map(|z| z * factor).collect();
        Self { ends_m: scaled(&self.ends_m), otherwise_m: self.otherwise_m.as_ref().map(scaled) }
    }
}

/// z at the ends of the ticks, from readings with `beyond` more at either end.
fn read(z_m: &[f32], beyond: usize, half_width: usize) -> Vec<f64> {
    let weights = parabola_weights(half_width);
    let last = z_m.len() as i64 - 1;
    let at = |n: i64| f64::from(z_m[n.clamp(0, last) as usize]);
    let reach = half_width as i64;
    let end = |n: i64| weights.iter().zip(-reach..).map(|(weight, beside)| weight * at(n + beside)).sum();
    let (from, ticks) = (beyond as i64, z_m.len() as i64 - 2 * beyond as i64);
    (from - 2..=from + ticks).map(end).collect()
}

/// Weights of the means of the ticks −m … m in z at the end of tick 0, by the parabola fitted to them by least squares.
fn parabola_weights(half_width: usize) -> Vec<f64> {
    let reach = half_width as i64;
    let places = || (-reach..=reach).map(|t| t as f64);
    let n = (2 * half_width + 1) as f64;
    let (s2, s4) = (places().map(|t| t * t).sum::<f64>(), places().map(|t| t.powi(4)).sum::<f64>());
    let determinant = n * s4 - s2 * s2;
    let curved = MEAN_TO_END * MEAN_TO_END - MEAN_OF_SQUARES;
    let weight = |t: f64| {
        let [level, slope, bend] = [(s4 - s2 * t * t) / determinant, t / s2, (n * t * t - s2) / determinant];
        level + MEAN_TO_END * slope + curved * bend
    };
    places().map(weight).collect()
}

/// A frequency of a drive, from a tick on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrequencyStep {
    pub(super) from_tick: u64,
    pub(super) frequency_hz: f64,
}

/// The drive of one or several frequencies, tick by tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SineDrive {
    /// First tick.
    pub(super) from_tick: u64,
    /// Demand of each tick, m.
    pub(super) demand_m: Vec<f32>,
    /// Phase of each tick.
    pub(super) phases: Vec<Phase>,
}

impl SineDrive {
    /// The drive that begins with the first step, up to `end_tick`, with a ramp at its beginning.
    pub(super) fn new(steps: &[FrequencyStep], end_tick: u64, amplitude_m: f64, ramp_s: f64) -> Self {
        let rise = if ramp_s > 0.0 { 1.0 / (ramp_s as f32 * TICK_HZ) } else { 1.0 };
        let mut drive = Self { from_tick: steps.first().map_or(0, |step| step.from_tick), ..Self::default() };
        let (mut phase, mut gain) = (Phase::default(), 0.0_f32);
        for (n, step) in steps.iter().enumerate() {
            let until = steps.get(n + 1).map_or(end_tick, |next| next.from_tick);
            let increment = Phase::increment(step.frequency_hz as f32, TICK_HZ);
            for _ in step.from_tick..until {
                gain = (gain + rise).min(1.0);
                let ramp = gain * gain * (3.0 - 2.0 * gain);
                drive.demand_m.push(ramp * (amplitude_m as f32 * phase.sin_cos().0));
                drive.phases.push(phase);
                phase.advance(increment);
            }
        }
        drive
    }
}

/// Whole cycles of a drive from rest before a dwell that begins at the first cycle after the settling time.
pub(super) fn least_cycles(frequency_hz: f64, settle_s: f64) -> u64 {
    let settle_ticks = (f64::from(settle_s as f32) * f64::from(TICK_HZ) + 0.5) as u64;
    let mut cycles = (settle_s * frequency_hz - 1.0).floor().max(0.0) as u64;
    while ticks_of(cycles, frequency_hz) < settle_ticks {
        cycles += 1;
    }
    cycles
}

/// Ticks from the beginning of a drive to the first tick after this many cycles.
pub(super) fn ticks_of(cycles: u64, frequency_hz: f64) -> u64 {
    let increment = u64::from(Phase::increment(frequency_hz as f32, TICK_HZ)).max(1);
    let ticks = (u128::from(cycles) << 32).div_ceil(u128::from(increment));
    u64::try_from(ticks).unwrap_or(u64::MAX)
}

/// The demand of a playback, tick by tick from its beginning, as the board computes it.
pub(super) fn played(playback: &Playback, range: &DriveRange, ticks: usize) -> Vec<f32> {
    let Ok(plan) = PlaybackPlan::new(playback.order()) else { return vec![0.0; ticks] };
    let record: Vec<i16> = playback.bytes().as_chunks::<2>().0.iter().map(|two| i16::from_le_bytes(*two)).collect();
    let mut runner = PlaybackRunner::new(&plan, range);
    let readings = Readings::default();
    let mut demands = Vec::with_capacity(ticks);
    for tick in 0.. {
        let inputs = TickInputs { tick, readings: &readings, impacts: 0, clipped: SensorSet::default() };
        let (demand, _) = runner.tick(&record, &inputs);
        if runner.stage() == ExperimentStage::Dwell {
            demands.push(demand);
        }
        if demands.len() >= ticks || tick == u32::MAX {
            break;
        }
    }
    demands
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn a_measured_sine_is_shifted_to_the_ends_of_its_ticks() {
        let omega = TAU * 2.5e-3;
        // The mean of ten sub-samples, the last at the end of the tick.
        let mean = |tick: f64| (1..=10).map(|n| (omega * (tick + 0.1 * f64::from(n))).sin()).sum::<f64>() * 1e-4;
        let readings: Vec<f32> = (0..800).map(|n| mean(f64::from(n)) as f32).collect();
        for half_width in [INTERPOLATED, SMOOTHED] {
            let ends_m = read(&readings, 20, half_width);
            assert_eq!(ends_m.len(), 760 + 3);
            let scaled = half_width as f64 * omega;
            // (mΩ)⁴/93, a bias of the slope of (mΩ)²/10 over 0.45 ticks, the term of third order, and single precision.
            let error =
                1e-3 * (scaled.powi(4) / 93.0 + 0.45 * omega * scaled.powi(2) / 10.0 + omega.powi(3) / 6.0 + 2e-7);
            for (n, end) in ends_m.iter().enumerate() {
                let exact = 1e-3 * (omega * (n as f64 + 18.0 + 1.0)).sin();
                assert!((end - exact).abs() < error, "{half_width} {n}: {end} {exact}");
            }
        }
    }

    #[test]
    fn a_base_that_follows_its_drive_is_read_late() {
        let omega = TAU * 2.5e-3;
        let drive: Vec<f32> = (0..800).map(|n| (omega * f64::from(n)).sin() as f32).collect();
        for delay_s in [0.0, 0.4e-3, 1.147e-3, 1.5e-3] {
            let ends_m = BaseMotion::following(&drive, delay_s).ends_m;
            for (n, end) in ends_m.iter().enumerate().skip(10) {
                let exact = (omega * (n as f64 - 4.0 - 1e3 * delay_s)).sin();
                // Ω³/16, Ω⁴/42 and single precision.
                assert!((end - exact).abs() < omega.powi(3) / 16.0 + 1e-7, "{delay_s} {n}: {end} {exact}");
            }
        }
    }

    #[test]
    fn a_dwell_begins_at_the_first_cycle_after_the_settling_time() {
        assert_eq!(least_cycles(2.5, 0.0), 0);
        assert_eq!(least_cycles(2.5, 1.0), 3, "two and a half cycles");
        assert_eq!(least_cycles(2.5, 1.2), 3);
        assert_eq!(
            ticks_of(3, 2.5),
            1201,
            "the phase step is rounded down, so the third cycle ends just after tick 1200"
        );
        assert_eq!(ticks_of(1, 2.3), 435, "434.8 ticks");
    }

    #[test]
    fn a_drive_keeps_its_phase_from_frequency_to_frequency() {
        let steps =
            [FrequencyStep { from_tick: 0, frequency_hz: 2.5 }, FrequencyStep { from_tick: 400, frequency_hz: 5.0 }];
        let drive = SineDrive::new(&steps, 500, 1e-3, 0.0);
        assert_eq!(drive.demand_m.len(), 500);
        assert!((drive.demand_m[100] - 1e-3).abs() < 1e-9 && (drive.demand_m[450] - 1e-3).abs() < 1e-9);
    }
}
