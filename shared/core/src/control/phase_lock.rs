//! Phase-locked loop: the drive's frequency is whatever keeps the phase of x relative to z. At −90° the structure is at
//! resonance, at every amplitude.
//!
//! # Plant
//! In the frame that rotates with the drive's phase, near resonance, the response a to the base u obeys
//! ȧ = −λ a − j (Ω/2) u with λ = σ − jδ and the detuning δ = ωn − Ω ([`super::response_loop`]). A damper makes σ and ωn functions
//! of |a|. Where the motion repeats, a/u = −j (Ω/2)/λ: its phase is −90° + arctan(δ/σ), and it is above −90° below the
//! resonance.
//!
//! # Control law
//! e is the sine of the difference between the phase and the kept phase θ, ±1 beyond a quarter of a cycle, from means over the
//! last whole cycle of x and z, renewed 16 times a cycle ([`CycleWindow`]). The gain g is for each cycle; f = Ω/2π.
//!
//! *The base's amplitude is given*: proportional and integral in the phase,
//!
//! ```text
//! Ω = q + g f e,   q̇ = (g f/2)² e
//! ```
//! Near resonance the phase follows the frequency as ψ̇ = δ − σ e, so the deviation obeys s² + (σ + g f) s + (g f/2)² = 0: both
//! roots are near −g f/2 where σ is much smaller. At a larger σ, and beside the resonance, the slower one is about
//! −k σ/(σ² + δ² + g f σ + k), k = (g f/2)². The amplitude approaches its limit with the structure's own σ. A delay of half a
//! window and half a part, 0.53 cycles, allows the proportional term alone g up to π/2/0.53 = 3. It must be the base whose
//! amplitude is given, and its phase: the drive of a shaker that yields to the structure is not enough. There z answers a
//! detuning at once and the loop hunts.
//!
//! *The response's amplitude is kept*: |a| is constant, so λ is too, and u tells it at once. The detuning from the frequency with
//! the phase θ is (Ω/2) |u/a| e, divided by the sine of −θ. It is integrated,
//!
//! ```text
//! Ω̇ = (g f/4) (Ω/2) |u/a| e
//! ```
//! A deviation of the frequency decays at the rate (g f/4) |sin θ| for every damper, and there is one frequency for every
//! amplitude of x, also where several belong to the same Z. The loop of the response is several times faster.
//!
//! # Lock, loss and range
//! The loop begins when the drive is at its full height, and waits until both means are of whole cycles at that. The frequency
//! stays within its range. The loop is locked when |e| has been within the tolerance at the end of [`HELD_CYCLES`] cycles;
//! the lock is lost when |e| is above [`LOST`] times the tolerance. A part of a cycle with a missing reading changes
//! nothing.

use super::base_loop::HELD_CYCLES;
use crate::io::{Invalid, positive, require};
use crate::measure::cycle_window::{CycleWindow, PARTS};
use crate::scalar::Scalar;
use crate::sine::Phase;
use core::f32::consts::{PI, TAU};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Least g: single precision moves the frequency in steps.
pub const MIN_GAIN_PER_CYCLE: f32 = 0.1;

/// Largest g.
pub const MAX_GAIN_PER_CYCLE: f32 = 1.5;

/// The lock is lost beyond this multiple of the tolerance. Noise of one tolerance's size does not end a measurement.
pub const LOST: f32 = 3.0;

/// Largest |u/a| of the integrator: beyond it the structure is far from resonance.
const MAX_RATIO: f32 = 1.0;

/// Parts of a cycle at full drive after which both means are of whole cycles.
const FILLED_PARTS: u32 = 2 * PARTS as u32;

/// Parameters of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PhaseLock {
    /// θ: the kept phase of x relative to z, rad; from −5π/6 to −π/6 (−150° to −30°).
    pub phase_rad: f32,
    /// Frequency at which the loop starts, Hz; within its range.
    pub start_hz: f32,
    /// Lowest frequency, Hz.
    pub low_hz: f32,
    /// Highest frequency, Hz; above the lowest.
    pub high_hz: f32,
    /// g: the rate of the loop, for each cycle; from [`MIN_GAIN_PER_CYCLE`] to [`MAX_GAIN_PER_CYCLE`].
    pub gain_per_cycle: f32,
    /// Deviation of the phase within which it counts as kept, rad; 0.001 to 0.2.
    pub tolerance_rad: f32,
    /// Longest time to wait after settling for the lock, s; from 0 to 3600.
    pub wait_s: f32,
}

impl PhaseLock {
    /// The loop as delivered, in this range of frequencies, Hz. It keeps −90° and starts in the middle.
    #[must_use]
    pub fn new(low_hz: f32, high_hz: f32) -> Self {
        Self {
            phase_rad: -PI / 2.0,
            start_hz: 0.5 * (low_hz + high_hz),
            low_hz,
            high_hz,
            gain_per_cycle: 1.0,
            tolerance_rad: 2.0 * PI / 180.0,
            wait_s: 120.0,
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let phase = f64::from(self.phase_rad);
        let is_lagging = (-5.0 * PI / 6.0 - 1e-6..=-PI / 6.0 + 1e-6).contains(&self.phase_rad);
        require(is_lagging, "lock.phase_rad", phase, "from −5π/6 to −π/6")?;
        positive("lock.low_hz", f64::from(self.low_hz))?;
        require(self.high_hz > self.low_hz, "lock.high_hz", f64::from(self.high_hz), "greater than low_hz")?;
        let is_within = (self.low_hz..=self.high_hz).contains(&self.start_hz);
        require(is_within, "lock.start_hz", f64::from(self.start_hz), "from low_hz to high_hz")?;
        let gain = f64::from(self.gain_per_cycle);
        let is_gain = (MIN_GAIN_PER_CYCLE..=MAX_GAIN_PER_CYCLE).contains(&self.gain_per_cycle);
        require(is_gain, "lock.gain_per_cycle", gain, "from 0.1 to 1.5")?;
        let tolerance = f64::from(self.tolerance_rad);
        require((0.001..=0.2).contains(&self.tolerance_rad), "lock.tolerance_rad", tolerance, "from 0.001 to 0.2")?;
        let wait = f64::from(self.wait_s);
        require((0.0..=3600.0).contains(&self.wait_s), "lock.wait_s", wait, "from 0 to 3600")
    }
}

/// A tick's sample of x and z.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// x and z, m; `None` if one is no displacement.
    pub reading: Option<(f32, f32)>,
    /// Phase of the samples, and its increment to the next ones.
    pub phase: u32,
    /// As above.
    pub increment: u32,
    /// Sine and cosine of that phase.
    pub wave: (f32, f32),
}

/// State of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct PhaseTracker {
    parameters: Option<PhaseLock>,
    /// Sine and cosine of θ.
    kept: (f32, f32),
    x: CycleWindow,
    z: CycleWindow,
    tick_hz: f32,
    /// q/2π, Hz.
    integral_hz: f32,
    frequency_hz: f32,
    error: f32,
    /// Parts of a cycle since the drive is at its full height.
    parts: u32,
    is_unread: bool,
    held: u32,
}

impl PhaseTracker {
    /// A loop with validated parameters at its first frequency.
    #[must_use]
    pub fn new(parameters: &PhaseLock, tick_hz: f32) -> Self {
        let frequency_hz = parameters.start_hz;
        let kept = Phase((parameters.phase_rad / TAU * 4_294_967_296.0) as i32 as u32).sin_cos();
        let parameters = Some(*parameters);
        let mut new = Self { parameters, kept, tick_hz, integral_hz: frequency_hz, frequency_hz, ..Self::default() };
        new.begin_point();
        new.tune();
        new
    }

    fn tune(&mut self) {
        let ticks_per_cycle = self.tick_hz / self.frequency_hz;
        self.x.tune(ticks_per_cycle);
        self.z.tune(ticks_per_cycle);
    }

    /// Begins a point: its lock counts anew.
    pub fn begin_point(&mut self) {
        (self.held, self.parts, self.error) = (0, 0, 1.0);
    }

    /// The present frequency, Hz.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        self.frequency_hz
    }

    /// Takes one tick. `is_full`: the drive is at its full height. `keeps_response`: a loop keeps the response's amplitude. Returns
    /// the frequency when it changes, Hz.
    pub fn tick(&mut self, sample: &Sample, is_full: bool, keeps_response: bool) -> Option<f32> {
        let Sample { phase, increment, wave, .. } = *sample;
        self.is_unread |= sample.reading.is_none();
        let of_mean = |(sine, cosine): (f32, f32)| sine * wave.0 + cosine * wave.1;
        let (x_m, z_m) = sample.reading.unwrap_or_else(|| (of_mean(self.x.components()), of_mean(self.z.components())));
        self.z.push(z_m, phase, increment, wave);
        let following = self.x.push(x_m, phase, increment, wave)?;
        if !is_full {
            self.begin_point();
        }
        self.parts = self.parts.saturating_add(1);
        if core::mem::take(&mut self.is_unread) {
            self.held = 0;
            return None;
        }
        if self.parts <= FILLED_PARTS {
            return None;
        }
        let parameters = self.parameters?;
        let ratio = self.read_phase();
        self.correct(&parameters, keeps_response.then_some(ratio));
        if following == 0 {
            let is_within = self.error.abs() <= parameters.tolerance_rad;
            self.held = if is_within { self.held.saturating_add(1) } else { 0 };
        }
        self.tune();
        Some(self.frequency_hz)
    }

    /// Reads e; returns |z/x|, limited.
    fn read_phase(&mut self) -> f32 {
        let (x, z) = (self.x.components(), self.z.components());
        // x times the conjugate of z.
        let product = (x.0 * z.0 + x.1 * z.1, x.1 * z.0 - x.0 * z.1);
        let size = Scalar::sqrt(product.0 * product.0 + product.1 * product.1);
        let x_square = x.0 * x.0 + x.1 * x.1;
        if size <= 0.0 || x_square <= 0.0 {
            self.error = 1.0;
            return 0.0;
        }
        let (sine, cosine) = self.kept;
        let across = (product.1 * cosine - product.0 * sine) / size;
        let is_behind = product.0 * cosine + product.1 * sine < 0.0;
        self.error = if is_behind { 1.0_f32.copysign(across) } else { across };
        (size / x_square).min(MAX_RATIO)
    }

    /// Corrects the frequency for a part of a cycle. `ratio` is |z/x| where the response's amplitude is kept.
    fn correct(&mut self, parameters: &PhaseLock, ratio: Option<f32>) {
        let (gain, parts) = (parameters.gain_per_cycle, PARTS as f32);
        let within = |frequency_hz: f32| frequency_hz.max(parameters.low_hz).min(parameters.high_hz);
        let step = match ratio {
            Some(ratio) => gain / (8.0 * parts) * ratio,
            None => gain * gain / (4.0 * parts * TAU),
        };
        self.integral_hz = within(self.integral_hz + step * self.frequency_hz * self.error);
        let proportional = if ratio.is_some() { 0.0 } else { gain / TAU * self.frequency_hz * self.error };
        self.frequency_hz = within(self.integral_hz + proportional);
    }

    /// The phase has been within the tolerance for [`HELD_CYCLES`], and is not lost.
    #[must_use]
    pub fn is_locked(&self) -> bool {
        self.held >= HELD_CYCLES && !self.is_lost()
    }

    /// The phase is far from the kept one.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.parameters.is_none_or(|own| self.error.abs() > LOST * own.tolerance_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the loop on a structure in the rotating frame whose base has the amplitude 1: decay rate (1/s), natural frequency (Hz).
    /// With `kept`, the response has the amplitude 1 and the base follows at once. A reading is missing where `is_missing` says
    /// so. Returns the loop and the largest step of the frequency in a tick after half of the time.
    fn locked(
        lock: &PhaseLock,
        rate: f32,
        natural_hz: f32,
        kept: bool,
        is_missing: fn(u32) -> bool,
    ) -> (PhaseTracker, f32) {
        let tick_hz = 1000.0;
        let mut tracker = PhaseTracker::new(lock, tick_hz);
        let mut phase = Phase::default();
        let (mut a, mut largest) = ((0.0_f32, 0.0_f32), 0.0_f32);
        for tick in 0..200_000 {
            let frequency_hz = tracker.frequency_hz();
            let (detuning, half) = (TAU * (natural_hz - frequency_hz), PI * frequency_hz);
            // u = j (2/Ω) λ a, or ȧ = −λ a − j (Ω/2) u, with λ = σ − jδ.
            let u = if kept { (detuning / half, rate / half) } else { (1.0, 0.0) };
            if kept {
                a = (1.0, 0.0);
            } else {
                let slope = (-rate * a.0 - detuning * a.1, -rate * a.1 + detuning * a.0 - half);
                a = (a.0 + slope.0 / tick_hz, a.1 + slope.1 / tick_hz);
            }
            let (increment, wave) = (Phase::increment(frequency_hz, tick_hz), phase.sin_cos());
            let of = |c: (f32, f32)| c.0 * wave.0 + c.1 * wave.1;
            let reading = (!is_missing(tick)).then_some((of(a), of(u)));
            let found = tracker.tick(&Sample { reading, phase: phase.0, increment, wave }, true, kept);
            if let Some(now_hz) = found.filter(|_| tick > 100_000) {
                largest = largest.max((now_hz - frequency_hz).abs());
            }
            phase.advance(increment);
        }
        (tracker, largest)
    }

    #[test]
    fn the_frequency_follows_a_structure_of_every_damping_to_its_phase() {
        for kept in [false, true] {
            for rate in [0.06_f32, 0.4, 3.0] {
                for degrees in [-40.0_f32, -90.0, -130.0] {
                    for gain_per_cycle in [0.5, 1.0, MAX_GAIN_PER_CYCLE] {
                        let phase_rad = degrees.to_radians();
                        let lock = PhaseLock { phase_rad, gain_per_cycle, start_hz: 2.3, ..PhaseLock::new(1.5, 4.0) };
                        let (tracker, _) = locked(&lock, rate, 2.5, kept, |_| false);
                        // tan(θ + 90°) = δ/σ.
                        let expected = 2.5 - rate * libm::tanf(phase_rad + PI / 2.0) / TAU;
                        let off = tracker.frequency_hz() - expected;
                        // What is left of the phase moves the frequency by σ for each radian (more beside resonance).
                        let slope = rate / TAU / libm::powf(libm::sinf(phase_rad), 2.0);
                        assert!(tracker.is_locked(), "{kept} {rate} {degrees} {gain_per_cycle}: {tracker:?}");
                        assert!(
                            off.abs() <= lock.tolerance_rad * slope,
                            "{kept} {rate} {degrees} {gain_per_cycle}: {off}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn ticks_without_a_reading_do_not_move_the_frequency() {
        let lock = PhaseLock { start_hz: 2.3, ..PhaseLock::new(1.5, 4.0) };
        let is_missing = |tick: u32| tick > 100_000 && tick % 7 < 2;
        let (tracker, largest) = locked(&lock, 0.4, 2.5, false, is_missing);
        assert!(largest < 1e-3 && (tracker.frequency_hz() - 2.5).abs() < 1e-3, "{largest} {tracker:?}");
    }

    /// From before it is locked: what it last read is not followed further.
    #[test]
    fn without_any_reading_the_frequency_stays_where_it_was() {
        let lock = PhaseLock { start_hz: 2.3, ..PhaseLock::new(1.5, 4.0) };
        let (tracker, _) = locked(&lock, 0.4, 2.5, false, |tick| tick > 1_500);
        // In 1.5 s less than two cycles of means are filled and one corrected.
        assert!(!tracker.is_locked() && tracker.frequency_hz() < 2.8, "{tracker:?}");
        let (until_then, _) = locked(&lock, 0.4, 2.5, false, |tick| tick > 1_500 && tick < 100_000);
        assert!(until_then.is_locked(), "it goes on when readings return: {until_then:?}");
    }

    #[test]
    fn the_frequency_stays_in_its_range_and_is_not_locked_there() {
        for kept in [false, true] {
            let (tracker, _) = locked(&PhaseLock::new(1.5, 2.2), 0.06, 2.5, kept, |_| false);
            assert_eq!(tracker.frequency_hz(), 2.2);
            assert!(tracker.is_lost() && !tracker.is_locked());
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused_by_name() {
        let good = PhaseLock::new(2.0, 3.0);
        assert!(good.validate().is_ok());
        for degrees in [-150.0_f32, -30.0] {
            assert!(PhaseLock { phase_rad: degrees.to_radians(), ..good }.validate().is_ok());
        }
        let name = |bad: PhaseLock| bad.validate().unwrap_err().parameter;
        assert_eq!(name(PhaseLock { phase_rad: 0.0, ..good }), "lock.phase_rad");
        assert_eq!(name(PhaseLock { low_hz: 0.0, ..good }), "lock.low_hz");
        assert_eq!(name(PhaseLock { high_hz: 2.0, ..good }), "lock.high_hz");
        assert_eq!(name(PhaseLock { start_hz: 3.5, ..good }), "lock.start_hz");
        assert_eq!(name(PhaseLock { gain_per_cycle: 1.6, ..good }), "lock.gain_per_cycle");
        assert_eq!(name(PhaseLock { tolerance_rad: f32::NAN, ..good }), "lock.tolerance_rad");
        assert_eq!(name(PhaseLock { wait_s: -1.0, ..good }), "lock.wait_s");
    }
}
