//! Compares the tables of a run that has not ended with its journal, from which they are made. No manifest has their checksums yet.

use std::path::Path;

use arrow_array::RecordBatch;

use super::parquet_file::read;
use crate::input::regular;
use crate::run_folder::ReadError;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::results::{self, RESULTS};
use crate::run_folder::schema::self_description::{self, DESCRIPTION};
use crate::run_folder::schema::transients::{self, TRANSIENTS};
use crate::run_folder::write::parquet_file::bytes_of;

/// The tables that are not as this program makes them of journal and manifest, one text each; `order` has the set-ups and experiments
/// of the campaign. A table may be older than the last results.
#[must_use]
pub fn differing(
    folder: &Path,
    manifest: &Manifest,
    journal: &JournalState,
    order: &[(String, String)],
) -> Vec<String> {
    let is_own = journal.begun.last().is_some_and(|begin| begin.damprig == crate::VERSION_LINE);
    let run = journal.begun.first().map_or("", |begin| begin.run.as_str());
    // Of rows that do not count any more it is unknown whether the table has them.
    if !is_own || run.is_empty() || !journal.superseded().is_empty() || !journal.withdrawn().is_empty() {
        return Vec::new();
    }
    let about = self_description::of_run(run, manifest);
    let points = |count| results::table(&journal.first_rows_in_order(count, order));
    let events = |count| transients::table(journal.transients().get(..count).unwrap_or_default());
    type Table<'a> = (&'a str, &'a str, &'a dyn Fn(usize) -> Result<RecordBatch, String>);
    let tables: [Table<'_>; 2] = [(RESULTS, results::ROW, &points), (TRANSIENTS, transients::ROW, &events)];
    let differs = |(name, row, table): &Table<'_>| {
        let path = folder.join(name);
        let count: Option<usize> = read(&path)
            .and_then(|batches| batches.map(|batch| Ok(batch?.num_rows())).sum::<Result<usize, ReadError>>())
            .ok();
        let made = count.and_then(|count| {
            table(count).and_then(|table| bytes_of(table, about.clone().with(DESCRIPTION, *row))).ok()
        });
        path.exists() && (made.is_none() || regular::read(&path).ok() != made)
    };
    tables
        .iter()
        .filter(|table| differs(table))
        .map(|(name, ..)| format!("{name}: not as it was made of the journal"))
        .collect()
}
