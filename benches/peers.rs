//! What a user would write otherwise. Both leave out resting contact: neither library knows it.

use diffsol::{MatrixCommon, NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason, Vector, VectorHost};

use crate::cases::{NATURAL_FREQUENCY_HZ, Setting};

type M = NalgebraMat<f64>;

/// Velocities after an impact: momentum kept, relative velocity times −e.
fn impact(restitution: f64, mass_ratio: f64, v: f64, u: f64) -> (f64, f64) {
    let common = (v + mass_ratio * u) / (1.0 + mass_ratio);
    let relative = -restitution * (u - v);
    (common - mass_ratio / (1.0 + mass_ratio) * relative, common + relative / (1.0 + mass_ratio))
}

struct Equations {
    stiffness: f64,
    damping: f64,
    mass_ratio: f64,
    turning: f64,
}

impl Equations {
    fn new(setting: &Setting) -> Self {
        let set_up = setting.set_up();
        debug_assert!(NATURAL_FREQUENCY_HZ > 0.0);
        Self {
            stiffness: set_up.structure.stiffness_n_per_m / set_up.structure.mass_kg,
            damping: set_up.structure.damping_n_s_per_m / set_up.structure.mass_kg,
            mass_ratio: set_up.particle.map_or(0.0, |p| p.mass_kg) / set_up.structure.mass_kg,
            turning: setting.angular_frequency_rad_per_s(),
        }
    }

    /// x″ of the structure.
    fn acceleration(&self, t: f64, x: f64, v: f64) -> f64 {
        let (sine, cosine) = (self.turning * t).sin_cos();
        -self.stiffness * (x - sine) - self.damping * (v - self.turning * cosine)
    }
}
