//! Compares the tables of a run that has not ended with its journal, from which they are made. No manifest has their checksums yet.

use std::path::Path;

use arrow_array::RecordBatch;

use super::parquet_file::read;
use crate::failure::Failure;
use crate::input::regular;
use crate::run_folder::journal::JournalEntry;
use crate::run_folder::schema::impacts::{self, IMPACTS};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::results::{self, RESULTS};
use crate::run_folder::schema::self_description::{self, DESCRIPTION};
use crate::run_folder::schema::transients::{self, TRANSIENTS};
use crate::run_folder::write::parquet_file::bytes_of;

/// A table that is made of the journal.
struct UnfinishedTable<'a> {
    name: &'static str,
    row: &'static str,
    /// Its number of rows.
    rows: fn(&JournalState) -> usize,
    make: &'a dyn Fn(&JournalState) -> Result<RecordBatch, Failure>,
    /// Whether the line changes it.
    depends_on: fn(&JournalEntry) -> bool,
    /// Whether a program that has written these lines has written it, or will within the next moments.
    is_due: fn(&JournalState) -> bool,
}

/// The tables that are missing, or not as this program makes them of manifest and journal, one text each; `order` has the set-ups and
/// experiments of the campaign. A table may be older than the last lines.
#[must_use]
pub fn differing(
    folder: &Path,
    manifest: &Manifest,
    entries: &[JournalEntry],
    order: &[(String, String)],
) -> Vec<String> {
    let journal = JournalState::of(entries);
    let run = journal.begun.first().map_or("", |begin| begin.run.as_str());
    let tick_hz = journal.begun.first().map_or(0.0, |begin| begin.device.tick_hz);
    let about = self_description::of_run(run, manifest);
    let points = |state: &JournalState| results::table(&state.rows_in_order(order));
    let events = |state: &JournalState| transients::table(state.transients());
    let hits = |state: &JournalState| impacts::table(&state.impacts, tick_hz);
    let tables = [
        UnfinishedTable {
            name: RESULTS,
            row: results::ROW,
            rows: |state| state.rows().len(),
            make: &points,
            depends_on: |entry| {
                matches!(
                    entry,
                    JournalEntry::Result(_)
                        | JournalEntry::PeakPoints(_)
                        | JournalEntry::Segment(_)
                        | JournalEntry::Withdrawn(_)
                )
            },
            is_due: |state| !state.segments.is_empty(),
        },
        UnfinishedTable {
            name: TRANSIENTS,
            row: transients::ROW,
            rows: |state| state.transients().len(),
            make: &events,
            depends_on: |entry| matches!(entry, JournalEntry::Transient(_) | JournalEntry::Withdrawn(_)),
            is_due: |state| !state.transients().is_empty(),
        },
        UnfinishedTable {
            name: IMPACTS,
            row: impacts::ROW,
            rows: |state| state.impacts.iter().map(|some| some.impacts.len()).sum(),
            make: &hits,
            depends_on: |entry| matches!(entry, JournalEntry::Impacts(_)),
            is_due: |state| (state.joined.is_some() || !state.ended.is_empty()) && !state.impacts.is_empty(),
        },
    ];
    // Another version makes the same table with other bytes.
    let is_own = !run.is_empty() && journal.begun.iter().all(|begin| begin.damprig == crate::VERSION_LINE);
    let found = tables.iter().filter_map(|table| {
        let path = folder.join(table.name);
        if !path.exists() {
            return (table.is_due)(&journal).then(|| format!("{}: missing; it can be made of the journal", table.name));
        }
        let is_made = |state: &JournalState| {
            let made = (table.make)(state).and_then(|made| bytes_of(made, about.clone().with(DESCRIPTION, table.row)));
            regular::read(&path).ok().is_some_and(|bytes| Ok(bytes) == made)
        };
        let count =
            read(&path).and_then(|batches| batches.map(|batch| Ok(batch?.num_rows())).sum::<Result<usize, Failure>>());
        let is_as_made = match count {
            Ok(count) if is_own => at_some_line(entries, table, |state| (table.rows)(state) == count && is_made(state)),
            readable => readable.is_ok(),
        };
        (!is_as_made).then(|| format!("{}: not as it was made of the journal", table.name))
    });
    found.collect()
}

/// Whether this is so of the lines up to some place.
fn at_some_line(entries: &[JournalEntry], table: &UnfinishedTable<'_>, is_so: impl Fn(&JournalState) -> bool) -> bool {
    let mut state = JournalState::default();
    is_so(&state)
        || entries.iter().any(|entry| {
            state.add(entry);
            (table.depends_on)(entry) && is_so(&state)
        })
}
