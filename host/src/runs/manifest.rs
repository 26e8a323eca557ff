//! `manifest.json` as it is read back: also of older runs, which lack keys, and of runs that were killed.
//!
//! What is written there, and why, is [`crate::recording::manifest`]'s.

use serde::Deserialize;

use crate::recording::acting::ActingSetting;
use crate::recording::checksum::FileRecord;
use crate::recording::controller::Controller;

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Signal {
    /// Name of its column.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

/// What the device said about itself.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Device {
    /// The link it was reached by.
    pub link: String,
    /// Board name.
    pub board: String,
    /// Firmware version.
    pub firmware: String,
    /// Hash of the protocol's message schema, hexadecimal.
    #[serde(default)]
    pub protocol_schema: String,
    /// Ticks in a second, Hz.
    pub tick_hz: f64,
}

/// What got lost on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub struct Counters {
    /// Records that the device had no room for.
    pub dropped_records: u64,
    /// Telemetry messages missing by their sequence numbers.
    pub missing_records: u64,
    /// Rows that the host dropped because its disk was too slow.
    pub dropped_rows_host: u64,
    /// Rows missing by their ticks.
    pub lost_rows: u64,
    /// Frames that the host refused.
    pub bad_frames_host: u64,
    /// Frames that the device refused.
    pub bad_frames_device: u64,
    /// Times that the link was lost or the device began anew.
    pub interruptions: u64,
}

/// Durations, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Clock {
    /// On the rig, s.
    pub rig_s: f64,
    /// For the person waiting, s.
    pub wall_s: f64,
}

/// A set-up.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct SetUp {
    /// Its name in the tables.
    pub name: String,
    /// Its name for people.
    #[serde(default)]
    pub label: String,
    /// Base amplitude as set, m.
    #[serde(default)]
    pub base_amplitude_m: f64,
    /// Largest |x| that was foreseen, m; NaN in older runs.
    #[serde(default = "unknown")]
    pub predicted_max_x_m: f64,
}

fn unknown() -> f64 {
    f64::NAN
}

/// The manifest, as far as reading a run needs it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Manifest {
    /// Version of the folder's format; the first runs carry none.
    #[serde(default = "first_format")]
    pub format: u32,
    /// Name of the campaign.
    pub campaign: String,
    /// `running`, `complete` or `incomplete`.
    pub status: String,
    /// Why it is incomplete.
    pub reason: Option<String>,
    /// Whether a program is recording into the folder now; not known of runs without a journal.
    #[serde(skip)]
    pub is_recording: Option<bool>,
    /// Start, with its time zone.
    pub started: String,
    /// Program that recorded it.
    pub damprig: String,
    /// Operating system and architecture of the host; empty in older runs.
    #[serde(default)]
    pub host: String,
    /// The device; absent when it never answered.
    pub device: Option<Device>,
    /// Points planned.
    pub points_planned: usize,
    /// Points taken.
    pub points_taken: usize,
    /// Rows of samples.
    pub sample_rows: u64,
    /// Samples of each signal in a second, Hz.
    pub telemetry_rate_hz: f64,
    /// Signals recorded.
    pub signals: Vec<Signal>,
    /// What got lost.
    #[serde(default)]
    pub counters: Counters,
    /// How the controller kept up; absent in older runs, and when it was never asked.
    #[serde(default)]
    pub controller: Option<Controller>,
    /// Times that the run was taken up again.
    #[serde(default)]
    pub resumed: usize,
    /// Durations.
    #[serde(default)]
    pub clock: Clock,
    /// The limits and spring properties that acted; empty in older runs.
    #[serde(default)]
    pub acting_settings: Vec<ActingSetting>,
    /// The set-ups.
    pub set_ups: Vec<SetUp>,
    /// The other files when the run ended; empty for a run that was killed, or is older than checksums.
    #[serde(default)]
    pub files: Vec<FileRecord>,
}

fn first_format() -> u32 {
    1
}

impl Manifest {
    /// Ticks between two rows, when the device and the rate are known.
    #[must_use]
    pub fn every_ticks(&self) -> Option<u64> {
        let every = (self.device.as_ref()?.tick_hz / self.telemetry_rate_hz).round();
        (every.is_finite() && every >= 1.0).then_some(every as u64)
    }

    /// The start as an instant; none when the text is no time.
    #[must_use]
    pub fn started_at(&self) -> Option<jiff::Timestamp> {
        // A zone that this machine does not know does not hide the offset.
        let zoned = self.started.parse::<jiff::Zoned>().map(|time| time.timestamp());
        zoned.ok().or_else(|| self.started.split('[').next()?.parse().ok())
    }

    /// How it ended, in words.
    #[must_use]
    pub fn ending(&self) -> String {
        match (self.status.as_str(), &self.reason) {
            ("running", _) => match self.is_recording {
                Some(true) => "still running".into(),
                Some(false) => "killed while it was running".into(),
                None => "still running, or killed".into(),
            },
            ("incomplete", Some(reason)) => format!("incomplete: {reason}"),
            (other, _) => other.to_string(),
        }
    }
}
