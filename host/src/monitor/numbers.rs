//! The controller's numbers as they are shown: those that are known, by name, and the alarms that follow from them.

use std::collections::BTreeMap;

use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::SpringStage;
use damprig_core::control::outcome::ExperimentStage;
use damprig_core::control::safety::SafeStage;
use damprig_core::io::{Sensor, SensorSet};
use damprig_core::rig::signals::SIGNALS;
use serde::Serialize;

use super::words;
use crate::run_folder::schema::samples::column_name;

/// A telemetry signal: a column of [`super::message::Rows`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SignalName {
    /// Its name on the device.
    pub name: String,
    /// Its unit; empty without one.
    pub unit: String,
}

impl SignalName {
    /// Of a signal of this version's devices; without a unit for another name.
    #[must_use]
    pub fn of(name: &str) -> Self {
        let unit = SIGNALS.iter().find(|(known, _)| *known == name).map_or("", |(_, unit)| unit);
        Self { name: name.into(), unit: unit.into() }
    }

    /// Its name with its unit: `x_amplitude_m`.
    #[must_use]
    pub fn key(&self) -> String {
        column_name(&self.name, &self.unit)
    }
}

/// Signals of a cycle of the drive.
const OF_A_CYCLE: [&str; 6] =
    ["x_over_z_lock_in", "x_amplitude", "x_phase", "z_amplitude", "z_phase", "impacts_in_cycle"];

/// What the controller computes in real time, as in its last report. What needs a drive, or a sensor that is lost, is unknown without.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Numbers {
    /// The device's tick.
    pub tick: Option<u32>,
    /// The known values by their keys: those of the device's signals ([`SignalName::key`]), and the monitor's own:
    /// * `x_mean_m` and `z_mean_m`, the means over the last second while nothing is driven, which a sensor is aligned with;
    /// * `max_abs_x_m`, the largest |x| of the last five seconds;
    /// * `x_over_z_spread`, the largest less the smallest X/Z of the last five cycles over their median, which
    ///   `x_over_z_lock_in` is here.
    #[serde(flatten)]
    pub values: BTreeMap<String, f32>,
    /// Whether impacts are missing.
    pub twin_alarm: bool,
    /// Stage of the friction damper's spring, in words.
    pub spring_stage: Option<&'static str>,
    /// Stage of the interlocks, in words.
    pub safety: Option<&'static str>,
    /// Stage of the present point, in words.
    pub stage: Option<&'static str>,
}

impl Numbers {
    /// A value, if it is known.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<f32> {
        self.values.get(key).copied()
    }

    /// Adds a value, if it is known.
    pub fn add(&mut self, key: impl Into<String>, value: Option<f32>) {
        self.values.extend(value.map(|value| (key.into(), value)));
    }

    /// Removes values.
    pub fn forget(&mut self, keys: &[&str]) {
        self.values.retain(|key, _| !keys.contains(&key.as_str()));
    }

    /// From the values of a device's signals, in the order of its table. Without a drive x and z are their means, by `mean` over the last
    /// second, unless an experiment is at work.
    pub(super) fn of(
        table: &[SignalName],
        values: &[f32],
        is_at_work: bool,
        mean: impl Fn(&str) -> Option<f32>,
    ) -> Self {
        let value = |name: &str| {
            let at = table.iter().position(|known| known.name == name)?;
            values.get(at).copied().filter(|value| value.is_finite())
        };
        // Without a drive, and in the first cycle, the controller's amplitudes are 0: nothing is measured.
        let is_driven = value("frequency").is_some_and(|hz| hz > 0.0) && value("z_amplitude") != Some(0.0);
        let index = |name: &str| value(name).map(|index| index as usize);
        let mut numbers = Self {
            twin_alarm: value("twin_alarm") == Some(1.0),
            spring_stage: index("spring_stage").and_then(|i| SpringStage::ALL.get(i)).map(|stage| stage.text()),
            safety: index("safety").and_then(|i| SafeStage::ALL.get(i)).map(|stage| stage.text()),
            stage: index("stage").and_then(|i| ExperimentStage::ALL.get(i.wrapping_sub(1))).map(|stage| stage.text()),
            ..Self::default()
        };
        for signal in table {
            let own = value(&signal.name);
            match signal.name.as_str() {
                "twin_alarm" | "spring_stage" | "safety" | "stage" => {}
                "x" | "z" if is_driven || is_at_work => {}
                name @ ("x" | "z") => numbers.add(format!("{name}_mean_m"), mean(name).or(own)),
                name if OF_A_CYCLE.contains(&name) => numbers.add(signal.key(), own.filter(|_| is_driven)),
                // Exactly 0 without a twin.
                "twin_residual" => numbers.add(signal.key(), own.filter(|residual| *residual > 0.0)),
                _ => numbers.add(signal.key(), own),
            }
        }
        numbers
    }

    /// Removes those of sensors without a signal.
    pub(super) fn forget_sensors(&mut self, lost: SensorSet) {
        for sensor in Sensor::ALL.into_iter().filter(|sensor| lost.contains(*sensor)) {
            self.forget(of_sensor(sensor));
        }
    }

    /// Alarms that follow from them and from the sensors without a signal.
    pub(super) fn alarms(&self, lost: SensorSet) -> Vec<String> {
        let count = |key: &str| self.get(key).unwrap_or(0.0) as u64;
        let lost = Sensor::ALL.into_iter().filter(|sensor| lost.contains(*sensor));
        let mut alarms: Vec<String> =
            lost.map(|sensor| words::sentence(FaultCause::SensorAtRail(sensor).text())).collect();
        if self.twin_alarm {
            alarms.push(format!(
                "Impacts are missing: the twin predicted {}, {} were measured, {} are missing. Check the walls' force sensors.",
                count("twin_predicted"),
                count("twin_detected"),
                count("twin_missing")
            ));
        }
        alarms
    }
}

/// The numbers that need a sensor.
fn of_sensor(sensor: Sensor) -> &'static [&'static str] {
    match sensor {
        Sensor::X => &[
            "x_amplitude_m",
            "max_abs_x_m",
            "x_mean_m",
            "x_over_z_lock_in",
            "x_over_z_spread",
            "x_peak_m",
            "x_phase_rad",
            "x_velocity_m_per_s",
        ],
        Sensor::Z => &[
            "base_amplitude_m",
            "x_over_z_lock_in",
            "x_over_z_spread",
            "x_phase_rad",
            "z_amplitude_m",
            "z_mean_m",
            "z_phase_rad",
        ],
        Sensor::SpringForce => &["spring_force_n"],
        Sensor::WallLow => &["wall_low_n"],
        Sensor::WallHigh => &["wall_high_n"],
    }
}
