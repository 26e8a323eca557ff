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

/// A length in millimetres with six significant digits.
#[must_use]
pub fn millimetres(metres: f64) -> String {
    format!("{} mm", significant(metres * 1e3, 6))
}

fn without_trailing_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}
