//! Exports to HDF5, readable by h5py, MATLAB's `h5read`, Julia and Octave.
//!
//! The root's attributes are the facts of the run. A group per table (`results`, `samples` and, if the run has any, `transients`
//! and `impacts`) has a dataset per column: numbers as doubles, names as UTF-8 texts, with the attributes `unit` and
//! `description`. In `samples` and `impacts` the datasets `set_up` and `experiment` are indices, from 0, into `set_up_names` and
//! `experiment_names` beside them. The group `set_ups` has the set-ups' names, labels, base amplitudes and parameters.

use std::io::Write;

use hdf5_pure::{AttrValue, DatasetBuilder, FileBuilder, FormatError, make_f64_type};

use super::atomic_file::{OutFile, to_failure, write_export};
use super::columns::{self, Column, Values};
use super::facts::{self, Fact};
use super::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::run_folder::{ReadError, RunFolder};

/// Numbers that are compressed together.
const CHUNK: usize = 1 << 16;

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

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, ReadError> {
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
            for (table, columns) in columns::tables(run, part, &mut exported).map_err(|e| failed(&e))? {
                add_table(&mut builder, table.name(), &columns).map_err(|e| failed(&e))?;
            }
            let bytes = builder.finish().map_err(|e| failed(&e))?;
            file.write_all(&bytes).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// Adds a group with a dataset for each column of a table, and for the names that its places refer to.
fn add_table(builder: &mut FileBuilder, name: &str, columns: &[Column]) -> Result<(), FormatError> {
    let mut group = builder.create_group(name);
    for Column { name, unit, description, values } in columns {
        let dataset = group.create_dataset(name);
        match values {
            Values::Numbers(all) => numbers(dataset, all),
            Values::Texts(all) => texts(dataset, all)?,
            Values::Places(all, _) => numbers(dataset, &all.iter().map(|place| *place as f64).collect::<Vec<_>>()),
        }
        for (attribute, text) in [("unit", unit), ("description", description)] {
            if !text.is_empty() {
                dataset.set_attr(attribute, AttrValue::VarLenString(text.clone()));
            }
        }
        if let Values::Places(_, names) = values {
            texts(group.create_dataset(&format!("{name}_names")), names)?;
        }
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
    if values.len() > CHUNK {
        dataset.with_chunks(&[CHUNK as u64]).with_shuffle().with_deflate(4);
    }
}

/// Texts of one width, that of the longest.
fn texts(dataset: &mut DatasetBuilder, values: &[String]) -> Result<(), FormatError> {
    let width = values.iter().map(String::len).max().unwrap_or(0).max(1);
    let values: Vec<&str> = values.iter().map(String::as_str).collect();
    dataset.with_strings_sized(&values, width as u32)?;
    Ok(())
}
