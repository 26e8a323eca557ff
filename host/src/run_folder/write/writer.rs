//! The work of the recorder's thread: writes journal lines, samples and results.
//!
//! A journal line and a batch of samples survive the end of the program as soon as they are written; [`super::recorder`]
//! syncs everything to the disk a few times a second. Samples are synced before the result of their point is noted: a result that
//! survives a power cut has its samples.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_schema::{Metadata, SchemaRef};

use super::parquet_file::{Durability, write_table};
use super::recorder::{PointRows, RecordSink, RecorderMessage};
use super::sample_join::{join, remove_parts};
use super::sample_part::{MAX_ROWS, OpenPart, seal_salvaged};
use crate::failure::Failure;
use crate::run_folder::file_name::FileName;
use crate::run_folder::journal::{Journal, JournalEntry, Sealed, SetAside};
use crate::run_folder::read::folder::readable_rows;
use crate::run_folder::read::open_part::{read_stream, rows_and_gaps};
use crate::run_folder::read::sample_files::{closed_parts, open_parts, open_sums};
use crate::run_folder::schema::impacts::{self, IMPACTS};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::results::{self, RESULTS, ResultRow};
use crate::run_folder::schema::samples::{
    self, LAST_PART, PARTS, PointLabel, SampleColumn, damaged_part_name, open_part_name, part_name,
};
use crate::run_folder::schema::self_description::DESCRIPTION;
use crate::run_folder::schema::stream_sums::sums_path;
use crate::run_folder::schema::transients::{self, TRANSIENTS};
use crate::run_folder::{checksum, own_files};

/// What is recorded, and in which order results are written.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordLayout {
    /// Columns of the samples.
    pub signals: Vec<SampleColumn>,
    /// Ticks from row to row; 0 for none.
    pub every_ticks: u16,
    /// Ticks per second.
    pub tick_hz: f64,
    /// Set-ups and experiments in the order of the campaign, by name.
    pub order: Vec<(String, String)>,
    /// What every table says of the run, from [`of_run`](crate::run_folder::schema::self_description::of_run).
    pub about: Metadata,
}

impl RecordLayout {
    /// The columns and metadata of the samples.
    fn samples(&self) -> SchemaRef {
        samples::schema(&self.signals, &self.about)
    }

    /// The metadata of a table with such rows.
    fn about(&self, description: &str) -> Metadata {
        self.about.clone().with(DESCRIPTION, description)
    }
}

/// A part that is closed and not yet in the journal.
#[derive(Debug)]
struct Pending {
    part: u32,
    rows: u64,
    lost_rows: u64,
    open: PathBuf,
    /// Of a damaged stream, which is kept aside: its sound bytes.
    sound_bytes: Option<u64>,
}

/// Writes the journal, samples and results of a run folder.
pub struct RunWriter {
    folder: PathBuf,
    layout: RecordLayout,
    journal: Journal,
    state: JournalState,
    open: Option<OpenPart>,
    next_part: u32,
    pending: Vec<Pending>,
    /// Tick of the last row of the present segment.
    last_tick: Option<u64>,
    rows: u64,
    /// Rows of earlier runs of the program.
    earlier_rows: u64,
    /// Rows that arrived more than once.
    repeated_rows: u64,
    is_synced: bool,
    has_new_results: bool,
}

impl RunWriter {
    /// Continues after `state`, the sum of the journal. A part that an earlier run of the program left open is closed first.
    ///
    /// # Errors
    /// When that cannot be written.
    pub fn new(folder: &Path, journal: Journal, layout: RecordLayout, state: JournalState) -> Result<Self, Failure> {
        let files = [closed_parts(folder), open_parts(folder), open_sums(folder)].into_iter().flatten().map(|(n, _)| n);
        // The number of a file that was removed is not used again.
        let listed = state.sealed.iter().map(|s| s.part).chain(state.set_aside.iter().map(|s| s.part));
        let last = files.chain(listed).max();
        let mut writer = Self {
            folder: folder.to_path_buf(),
            layout,
            journal,
            rows: 0,
            earlier_rows: 0,
            repeated_rows: 0,
            state,
            open: None,
            next_part: last.map_or(1, |n| n + 1),
            pending: Vec::new(),
            last_tick: None,
            is_synced: false,
            has_new_results: false,
        };
        writer.close_left_open()?;
        writer.rows = writer.state.sealed_rows();
        writer.earlier_rows = writer.rows;
        Ok(writer)
    }

    /// The journal's sum.
    #[must_use]
    pub fn state(&self) -> &JournalState {
        &self.state
    }

    /// Rows of samples in the folder.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The results, in the order of the campaign.
    #[must_use]
    pub fn results(&self) -> Vec<ResultRow> {
        self.state.rows_in_order(&self.layout.order)
    }

    fn close_left_open(&mut self) -> Result<(), Failure> {
        for (part, open) in open_parts(&self.folder) {
            let stream = read_stream(&open)?;
            let sound_bytes = stream.has_damage().then_some(stream.sound_bytes() as u64);
            let mut pending = Pending { part, rows: 0, lost_rows: 0, open, sound_bytes };
            if !self.state.is_sealed(part) {
                let salvaged = stream.salvage();
                // A power cut may have kept a closed part that the journal lacks, and not all of its stream.
                let closed = rows_and_gaps(&self.folder.join(part_name(part))).unwrap_or_default();
                let (rows, gap_ticks) = closed.max((salvaged.rows, salvaged.gap_ticks));
                // A closed part that the journal lacks has no digest, so it is written again.
                if salvaged.rows == rows {
                    seal_salvaged(&self.folder, part, &salvaged, &self.layout.samples())?;
                }
                pending.rows = rows;
                pending.lost_rows = gap_ticks / u64::from(self.layout.every_ticks).max(1);
            }
            self.pending.push(pending);
        }
        self.journal_pending()
    }

    /// Appends an entry and adds it to the sum.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn note(&mut self, entry: &JournalEntry) -> Result<(), Failure> {
        if matches!(entry, JournalEntry::Result(_) | JournalEntry::Transient(_)) {
            self.sync_samples()?;
        }
        self.journal.append(entry)?;
        self.state.add(entry);
        self.is_synced = false;
        self.has_new_results |=
            matches!(entry, JournalEntry::Result(_) | JournalEntry::Transient(_) | JournalEntry::Segment(_));
        Ok(())
    }

    /// Syncs the rows so far to the disk, in the open part and in closed ones.
    fn sync_samples(&mut self) -> Result<(), Failure> {
        if let Some(part) = &mut self.open {
            part.sync()?;
        }
        if self.pending.is_empty() { Ok(()) } else { self.journal_pending() }
    }

    fn sync_journal(&mut self) -> Result<(), Failure> {
        if !self.is_synced {
            self.journal.sync()?;
            self.is_synced = true;
        }
        Ok(())
    }

    fn entry(&mut self, mut entry: JournalEntry) -> Result<(), Failure> {
        match &mut entry {
            JournalEntry::Segment(_) => {
                self.seal()?;
                self.last_tick = None;
            }
            JournalEntry::Finished(finished) => {
                let every = u64::from(self.layout.every_ticks);
                if let Some(steps) = u64::from(finished.end_tick).checked_div(every) {
                    let have = self.last_tick.map_or(0, |tick| tick / every + 1);
                    finished.lost_rows = (steps + 1).saturating_sub(have);
                }
                self.seal()?;
            }
            _ => {}
        }
        self.note(&entry)?;
        // Samples of a segment that the journal does not have would be taken for those of another run.
        let is_final = matches!(entry, JournalEntry::Segment(_) | JournalEntry::Result(_) | JournalEntry::Transient(_));
        if is_final { self.sync_journal() } else { Ok(()) }
    }

    fn push(&mut self, rows: &PointRows) -> Result<(), Failure> {
        let every = u64::from(self.layout.every_ticks).max(1);
        let width = self.layout.signals.len();
        if rows.values.len() != rows.ticks.len() * width {
            let message = format!("{} values are not {} rows of {width} signals", rows.values.len(), rows.ticks.len());
            return Err(Failure::cannot("record", &self.folder, message));
        }
        for (n, tick) in rows.ticks.iter().enumerate() {
            let tick = u64::from(*tick);
            let expected = self.last_tick.map_or(0, |last| last + every);
            if tick < expected {
                // It arrived twice.
                self.repeated_rows += 1;
                continue;
            }
            let gap_ticks = tick - expected;
            if self.open.as_ref().is_some_and(|p| p.label != rows.label || p.rows >= MAX_ROWS) {
                self.seal()?;
            }
            let part = match &mut self.open {
                Some(part) => part,
                None => self.open.insert(new_part(&self.folder, &mut self.next_part, &rows.label, &self.layout)?),
            };
            part.lost_rows += gap_ticks / every;
            part.push(tick, u32::try_from(gap_ticks).unwrap_or(u32::MAX), &rows.values[n * width..(n + 1) * width])?;
            self.last_tick = Some(tick);
            self.rows += 1;
        }
        Ok(())
    }

    /// Closes the open part.
    fn seal(&mut self) -> Result<(), Failure> {
        let Some(mut part) = self.open.take() else { return Ok(()) };
        let sealed = part.seal(&self.folder, &self.layout.signals, &self.layout.about, self.layout.tick_hz);
        if sealed.is_ok() {
            let (rows, lost_rows) = (part.rows, part.lost_rows);
            self.pending.push(Pending {
                part: part.number,
                rows,
                lost_rows,
                open: part.path.clone(),
                sound_bytes: None,
            });
        }
        sealed
    }

    /// Syncs closed parts to the disk, then adds them to the journal; only then their streams are removed, or kept aside.
    fn journal_pending(&mut self) -> Result<(), Failure> {
        let pending = std::mem::take(&mut self.pending);
        let closed: Vec<&Pending> = pending.iter().filter(|p| p.rows > 0 && !self.state.is_sealed(p.part)).collect();
        for p in &closed {
            let path = self.folder.join(part_name(p.part));
            File::open(&path).and_then(|f| f.sync_data()).map_err(|e| Failure::cannot("write", &path, e))?;
        }
        if !closed.is_empty() {
            // A closed part is known by its stream until the journal has it, so that name comes first.
            for folder in [self.folder.clone(), self.folder.join(PARTS)] {
                own_files::sync_folder(&folder).map_err(|e| Failure::cannot("write", &folder, e))?;
            }
        }
        for p in closed {
            let path = self.folder.join(part_name(p.part));
            let file = FileName::new(&part_name(p.part)).map_err(|e| Failure::cannot("read", &path, e))?;
            let file = checksum::of_file(&self.folder, &file).map_err(|e| Failure::cannot("read", &path, e))?;
            self.note(&JournalEntry::Sealed(Sealed { part: p.part, file, rows: p.rows, lost_rows: p.lost_rows }))?;
        }
        for p in &pending {
            if let Some(sound_bytes) = p.sound_bytes {
                self.note(&JournalEntry::SetAside(set_aside(&self.folder, p.part, sound_bytes)?))?;
            }
        }
        self.sync_journal()?;
        for p in &pending {
            if p.sound_bytes.is_some() {
                let aside = self.folder.join(damaged_part_name(p.part));
                own_files::name_for_good(&p.open, &aside).map_err(|e| Failure::cannot("name", &aside, e))?;
            } else {
                std::fs::remove_file(&p.open).map_err(|e| Failure::cannot("remove", &p.open, e))?;
            }
            // Older runs have no checksums of a stream.
            own_files::remove_left(&sums_path(&p.open));
        }
        Ok(())
    }

    /// Ends the recording: closes the open part and syncs everything to the disk. What can be written is written, whatever cannot.
    ///
    /// # Errors
    /// The first thing that cannot be written.
    pub fn close(&mut self) -> Result<(), Failure> {
        self.journal.is_in_place()?;
        let sealed = self.seal();
        let impacts = self.write_impacts();
        let synced = self.sync();
        let results = self.write_results(Durability::Disk);
        sealed.and(impacts).and(synced).and(results)
    }

    fn write_impacts(&self) -> Result<(), Failure> {
        if self.state.impacts.is_empty() {
            return Ok(());
        }
        let table = impacts::table(&self.state.impacts, self.layout.tick_hz);
        write_table(&self.folder.join(IMPACTS), table, self.layout.about(impacts::ROW), Durability::Disk)
    }

    fn write_results(&self, durability: Durability) -> Result<(), Failure> {
        let about = self.layout.about(results::ROW);
        write_table(&self.folder.join(RESULTS), results::table(&self.results()), about, durability)?;
        if self.state.transients().is_empty() {
            return Ok(());
        }
        let about = self.layout.about(transients::ROW);
        write_table(&self.folder.join(TRANSIENTS), transients::table(self.state.transients()), about, durability)
    }

    /// Of the `accepted` rows of the recorder, those that are in no file because the disk has failed. From here on
    /// [`RunWriter::rows`] is the rows that can be read.
    pub fn unwritten_rows(&mut self, accepted: u64) -> u64 {
        self.rows = readable_rows(&self.folder, &self.state);
        let written = self.repeated_rows.saturating_add(self.rows);
        self.earlier_rows.saturating_add(accepted).saturating_sub(written)
    }

    /// Joins the parts of a complete run and removes them. Does nothing when that has been done before.
    ///
    /// # Errors
    /// When the joined file cannot be written; the parts stay then.
    pub fn join(&mut self) -> Result<(), Failure> {
        if self.state.joined.is_none() {
            let joined = join(&self.folder, &self.layout.samples(), &self.state.sealed)?;
            self.note(&JournalEntry::Joined(joined))?;
            self.sync()?;
        }
        let Some(joined) = &self.state.joined else { return Ok(()) };
        self.rows = joined.rows;
        remove_parts(&self.folder, self.state.sealed.iter().filter(|s| !joined.left.contains(&s.part)))
    }
}

/// The entry of a damaged open part, whose file gets another name.
fn set_aside(folder: &Path, part: u32, sound_bytes: u64) -> Result<SetAside, Failure> {
    let (open, aside) = (open_part_name(part), damaged_part_name(part));
    let failed = |e: &dyn std::fmt::Display| Failure::cannot("read", &folder.join(&open), e);
    let file = FileName::new(&open).map_err(|e| failed(&e))?;
    let mut file = checksum::of_file(folder, &file).map_err(|e| failed(&e))?;
    file.name = FileName::new(&aside).map_err(|e| failed(&e))?;
    Ok(SetAside { part, file, sound_bytes })
}

fn new_part(
    folder: &Path,
    next: &mut u32,
    label: &Arc<PointLabel>,
    layout: &RecordLayout,
) -> Result<OpenPart, Failure> {
    let number = *next;
    if number > LAST_PART {
        return Err(Failure::cannot(
            "create",
            &folder.join(PARTS),
            format!("part {LAST_PART} exists; no number is left"),
        ));
    }
    *next += 1;
    OpenPart::create(folder, number, Arc::clone(label), &layout.signals, layout.tick_hz)
}

impl RecordSink for RunWriter {
    fn take(&mut self, message: RecorderMessage) -> Result<(), Failure> {
        match message {
            RecorderMessage::Entry(entry) => self.entry(*entry),
            RecorderMessage::Rows(rows) => self.push(&rows),
        }
    }

    fn sync(&mut self) -> Result<(), Failure> {
        self.journal.is_in_place()?;
        if let Some(part) = &mut self.open {
            part.sync()?;
        }
        self.journal_pending()?;
        if std::mem::take(&mut self.has_new_results) { self.write_results(Durability::Program) } else { Ok(()) }
    }
}
