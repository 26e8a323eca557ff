//! The channels that can be calibrated: names, units, columns and default references.

use std::fmt;
use std::str::FromStr;

use damprig_core::model::GRAVITY_M_PER_S2;
use damprig_core::settings::{Period, Settings};

use crate::identify::table::{METRES, TableQuantity};
use crate::input::near;

/// Units of force; of a weight also its mass.
const NEWTONS: &[(&str, f64)] = &[("n", 1.0), ("mn", 1e-3), ("kn", 1e3), ("kg", GRAVITY_M_PER_S2)];
/// Units of impulse.
const NEWTON_SECONDS: &[(&str, f64)] = &[("n_s", 1.0), ("mn_s", 1e-3)];
/// The unit of a converter.
const COUNTS: &[(&str, f64)] = &[("counts", 1.0)];

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Displacement sensor of the structure.
    X,
    /// Displacement sensor of the base.
    Z,
    /// Both displacement sensors on one target.
    Match,
    /// Force sensor of the friction damper's spring.
    Spring,
    /// Force sensors of the walls.
    Walls,
    /// The drive.
    Drive,
    /// Stiffness of the friction damper's spring.
    FrictionSpring,
}

impl Channel {
    /// All channels, in the order in which they are calibrated.
    pub const ALL: [Self; 7] =
        [Self::X, Self::Z, Self::Match, Self::Spring, Self::Walls, Self::Drive, Self::FrictionSpring];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Z => "z",
            Self::Match => "match",
            Self::Spring => "spring",
            Self::Walls => "walls",
            Self::Drive => "drive",
            Self::FrictionSpring => "friction-spring",
        }
    }

    /// What is calibrated, for people.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::X => "displacement sensor of x",
            Self::Z => "displacement sensor of z",
            Self::Match => "displacement sensors of x and z on one target",
            Self::Spring => "force sensor of the spring",
            Self::Walls => "force sensors of the walls",
            Self::Drive => "drive",
            Self::FrictionSpring => "stiffness of the friction damper's spring",
        }
    }

    /// The telemetry signal of the reading, where it is read at rest.
    #[must_use]
    pub fn signal(self) -> Option<&'static str> {
        match self {
            Self::X => Some("x"),
            Self::Z => Some("z"),
            Self::Spring => Some("spring_force"),
            _ => None,
        }
    }

    /// The column of the references.
    #[must_use]
    pub fn reference(self) -> TableQuantity {
        let (units, about, most) = match self {
            Self::X | Self::Z => (METRES, "position of the target", 0.5),
            Self::Match => (METRES, "position or amplitude by x", 0.5),
            Self::Spring => (NEWTONS, "force of the weights", 1e4),
            Self::Walls => (NEWTON_SECONDS, "impulse of the hammer", 100.0),
            Self::Drive => (METRES, "demanded displacement", 0.5),
            Self::FrictionSpring => (METRES, "deflection of the spring", 0.5),
        };
        TableQuantity { stem: "reference", units, about, most }
    }

    /// The column of the readings.
    #[must_use]
    pub fn reading(self) -> TableQuantity {
        let (units, about, most) = match self {
            Self::X | Self::Z => (METRES, "reading of the sensor", 0.5),
            Self::Match => (METRES, "position or amplitude by z", 0.5),
            Self::Spring | Self::FrictionSpring => (NEWTONS, "reading of the force sensor", 1e4),
            Self::Walls => (NEWTON_SECONDS, "impulse as measured", 100.0),
            Self::Drive => (METRES, "displacement of the base by z", 0.5),
        };
        TableQuantity { stem: "reading", units, about, most }
    }

    /// The column of readings in counts of the converter, where there may be one.
    #[must_use]
    pub fn counts(self) -> Option<TableQuantity> {
        let about = "reading of the converter";
        matches!(self, Self::X | Self::Z | Self::Spring).then_some(TableQuantity {
            stem: "reading",
            units: COUNTS,
            about,
            most: 65_520.0,
        })
    }

    /// Unit of references for people, and how many of it make the SI unit.
    #[must_use]
    pub fn shown_reference(self) -> (&'static str, f64) {
        match self {
            Self::X | Self::Z | Self::Match | Self::Drive | Self::FrictionSpring => ("mm", 1e3),
            Self::Spring => ("N", 1.0),
            Self::Walls => ("N·s", 1.0),
        }
    }

    /// Unit of readings for people, and how many of it make the SI unit.
    #[must_use]
    pub fn shown_reading(self) -> (&'static str, f64) {
        if self == Self::FrictionSpring { ("N", 1.0) } else { self.shown_reference() }
    }

    /// Usable span of the sensor in its SI unit under these settings, for channels with references at rest.
    #[must_use]
    pub fn usable(self, settings: &Settings) -> Option<[f64; 2]> {
        let span = match self {
            Self::X => settings.calibration.x.usable_m(),
            Self::Z => settings.calibration.z.usable_m(),
            Self::Spring => settings.calibration.usable_spring_n(),
            _ => return None,
        };
        Some([f64::from(span.low), f64::from(span.high)])
    }

    /// The references of a guided calibration at rest, SI: within four fifths of the usable span, weights up and down.
    #[must_use]
    pub fn default_references(self, settings: &Settings) -> Vec<f64> {
        let Some([low, high]) = self.usable(settings) else { return Vec::new() };
        match self {
            Self::Spring => {
                // Steps of a whole newton, if the sensor is not smaller.
                let step = 0.8 * high / 4.0;
                let step = if step >= 1.0 { step.round().min((high / 4.0).floor()) } else { step };
                [0.0, 1.0, 2.0, 4.0, 2.0, 1.0, 0.0].iter().map(|n| n * step).collect()
            }
            _ => {
                // Steps of a whole millimetre, if the sensor is not smaller.
                let step = 0.8 * high.min(-low) / 3.0;
                let step = if step >= 1e-3 { (step * 1e3).floor() / 1e3 } else { step };
                (-3..=3).map(|n| f64::from(n) * step).collect()
            }
        }
    }

    /// The channel's record in the settings: date and validity.
    #[must_use]
    pub fn period(self, settings: &Settings) -> Period {
        let periods = settings.calibrated.periods();
        periods.into_iter().find(|(name, _)| *name == self.name()).map_or(settings.calibrated.x.period(), |(_, p)| p)
    }

    /// A reference as typed: a number with a unit behind it or in the SI unit, converted to it.
    ///
    /// # Errors
    /// What is wrong, what is allowed, and what to type.
    pub fn parse(self, text: &str) -> Result<f64, String> {
        let text = text.trim();
        let units: &[(&str, f64)] = match self.shown_reference().0 {
            "mm" => &[("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6), ("cm", 1e-2), ("m", 1.0)],
            "N" => &[("kN", 1e3), ("mN", 1e-3), ("kg", GRAVITY_M_PER_S2), ("g", 1e-3 * GRAVITY_M_PER_S2), ("N", 1.0)],
            _ => &[("mN·s", 1e-3), ("mNs", 1e-3), ("N·s", 1.0), ("Ns", 1.0)],
        };
        let (number, factor) =
            units.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor))).unwrap_or((text, 1.0));
        let value = number.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let si = units.last().map_or("", |(unit, _)| unit);
        value.map(|value| value * factor).ok_or_else(|| {
            format!("{text:?} is no number: write a decimal point, and the unit behind it ({si} without one)")
        })
    }

    /// A value for people, with its sign and unit.
    #[must_use]
    pub fn shown(self, reference: f64) -> String {
        let (unit, factor) = self.shown_reference();
        let signed = matches!(self, Self::X | Self::Z);
        let value = reference * factor + 0.0;
        if signed { format!("{value:+.3} {unit}") } else { format!("{value:.4} {unit}") }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Channel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = Self::ALL.map(Self::name);
        Self::ALL.into_iter().find(|channel| channel.name() == text).ok_or_else(|| {
            let hint = near(text, names).first().map_or(String::new(), |name| format!("; is it {name}?"));
            format!("must be one of {}{hint}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_references_are_round_and_inside_the_usable_span() {
        let settings = Settings::default();
        let x = Channel::X.default_references(&settings);
        assert_eq!(x.iter().map(|x| (x * 1e3).round() as i32).collect::<Vec<_>>(), [-60, -40, -20, 0, 20, 40, 60]);
        assert_eq!(Channel::Spring.default_references(&settings), [0.0, 10.0, 20.0, 40.0, 20.0, 10.0, 0.0]);
        for channel in [Channel::X, Channel::Spring] {
            let [low, high] = channel.usable(&settings).unwrap();
            assert!(channel.default_references(&settings).iter().all(|at| low < *at && *at < high));
        }
    }

    #[test]
    fn a_reference_is_read_with_its_unit() {
        for (channel, text, value) in [
            (Channel::X, "20mm", 0.02),
            (Channel::X, " -20.5 mm", -0.0205),
            (Channel::Z, "0.02", 0.02),
            (Channel::Z, "0.02 m", 0.02),
            (Channel::Spring, "10N", 10.0),
            (Channel::Spring, "1kg", 9.81),
            (Channel::Spring, "500 g", 4.905),
            (Channel::Walls, "25 mN·s", 0.025),
        ] {
            assert!((channel.parse(text).unwrap() - value).abs() < 1e-12, "{text}");
        }
        for text in ["", "20,5mm", "twenty", "nan", "mm"] {
            assert!(Channel::X.parse(text).unwrap_err().contains("decimal point"), "{text}");
        }
    }

    #[test]
    fn every_channel_has_a_record_of_its_name() {
        let names = Settings::default().calibrated.periods().map(|(name, _)| name);
        assert_eq!(names, Channel::ALL.map(Channel::name));
        assert!("sprng".parse::<Channel>().unwrap_err().contains("is it spring?"));
    }
}
