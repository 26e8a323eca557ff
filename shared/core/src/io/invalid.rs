//! The error for a parameter out of range (name, value, allowed range) and the checks that return it.

/// A parameter out of range: its name, its value, and what is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    /// The parameter's name with its unit, spelled as in files (`structure.mass_kg`).
    pub parameter: &'static str,
    /// The value found.
    pub value: f64,
    /// The allowed range in words ("greater than 0").
    pub allowed: &'static str,
}

impl core::fmt::Display for Invalid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} = {} is not allowed: must be {}", self.parameter, self.value, self.allowed)
    }
}

impl core::error::Error for Invalid {}

/// Rejects `value` under the parameter's name unless `ok`.
pub fn require(ok: bool, parameter: &'static str, value: f64, allowed: &'static str) -> Result<(), Invalid> {
    if ok { Ok(()) } else { Err(Invalid { parameter, value, allowed }) }
}

/// Rejects every value except a finite number above zero.
pub fn positive(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite() && value > 0.0, parameter, value, "a finite number greater than 0")
}

/// Rejects every value except a finite number of zero or more.
pub fn not_negative(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite() && value >= 0.0, parameter, value, "a finite number, 0 or greater")
}

/// Rejects NaN and infinities.
pub fn finite(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite(), parameter, value, "a finite number")
}
