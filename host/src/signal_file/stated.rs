//! What a user states of a signal where its file does not: the unit, and the sensitivity of the sensor behind a voltage.

use std::str::FromStr;

use super::Signal;
use super::unit::{Kind, Unit};

/// Volts of a sensor per unit of what it measures: `100 mV/g`, `10.2 mV/(m/s2)`, `2.5 V/mm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// What the sensor measures.
    pub kind: Kind,
    /// V per SI unit of it; greater than 0.
    pub volts_per_si: f64,
}

impl FromStr for Sensitivity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "write it as \"100 mV/g\", \"10.2 mV/(m/s2)\" or \"2.5 V/mm\"";
        let (value, units) =
            text.trim().split_once(' ').ok_or_else(|| format!("{text:?} is no sensitivity: {form}"))?;
        let value = value.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
        let value = value.ok_or_else(|| format!("{text:?} is not allowed: a sensitivity is greater than 0; {form}"))?;
        let (electric, measured) =
            units.split_once('/').ok_or_else(|| format!("{text:?} has no unit \"V/…\": {form}"))?;
        let volts = Unit::of(electric).filter(|unit| unit.kind == Kind::Voltage);
        let volts = volts.ok_or_else(|| format!("{electric:?} in {text:?} is no voltage: {form}"))?;
        let measured_unit =
            Unit::of(measured).filter(|unit| !matches!(unit.kind, Kind::Voltage | Kind::Time | Kind::Frequency));
        let measured_unit =
            measured_unit.ok_or_else(|| format!("{measured:?} in {text:?} is no known unit: {form}"))?;
        Ok(Self { kind: measured_unit.kind, volts_per_si: value * volts.si / measured_unit.si })
    }
}

/// What is stated of a signal beside its file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stated {
    /// Unit of the values, if the file does not state it.
    pub unit: Option<Unit>,
    /// Sensitivity of the sensor, if the values are its voltage.
    pub sensitivity: Option<Sensitivity>,
}

/// Why what a signal measures is not known, or what is stated contradicts the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unsettled {
    /// Neither the file nor the user states the unit.
    UnitMissing,
    /// A voltage without a sensitivity.
    SensitivityMissing,
    /// What is stated contradicts the file, and how.
    Contradiction(String),
}

impl Signal {
    /// Quantity of the values and SI units per unit of them, from the file and from what is stated beside it.
    ///
    /// # Errors
    /// What is missing, or contradicts the file.
    pub fn measured(&self, stated: &Stated) -> Result<Unit, Unsettled> {
        let unit = match (self.unit, stated.unit) {
            (Some(of_file), Some(given)) if of_file != given => {
                return Err(Unsettled::Contradiction(format!(
                    "the file states the unit {:?} of {:?}, which is another: leave out the unit",
                    self.unit_text, self.name
                )));
            }
            (Some(unit), _) | (None, Some(unit)) => unit,
            (None, None) => return Err(Unsettled::UnitMissing),
        };
        match (unit.kind, stated.sensitivity) {
            (Kind::Voltage, None) => Err(Unsettled::SensitivityMissing),
            (Kind::Voltage, Some(sensor)) => Ok(Unit { kind: sensor.kind, si: unit.si / sensor.volts_per_si }),
            (_, None) => Ok(unit),
            (_, Some(_)) => Err(Unsettled::Contradiction(format!(
                "{:?} is a {}, not the voltage of a sensor: leave out the sensitivity",
                self.name,
                unit.kind.text()
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal_file::unit::STANDARD_GRAVITY;

    fn of(text: &str) -> Result<Sensitivity, String> {
        text.parse()
    }

    #[test]
    fn a_sensitivity_is_volts_per_si_unit() {
        let close = |text: &str, kind, volts_per_si: f64| {
            let read = of(text).unwrap();
            assert_eq!(read.kind, kind, "{text}");
            assert!((read.volts_per_si / volts_per_si - 1.0).abs() < 1e-12, "{text}: {read:?}");
        };
        close("100 mV/g", Kind::Acceleration, 0.1 / STANDARD_GRAVITY);
        close("10.2 mV/(m/s²)", Kind::Acceleration, 0.0102);
        close("10.2 mV/m/s2", Kind::Acceleration, 0.0102);
        close("2.5 V/mm", Kind::Displacement, 2500.0);
        close("22 mV/N", Kind::Force, 0.022);
    }

    #[test]
    fn what_is_no_sensitivity_is_refused_with_a_form_that_is_one() {
        for (text, said) in [
            ("0 mV/g", "greater than 0"),
            ("-100 mV/g", "greater than 0"),
            ("NaN mV/g", "greater than 0"),
            ("100", "is no sensitivity"),
            ("100 mV", "has no unit"),
            ("100 g/mV", "is no voltage"),
            ("100 mV/s", "no known unit"),
            ("100 mV/parsec", "no known unit"),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains(said) && error.contains("100 mV/g"), "{text}: {error}");
        }
    }
}
