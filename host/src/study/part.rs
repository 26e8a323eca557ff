//! A part of a study's table: its columns, its file, and the check of what is read back.

use std::ops::Range;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use arrow_select::concat::concat_batches;
use bytes::Bytes;

use super::axis::{AxisValue, AxisValues};
use super::data_set::StudyManifest;
use super::evaluate::{ComputedColumn, columns};
use super::file::Study;
use crate::failure::Failure;
use crate::run_folder::read::parquet_file;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet::{self, IDENTITY};
use crate::simulation::fixed_parameters;
use crate::table;

/// Column with the number of a row.
pub const ROW: &str = "row";

/// Key of the program's build in the metadata of a part.
const BUILD: &str = "damprig.build";

/// A part that has been read.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its rows.
    pub batch: RecordBatch,
    /// It has a digest; one of an older version has none.
    pub has_digest: bool,
}

/// Columns: number of the row, axes, results; each with its unit and its meaning.
#[must_use]
pub fn schema(study: &Study, manifest: &StudyManifest) -> SchemaRef {
    let field = |name: &str, kind: DataType, unit: &str, doc: &str, is_missing: bool| {
        table::Column::new(name, unit, doc).field(kind).with_nullable(is_missing)
    };
    let mut fields = vec![field(ROW, DataType::UInt64, "1", "number of the row, from 0", false)];
    for &place in study.points.kept() {
        let axis = &study.axes[place];
        let (kind, unit) = match &axis.values {
            AxisValues::Words(_) => (DataType::Utf8, ""),
            _ => (DataType::Float64, plain(axis.unit())),
        };
        fields.push(field(&axis.key, kind, unit, &format!("axis of the study: the case's key {}", axis.key), false));
    }
    for ComputedColumn { name, unit, doc } in columns(study) {
        fields.push(field(&name, DataType::Float64, plain(unit), &doc, true));
    }
    let mut about = of_file("a row for each point of the study");
    about.insert(IDENTITY, manifest.identity.as_str());
    about.insert("damprig.revision", manifest.revision.as_deref().unwrap_or_default());
    about.insert(BUILD, manifest.build.as_deref().unwrap_or_default());
    about.insert("damprig.name", manifest.name.as_str());
    about.insert("damprig.study", manifest.study.as_str());
    about.insert("damprig.case", manifest.case.as_str());
    about.insert("damprig.fixed", fixed(study));
    sealed_parquet::schema(&Schema::new_with_metadata(fields, about))
}

/// The keys of the case that no axis changes, with their values, as JSON.
fn fixed(study: &Study) -> String {
    let keys: Vec<&str> = study.axes.iter().map(|axis| axis.key.as_str()).collect();
    fixed_parameters(&study.case_text, &keys)
}

fn plain(unit: &str) -> &str {
    if unit.is_empty() { "1" } else { unit }
}

/// Rows from `first` on as a record batch; what is not a number is missing.
pub(super) fn batch(
    study: &Study,
    schema: &SchemaRef,
    first: u64,
    rows: &[Vec<f64>],
) -> Result<RecordBatch, ArrowError> {
    let mut arrays = planned(study, &(first..first + rows.len() as u64));
    for column in 0..columns(study).len() {
        let value = |row: &Vec<f64>| Some(row[column]).filter(|value| !value.is_nan());
        arrays.push(Arc::new(rows.iter().map(value).collect::<Float64Array>()));
    }
    RecordBatch::try_new(schema.clone(), arrays)
}

/// The columns that follow from the study alone: numbers of the rows, and the axes.
fn planned(study: &Study, rows: &Range<u64>) -> Vec<ArrayRef> {
    let axes: Vec<Vec<AxisValue>> = rows.clone().map(|row| study.points.values(&study.axes, row, 0)).collect();
    let mut arrays: Vec<ArrayRef> = vec![Arc::new(UInt64Array::from_iter_values(rows.clone()))];
    for &place in study.points.kept() {
        let number =
            |values: &Vec<AxisValue>| if let AxisValue::Number(number) = values[place] { number } else { f64::NAN };
        let word = |values: &Vec<AxisValue>| {
            if let AxisValue::Word(word) = &values[place] { word.clone() } else { String::new() }
        };
        arrays.push(match &study.axes[place].values {
            AxisValues::Words(_) => Arc::new(StringArray::from_iter_values(axes.iter().map(word))),
            _ => Arc::new(Float64Array::from_iter_values(axes.iter().map(number))),
        });
    }
    arrays
}

/// Reads a part with these rows; `shown` names its file.
///
/// # Errors
/// A file that is no Parquet, is cut short, has changed since it was written, belongs to another study, or has other columns or points.
pub(super) fn read(
    study: &Study,
    manifest: &StudyManifest,
    rows: &Range<u64>,
    (shown, bytes): (&str, Bytes),
) -> Result<Part, Failure> {
    let wrong = |what: &dyn std::fmt::Display| Failure::Storage(format!("{shown}: {what}"));
    let content = parquet_file::content(shown, bytes)?;
    if content.metadata.get(IDENTITY) != Some(&manifest.identity) {
        return Err(wrong(&"belongs to another study or another version of it"));
    }
    let built = content.metadata.get(BUILD).filter(|build| !build.is_empty());
    if let Some((there, now)) = built.zip(manifest.build.as_ref()).filter(|(there, now)| there != now) {
        return Err(wrong(&format!("was written by another build of damprig, {there}, and the study by {now}")));
    }
    let there = content.batches.first().map(RecordBatch::schema).ok_or_else(|| wrong(&"has no rows"))?;
    let schema = schema(study, manifest);
    if let Some(difference) = difference(&there, &schema) {
        return Err(wrong(&difference));
    }
    let batch = concat_batches(&there, &content.batches).map_err(|error| wrong(&error))?;
    for (place, planned) in planned(study, rows).iter().enumerate() {
        let column = batch.column(place);
        if column.as_ref() == planned.as_ref() {
            continue;
        }
        if place == 0 {
            return Err(wrong(&format!("does not have the rows {} to {} in this order", rows.start, rows.end - 1)));
        }
        let row = (0..planned.len()).find(|row| column.slice(*row, 1) != planned.slice(*row, 1)).unwrap_or(0);
        let (name, number) = (schema.field(place).name(), rows.start + row as u64);
        let [has, should] = [column, planned].map(|column| value_text(column.as_ref(), row));
        return Err(wrong(&format!("row {number} has {name} = {has}, and the study {should}")));
    }
    // Read back, a batch has lost the metadata of the file.
    let batch = RecordBatch::try_new(schema, batch.columns().to_vec()).map_err(|error| wrong(&error))?;
    Ok(Part { batch, has_digest: content.has_digest })
}

/// The first difference in number, name, type or unit of the columns.
fn difference(there: &Schema, study: &Schema) -> Option<String> {
    let unit = |field: &Field| field.metadata().get("unit").cloned().unwrap_or_default();
    for (place, wanted) in study.fields().iter().enumerate() {
        let Some(field) = there.fields().get(place) else {
            return Some(format!("has no column {}", wanted.name()));
        };
        let name = wanted.name();
        if field.name() != name {
            return Some(format!("its column {} is {}, and that of the study {name}", place + 1, field.name()));
        }
        if field.data_type() != wanted.data_type() {
            let (has, wanted) = (field.data_type(), wanted.data_type());
            return Some(format!("its column {name} has the type {has}, and that of the study {wanted}"));
        }
        if unit(field) != unit(wanted) {
            return Some(format!(
                "its column {name} has the unit {:?}, and that of the study {:?}",
                unit(field),
                unit(wanted)
            ));
        }
    }
    let more = there.fields().get(study.fields().len());
    more.map(|field| format!("its column {} is none of the study", field.name()))
}

/// The value of an axis in a row.
fn value_text(column: &dyn Array, row: usize) -> String {
    if column.is_null(row) {
        return "no value".into();
    }
    let number = column.as_primitive_opt::<Float64Type>().map(|numbers| format!("{:?}", numbers.value(row)));
    let word = || column.as_string_opt::<i32>().map(|words| format!("{:?}", words.value(row)));
    number.or_else(word).unwrap_or_default()
}
