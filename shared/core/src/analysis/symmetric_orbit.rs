//! Symmetric periodic orbit of an impact damper with two equispaced impacts per cycle, in closed form.
//!
//! Masri and Caughey (1966), Bapat and Sankar (1985): hard walls, no internal friction, sinusoidal base motion. Between
//! the impacts the structure's motion is the sum of its steady response and a decaying response. By symmetry (the
//! motion is mirrored after half a period) one quadratic equation for the particle's speed remains.

use crate::integrator::exact::ExactState;
use crate::model::{Initial, SetUp, Wall};

/// One such orbit. Neither its stability nor the absence of further impacts is checked; run it to find out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricOrbit {
    /// Speed of the particle between the impacts, m/s.
    pub particle_speed_m_per_s: f64,
    /// Displacement of the structure at the impact on the + wall, m.
    pub impact_displacement_m: f64,
    /// |x′ − y′| just before an impact, m/s.
    pub approach_speed_m_per_s: f64,
    /// Velocity of the structure just after the impact on the + wall, m/s.
    pub velocity_after_m_per_s: f64,
    /// Phase Ωt of the base z = Z sin Ωt at the impact on the + wall, rad, −π to π.
    pub drive_phase_rad: f64,
    /// y − x at the + wall, m.
    wall_m: f64,
}

impl SymmetricOrbit {
    /// The orbit with the faster particle, of `set_up` on a base that moves as `amplitude_m` sin Ωt.
    ///
    /// `None` without a particle between equal hard walls of constant restitution on a level, with friction of any kind or a tuned mass, for a base at rest, or
    /// where no such orbit exists (A/d too small).
    #[must_use]
    pub fn new(set_up: &SetUp, amplitude_m: f64, angular_frequency_rad_per_s: f64) -> Option<Self> {
        Self::both(set_up, amplitude_m, angular_frequency_rad_per_s)?.into_iter().next().flatten()
    }

    /// Both roots of the quadratic equation, the faster particle first; a root without a positive speed is `None`.
    #[must_use]
    pub fn both(set_up: &SetUp, amplitude_m: f64, angular_frequency_rad_per_s: f64) -> Option<[Option<Self>; 2]> {
        let particle = set_up.particle?;
        let Wall::Restitution { coefficient: e } = particle.wall else { return None };
        let frictionless = set_up.internal_friction_m_per_s2() == 0.0
            && particle.is_symmetric()
            && set_up.friction_damper.is_none_or(|damper| damper.force_n == 0.0);
        let turning = angular_frequency_rad_per_s;
        if !frictionless || set_up.tmd.is_some() || !(amplitude_m > 0.0 && turning > 0.0) || set_up.validate().is_err()
        {
            return None;
        }
        let structure = &set_up.structure;
        let natural = libm::sqrt(structure.stiffness_n_per_m / structure.mass_kg);
        let zeta = structure.damping_n_s_per_m / (2.0 * libm::sqrt(structure.stiffness_n_per_m * structure.mass_kg));
        if zeta >= 1.0 {
            return None;
        }
        let (mass_ratio, d) = (particle.mass_kg / structure.mass_kg, particle.clearance_m);
        let ratio = turning / natural;
        let (stiff, damped) = (1.0 - ratio * ratio, 2.0 * zeta * ratio);
        let response = amplitude_m * libm::sqrt((1.0 + damped * damped) / (stiff * stiff + damped * damped));

        // The decaying part, e^{−ζωt}(B₁ sin ω_d t + B₂ cos ω_d t), with Bᵢ = bᵢ V.
        let half = core::f64::consts::PI / turning;
        let decay = zeta * natural;
        let ringing = natural * libm::sqrt(1.0 - zeta * zeta);
        let h = libm::exp(-decay * half);
        let (sine, cosine) = (libm::sin(ringing * half), libm::cos(ringing * half));
        let rows = [
            [h * sine, h * cosine + 1.0],
            [h * (ringing * cosine - decay * sine) + ringing, -h * (ringing * sine + decay * cosine) - decay],
        ];
        let determinant = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
        let b1 = -2.0 * mass_ratio * rows[0][1] / determinant;
        let b2 = 2.0 * mass_ratio * rows[0][0] / determinant;

        let after = (2.0 * mass_ratio * e - 1.0 + e) / (1.0 + e);
        let before = -(1.0 - e + 2.0 * mass_ratio) / (1.0 + e);
        let s1 = 0.5 * half - b2;
        let s2 = (after + decay * b2 - ringing * b1) / turning;
        let square = s1 * s1 + s2 * s2;
        // (s₁² + s₂²) V² − 2 s₁ d V + d² − A² = 0
        let discriminant = s1 * s1 * d * d - square * (d * d - response * response);
        if discriminant < 0.0 {
            return Some([None, None]);
        }
        let root = libm::sqrt(discriminant);
        // The steady response A sin(Ωt + α) lags the base by `lag`.
        let lag = libm::atan2(damped, stiff) - libm::atan2(damped, 1.0);
        let orbit = |speed: f64| {
            let alpha = libm::atan2(s1 * speed - d, s2 * speed);
            let phase = alpha + lag;
            let turn = core::f64::consts::TAU;
            (speed > 0.0).then(|| Self {
                particle_speed_m_per_s: speed,
                impact_displacement_m: 0.5 * half * speed - d,
                approach_speed_m_per_s: speed * (1.0 - before),
                velocity_after_m_per_s: speed * after,
                drive_phase_rad: phase - turn * libm::round(phase / turn),
                wall_m: particle.ends_m()[1],
            })
        };
        Some([orbit((s1 * d + root) / square), orbit((s1 * d - root) / square)])
    }

    /// The state just after the impact on the + wall: the initial state of a run on the orbit, together with
    /// [`SymmetricOrbit::drive_phase_rad`].
    #[must_use]
    pub fn initial(&self) -> Initial {
        Initial {
            x_m: self.impact_displacement_m,
            v_m_per_s: self.velocity_after_m_per_s,
            y_m: self.impact_displacement_m + self.wall_m,
            u_m_per_s: -self.particle_speed_m_per_s,
        }
    }

    /// The same state as a state of the exact driver.
    #[must_use]
    pub fn state(&self) -> ExactState {
        ExactState {
            x_m: self.impact_displacement_m,
            v_m_per_s: self.velocity_after_m_per_s,
            offset_m: self.wall_m,
            slide_m_per_s: -self.particle_speed_m_per_s - self.velocity_after_m_per_s,
        }
    }
}
