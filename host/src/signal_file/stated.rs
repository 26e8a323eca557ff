//! What a user states of a signal where its file does not: the unit, the sensitivity of the sensor behind a voltage, or a calibrator's tone.

use std::ops::RangeInclusive;
use std::str::FromStr;

use super::unit::{Unit, UnitKind};
use super::{Selector, Signal, Tone};
use crate::failure::Failure;

/// Volts of a sensor per unit of what it measures: `100 mV/g`, `10.2 mV/(m/s2)`, `2.5 V/mm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorSensitivity {
    /// What the sensor measures.
    pub kind: UnitKind,
    /// V per SI unit of it; greater than 0.
    pub volts_per_si: f64,
}

impl FromStr for SensorSensitivity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "write it as \"100 mV/g\", \"10.2 mV/(m/s2)\" or \"2.5 V/mm\"";
        let (value, units) =
            text.trim().split_once(' ').ok_or_else(|| format!("{text:?} is no sensitivity: {form}"))?;
        let value = value.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
        let value = value.ok_or_else(|| format!("{text:?} is not allowed: a sensitivity is greater than 0; {form}"))?;
        let (electric, measured) =
            units.split_once('/').ok_or_else(|| format!("{text:?} has no unit \"V/…\": {form}"))?;
        let volts = Unit::of(electric).filter(|unit| unit.kind == UnitKind::Voltage);
        let volts = volts.ok_or_else(|| format!("{electric:?} in {text:?} is no voltage: {form}"))?;
        let measured_unit = Unit::of(measured)
            .filter(|unit| !matches!(unit.kind, UnitKind::Voltage | UnitKind::Time | UnitKind::Frequency));
        let measured_unit =
            measured_unit.ok_or_else(|| format!("{measured:?} in {text:?} is no known unit: {form}"))?;
        Ok(Self { kind: measured_unit.kind, volts_per_si: value * volts.si / measured_unit.si })
    }
}

/// What a calibrator's tone, recorded on the same channel, says of a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// What one unit of the recording is.
    pub unit: Unit,
    /// The unit of the recording, as its file writes it; empty for shares of full scale.
    pub unit_text: String,
    /// Frequency of the tone, Hz.
    pub frequency_hz: f64,
}

/// Frequencies of a vibration calibrator, Hz: 79.6 Hz and 159.2 Hz are usual.
const FREQUENCIES_HZ: RangeInclusive<f64> = 5.0..=10_000.0;

impl Calibration {
    /// Of the recording of a calibrator with this RMS, for example `10 m/s2`.
    ///
    /// # Errors
    /// A recording that cannot be read or is of no steady tone; an RMS without a known unit.
    pub fn of(recording: &Selector, rms: &str) -> Result<Self, Failure> {
        let parsed = rms.trim().split_once(' ').and_then(|(value, unit)| {
            let value = value.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0)?;
            Unit::of(unit).filter(|unit| unit.kind != UnitKind::Voltage).map(|unit| (value, unit))
        });
        let (value, unit) = parsed.ok_or_else(|| {
            Failure::Input(format!("{rms:?} is no RMS of a calibrator: write it with its unit, \"10 m/s2\" or \"1 g\""))
        })?;
        let refuse = |why: String| Failure::Input(format!("{}: {why}", recording.path.display()));
        let signal = recording.read()?;
        if signal.unit.is_some_and(|unit| unit.kind != UnitKind::Voltage) {
            return Err(refuse(format!(
                "its values have the unit {:?} already: it calibrates nothing",
                signal.unit_text
            )));
        }
        let even = signal.evenly().map_err(refuse)?;
        let tone = Tone::find(&even.values, 1.0 / even.step_s, &FREQUENCIES_HZ).map_err(refuse)?;
        let unit = Unit { kind: unit.kind, si: unit.si * value / tone.rms };
        Ok(Self { unit, unit_text: signal.unit_text, frequency_hz: tone.frequency_hz })
    }
}

/// What is stated of a signal beside its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedSignal {
    /// Unit of the values, if the file does not state it.
    pub unit: Option<Unit>,
    /// Sensitivity of the sensor, if the values are its voltage.
    pub sensitivity: Option<SensorSensitivity>,
    /// A calibrator's tone, in place of both.
    pub calibration: Option<Calibration>,
}

impl StatedSignal {
    /// Whether the values are those of a sensor whose sensitivity is not in the file.
    pub(crate) fn is_of_sensor(&self) -> bool {
        self.sensitivity.is_some()
            || self.calibration.is_some()
            || self.unit.is_some_and(|unit| unit.kind == UnitKind::Voltage)
    }
}

/// Why what a signal measures is not known, or what is stated contradicts the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnknownQuantity {
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
    pub fn measured(&self, stated: &StatedSignal) -> Result<Unit, UnknownQuantity> {
        if let Some(calibration) = &stated.calibration {
            return if self.unit_text == calibration.unit_text {
                Ok(calibration.unit)
            } else {
                Err(UnknownQuantity::Contradiction(format!(
                    "{:?} has the unit {:?}, the calibration {:?}: record both on the same channel",
                    self.name, self.unit_text, calibration.unit_text
                )))
            };
        }
        let unit = match (self.unit, stated.unit) {
            (Some(of_file), Some(given)) if of_file != given => {
                return Err(UnknownQuantity::Contradiction(format!(
                    "the file states the unit {:?} of {:?}, which is another: leave out the unit",
                    self.unit_text, self.name
                )));
            }
            (Some(unit), _) | (None, Some(unit)) => unit,
            (None, None) => return Err(UnknownQuantity::UnitMissing),
        };
        match (unit.kind, stated.sensitivity) {
            (UnitKind::Voltage, None) => Err(UnknownQuantity::SensitivityMissing),
            (UnitKind::Voltage, Some(sensor)) => Ok(Unit { kind: sensor.kind, si: unit.si / sensor.volts_per_si }),
            (_, None) => Ok(unit),
            (_, Some(_)) => Err(UnknownQuantity::Contradiction(format!(
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

    fn of(text: &str) -> Result<SensorSensitivity, String> {
        text.parse()
    }

    #[test]
    fn a_sensitivity_is_volts_per_si_unit() {
        let close = |text: &str, kind, volts_per_si: f64| {
            let read = of(text).unwrap();
            assert_eq!(read.kind, kind, "{text}");
            assert!((read.volts_per_si / volts_per_si - 1.0).abs() < 1e-12, "{text}: {read:?}");
        };
        close("100 mV/g", UnitKind::Acceleration, 0.1 / STANDARD_GRAVITY);
        close("10.2 mV/(m/s²)", UnitKind::Acceleration, 0.0102);
        close("10.2 mV/m/s2", UnitKind::Acceleration, 0.0102);
        close("2.5 V/mm", UnitKind::Displacement, 2500.0);
        close("22 mV/N", UnitKind::Force, 0.022);
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
