//! Runs in other formats. One exporter a file, behind [`Exporter`]; reading the run is [`crate::run_folder`]'s.
//!
//! A file appears under its name only when it is whole (`atomic_file.rs`). What cannot be read of a damaged run does not hold
//! up the rest: it is told in [`Exported::missing`].

pub(crate) mod atomic_file;
pub mod csv;
pub mod mat;
pub mod uff;
mod uff_dataset;

use std::path::Path;

use arrow_array::{BooleanArray, RecordBatch};
use arrow_select::filter::filter_record_batch;

use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::read::sample_files::{read_samples, sample_files};
use crate::run_folder::{ReadError, RunFolder};

/// A table of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Table {
    /// Telemetry
    Samples,
    /// One row a point
    Results,
    /// One row a record, pulse or free vibration
    Transients,
}

impl Table {
    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Samples => "samples",
            Self::Results => "results",
            Self::Transients => "transients",
        }
    }
}

/// Which part of a run.
#[derive(Clone, Debug)]
pub struct Part {
    /// The tables, at least one. Formats that hold one take the first.
    pub tables: Vec<Table>,
    /// Only this set-up.
    pub set_up: Option<String>,
    /// Samples from this time of their experiment on, s.
    pub from_s: f64,
    /// Samples before this time of their experiment, s.
    pub to_s: f64,
}

/// What an export wrote, and what it could not.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Rows written, of all tables.
    pub rows: u64,
    /// What of the run could not be read and is not in the file, one text a file of the run.
    pub missing: Vec<String>,
    /// What the format could not hold as it is, in words.
    pub notes: Vec<String>,
}

impl Part {
    /// Hands the chosen rows of a table to `take`, batch by batch, in the order they were taken. What cannot be read is
    /// put into `exported.missing`, and the rest is read.
    ///
    /// # Errors
    /// What `take` gives.
    fn each(
        &self,
        run: &RunFolder,
        table: Table,
        exported: &mut Exported,
        mut take: impl FnMut(RecordBatch) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let mut take_chosen = |batch: &RecordBatch, exported: &mut Exported| {
            let chosen = self.choose(batch, table)?;
            exported.rows += chosen.num_rows() as u64;
            take(chosen)
        };
        if table != Table::Samples {
            match if table == Table::Results { run.results() } else { run.transients() } {
                Ok(batches) => batches.iter().try_for_each(|batch| take_chosen(batch, exported))?,
                Err(error) => exported.missing.push(error.to_string()),
            }
            return Ok(());
        }
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

    fn choose(&self, batch: &RecordBatch, table: Table) -> Result<RecordBatch, ReadError> {
        let mut is_chosen = vec![true; batch.num_rows()];
        if let Some(wanted) = &self.set_up {
            is_chosen = texts(batch, "set_up")?.iter().map(|s| s == wanted).collect();
        }
        if table == Table::Samples {
            for (chosen, t_s) in is_chosen.iter_mut().zip(numbers(batch, "t_s")?) {
                *chosen &= t_s >= self.from_s && t_s < self.to_s;
            }
        }
        filter_record_batch(batch, &BooleanArray::from(is_chosen)).map_err(|e| ReadError(e.to_string()))
    }
}

/// Writes a part of a run in one format.
pub trait Exporter {
    /// The tables that are written when none is asked for.
    fn usual_tables(&self) -> &'static [Table];

    /// Whether a file holds one table only.
    fn holds_one_table(&self) -> bool {
        false
    }

    /// Why a table has no place in the format, if it has none.
    fn cannot_hold(&self, table: Table) -> Option<&'static str> {
        let _ = table;
        None
    }

    /// The end of the file's name, without the dot.
    fn extension(&self) -> &'static str;

    /// Writes it to a new file.
    ///
    /// # Errors
    /// When nothing of what is asked for can be read, it is more than the format can hold, or the file cannot be written;
    /// with the file's name. There is no file then.
    fn export(&self, run: &RunFolder, part: &Part, out: &Path) -> Result<Exported, ReadError>;
}
