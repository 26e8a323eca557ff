//! The forces of a contact, along and across the line of centres.

use core::f64::consts::PI;

use crate::vector::{Vector, across, dot, length, plus_times, times};

/// Damping ratio of a contact with this coefficient of restitution, above 0 to 1, whose force never pulls: the inverse of
/// [`restitution`].
#[must_use]
pub fn damping_ratio(restitution_coefficient: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while restitution(high) > restitution_coefficient {
        high *= 2.0;
    }
    // The interval shrinks to neighbouring numbers.
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if restitution(middle) > restitution_coefficient { low = middle } else { high = middle }
    }
    if restitution_coefficient >= 1.0 { 0.0 } else { high }
}

/// Coefficient of restitution of a spring and a dashpot that part when their force would pull (Schwager and Pöschel 2007).
#[must_use]
pub fn restitution(damping_ratio: f64) -> f64 {
    let square = damping_ratio * damping_ratio;
    let root = libm::sqrt((1.0 - square).abs());
    // Times are in units of 1/ω0.
    let duration = if root < 1e-6 {
        2.0
    } else if square < 1.0 {
        libm::atan2(2.0 * damping_ratio * root, 2.0 * square - 1.0) / root
    } else {
        2.0 * libm::log(damping_ratio + root) / root
    };
    libm::exp(-damping_ratio * duration)
}

/// Constants of the contacts.
///
/// Along the line of centres: the force k·δ + c·δ′ on the overlap δ, but never less than 0. Across it: a spring of 2/7·k
/// and a dashpot of 2/7·c on the sliding of the surfaces, which gives both directions one frequency for full spheres;
/// spring and force have at most μ times the force along the line of centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// k, N/m.
    pub stiffness_n_per_m: f64,
    /// c between two spheres, N·s/m.
    pub pair_damping_n_s_per_m: f64,
    /// c at the walls across the motion, which are as heavy as the structure, N·s/m.
    pub end_damping_n_s_per_m: f64,
    /// c at the other walls, N·s/m.
    pub side_damping_n_s_per_m: f64,
    /// μ, 0 or greater.
    pub friction_coefficient: f64,
    /// Fastest rate of a contact, rad/s: √(k/m) of the lightest pair, or more with heavy damping.
    pub fastest_rate_rad_per_s: f64,
}

/// Stiffness and damping across the line of centres over those along it.
pub const TANGENTIAL: f64 = 2.0 / 7.0;

impl ContactLaw {
    /// Of spheres with this coefficient of restitution. `structure_kg` moves with the walls across the motion.
    #[must_use]
    pub fn new(
        (stiffness_n_per_m, restitution_coefficient, friction_coefficient): (f64, f64, f64),
        sphere_kg: f64,
        structure_kg: f64,
    ) -> Self {
        let ratio = damping_ratio(restitution_coefficient);
        let damping = |mass_kg: f64| 2.0 * ratio * libm::sqrt(stiffness_n_per_m * mass_kg);
        let end_kg = sphere_kg * structure_kg / (sphere_kg + structure_kg);
        Self {
            stiffness_n_per_m,
            pair_damping_n_s_per_m: damping(0.5 * sphere_kg),
            end_damping_n_s_per_m: damping(end_kg),
            side_damping_n_s_per_m: damping(sphere_kg),
            friction_coefficient,
            fastest_rate_rad_per_s: libm::sqrt(stiffness_n_per_m / end_kg.min(0.5 * sphere_kg))
                * (2.0 * ratio).max(1.0),
        }
    }

    /// Duration of the shortest contact, s.
    #[must_use]
    pub fn shortest_contact_s(&self) -> f64 {
        PI / self.fastest_rate_rad_per_s
    }
}

/// What a contact remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History {
    /// Whether the surfaces touch.
    pub touches: bool,
    /// Stretch of the spring across the line of centres, m.
    stretch_m: Vector,
    /// Sliding velocity at the last step, m/s.
    sliding_m_per_s: Vector,
}

/// Power into contacts and energy stored in them, along and across the lines of centres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactEnergy {
    /// Power along, W.
    pub normal_w: f64,
    /// Power across, W.
    pub tangential_w: f64,
    /// Stored along, J.
    pub normal_j: f64,
    /// Stored across, J.
    pub tangential_j: f64,
}

impl ContactLaw {
    /// Force of a contact on the body that `normal` points to, whose velocity relative to the other is `velocity`,
    /// rotation included; N.
    #[inline]
    pub fn force(
        &self,
        damping_n_s_per_m: f64,
        (overlap_m, normal, velocity): (f64, &Vector, &Vector),
        step_s: f64,
        history: &mut History,
        energy: &mut ContactEnergy,
    ) -> Vector {
        let approach = -dot(velocity, normal);
        let normal_n = (self.stiffness_n_per_m * overlap_m + damping_n_s_per_m * approach).max(0.0);
        energy.normal_w += normal_n * approach;
        energy.normal_j += 0.5 * self.stiffness_n_per_m * overlap_m * overlap_m;
        let force = times(normal_n, normal);
        if self.friction_coefficient == 0.0 {
            history.touches = true;
            return force;
        }
        let sliding = across(velocity, normal);
        let stiffness = TANGENTIAL * self.stiffness_n_per_m;
        let damping = TANGENTIAL * damping_n_s_per_m;
        let mut stretch = if history.touches {
            let moved = plus_times(&history.stretch_m, 0.5 * step_s, &history.sliding_m_per_s);
            // The plane of the contact turns with the spheres.
            across(&plus_times(&moved, 0.5 * step_s, &sliding), normal)
        } else {
            [0.0; 3]
        };
        // A spring cannot be longer than the force that friction allows.
        let most_n = self.friction_coefficient * normal_n;
        let (long_m, most_m) = (length(&stretch), most_n / stiffness);
        if long_m > most_m {
            stretch = times(most_m / long_m, &stretch);
        }
        let mut tangential = plus_times(&times(-stiffness, &stretch), -damping, &sliding);
        let wanted_n = length(&tangential);
        if wanted_n > most_n {
            tangential = times(most_n / wanted_n, &tangential);
        }
        energy.tangential_w -= dot(&tangential, &sliding);
        energy.tangential_j += 0.5 * stiffness * dot(&stretch, &stretch);
        *history = History { touches: true, stretch_m: stretch, sliding_m_per_s: sliding };
        [force[0] + tangential[0], force[1] + tangential[1], force[2] + tangential[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damping_ratio_gives_back_its_restitution() {
        for wanted in [0.01, 0.1, 0.135, 0.136, 0.4, 0.9, 0.999] {
            let found = restitution(damping_ratio(wanted));
            assert!((found / wanted - 1.0).abs() < 1e-9, "{wanted}: {found}");
        }
        assert_eq!(damping_ratio(1.0), 0.0);
        // At critical damping the force ends after 2/ω0.
        assert!((restitution(1.0) - libm::exp(-2.0)).abs() < 1e-12);
    }
}
