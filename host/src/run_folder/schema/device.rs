//! The device as the manifest and the journal describe it.

use damprig_core::settings::Settings;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

/// Description of the device. Keys that older runs lack have defaults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// The link it was reached by, as given to `--rig`.
    pub link: String,
    /// Board name.
    pub board: String,
    /// Firmware version.
    pub firmware: String,
    /// Protocol version.
    #[serde(default)]
    pub protocol_version: u16,
    /// Hash of the protocol's message schema, in hexadecimal.
    #[serde(default)]
    pub protocol_schema: String,
    /// Whether the plant is simulated.
    #[serde(default)]
    pub simulated: bool,
    /// What moves: `real`, `simulated in f32` or `simulated in f64`.
    #[serde(default)]
    pub plant: String,
    /// What advances the ticks: the board's own clock (`real time`), or the host (`granted`).
    #[serde(default)]
    pub clock: String,
    /// Ticks per second.
    pub tick_hz: f64,
    /// Revision of the firmware's source and build profile; empty where they are unknown.
    #[serde(default)]
    pub build: String,
    /// Source of the board's clock: `crystal`, or `internal oscillator` when the crystal did not start; `host` under a
    /// granted clock.
    #[serde(default)]
    pub clock_source: String,
    /// Cause of the last crash of the firmware since power-on.
    #[serde(default)]
    pub last_crash: Option<String>,
    /// Wrong option bytes, a wrong supply, and missing or expired calibrations of the board, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The board's settings when the run began: the base of the acting settings.
    #[serde(default, deserialize_with = "or_default")]
    pub settings: Option<BoardSettings>,
}

/// Settings of a board and their source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoardSettings {
    /// Where they come from, in words.
    pub source: String,
    /// The settings.
    #[serde(flatten)]
    pub settings: Settings,
}

/// A value that an older run may have in another layout: then its default.
pub(super) fn or_default<'de, D: Deserializer<'de>, T: Default + DeserializeOwned>(from: D) -> Result<T, D::Error> {
    let value = serde_json::Value::deserialize(from)?;
    Ok(serde_json::from_value(value).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a run recorded it before there were dates of calibrations.
    #[test]
    fn settings_without_dates_of_calibrations_are_read() {
        let board = BoardSettings { source: "stored".into(), settings: Settings::default() };
        let mut value = serde_json::to_value(&board).unwrap();
        assert!(value.as_object_mut().unwrap().remove("calibrated").is_some());
        assert_eq!(serde_json::from_value::<BoardSettings>(value).unwrap(), board);
    }
}
