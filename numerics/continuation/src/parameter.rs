//! Parameters along which orbits are followed.

use crate::dual::Real;

/// A parameter. Its unit is that of the field of the model, or none for a ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Ω/2π of the drive, Hz.
    Frequency,
    /// Z of the base's sine, m.
    BaseAmplitude,
    /// P of the force's sine, N.
    ForceAmplitude,
    /// c of the structure, N·s/m.
    StructureDamping,
    /// ζ of the structure.
    StructureDampingRatio,
    /// m of the particle or the tuned mass, kg.
    Mass,
    /// m/M.
    MassRatio,
    /// d, m.
    Clearance,
    /// d/Z.
    ClearanceRatio,
    /// μi of the friction between particle and structure.
    InternalFriction,
    /// e of hard walls.
    Restitution,
    /// k1 of soft walls or of the tuned mass, N/m.
    LinkStiffness,
    /// c1 of soft walls or of the tuned mass, N·s/m.
    LinkDamping,
    /// F of the friction damper, N.
    DamperForce,
    /// F/(kZ).
    DamperForceRatio,
    /// γ: the tuned mass's own frequency over the structure's.
    LinkFrequencyRatio,
    /// ζ of the tuned mass: c1/(2√(k1 m)).
    LinkDampingRatio,
}

/// Ratios that keep their value while another parameter changes: d/Z and F/(kZ) while Z changes, m/M of the tuned mass with its
/// frequency and damping ratio.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ties {
    /// d/Z.
    pub clearance_ratio: Option<f64>,
    /// F/(kZ).
    pub damper_force_ratio: Option<f64>,
    /// γ of the tuned mass.
    pub link_frequency_ratio: Option<f64>,
    /// ζ of the tuned mass.
    pub link_damping_ratio: Option<f64>,
}

/// The values that the equations of motion use, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<T> {
    pub(crate) structure_mass: T,
    pub(crate) damping: T,
    pub(crate) stiffness: T,
    pub(crate) mass: T,
    pub(crate) clearance: T,
    pub(crate) friction_acceleration: T,
    pub(crate) restitution: T,
    pub(crate) link_stiffness: T,
    pub(crate) link_damping: T,
    pub(crate) damper_force: T,
    pub(crate) base_amplitude: T,
    pub(crate) force_amplitude: T,
    pub(crate) turning: T,
    pub(crate) gravity: T,
    pub(crate) clearance_ratio: Option<T>,
    pub(crate) damper_force_ratio: Option<T>,
    pub(crate) link_frequency_ratio: Option<T>,
    pub(crate) link_damping_ratio: Option<T>,
}

impl<T: Real> Values<T> {
    /// Sets a parameter. Ratios take effect in [`Values::tied`].
    pub(crate) fn set(&mut self, parameter: Parameter, value: T) {
        match parameter {
            Parameter::Frequency => self.turning = value * T::of(std::f64::consts::TAU),
            Parameter::BaseAmplitude => self.base_amplitude = value,
            Parameter::ForceAmplitude => self.force_amplitude = value,
            Parameter::StructureDamping => self.damping = value,
            Parameter::StructureDampingRatio => {
                self.damping = T::of(2.0) * value * (self.stiffness * self.structure_mass).sqrt();
            }
            Parameter::Mass => self.mass = value,
            Parameter::MassRatio => self.mass = value * self.structure_mass,
            Parameter::Clearance => (self.clearance, self.clearance_ratio) = (value, None),
            Parameter::ClearanceRatio => self.clearance_ratio = Some(value),
            Parameter::InternalFriction => self.friction_acceleration = value * self.gravity,
            Parameter::Restitution => self.restitution = value,
            Parameter::LinkStiffness => (self.link_stiffness, self.link_frequency_ratio) = (value, None),
            Parameter::LinkDamping => (self.link_damping, self.link_damping_ratio) = (value, None),
            Parameter::DamperForce => (self.damper_force, self.damper_force_ratio) = (value, None),
            Parameter::DamperForceRatio => self.damper_force_ratio = Some(value),
            Parameter::LinkFrequencyRatio => self.link_frequency_ratio = Some(value),
            Parameter::LinkDampingRatio => self.link_damping_ratio = Some(value),
        }
    }

    /// The values with those that follow from ratios.
    pub(crate) fn tied(mut self) -> Self {
        if let Some(ratio) = self.clearance_ratio {
            self.clearance = ratio * self.base_amplitude;
        }
        if let Some(ratio) = self.damper_force_ratio {
            self.damper_force = ratio * self.stiffness * self.base_amplitude;
        }
        if let Some(ratio) = self.link_frequency_ratio {
            self.link_stiffness = ratio * ratio * self.stiffness * self.mass / self.structure_mass;
        }
        if let Some(ratio) = self.link_damping_ratio {
            self.link_damping = T::of(2.0) * ratio * (self.link_stiffness * self.mass).sqrt();
        }
        self
    }
}
