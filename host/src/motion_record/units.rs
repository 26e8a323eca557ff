//! Units of recorded motions, and their numbers as text.

use super::record::Quantity;

/// Standard gravity by definition, m/s²: the unit "g" of a record.
pub(super) const STANDARD_GRAVITY: f64 = 9.806_65;

/// Units: name, quantity, and SI units per unit.
pub(super) const UNITS: [(&str, Quantity, f64); 7] = [
    ("m/s2", Quantity::Acceleration, 1.0),
    ("g", Quantity::Acceleration, STANDARD_GRAVITY),
    ("cm/s2", Quantity::Acceleration, 0.01),
    ("mm/s2", Quantity::Acceleration, 0.001),
    ("m", Quantity::Displacement, 1.0),
    ("cm", Quantity::Displacement, 0.01),
    ("mm", Quantity::Displacement, 0.001),
];

/// The units of a quantity for a message: `"m" or "cm" …`.
pub(super) fn unit_list(quantity: Quantity) -> String {
    let of = UNITS.iter().filter(|(_, of, _)| *of == quantity);
    of.map(|(name, ..)| format!("{name:?}")).collect::<Vec<_>>().join(" or ")
}

/// A finite number.
pub(super) fn finite(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|v| v.is_finite())
}
