//! Units of recorded motions, and their numbers as text.

use super::record::RecordQuantity;
use crate::input::key::KeyUnit;
use crate::signal_file::unit::Unit;

/// Units of records. A voltage needs the sensitivity of its sensor.
pub(crate) const UNITS: [&str; 9] = ["m/s2", "g", "cm/s2", "mm/s2", "m", "cm", "mm", "V", "mV"];

/// The units of a quantity for a message: `"m" or "cm" …`.
pub(super) fn unit_list(quantity: RecordQuantity) -> String {
    let of = UNITS.iter().filter(|name| Unit::of(name).is_some_and(|unit| unit.kind == quantity.kind()));
    of.map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" or ")
}

/// From the values of a file to SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ToSi {
    /// Quantity of the values.
    pub quantity: RecordQuantity,
    /// SI units per unit of the file.
    pub unit_si: f64,
    /// Factor on every value.
    pub scale: f64,
}

impl ToSi {
    /// A value in SI units; `text` is as the file has it.
    ///
    /// # Errors
    /// Why it is too large. The limits are those of the keys in these units: what is computed from a value within them is finite.
    pub(super) fn value(&self, text: &str, value: f64) -> Result<f64, String> {
        let si = value * (self.unit_si * self.scale);
        let suffix = match self.quantity {
            RecordQuantity::Acceleration => "_m_per_s2",
            RecordQuantity::Displacement => "_m",
        };
        let Some(limit) = KeyUnit::of(suffix).filter(|limit| si.is_nan() || si.abs() > limit.most) else {
            return Ok(si);
        };
        let unit = Unit { kind: self.quantity.kind(), si: self.unit_si };
        let unit = UNITS.iter().find(|name| Unit::of(name) == Some(unit)).map_or("", |name| *name);
        let scaled = if self.scale == 1.0 { String::new() } else { format!(" times scale = {}", self.scale) };
        Err(format!(
            "{text:?} {unit}{scaled} is not allowed: must be at most {:e} {} in magnitude; is the unit right?",
            limit.most, limit.symbol
        ))
    }
}
