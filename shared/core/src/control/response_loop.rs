//! Closed-loop control of the structure's response: the drive is whatever keeps x (or its velocity, or x − z) at a
//! demanded amplitude, frequency by frequency. Z is the result.
//!
//! At a constant amplitude of the base a damper that stiffens, softens or lets go bends the resonance peak, and the
//! response jumps over a part of it. At a constant amplitude of the response there is one drive for every frequency
//! and amplitude, unless the damper itself has several motions there, such as a particle that rests or impacts.
//!
//! # Plant
//! In the frame that rotates with the drive's phase φ a signal `S sin φ + C cos φ` is the complex amplitude S + jC.
//! With the base's demanded amplitude u and the response a, near resonance
//!
//! ```text
//! ȧ = −λ a − j (Ω/2) u,   λ = σ − j(ωn − Ω) for the bare structure, σ = ζωn
//! ```
//! The base moves by u: it follows the drive, or on a shaker the loop of the base sees to it within 1/K = 50 ms
//! ([`super::base_loop`]). A damper makes λ a function of |a|: the decay rate and the detuning of the motion at that
//! amplitude. Every amplitude A has one u = j (2/Ω) λ(A) A, also where several A have the same |u|.
//!
//! # Control law
//! The target is A sin φ: amplitude *and* phase of the response are held, the phase of the base is free. With the
//! error e = A − a, the gain g for each cycle, and time in cycles
//!
//! ```text
//! u = q + j (g/π) e½,   q̇ = (g/8) (j (g/π) + u/a) e
//! ```
//! The second term of u damps every deviation at the rate g f. The ratio u/a is the measured j (2/Ω) λ: it schedules
//! the integrator over the resonance, so that the deviation ends at the rate g f/8 beside the resonance too, where the
//! base acts on the response with another phase. It is limited to `MAX_RATIO`.
//!
//! # Amplitudes
//! a is a mean over the last whole cycle, renewed [`PARTS`] times a cycle ([`CycleWindow`]): harmonics of x and its mean do
//! not enter. Its delay of half a cycle leaves too little to the damping term, whose e½ comes from the last half of a
//! cycle. There a mean and even harmonics do enter; what they add in each part of a cycle is learned as the difference
//! from the whole cycle, by an eighth in each cycle, and taken away. Where the motion repeats with the drive, the base
//! is therefore asked for a pure sine, and the loop adds nothing to the motion.
//!
//! # Stability
//! With λ constant, and without delays, the deviation obeys s² + (λ + g f) s + (g f/8)(λ + g f) = 0: both roots are
//! damped for every detuning. Half a cycle's mean has a delay of a quarter of a cycle, and the correction that is spread
//! over a part one of a sixteenth; at λ = 0 the damping term alone is then stable up to g = 6.6 (the phase −π at 5.0 rad a
//! cycle, where the mean passes 0.76). Farther from the drive frequency than |ωn − Ω| the structure responds with
//! another phase than this model, which lowers the limit. Simulated rigs, bare and with every damper, are stable at
//! [`MAX_GAIN_PER_CYCLE`] from 0.8 to 1.28 fn (`shared/simulator/tests/integration/response_loop.rs`). A damper's
//! dλ/d|a| acts like a further rate A dλ/d|a|: where it is larger than g f, the response is not held, and the point is
//! measured when the wait is over, with the amplitude that it has.
//!
//! When a particle sticks to its wall or is let go, λ jumps. The response leaves its amplitude and returns at these
//! rates; a measurement in progress starts again.
//!
//! # Start and limits
//! When the loop starts or its amplitude changes, its target moves over `RISE_CYCLES`. The demanded amplitude stays within its limit; at the limit the
//! integrator keeps the value that belongs to it. In a tick without a reading the mean is taken for it, and the part of
//! the cycle that has such a tick corrects nothing; after a fault the drive fades. The base amplitude that is demanded next is
//! known before the base has it ([`ResponseControl::base_foreseen_m`]): the interlocks stop the rig before its limit.

use super::base_loop::{ClosedLoop, HELD_CYCLES};
use crate::io::{DriveScale, Invalid, positive, require};
use crate::measure::cycle_window::{CycleWindow, PARTS};
use crate::scalar::Scalar;
use core::f32::consts::PI;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest g.
pub const MAX_GAIN_PER_CYCLE: f32 = 2.0;

/// Largest ratio of the drive to the response that schedules the integrator.
const MAX_RATIO: f32 = 1.0;

/// Share of the difference from the whole cycle that is learned in each cycle.
const LEARNED: f32 = 0.125;

/// Cycles over which the target moves when the loop starts or its amplitude changes.
const RISE_CYCLES: f32 = 4.0;

/// Response below this share of its target: its ratio to the drive is not known yet.
const MIN_SHARE: f32 = 0.1;

/// The quantity whose amplitude at the drive frequency is held.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum KeptQuantity {
    /// The displacement x.
    Displacement {
        /// Its amplitude, m; greater than 0.
        amplitude_m: f32,
    },
    /// The velocity of x.
    Velocity {
        /// Its amplitude, m/s; greater than 0.
        amplitude_m_per_s: f32,
    },
    /// The displacement relative to the base, x − z.
    Relative {
        /// Its amplitude, m; greater than 0.
        amplitude_m: f32,
    },
}

impl KeptQuantity {
    /// The displacement amplitude at a drive frequency, m.
    #[must_use]
    pub fn amplitude_m(&self, frequency_hz: f32) -> f32 {
        match self {
            Self::Displacement { amplitude_m } | Self::Relative { amplitude_m } => *amplitude_m,
            Self::Velocity { amplitude_m_per_s } => amplitude_m_per_s / (2.0 * PI * frequency_hz),
        }
    }

    /// The quantity with another amplitude, in its unit.
    #[must_use]
    pub fn with_amplitude(self, amplitude: f32) -> Self {
        match self {
            Self::Displacement { .. } => Self::Displacement { amplitude_m: amplitude },
            Self::Velocity { .. } => Self::Velocity { amplitude_m_per_s: amplitude },
            Self::Relative { .. } => Self::Relative { amplitude_m: amplitude },
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        match self {
            Self::Displacement { amplitude_m } | Self::Relative { amplitude_m } => {
                positive("drive.amplitude_m", f64::from(*amplitude_m))
            }
            Self::Velocity { amplitude_m_per_s } => positive("drive.amplitude_m_per_s", f64::from(*amplitude_m_per_s)),
        }
    }
}

/// Parameters of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ResponseLoop {
    /// The quantity, with its amplitude.
    pub response: KeptQuantity,
    /// The loop with which the base follows its demand on a shaker; `None` where the base follows the drive.
    pub base: Option<ClosedLoop>,
    /// g: the rate at which a deviation is damped, for each cycle; greater than 0, at most [`MAX_GAIN_PER_CYCLE`].
    pub gain_per_cycle: f32,
    /// Relative error of the amplitude within which the response counts as held; 0.001 to 0.5.
    pub tolerance: f32,
    /// Longest time to wait after settling for the response to be held, s; from 0 to 3600.
    pub wait_s: f32,
    /// Limit of the demanded amplitude, m; greater than 0, at most what the drive can deliver.
    pub drive_limit_m: f32,
}

impl ResponseLoop {
    /// The loop as delivered, for this quantity. The drive limit is the range of the drive as delivered.
    #[must_use]
    pub fn new(response: KeptQuantity, base: Option<ClosedLoop>) -> Self {
        let drive_limit_m = DriveScale::default().range().amplitude_m();
        Self { response, base, gain_per_cycle: 1.5, tolerance: 0.01, wait_s: 120.0, drive_limit_m }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.response.validate()?;
        let gain = f64::from(self.gain_per_cycle);
        positive("drive.gain_per_cycle", gain)?;
        require(self.gain_per_cycle <= MAX_GAIN_PER_CYCLE, "drive.gain_per_cycle", gain, "at most 2")?;
        let tolerance = f64::from(self.tolerance);
        require((0.001..=0.5).contains(&self.tolerance), "drive.tolerance", tolerance, "from 0.001 to 0.5")?;
        let wait = f64::from(self.wait_s);
        require((0.0..=3600.0).contains(&self.wait_s), "drive.wait_s", wait, "from 0 to 3600")?;
        positive("drive.drive_limit_m", f64::from(self.drive_limit_m))?;
        if let Some(base) = &self.base {
            base.validate()?;
            let limit = f64::from(base.drive_limit_m);
            require(
                base.drive_limit_m <= self.drive_limit_m,
                "drive.base.drive_limit_m",
                limit,
                "at most drive_limit_m",
            )?;
        }
        Ok(())
    }
}

/// A complex amplitude: the components in phase with the sine and with the cosine of the drive's phase.
type Complex = (f32, f32);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn modulus(a: Complex) -> f32 {
    Scalar::sqrt(a.0 * a.0 + a.1 * a.1)
}

/// State of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct ResponseControl {
    parameters: Option<ResponseLoop>,
    target_m: f32,
    ticks_per_part: f32,
    window: CycleWindow,
    /// What means over half a cycle have besides those over a whole one, m, for each part of the cycle.
    learned: [Complex; PARTS],
    /// q, m.
    integral: Complex,
    /// u, m, and its change in each tick.
    demand: Complex,
    slope: Complex,
    /// |u| at the end of this part of the cycle, and at the end of the last cycle, m.
    next_m: f32,
    last_m: f32,
    /// Largest |u| of this cycle and of the one before, m.
    largest_m: [f32; 2],
    /// The target from which it rises, m, and the share of the rise, 0 to 1.
    before_m: f32,
    rise: f32,
    /// A reading was missing in this part of the cycle.
    is_unread: bool,
    held: u32,
    saturated: bool,
}

impl ResponseControl {
    /// A loop with validated parameters and no demand.
    #[must_use]
    pub fn new(parameters: &ResponseLoop) -> Self {
        Self { parameters: Some(*parameters), ..Self::default() }
    }

    /// Changes the frequency; the demand carries over.
    pub fn tune(&mut self, frequency_hz: f32, tick_hz: f32) {
        let Some(parameters) = &self.parameters else { return };
        self.target_m = parameters.response.amplitude_m(frequency_hz);
        let ticks_per_cycle = tick_hz / frequency_hz;
        self.ticks_per_part = ticks_per_cycle / PARTS as f32;
        self.window.tune(ticks_per_cycle);
    }

    /// Begins a point; with another amplitude of its quantity if one is given. The target rises to it from the one before.
    pub fn begin_point(&mut self, amplitude: Option<f32>) {
        self.held = 0;
        if let (Some(parameters), Some(amplitude)) = (&mut self.parameters, amplitude) {
            self.before_m += self.rise * (self.target_m - self.before_m);
            self.rise = 0.0;
            parameters.response = parameters.response.with_amplitude(amplitude);
        }
    }

    /// Runs one tick. `ramp` (0 to 1) scales the target. `reading`: x and z, m; `None` if one is no displacement. `phase` is that of
    /// the samples, with its increment and its sine and cosine. Returns the base's demanded components in phase with the sine
    /// and with the cosine, m.
    pub fn tick(
        &mut self,
        ramp: f32,
        reading: Option<(f32, f32)>,
        (phase, increment, then): (u32, u32, Complex),
    ) -> Complex {
        let is_relative = matches!(self.parameters, Some(ResponseLoop { response: KeptQuantity::Relative { .. }, .. }));
        self.is_unread |= reading.is_none();
        let response_m = match reading {
            Some((x_m, z_m)) => {
                if is_relative {
                    x_m - z_m
                } else {
                    x_m
                }
            }
            None => {
                let (sine, cosine) = self.window.components();
                sine * then.0 + cosine * then.1
            }
        };
        self.demand = (self.demand.0 + self.slope.0, self.demand.1 + self.slope.1);
        if let Some(part) = self.window.push(response_m, phase, increment, then) {
            if core::mem::take(&mut self.is_unread) {
                (self.slope, self.held) = ((0.0, 0.0), 0);
            } else {
                self.correct(ramp, part);
            }
            if part == 0 {
                self.end_cycle();
            }
        }
        self.demand
    }

    /// Corrects the demand as the part of a cycle `following` begins; the correction is spread over that part.
    fn correct(&mut self, ramp: f32, following: usize) {
        let Some(parameters) = &self.parameters else { return };
        let gain = parameters.gain_per_cycle;
        self.rise = (self.rise + 1.0 / (RISE_CYCLES * PARTS as f32)).min(1.0);
        let (response, half) = (self.window.components(), self.window.last_half(following));
        let target_m = ramp * self.rise * (self.target_m - self.before_m) + ramp * self.before_m;
        let error = (target_m - response.0, -response.1);
        let learned = &mut self.learned[following];
        learned.0 += LEARNED * (half.0 - response.0 - learned.0);
        learned.1 += LEARNED * (half.1 - response.1 - learned.1);
        let damping = times((0.0, gain / PI), (target_m - half.0 + learned.0, learned.1 - half.1));
        let rate = times((0.0, gain / PI), error);
        let scheduled = times(self.ratio(response), error);
        let step = gain / (8.0 * PARTS as f32);
        let integral =
            (self.integral.0 + step * (rate.0 + scheduled.0), self.integral.1 + step * (rate.1 + scheduled.1));
        let wanted = (integral.0 + damping.0, integral.1 + damping.1);
        let (demanded, most) = (modulus(wanted), parameters.drive_limit_m);
        self.saturated = demanded > most;
        let scale = if self.saturated { most / demanded } else { 1.0 };
        let demand = (wanted.0 * scale, wanted.1 * scale);
        // At the limit: what belongs to the limited demand.
        self.integral = if self.saturated { (demand.0 - damping.0, demand.1 - damping.1) } else { integral };
        self.next_m = modulus(demand);
        self.largest_m[0] = self.largest_m[0].max(self.next_m);
        let ticks = self.ticks_per_part;
        self.slope = ((demand.0 - self.demand.0) / ticks, (demand.1 - self.demand.1) / ticks);
    }

    /// The demand over the response; 0 while the response is too small to tell.
    fn ratio(&self, response: Complex) -> Complex {
        let size = modulus(response);
        if size <= MIN_SHARE * self.target_m {
            return (0.0, 0.0);
        }
        let ratio = times(self.demand, (response.0 / (size * size), -response.1 / (size * size)));
        let scale = MAX_RATIO / modulus(ratio).max(MAX_RATIO);
        (ratio.0 * scale, ratio.1 * scale)
    }

    fn end_cycle(&mut self) {
        let Some(parameters) = &self.parameters else { return };
        let is_near = |value: f32, of: f32| (value - of).abs() <= parameters.tolerance * of;
        let amplitude_m = modulus(self.demand);
        let is_within = is_near(modulus(self.window.components()), self.target_m) && is_near(amplitude_m, self.last_m);
        self.last_m = amplitude_m;
        self.largest_m = [self.next_m, self.largest_m[0]];
        self.held = if is_within { self.held.saturating_add(1) } else { 0 };
    }

    /// The demand of this tick, m.
    #[must_use]
    pub fn open(&self, now: Complex) -> f32 {
        self.demand.0 * now.0 + self.demand.1 * now.1
    }

    /// The response has been within the tolerance, and the demand has changed by no more in a cycle, for [`HELD_CYCLES`].
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held >= HELD_CYCLES
    }

    /// The demand was at its limit in the last correction.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.saturated
    }

    /// Present amplitude of the demand, m.
    #[must_use]
    pub fn demanded_m(&self) -> f32 {
        modulus(self.demand)
    }

    /// Largest amplitude that was demanded in this cycle and in the one before, m.
    #[must_use]
    pub fn largest_demand_m(&self) -> f32 {
        self.largest_m[0].max(self.largest_m[1])
    }

    /// Base amplitude that is demanded next, m.
    #[must_use]
    pub fn base_foreseen_m(&self) -> f32 {
        self.next_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sine::Phase;

    /// The share of a deviation that the loop leaves after 80 cycles at 2.5 Hz of a structure with this decay rate (1/s) and detuning
    /// ωn − Ω (rad/s), ȧ = −λ a − j (Ω/2) u.
    fn left(rate: f32, detuning: f32, gain_per_cycle: f32) -> f32 {
        let (target_m, frequency_hz, tick_hz) = (0.01, 2.5, 1000.0);
        let response = KeptQuantity::Displacement { amplitude_m: target_m };
        let parameters = ResponseLoop { gain_per_cycle, drive_limit_m: 0.1, ..ResponseLoop::new(response, None) };
        let mut control = ResponseControl::new(&parameters);
        control.tune(frequency_hz, tick_hz);
        let increment = Phase::increment(frequency_hz, tick_hz);
        let (mut phase, mut a) = (Phase::default(), (0.0_f32, 0.0_f32));
        for _ in 0..32_000 {
            let wave = phase.sin_cos();
            let u = control.tick(1.0, Some((a.0 * wave.0 + a.1 * wave.1, 0.0)), (phase.0, increment, wave));
            let (decay, push) = (times((-rate, detuning), a), times((0.0, -PI * frequency_hz), u));
            a = (a.0 + (decay.0 + push.0) / tick_hz, a.1 + (decay.1 + push.1) / tick_hz);
            phase.advance(increment);
        }
        assert!(control.is_held(), "{rate} {detuning} {gain_per_cycle}: {a:?}");
        modulus((a.0 - target_m, a.1)) / target_m
    }

    #[test]
    fn a_deviation_ends_at_every_decay_rate_and_detuning_of_a_structure() {
        for rate in [0.06, 0.4, 3.0] {
            for detuning in [-4.0, -1.0, -0.1, 0.0, 0.1, 1.0, 4.0] {
                for gain_per_cycle in [0.5, 1.5, MAX_GAIN_PER_CYCLE] {
                    // The slow rate g f/8 leaves at most e^(−5) at g = 0.5.
                    let left = left(rate, detuning, gain_per_cycle);
                    assert!(left < 1e-2, "{rate} {detuning} {gain_per_cycle}: {left}");
                }
            }
        }
    }

    #[test]
    fn ticks_without_a_reading_change_neither_amplitude_nor_demand() {
        let (frequency_hz, tick_hz) = (2.5, 1000.0);
        let parameters = ResponseLoop::new(KeptQuantity::Displacement { amplitude_m: 0.01 }, None);
        let mut control = ResponseControl::new(&parameters);
        control.tune(frequency_hz, tick_hz);
        let (increment, mut phase) = (Phase::increment(frequency_hz, tick_hz), Phase::default());
        let mut settled = None;
        for tick in 0..20_000_u32 {
            let wave = phase.sin_cos();
            // After 10 s every seventh reading is missing, so that gaps fall on the ends of parts too.
            let is_missing = tick > 10_000 && tick % 7 < 2;
            let demand = control.tick(1.0, (!is_missing).then_some((0.01 * wave.0, 0.0)), (phase.0, increment, wave));
            phase.advance(increment);
            if tick == 10_000 {
                settled = Some(demand);
            }
            if let Some(before) = settled {
                let moved = modulus((demand.0 - before.0, demand.1 - before.1));
                assert!(moved < 1e-3 * 0.01, "{tick}: {moved}");
            }
        }
    }

    /// s + g e^(−s/16) (1 − e^(−s/2))/(s/2) = 0, time in cycles; the delay is that of a correction that is spread over a part.
    #[test]
    fn the_mean_over_half_a_cycle_alone_would_allow_a_gain_of_six() {
        let (mut low, mut high) = (1.0_f64, 6.2_f64);
        while high - low > 1e-9 {
            let at = 0.5 * (low + high);
            let angle = at * (0.25 + 1.0 / PARTS as f64);
            *(if angle < core::f64::consts::FRAC_PI_2 { &mut low } else { &mut high }) = at;
        }
        let limit = low / (libm::sin(low / 4.0) / (low / 4.0));
        assert!((low - 5.03).abs() < 0.01 && (limit - 6.64).abs() < 0.01, "{low} {limit}");
    }

    #[test]
    fn parameters_out_of_range_are_refused_by_name() {
        let good = ResponseLoop::new(KeptQuantity::Displacement { amplitude_m: 0.01 }, None);
        assert!(good.validate().is_ok());
        let name = |bad: ResponseLoop| bad.validate().unwrap_err().parameter;
        assert_eq!(name(ResponseLoop { gain_per_cycle: 2.1, ..good }), "drive.gain_per_cycle");
        assert_eq!(name(ResponseLoop { tolerance: f32::NAN, ..good }), "drive.tolerance");
        assert_eq!(name(ResponseLoop { drive_limit_m: 0.0, ..good }), "drive.drive_limit_m");
        let response = KeptQuantity::Velocity { amplitude_m_per_s: -1.0 };
        assert_eq!(name(ResponseLoop { response, ..good }), "drive.amplitude_m_per_s");
    }
}
