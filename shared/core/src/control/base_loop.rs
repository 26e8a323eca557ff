//! Closed-loop control of the base amplitude: the base moves as `Z sin φ` under any load by the structure.
//!
//! # Plant
//! A shaker in voltage mode is a velocity source with a resistance R = (Bl)²/R_coil, on which its load pulls. The
//! transfer function from drive to base has the structure's own poles as *zeros*: at fn, damped by only σ = ζω (0.06 /s
//! at ζ = 0.0038). Let u and z be the slowly varying complex amplitudes at the drive frequency, δ the distance of the
//! drive frequency from fn (rad/s) and κ = Mω²/2R. Near the zeros,
//!
//! ```text
//! z/u = h(s) = (s + σ + jδ)/(s + σ + κ + jδ)
//! ```
//! At fn a steady drive therefore gives a base that first moves as without load and then sags by 1 + κ/σ (six times
//! with the default shaker) over some seconds. The drive must follow the slow changes of the structure's amplitude.
//!
//! # Control law
//! An integrator `u̇ = K (Z − z)` on the lock-in of every cycle T acts on a value that is T old. Its bound is K T < 1
//! (below, with τ = T), so K is about 1 /s in practice. The sag then runs ahead of the integrator by κ/(K + κ) = 25 %,
//! which fades with the structure as e^(−σt): a minute. The same integrator therefore runs at every tick, in the frame
//! that rotates with the drive. In the fixed frame it is
//!
//! ```text
//! C(s) = (2K/Ωc) s²/(s² + Ω²),   e = Z sin φ − z
//! u = (2K/Ωc) e + S sin φ + Q cos φ,   Ṡ = −2K (Ω/Ωc) e cos φ,   Q̇ = 2K (Ω/Ωc) e sin φ
//! ```
//! with Ωc the frequency at which the drive is calibrated. This is a resonator. Its frequency is always exact, because
//! φ is the drive's phase. It neither responds to the mean of z nor drives it.
//!
//! # Stability
//! With the table's admittance under load Y(s) = 1/(ms + R + k/s + Z_load(s)) the open loop is
//!
//! ```text
//! L(s) = 2K · s/(s² + Ω²) · R Y(s)
//! ```
//! The first factor is positive real. The second is the admittance of a dissipative table with a *passive* load. A loop
//! of a passive and a strictly passive part is stable for every K > 0 and every passive load, linear or nonlinear: bare
//! structure, impacts and friction alike. At ζ = 0.0038 this shows in the envelope's poles,
//! s (s + σ + κ + jδ) + K (s + σ + jδ) = 0. For K ≫ κ one pole is at −K and one at −(σ + jδ)(1 − κ/K), damped for every
//! δ.
//!
//! The limit on K comes from the delay τ from drive to reading. Two ticks of it are known ([`DELAY_TICKS`]), and the
//! correlation uses the phase of two ticks before. R Y lies in the disk over [0, 1] (its real part is at least its
//! modulus squared), so where its phase is −α its modulus is at most cos α. The loop's phase reaches −180° at the
//! frequency where ωτ = π/2 − α. There its modulus is at most 2K ω sin(ωτ)/(ω² − Ω²), which above 2Ω is less than (8/3)
//! K τ.
//! So **K < 3/(8τ)** for every passive load: 94 /s at τ = 4 ms. [`MAX_GAIN_PER_S`] is below half of it. Near Ω an
//! uncompensated phase θ = Ωτ could at worst excite an envelope at K θ²/4 (10⁻³ /s for a further 1 ms), below the
//! structure's own σ.
//!
//! # Settling
//! After a start on a bare structure at fn, the first error is κ/(K + κ) (1.6 % at K = 20 /s). It fades with e^(−σt);
//! beside fn it beats with δ. The error with a damped structure is smaller and shorter. A point is measured only after
//! the amplitude has been within tolerance for [`HELD_CYCLES`]. If the amplitude leaves the tolerance, the measurement
//! starts again, until the longest wait is over. After that the point is measured in any case.
//!
//! # Other shakers
//! In *current* mode the table is a mass whose only resistance is that of its suspension. It is passive too, but with
//! little margin against the delay: it keeps Z and overshoots by a quarter
//! (`shared/simulator/tests/integration/base_loop.rs`). On a displacement source, or with a wrong sign, the loop is
//! unstable, and [`BaseLoop::runaway`] ends it.

use crate::io::{DriveScale, Invalid, positive, require};
use crate::measure::lock_in::LockIn;
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest K, 1/s.
pub const MAX_GAIN_PER_S: f32 = 40.0;

/// Ticks from a drive value to the block of samples that shows it: one tick of waiting, half a tick of hold, half a
/// block of averaging.
pub const DELAY_TICKS: u32 = 2;

/// Consecutive cycles within the tolerance after which the base counts as held.
pub const HELD_CYCLES: u32 = 3;

/// Half of a cycle's travel, relative to the demanded amplitude, at which the loop is stopped. It detects a runaway at
/// any frequency.
pub const RUNAWAY: f32 = 1.5;

/// Parameters of the closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ClosedLoop {
    /// K, 1/s: the rate at which an amplitude error decays without load; greater than 0, at most [`MAX_GAIN_PER_S`].
    pub gain_per_s: f32,
    /// Frequency at which the drive is calibrated, Hz: there the unloaded table moves by the demanded amplitude (twice
    /// the movement is twice the gain); greater than 0.
    pub calibrated_at_hz: f32,
    /// Relative error of the amplitude within which the base counts as held; 0.001 to 0.5.
    pub tolerance: f32,
    /// Longest time to wait after settling for the base to be held, s; from 0 to 3600.
    pub wait_s: f32,
    /// Limit of |drive|, m; greater than 0, at most what the drive can deliver.
    pub drive_limit_m: f32,
}

impl Default for ClosedLoop {
    /// The drive limit is the range of the drive as delivered.
    fn default() -> Self {
        let drive_limit_m = DriveScale::default().range().amplitude_m();
        Self { gain_per_s: 20.0, calibrated_at_hz: 2.5, tolerance: 0.01, wait_s: 120.0, drive_limit_m }
    }
}

impl ClosedLoop {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let gain = f64::from(self.gain_per_s);
        positive("drive.gain_per_s", gain)?;
        require(self.gain_per_s <= MAX_GAIN_PER_S, "drive.gain_per_s", gain, "at most 40")?;
        positive("drive.calibrated_at_hz", f64::from(self.calibrated_at_hz))?;
        let tolerance = f64::from(self.tolerance);
        // The amplitude over one cycle is known to one tick of the cycle.
        require((0.001..=0.5).contains(&self.tolerance), "drive.tolerance", tolerance, "from 0.001 to 0.5")?;
        let wait = f64::from(self.wait_s);
        require((0.0..=3600.0).contains(&self.wait_s), "drive.wait_s", wait, "from 0 to 3600")?;
        positive("drive.drive_limit_m", f64::from(self.drive_limit_m))
    }
}

/// State of the closed loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct BaseLoop {
    /// 2K Ω/Ωc per tick.
    step: f32,
    /// 2K/Ωc.
    proportional: f32,
    limit: f32,
    tolerance: f32,
    /// S and Q, m.
    sine: f32,
    cosine: f32,
    lock_in: LockIn,
    ticks_per_cycle: f32,
    amplitude: f32,
    /// Lowest and highest z of the cycle, m.
    travel: Option<(f32, f32)>,
    half_travel: f32,
    held: u32,
    /// Whether the drive was at its limit in the last tick.
    saturated: bool,
}

impl BaseLoop {
    /// A loop with validated parameters and no drive.
    #[must_use]
    pub fn new(parameters: &ClosedLoop) -> Self {
        Self { limit: parameters.drive_limit_m, tolerance: parameters.tolerance, ..Self::default() }
    }

    /// Changes the frequency; the drive's amplitude and phase carry over.
    pub fn tune(&mut self, parameters: &ClosedLoop, frequency_hz: f32, tick_hz: f32) {
        self.step = 2.0 * parameters.gain_per_s * (frequency_hz / parameters.calibrated_at_hz) / tick_hz;
        self.proportional = 2.0 * parameters.gain_per_s / (core::f32::consts::TAU * parameters.calibrated_at_hz);
        self.ticks_per_cycle = tick_hz / frequency_hz;
    }

    /// Begins a point: its amplitude is measured anew.
    pub fn begin_point(&mut self) {
        self.lock_in = LockIn::default();
        self.held = 0;
        self.amplitude = 0.0;
        self.travel = None;
        self.half_travel = 0.0;
    }

    /// Runs one tick. `target_m` are the components of the demanded z in phase with the sine and with the cosine; `then` is the
    /// sine and cosine of the phase that the samples belong to; `now` is that of this tick. Returns the drive, m.
    pub fn tick(&mut self, target_m: (f32, f32), z_m: f32, then: (f32, f32), now: (f32, f32)) -> f32 {
        self.lock_in.push(z_m, then);
        let (low, high) = self.travel.unwrap_or((z_m, z_m));
        self.travel = Some((low.min(z_m), high.max(z_m)));
        let error = target_m.0 * then.0 + target_m.1 * then.1 - z_m;
        self.sine -= self.step * error * then.1;
        self.cosine += self.step * error * then.0;
        let square = self.sine * self.sine + self.cosine * self.cosine;
        let is_too_much = square > self.limit * self.limit;
        if is_too_much {
            let scale = self.limit / Scalar::sqrt(square);
            self.sine *= scale;
            self.cosine *= scale;
        }
        let drive = self.proportional * error + self.open(now);
        self.saturated = is_too_much || drive.abs() > self.limit;
        drive.max(-self.limit).min(self.limit)
    }

    /// The drive without feedback, at its last amplitude and phase, m.
    #[must_use]
    pub fn open(&self, now: (f32, f32)) -> f32 {
        self.sine * now.0 + self.cosine * now.1
    }

    /// Closes a cycle of the phase that the samples belong to.
    pub fn end_cycle(&mut self, target_m: f32) {
        self.lock_in.end_cycle(0.0);
        // The nominal length: with z in phase with the sine, one tick more or less at the cycle's end adds nothing.
        let samples = self.ticks_per_cycle;
        self.amplitude = Scalar::sqrt(self.lock_in.squared_amplitude(1.0)) / samples;
        self.lock_in = LockIn::default();
        self.half_travel = self.travel.take().map_or(0.0, |(low, high)| (high - low) * 0.5);
        let within = (self.amplitude - target_m).abs() <= self.tolerance * target_m;
        self.held = if within { self.held.saturating_add(1) } else { 0 };
    }

    /// The base has been within the tolerance for [`HELD_CYCLES`].
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held >= HELD_CYCLES
    }

    /// Half of the last cycle's travel, m, if it is [`RUNAWAY`] times the target or more.
    #[must_use]
    pub fn runaway(&self, target_m: f32) -> Option<f32> {
        (self.half_travel >= RUNAWAY * target_m).then_some(self.half_travel)
    }

    /// The drive was at its limit in the last tick.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.saturated
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Complex = (f64, f64);

    fn times(a: Complex, b: Complex) -> Complex {
        (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
    }

    fn root(a: Complex) -> Complex {
        let (modulus, half) = (libm::sqrt(libm::hypot(a.0, a.1)), libm::atan2(a.1, a.0) / 2.0);
        (modulus * libm::cos(half), modulus * libm::sin(half))
    }

    /// Both roots of s (s + σ + κ + jδ) + K (s + σ + jδ).
    fn envelope_poles(sigma: f64, kappa: f64, delta: f64, gain: f64) -> [Complex; 2] {
        let b = (sigma + kappa + gain, delta);
        let square = times(b, b);
        let r = root((square.0 - 4.0 * gain * sigma, square.1 - 4.0 * gain * delta));
        [((r.0 - b.0) / 2.0, (r.1 - b.1) / 2.0), ((-r.0 - b.0) / 2.0, (-r.1 - b.1) / 2.0)]
    }

    #[test]
    fn the_envelope_is_damped_for_every_gain_load_and_distance_from_resonance() {
        for exponent in -3..=3i8 {
            let kappa = libm::pow(10.0, f64::from(exponent));
            for gain in [0.01, 1.0, 20.0, f64::from(MAX_GAIN_PER_S)] {
                for n in -100..=100i8 {
                    let delta = f64::from(n) * 0.05;
                    let poles = envelope_poles(0.0597, kappa, delta, gain);
                    assert!(poles.iter().all(|p| p.0 < 0.0), "κ {kappa}, K {gain}, δ {delta}: {poles:?}");
                }
            }
        }
    }

    #[test]
    fn at_high_gain_a_pole_is_near_the_structures_zero() {
        let (sigma, kappa, delta, gain) = (0.0597, 0.326, 0.3, 20.0);
        let [slow, _] = envelope_poles(sigma, kappa, delta, gain);
        let share = 1.0 - kappa / gain;
        // The next order of the expansion is (κ/K)².
        assert!((slow.0 / (-sigma * share) - 1.0).abs() < 2e-3, "{slow:?}");
        assert!((slow.1 / (-delta * share) - 1.0).abs() < 2e-3, "{slow:?}");
    }

    /// K < 3/(8τ): at it, the loop's modulus at −180° stays below 1 for every admittance R Y in the disk over [0, 1].
    #[test]
    fn the_delay_bound_holds_for_every_passive_load() {
        let (omega, delay) = (core::f64::consts::TAU * 2.5, 4e-3);
        let gain = 3.0 / (8.0 * delay);
        assert!(f64::from(MAX_GAIN_PER_S) < gain / 2.0);
        for n in 0..=1000u16 {
            let at = 2.0 * omega * libm::pow(1.004, f64::from(n));
            if at * delay < core::f64::consts::FRAC_PI_2 {
                let modulus = 2.0 * gain * at * libm::sin(at * delay) / (at * at - omega * omega);
                assert!(modulus <= 1.0, "{at}: {modulus}");
            }
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused_by_name() {
        let name = |loop_: ClosedLoop| loop_.validate().unwrap_err().parameter;
        assert_eq!(name(ClosedLoop { gain_per_s: 41.0, ..ClosedLoop::default() }), "drive.gain_per_s");
        assert_eq!(name(ClosedLoop { tolerance: 0.0, ..ClosedLoop::default() }), "drive.tolerance");
        assert_eq!(name(ClosedLoop { wait_s: f32::NAN, ..ClosedLoop::default() }), "drive.wait_s");
        assert_eq!(name(ClosedLoop { drive_limit_m: 0.0, ..ClosedLoop::default() }), "drive.drive_limit_m");
        assert!(ClosedLoop::default().validate().is_ok());
    }
}
