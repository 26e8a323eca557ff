//! A parameter outside its range: which one, its value, and what is allowed; and the checks that return it.

/// A parameter that cannot be: which one, its value, and what is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    /// The parameter's name with its unit, as files spell it (`structure.mass_kg`).
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

/// Refuses `value` unless `ok`, with the parameter's name.
pub fn require(ok: bool, parameter: &'static str, value: f64, allowed: &'static str) -> Result<(), Invalid> {
    if ok { Ok(()) } else { Err(Invalid { parameter, value, allowed }) }
}

/// Refuses anything but a finite number above zero.
pub fn positive(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite() && value > 0.0, parameter, value, "a finite number greater than 0")
}

/// Refuses anything but a finite number from zero up.
pub fn not_negative(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite() && value >= 0.0, parameter, value, "a finite number, 0 or greater")
}

/// Refuses NaN and infinities.
pub fn finite(parameter: &'static str, value: f64) -> Result<(), Invalid> {
    require(value.is_finite(), parameter, value, "a finite number")
}
