//! The lines of the journal: what happened in a run, as records.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use super::clock_fit::{ClockFit, ClockPair};
use super::device::Device;
use super::impacts::Impacts;
use super::json_float;
use super::peak_points::PeakPoints;
use super::results::ResultRow;
use super::samples::{LAST_PART, SampleColumn, damaged_part_name, part_name};
use super::segment_id::SegmentId;
use super::transients::TransientRow;
use crate::campaign::transient::RECORDS;
use crate::client::controller::Controller;
use crate::run_folder::checksum::FileRecord;

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "entry", rename_all = "snake_case")]
pub enum JournalEntry {
    /// The program begins, or resumes the run.
    Begin(Box<Begin>),
    /// The device has started (a part of) an experiment.
    Segment(SegmentStart),
    /// A point is measured.
    Result(Box<ResultRow>),
    /// The points around the peak of a measured grid.
    PeakPoints(Box<PeakPoints>),
    /// A record, a pulse or a free vibration is measured.
    Transient(Box<TransientRow>),
    /// Impacts of the particle on its walls.
    Impacts(Box<Impacts>),
    /// A part of the samples is closed.
    Sealed(Sealed),
    /// An open part that was damaged is kept aside.
    SetAside(SetAside),
    /// The device has finished a segment.
    Finished(Finished),
    /// Device time and host time of one tick in the present segment; about one a second.
    Clock(ClockPair),
    /// The link was lost or came back, or the device was reset.
    Link {
        /// What happened.
        what: String,
        /// Host time with its zone.
        at: String,
    },
    /// A person acted on the run: a pause, a hold, a fault injected into a simulated rig.
    Action {
        /// What was done.
        what: String,
        /// Host time with its zone.
        at: String,
    },
    /// A result does not count any more: a kill has cut off the end of its samples.
    Withdrawn(Withdrawn),
    /// The parts are joined into `samples.parquet`.
    Joined(Joined),
    /// The program has ended in an orderly way.
    Ended(Ended),
}

impl JournalEntry {
    /// Whether its parts fit together. What a journal states as a part of the samples is removed once the parts are joined, so
    /// it must have a part's name.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        match self {
            Self::Sealed(sealed) => sealed.part <= LAST_PART && *sealed.file.name == part_name(sealed.part),
            Self::SetAside(aside) => aside.part <= LAST_PART && *aside.file.name == damaged_part_name(aside.part),
            Self::PeakPoints(points) => points.is_consistent(),
            Self::Begin(begin) => begin.records.iter().all(|copy| copy.file.name.starts_with(RECORDS)),
            _ => true,
        }
    }
}

/// The program begins. Everything here but `at`, `damprig` and `run` must be the same when the run is resumed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// Host time with its zone.
    pub at: String,
    /// Name and version of the program.
    pub damprig: String,
    /// Name of the run folder when the run was first started; its tables keep it. Absent in older runs.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub run: String,
    /// The device.
    pub device: Device,
    /// Columns of the samples.
    pub signals: Vec<SampleColumn>,
    /// Ticks from row to row of the samples; 0 for none.
    pub every_ticks: u16,
    /// The campaign's text.
    pub campaign: String,
    /// Each line from this one on ends with its checksum; not in older runs.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sums: bool,
    /// The files that it names, as copied into the run folder; absent in older runs.
    #[serde(default)]
    pub records: Vec<CopiedFile>,
}

/// A copy of a file that the campaign names, or the noise that it plays.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CopiedFile {
    /// The copy.
    #[serde(flatten)]
    pub file: FileRecord,
    /// Number of the `[[experiment]]` that plays it, from 1; none of a set-up file, and in older runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<usize>,
}

/// A segment has started.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentStart {
    /// The segment.
    #[serde(flatten)]
    pub id: SegmentId,
    /// Place of the first point in the experiment's frequency list.
    pub first_index: usize,
    /// Points.
    pub points: usize,
    /// Results of earlier segments from the first point on are superseded: their motion could not be carried over.
    pub anew: bool,
    /// Host time with its zone.
    pub at: String,
}

/// A closed part of the samples: it is on the disk and does not change any more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sealed {
    /// Its number.
    pub part: u32,
    /// Its file.
    pub file: FileRecord,
    /// Rows in it.
    pub rows: u64,
    /// Rows missing before or between them, by their ticks.
    pub lost_rows: u64,
}

/// The program has found an open part that is not as its checksums say, and has kept its file under another name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetAside {
    /// Number of the part.
    pub part: u32,
    /// Its file.
    pub file: FileRecord,
    /// Bytes at its beginning that agree with their checksums: their rows are in the closed part of this number.
    pub sound_bytes: u64,
}

/// The device has finished a segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finished {
    /// The segment.
    #[serde(flatten)]
    pub id: SegmentId,
    /// Its last tick.
    pub end_tick: u32,
    /// Rows missing after the last that arrived, by their ticks.
    pub lost_rows: u64,
    /// Device time against host time; none under a granted clock.
    pub clock: Option<ClockFit>,
    /// The controller's counters since the program began.
    #[serde(default)]
    pub controller: Option<Controller>,
}

/// A result without the end of its samples; its point is measured again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Withdrawn {
    /// The segment that it was measured in.
    #[serde(flatten)]
    pub id: SegmentId,
    /// Place of its point in the experiment's frequency list.
    pub point_index: u32,
    /// Rows of its samples that are missing.
    pub lost_rows: u64,
}

/// The parts of the samples are one file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Joined {
    /// Rows of `samples.parquet`.
    pub rows: u64,
    /// That file; none in older runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileRecord>,
    /// Numbers of the damaged parts, which are left out; their files stay where they are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left: Vec<u32>,
}

/// The program has ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    /// Host time with its zone.
    pub at: String,
    /// Why it ended early; none when every point is taken.
    pub reason: Option<String>,
    /// What was lost since the program began.
    pub counters: Losses,
    /// The controller's counters since the program began; none when it was never asked.
    #[serde(default)]
    pub controller: Option<Controller>,
    /// Wall time since the program began, s.
    #[serde(with = "json_float")]
    pub wall_s: f64,
}

/// What was lost between device and disk; zeros unless something is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Losses {
    /// Rows of samples dropped by the device: its queue was full.
    pub dropped_records: u64,
    /// Telemetry messages missing by their sequence numbers.
    pub missing_records: u64,
    /// Rows of samples dropped by this program: the disk was too slow.
    pub dropped_rows_host: u64,
    /// Rows of samples missing by their ticks, whatever lost them; each gap is in the column `gap_before_ticks`.
    pub lost_rows: u64,
    /// Frames that the host rejected: checksum, length, or content.
    pub bad_frames_host: u64,
    /// Frames that the device rejected.
    pub bad_frames_device: u64,
    /// Messages of the device that did not fit what it was asked to do; they were dropped.
    pub misfit_messages: u64,
    /// Times that the link was lost or the device was reset during the run.
    pub interruptions: u64,
}

impl AddAssign for Losses {
    /// A damaged journal may state any number, so the sums stop at the largest.
    fn add_assign(&mut self, more: Self) {
        for (sum, more) in [
            (&mut self.dropped_records, more.dropped_records),
            (&mut self.missing_records, more.missing_records),
            (&mut self.dropped_rows_host, more.dropped_rows_host),
            (&mut self.lost_rows, more.lost_rows),
            (&mut self.bad_frames_host, more.bad_frames_host),
            (&mut self.bad_frames_device, more.bad_frames_device),
            (&mut self.misfit_messages, more.misfit_messages),
            (&mut self.interruptions, more.interruptions),
        ] {
            *sum = sum.saturating_add(more);
        }
    }
}
