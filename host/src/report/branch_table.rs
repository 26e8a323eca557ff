//! Tables of a continuation, CSV or Parquet: a row for each orbit of the branches, and a row for each point of the curves.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray, UInt32Array};
use arrow_schema::{ArrowError, DataType, Field, Schema};

use crate::continuation::parameters::ParameterKey;
use crate::continuation::{Found, FoundOrbit};
use crate::report::exports::atomic_file::{OutFile, to_failure, write_new};
use crate::run_folder::ReadError;
use crate::run_folder::read::columns::values;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::schema::table::{described, field};
use crate::run_folder::sealed_parquet::{self, IDENTITY};
use crate::simulation::fixed_parameters;

/// Most multipliers of an orbit.
const MULTIPLIERS: usize = 4;

/// Parses the place of the results: a table, or a folder.
///
/// # Errors
/// Names the extensions that are supported.
pub fn place(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        None | Some("csv" | "parquet") => Ok(path),
        Some(other) => {
            let why = format!("the extension .{other} is not supported");
            Err(format!("{why}; use .csv or .parquet for the orbits, or the name of a folder for everything"))
        }
    }
}

/// Writes a table, as CSV if the file's name ends so, else as Parquet. Returns the number of its rows.
///
/// # Errors
/// Names the file that exists or cannot be written.
pub fn write(table: Result<RecordBatch, ArrowError>, out: &OutFile) -> Result<usize, ReadError> {
    let failed = to_failure(&out.path);
    let batch = table.map_err(|e| failed(&e))?;
    let is_csv = out.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    write_new(out, |file| {
        if !is_csv {
            let bytes = sealed_parquet::bytes(&batch).map_err(|e| failed(&e))?;
            return file.write_all(&bytes).map_err(|e| failed(&e));
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

/// The column of a parameter: its unit, and its key in a case.
fn parameter_field(parameter: &ParameterKey) -> Field {
    let mut field = described(field(&parameter.column(), DataType::Float64, parameter.unit()), "parameter of the case");
    let mut metadata = field.metadata().clone();
    metadata.insert("key", parameter.key);
    field.set_metadata(metadata);
    field
}

/// A row for each point of the curves in two parameters, curve after curve; no rows without a second parameter.
///
/// # Errors
/// The table library's error.
pub fn curves(found: &Found) -> Result<RecordBatch, ArrowError> {
    let numbered = || (1u32..).zip(&found.curves);
    let rows = || numbered().flat_map(|(number, curve)| curve.points.iter().map(move |point| (number, curve, point)));
    let number = |place: usize| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(rows().map(|(_, _, point)| point[place])))
    };
    let text = |values: Vec<String>| -> ArrayRef { Arc::new(StringArray::from(values)) };
    let mut columns: Vec<(Field, ArrayRef)> = vec![
        (
            described(field("curve", DataType::UInt32, "1"), "number of the curve, from 1"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(number, _, _)| number))),
        ),
        (
            described(field("branch", DataType::UInt32, "1"), "number of the branch"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(_, curve, _)| curve.branch as u32))),
        ),
        (
            described(field("kind", DataType::Utf8, ""), "kind of the special point that the curve follows"),
            text(rows().map(|(_, curve, _)| curve.kind.to_string()).collect()),
        ),
    ];
    for (place, parameter) in found.curve_parameters.iter().flatten().enumerate() {
        columns.push((parameter_field(parameter), number(place)));
    }
    columns.push((described(field("peak_x_m", DataType::Float64, "m"), "largest |x|"), number(2)));
    columns.push((
        described(field("meaning", DataType::Utf8, ""), "what that point means"),
        text(rows().map(|(_, curve, _)| curve.meaning.clone()).collect()),
    ));
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = columns.into_iter().unzip();
    table(found, "a row for each point of the curves", fields, arrays)
}

/// A row for each orbit, branch after branch.
///
/// # Errors
/// The table library's error.
pub fn orbits(found: &Found) -> Result<RecordBatch, ArrowError> {
    let rows = || found.branches.iter().flat_map(|branch| branch.orbits.iter().map(move |orbit| (branch, orbit)));
    let number = |get: &dyn Fn(&FoundOrbit) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(rows().map(|(_, orbit)| get(orbit))))
    };
    let mut columns: Vec<(Field, ArrayRef)> = vec![
        (
            described(field("branch", DataType::UInt32, "1"), "number of the branch"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(branch, _)| branch.number as u32))),
        ),
        (
            described(field("periods", DataType::UInt32, "1"), "periods of the drive in a period of the orbit"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(branch, _)| branch.periods))),
        ),
        (parameter_field(&found.key), number(&|orbit| orbit.parameter)),
        (
            described(field("is_stable", DataType::Boolean, ""), "whether neighbouring motions return to the orbit"),
            Arc::new(BooleanArray::from_iter(rows().map(|(_, orbit)| Some(orbit.is_stable)))),
        ),
        (described(field("peak_x_m", DataType::Float64, "m"), "largest |x|"), number(&|orbit| orbit.peak_x_m)),
        (
            described(
                field("mean_cycle_peak_x_m", DataType::Float64, "m"),
                "mean over the cycles of their largest |x|",
            ),
            number(&|orbit| orbit.mean_cycle_peak_x_m),
        ),
        (
            described(field("peak_offset_m", DataType::Float64, "m"), "largest |y - x|"),
            number(&|orbit| orbit.peak_offset_m),
        ),
        (
            described(field("impacts", DataType::UInt32, "1"), "impacts in a period of the orbit"),
            Arc::new(UInt32Array::from_iter_values(rows().map(|(_, orbit)| orbit.impacts))),
        ),
        (
            described(field("fastest_impact_m_per_s", DataType::Float64, "m/s"), "largest approach speed of an impact"),
            number(&|orbit| orbit.fastest_impact_m_per_s),
        ),
    ];
    for n in 0..MULTIPLIERS {
        for (part, name) in ["re", "im"].into_iter().enumerate() {
            // A structure alone has two multipliers.
            let value = number(&|orbit| orbit.multipliers.get(n).map_or(f64::NAN, |m| m[part]));
            columns.push((
                described(field(&format!("multiplier_{}_{name}", n + 1), DataType::Float64, "1"), "Floquet multiplier"),
                value,
            ));
        }
    }
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = columns.into_iter().unzip();
    table(found, "a row for each orbit", fields, arrays)
}

/// A table that says what it is: case, parameters that do not vary, and identity.
fn table(found: &Found, row: &str, fields: Vec<Field>, arrays: Vec<ArrayRef>) -> Result<RecordBatch, ArrowError> {
    let varied: Vec<&str> = [found.parameter].into_iter().chain(found.second_parameter).collect();
    let about = of_file(row)
        .with("damprig.name", found.case.as_str())
        .with("damprig.case", found.case_text.as_str())
        .with("damprig.fixed", fixed_parameters(&found.case_text, &varied));
    let table = RecordBatch::try_new(Arc::new(Schema::new_with_metadata(fields, about)), arrays)?;
    Ok(sealed_parquet::identified(&table)?.0)
}

/// The identity of a table, which its figure states too.
#[must_use]
pub fn identity(table: &RecordBatch) -> String {
    table.schema().metadata().get(IDENTITY).cloned().unwrap_or_default()
}
