//! What a frequency response is of, by its unit.

use damprig_identification::modal::quantity::{MotionKind, Quantity};

use crate::signal_file::unit::{Ratio, UnitKind};

/// Units that a frequency response may have, for messages.
const UNITS: &str = "m/N, m/s/N, m/s2/N, g/N, N/m, N/(m/s), N/(m/s2), or m/m, g/g for a transmissibility x/z, also with mm, um, kN and others";

fn motion_of(kind: UnitKind) -> Option<MotionKind> {
    match kind {
        UnitKind::Displacement => Some(MotionKind::Displacement),
        UnitKind::Velocity => Some(MotionKind::Velocity),
        UnitKind::Acceleration => Some(MotionKind::Acceleration),
        _ => None,
    }
}

/// Of a unit's text.
///
/// # Errors
/// No ratio of known units; a ratio that is no frequency response of a structure.
pub fn quantity_of(text: &str) -> Result<Quantity, String> {
    let Some(Ratio { of, per }) = Ratio::of(text) else {
        return Err(format!("the unit {text:?} is not that of a frequency response: allowed are {UNITS}"));
    };
    let si = of.si / per.si;
    match (motion_of(of.kind), motion_of(per.kind)) {
        (Some(motion), None) if per.kind == UnitKind::Force => Ok(Quantity::of_force(motion, false, si)),
        (None, Some(motion)) if of.kind == UnitKind::Force => Ok(Quantity::of_force(motion, true, si)),
        (Some(motion), Some(base)) if motion == base => Ok(Quantity::of_base(motion, si)),
        _ => Err(format!(
            "the unit {text:?} is {} per {}: a frequency response of a structure is a motion per force, force per motion, or a \
             motion per motion of the same kind: allowed are {UNITS}",
            of.kind.text(),
            per.kind.text()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_say_what_a_response_is_of() {
        for (text, name, si) in [
            ("m/N", "receptance", 1.0),
            ("mm/kN", "receptance", 1e-6),
            ("m/s/N", "mobility", 1.0),
            ("m/s²/N", "accelerance", 1.0),
            ("(m/s^2)/N", "accelerance", 1.0),
            ("g/N", "accelerance", 9.80665),
            ("m_per_s2_per_n", "accelerance", 1.0),
            ("N/m", "dynamic stiffness", 1.0),
            ("N/(m/s)", "impedance", 1.0),
            ("N/m/s2", "apparent mass", 1.0),
            ("N/g", "apparent mass", 1.0 / 9.80665),
            ("g/g", "transmissibility", 1.0),
            ("m/s^2/m/s^2", "transmissibility", 1.0),
            ("mm/m", "transmissibility", 1e-3),
        ] {
            let quantity = quantity_of(text).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(quantity.name(), name, "{text}");
            assert!((quantity.si / si - 1.0).abs() < 1e-12, "{text}: {}", quantity.si);
        }
        for (text, part) in [
            ("", "is not that of a frequency response"),
            ("m/s2", "is not that"),
            ("V/V", "is voltage per voltage"),
            ("g/m", "is acceleration per displacement"),
            ("N/N", "is force per force"),
            ("furlong/N", "allowed are m/N"),
        ] {
            let error = quantity_of(text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
