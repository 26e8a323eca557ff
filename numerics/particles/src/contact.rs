//! The forces of a contact, along and across the line of centres.

use core::f64::consts::PI;

use damprig_core::model::Hertz;

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

/// What presses two surfaces apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elasticity {
    /// A spring with the same stiffness in every contact: a choice of the calculation.
    Spring {
        /// k, N/m; greater than 0.
        stiffness_n_per_m: f64,
    },
    /// Elastic spheres in an elastic box of the same material (Hertz 1882, Mindlin 1949).
    Hertz {
        /// E, Pa; greater than 0.
        youngs_modulus_pa: f64,
        /// ν, from 0 to 0.5.
        poisson_ratio: f64,
    },
}

/// Speed of the contacts whose duration gives the steps of Hertz contacts, m/s. The duration falls with v^(−1/5): contacts at a
/// hundredth of this speed last 2.5 times as long.
pub const FAST_M_PER_S: f64 = 10.0;

/// Spring and dashpot along the line of centres between two kinds of bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringAndDashpot {
    /// k, N/m; of Hertz contacts N/m^1.5.
    stiffness: f64,
    /// c, N·s/m; of Hertz contacts N·s/m^1.25.
    damping: f64,
}

impl SpringAndDashpot {
    /// k, N/m; of Hertz contacts N/m^1.5.
    #[must_use]
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }
}

/// Constants of the contacts.
///
/// Along the line of centres a spring: the force k·δ + c·δ′ on the overlap δ, but never less than 0. Across it: a spring of 2/7·k
/// and a dashpot of 2/7·c on the sliding of the surfaces, which gives both directions one frequency for full spheres;
/// spring and force have at most μ times the force along the line of centres.
///
/// Hertz: along the line of centres k·δ^1.5 + c·δ^(1/4)·δ′, but never less than 0, with k = 4/3·E\*√R and c = √5·ζ√(km) (Tsuji, Tanaka
/// and Ishida 1992). With w = √(4/5)·δ^(5/4) for δ its phase plane is that of the spring with the damping ratio ζ, so that [`damping_ratio`]
/// holds and the restitution does not depend on the speed. Across it the stiffness is that of Mindlin without slip,
/// 2(1 − ν)/(2 − ν) times the slope of the force along it: a stretched spring whose energy grows with √δ, so that it also presses the
/// surfaces apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// Between two spheres.
    pub pair: SpringAndDashpot,
    /// At the walls across the motion, which are as heavy as the structure.
    pub end: SpringAndDashpot,
    /// At the other walls.
    pub side: SpringAndDashpot,
    /// μ, 0 or greater.
    pub friction_coefficient: f64,
    /// Fastest rate of a contact, rad/s: √(k/m) of the lightest pair, or more with heavy damping.
    pub fastest_rate_rad_per_s: f64,
    /// Slope of the force at an end on the overlap, N/m; with Hertz contacts in the deepest overlap at [`FAST_M_PER_S`].
    pub end_stiffness_n_per_m: f64,
    /// Slope of the force at an end on the speed of approach, N·s/m; with Hertz contacts as above.
    pub end_damping_n_s_per_m: f64,
    is_hertz: bool,
    /// Stiffness across the line of centres over k, or over k√δ.
    tangential_stiffness: f64,
    /// Damping across the line of centres over that along it.
    tangential_damping: f64,
}

/// Stiffness and damping across the line of centres over those along it, of springs.
pub const TANGENTIAL: f64 = 2.0 / 7.0;

impl ContactLaw {
    /// Of spheres of this mass and radius with this coefficient of restitution. `structure_kg` moves with the walls across the motion.
    #[must_use]
    pub fn new(
        (elasticity, restitution_coefficient, friction_coefficient): (Elasticity, f64, f64),
        (sphere_kg, radius_m): (f64, f64),
        structure_kg: f64,
    ) -> Self {
        let ratio = damping_ratio(restitution_coefficient);
        let end_kg = sphere_kg * structure_kg / (sphere_kg + structure_kg);
        let law = Self {
            pair: SpringAndDashpot { stiffness: 0.0, damping: 0.0 },
            end: SpringAndDashpot { stiffness: 0.0, damping: 0.0 },
            side: SpringAndDashpot { stiffness: 0.0, damping: 0.0 },
            friction_coefficient,
            fastest_rate_rad_per_s: 0.0,
            end_stiffness_n_per_m: 0.0,
            end_damping_n_s_per_m: 0.0,
            is_hertz: false,
            tangential_stiffness: TANGENTIAL,
            tangential_damping: TANGENTIAL,
        };
        match elasticity {
            Elasticity::Spring { stiffness_n_per_m: stiffness } => {
                let contact =
                    |kg: f64| SpringAndDashpot { stiffness, damping: 2.0 * ratio * libm::sqrt(stiffness * kg) };
                let end = contact(end_kg);
                Self {
                    pair: contact(0.5 * sphere_kg),
                    end,
                    side: contact(sphere_kg),
                    fastest_rate_rad_per_s: libm::sqrt(stiffness / end_kg.min(0.5 * sphere_kg))
                        * (2.0 * ratio).max(1.0),
                    end_stiffness_n_per_m: stiffness,
                    end_damping_n_s_per_m: end.damping,
                    ..law
                }
            }
            Elasticity::Hertz { youngs_modulus_pa, poisson_ratio } => {
                let contact = |kg: f64, radius_m: f64| {
                    let material = ([youngs_modulus_pa; 2], [poisson_ratio; 2]);
                    let stiffness = Hertz::stiffness_of_sphere_n_per_m15(material.0, material.1, radius_m);
                    SpringAndDashpot { stiffness, damping: libm::sqrt(5.0) * ratio * libm::sqrt(stiffness * kg) }
                };
                let duration_s = |contact: &SpringAndDashpot, kg: f64| {
                    Hertz::elastic(contact.stiffness).elastic_duration_s(kg, FAST_M_PER_S)
                };
                let (pair, end) = (contact(0.5 * sphere_kg, 0.5 * radius_m), contact(end_kg, radius_m));
                let shortest_s = duration_s(&pair, 0.5 * sphere_kg).min(duration_s(&end, end_kg));
                let root = libm::sqrt(Hertz::elastic(end.stiffness).peak_penetration_m(end_kg, FAST_M_PER_S));
                let mindlin = 2.0 * (1.0 - poisson_ratio) / (2.0 - poisson_ratio);
                Self {
                    pair,
                    end,
                    side: contact(sphere_kg, radius_m),
                    fastest_rate_rad_per_s: PI / shortest_s * (2.0 * ratio).max(1.0),
                    end_stiffness_n_per_m: 1.5 * end.stiffness * root,
                    end_damping_n_s_per_m: end.damping * libm::sqrt(root),
                    is_hertz: true,
                    tangential_stiffness: 1.5 * mindlin,
                    tangential_damping: mindlin,
                    ..law
                }
            }
        }
    }

    /// Duration of the shortest contact, s; of Hertz contacts at [`FAST_M_PER_S`].
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
        contact: &SpringAndDashpot,
        (overlap_m, normal, velocity): (f64, &Vector, &Vector),
        step_s: f64,
        history: &mut History,
        energy: &mut ContactEnergy,
    ) -> Vector {
        // Spheres in their packing may touch in a point.
        if self.is_hertz && overlap_m <= 0.0 {
            history.touches = false;
            return [0.0; 3];
        }
        let approach = -dot(velocity, normal);
        // √δ of a Hertz contact.
        let root = if self.is_hertz { overlap_m.sqrt() } else { 1.0 };
        let secant_n_per_m = contact.stiffness * root;
        let damping_n_s_per_m = if self.is_hertz { contact.damping * root.sqrt() } else { contact.damping };
        let stored = if self.is_hertz { 0.4 } else { 0.5 };
        let normal_n = (secant_n_per_m * overlap_m + damping_n_s_per_m * approach).max(0.0);
        energy.normal_w += normal_n * approach;
        energy.normal_j += stored * secant_n_per_m * overlap_m * overlap_m;
        let mut force = times(normal_n, normal);
        if self.friction_coefficient == 0.0 {
            history.touches = true;
            return force;
        }
        let sliding = across(velocity, normal);
        let stiffness = self.tangential_stiffness * secant_n_per_m;
        let damping = self.tangential_damping * damping_n_s_per_m;
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
        let stretched_j = 0.5 * stiffness * dot(&stretch, &stretch);
        if self.is_hertz {
            // The slope of the stretched spring's energy ~√δ on the overlap: with it no work is gained as its stiffness changes.
            let parting_n = 0.5 * stretched_j / overlap_m;
            force = plus_times(&force, parting_n, normal);
            energy.tangential_w += parting_n * approach;
        }
        energy.tangential_w -= dot(&tangential, &sliding);
        energy.tangential_j += stretched_j;
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
