//! Soft walls from material data: storage modulus, shape factor and loss factor.
//!
//! A viscoelastic pad of storage modulus E_s and shape factor ν has the stiffness k1 = ν E_s and dissipates energy
//! according to its loss factor η. The Voigt model has a constant c1 instead; its energy loss per cycle equals that of
//! the pad at only one angular frequency ω, where c1 ω = k1 η. [`DampingLaw`] selects that ω.

use super::{Release, Structure, Wall};

/// Frequency at which a Voigt wall has the given loss factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DampingLaw {
    /// c1 = k1 η/ω with the structure's ω = √(k/M), the frequency of the motion that drives the particle.
    #[default]
    Natural,
    /// c1 = k1 η/ω with ω = √(k1 (M+m)/(M m)), the frequency of the particle on the wall's spring during contact.
    Contact,
    /// c1 = k1 η/f with f in Hz, as eq. 4.7 of the source document is printed: 2π times [`DampingLaw::Natural`].
    NaturalHz,
}

impl DampingLaw {
    /// All variants.
    pub const ALL: [Self; 3] = [Self::Natural, Self::Contact, Self::NaturalHz];

    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Natural => "natural",
            Self::Contact => "contact",
            Self::NaturalHz => "natural_hz",
        }
    }

    /// c1, N·s/m, of a wall of stiffness k1 (N/m) and loss factor η between `structure` and a particle.
    #[must_use]
    pub fn damping_n_s_per_m(
        self,
        stiffness_n_per_m: f64,
        loss_factor: f64,
        structure: &Structure,
        particle_mass_kg: f64,
    ) -> f64 {
        let natural = structure.angular_frequency_rad_per_s();
        let at = match self {
            Self::Natural => natural,
            Self::NaturalHz => natural / (2.0 * core::f64::consts::PI),
            Self::Contact => {
                let reduced = structure.mass_kg * particle_mass_kg / (structure.mass_kg + particle_mass_kg);
                libm::sqrt(stiffness_n_per_m / reduced)
            }
        };
        stiffness_n_per_m * loss_factor / at
    }
}

/// The pads measured in the source document (its table 4-5), at room temperature and low frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// νE_s = 43.436 kN/m, η = 0.164.
    Rubber,
    /// νE_s = 51.636 kN/m, η = 0.209.
    AntiVibrationPad,
    /// νE_s = 112.43 kN/m, η = 0.683.
    AcrylicFoam,
    /// Polyurethane: νE_s = 1.0249 kN/m, η = 0.224.
    PuFoam,
}

impl Material {
    /// All variants.
    pub const ALL: [Self; 4] = [Self::Rubber, Self::AntiVibrationPad, Self::AcrylicFoam, Self::PuFoam];

    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rubber => "rubber",
            Self::AntiVibrationPad => "anti_vibration_pad",
            Self::AcrylicFoam => "acrylic_foam",
            Self::PuFoam => "pu_foam",
        }
    }

    /// k1 = νE_s, N/m.
    #[must_use]
    pub fn stiffness_n_per_m(self) -> f64 {
        match self {
            Self::Rubber => 43_436.0,
            Self::AntiVibrationPad => 51_636.0,
            Self::AcrylicFoam => 112_430.0,
            Self::PuFoam => 1_024.9,
        }
    }

    /// η.
    #[must_use]
    pub fn loss_factor(self) -> f64 {
        match self {
            Self::Rubber => 0.164,
            Self::AntiVibrationPad => 0.209,
            Self::AcrylicFoam => 0.683,
            Self::PuFoam => 0.224,
        }
    }
}

impl Wall {
    /// A soft wall of stiffness k1 = νE_s (N/m, greater than 0) and loss factor η (0 or greater) in `structure`, for a
    /// particle of the given mass (kg).
    #[must_use]
    pub fn viscoelastic(
        stiffness_n_per_m: f64,
        loss_factor: f64,
        law: DampingLaw,
        structure: &Structure,
        particle_mass_kg: f64,
        release: Release,
    ) -> Self {
        let damping_n_s_per_m = law.damping_n_s_per_m(stiffness_n_per_m, loss_factor, structure, particle_mass_kg);
        Self::Voigt { stiffness_n_per_m, damping_n_s_per_m, release }
    }

    /// A soft wall of one of the measured materials.
    #[must_use]
    pub fn of_material(
        material: Material,
        law: DampingLaw,
        structure: &Structure,
        particle_mass_kg: f64,
        release: Release,
    ) -> Self {
        let (stiffness, loss) = (material.stiffness_n_per_m(), material.loss_factor());
        Self::viscoelastic(stiffness, loss, law, structure, particle_mass_kg, release)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn damping(material: Material, law: DampingLaw) -> f64 {
        let structure = Structure::from_modal(1.6, 2.5, 0.0038);
        let wall = Wall::of_material(material, law, &structure, 0.16, Release::ZeroForce);
        wall.spring_and_dashpot().map_or(f64::NAN, |(_, damping_n_s_per_m)| damping_n_s_per_m)
    }

    #[test]
    fn materials_have_the_golden_cases_dashpots() {
        let golden = [
            (Material::PuFoam, DampingLaw::Natural, 14.615_363_945_269_566),
            (Material::Rubber, DampingLaw::Natural, 453.496_349_493_955_5),
            (Material::AntiVibrationPad, DampingLaw::Natural, 687.035_220_028_823_8),
            (Material::PuFoam, DampingLaw::Contact, 2.734_969_034_892_019),
        ];
        for (material, law, c1) in golden {
            assert!((damping(material, law) / c1 - 1.0).abs() < 1e-14, "{material:?} {law:?}");
        }
    }

    #[test]
    fn the_printed_law_is_two_pi_times_the_default() {
        let ratio =
            damping(Material::AcrylicFoam, DampingLaw::NaturalHz) / damping(Material::AcrylicFoam, DampingLaw::Natural);
        assert!((ratio - 2.0 * core::f64::consts::PI).abs() < 1e-14);
    }

    #[test]
    fn a_dashpot_dissipates_the_loss_factors_energy_at_its_frequency() {
        // Loss per cycle over 2π times the stored energy ½k1X²: π c1 ω X²/(π k1 X²) = η.
        let omega = Structure::from_modal(1.6, 2.5, 0.0).angular_frequency_rad_per_s();
        let lost = damping(Material::Rubber, DampingLaw::Natural) * omega / Material::Rubber.stiffness_n_per_m();
        assert!((lost - Material::Rubber.loss_factor()).abs() < 1e-15);
    }
}
