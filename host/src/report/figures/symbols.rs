//! Symbols of keys as the field writes them: d/Z, e, μi.

use crate::input::key::KeyUnit;
use crate::simulation::Case;

/// Symbols of keys. That of a clearance ratio depends on the case's reference length.
const SYMBOLS: [(&str, &str); 47] = [
    ("structure.mass_kg", "M"),
    ("structure.natural_frequency_hz", "fn"),
    ("structure.damping_ratio", "ζ"),
    ("structure.damping_n_s_per_m", "c"),
    ("base.frequency_hz", "f"),
    ("force.frequency_hz", "f"),
    ("base.angular_frequency_rad_per_s", "Ω"),
    ("force.angular_frequency_rad_per_s", "Ω"),
    ("base.frequency_ratio", "Ω/ωn"),
    ("force.frequency_ratio", "Ω/ωn"),
    ("base.amplitude_m", "Z"),
    ("force.amplitude_n", "P"),
    ("base.noise.from_hz", "fmin"),
    ("base.noise.to_hz", "fmax"),
    ("base.noise.seed", "seed"),
    ("particle.mass_kg", "m"),
    ("particle.mass_ratio", "m/M"),
    ("particle.clearance_m", "d"),
    ("particle.friction_coefficient", "μi"),
    ("particle.wall.coefficient", "e"),
    ("particle.offset_m", "offset"),
    ("particle.inclination_deg", "inclination (°)"),
    ("particle.positive_wall.coefficient", "e at +"),
    ("particle.positive_wall.exponent", "p at +"),
    ("particle.positive_wall.stiffness_n_per_m", "k1 at +"),
    ("particle.positive_wall.damping_n_s_per_m", "c1 at +"),
    ("particle.wall.exponent", "p"),
    ("particle.wall.maximum", "largest e"),
    ("particle.wall.contact_time_s", "τ"),
    ("particle.wall.hertz_stiffness_n_per_m15", "k of the contact"),
    ("particle.wall.stiffness_n_per_m", "k1"),
    ("particle.wall.damping_n_s_per_m", "c1"),
    ("particle.wall.loss_factor", "η"),
    ("friction_damper.force_n", "F"),
    ("friction_damper.friction_ratio", "γF"),
    ("tmd.mass_kg", "m"),
    ("tmd.mass_ratio", "m/M"),
    ("tmd.stiffness_n_per_m", "k1"),
    ("tmd.damping_n_s_per_m", "c1"),
    ("tmd.frequency_ratio", "γ"),
    ("tmd.damping_ratio", "ζ1"),
    ("many_particles.mass_kg", "m"),
    ("many_particles.mass_ratio", "m/M"),
    ("many_particles.clearance_m", "d"),
    ("many_particles.restitution", "e"),
    ("many_particles.friction_coefficient", "μ"),
    ("many_particles.seed", "seed"),
];

/// The symbol of a case's reference length, `Z`, `(P/k)` or `x0`; Z where the case has none.
#[must_use]
pub fn reference(case: &Case) -> &'static str {
    case.reference_m().map_or("Z", |(_, symbol)| symbol)
}

/// The symbol of a key with its tables, if it has one.
fn symbol(key: &str, reference: impl FnOnce() -> &'static str) -> Option<String> {
    if key == "particle.clearance_ratio" {
        return Some(format!("d/{}", reference()));
    }
    SYMBOLS.iter().find(|(known, _)| *known == key).map(|(_, symbol)| (*symbol).to_string())
}

fn unit(key: &str) -> &'static str {
    KeyUnit::of(key).map_or("", |unit| unit.symbol)
}

/// Quantity and unit of a key: `d/Z`, `f (Hz)`; the key where it has no symbol. `reference` is the symbol of the reference length.
#[must_use]
pub fn label(key: &str, reference: impl FnOnce() -> &'static str) -> String {
    let name = symbol(key, reference).unwrap_or_else(|| key.to_string());
    if unit(key).is_empty() { name } else { format!("{name} ({})", unit(key)) }
}

/// Name of a key before a value: `d/Z`, `f`; the key without its tables where it has no symbol.
#[must_use]
pub fn name(key: &str, reference: impl FnOnce() -> &'static str) -> String {
    symbol(key, reference).unwrap_or_else(|| key.rsplit('.').next().unwrap_or(key).to_string())
}

/// Name, value and unit: `d/Z = 15`, `f = 2.5 Hz`.
#[must_use]
pub fn at(key: &str, value: &str, reference: impl FnOnce() -> &'static str) -> String {
    format!("{} = {value} {}", name(key, reference), unit(key)).trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_symbol_belongs_to_a_key_of_a_case() {
        let tables = || {
            crate::setup::TABLES
                .iter()
                .chain(crate::structure::TABLES)
                .chain(crate::simulation::TABLES)
                .chain(crate::motion_record::TABLES)
        };
        for (key, _) in SYMBOLS {
            let (path, name) = key.rsplit_once('.').unwrap();
            let mut keys = tables().filter(|t| t.path == path).flat_map(|t| t.quantities).flat_map(|q| q.keys);
            assert!(keys.any(|known| known.name == name), "{key}");
        }
    }

    #[test]
    fn a_key_has_its_symbol_and_unit_or_its_own_name() {
        assert_eq!(label("particle.clearance_ratio", || "x0"), "d/x0");
        assert_eq!(label("many_particles.clearance_m", || "Z"), "d (m)");
        assert_eq!(at("base.frequency_hz", "2.5", || "Z"), "f = 2.5 Hz");
        assert_eq!(at("particle.wall.law", "linear", || "Z"), "law = linear");
        assert_eq!(label("particle.wall.law", || "Z"), "particle.wall.law");
    }
}
