//! Exports to CSV (RFC 4180): a header of `name [unit]`, then one row per line. Numbers have the fewest digits that read back
//! to the same value.

use super::atomic_file::{OutFile, to_failure, write_export};
use super::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::run_folder::read::columns::{unit, values};
use crate::run_folder::{ReadError, RunFolder};

/// The CSV exporter. Rows are written as they are read, so the length is unlimited.
#[derive(Clone, Copy, Debug)]
pub struct Csv;

impl Exporter for Csv {
    fn usual_tables(&self) -> &'static [RunTable] {
        &[RunTable::Samples]
    }

    fn holds_one_table(&self) -> bool {
        true
    }

    fn extension(&self) -> &'static str {
        "csv"
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, ReadError> {
        let failed = to_failure(&out.path);
        let table = part.tables.first().copied().unwrap_or(RunTable::Samples);
        write_export(out, |file| {
            let mut writer =
                csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(file.as_file_mut());
            let (mut exported, mut has_header) = (ExportSummary::default(), false);
            part.each(run, table, &mut exported, |batch| {
                let schema = batch.schema();
                if !has_header {
                    let header = schema.fields().iter().map(|f| match unit(f) {
                        "" => f.name().clone(),
                        unit => format!("{} [{unit}]", f.name()),
                    });
                    writer.write_record(header).map_err(|e| failed(&e))?;
                    has_header = true;
                }
                let wrong_type = || ReadError("a column has an unknown type".into());
                let columns = batch.columns().iter().map(|c| values(c.as_ref()).ok_or_else(wrong_type));
                let columns = columns.collect::<Result<Vec<_>, _>>()?;
                (0..batch.num_rows()).try_for_each(|row| {
                    writer.write_record(columns.iter().map(|c| c[row].to_string())).map_err(|e| failed(&e))
                })
            })?;
            writer.flush().map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}
