//! Units of time and length of a calculation.

/// Units of a calculation. Floating point uses metres; fixed point needs displacements of order one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// The step: the unit of time, s.
    pub step_s: f64,
    /// The unit of length, m.
    pub length_m: f64,
}

impl Units {
    /// Steps of `step_s` seconds and lengths in metres.
    #[must_use]
    pub fn metres(step_s: f64) -> Self {
        Self { step_s, length_m: 1.0 }
    }

    /// The unit of velocity, m/s.
    #[must_use]
    pub fn velocity_m_per_s(&self) -> f64 {
        self.length_m / self.step_s
    }
}
