//! `manifest.json`: everything about a run that is not a table. Older runs of format 1 lack keys; these have defaults.

use std::sync::Arc;

use arrow_schema::Field;
use serde::{Deserialize, Serialize};

use super::acting_settings::ActingSetting;
use super::clock_fit::ClockFit;
use super::device::{Device, or_default};
use super::journal_entry::{Losses, SegmentStart};
use super::journal_state::JournalState;
use super::results;
use super::samples::SampleColumn;
use super::segment_id::SegmentId;
use crate::campaign::{Campaign, CampaignSetUp, Plan};
use crate::client::controller::Controller;
use crate::host_time;
use crate::run_folder::checksum::{self, FileRecord};
use crate::setup::{Identified, SetUpFile};

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum RunEnding {
    /// It has not ended; when no program is recording any more, it was killed.
    Running,
    /// Every point was taken.
    Complete,
    /// It ended early.
    Incomplete {
        /// Why.
        #[serde(default)]
        reason: String,
    },
}

/// A segment as the manifest summarises it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SegmentRecord {
    #[serde(flatten)]
    id: SegmentId,
    first_point_index: usize,
    started: String,
    /// Whether the device reached its end; otherwise the run was interrupted in it.
    finished: bool,
    /// Device time against host time; none under a granted clock, where the host advances the device's time.
    clock: Option<ClockFit>,
}

/// A set-up in SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetUpRecord {
    /// Its name in the tables.
    pub name: String,
    /// Its name for people.
    #[serde(default)]
    pub label: String,
    /// Base amplitude as set, m.
    #[serde(default)]
    pub base_amplitude_m: f64,
    #[serde(default, deserialize_with = "or_default")]
    clearance_ratio: Option<f64>,
    #[serde(default, deserialize_with = "or_default")]
    friction_ratio: Option<f64>,
    #[serde(default, deserialize_with = "or_default")]
    natural_frequency_hz: f64,
    /// y − x at the start, m; NaN where it is not known.
    #[serde(default, deserialize_with = "or_nan")]
    particle_start_m: f64,
    /// Largest |x| predicted, m; NaN in older runs.
    #[serde(default = "nan")]
    pub predicted_max_x_m: f64,
    /// Largest |x| predicted for the dwells of its stepped sines, m; NaN without one and in older runs.
    #[serde(default = "nan", deserialize_with = "or_nan")]
    pub predicted_dwell_max_x_m: f64,
    #[serde(default, deserialize_with = "or_default")]
    model: Option<damprig_core::model::SetUp>,
    /// It has a damper without a model; `model` is that of the bare structure.
    #[serde(default, deserialize_with = "or_default", skip_serializing_if = "std::ops::Not::not")]
    pub has_unmodelled_damper: bool,
}

fn nan() -> f64 {
    f64::NAN
}

/// JSON writes NaN as null.
fn or_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl SetUpRecord {
    /// Of a campaign's set-up and its predictions: with the settling time, and in the dwells.
    #[must_use]
    pub fn new(set_up: &CampaignSetUp, predicted_max_x_m: f64, predicted_dwell_max_x_m: f64) -> Self {
        Self {
            name: set_up.name.clone(),
            label: set_up.label.clone(),
            base_amplitude_m: set_up.base_amplitude_m,
            clearance_ratio: set_up.clearance_ratio(),
            friction_ratio: set_up.friction_ratio(),
            natural_frequency_hz: set_up.natural_frequency_hz(),
            particle_start_m: if set_up.spec.is_start_unknown() { f64::NAN } else { set_up.particle_start_m() },
            predicted_max_x_m,
            predicted_dwell_max_x_m,
            model: Some(set_up.model()),
            has_unmodelled_damper: set_up.has_unmodelled_damper,
        }
    }

    /// What its damper is, in words; `None` for a bare structure, and in older runs.
    #[must_use]
    pub fn damper(&self) -> Option<&'static str> {
        let friction = self.model?.friction_damper.map(|_| "a friction damper");
        self.damper_besides_friction().or(friction)
    }

    /// As [`SetUpRecord::damper`], `None` for a friction damper alone.
    #[must_use]
    pub fn damper_besides_friction(&self) -> Option<&'static str> {
        let model = self.model?;
        let particle = model.particle.map(|_| "an impact damper");
        let tmd = model.tmd.map(|_| "a tuned mass damper");
        particle.or(tmd).or(self.has_unmodelled_damper.then_some("a damper without a model"))
    }

    /// d/Z as stated; none in lengths.
    #[must_use]
    pub fn clearance_ratio(&self) -> Option<f64> {
        self.clearance_ratio
    }

    /// Ratio of the friction force to that of the excitation as stated; none in newtons.
    #[must_use]
    pub fn friction_ratio(&self) -> Option<f64> {
        self.friction_ratio
    }

    /// P, N, if a force drives the structure over a fixed base: `base_amplitude_m` is P/k then.
    #[must_use]
    pub fn force_amplitude_n(&self) -> Option<f64> {
        let model = self.model.filter(|model| model.is_force_driven)?;
        Some(model.structure.stiffness_n_per_m * self.base_amplitude_m)
    }

    /// The set-up in SI units; none in older runs.
    #[must_use]
    pub fn model(&self) -> Option<damprig_core::model::SetUp> {
        self.model
    }
}

/// A set-up file that completed a campaign's set-ups.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetUpFileRecord {
    /// Its path as the campaign names it.
    pub file: String,
    /// SHA-256 of its text.
    pub sha256: String,
    /// Where its values come from. A set-up that states a key itself does not use the value of the file.
    #[serde(default)]
    pub identified: Vec<Identified>,
}

impl SetUpFileRecord {
    fn new(file: &SetUpFile) -> Self {
        Self {
            file: file.file.clone(),
            sha256: checksum::of_bytes(file.text.as_bytes()),
            identified: file.identified.clone(),
        }
    }
}

/// Unit and meaning of a results column.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct ColumnRecord {
    name: String,
    unit: String,
    about: String,
}

/// Durations of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Durations {
    /// Time on the rig, s.
    pub rig_s: f64,
    /// Wall time, s.
    pub wall_s: f64,
}

/// The file's name in a run folder.
pub const MANIFEST: &str = "manifest.json";

/// Version of the run folder's format: raised when a reader of the earlier one would misread the new one.
pub const FORMAT: u32 = 1;

/// The first runs carry no version.
fn first_format() -> u32 {
    1
}

/// The manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the folder's format, [`FORMAT`].
    #[serde(default = "first_format")]
    pub format: u32,
    /// Name of the campaign.
    pub campaign: String,
    /// What a person stated about the campaign, and its order; left out when nothing was stated.
    #[serde(default, skip_serializing_if = "Plan::is_empty", deserialize_with = "or_default")]
    pub plan: Plan,
    /// How the run ended.
    #[serde(flatten)]
    pub ending: RunEnding,
    /// Whether a program is recording into the folder now; none when unknown. Found when a folder is opened.
    #[serde(skip)]
    pub is_recording: Option<bool>,
    /// Start, local time in the form of RFC 3339; in older runs with the zone in brackets behind it.
    pub started: String,
    /// Name and version of the program that recorded it.
    pub damprig: String,
    /// Operating system and architecture of the host.
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
    /// Samples of each signal per second, as asked for.
    pub telemetry_rate_hz: f64,
    /// Signals recorded.
    pub signals: Vec<SampleColumn>,
    /// What was lost.
    #[serde(default)]
    pub counters: Losses,
    /// The controller's counters, as far as the journal has them; absent when it was never asked.
    #[serde(default)]
    pub controller: Option<Controller>,
    /// Durations.
    #[serde(default)]
    pub clock: Durations,
    /// Times that the run was resumed.
    #[serde(default)]
    pub resumed: usize,
    /// Each start of the device.
    #[serde(default, deserialize_with = "or_default")]
    pub segments: Vec<SegmentRecord>,
    /// The limits and spring properties that acted, each with its origin.
    #[serde(default)]
    pub acting_settings: Vec<ActingSetting>,
    /// The set-ups in SI units.
    pub set_ups: Vec<SetUpRecord>,
    /// The set-up file that completed the set-ups, and where its values come from; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set_up_file: Option<SetUpFileRecord>,
    /// The other files when the run ended; empty before, and in a run that was killed.
    #[serde(default)]
    pub files: Vec<FileRecord>,
    #[serde(default, deserialize_with = "or_default")]
    results_columns: Vec<ColumnRecord>,
    /// SHA-256 of this file with 64 zeros in this place; empty in older runs.
    #[serde(default)]
    manifest_sha256: String,
}

/// In place of the manifest's own SHA-256 while that is computed.
const NO_SUM: &str = "0000000000000000000000000000000000000000000000000000000000000000";

impl Manifest {
    /// At the start of a run.
    #[must_use]
    pub fn begin(campaign: &Campaign, set_ups: Vec<SetUpRecord>, started: &str) -> Self {
        Self {
            format: FORMAT,
            campaign: campaign.name.clone(),
            plan: campaign.plan.clone(),
            ending: RunEnding::Running,
            is_recording: None,
            started: started.to_string(),
            damprig: crate::VERSION_LINE.to_string(),
            host: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            device: None,
            points_planned: campaign.points(),
            points_taken: 0,
            sample_rows: 0,
            telemetry_rate_hz: campaign.telemetry.rate_hz,
            signals: Vec::new(),
            counters: Losses::default(),
            controller: None,
            clock: Durations::default(),
            resumed: 0,
            segments: Vec::new(),
            acting_settings: Vec::new(),
            set_ups,
            set_up_file: campaign.set_up_file.as_ref().map(SetUpFileRecord::new),
            files: Vec::new(),
            results_columns: results_columns(),
            manifest_sha256: String::new(),
        }
    }

    /// The text of the file, with its own checksum.
    ///
    /// # Errors
    /// When it cannot be written as JSON: a defect of this function.
    pub fn to_text(&self) -> Result<String, serde_json::Error> {
        let unsigned = Self { manifest_sha256: NO_SUM.into(), ..self.clone() };
        let text = serde_json::to_string_pretty(&unsigned)? + "\n";
        let sum = checksum::of_bytes(text.as_bytes());
        Ok(text.replace(&own_sum(NO_SUM), &own_sum(&sum)))
    }

    /// Whether `text`, from which this manifest was read, is as it was written; none without a checksum (an older run).
    #[must_use]
    pub fn is_intact(&self, text: &str) -> Option<bool> {
        if self.manifest_sha256.is_empty() {
            // An older manifest does not end with a checksum: one under another name is damaged.
            let end = text.trim_end_matches(|c: char| !c.is_ascii_hexdigit());
            let is_sum = |end: &str| end.bytes().all(|b| b.is_ascii_hexdigit());
            let has_sum = end.len().checked_sub(NO_SUM.len()).and_then(|from| end.get(from..)).is_some_and(is_sum);
            return has_sum.then_some(false);
        }
        let unsigned = text.replace(&own_sum(&self.manifest_sha256), &own_sum(NO_SUM));
        Some(checksum::of_bytes(unsigned.as_bytes()) == self.manifest_sha256)
    }

    /// Takes over the totals of the journal of a run of this campaign.
    pub fn note(&mut self, campaign: &Campaign, journal: &JournalState, rows: u64) {
        self.points_planned = journal.planned(campaign).points;
        self.points_taken = journal.points();
        self.sample_rows = rows;
        self.controller = journal.controller();
        self.resumed = journal.begun.len().saturating_sub(1);
        let record = |start: &SegmentStart| {
            let finished = journal.end_of(&start.id);
            SegmentRecord {
                id: start.id.clone(),
                first_point_index: start.first_index,
                started: start.at.clone(),
                finished: finished.is_some(),
                clock: finished.and_then(|f| f.clock),
            }
        };
        self.segments = journal.segments.iter().map(record).collect();
    }

    /// Whether every point was taken and the program ended in an orderly way.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.ending == RunEnding::Complete
    }

    /// Whether its rig was simulated.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        self.device.as_ref().is_some_and(|device| device.simulated)
    }

    /// Whether the run has not ended in an orderly way: it goes on, or was killed.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.ending == RunEnding::Running
    }

    /// How it ended, in words.
    #[must_use]
    pub fn ending_text(&self) -> String {
        match (&self.ending, self.is_recording) {
            (RunEnding::Running, Some(true)) => "still running".into(),
            (RunEnding::Running, Some(false)) => {
                "killed while it was running, or ended by a disk that could not be written".into()
            }
            (RunEnding::Running, None) => "still running, or killed".into(),
            (RunEnding::Complete, _) => "complete".into(),
            (RunEnding::Incomplete { reason }, _) if reason.is_empty() => "incomplete".into(),
            (RunEnding::Incomplete { reason }, _) => format!("incomplete: {reason}"),
        }
    }

    /// The status as the file has it: `running`, `complete` or `incomplete`.
    #[must_use]
    pub fn status(&self) -> &'static str {
        match self.ending {
            RunEnding::Running => "running",
            RunEnding::Complete => "complete",
            RunEnding::Incomplete { .. } => "incomplete",
        }
    }

    /// Ticks between two rows, when the device and the rate are known.
    #[must_use]
    pub fn every_ticks(&self) -> Option<u64> {
        let every = (self.device.as_ref()?.tick_hz / self.telemetry_rate_hz).round();
        (every.is_finite() && every >= 1.0).then_some(every as u64)
    }

    /// The start as an instant; none when the text is not a time.
    #[must_use]
    pub fn started_at(&self) -> Option<jiff::Timestamp> {
        host_time::parse(&self.started).map(|time| time.timestamp())
    }
}

/// The line of the manifest's own checksum. It cannot occur within a text of the manifest, where quotes are escaped.
fn own_sum(sum: &str) -> String {
    format!("\"manifest_sha256\": \"{sum}\"")
}

/// The columns of the results, by the table itself.
fn results_columns() -> Vec<ColumnRecord> {
    let Ok(table) = results::table(&[]) else { return Vec::new() };
    let text = |field: &Field, key| field.metadata().get(key).cloned().unwrap_or_default();
    let record = |field: &Arc<Field>| ColumnRecord {
        name: field.name().clone(),
        unit: text(field, "unit"),
        about: text(field, "description"),
    };
    table.schema().fields().iter().map(record).collect()
}
