//! Names of a study's axes as the field writes them: d/Z, e, μi.

use crate::study::Study;
use crate::study::axis::Axis;

/// Symbols of keys. A clearance ratio refers to what the case's reference is.
const SYMBOLS: [(&str, &str); 18] = [
    ("structure.mass_kg", "M"),
    ("structure.natural_frequency_hz", "fn"),
    ("structure.damping_ratio", "ζ"),
    ("base.frequency_hz", "f"),
    ("force.frequency_hz", "f"),
    ("base.angular_frequency_rad_per_s", "Ω"),
    ("force.angular_frequency_rad_per_s", "Ω"),
    ("base.frequency_ratio", "Ω/ωn"),
    ("force.frequency_ratio", "Ω/ωn"),
    ("base.amplitude_m", "Z"),
    ("force.amplitude_n", "P"),
    ("particle.mass_kg", "m"),
    ("particle.mass_ratio", "m/M"),
    ("particle.clearance_m", "d"),
    ("particle.friction_coefficient", "μi"),
    ("particle.wall.coefficient", "e"),
    ("friction_damper.force_n", "F"),
    ("friction_damper.friction_ratio", "γF"),
];

/// The symbol of an axis, if its key has one.
fn symbol(study: &Study, axis: &Axis) -> Option<String> {
    if axis.key == "particle.clearance_ratio" {
        let first = study.points.values(&study.axes, 0, 0);
        let reference = study.case_with(&first).ok().and_then(|case| case.reference_m());
        return Some(format!("d/{}", reference.map_or("Z", |(_, symbol)| symbol)));
    }
    SYMBOLS.iter().find(|(key, _)| *key == axis.key).map(|(_, symbol)| (*symbol).to_string())
}

/// Quantity and unit of an axis: `d/Z`, `f (Hz)`; the key where it has no symbol.
#[must_use]
pub fn label(study: &Study, axis: &Axis) -> String {
    let name = symbol(study, axis).unwrap_or_else(|| axis.key.clone());
    if axis.unit().is_empty() { name } else { format!("{name} ({})", axis.unit()) }
}

/// Name of an axis before a value: `d/Z`, `f`; the key without its tables where it has no symbol.
#[must_use]
pub fn name(study: &Study, axis: &Axis) -> String {
    symbol(study, axis).unwrap_or_else(|| axis.short_key().to_string())
}
