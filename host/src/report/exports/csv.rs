//! Exports to CSV.

use super::{ExportSelection, ExportSummary, Exporter, RunTable, write_export};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::storage::out_file::{OutFile, to_failure};
use crate::table::csv::{CsvTable, Heads};

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

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, Failure> {
        let failed = to_failure(&out.path);
        let table = part.tables.first().copied().unwrap_or(RunTable::Samples);
        write_export(out, |file| {
            let mut exported = ExportSummary::default();
            let (mut file, mut writer) = (Some(file), None);
            part.each(run, table, &mut exported, |batch| {
                // The columns of the first rows: runs of older versions have others.
                if let Some(file) = file.take() {
                    let heads = CsvTable::new(file, &batch.schema(), Heads::NamesAndUnits);
                    writer = Some(heads.map_err(|e| failed(&e))?);
                }
                writer.as_mut().map_or(Ok(()), |writer| writer.write(&batch)).map_err(|e| failed(&e))
            })?;
            writer.map_or(Ok(()), |writer| writer.finish().map(drop)).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}
