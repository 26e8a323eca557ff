//! Free flight of a particle.

use crate::polynomial::Polynomial;

/// y of a particle in free flight, or pushed by a Hertz wall, from the start of the present step, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight(pub Polynomial);

impl Flight {
    /// From y, y′ and y″, a cubic.
    pub fn new(y_m: f64, u_m_per_s: f64, acceleration: Polynomial) -> Self {
        let Polynomial { value, slope, bend, jerk, .. } = acceleration;
        Self(Polynomial::of([y_m, u_m_per_s, value, slope, bend, jerk, 0.0, 0.0]))
    }

    /// y.
    pub fn polynomial(&self) -> Polynomial {
        self.0
    }

    /// The flight from time `t` on.
    pub fn after(&self, t: f64) -> Self {
        Self(self.0.after(t))
    }
}
