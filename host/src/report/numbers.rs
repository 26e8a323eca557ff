//! Formats numbers for people.

/// `value` with at most `decimals` decimals, without trailing zeros.
#[must_use]
pub fn trimmed(value: f64, decimals: usize) -> String {
    without_trailing_zeros(&format!("{value:.decimals$}")).to_string()
}

/// `value` with at most `digits` significant digits, without trailing zeros.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..=9).contains(&magnitude) {
        let text = format!("{value:.*e}", digits.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", without_trailing_zeros(mantissa));
    }
    trimmed(value, usize::try_from(digits as i32 - 1 - magnitude).unwrap_or(0))
}

/// A duration in a suitable unit.
#[must_use]
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", significant(s, 2)),
        s if s < 7_200.0 => format!("{} min", significant(s / 60.0, 2)),
        s if s < 172_800.0 => format!("{} h", significant(s / 3_600.0, 2)),
        s if s < 6.3e7 => format!("{} days", significant(s / 86_400.0, 2)),
        s => format!("{} years", significant(s / 3.15e7, 2)),
    }
}

/// An estimated duration: `about 3 min`. Beyond a thousand years only that is said.
#[must_use]
pub fn about(seconds: f64) -> String {
    if seconds < 3.15e10 { format!("about {}", duration(seconds)) } else { "more than 1000 years".into() }
}

/// A length in millimetres with six significant digits.
#[must_use]
pub fn millimetres(metres: f64) -> String {
    format!("{} mm", significant(metres * 1e3, 6))
}

/// A phase of −π to π in degrees, −270 to 90: that of x to z does not jump as it passes −180.
#[must_use]
pub fn phase_in_degrees(radians: f32) -> f32 {
    let degrees = radians.to_degrees();
    if degrees > 90.0 { degrees - 360.0 } else { degrees }
}

/// A value with its uncertainty to two significant digits: `12.34 ± 0.56`.
#[must_use]
pub fn with_uncertainty(value: f64, uncertainty: f64) -> String {
    if !value.is_finite() || !uncertainty.is_finite() || uncertainty <= 0.0 {
        return significant(value, 6);
    }
    let decimals = (1 - uncertainty.log10().floor() as i32).max(0);
    let is_readable = decimals <= 7 && value.abs() < 1e9;
    if !is_readable {
        return format!("{} ± {}", significant(value, 6), significant(uncertainty, 2));
    }
    let decimals = usize::try_from(decimals).unwrap_or(0);
    format!("{value:.decimals$} ± {uncertainty:.decimals$}")
}

/// A normalised error; large ones without decimals.
#[must_use]
pub fn normalised_error(value: f64) -> String {
    // Adding 0 removes the sign of a rounded zero.
    let rounded = (value * 100.0).round() / 100.0 + 0.0;
    if rounded.abs() < 10.0 { format!("{rounded:.2}") } else { format!("{value:.0}") }
}

fn without_trailing_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}
