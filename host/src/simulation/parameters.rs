//! Parameters of a motion under a sine that have exact derivatives, by their keys in a case: those that a continuation follows.

use damprig_continuation::Parameter;

/// A parameter and its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterKey {
    /// Key in a case, with its table.
    pub key: &'static str,
    /// The parameter.
    pub parameter: Parameter,
}

impl ParameterKey {
    /// Its range, as a case declares it.
    pub(crate) fn refusal(&self, value: f64) -> Option<String> {
        let (path, name) = self.key.rsplit_once('.')?;
        let tables = crate::setup::TABLES.iter().chain(crate::structure::TABLES).chain(crate::simulation::TABLES);
        let quantities = tables.filter(|table| table.path == path).flat_map(|table| table.quantities);
        let key = quantities.flat_map(|quantity| quantity.keys).find(|key| key.name == name)?;
        key.refusal(value)
    }
}

const fn key(key: &'static str, parameter: Parameter) -> ParameterKey {
    ParameterKey { key, parameter }
}

/// Every parameter.
pub const PARAMETERS: [ParameterKey; 26] = [
    key("base.frequency_hz", Parameter::Frequency),
    key("base.amplitude_m", Parameter::BaseAmplitude),
    key("force.frequency_hz", Parameter::Frequency),
    key("force.amplitude_n", Parameter::ForceAmplitude),
    key("structure.damping_ratio", Parameter::StructureDampingRatio),
    key("structure.damping_n_s_per_m", Parameter::StructureDamping),
    key("particle.clearance_m", Parameter::Clearance),
    key("particle.clearance_ratio", Parameter::ClearanceRatio),
    key("particle.mass_kg", Parameter::Mass),
    key("particle.mass_ratio", Parameter::MassRatio),
    key("particle.friction_coefficient", Parameter::InternalFriction),
    key("particle.wall.coefficient", Parameter::Restitution),
    key("particle.wall.exponent", Parameter::RestitutionExponent),
    key("particle.wall.stiffness_n_per_m", Parameter::LinkStiffness),
    key("particle.wall.damping_n_s_per_m", Parameter::LinkDamping),
    key("particle.positive_wall.coefficient", Parameter::PositiveRestitution),
    key("particle.positive_wall.exponent", Parameter::PositiveRestitutionExponent),
    key("particle.positive_wall.stiffness_n_per_m", Parameter::PositiveStiffness),
    key("particle.positive_wall.damping_n_s_per_m", Parameter::PositiveDamping),
    key("friction_damper.force_n", Parameter::DamperForce),
    key("friction_damper.friction_ratio", Parameter::DamperForceRatio),
    key("tmd.mass_kg", Parameter::Mass),
    key("tmd.stiffness_n_per_m", Parameter::LinkStiffness),
    key("tmd.damping_n_s_per_m", Parameter::LinkDamping),
    key("tmd.frequency_ratio", Parameter::LinkFrequencyRatio),
    key("tmd.damping_ratio", Parameter::LinkDampingRatio),
];
