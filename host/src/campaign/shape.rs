//! Shapes of base pulses. Each pulse becomes a record that is uploaded to the device.

use std::f64::consts::{PI, TAU};

/// The shapes of a pulse of height Z and length T.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseShape {
    /// z = Z sin(πt/T): its corners at zero are rounded over one sample by the record.
    HalfSine,
    /// z = Z/2 (1 − cos 2πt/T), the versed sine of the source document; also called haversine.
    Versine,
    /// Z with a rise and a fall of this length (s) at its ends, each half a cosine; T includes both.
    Rectangle {
        /// Length of rise and fall, s; greater than 0, at most T/2.
        ramp_s: f64,
    },
}

impl PulseShape {
    /// Names in a campaign.
    pub const WORDS: [&'static str; 4] = ["half_sine", "versine", "haversine", "rectangle"];

    /// Displacement at `t_s` after the beginning of a pulse of height 1 and length `duration_s`; 0 outside it.
    #[must_use]
    pub fn at(self, t_s: f64, duration_s: f64) -> f64 {
        if !(0.0..=duration_s).contains(&t_s) {
            return 0.0;
        }
        match self {
            Self::HalfSine => (PI * t_s / duration_s).sin(),
            Self::Versine => 0.5 * (1.0 - (TAU * t_s / duration_s).cos()),
            Self::Rectangle { ramp_s } => {
                let from_end_s = t_s.min(duration_s - t_s);
                if from_end_s >= ramp_s { 1.0 } else { 0.5 * (1.0 - (PI * from_end_s / ramp_s).cos()) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_begins_and_ends_at_zero_and_reaches_its_height() {
        for shape in [PulseShape::HalfSine, PulseShape::Versine, PulseShape::Rectangle { ramp_s: 0.05 }] {
            assert!(shape.at(0.0, 0.4).abs() < 1e-15 && shape.at(0.4, 0.4).abs() < 1e-15, "{shape:?}");
            assert!((shape.at(0.2, 0.4) - 1.0).abs() < 1e-15, "{shape:?}");
            assert_eq!((shape.at(-1e-9, 0.4), shape.at(0.401, 0.4)), (0.0, 0.0));
        }
        assert!((PulseShape::Rectangle { ramp_s: 0.05 }.at(0.025, 0.4) - 0.5).abs() < 1e-15);
        assert!((PulseShape::HalfSine.at(0.1, 0.4) - 0.5f64.sqrt()).abs() < 1e-15);
        assert!((PulseShape::Versine.at(0.1, 0.4) - 0.5).abs() < 1e-15);
    }
}
