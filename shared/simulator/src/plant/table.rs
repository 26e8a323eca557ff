//! Motion of the shaker's table, coupled to the structure on it.
//!
//! # The coupling
//! Within a step the table's acceleration a is constant, so its displacement is a parabola. a is chosen so that the
//! table's momentum balance holds over the step:
//!
//! ```text
//! m a h = ∫ (shaker force − c z′ − k z) dt − ΔP,      P = M x′ + m y′
//! ```
//! The load's reaction enters as the momentum P that structure and particle (or tuned mass) *gain*. The structure's flights give it
//! exactly, whatever the forces between base and structure are (spring, dashpot, friction sticking or slipping). So
//! momentum passes between table and load without loss, and an impact, which does not change P, does not disturb the
//! balance. z is measured from where the table rests under its whole load: of the weight of a particle that moves up and down, only
//! the changes act. P(a) is continuous and rises with a (from almost zero to the full mass M + m when the friction damper
//! sticks), so the balance has one solution. A secant iteration on copies of the structure finds it.
//!
//! # The error
//! The method is of second order in the step: `tests/integration/shaker.rs` halves the step and finds a quarter of
//! the error. With the default shaker's 3 steps of 1/3 ms per tick the amplitudes of x and z are within 1e-5 of the
//! closed form at 2 to 3 Hz. Table modes up to [`LARGEST_RATE_PER_STEP`] per step are accurate to 2·10⁻⁴. The end of
//! the stroke is resolved to one step.

use super::load::Load;
use super::shaker::Shaker;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::SampledObserver;
use damprig_core::integrator::units::Units;
use damprig_core::io::{Invalid, require};
use damprig_core::model::SetUp;
use damprig_core::scalar::Scalar;

/// Largest product of the table's fastest rate and the step: a parabola's error is (rate × step)²/12.
pub const LARGEST_RATE_PER_STEP: f64 = 0.05;

/// Maximum number of evaluations of the structure in the search for a step's acceleration.
const MAX_EVALUATIONS: usize = 8;

/// The table: its coefficients per structure mass in [`Units`], and its state.
#[derive(Clone, Debug)]
pub struct Table<S> {
    mass: S,
    damping: S,
    stiffness: S,
    back_emf: S,
    force_per_drive: S,
    voltage_force_limit: S,
    current_force_limit: S,
    half_stroke: S,
    /// Derivative of the structure's momentum gain with respect to the table's acceleration while the damper slips.
    slip_share: S,
    z: S,
    v: S,
    a: S,
    limited: u32,
}

impl<S: Scalar> Table<S> {
    /// Number of steps into which a sample interval must be divided for this table.
    ///
    /// # Errors
    /// More than 200 steps would be needed.
    pub fn steps_per_sample(shaker: &Shaker, sample_s: f64) -> Result<u8, Invalid> {
        let mass = shaker.moving_mass_kg;
        let damping = shaker.suspension_damping_n_s_per_m + shaker.back_emf_damping_n_s_per_m();
        let rate = (damping / mass).max(libm::sqrt(shaker.suspension_stiffness_n_per_m / mass));
        let steps = libm::ceil(rate * sample_s / LARGEST_RATE_PER_STEP).max(1.0);
        require(
            steps <= 200.0,
            "shaker.moving_mass_kg",
            mass,
            "high enough for the sampling rate (fastest rate of the table × sample interval at most 10)",
        )?;
        Ok(steps as u8)
    }

    /// Makes a validated shaker's table at rest, under `set_up`, counted in `units`.
    #[must_use]
    pub fn new(shaker: &Shaker, set_up: &SetUp, units: &Units) -> Self {
        let (mass, h) = (set_up.structure.mass_kg, units.step_s);
        let per_force = h * h / (mass * units.length_m);
        let structure = &set_up.structure;
        let slip_share = (structure.stiffness_n_per_m * h * h / 6.0 + structure.damping_n_s_per_m * h / 2.0) / mass;
        let blocked = S::from_f64(shaker.blocked_force_limit_n() * per_force);
        let by_current = shaker.force_factor_n_per_a * shaker.current_limit_a * per_force;
        Self {
            mass: S::from_f64(shaker.moving_mass_kg / mass),
            damping: S::from_f64(shaker.suspension_damping_n_s_per_m * h / mass),
            stiffness: S::from_f64(shaker.suspension_stiffness_n_per_m * h * h / mass),
            back_emf: S::from_f64(shaker.back_emf_damping_n_s_per_m() * h / mass),
            force_per_drive: S::from_f64(shaker.force_per_drive_n_per_m() * h * h / mass),
            voltage_force_limit: blocked,
            current_force_limit: S::from_f64(by_current),
            half_stroke: S::from_f64(shaker.half_stroke_m / units.length_m),
            slip_share: S::from_f64(slip_share),
            z: S::ZERO,
            v: S::ZERO,
            a: S::ZERO,
            limited: 0,
        }
    }

    /// Resets the table to rest.
    pub fn reset(&mut self) {
        (self.z, self.v, self.a, self.limited) = (S::ZERO, S::ZERO, S::ZERO, 0);
    }

    /// Displacement, in units of length.
    #[must_use]
    pub fn z(&self) -> S {
        self.z
    }

    /// Velocity, in units of length per step.
    #[must_use]
    pub fn v(&self) -> S {
        self.v
    }

    /// Number of steps in which the amplifier's voltage or current or the stroke was at its limit.
    #[must_use]
    pub fn limited(&self) -> u32 {
        self.limited
    }

    /// Advances one step under a constant drive (the demanded displacement, in units of length): moves the table and
    /// the structure on it; returns the table's motion.
    pub fn step(
        &mut self,
        motion: &mut impl Load<S>,
        drive: S,
        observer: &mut impl SampledObserver<S>,
    ) -> BaseSegment<S> {
        let demand = self.force_per_drive * drive;
        let blocked = demand.min(self.voltage_force_limit).max(-self.voltage_force_limit);
        let before = motion.momentum();
        let tolerance = S::EPSILON.max(S::from_f64(1e-11)) * (self.v.abs() + before.abs()) * S::from_u8(4);
        let mut share = motion.stuck_mass().unwrap_or(self.slip_share);
        let mut a = self.a;
        let mut last: Option<(S, S)> = None;
        for _ in 0..MAX_EVALUATIONS {
            let gained = motion.momentum_after(&self.segment(a)) - before;
            if let Some((last_a, last_gained)) = last
                && (a - last_a).abs() > tolerance
            {
                share = ((gained - last_gained) / (a - last_a)).max(S::ZERO).min(motion.mass());
            }
            last = Some((a, gained));
            let next = self.balance(blocked, gained, share, a);
            let change = (next - a).abs();
            a = next;
            if change <= tolerance {
                break;
            }
        }
        let segment = self.segment(a);
        let at_limit = self.take(&segment, a) | (blocked != demand) | self.current_limit(blocked, a).is_some();
        self.limited = self.limited.saturating_add(u32::from(at_limit));
        motion.step(&segment, observer);
        segment
    }

    /// The acceleration that balances the momentum if the load gains `gained + share·(a − at)`.
    fn balance(&self, blocked: S, gained: S, share: S, at: S) -> S {
        let a = self.solve(blocked, self.back_emf, gained, share, at);
        match self.current_limit(blocked, a) {
            Some(force) => self.solve(force, S::ZERO, gained, share, at),
            None => a,
        }
    }

    fn solve(&self, force: S, back_emf: S, gained: S, share: S, at: S) -> S {
        let half = S::from_f64(0.5);
        let sixth = S::from_f64(1.0 / 6.0);
        let damping = self.damping + back_emf;
        let known = force - damping * self.v - self.stiffness * (self.z + half * self.v) - gained + share * at;
        known / (self.mass + half * damping + sixth * self.stiffness + share)
    }

    /// The coil's force if its current is at its limit.
    fn current_limit(&self, blocked: S, a: S) -> Option<S> {
        let force = blocked - self.back_emf * (self.v + S::from_f64(0.5) * a);
        let limit = self.current_force_limit;
        (force.abs() > limit).then(|| if force > S::ZERO { limit } else { -limit })
    }

    /// The motion over the step with acceleration `a`. If the stroke ends within the step, the table comes to rest
    /// there.
    fn segment(&self, a: S) -> BaseSegment<S> {
        let half = S::from_f64(0.5) * a;
        let end = self.z + (self.v + half);
        if end.abs() < self.half_stroke {
            return BaseSegment([self.z, self.v, half, S::ZERO]);
        }
        let stop = if end > S::ZERO { self.half_stroke } else { -self.half_stroke };
        BaseSegment::hermite(self.z, stop, self.v, S::ZERO)
    }

    /// Takes the end of `segment` as the new state; returns whether the table is at an end of its stroke.
    fn take(&mut self, segment: &BaseSegment<S>, a: S) -> bool {
        let half = S::from_f64(0.5) * a;
        let stopped = (self.z + (self.v + half)).abs() >= self.half_stroke;
        if stopped {
            self.z += segment.0[1] + (segment.0[2] + segment.0[3]);
            (self.v, self.a) = (S::ZERO, S::ZERO);
        } else {
            self.z += self.v + half;
            self.v += a;
            self.a = a;
        }
        stopped
    }
}
