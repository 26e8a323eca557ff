//! Exports to HDF5, readable by h5py, PyTables, MATLAB's `h5read`, Julia and Octave.
//!
//! The root's attributes are the facts of the run. A group per table (`results`, `samples` and, if the run has any, `transients`
//! and `impacts`) has a dataset per column: numbers as doubles, names as UTF-8 texts, with the attributes `unit` and
//! `description`. In `samples` and `impacts` the datasets `set_up` and `experiment` are indices, from 0, into `set_up_names` and
//! `experiment_names` beside them. The group `set_ups` has the set-ups' names, labels, base amplitudes and parameters.
//!
//! Samples and impacts are appended chunk by chunk, so their number is not limited and memory does not grow with it.

use std::io::Write;

use hdf5_pure::{
    AttrValue, Dataset, DatasetBuilder, Error, File, FileAccessProperties, FileBuilder, FormatError, MaxExtent,
    SyncPolicy, make_f64_type,
};

use super::facts::{self, Fact};
use super::{ExportSelection, ExportSummary, Exporter, RunTable, write_export};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::storage::out_file::{OutFile, to_failure};
use crate::table::gathered::{ColumnValues, Values, gather};

/// Numbers that are compressed together. The library writes the dimensions of a chunk in 1, 2 or 4 bytes, and the HDF5 library
/// refuses more bytes than they need: from 65 536 on that would be 3.
const CHUNK: usize = 1 << 15;

/// The HDF5 exporter.
#[derive(Clone, Copy, Debug)]
pub struct Hdf5;

impl Exporter for Hdf5 {
    fn usual_tables(&self) -> &'static [RunTable] {
        &RunTable::ALL
    }

    fn extension(&self) -> &'static str {
        "h5"
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, Failure> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let mut exported = ExportSummary::default();
            let mut builder = FileBuilder::new();
            for (name, fact) in facts::of_run(run) {
                let value = match fact {
                    Fact::Text(text) => AttrValue::VarLenString(text),
                    Fact::Number(number) => AttrValue::F64(number),
                };
                builder.set_attr(name, value);
            }
            add_set_ups(&mut builder, run).map_err(|e| failed(&e))?;
            let is_long = |table: &RunTable| matches!(table, RunTable::Samples | RunTable::Impacts);
            let (long, short): (Vec<_>, Vec<_>) = part.tables.iter().copied().partition(is_long);
            let short = ExportSelection { tables: short, ..part.clone() };
            for (table, columns) in short.gathered(run, usize::MAX, &mut exported).map_err(|e| failed(&e))? {
                add_table(&mut builder, table.name(), &columns).map_err(|e| failed(&e))?;
            }
            builder.finish_to(&mut *file).map_err(|e| failed(&e))?;
            file.flush().map_err(|e| failed(&e))?;
            // The caller syncs the file.
            let access = FileAccessProperties::new().with_sync_policy(SyncPolicy::OnClose);
            let growing = File::open_rw_with_options(file.path(), access).map_err(|e| failed(&e))?;
            for table in long {
                LongTable::append(&growing, run, part, table, &mut exported, &failed)?;
            }
            growing.close().map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// A table that is written while it is read.
struct LongTable<'f> {
    file: &'f File,
    name: &'static str,
    /// With the rows that are not yet in the file.
    columns: Vec<ColumnValues>,
    /// Those of the columns, once there are more rows than a chunk has.
    datasets: Vec<Dataset>,
}

impl<'f> LongTable<'f> {
    /// Reads the selected rows of a table and appends them to the file.
    fn append(
        file: &'f File,
        run: &RunFolder,
        part: &ExportSelection,
        table: RunTable,
        exported: &mut ExportSummary,
        failed: &impl Fn(&dyn std::fmt::Display) -> Failure,
    ) -> Result<(), Failure> {
        let mut long = Self { file, name: table.name(), columns: Vec::new(), datasets: Vec::new() };
        part.each(run, table, exported, |batch| {
            gather(&mut long.columns, &batch, table.names()).map_err(|e| failed(&e))?;
            long.write_chunks().map_err(|e| failed(&e))
        })?;
        long.finish().map_err(|e| failed(&e))
    }

    fn path(&self, column: &str) -> String {
        format!("{}/{column}", self.name)
    }

    /// Writes the whole chunks of the rows so far.
    fn write_chunks(&mut self) -> Result<(), Error> {
        let rows = self.columns.first().map_or(0, |column| column.values.count());
        if rows <= CHUNK {
            return Ok(());
        }
        if self.datasets.is_empty() {
            self.create(|_, dataset| {
                let extent = dataset.with_f64_data(&[]).with_shape(&[0]).with_maxshape(&[MaxExtent::Unlimited]);
                extent.with_chunks(&[CHUNK as u64]).with_shuffle().with_deflate(4);
            })?;
        }
        self.write_rows(rows - rows % CHUNK)
    }

    /// Creates the group with a dataset for each column, which `fill` completes.
    fn create(&mut self, fill: impl Fn(&mut ColumnValues, &mut DatasetBuilder)) -> Result<(), Error> {
        let root = self.file.root();
        root.create_group(self.name)?;
        for mut column in std::mem::take(&mut self.columns) {
            let path = self.path(&column.name);
            let create = |dataset: &mut DatasetBuilder| {
                fill(&mut column, dataset);
                describe(dataset, &column);
            };
            self.datasets.push(root.create_dataset(&path, create)?);
            self.columns.push(column);
        }
        self.file.commit()
    }

    fn write_rows(&mut self, count: usize) -> Result<(), Error> {
        for (column, dataset) in self.columns.iter_mut().zip(&mut self.datasets) {
            dataset.append(&column.values.take_numbers(count))?;
        }
        Ok(())
    }

    /// Writes the remaining rows, and the names that places refer to. A table of no more rows than a chunk has is not chunked:
    /// every reader has that layout.
    fn finish(mut self) -> Result<(), Error> {
        let rows = self.columns.first().map_or(0, |column| column.values.count());
        if self.datasets.is_empty() {
            self.create(|column, dataset| numbers(dataset, &column.values.take_numbers(rows)))?;
        } else {
            self.write_rows(rows)?;
        }
        for ColumnValues { name, values, .. } in &self.columns {
            if let Values::Places(_, names) = values {
                // A wrong width would leave the dataset without a type, which is refused here.
                let fill = |dataset: &mut DatasetBuilder| drop(texts(dataset, names));
                self.file.root().create_dataset(&self.path(&format!("{name}_names")), fill)?;
            }
        }
        self.file.commit()
    }
}

/// Unit and description as attributes.
fn describe(dataset: &mut DatasetBuilder, column: &ColumnValues) {
    for (attribute, text) in [("unit", &column.unit), ("description", &column.description)] {
        if !text.is_empty() {
            dataset.set_attr(attribute, AttrValue::VarLenString(text.clone()));
        }
    }
}

/// Adds a group with a dataset for each column of a table.
fn add_table(builder: &mut FileBuilder, name: &str, columns: &[ColumnValues]) -> Result<(), FormatError> {
    let mut group = builder.create_group(name);
    for column in columns {
        let dataset = group.create_dataset(&column.name);
        match &column.values {
            Values::Numbers(all) => numbers(dataset, all),
            Values::Texts(all) => texts(dataset, all)?,
            Values::Places(all, names) => {
                texts(dataset, &all.iter().map(|place| names[*place].clone()).collect::<Vec<_>>())?
            }
        }
        describe(dataset, column);
    }
    builder.add_group(group.finish());
    Ok(())
}

fn add_set_ups(builder: &mut FileBuilder, run: &RunFolder) -> Result<(), FormatError> {
    let records = &run.manifest().set_ups;
    let mut group = builder.create_group("set_ups");
    texts(group.create_dataset("name"), &records.iter().map(|s| s.name.clone()).collect::<Vec<_>>())?;
    texts(group.create_dataset("label"), &records.iter().map(|s| s.label.clone()).collect::<Vec<_>>())?;
    let amplitudes = records.iter().map(|s| s.base_amplitude_m).collect();
    for (name, values) in [("base_amplitude_m", amplitudes)].into_iter().chain(facts::set_up_columns(records)) {
        numbers(group.create_dataset(name), &values);
    }
    builder.add_group(group.finish());
    Ok(())
}

fn numbers(dataset: &mut DatasetBuilder, values: &[f64]) {
    if values.is_empty() {
        dataset.with_dtype(make_f64_type()).with_shape(&[0]);
        return;
    }
    dataset.with_f64_data(values);
}

/// Texts of one width, that of the longest.
fn texts(dataset: &mut DatasetBuilder, values: &[String]) -> Result<(), FormatError> {
    let width = values.iter().map(String::len).max().unwrap_or(0).max(1);
    let values: Vec<&str> = values.iter().map(String::as_str).collect();
    dataset.with_strings_sized(&values, width as u32)?;
    Ok(())
}
