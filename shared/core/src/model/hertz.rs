//! Hertz contact with dissipation: the law of force of a wall, and the closed forms of a free impact on it.
//!
//! Sources: the force k δ^1.5 of elastic bodies is Hertz's (Johnson, *Contact Mechanics*, 1985, sections 4.2 and 11.4). Hunt
//! and Crossley (1975) add a dissipation whose coefficient α is a constant of the pair of bodies; Lankarani and Nikravesh
//! (1990) have one that follows from a coefficient of restitution and the approach speed of the impact. Both forces are
//! k δ^1.5 (1 + β δ′) with a β that is constant during a contact. In a free impact of reduced mass m then
//! u/β − ln(1 + β u)/β² + (2k/5m) δ^2.5 is conserved, u = δ′: penetration, force and restitution follow from it.

use super::speed_table::{SPEED_TABLE_POINTS, SpeedTable};
use crate::io::{Invalid, not_negative, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A wall with Hertz contact: F = k δ^1.5 (1 + β δ′) at the penetration δ, and never less than zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Hertz {
    /// k, N/m^1.5; greater than 0.
    pub stiffness_n_per_m15: f64,
    /// What the contact loses.
    pub dissipation: Dissipation,
}

/// The law of dissipation of a Hertz contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Dissipation {
    /// β = 1.5 α at every speed: e is about 1 − α v at slow impacts.
    HuntCrossley {
        /// α, s/m; 0 (no energy is lost) or greater.
        coefficient_s_per_m: f64,
    },
    /// β = 0.75 (1 − e²)/v with the approach speed v of the contact. The restitution that follows is the same at every
    /// speed; it is close to e only where e is close to 1.
    LankaraniNikravesh {
        /// e of the law, 0 to 1.
        coefficient: f64,
    },
}

/// Largest error of e in [`Hertz::table`], up to its fastest speed.
pub const HERTZ_TABLE_ERROR: f64 = 0.005;

/// βv at the points of [`Hertz::table`]. e falls with rising slope: a chord lies above it, so that the table is
/// [`HERTZ_TABLE_ERROR`] too high between points and too low at them. Up to the first one it is constant, and too high there. The
/// last one is limited by the rebound speed, which must not fall.
const TABLE_RATES: [f64; SPEED_TABLE_POINTS] = [0.0151, 0.1755, 0.6035, 1.2155, 2.1105, 2.975];

/// βv up to which [`Hertz::table`] holds, a little beyond its last point.
const FASTEST_RATE: f64 = 3.0;

/// α below which e is taken as the same at every speed, s/m: it differs by this much from its value at 1 m/s for each m/s.
const NEGLIGIBLE_S_PER_M: f64 = 1e-6;

/// 2 (5/4)^(2/5) ∫₀¹ dx/√(1 − x^2.5).
const DURATION_FACTOR: f64 = 3.218_065_459_719_043;

impl Hertz {
    /// A wall without dissipation: k in N/m^1.5, greater than 0.
    #[must_use]
    pub const fn elastic(stiffness_n_per_m15: f64) -> Self {
        Self { stiffness_n_per_m15, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 0.0 } }
    }

    /// The stiffness of an elastic sphere on a plane body, N/m^1.5: k = 4/3 E* √R with 1/E* = Σ (1 − ν²)/E.
    ///
    /// Young's moduli E in Pa, greater than 0; Poisson ratios ν, above −1, up to 0.5; radius R in m, greater than 0
    /// (Johnson, 1985, equation 4.23).
    #[must_use]
    pub fn stiffness_of_sphere_n_per_m15(moduli_pa: [f64; 2], poisson_ratios: [f64; 2], radius_m: f64) -> f64 {
        let compliance = |n: usize| (1.0 - poisson_ratios[n] * poisson_ratios[n]) / moduli_pa[n];
        4.0 / 3.0 * libm::sqrt(radius_m) / (compliance(0) + compliance(1))
    }

    /// β of a contact with this approach speed, m/s; s/m. 0 at a speed of 0.
    #[must_use]
    pub fn rate_s_per_m(&self, speed_m_per_s: f64) -> f64 {
        match self.dissipation {
            Dissipation::HuntCrossley { coefficient_s_per_m } => 1.5 * coefficient_s_per_m,
            Dissipation::LankaraniNikravesh { coefficient } if speed_m_per_s > 0.0 => {
                0.75 * (1.0 - coefficient * coefficient) / speed_m_per_s
            }
            Dissipation::LankaraniNikravesh { .. } => 0.0,
        }
    }

    /// e of a free impact with this approach speed, m/s, 0 or greater: separation speed over approach speed. The masses do not
    /// matter.
    #[must_use]
    pub fn restitution(&self, speed_m_per_s: f64) -> f64 {
        let approach = self.rate_s_per_m(speed_m_per_s) * speed_m_per_s;
        if approach > 0.0 { returned(approach) / approach } else { 1.0 }
    }

    /// e of free impacts as a table over the approach speed, and the speed up to which the table is within [`HERTZ_TABLE_ERROR`] of
    /// e, m/s: 2/α of Hunt and Crossley. Faster impacts have the e of that speed. `None` where e is the same at every speed.
    #[must_use]
    pub fn table(&self) -> Option<(SpeedTable, f64)> {
        let rate = match self.dissipation {
            Dissipation::HuntCrossley { coefficient_s_per_m } if coefficient_s_per_m > NEGLIGIBLE_S_PER_M => {
                self.rate_s_per_m(1.0)
            }
            _ => return None,
        };
        let mut points = TABLE_RATES.map(|approach| {
            let speed = approach / rate;
            [speed, self.restitution(speed) - HERTZ_TABLE_ERROR]
        });
        points[0][1] += 2.0 * HERTZ_TABLE_ERROR;
        Some((SpeedTable::new(&points)?, FASTEST_RATE / rate))
    }

    /// Largest penetration of a free impact, m: reduced mass in kg and approach speed in m/s, both greater than 0.
    #[must_use]
    pub fn peak_penetration_m(&self, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        self.depth_m(reduced_mass_kg, self.work(speed_m_per_s, speed_m_per_s))
    }

    /// Largest force of a free impact, N: reduced mass in kg and approach speed in m/s, both greater than 0.
    #[must_use]
    pub fn peak_force_n(&self, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        let rate = self.rate_s_per_m(speed_m_per_s);
        let force_n = |speed: f64, work: f64| {
            let depth_m = self.depth_m(reduced_mass_kg, work);
            self.stiffness_n_per_m15 * depth_m * libm::sqrt(depth_m) * (1.0 + rate * speed)
        };
        let all = self.work(speed_m_per_s, speed_m_per_s);
        if rate == 0.0 {
            return force_n(0.0, all);
        }
        // With dissipation the force is largest before the deepest point: where 3u/(5β) = G(v) − G(u), by bisection.
        let (mut low, mut high) = (0.0, speed_m_per_s);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if 0.6 * middle / rate < all - self.work(middle, speed_m_per_s) {
                low = middle;
            } else {
                high = middle;
            }
        }
        force_n(low, all - self.work(low, speed_m_per_s))
    }

    /// Duration of a free impact without dissipation, s: 2 (5/4)^(2/5) ∫₀¹ dx/√(1 − x^2.5) (m²/(k² v))^(1/5). Reduced mass in kg
    /// and approach speed in m/s, both greater than 0.
    #[must_use]
    pub fn elastic_duration_s(&self, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        let ratio = reduced_mass_kg / self.stiffness_n_per_m15;
        DURATION_FACTOR * libm::pow(ratio * ratio / speed_m_per_s, 0.2)
    }

    /// G(u) = u/β − ln(1 + β u)/β², m²/s², u²/2 without dissipation, in a contact with that approach speed.
    fn work(&self, speed_m_per_s: f64, approach_m_per_s: f64) -> f64 {
        let rate = self.rate_s_per_m(approach_m_per_s);
        if rate == 0.0 {
            return 0.5 * speed_m_per_s * speed_m_per_s;
        }
        over_logarithm(rate * speed_m_per_s) / (rate * rate)
    }

    /// δ where (2k/5m) δ^2.5 is this work per mass.
    fn depth_m(&self, reduced_mass_kg: f64, work: f64) -> f64 {
        libm::pow(2.5 * reduced_mass_kg * work / self.stiffness_n_per_m15, 0.4)
    }

    /// Checks that every value is physical.
    pub(super) fn validate(&self) -> Result<(), Invalid> {
        positive("particle.wall.stiffness_n_per_m15", self.stiffness_n_per_m15)?;
        match self.dissipation {
            Dissipation::HuntCrossley { coefficient_s_per_m } => {
                not_negative("particle.wall.coefficient_s_per_m", coefficient_s_per_m)
            }
            Dissipation::LankaraniNikravesh { coefficient } => {
                require((0.0..=1.0).contains(&coefficient), "particle.wall.coefficient", coefficient, "from 0 to 1")
            }
        }
    }
}

/// t − ln(1 + t), to the last bits also where t is small; t > −1.
fn over_logarithm(t: f64) -> f64 {
    if t.abs() > 0.1 {
        return t - libm::log1p(t);
    }
    let sum = (2..19).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - t * sum);
    sum * t * t
}

/// s in 0 to 1 with −s − ln(1 − s) = a − ln(1 + a), a > 0.
fn returned(a: f64) -> f64 {
    let wanted = over_logarithm(a);
    // In L = −ln(1 − s) the left side is L − 1 + exp(−L): convex, so that Newton's method from above does not overshoot.
    let mut l = (wanted + 1.0).min(libm::sqrt(2.0 * wanted) + wanted);
    for _ in 0..60 {
        let s = -libm::expm1(-l);
        let excess = if s < 0.1 { over_logarithm(-s) } else { l - s } - wanted;
        let next = l - excess / s;
        if next >= l {
            break;
        }
        l = next;
    }
    -libm::expm1(-l)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn hunt_crossley(coefficient_s_per_m: f64) -> Hertz {
        Hertz { stiffness_n_per_m15: 1e9, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m } }
    }

    #[test]
    fn both_speeds_of_an_impact_have_the_same_work() {
        for a in [1e-9, 1e-4, 0.03, 0.1, 0.5, 3.0, 10.0] {
            let s = returned(a);
            let (before, after) = (over_logarithm(a), over_logarithm(-s));
            // Near s = 1 the rounding of s counts 1/(1 − s) times.
            assert!((after / before - 1.0).abs() < 1e-14 / (1.0 - s), "{a}: {s} {before} {after}");
        }
    }

    #[test]
    fn a_slow_hunt_crossley_impact_returns_one_minus_alpha_v() {
        // β = 1.5 α; the series of the closed form is e = 1 − (2/3) βv + (4/9)(βv)² − …
        for v in [1e-3, 1e-2] {
            let (e, x) = (hunt_crossley(0.3).restitution(v), 0.45 * v);
            assert!((e - (1.0 - 2.0 / 3.0 * x + 4.0 / 9.0 * x * x)).abs() < x * x * x, "{v}: {e}");
        }
        assert_eq!(hunt_crossley(0.0).restitution(1.0), 1.0);
    }

    #[test]
    fn the_restitution_of_lankarani_and_nikravesh_is_the_same_at_every_speed() {
        let law = Dissipation::LankaraniNikravesh { coefficient: 0.6 };
        let wall = Hertz { stiffness_n_per_m15: 1e9, dissipation: law };
        let e = wall.restitution(1.0);
        for v in [1e-4, 1e-2, 100.0] {
            assert!((wall.restitution(v) - e).abs() < 1e-14);
        }
        // The law's own coefficient is met only near 1.
        assert!(e > 0.7 && e < 0.8, "{e}");
        let near = Hertz { dissipation: Dissipation::LankaraniNikravesh { coefficient: 0.99 }, ..wall };
        // To second order in 1 − e.
        assert!((near.restitution(1.0) - 0.99).abs() < 2e-4);
    }

    #[test]
    fn the_table_of_hunt_and_crossley_is_as_close_to_the_law_as_stated() {
        for coefficient in [1e-4, 0.08, 0.3, 5.0] {
            let wall = hunt_crossley(coefficient);
            let (table, fastest) = wall.table().expect("e varies");
            assert_eq!(table.validate(), Ok(()));
            assert!((fastest * coefficient - 2.0).abs() < 1e-12);
            let error = |v: f64| (table.at(v) - wall.restitution(v)).abs();
            let worst = (1..=20_000).map(|n| error(fastest * f64::from(n) / 20_000.0)).fold(0.0, f64::max);
            assert!(worst <= HERTZ_TABLE_ERROR + 1e-12 && worst > 0.99 * HERTZ_TABLE_ERROR, "{worst}");
        }
        assert_eq!(hunt_crossley(0.0).table(), None);
    }

    #[test]
    fn the_factor_of_the_duration_is_that_of_the_gamma_functions() {
        let factor = 0.8 * libm::pow(1.25, 0.4) * libm::sqrt(PI) * libm::tgamma(0.4) / libm::tgamma(0.9);
        assert!((DURATION_FACTOR / factor - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_force_is_largest_where_it_says() {
        let (wall, m, v) = (hunt_crossley(2.0), 0.1, 0.7);
        let peak = wall.peak_force_n(m, v);
        let all = wall.work(v, v);
        let most = (0..=100_000).map(|n| {
            let u = v * f64::from(n) * 1e-5;
            let depth = wall.depth_m(m, all - wall.work(u, v));
            1e9 * libm::pow(depth, 1.5) * (1.0 + 3.0 * u)
        });
        let most = most.fold(0.0, f64::max);
        assert!(most <= peak * (1.0 + 1e-12) && most > peak * (1.0 - 1e-8), "{most} {peak}");
        assert!(peak > hunt_crossley(0.0).peak_force_n(m, v) * 0.5);
    }

    #[test]
    fn a_steel_ball_on_a_steel_plate_has_the_textbook_stiffness() {
        // E* = 210 GPa/(2·0.91) = 115.385 GPa; R = 10 mm.
        let k = Hertz::stiffness_of_sphere_n_per_m15([210e9; 2], [0.3; 2], 0.01);
        assert!((k / (4.0 / 3.0 * 210e9 / 1.82 * 0.1) - 1.0).abs() < 1e-15);
    }
}
