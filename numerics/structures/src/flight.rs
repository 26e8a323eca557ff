//! Free flight of a particle.

use crate::cubic::Cubic;

/// A particle in free flight, from the start of the present step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    /// y, m.
    pub y_m: f64,
    /// y′, m/s.
    pub u_m_per_s: f64,
    /// y″, m/s².
    pub acceleration: f64,
}

impl Flight {
    /// y.
    pub fn cubic(&self) -> Cubic {
        Cubic { value: self.y_m, slope: self.u_m_per_s, bend: self.acceleration, jerk: 0.0 }
    }

    /// The flight from time `t` on.
    pub fn after(&self, t: f64) -> Self {
        Self {
            y_m: self.y_m + t * (self.u_m_per_s + 0.5 * t * self.acceleration),
            u_m_per_s: self.u_m_per_s + t * self.acceleration,
            ..*self
        }
    }
}
