//! The messages to the monitor's viewers: a page gets them as JSON, the terminal view as they are. [`super::action`] has those of the
//! viewers.
//!
//! Numbers are SI; one that is not known is `None` (`null` in JSON). Times are rig time in s.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use axum::extract::ws::Utf8Bytes;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::impacts::ImpactRecord;
use serde::Serialize;

use super::numbers::{Numbers, SignalName};
use super::spectrum::Spectrum;
use crate::runner::TimeLeft;

/// A message to a viewer.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Message<'a> {
    /// Everything that a new viewer needs.
    Snapshot(&'a Snapshot),
    /// What is new since the message before.
    Frame(&'a ViewerUpdate),
    /// The answer to an action of this viewer.
    Answer(&'a ActionAnswer),
}

/// What is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// A run of this process.
    Run,
    /// An idle rig.
    Rig,
    /// The folder of a run that another process records.
    Folder,
    /// The folder of a run that is over.
    Replay,
}

/// Description of what is watched.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WatchedSource {
    /// Its kind.
    pub kind: SourceKind,
    /// Name of the campaign, or the rig's address.
    pub name: String,
    /// The rig's address.
    pub rig: String,
    /// The rig's board.
    pub board: String,
    /// The run folder.
    pub folder: Option<String>,
}

/// What the points of an experiment are drawn as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CurveKind {
    /// X/Z over the drive frequency (Hz), of a stepped sine at a given base amplitude.
    Response,
    /// Z (m) over the drive frequency (Hz), of one that keeps the response.
    Sheet,
    /// Drive frequency (Hz) over the amplitude of x (m), of one that follows the resonance.
    Backbone,
}

/// The points of one experiment on one set-up as predicted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PredictedCurve {
    /// Name of the set-up.
    pub set_up: String,
    /// The set-up's parameters in words.
    pub about: String,
    /// Name of the experiment.
    pub experiment: String,
    /// What its points are drawn as.
    pub draws: CurveKind,
    /// Its points are joined in their order, as in a sweep; otherwise by their abscissa.
    pub is_in_order: bool,
    /// Abscissa and ordinate of each predicted point, in the order in which they are joined.
    pub predicted: Vec<(f64, f64)>,
}

/// A measured point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredPoint {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Its place in the experiment.
    pub index: u32,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z (cycle maxima): mean cycle maximum of |x| over the lock-in amplitude of z.
    pub x_over_z: Option<f64>,
    /// X/Z (lock-in): ratio of the two lock-in amplitudes.
    pub x_over_z_lock_in: Option<f64>,
    /// Mean cycle maximum of |x|, m.
    pub mean_cycle_max_m: Option<f64>,
    /// Lock-in amplitude of x, m.
    pub x_amplitude_m: Option<f64>,
    /// Lock-in amplitude of z, m.
    pub z_amplitude_m: Option<f64>,
    /// Phase of x relative to z, −π to π, rad.
    pub phase_rad: Option<f64>,
    /// `steady`, `stationary` or `not steady`.
    pub steadiness: String,
}

/// The result of a playback, an impulse or a free vibration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Transient {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// The result in words.
    pub text: String,
}

/// An impact of the particle on a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Impact {
    /// Its time, s.
    pub t_s: f64,
    /// +1 for the wall at +d, −1 for the wall at −d.
    pub side: i8,
    /// Highest force, N.
    pub peak_n: Option<f64>,
}

impl Impact {
    /// Of a measured impact; tick 0 is at `from_s`.
    #[must_use]
    pub fn of(impact: &ImpactRecord, from_s: f64) -> Self {
        let ticks = f64::from(impact.tick) + f64::from(impact.centre_ticks);
        Self {
            t_s: from_s + ticks / f64::from(TICK_HZ),
            side: impact.side,
            peak_n: impact.peak_n.is_finite().then_some(f64::from(impact.peak_n)),
        }
    }
}

/// How serious a line of the log is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Something happened.
    Info,
    /// Something may be wrong.
    Warning,
    /// A fault of the rig.
    Fault,
    /// A person did something.
    Action,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LogLine {
    /// Host time of day; in a replay the time of the run.
    pub at: String,
    /// How serious it is.
    pub level: Level,
    /// What happened, in words.
    pub text: String,
}

/// Rows of named columns over time; a gap is an entry of `None`s.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TimeRows {
    /// Ascending times, s.
    pub t_s: Vec<f64>,
    /// A column for each name.
    pub values: BTreeMap<String, Vec<Option<f32>>>,
}

impl TimeRows {
    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }
}

/// State of what is watched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Activity {
    /// An experiment runs.
    Running,
    /// The experiment is held at its present point.
    Held,
    /// The run is paused: the drive is off.
    Paused,
    /// The run waits for a person or prepares the next experiment.
    #[default]
    Waiting,
    /// The drive fades out.
    Stopping,
    /// The rig is idle.
    Idle,
    /// A fault is latched.
    Faulted,
    /// The link to the rig is lost.
    Lost,
    /// The run is over.
    Over,
    /// A run that is over is replayed.
    Replay,
}

/// Limits that are in force, and the particle's clearance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Limit of |x|, m.
    pub x_m: Option<f64>,
    /// Limit of |z|, m.
    pub z_m: Option<f64>,
    /// Limit of the force on a wall, N.
    pub wall_force_n: Option<f64>,
    /// Clearance of the present set-up, m.
    pub clearance_m: Option<f64>,
}

/// State and counters of the link.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkState {
    /// The rig's address.
    pub name: String,
    /// Its state in words.
    pub state: String,
    /// Rows of telemetry so far, as the monitor counts them.
    pub rows: u64,
    /// Rows lost on the way.
    pub lost_rows: u64,
    /// Rows that the recorder had no room for.
    pub dropped_rows: u64,
    /// Damaged frames.
    pub bad_frames: u64,
    /// Times that the link was lost.
    pub interruptions: u64,
    /// Viewers at present.
    pub viewers: usize,
    /// Parts of the display that were skipped because the display was too slow; nothing recorded is lost.
    pub skipped_frames: u64,
}

/// A fault in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FaultText {
    /// What happened.
    pub what: String,
    /// What to do.
    pub advice: String,
}

/// Position of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReplayState {
    /// Time shown, s.
    pub t_s: f64,
    /// Length of the run, s.
    pub end_s: f64,
    /// Rig seconds per second.
    pub speed: f64,
    /// Whether it stands.
    pub paused: bool,
}

/// What a run still takes, in wall time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Left {
    /// The shortest time, s.
    pub low_s: f64,
    /// The longest time, s.
    pub high_s: f64,
    /// The same in words.
    pub text: String,
}

impl From<TimeLeft> for Left {
    fn from(left: TimeLeft) -> Self {
        Self { low_s: left.low_s, high_s: left.high_s, text: left.to_string() }
    }
}

/// The present state.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct State {
    /// State of what is watched.
    pub activity: Activity,
    /// The same in one sentence.
    pub headline: String,
    /// Name of the present set-up.
    pub set_up: Option<String>,
    /// Name of the present experiment.
    pub experiment: Option<String>,
    /// Points measured.
    pub points_taken: usize,
    /// Points of the whole campaign.
    pub points_planned: usize,
    /// Rig time so far, s.
    pub rig_s: f64,
    /// Age of the newest sample when this was told, s: host time, in a replay the run's own; none before the first.
    pub age_s: Option<f64>,
    /// What the run still takes; it stands while the run waits for a person.
    pub left: Option<Left>,
    /// Rig seconds per second, as measured over the last seconds; none when the rig stands.
    pub speed: Option<f64>,
    /// Position of a replay.
    pub replay: Option<ReplayState>,
    /// What the controller computes.
    pub numbers: Numbers,
    /// Limits.
    pub limits: Limits,
    /// The link.
    pub link: LinkState,
    /// The fault, if one is latched or has ended the run.
    pub fault: Option<FaultText>,
    /// Alarms in words.
    pub alarms: Vec<String>,
    /// Injected faults of a simulated rig in words.
    pub injected: Vec<String>,
}

/// What is new in lists that only grow.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct News {
    /// Measured points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<MeasuredPoint>,
    /// Measured transients.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transients: Vec<Transient>,
    /// Impacts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impacts: Vec<Impact>,
    /// Poincaré points: x (m), velocity (m/s) and drive frequency (Hz) at each rising zero of the drive.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub section: Vec<(f32, f32, f32)>,
    /// Spectra of x.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub spectra: Vec<Spectrum>,
    /// Lines of the log.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub log: Vec<LogLine>,
    /// Telemetry.
    #[serde(skip_serializing_if = "TimeRows::is_empty")]
    pub rows: TimeRows,
    /// The controller's numbers over time.
    #[serde(skip_serializing_if = "TimeRows::is_empty")]
    pub slow: TimeRows,
}

/// Everything that a new viewer needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Snapshot {
    /// Name and version of the program.
    pub version: String,
    /// What is watched.
    pub source: WatchedSource,
    /// Actions are possible with the token.
    pub can_control: bool,
    /// Faults can be injected, with the token.
    pub can_inject: bool,
    /// A replay can be moved.
    pub is_replay: bool,
    /// Where a run can be stopped, in words.
    pub where_to_stop: String,
    /// Columns of `rows`.
    pub signals: Vec<SignalName>,
    /// Predicted responses.
    pub curves: Vec<PredictedCurve>,
    /// Everything so far, as far as it is kept.
    #[serde(flatten)]
    pub news: News,
    /// The present state.
    pub state: State,
}

/// What is new since the message before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewerUpdate {
    /// The time axis has jumped: rows, impacts and Poincaré points so far are out of date.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub restart: bool,
    /// What is new.
    #[serde(flatten)]
    pub news: News,
    /// The present state.
    pub state: State,
}

/// A frame as all viewers share it: it is written as JSON once.
#[derive(Debug)]
pub struct SharedFrame {
    frame: ViewerUpdate,
    json: OnceLock<Utf8Bytes>,
}

impl SharedFrame {
    /// Of a frame.
    #[must_use]
    pub fn new(frame: ViewerUpdate) -> Self {
        Self { frame, json: OnceLock::new() }
    }

    /// The frame.
    #[must_use]
    pub fn frame(&self) -> &ViewerUpdate {
        &self.frame
    }

    /// The message as JSON.
    #[must_use]
    pub fn json(&self) -> Utf8Bytes {
        self.json.get_or_init(|| json(&Message::Frame(&self.frame))).clone()
    }
}

/// A message as JSON.
#[must_use]
pub fn json(message: &Message) -> Utf8Bytes {
    // Cannot fail: every number is finite or none, and every key is text.
    serde_json::to_string(message).unwrap_or_default().into()
}

/// The answer to an action.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ActionAnswer {
    /// Number of the action, as the viewer gave it.
    pub id: u64,
    /// Whether it was done.
    pub ok: bool,
    /// What was done, or why not, in words.
    pub text: String,
}
