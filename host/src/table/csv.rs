//! Writes tables as CSV (RFC 4180): a line of heads, then one row per line. Numbers have the fewest digits that read back to the
//! same value.

use std::io::Write;

use arrow_array::RecordBatch;
use arrow_schema::Schema;
use csv::{Terminator, Writer, WriterBuilder};

use super::values::{unit, values};
use crate::failure::Failure;

/// Heads of the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heads {
    /// `x_m`
    Names,
    /// `x_m [m]`
    NamesAndUnits,
}

/// A CSV file of one table, which is written while it is read, so that its length is not limited.
pub struct CsvTable<W: Write>(Writer<W>);

impl<W: Write> CsvTable<W> {
    /// Writes the heads.
    ///
    /// # Errors
    /// The writer's.
    pub fn new(to: W, schema: &Schema, heads: Heads) -> Result<Self, Failure> {
        let mut writer = WriterBuilder::new().terminator(Terminator::CRLF).from_writer(to);
        let head = |(name, unit): (&str, &str)| match (heads, unit) {
            (Heads::Names, _) | (_, "") => name.to_string(),
            (Heads::NamesAndUnits, unit) => format!("{name} [{unit}]"),
        };
        let heads = schema.fields().iter().map(|field| head((field.name(), unit(field))));
        writer.write_record(heads).map_err(Failure::storage)?;
        Ok(Self(writer))
    }

    /// Writes rows.
    ///
    /// # Errors
    /// A column of an unknown type, or the writer's.
    pub fn write(&mut self, batch: &RecordBatch) -> Result<(), Failure> {
        let columns = batch.columns().iter().map(|column| values(column.as_ref()));
        let columns: Vec<_> =
            columns.collect::<Option<_>>().ok_or_else(|| Failure::Storage("a column has an unknown type".into()))?;
        (0..batch.num_rows()).try_for_each(|row| {
            self.0.write_record(columns.iter().map(|column| column[row].to_string())).map_err(Failure::storage)
        })
    }

    /// Ends the file and gives back the writer.
    ///
    /// # Errors
    /// The writer's.
    pub fn finish(self) -> Result<W, Failure> {
        self.0.into_inner().map_err(|e| Failure::storage(e.error()))
    }
}
