//! `journal.jsonl`: the append-only log of a run, one JSON object a line.
//!
//! A run is resumed from it, and `results.parquet` is made from it. A line is there whole, or it is the cut-off end of the
//! file of a program that was killed, which is ignored. Each line ends with its checksum ([`with_sum`]). [`JournalState`](super::schema::journal_state::JournalState) is the
//! sum of the lines.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::checksum::of_bytes;
use super::own_files::refuse_links;
pub use super::schema::journal_entry::{
    Begin, CopiedFile, Ended, Finished, Joined, JournalEntry, Losses, Sealed, SegmentStart, SetAside, Withdrawn,
};
use crate::failure::Failure;
use crate::input::regular;

/// The journal's name in a run folder.
pub const JOURNAL: &str = "journal.jsonl";

/// A journal open for appending, locked against other programs.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Bytes up to the end of the last line.
    whole: u64,
    fragment: Fragment,
}

/// A fragment after the last whole line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fragment {
    None,
    /// The beginning of a line by an earlier program. It is kept, and terminated: a line that is not an entry.
    Earlier,
    /// The beginning of a line of this program that could not be written whole.
    Own,
}

/// A reader locks the journal for a moment: number of tries to lock it, and the pause between them.
const TRIES: (u32, Duration) = (50, Duration::from_millis(10));

impl Journal {
    /// Opens or creates the journal of a run folder for appending. An existing one is not changed before
    /// [`Journal::append`].
    ///
    /// # Errors
    /// When it cannot be written, or another program is writing it.
    pub fn open(folder: &Path) -> Result<Self, Failure> {
        refuse_links(folder)?;
        let path = folder.join(JOURNAL);
        let failed = |e: std::io::Error| Failure::cannot("open", &path, e);
        if path.exists() {
            // Opening a pipe would block.
            regular::open(&path).map_err(failed)?;
        }
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(failed)?;
        let mut tries = 0;
        while let Err(error) = file.try_lock() {
            match error {
                TryLockError::WouldBlock if tries < TRIES.0 => std::thread::sleep(TRIES.1),
                TryLockError::WouldBlock => {
                    let message = "another damprig is recording into this folder; wait until it has ended";
                    return Err(Failure::cannot("append to", &path, message));
                }
                TryLockError::Error(error) => return Err(failed(error)),
            }
            tries += 1;
        }
        has_one_name(&file, &path)?;
        let mut fragment = Fragment::None;
        if file.seek(SeekFrom::End(-1)).is_ok() {
            let mut last = [0];
            file.read_exact(&mut last).map_err(failed)?;
            if last != *b"\n" {
                fragment = Fragment::Earlier;
            }
        }
        let whole = file.metadata().map_err(failed)?.len();
        Ok(Self { path, file, whole, fragment })
    }

    /// Opens the journal of a run folder, if it has one.
    ///
    /// # Errors
    /// As [`Journal::open`].
    pub fn existing(folder: &Path) -> Result<Option<Self>, Failure> {
        refuse_links(folder)?;
        if folder.join(JOURNAL).exists() { Self::open(folder).map(Some) } else { Ok(None) }
    }

    /// Appends a line. It survives the program from here on, and a power cut from [`Journal::sync`] on. The fragment of a
    /// line that could not be written whole is removed first: the new line would be appended to it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn append(&mut self, entry: &JournalEntry) -> Result<(), Failure> {
        let text = serde_json::to_string(entry).map_err(|e| Failure::cannot("write", &self.path, e))?;
        let mut line = with_sum(&text);
        line.push('\n');
        let failed = |e: std::io::Error| Failure::cannot("write", &self.path, e);
        match self.fragment {
            Fragment::None => {}
            Fragment::Earlier => {
                self.file.write_all(b"\n").map_err(failed)?;
                self.whole += 1;
            }
            Fragment::Own => self.file.set_len(self.whole).map_err(failed)?,
        }
        self.fragment = Fragment::Own;
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        self.fragment = Fragment::None;
        self.whole += line.len() as u64;
        Ok(())
    }

    /// Syncs the lines to the disk.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn sync(&mut self) -> Result<(), Failure> {
        self.file.sync_data().map_err(|e| Failure::cannot("write", &self.path, e))
    }

    /// Checks that the folder still holds the journal: writing to a removed file gives no error.
    ///
    /// # Errors
    /// When it is gone.
    pub fn is_in_place(&self) -> Result<(), Failure> {
        match std::fs::metadata(&self.path) {
            Ok(_) => Ok(()),
            Err(e) => Err(Failure::cannot("find", &self.path, format!("{e}; was the run folder removed or renamed?"))),
        }
    }
}

/// A journal with two names (hard links, as in a copy of the folder made with them) would change in both places.
#[cfg(unix)]
fn has_one_name(file: &File, path: &Path) -> Result<(), Failure> {
    use std::os::unix::fs::MetadataExt;
    let names = file.metadata().map_or(1, |m| m.nlink());
    if names <= 1 {
        return Ok(());
    }
    let message = format!(
        "the file has {names} names (hard links), and would change under all of them; give the run one of its own: cp {0} {0}.own && mv {0}.own {0}",
        path.display()
    );
    Err(Failure::cannot("append to", path, message))
}

#[cfg(not(unix))]
fn has_one_name(_: &File, _: &Path) -> Result<(), Failure> {
    Ok(())
}

/// Beginning and end of the checksum at the end of a line, and its length.
const SUM: (&[u8], &[u8], usize) = (b",\"sum\":\"", b"\"}", 16);

/// Beginning of each line.
const BEGINNING: &[u8] = b"{\"entry\":\"";

/// A JSON object as a line: with the beginning of its SHA-256 as its last value, `sum`.
#[must_use]
pub fn with_sum(object: &str) -> String {
    let inner = object.strip_suffix('}').unwrap_or(object);
    format!("{inner},\"sum\":\"{}\"}}", &of_bytes(object.as_bytes())[..SUM.2])
}

/// A line without its checksum, and whether that is right; `None` of a line without one.
fn sum_of(line: &[u8]) -> Option<(Vec<u8>, bool)> {
    let (rest, sum) = line.strip_suffix(SUM.1)?.split_last_chunk::<{ SUM.2 }>()?;
    let object = [rest.strip_suffix(SUM.0)?, b"}"].concat();
    let is_right = of_bytes(&object).as_bytes().starts_with(sum);
    Some((object, is_right))
}

/// Reads lines one after the other. Once a `begin` states that its program writes checksums, each line has one.
#[derive(Clone, Copy, Debug, Default)]
struct LineReader {
    has_sums: bool,
}

/// A line that is not an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NoEntry {
    /// The beginning of one.
    Torn,
    Damaged,
}

impl LineReader {
    fn read(&mut self, line: &[u8]) -> Result<JournalEntry, NoEntry> {
        let (object, sum) = sum_of(line).map_or((None, None), |(object, is_right)| (Some(object), Some(is_right)));
        let read = serde_json::from_slice::<JournalEntry>(object.as_deref().unwrap_or(line));
        let is_begun = !line.is_empty() && line.iter().zip(BEGINNING).all(|(a, b)| a == b);
        let torn = |error: serde_json::Error| if error.is_eof() && is_begun { NoEntry::Torn } else { NoEntry::Damaged };
        let entry = read.map_err(torn)?;
        let has_sums = if let JournalEntry::Begin(begin) = &entry { begin.sums } else { self.has_sums };
        if !sum.unwrap_or(!has_sums) || !entry.is_consistent() {
            return Err(NoEntry::Damaged);
        }
        self.has_sums = has_sums;
        Ok(entry)
    }
}

/// What a journal holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JournalLines {
    /// The entries in order.
    pub entries: Vec<JournalEntry>,
    /// Numbers (from 1) of the lines that are not entries.
    pub damaged: Vec<usize>,
    /// Numbers of the lines that were cut off when the program was killed; they are ignored.
    pub torn: Vec<usize>,
}

/// Reads the journal of a run folder.
///
/// # Errors
/// When it cannot be read; a folder without one gives the error of a missing file.
pub fn read(folder: &Path) -> Result<JournalLines, Failure> {
    let path = folder.join(JOURNAL);
    let bytes = regular::read(&path).map_err(|e| Failure::cannot("read", &path, e))?;
    let mut lines = JournalLines::default();
    let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    // A torn line ends in the middle of an entry. The program's next entry is its new beginning; before that it may close
    // the parts that were open.
    let mut cut_short: Option<usize> = None;
    let mut reader = LineReader::default();
    for (n, line) in bytes[..whole].split_inclusive(|b| *b == b'\n').enumerate() {
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        match reader.read(line) {
            Ok(entry) => {
                match (&entry, cut_short) {
                    (JournalEntry::Begin(_), Some(torn)) => lines.torn.push(torn),
                    (JournalEntry::Sealed(_), _) | (_, None) => {}
                    (_, Some(damaged)) => lines.damaged.push(damaged),
                }
                if !matches!(entry, JournalEntry::Sealed(_)) {
                    cut_short = None;
                }
                lines.entries.push(entry);
            }
            Err(what) => {
                lines.damaged.extend(cut_short.take());
                if what == NoEntry::Torn { cut_short = Some(n + 1) } else { lines.damaged.push(n + 1) }
            }
        }
    }
    // Killed again before its new beginning.
    lines.torn.extend(cut_short);
    let rest = &bytes[whole..];
    if !rest.is_empty() {
        let line = bytes[..whole].iter().filter(|b| **b == b'\n').count() + 1;
        if reader.read(rest) == Err(NoEntry::Damaged) { lines.damaged.push(line) } else { lines.torn.push(line) }
    }
    Ok(lines)
}

/// Reads the entries after the first `bytes` of the journal of a run that is being recorded, up to the last whole line, and moves
/// `bytes` there. Lines that are not entries are passed over.
///
/// # Errors
/// When it cannot be read.
pub fn read_after(folder: &Path, bytes: &mut u64) -> Result<Vec<JournalEntry>, Failure> {
    let path = folder.join(JOURNAL);
    let failed = |e: std::io::Error| Failure::cannot("read", &path, e);
    let mut file = regular::open(&path).map_err(failed)?;
    file.seek(SeekFrom::Start(*bytes)).map_err(failed)?;
    let mut new = Vec::new();
    file.read_to_end(&mut new).map_err(failed)?;
    let whole = new.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    *bytes += whole as u64;
    let mut reader = LineReader::default();
    Ok(new[..whole].split(|b| *b == b'\n').filter_map(|line| reader.read(line).ok()).collect())
}

/// Whether a program is appending to the journal of a folder now; none without a journal, or when the system cannot tell.
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

    fn joined(rows: u64) -> JournalEntry {
        JournalEntry::Joined(Joined { rows, ..Joined::default() })
    }

    #[test]
    fn only_a_torn_line_is_lost_wherever_it_is_cut() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(folder.path()).unwrap();
        (1..=2).for_each(|n| journal.append(&joined(n)).unwrap());
        drop(journal);
        let path = folder.path().join(JOURNAL);
        let bytes = std::fs::read(&path).unwrap();
        let second = bytes.len() / 2;
        for cut in second..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let torn = if cut == second { vec![] } else { vec![2] };
            let lines = JournalLines { entries: vec![joined(1)], torn, ..JournalLines::default() };
            assert_eq!(read(folder.path()).unwrap(), lines, "{cut}");
            Journal::open(folder.path()).unwrap().append(&joined(3)).unwrap();
            let lines = read(folder.path()).unwrap();
            // Without its end of line alone, the entry is whole.
            let kept =
                if cut == bytes.len() - 1 { vec![joined(1), joined(2), joined(3)] } else { vec![joined(1), joined(3)] };
            assert_eq!(lines.entries, kept, "{cut}");
        }
    }

    #[test]
    fn a_line_torn_by_a_kill_differs_from_a_damaged_one_by_the_entry_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        let device = r#"{"link":"","board":"","firmware":"","protocol_version":1,"protocol_schema":"","simulated":true,"plant":"","clock":"","tick_hz":1.0}"#;
        let begin = format!(
            r#"{{"entry":"begin","at":"","damprig":"","device":{device},"signals":[],"every_ticks":1,"campaign":""}}"#
        );
        let sealed = r#"{"entry":"sealed","part":1,"file":{"name":"samples.parts/000001.parquet","bytes":0,"sha256":""},"rows":1,"lost_rows":0}"#;
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
    fn a_growing_journal_is_read_line_by_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        let mut journal = Journal::open(folder.path()).unwrap();
        let mut bytes = 0;
        (1..=2).for_each(|n| journal.append(&joined(n)).unwrap());
        assert_eq!(read_after(folder.path(), &mut bytes).unwrap(), [joined(1), joined(2)]);
        assert_eq!(read_after(folder.path(), &mut bytes).unwrap(), []);
        journal.append(&joined(3)).unwrap();
        drop(journal);
        let text = std::fs::read(&path).unwrap();
        // The end of a line that is still being written.
        std::fs::write(&path, &text[..text.len() - 4]).unwrap();
        assert_eq!(read_after(folder.path(), &mut bytes).unwrap(), []);
        std::fs::write(&path, &text).unwrap();
        assert_eq!(read_after(folder.path(), &mut bytes).unwrap(), [joined(3)]);
        assert_eq!(bytes, text.len() as u64);
    }

    #[test]
    fn two_programs_cannot_write_one_journal() {
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
