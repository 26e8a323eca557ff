//! `manifest.json`: everything about a run that is not a table.

use std::ops::AddAssign;

use damprig_core::settings::Settings;
use serde::{Deserialize, Deserializer, Serialize};

use super::Signal;
use super::acting::ActingSetting;
use super::checksum::FileRecord;
use super::clock::ClockFit;
use super::controller::Controller;
use super::row::COLUMNS;
use super::taken::Taken;
use crate::campaign::{Campaign, CampaignSetUp};

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Ending {
    /// Not yet. Found in a folder whose run is over: it was killed.
    Running,
    /// Every point was taken.
    Complete,
    /// It ended before.
    Incomplete {
        /// Why.
        reason: String,
    },
}

/// What the device said about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// The link it was reached by, as given to `--rig`.
    pub link: String,
    /// Board name.
    pub board: String,
    /// Firmware version.
    pub firmware: String,
    /// Protocol version.
    pub protocol_version: u16,
    /// Hash of the protocol's message schema, in hexadecimal.
    pub protocol_schema: String,
    /// Whether the plant is simulated.
    pub simulated: bool,
    /// What moves: `real`, `simulated in f32` or `simulated in f64`.
    pub plant: String,
    /// Whose clock counts the ticks: the board's (`real time`), or the host's (`granted`).
    pub clock: String,
    /// Ticks in a second.
    pub tick_hz: f64,
    /// Revision of the firmware's source and how it was built; empty where they are not known.
    #[serde(default)]
    pub build: String,
    /// What counts the board's ticks: `crystal`, or `internal oscillator` when the crystal did not start; `host` under a
    /// granted clock.
    #[serde(default)]
    pub clock_source: String,
    /// What ended an earlier run of the firmware since its supply came on.
    #[serde(default)]
    pub last_crash: Option<String>,
    /// Its settings when the run began: the base of [`Manifest::acting_settings`].
    #[serde(default, deserialize_with = "of_this_layout")]
    pub settings: Option<BoardSettings>,
}

/// Settings of another layout, which an older run may have, are passed over.
fn of_this_layout<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<BoardSettings>, D::Error> {
    let settings = serde_json::Value::deserialize(deserializer)?;
    Ok(serde_json::from_value(settings).ok())
}

/// Settings of a board, and where they came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoardSettings {
    /// In words.
    pub source: String,
    /// The settings.
    #[serde(flatten)]
    pub settings: Settings,
}

/// What got lost on the way; zeros unless something is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Counters {
    /// Rows of samples that the device had no room for.
    pub dropped_records: u64,
    /// Telemetry messages missing by their sequence numbers.
    pub missing_records: u64,
    /// Rows of samples that this program dropped because the disk was too slow.
    pub dropped_rows_host: u64,
    /// Rows of samples missing by their ticks, whoever lost them; each gap is in the column `gap_before_ticks`.
    pub lost_rows: u64,
    /// Frames that the host refused: checksum, length, or content.
    pub bad_frames_host: u64,
    /// Frames that the device refused.
    pub bad_frames_device: u64,
    /// Times that the link was lost, or the device began anew, in mid-run.
    pub interruptions: u64,
}

impl AddAssign for Counters {
    fn add_assign(&mut self, more: Self) {
        self.dropped_records += more.dropped_records;
        self.missing_records += more.missing_records;
        self.dropped_rows_host += more.dropped_rows_host;
        self.lost_rows += more.lost_rows;
        self.bad_frames_host += more.bad_frames_host;
        self.bad_frames_device += more.bad_frames_device;
        self.interruptions += more.interruptions;
    }
}

/// A start of the device, and device time against host time in it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentRecord {
    set_up: String,
    experiment: String,
    segment: u32,
    first_point_index: usize,
    started: String,
    /// Whether the device came to its end; otherwise the run was interrupted in it.
    finished: bool,
    /// None under a granted clock: device time then passes only as the host lets it, whatever the time here.
    clock: Option<ClockFit>,
}

/// A set-up in SI units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetUpRecord {
    name: String,
    label: String,
    base_amplitude_m: f64,
    clearance_ratio: Option<f64>,
    friction_ratio: Option<f64>,
    natural_frequency_hz: f64,
    particle_start_m: f64,
    predicted_max_x_m: f64,
    model: damprig_core::model::SetUp,
}

impl SetUpRecord {
    /// Of a campaign's set-up and its prediction.
    #[must_use]
    pub fn new(set_up: &CampaignSetUp, predicted_max_x_m: f64) -> Self {
        Self {
            name: set_up.name.clone(),
            label: set_up.label.clone(),
            base_amplitude_m: set_up.base_amplitude_m,
            clearance_ratio: set_up.clearance_ratio(),
            friction_ratio: set_up.friction_ratio(),
            natural_frequency_hz: set_up.natural_frequency_hz(),
            particle_start_m: set_up.particle_start_m(),
            predicted_max_x_m,
            model: set_up.model(),
        }
    }
}

/// Unit and meaning of a results column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct ColumnRecord {
    name: &'static str,
    unit: &'static str,
    about: &'static str,
}

/// How long it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Clock {
    /// Time that passed on the rig, s.
    pub rig_s: f64,
    /// Time that passed for the person waiting, s.
    pub wall_s: f64,
}

/// Version of the run folder's format: raised when a reader of the earlier one would misread the new one.
pub const FORMAT: u32 = 1;

/// The manifest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Manifest {
    /// Version of the folder's format, [`FORMAT`].
    pub format: u32,
    /// Name of the campaign.
    pub campaign: String,
    /// How the run ended.
    #[serde(flatten)]
    pub ending: Ending,
    /// Start, local time with its zone.
    pub started: String,
    /// Version of this program.
    pub damprig: String,
    /// Operating system and architecture of the host.
    pub host: String,
    /// The device; absent when it never answered.
    pub device: Option<Device>,
    /// Points planned.
    pub points_planned: usize,
    /// Points taken.
    pub points_taken: usize,
    /// Rows in the samples file.
    pub sample_rows: u64,
    /// Samples of each signal in a second, as asked for.
    pub telemetry_rate_hz: f64,
    /// Signals recorded.
    pub signals: Vec<Signal>,
    /// What got lost.
    pub counters: Counters,
    /// How the controller kept up, as far as the journal tells; absent when it was never asked.
    pub controller: Option<Controller>,
    /// Durations.
    pub clock: Clock,
    /// Times that the run was taken up again.
    pub resumed: usize,
    /// Each start of the device.
    pub segments: Vec<SegmentRecord>,
    /// The limits and spring properties that acted, each with its origin.
    pub acting_settings: Vec<ActingSetting>,
    /// The set-ups in SI units.
    pub set_ups: Vec<SetUpRecord>,
    /// The other files of the folder when the run ended; empty before.
    pub files: Vec<FileRecord>,
    results_columns: Vec<ColumnRecord>,
}

impl Manifest {
    /// At the start of a run.
    #[must_use]
    pub fn begin(campaign: &Campaign, set_ups: Vec<SetUpRecord>, started: &str) -> Self {
        let columns = COLUMNS.iter().map(|c| ColumnRecord { name: c.name, unit: c.unit, about: c.about });
        Self {
            format: FORMAT,
            campaign: campaign.name.clone(),
            ending: Ending::Running,
            started: started.to_string(),
            damprig: crate::VERSION_LINE.to_string(),
            host: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            device: None,
            points_planned: campaign.points(),
            points_taken: 0,
            sample_rows: 0,
            telemetry_rate_hz: campaign.telemetry.rate_hz,
            signals: Vec::new(),
            counters: Counters::default(),
            controller: None,
            clock: Clock::default(),
            resumed: 0,
            segments: Vec::new(),
            acting_settings: Vec::new(),
            set_ups,
            files: Vec::new(),
            results_columns: columns.collect(),
        }
    }
    /// Takes over what the journal adds up to.
    pub fn note(&mut self, taken: &Taken, rows: u64) {
        self.points_taken = taken.points();
        self.sample_rows = rows;
        self.controller = taken.controller();
        self.resumed = taken.begun.len().saturating_sub(1);
        let segment = |s: &super::journal::Segment| {
            let finished = taken
                .finished
                .iter()
                .find(|f| f.set_up == s.set_up && f.experiment == s.experiment && f.segment == s.segment);
            SegmentRecord {
                set_up: s.set_up.clone(),
                experiment: s.experiment.clone(),
                segment: s.segment,
                first_point_index: s.first_index,
                started: s.at.clone(),
                finished: finished.is_some(),
                clock: finished.and_then(|f| f.clock),
            }
        };
        self.segments = taken.segments.iter().map(segment).collect();
    }
}
