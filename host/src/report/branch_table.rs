//! Writes the orbits of a continuation as a table, CSV or Parquet.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, RecordBatch, UInt32Array};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;

use crate::continuation::{Found, FoundOrbit};
use crate::report::exports::atomic_file::{OutFile, to_failure, write_new};
use crate::run_folder::ReadError;
use crate::run_folder::read::columns::values;
use crate::run_folder::schema::table::field;
use crate::run_folder::write::parquet_file::properties;

/// Most multipliers of an orbit.
const MULTIPLIERS: usize = 4;

/// Parses the path of a table.
///
/// # Errors
/// Names the extensions that are supported.
pub fn path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("csv" | "parquet") => Ok(path),
        Some(other) => Err(format!("the extension .{other} is not supported; use .csv or .parquet")),
        None => Err("the file needs an extension: .csv or .parquet".into()),
    }
}

/// Writes one row for each orbit, branch after branch.
///
/// # Errors
/// Names the file that exists or cannot be written.
pub fn write(found: &Found, out: &OutFile) -> Result<usize, ReadError> {
    let failed = to_failure(&out.path);
    let batch = table(found).map_err(|e| failed(&e))?;
    let is_csv = out.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    write_new(out, |file| {
        if !is_csv {
            let schema = batch.schema();
            let file = file.as_file_mut();
            let mut writer =
                ArrowWriter::try_new(file, schema.clone(), Some(properties(&schema))).map_err(|e| failed(&e))?;
            writer.write(&batch).map_err(|e| failed(&e))?;
            return writer.close().map(drop).map_err(|e| failed(&e));
        }
        let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(file.as_file_mut());
        writer.write_record(batch.schema().fields().iter().map(|f| f.name())).map_err(|e| failed(&e))?;
        let columns: Vec<_> = batch.columns().iter().filter_map(|column| values(column.as_ref())).collect();
        for row in 0..batch.num_rows() {
            writer.write_record(columns.iter().map(|column| column[row].to_string())).map_err(|e| failed(&e))?;
        }
        writer.flush().map_err(|e| failed(&e))?;
        drop(writer);
        file.flush().map_err(|e| failed(&e))
    })?;
    Ok(batch.num_rows())
}

fn table(found: &Found) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let rows = || found.branches.iter().flat_map(|branch| branch.orbits.iter().map(move |orbit| (branch, orbit)));
    let number = |get: &dyn Fn(&FoundOrbit) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(rows().map(|(_, orbit)| get(orbit))))
    };
    let unit = found.label.rsplit_once('(').map_or("1", |(_, unit)| unit.trim_end_matches(')'));
    let mut columns: Vec<(Field, ArrayRef)> = vec![
        (
            field("branch", DataType::UInt32, "1"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(branch, _)| branch.number as u32))),
        ),
        (
            field("periods", DataType::UInt32, "1"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(branch, _)| branch.periods))),
        ),
        (field(&found.column, DataType::Float64, unit), number(&|orbit| orbit.parameter)),
        (
            field("is_stable", DataType::Boolean, ""),
            Arc::new(BooleanArray::from_iter(rows().map(|(_, orbit)| Some(orbit.is_stable)))),
        ),
        (field("peak_x_m", DataType::Float64, "m"), number(&|orbit| orbit.peak_x_m)),
        (field("mean_cycle_peak_x_m", DataType::Float64, "m"), number(&|orbit| orbit.mean_cycle_peak_x_m)),
        (field("peak_offset_m", DataType::Float64, "m"), number(&|orbit| orbit.peak_offset_m)),
        (
            field("impacts", DataType::UInt32, "1"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(_, orbit)| orbit.impacts))),
        ),
        (field("fastest_impact_m_per_s", DataType::Float64, "m/s"), number(&|orbit| orbit.fastest_impact_m_per_s)),
    ];
    for n in 0..MULTIPLIERS {
        for (part, name) in ["re", "im"].into_iter().enumerate() {
            // A structure alone has two multipliers.
            let value = number(&|orbit| orbit.multipliers.get(n).map_or(f64::NAN, |m| m[part]));
            columns.push((field(&format!("multiplier_{}_{name}", n + 1), DataType::Float64, "1"), value));
        }
    }
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = columns.into_iter().unzip();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)
}
