//! A motion that is guided from outside, step by step, as on a simulated rig.

use std::sync::Arc;

use crate::Refused;
use crate::motion::Motion;
use crate::polynomial::Polynomial;

impl Motion {
    /// The base follows z = Σ cₖ tᵏ, m, from the present instant on, counted from there. z and z′ are to go on as before; z″ may jump. Only for a
    /// motion that began [`Motion::on_base`].
    ///
    /// # Errors
    /// As [`Motion::run`].
    pub fn follow(&mut self, base: [f64; 4]) -> Result<(), Refused> {
        self.leave();
        self.base_cubic = Polynomial::of_powers(base);
        self.resolve(&self.stuck(), &[])
    }

    /// As [`Motion::follow`] where z′ jumps: the velocities of all masses go on, and joints that stuck to the base slip.
    ///
    /// # Errors
    /// As [`Motion::run`].
    pub fn follow_jump(&mut self, base: [f64; 4]) -> Result<(), Refused> {
        self.leave();
        let before = self.base().1;
        self.base_cubic = Polynomial::of_powers(base);
        self.base_has_jumped(self.base().1 - before)
    }

    /// Changes the largest force of a friction damper, N, 0 or greater, at the present instant.
    ///
    /// # Errors
    /// As [`Motion::run`].
    pub fn set_friction_n(&mut self, damper: usize, force_n: f64) -> Result<(), Refused> {
        self.leave();
        Arc::make_mut(&mut self.mount).joints[damper].friction_n = force_n;
        self.systems.clear();
        self.known.clear();
        self.resolve(&self.stuck(), &[])
    }

    /// Momentum of structure and dampers along the base's motion, ιᵀM(u′ + ιz′), kg·m/s: what the base has given them. Of modes the mass that
    /// takes part in them; the rest of the structure moves with the base.
    #[must_use]
    pub fn momentum_kg_m_per_s(&self) -> f64 {
        let (_, v) = self.bodies();
        let bodies = &self.mount.bodies;
        bodies.inertia.iter().zip(v).map(|(inertia, v)| inertia * v).sum::<f64>()
            + self.moving_mass_kg() * self.base().1
    }

    /// Σ Γ² of the modes and the masses of all dampers that the base moves, kg.
    #[must_use]
    pub fn moving_mass_kg(&self) -> f64 {
        let bodies = &self.mount.bodies;
        bodies.inertia.iter().zip(bodies.divisors()).map(|(inertia, mass)| inertia * inertia / mass).sum()
    }

    /// What `ask` finds on a copy that it may run on; the motion stays where it is.
    pub fn tried<T>(&mut self, ask: impl FnOnce(&mut Self) -> T) -> T {
        // Systems are solved once for both.
        let (systems, known) = (std::mem::take(&mut self.systems), std::mem::take(&mut self.known));
        let mut copy = Self { systems, known, ..self.clone() };
        let found = ask(&mut copy);
        (self.systems, self.known) = (copy.systems, copy.known);
        found
    }
}
