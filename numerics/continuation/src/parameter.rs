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
    /// fn of the structure, Hz, at the same M and ζ.
    NaturalFrequency,
    /// M of the structure, kg, at the same fn and ζ.
    StructureMass,
    /// g, m/s².
    Gravity,
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
    /// e of hard walls, at the reference speed where it varies; of two different walls that at the negative side.
    Restitution,
    /// Exponent of e over the speed, of the same walls.
    RestitutionExponent,
    /// k1 of soft walls or of the tuned mass, N/m; of two different walls that at the negative side.
    LinkStiffness,
    /// c1 of soft walls or of the tuned mass, N·s/m; of two different walls that at the negative side.
    LinkDamping,
    /// e of the wall at the positive side, where it differs.
    PositiveRestitution,
    /// Exponent of e over the speed, of the wall at the positive side.
    PositiveRestitutionExponent,
    /// k1 of the wall at the positive side, N/m.
    PositiveStiffness,
    /// c1 of the wall at the positive side, N·s/m.
    PositiveDamping,
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

/// The values of a wall that parameters change, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallValues<T> {
    /// e, at the reference speed where it varies.
    pub(crate) restitution: T,
    /// Exponent of e over the speed.
    pub(crate) exponent: T,
    /// k1 of a soft wall; at the first place that of a tuned mass too.
    pub(crate) stiffness: T,
    /// c1, likewise.
    pub(crate) damping: T,
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
    /// Of the wall at the negative side, which may be both, and at the positive side, which acts where it differs.
    pub(crate) walls: [WallValues<T>; 2],
    pub(crate) damper_force: T,
    pub(crate) base_amplitude: T,
    pub(crate) force_amplitude: T,
    pub(crate) turning: T,
    pub(crate) whole_gravity: T,
    /// The part of g that presses the particle on its floor, and that along the motion.
    pub(crate) gravity: T,
    pub(crate) weight: T,
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
            Parameter::NaturalFrequency => {
                let omega = value * T::of(std::f64::consts::TAU);
                let ratio = omega / (self.stiffness / self.structure_mass).sqrt();
                self.stiffness = omega * omega * self.structure_mass;
                self.damping = self.damping * ratio;
            }
            Parameter::StructureMass => {
                let ratio = value / self.structure_mass;
                self.stiffness = self.stiffness * ratio;
                self.damping = self.damping * ratio;
                self.structure_mass = value;
            }
            Parameter::Gravity => {
                let ratio = value / self.whole_gravity;
                self.friction_acceleration = self.friction_acceleration * ratio;
                self.gravity = self.gravity * ratio;
                self.weight = self.weight * ratio;
                self.whole_gravity = value;
            }
            Parameter::Mass => self.mass = value,
            Parameter::MassRatio => self.mass = value * self.structure_mass,
            Parameter::Clearance => (self.clearance, self.clearance_ratio) = (value, None),
            Parameter::ClearanceRatio => self.clearance_ratio = Some(value),
            Parameter::InternalFriction => self.friction_acceleration = value * self.gravity,
            Parameter::Restitution => self.walls[0].restitution = value,
            Parameter::RestitutionExponent => self.walls[0].exponent = value,
            Parameter::LinkStiffness => (self.walls[0].stiffness, self.link_frequency_ratio) = (value, None),
            Parameter::LinkDamping => (self.walls[0].damping, self.link_damping_ratio) = (value, None),
            Parameter::PositiveRestitution => self.walls[1].restitution = value,
            Parameter::PositiveRestitutionExponent => self.walls[1].exponent = value,
            Parameter::PositiveStiffness => self.walls[1].stiffness = value,
            Parameter::PositiveDamping => self.walls[1].damping = value,
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
        let link = &mut self.walls[0];
        if let Some(ratio) = self.link_frequency_ratio {
            link.stiffness = ratio * ratio * self.stiffness * self.mass / self.structure_mass;
        }
        if let Some(ratio) = self.link_damping_ratio {
            link.damping = T::of(2.0) * ratio * (link.stiffness * self.mass).sqrt();
        }
        self
    }
}
