//! The state of a structure with its dampers.

/// Absolute displacement and velocity of a particle or a tuned mass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// y, m.
    pub y_m: f64,
    /// y′, m/s.
    pub u_m_per_s: f64,
}

/// Displacements and velocities of everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Modal coordinates q relative to the base, m·√kg.
    pub modal: Vec<f64>,
    /// q′, m·√kg/s.
    pub modal_rate: Vec<f64>,
    /// The particles, in the order of the impact dampers.
    pub particles: Vec<Body>,
    /// The tuned masses, in the order of the tuned mass dampers.
    pub tuned_masses: Vec<Body>,
    /// The charges that have flown through the loads of the piezoelectric walls, C: in the order of the impact dampers, the wall on the negative side
    /// first.
    pub charges_c: Vec<f64>,
}
