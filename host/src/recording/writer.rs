//! What the recorder's thread does with what it is given: journal lines, the open part, closed parts, results.
//!
//! A line of the journal and a batch of the open part survive the end of the program as soon as they are written; a few
//! times a second everything is brought to the disk itself. When something waits and who is told of a failure is
//! [`super::recorder`]'s.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::impacts::IMPACTS;
use super::journal::{Entry, Journal, Sealed};
use super::parquet::write_results;
use super::part::{MOST_ROWS, OpenPart, Stream, open_parts, read_stream, salvage, seal_salvaged};
use super::recorder::{Message, Rows, Sink};
use super::samples::{self, Label};
use super::taken::Taken;
use super::transients::TRANSIENTS;
use super::{Signal, StorageError, checksum, impacts, transients};

/// What a writer has to know of its run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Columns of the samples.
    pub signals: Vec<Signal>,
    /// Ticks from row to row; 0 for none.
    pub every_ticks: u16,
    /// Ticks in a second, Hz.
    pub tick_hz: f64,
    /// Set-ups and experiments in the order of the campaign, by name.
    pub order: Vec<(String, String)>,
}

/// A part that is closed and not yet in the journal.
#[derive(Debug)]
struct Pending {
    part: u32,
    rows: u64,
    lost_rows: u64,
    open: PathBuf,
}

/// Writes a run folder.
pub struct Writer {
    folder: PathBuf,
    plan: Plan,
    journal: Journal,
    taken: Taken,
    open: Option<OpenPart>,
    next_part: u32,
    pending: Vec<Pending>,
    /// Tick of the last row of the present segment.
    last_tick: Option<u64>,
    rows: u64,
    /// Rows that were there when this program began.
    earlier_rows: u64,
    /// Rows that came more than once.
    repeated_rows: u64,
    is_synced: bool,
    has_new_results: bool,
}

impl Writer {
    /// Goes on after what `taken` says the journal holds. What was open when the program ended before is closed first.
    ///
    /// # Errors
    /// When that cannot be written.
    pub fn new(folder: &Path, journal: Journal, plan: Plan, taken: Taken) -> Result<Self, StorageError> {
        let last = samples::parts(folder).into_iter().chain(open_parts(folder)).map(|(n, _)| n).max();
        let mut writer = Self {
            folder: folder.to_path_buf(),
            plan,
            journal,
            rows: 0,
            earlier_rows: 0,
            repeated_rows: 0,
            taken,
            open: None,
            next_part: last.map_or(1, |n| n + 1),
            pending: Vec::new(),
            last_tick: None,
            is_synced: false,
            has_new_results: false,
        };
        writer.close_what_was_open()?;
        writer.rows = writer.taken.sealed.iter().map(|s| s.rows).sum();
        writer.earlier_rows = writer.rows;
        Ok(writer)
    }

    /// The journal's sum.
    #[must_use]
    pub fn taken(&self) -> &Taken {
        &self.taken
    }

    /// Rows of samples in the folder.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The results, in the order of the campaign.
    #[must_use]
    pub fn results(&self) -> Vec<super::ResultRow> {
        self.taken.rows_in_order(&self.plan.order)
    }

    fn close_what_was_open(&mut self) -> Result<(), StorageError> {
        for (part, open) in open_parts(&self.folder) {
            if read_stream(&open) == Stream::Unreadable {
                // Whatever it is, it is not this program's to remove.
                continue;
            }
            let is_sealed = self.taken.sealed.iter().any(|s| s.part == part);
            let mut pending = Pending { part, rows: 0, lost_rows: 0, open };
            if !is_sealed {
                let salvaged = salvage(&pending.open)?;
                pending.rows = salvaged.rows;
                pending.lost_rows = salvaged.gap_ticks / u64::from(self.plan.every_ticks).max(1);
                seal_salvaged(&self.folder, part, &salvaged)?;
            }
            self.pending.push(pending);
        }
        self.journal_pending()
    }

    /// Appends an entry and counts it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn note(&mut self, entry: &Entry) -> Result<(), StorageError> {
        self.journal.append(entry)?;
        self.taken.add(entry);
        self.is_synced = false;
        self.has_new_results |= matches!(entry, Entry::Result(_) | Entry::Transient(_) | Entry::Segment(_));
        Ok(())
    }

    fn entry(&mut self, mut entry: Entry) -> Result<(), StorageError> {
        match &mut entry {
            Entry::Segment(_) => {
                self.seal()?;
                self.last_tick = None;
            }
            Entry::Finished(finished) => {
                let every = u64::from(self.plan.every_ticks);
                if let Some(steps) = u64::from(finished.end_tick).checked_div(every) {
                    let have = self.last_tick.map_or(0, |tick| tick / every + 1);
                    finished.lost_rows = (steps + 1).saturating_sub(have);
                }
                self.seal()?;
            }
            _ => {}
        }
        self.note(&entry)
    }

    fn push(&mut self, rows: &Rows) -> Result<(), StorageError> {
        let every = u64::from(self.plan.every_ticks).max(1);
        let width = self.plan.signals.len();
        for (n, tick) in rows.ticks.iter().enumerate() {
            let tick = u64::from(*tick);
            let expected = self.last_tick.map_or(0, |last| last + every);
            if tick < expected {
                // It came twice.
                self.repeated_rows += 1;
                continue;
            }
            let gap_ticks = tick - expected;
            if self.open.as_ref().is_some_and(|p| p.label != rows.label || p.rows >= MOST_ROWS) {
                self.seal()?;
            }
            let part = match &mut self.open {
                Some(part) => part,
                None => self.open.insert(new_part(&self.folder, &mut self.next_part, &rows.label, &self.plan)?),
            };
            part.lost_rows += gap_ticks / every;
            part.push(tick, u32::try_from(gap_ticks).unwrap_or(u32::MAX), &rows.values[n * width..(n + 1) * width])?;
            self.last_tick = Some(tick);
            self.rows += 1;
        }
        Ok(())
    }

    /// Closes the open part.
    fn seal(&mut self) -> Result<(), StorageError> {
        let Some(mut part) = self.open.take() else { return Ok(()) };
        let sealed = part.seal(&self.folder, &self.plan.signals, self.plan.tick_hz);
        if sealed.is_ok() {
            let (rows, lost_rows) = (part.rows, part.lost_rows);
            self.pending.push(Pending { part: part.number, rows, lost_rows, open: part.path.clone() });
        }
        sealed
    }

    /// Closed parts go to the disk, then into the journal; only then their streams go.
    fn journal_pending(&mut self) -> Result<(), StorageError> {
        let pending = std::mem::take(&mut self.pending);
        for p in &pending {
            let is_sealed = self.taken.sealed.iter().any(|s| s.part == p.part);
            if p.rows == 0 || is_sealed {
                continue;
            }
            let name = samples::part_name(p.part);
            let path = self.folder.join(&name);
            File::open(&path).and_then(|f| f.sync_data()).map_err(|e| StorageError::new("write", &path, e))?;
            let file = checksum::of_file(&self.folder, &name).map_err(|e| StorageError::new("read", &path, e))?;
            self.note(&Entry::Sealed(Sealed { part: p.part, file, rows: p.rows, lost_rows: p.lost_rows }))?;
        }
        if !self.is_synced {
            self.journal.sync()?;
            self.is_synced = true;
        }
        for p in &pending {
            std::fs::remove_file(&p.open).map_err(|e| StorageError::new("remove", &p.open, e))?;
        }
        Ok(())
    }

    /// The run is over: the open part is closed and everything is on the disk.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn close(&mut self) -> Result<(), StorageError> {
        self.seal()?;
        self.has_new_results = true;
        if !self.taken.impacts.is_empty() {
            impacts::write(&self.folder.join(IMPACTS), &self.taken.impacts, self.plan.tick_hz)?;
        }
        self.sync()
    }

    /// Of `accepted` rows that the recorder has let in, those that are in no file: the disk has failed. From here on
    /// [`Writer::rows`] is what can be read.
    pub fn unwritten_rows(&mut self, accepted: u64) -> u64 {
        let sealed = &self.taken.sealed;
        let open = open_parts(&self.folder).into_iter().filter(|(n, _)| sealed.iter().all(|s| s.part != *n));
        let in_streams = open.filter_map(|(_, path)| salvage(&path).ok()).map(|s| s.rows);
        self.rows = sealed.iter().map(|s| s.rows).chain(in_streams).sum();
        (self.earlier_rows + accepted).saturating_sub(self.repeated_rows + self.rows)
    }

    /// Joins the parts of a complete run and takes them away. Does nothing when that has been done before.
    ///
    /// # Errors
    /// When the joined file cannot be written; the parts stay then.
    pub fn join(&mut self) -> Result<(), StorageError> {
        if self.taken.joined.is_none() {
            let samples::Join { rows, left } = samples::join(&self.folder, &self.plan.signals, &self.taken.sealed)?;
            self.note(&Entry::Joined { rows, left })?;
            self.sync()?;
        }
        self.rows = self.taken.joined.unwrap_or(self.rows);
        samples::remove_parts(&self.folder, self.taken.sealed.iter().filter(|s| !self.taken.left.contains(&s.part)))
    }
}

fn new_part(folder: &Path, next: &mut u32, label: &Arc<Label>, plan: &Plan) -> Result<OpenPart, StorageError> {
    let number = *next;
    *next += 1;
    OpenPart::create(folder, number, Arc::clone(label), &plan.signals, plan.tick_hz)
}

impl Sink for Writer {
    fn take(&mut self, message: Message) -> Result<(), StorageError> {
        match message {
            Message::Entry(entry) => self.entry(*entry),
            Message::Rows(rows) => self.push(&rows),
        }
    }

    fn sync(&mut self) -> Result<(), StorageError> {
        self.journal.is_in_place()?;
        if let Some(part) = &mut self.open {
            part.sync()?;
        }
        self.journal_pending()?;
        if std::mem::take(&mut self.has_new_results) {
            write_results(&self.folder.join("results.parquet"), &self.results())?;
            if !self.taken.transients().is_empty() {
                transients::write(&self.folder.join(TRANSIENTS), self.taken.transients())?;
            }
        }
        Ok(())
    }
}
