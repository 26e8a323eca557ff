//! Parameters of a motion under a sine that have exact derivatives, by their keys in a case: those that a continuation follows.

use damprig_continuation::Parameter;

/// A parameter and its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterKey {
    /// Key in a case, with its table.
    pub key: &'static str,
    /// The parameter.
    pub parameter: Parameter,
    /// Symbol and unit, as axes show them.
    pub label: &'static str,
}

impl ParameterKey {
    /// Name of its column in tables: the key without its table.
    #[must_use]
    pub fn column(&self) -> String {
        self.key.replace('.', "_")
    }

    /// Its unit; "1" for a plain number.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.label.rsplit_once('(').map_or("1", |(_, unit)| unit.trim_end_matches(')'))
    }

    /// Its range, as a case declares it.
    pub(crate) fn refusal(&self, value: f64) -> Option<String> {
        let (path, name) = self.key.rsplit_once('.')?;
        let tables = crate::setup::TABLES.iter().chain(crate::simulation::TABLES);
        let quantities = tables.filter(|table| table.path == path).flat_map(|table| table.quantities);
        let key = quantities.flat_map(|quantity| quantity.keys).find(|key| key.name == name)?;
        key.refusal(value)
    }
}

const fn key(key: &'static str, parameter: Parameter, label: &'static str) -> ParameterKey {
    ParameterKey { key, parameter, label }
}

/// Every parameter.
pub const PARAMETERS: [ParameterKey; 26] = [
    key("base.frequency_hz", Parameter::Frequency, "Frequency of the base (Hz)"),
    key("base.amplitude_m", Parameter::BaseAmplitude, "Z (m)"),
    key("force.frequency_hz", Parameter::Frequency, "Frequency of the force (Hz)"),
    key("force.amplitude_n", Parameter::ForceAmplitude, "P (N)"),
    key("structure.damping_ratio", Parameter::StructureDampingRatio, "ζ of the structure"),
    key("structure.damping_n_s_per_m", Parameter::StructureDamping, "c (N·s/m)"),
    key("particle.clearance_m", Parameter::Clearance, "d (m)"),
    key("particle.clearance_ratio", Parameter::ClearanceRatio, "d/Z"),
    key("particle.mass_kg", Parameter::Mass, "m (kg)"),
    key("particle.mass_ratio", Parameter::MassRatio, "m/M"),
    key("particle.friction_coefficient", Parameter::InternalFriction, "μi"),
    key("particle.wall.coefficient", Parameter::Restitution, "e"),
    key("particle.wall.exponent", Parameter::RestitutionExponent, "exponent of e(v)"),
    key("particle.wall.stiffness_n_per_m", Parameter::LinkStiffness, "k1 of the wall (N/m)"),
    key("particle.wall.damping_n_s_per_m", Parameter::LinkDamping, "c1 of the wall (N·s/m)"),
    key("particle.positive_wall.coefficient", Parameter::PositiveRestitution, "e of the positive wall"),
    key(
        "particle.positive_wall.exponent",
        Parameter::PositiveRestitutionExponent,
        "exponent of e(v) of the positive wall",
    ),
    key("particle.positive_wall.stiffness_n_per_m", Parameter::PositiveStiffness, "k1 of the positive wall (N/m)"),
    key("particle.positive_wall.damping_n_s_per_m", Parameter::PositiveDamping, "c1 of the positive wall (N·s/m)"),
    key("friction_damper.force_n", Parameter::DamperForce, "F (N)"),
    key("friction_damper.friction_ratio", Parameter::DamperForceRatio, "F/(kZ)"),
    key("tmd.mass_kg", Parameter::Mass, "m of the tuned mass (kg)"),
    key("tmd.stiffness_n_per_m", Parameter::LinkStiffness, "k1 of the tuned mass (N/m)"),
    key("tmd.damping_n_s_per_m", Parameter::LinkDamping, "c1 of the tuned mass (N·s/m)"),
    key("tmd.frequency_ratio", Parameter::LinkFrequencyRatio, "γ of the tuned mass"),
    key("tmd.damping_ratio", Parameter::LinkDampingRatio, "ζ of the tuned mass"),
];
