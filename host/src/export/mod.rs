//! Runs in other formats. One exporter a file, behind [`Exporter`]; reading the run is [`crate::runs`]'s.

pub mod csv;

use std::path::Path;

use arrow_array::RecordBatch;

use crate::runs::{ReadError, RunFolder};

/// Which table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Table {
    /// Telemetry.
    Samples,
    /// One row a point.
    Results,
}

/// Which part of a run.
#[derive(Clone, Debug)]
pub struct Part {
    /// The table.
    pub table: Table,
    /// Only this set-up.
    pub set_up: Option<String>,
    /// Samples from this time of their experiment on, s.
    pub from_s: f64,
    /// Samples before this time of their experiment, s.
    pub to_s: f64,
}

impl Part {
    /// The table's batches, before rows are chosen.
    pub fn batches<'r>(
        &self,
        run: &'r RunFolder,
    ) -> Result<Box<dyn Iterator<Item = Result<RecordBatch, ReadError>> + 'r>, ReadError> {
        Ok(match self.table {
            Table::Samples => Box::new(run.samples()),
            Table::Results => Box::new(run.results()?.into_iter().map(Ok)),
        })
    }
}

/// Writes a part of a run in one format.
pub trait Exporter {
    /// Writes it to a new file and gives the number of rows.
    ///
    /// # Errors
    /// When the run cannot be read or the file cannot be written, with the file's name.
    fn export(&self, run: &RunFolder, part: &Part, out: &Path) -> Result<u64, ReadError>;
}
