//! Free flight of a particle.

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
    /// The flight from time `t` on.
    pub fn after(&self, t: f64) -> Self {
        Self {
            y_m: self.y_m + t * (self.u_m_per_s + 0.5 * t * self.acceleration),
            u_m_per_s: self.u_m_per_s + t * self.acceleration,
            ..*self
        }
    }
}
