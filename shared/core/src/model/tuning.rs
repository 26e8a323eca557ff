//! Optimal tuning of a tuned mass damper on an undamped structure, μ = m/M.

use super::{Structure, Tmd};

/// A tuning rule for the spring and dashpot of a tuned mass damper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tuning {
    /// For a harmonic force on the structure (Den Hartog): γ = 1/(1+μ), ζ = √(3μ/(8(1+μ))). The two fixed points of the
    /// response, which are independent of damping, both have the height √(1+2/μ).
    ///
    /// ζ refers to the damper's own critical damping: c1/(2 m ω1). Den Hartog's book divides by 2 m ω with the
    /// structure's ω: the same c1 is then √(3μ/(8(1+μ)³)) (0.1679 for μ = 0.1, where ζ = 0.1846).
    DenHartog,
    /// For a random (white) acceleration of the base, minimum mean square of x − z (Warburton 1982): γ =
    /// √(1−μ/2)/(1+μ), ζ = √(μ(1−μ/4)/(4(1+μ)(1−μ/2))). Valid for μ below 2.
    Warburton,
}

impl Tuning {
    /// All variants.
    pub const ALL: [Self; 2] = [Self::DenHartog, Self::Warburton];

    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::DenHartog => "den_hartog",
            Self::Warburton => "warburton",
        }
    }

    /// γ = ω1/ω, the damper's own frequency over the structure's; NaN outside the rule's range (Warburton for μ above
    /// 2).
    #[must_use]
    pub fn frequency_ratio(self, mass_ratio: f64) -> f64 {
        match self {
            Self::DenHartog => 1.0 / (1.0 + mass_ratio),
            Self::Warburton => libm::sqrt(1.0 - 0.5 * mass_ratio) / (1.0 + mass_ratio),
        }
    }

    /// ζ = c1/(2√(k1 m)).
    #[must_use]
    pub fn damping_ratio(self, mass_ratio: f64) -> f64 {
        let whole = 1.0 + mass_ratio;
        match self {
            Self::DenHartog => libm::sqrt(3.0 * mass_ratio / (8.0 * whole)),
            Self::Warburton => {
                let over = 4.0 * whole * (1.0 - 0.5 * mass_ratio);
                libm::sqrt(mass_ratio * (1.0 - 0.25 * mass_ratio) / over)
            }
        }
    }
}

impl Tmd {
    /// A damper of mass m (kg) with frequency ratio γ and damping ratio ζ on `structure`.
    #[must_use]
    pub fn from_ratios(structure: &Structure, mass_kg: f64, frequency_ratio: f64, damping_ratio: f64) -> Self {
        let omega = frequency_ratio * structure.angular_frequency_rad_per_s();
        Self {
            mass_kg,
            stiffness_n_per_m: mass_kg * omega * omega,
            damping_n_s_per_m: 2.0 * damping_ratio * mass_kg * omega,
        }
    }

    /// A damper of mass m (kg), tuned by a rule.
    #[must_use]
    pub fn tuned(structure: &Structure, mass_kg: f64, tuning: Tuning) -> Self {
        let mass_ratio = mass_kg / structure.mass_kg;
        Self::from_ratios(structure, mass_kg, tuning.frequency_ratio(mass_ratio), tuning.damping_ratio(mass_ratio))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |x| k/P of an undamped structure with a damper under P sin Ωt, r = Ω/ω.
    fn magnification(mass_ratio: f64, gamma: f64, zeta: f64, r: f64) -> f64 {
        let damping = 2.0 * zeta * gamma * r;
        let own = gamma * gamma - r * r;
        let real = own * (1.0 - r * r) - mass_ratio * gamma * gamma * r * r;
        let imaginary = damping * (1.0 - r * r - mass_ratio * r * r);
        libm::sqrt((own * own + damping * damping) / (real * real + imaginary * imaginary))
    }

    #[test]
    fn the_fixed_points_of_den_hartog_are_equally_high_whatever_the_damping() {
        for mass_ratio in [0.01, 0.05, 0.1, 0.3] {
            let gamma = Tuning::DenHartog.frequency_ratio(mass_ratio);
            // r² = [1 + γ²(1+μ) ± √(…)]/(2+μ) with γ = 1/(1+μ): r² = (1 ± √(μ/(2+μ)))/(1+μ).
            let height = libm::sqrt(1.0 + 2.0 / mass_ratio);
            for sign in [-1.0, 1.0] {
                let r = libm::sqrt((1.0 + sign * libm::sqrt(mass_ratio / (2.0 + mass_ratio))) / (1.0 + mass_ratio));
                for zeta in [0.01, Tuning::DenHartog.damping_ratio(mass_ratio), 0.5] {
                    let found = magnification(mass_ratio, gamma, zeta, r);
                    assert!((found / height - 1.0).abs() < 1e-12, "μ = {mass_ratio}, ζ = {zeta}: {found}");
                }
            }
        }
    }

    #[test]
    fn den_hartogs_damping_puts_the_peaks_at_the_fixed_points() {
        for mass_ratio in [0.01, 0.1] {
            let (gamma, zeta) =
                (Tuning::DenHartog.frequency_ratio(mass_ratio), Tuning::DenHartog.damping_ratio(mass_ratio));
            let peak =
                (5000..15_000).map(|n| magnification(mass_ratio, gamma, zeta, f64::from(n) * 1e-4)).fold(0.0, f64::max);
            let height = libm::sqrt(1.0 + 2.0 / mass_ratio);
            // Den Hartog's ζ is the mean of the two values that each make one fixed point a peak, so neither fixed
            // point is exactly a peak.
            assert!(peak / height < 1.002, "μ = {mass_ratio}: {peak} over {height}");
        }
    }

    #[test]
    fn no_neighbour_of_warburtons_damper_has_a_smaller_mean_square_under_white_base_acceleration() {
        let mean_square = |mass_ratio: f64, gamma: f64, zeta: f64| {
            let mut sum = 0.0;
            // Midpoints up to ten times the natural frequency; above that the response falls as r⁻².
            for n in 0..100_000 {
                let r = (f64::from(n) + 0.5) * 1e-4;
                let (damping, own) = (2.0 * zeta * gamma * r, gamma * gamma - r * r);
                // The base acceleration acts on the damper's mass too.
                let top = (own + mass_ratio * gamma * gamma, damping * (1.0 + mass_ratio));
                let real = own * (1.0 - r * r) - mass_ratio * gamma * gamma * r * r;
                let imaginary = damping * (1.0 - r * r - mass_ratio * r * r);
                sum += (top.0 * top.0 + top.1 * top.1) / (real * real + imaginary * imaginary);
            }
            sum
        };
        for mass_ratio in [0.02, 0.1] {
            let (gamma, zeta) =
                (Tuning::Warburton.frequency_ratio(mass_ratio), Tuning::Warburton.damping_ratio(mass_ratio));
            let least = mean_square(mass_ratio, gamma, zeta);
            for (other_gamma, other_zeta) in [(0.995, 1.0), (1.005, 1.0), (1.0, 0.98), (1.0, 1.02)] {
                let other = mean_square(mass_ratio, gamma * other_gamma, zeta * other_zeta);
                assert!(
                    other > least,
                    "μ = {mass_ratio}: {other} with γ × {other_gamma}, ζ × {other_zeta}, not {least}"
                );
            }
        }
    }

    #[test]
    fn den_hartogs_damper_is_the_golden_cases() {
        let tmd = Tmd::tuned(&Structure::from_modal(1.6, 2.5, 0.0038), 0.16, Tuning::DenHartog);
        assert!((tmd.stiffness_n_per_m / 32.626_791_408_559_87 - 1.0).abs() < 1e-14);
        assert!((tmd.damping_n_s_per_m / 0.843_716_342_792_915 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_mass_ratio_of_a_tenth_has_the_known_values() {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let of_structure = Tuning::DenHartog.damping_ratio(0.1) * Tuning::DenHartog.frequency_ratio(0.1);
        assert!(close(of_structure, 0.167_852_033), "2 m ω as the unit");
        assert!(close(Tuning::Warburton.frequency_ratio(0.1), 0.886_072_213));
        assert!(close(Tuning::Warburton.damping_ratio(0.1), 0.152_726_418));
    }
}
