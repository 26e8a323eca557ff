//! `journal.jsonl`: what happened in a run, one JSON object a line, only ever appended to.
//!
//! It is what a run is taken up again from, and what `results.parquet` is made of. A line is there as a whole or, when
//! the program was killed in the middle of it, as the torn end of the file, which counts as nothing. What the lines
//! add up to is [`super::taken`]'s.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::checksum::FileRecord;
use super::clock::{ClockFit, Pair};
use super::controller::Controller;
use super::impacts::Impacts;
use super::manifest::{Counters, Device};
use super::transients::TransientRow;
use super::{ResultRow, Signal, StorageError};
use crate::input::regular;

/// The journal's name in a run folder.
pub const JOURNAL: &str = "journal.jsonl";

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "entry", rename_all = "snake_case")]
pub enum Entry {
    /// The program begins, or begins again.
    Begin(Box<Begin>),
    /// The device has started (a part of) an experiment.
    Segment(Segment),
    /// A point is measured.
    Result(Box<ResultRow>),
    /// A record, a pulse or a free vibration is measured.
    Transient(Box<TransientRow>),
    /// The particle hit its walls.
    Impacts(Box<Impacts>),
    /// A part of the samples is closed.
    Sealed(Sealed),
    /// The device has finished what it was started with.
    Finished(Finished),
    /// Device time and host time that belong together, of the segment before it; about one a second.
    Clock(Pair),
    /// The link to the device went or came back.
    Link {
        /// What happened.
        what: String,
        /// Host time with its zone.
        at: String,
    },
    /// The parts are in `samples.parquet`.
    Joined {
        /// Its rows.
        rows: u64,
        /// Parts that were damaged and are not in it; they stay where they are.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        left: Vec<u32>,
    },
    /// The program has ended in an orderly way.
    Ended(Ended),
}

/// The program begins: what must be the same when a run is taken up again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// Host time with its zone.
    pub at: String,
    /// Name and version of the program.
    pub damprig: String,
    /// The device.
    pub device: Device,
    /// Columns of the samples.
    pub signals: Vec<Signal>,
    /// Ticks from row to row of the samples; 0 for none.
    pub every_ticks: u16,
    /// The campaign's text.
    pub campaign: String,
}

/// The device was started.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segment {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// How many times this experiment was started on this set-up before.
    pub segment: u32,
    /// Place of the first point in the experiment's frequency list.
    pub first_index: usize,
    /// Points.
    pub points: usize,
    /// Results of earlier segments count no more: their motion could not be carried over.
    pub anew: bool,
    /// Host time with its zone.
    pub at: String,
}

/// A part that is closed: it is on the disk and changes no more.
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

/// The device has finished.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finished {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Which segment.
    pub segment: u32,
    /// Its last tick.
    pub end_tick: u32,
    /// Rows missing after the last that arrived, by their ticks.
    pub lost_rows: u64,
    /// Device time against host time; none under a granted clock.
    pub clock: Option<ClockFit>,
    /// How the controller kept up since the program began.
    #[serde(default)]
    pub controller: Option<Controller>,
}

/// The program has ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    /// Host time with its zone.
    pub at: String,
    /// Why before the last point; none when every point is taken.
    pub reason: Option<String>,
    /// What was lost since the program began.
    pub counters: Counters,
    /// How the controller kept up since the program began; none when it was never asked.
    #[serde(default)]
    pub controller: Option<Controller>,
    /// Wall time since the program began, s.
    pub wall_s: f64,
}

/// A journal that is being written; no other program writes it meanwhile.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Bytes up to the end of the last line.
    whole: u64,
    behind: Behind,
}

/// What may stand behind the last line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Behind {
    Nothing,
    /// A line that an earlier program began. It stays what it is: a line that is no entry.
    OfBefore,
    /// What the disk took of a line that could not be written whole.
    Own,
}

/// Who only looks at a journal holds it for a moment: so often it is tried again, with such a pause.
const TRIES: (u32, Duration) = (50, Duration::from_millis(10));

impl Journal {
    /// Opens or makes the journal of a run folder, to append to it. Nothing is written to one that there is before
    /// [`Journal::append`].
    ///
    /// # Errors
    /// When it cannot be written, or another program is writing it.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        let path = folder.join(JOURNAL);
        let failed = |e: std::io::Error| StorageError::new("open", &path, e);
        if path.exists() {
            // A pipe would be waited for.
            regular::open(&path).map_err(failed)?;
        }
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(failed)?;
        let mut tries = 0;
        while let Err(error) = file.try_lock() {
            match error {
                TryLockError::WouldBlock if tries < TRIES.0 => std::thread::sleep(TRIES.1),
                TryLockError::WouldBlock => {
                    let message = "another damprig is recording into this folder; wait until it has ended";
                    return Err(StorageError::new("append to", &path, message));
                }
                TryLockError::Error(error) => return Err(failed(error)),
            }
            tries += 1;
        }
        has_one_name(&file, &path)?;
        let mut behind = Behind::Nothing;
        if file.seek(SeekFrom::End(-1)).is_ok() {
            let mut last = [0];
            file.read_exact(&mut last).map_err(failed)?;
            if last != *b"\n" {
                behind = Behind::OfBefore;
            }
        }
        let whole = file.metadata().map_err(failed)?.len();
        Ok(Self { path, file, whole, behind })
    }

    /// Opens the journal of a run folder, if it has one.
    ///
    /// # Errors
    /// As [`Journal::open`].
    pub fn existing(folder: &Path) -> Result<Option<Self>, StorageError> {
        if folder.join(JOURNAL).exists() { Self::open(folder).map(Some) } else { Ok(None) }
    }

    /// Whether it holds nothing yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.whole == 0
    }

    /// Appends a line. It survives the program from here on, and the machine from [`Journal::sync`] on. What was left of
    /// a line that could not be written whole is taken away first: the next one would become a part of it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn append(&mut self, entry: &Entry) -> Result<(), StorageError> {
        let mut line = serde_json::to_string(entry).map_err(|e| StorageError::new("write", &self.path, e))?;
        line.push('\n');
        let failed = |e: std::io::Error| StorageError::new("write", &self.path, e);
        match self.behind {
            Behind::Nothing => {}
            Behind::OfBefore => {
                self.file.write_all(b"\n").map_err(failed)?;
                self.whole += 1;
            }
            Behind::Own => self.file.set_len(self.whole).map_err(failed)?,
        }
        self.behind = Behind::Own;
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        self.behind = Behind::Nothing;
        self.whole += line.len() as u64;
        Ok(())
    }

    /// Brings the lines to the disk itself.
    ///
    /// # Errors
    /// When the disk fails, or the journal is no more in its folder.
    pub fn sync(&mut self) -> Result<(), StorageError> {
        self.file.sync_data().map_err(|e| StorageError::new("write", &self.path, e))
    }

    /// Whether the folder still holds the journal: a file that was removed can be written for ever without a word.
    ///
    /// # Errors
    /// When it is gone.
    pub fn is_in_place(&self) -> Result<(), StorageError> {
        match std::fs::metadata(&self.path) {
            Ok(_) => Ok(()),
            Err(e) => {
                Err(StorageError::new("find", &self.path, format!("{e}; was the run folder removed or renamed?")))
            }
        }
    }
}

/// A journal under two names (a copy of the folder made of hard links) would change in both places.
#[cfg(unix)]
fn has_one_name(file: &File, path: &Path) -> Result<(), StorageError> {
    use std::os::unix::fs::MetadataExt;
    let names = file.metadata().map_or(1, |m| m.nlink());
    if names <= 1 {
        return Ok(());
    }
    let message = format!(
        "the file has {names} names (hard links), and would change under all of them; give the run one of its own: cp {0} {0}.own && mv {0}.own {0}",
        path.display()
    );
    Err(StorageError::new("append to", path, message))
}

#[cfg(not(unix))]
fn has_one_name(_: &File, _: &Path) -> Result<(), StorageError> {
    Ok(())
}

/// What a journal holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// The entries in order.
    pub entries: Vec<Entry>,
    /// Numbers (from 1) of the lines that are no entries.
    pub damaged: Vec<usize>,
    /// Numbers of the lines that were torn when the program was killed; they count as nothing.
    pub torn: Vec<usize>,
}

/// Reads the journal of a run folder.
///
/// # Errors
/// When it cannot be read; a folder without one gives the error of a missing file.
pub fn read(folder: &Path) -> Result<Lines, StorageError> {
    let path = folder.join(JOURNAL);
    let bytes = regular::read(&path).map_err(|e| StorageError::new("read", &path, e))?;
    let mut lines = Lines::default();
    let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    // A torn line stops in mid-entry, and the next thing that the program did was to begin again (and, just before, to
    // close the parts that were open).
    let mut cut_short: Option<usize> = None;
    for (n, line) in bytes[..whole].split(|b| *b == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
        match serde_json::from_slice(line) {
            Ok(entry) => {
                match (&entry, cut_short) {
                    (Entry::Begin(_), Some(torn)) => lines.torn.push(torn),
                    (Entry::Sealed(_), _) | (_, None) => {}
                    (_, Some(damaged)) => lines.damaged.push(damaged),
                }
                if !matches!(entry, Entry::Sealed(_)) {
                    cut_short = None;
                }
                lines.entries.push(entry);
            }
            Err(error) => {
                lines.damaged.extend(cut_short.take());
                if error.is_eof() { cut_short = Some(n + 1) } else { lines.damaged.push(n + 1) }
            }
        }
    }
    // Killed again before it had begun.
    lines.torn.extend(cut_short);
    Ok(lines)
}

/// Whether a program is appending to the journal of a folder now; none when there is no journal, or the system cannot
/// tell.
#[must_use]
pub fn is_being_written(folder: &Path) -> Option<bool> {
    match regular::open(&folder.join(JOURNAL)).ok()?.try_lock_shared() {
        Ok(()) => Some(false),
        Err(TryLockError::WouldBlock) => Some(true),
        Err(TryLockError::Error(_)) => None,
    }
}

/// Whether a folder has a journal.
#[must_use]
pub fn is_in(folder: &Path) -> bool {
    folder.join(JOURNAL).is_file()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(rows: u64) -> Entry {
        Entry::Joined { rows, left: Vec::new() }
    }

    #[test]
    fn a_torn_line_costs_itself_alone_wherever_it_is_cut() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(folder.path()).unwrap();
        (1..=2).for_each(|n| journal.append(&joined(n)).unwrap());
        drop(journal);
        let path = folder.path().join(JOURNAL);
        let bytes = std::fs::read(&path).unwrap();
        let second = bytes.len() / 2;
        for cut in second..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            assert_eq!(read(folder.path()).unwrap(), Lines { entries: vec![joined(1)], ..Lines::default() }, "{cut}");
            Journal::open(folder.path()).unwrap().append(&joined(3)).unwrap();
            let lines = read(folder.path()).unwrap();
            // Cut before its end of line alone, the entry is whole after all.
            let kept =
                if cut == bytes.len() - 1 { vec![joined(1), joined(2), joined(3)] } else { vec![joined(1), joined(3)] };
            assert_eq!(lines.entries, kept, "{cut}");
        }
    }

    #[test]
    fn a_line_torn_by_a_kill_is_told_from_a_damaged_one_by_what_follows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        let device = r#"{"link":"","board":"","firmware":"","protocol_version":1,"protocol_schema":"","simulated":true,"plant":"","clock":"","tick_hz":1.0}"#;
        let begin = format!(
            r#"{{"entry":"begin","at":"","damprig":"","device":{device},"signals":[],"every_ticks":1,"campaign":""}}"#
        );
        let sealed = r#"{"entry":"sealed","part":1,"file":{"name":"","bytes":0,"sha256":""},"rows":1,"lost_rows":0}"#;
        let joined = r#"{"entry":"joined","rows":1}"#;
        let of = |lines: &[&str]| {
            std::fs::write(&path, lines.join("\n") + "\n").unwrap();
            let lines = read(folder.path()).unwrap();
            (lines.torn, lines.damaged)
        };
        let torn = &joined[..9];
        assert_eq!(of(&[&begin, torn, sealed, &begin, joined]), (vec![2], vec![]));
        assert_eq!(of(&[&begin, torn, joined, &begin]), (vec![], vec![2]));
        assert_eq!(of(&[&begin, "no JSON", &begin]), (vec![], vec![2]));
        assert_eq!(of(&[&begin, torn, torn, &begin, torn]), (vec![3, 5], vec![2]));
    }

    #[test]
    fn two_programs_do_not_write_one_journal() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(is_being_written(folder.path()), None);
        let first = Journal::open(folder.path()).unwrap();
        assert_eq!(is_being_written(folder.path()), Some(true));
        let error = Journal::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("another damprig is recording into this folder"), "{error}");
        drop(first);
        assert_eq!(is_being_written(folder.path()), Some(false));
        Journal::open(folder.path()).unwrap();
    }
}
