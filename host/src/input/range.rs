//! How large a number of a case may be, by the unit that its key carries.
//!
//! The bounds are far beyond any rig. They are there so that what follows from the values stays finite, and a slip in an
//! exponent is answered in place of being computed.

/// What a unit may measure, in magnitude; zero and the sign are the business of who reads the key.
struct Range {
    /// How the key ends.
    suffix: &'static str,
    /// The least magnitude that is not zero.
    least: f64,
    /// The largest magnitude.
    most: f64,
    unit: &'static str,
}

const fn range(suffix: &'static str, least: f64, most: f64, unit: &'static str) -> Range {
    Range { suffix, least, most, unit }
}

/// Longer endings stand before those that end them.
const RANGES: [Range; 16] = [
    range("_n_s_per_m", 0.0, 1e18, " N·s/m"),
    range("_n_per_m", 1e-12, 1e18, " N/m"),
    range("_rad_per_s", 1e-9, 1e9, " rad/s"),
    range("_m_per_s2", 0.0, 1e6, " m/s²"),
    range("_m_per_s", 0.0, 1e6, " m/s"),
    range("phase_rad", 0.0, 1e6, " rad"),
    range("_pa", 1e-6, 1e18, " Pa"),
    range("_kg", 1e-12, 1e12, " kg"),
    range("_hz", 1e-9, 1e9, " Hz"),
    range("_m", 0.0, 1e6, " m"),
    range("_n", 0.0, 1e12, " N"),
    range("_s", 1e-12, 1e12, " s"),
    range("coefficient", 0.0, 100.0, ""),
    range("loss_factor", 0.0, 1e6, ""),
    range("damping_ratio", 0.0, 1e6, ""),
    range("_ratio", 1e-9, 1e6, ""),
];

/// Why `value` cannot be that of `key`: the allowed range in words; nothing when it can, or when the key says no unit.
pub(super) fn excess(key: &str, value: f64) -> Option<String> {
    let range = RANGES.iter().find(|range| key.ends_with(range.suffix))?;
    let magnitude = value.abs();
    if magnitude == 0.0 || (range.least..=range.most).contains(&magnitude) {
        return None;
    }
    let Range { least, most, unit, .. } = range;
    Some(if magnitude > *most {
        format!("must be at most {most:e}{unit} in magnitude")
    } else {
        format!("must be 0 or at least {least:e}{unit} in magnitude")
    })
}
