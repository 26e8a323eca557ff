//! CSV after RFC 4180: a header of `name [unit]`, then a row a line, numbers in the shortest text that reads
//! back to the same value.

use std::fs::File;
use std::path::Path;

use super::{Exporter, Part, Table};
use crate::runs::columns::{numbers, texts, unit, values};
use crate::runs::{ReadError, RunFolder};

/// The exporter.
#[derive(Clone, Copy, Debug)]
pub struct Csv;

impl Exporter for Csv {
    fn export(&self, run: &RunFolder, part: &Part, out: &Path) -> Result<u64, ReadError> {
        let failed = |e: &dyn std::fmt::Display| ReadError(format!("cannot write {}: {e}", out.display()));
        let file = File::create_new(out).map_err(|e| failed(&e))?;
        let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(file);
        let (mut rows, mut has_header) = (0, false);
        for batch in part.batches(run)? {
            let batch = batch?;
            let schema = batch.schema();
            if !has_header {
                let header = schema.fields().iter().map(|f| match unit(f) {
                    "" => f.name().clone(),
                    unit => format!("{} [{unit}]", f.name()),
                });
                writer.write_record(header).map_err(|e| failed(&e))?;
                has_header = true;
            }
            let set_ups = texts(&batch, "set_up")?;
            let times = if part.table == Table::Samples { Some(numbers(&batch, "t_s")?) } else { None };
            let wrong_type = || ReadError("a column has a type that no run has".into());
            let columns = batch.columns().iter().map(|c| values(c.as_ref()).ok_or_else(wrong_type));
            let columns = columns.collect::<Result<Vec<_>, _>>()?;
            for (row, set_up) in set_ups.iter().enumerate() {
                let is_in_time = times.as_ref().is_none_or(|t| t[row] >= part.from_s && t[row] < part.to_s);
                if is_in_time && part.set_up.as_ref().is_none_or(|wanted| wanted == set_up) {
                    writer.write_record(columns.iter().map(|c| c[row].to_string())).map_err(|e| failed(&e))?;
                    rows += 1;
                }
            }
        }
        writer.flush().map_err(|e| failed(&e))?;
        Ok(rows)
    }
}
