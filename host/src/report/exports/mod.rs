//! Exports runs to other formats: CSV, MATLAB, HDF5, UFF. Each format is a file that implements [`Exporter`].
//!
//! To add a format: implement [`Exporter`] and add it to `Format` in `cli/runs.rs`. An export gets its name only when it is
//! complete (`write_export`). Unreadable parts of a damaged run are listed in [`ExportSummary::missing`]; the rest is
//! exported.

pub mod comparison;
pub mod csv;
mod facts;
pub mod hdf5;
pub mod mat;
pub mod uff;
mod uff_dataset;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use arrow_array::{BooleanArray, RecordBatch};
use arrow_schema::Metadata;
use arrow_select::filter::filter_record_batch;
use damprig_core::io::TICK_HZ;

use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::read::sample_files::{read_samples, sample_files};
use crate::run_folder::schema::{impacts, results, samples, transients};
use crate::storage::out_file::{OutFile, write_new};
use crate::storage::whole_file::WholeFile;
use crate::table::gathered::{ColumnValues, Names, gather};
use crate::table::values::{numbers, texts};

/// A table of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RunTable {
    /// Telemetry
    Samples,
    /// One row per point
    Results,
    /// One row per playback, impulse or free vibration
    Transients,
    /// One row per impact
    Impacts,
}

impl RunTable {
    /// All tables.
    pub const ALL: [Self; 4] = [Self::Results, Self::Samples, Self::Transients, Self::Impacts];

    /// Name of the table.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "samples",
            Self::Results => "results",
            Self::Transients => "transients",
            Self::Impacts => "impacts",
        }
    }

    /// How its names are kept: a name per row would dominate a table with a row per tick or impact.
    fn names(self) -> Names {
        match self {
            Self::Results | Self::Transients => Names::InFull,
            Self::Samples | Self::Impacts => Names::AsPlaces,
        }
    }

    /// Its rows in a run; `None` for samples, which are read file by file.
    fn of(self, run: &RunFolder) -> Option<Result<Vec<RecordBatch>, Failure>> {
        match self {
            Self::Samples => None,
            Self::Results => Some(run.results()),
            Self::Transients => Some(run.transients()),
            Self::Impacts => Some(run.impacts()),
        }
    }

    /// Its columns in a run, without rows.
    fn without_rows(self, run: &RunFolder) -> Result<RecordBatch, Failure> {
        match self {
            Self::Samples => Ok(RecordBatch::new_empty(samples::schema(&run.manifest().signals, &Metadata::new()))),
            Self::Results => results::table(&[]),
            Self::Transients => transients::table(&[]),
            Self::Impacts => impacts::table(&[], f64::from(TICK_HZ)),
        }
    }

    /// Whether a file of several tables has it without being asked for: most runs have no transients or no impacts.
    #[must_use]
    pub fn is_usual(self, run: &RunFolder) -> bool {
        let has_rows = |batches: Vec<RecordBatch>| batches.iter().any(|batch| batch.num_rows() > 0);
        match self {
            Self::Samples | Self::Results => true,
            // One that cannot be read is named by the export.
            Self::Transients | Self::Impacts => self.of(run).is_none_or(|read| read.map_or(true, has_rows)),
        }
    }
}

/// The part of a run to export.
#[derive(Clone, Debug)]
pub struct ExportSelection {
    /// Tables, at least one. A format that holds one table takes the first.
    pub tables: Vec<RunTable>,
    /// Only this set-up.
    pub set_up: Option<String>,
    /// Samples and impacts from this time of their experiment on, s.
    pub from_s: f64,
    /// Samples and impacts before this time of their experiment, s.
    pub to_s: f64,
    /// Rows of the samples that have been read so far.
    pub samples_read: Arc<AtomicU64>,
}

/// What an export wrote.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExportSummary {
    /// Rows written, all tables together.
    pub rows: u64,
    /// Files of the run that could not be read and are missing, with the reason.
    pub missing: Vec<String>,
    /// Notes on what the format changed.
    pub notes: Vec<String>,
}

impl ExportSelection {
    /// Passes the selected rows of a table to `take`, batch by batch, in order; a batch with the columns alone if there are no
    /// rows. Unreadable parts are added to `exported.missing`.
    ///
    /// # Errors
    /// The error of `take`.
    fn each(
        &self,
        run: &RunFolder,
        table: RunTable,
        exported: &mut ExportSummary,
        mut take: impl FnMut(RecordBatch) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut has_columns = false;
        let mut take_chosen = |batch: &RecordBatch, exported: &mut ExportSummary| {
            has_columns = true;
            let chosen = self.choose(batch, table)?;
            exported.rows += chosen.num_rows() as u64;
            take(chosen)
        };
        match table.of(run) {
            Some(Ok(batches)) => batches.iter().try_for_each(|batch| take_chosen(batch, exported))?,
            Some(Err(error)) => exported.missing.push(error.to_string()),
            None => self.each_of_samples(run, exported, &mut take_chosen)?,
        }
        if has_columns { Ok(()) } else { take(table.without_rows(run)?) }
    }

    fn each_of_samples(
        &self,
        run: &RunFolder,
        exported: &mut ExportSummary,
        take_chosen: &mut impl FnMut(&RecordBatch, &mut ExportSummary) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        for file in sample_files(run.path()) {
            let mut rows = 0;
            let batches = match read_samples(&file) {
                Ok(batches) => batches,
                Err(error) => {
                    exported.missing.push(error.to_string());
                    continue;
                }
            };
            for batch in batches {
                match batch {
                    Ok(batch) => {
                        rows += batch.num_rows();
                        self.samples_read.fetch_add(batch.num_rows() as u64, Ordering::Relaxed);
                        take_chosen(&batch, exported)?;
                    }
                    Err(error) => {
                        exported.missing.push(format!("{error}\n  {rows} rows before it were read"));
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    /// The selected rows of the selected tables in memory, in their order.
    ///
    /// # Errors
    /// More than `most` values in a table; a column of an unknown type, or one that only some files of the run have.
    fn gathered(
        &self,
        run: &RunFolder,
        most: usize,
        exported: &mut ExportSummary,
    ) -> Result<Vec<(RunTable, Vec<ColumnValues>)>, Failure> {
        let mut tables = Vec::new();
        for &table in &self.tables {
            let (mut columns, mut count) = (Vec::new(), 0);
            self.each(run, table, exported, |batch| {
                count += batch.num_rows() * batch.num_columns();
                if count > most {
                    return Err(Failure::Storage(format!(
                        "the {} have more than {most} numbers, all that a variable of a .mat file holds (2 GiB); select fewer \
                         with --set-up, --from-s and --to-s, or use --format h5 or csv, which have no limit",
                        table.name()
                    )));
                }
                gather(&mut columns, &batch, table.names())
            })?;
            tables.push((table, columns));
        }
        Ok(tables)
    }

    fn choose(&self, batch: &RecordBatch, table: RunTable) -> Result<RecordBatch, Failure> {
        let mut is_chosen = vec![true; batch.num_rows()];
        if let Some(wanted) = &self.set_up {
            is_chosen = texts(batch, "set_up")?.iter().map(|s| s == wanted).collect();
        }
        if matches!(table, RunTable::Samples | RunTable::Impacts) {
            for (chosen, t_s) in is_chosen.iter_mut().zip(numbers(batch, "t_s")?) {
                *chosen &= t_s >= self.from_s && t_s < self.to_s;
            }
        }
        Ok(filter_record_batch(batch, &BooleanArray::from(is_chosen))?)
    }
}

/// Writes an export as [`write_new`] does.
///
/// # Errors
/// As [`write_new`], and when nothing could be read.
fn write_export(
    out: &OutFile,
    write: impl FnOnce(&mut WholeFile) -> Result<ExportSummary, Failure>,
) -> Result<ExportSummary, Failure> {
    write_new(out, |file| {
        let exported = write(file)?;
        if exported.rows == 0 && !exported.missing.is_empty() {
            return Err(Failure::Storage(format!("nothing was exported: {}", exported.missing.join("\n"))));
        }
        Ok(exported)
    })
}

/// Writes a part of a run in one format.
pub trait Exporter: Sync {
    /// Tables written by default, of which a run may lack some ([`RunTable::is_usual`]).
    fn usual_tables(&self) -> &'static [RunTable];

    /// Whether a file holds a single table.
    fn holds_one_table(&self) -> bool {
        false
    }

    /// Why the format cannot hold a table; `None` if it can.
    fn cannot_hold(&self, table: RunTable) -> Option<&'static str> {
        let _ = table;
        None
    }

    /// Extension of the file, without the dot.
    fn extension(&self) -> &'static str;

    /// Writes a new file.
    ///
    /// # Errors
    /// Nothing selected can be read, the data exceed the format's limit, or the file cannot be written. No file is left then.
    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, Failure>;
}
