//! Tables of a continuation, CSV or Parquet: a row for each orbit of the branches, and a row for each point of the curves.

use std::io::Write;
use std::path::PathBuf;

use arrow_array::RecordBatch;

use crate::continuation::FoundBranches;
use crate::failure::Failure;
use crate::input::key::KeyUnit;
use crate::quantity::Quantity;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet::{self, IDENTITY};
use crate::simulation::fixed_parameters;
use crate::storage::out_file::{OutFile, to_failure, write_new};
use crate::table::csv::{CsvTable, Heads};
use crate::table::{Column, TableBuilder};

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
pub fn write(batch: &RecordBatch, out: &OutFile) -> Result<usize, Failure> {
    let failed = to_failure(&out.path);
    let is_csv = out.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    write_new(out, |file| {
        if !is_csv {
            let bytes = sealed_parquet::bytes(batch).map_err(|e| failed(&e))?;
            return file.write_all(&bytes).map_err(|e| failed(&e));
        }
        let written = CsvTable::new(file, &batch.schema(), Heads::Names)
            .and_then(|mut table| table.write(batch).and_then(|()| table.finish().map(drop)));
        written.map_err(|e| failed(&e))
    })?;
    Ok(batch.num_rows())
}

/// The column of a parameter: its unit, and its key in a case.
fn column_of(key: &str) -> Column {
    let unit = KeyUnit::of(key).map(|unit| unit.symbol).filter(|symbol| !symbol.is_empty());
    Column::new(key.replace('.', "_"), unit.unwrap_or("1"), "parameter of the case").with("key", key)
}

/// A row for each point of the curves in two parameters, curve after curve; no rows without a second parameter.
///
/// # Errors
/// The table library's error.
pub fn curves(found: &FoundBranches) -> Result<RecordBatch, Failure> {
    let numbered = (1u32..).zip(&found.curves);
    let rows: Vec<_> =
        numbered.flat_map(|(number, curve)| curve.points.iter().map(move |point| (number, curve, point))).collect();
    let mut table = TableBuilder::new(&rows)
        .column(Column::new("curve", "1", "number of the curve, from 1"), |(number, _, _)| *number)
        .column(Column::new("branch", "1", "number of the branch"), |(_, curve, _)| curve.branch as u32)
        .column(Column::new("kind", "", "kind of the special point that the curve follows"), |(_, curve, _)| {
            curve.kind.to_string()
        });
    let both = found.second_parameter.iter().flat_map(|second| [&found.parameter, second]);
    for (place, parameter) in both.enumerate() {
        table = table.column(column_of(parameter), |(_, _, point)| point[place]);
    }
    let table = table
        .column(Quantity::MaxAbsXM, |(_, _, point)| point[2])
        .column(Column::new("meaning", "", "what that point means"), |(_, curve, _)| curve.meaning.clone());
    finish(found, "a row for each point of the curves", table)
}

/// A row for each orbit, branch after branch.
///
/// # Errors
/// The table library's error.
pub fn orbits(found: &FoundBranches) -> Result<RecordBatch, Failure> {
    let branches = found.branches.iter();
    let rows: Vec<_> = branches.flat_map(|branch| branch.orbits.iter().map(move |orbit| (branch, orbit))).collect();
    let is_stable = Column::new("is_stable", "", "whether neighbouring motions return to the orbit");
    let periods = Column::new("periods", "1", "periods of the drive in a period of the orbit");
    let mut table = TableBuilder::new(&rows)
        .column(Column::new("branch", "1", "number of the branch"), |(branch, _)| branch.number as u32)
        .column(periods, |(branch, _)| branch.periods)
        .column(column_of(&found.parameter), |(_, orbit)| orbit.parameter)
        .column(is_stable, |(_, orbit)| orbit.is_stable)
        .column(Quantity::MaxAbsXM, |(_, orbit)| orbit.max_abs_x_m)
        .column(Quantity::MeanCycleMaxM, |(_, orbit)| orbit.mean_cycle_max_m)
        .column(Quantity::MaxAbsYMinusXM, |(_, orbit)| orbit.max_abs_y_minus_x_m)
        .column(Quantity::Impacts, |(_, orbit)| orbit.impacts)
        .column(Quantity::FastestImpactMPerS, |(_, orbit)| orbit.fastest_impact_m_per_s);
    for n in 0..MULTIPLIERS {
        for (part, name) in ["re", "im"].into_iter().enumerate() {
            let multiplier = Column::new(format!("multiplier_{}_{name}", n + 1), "1", "Floquet multiplier");
            // A structure alone has two.
            table = table.column(multiplier, |(_, orbit)| orbit.multipliers.get(n).map_or(f64::NAN, |m| m[part]));
        }
    }
    finish(found, "a row for each orbit", table)
}

/// A table that says what it is: case, parameters that do not vary, and identity.
fn finish<R>(found: &FoundBranches, row: &str, table: TableBuilder<R>) -> Result<RecordBatch, Failure> {
    let varied: Vec<&str> = [&found.parameter].into_iter().chain(&found.second_parameter).map(String::as_str).collect();
    let about = of_file(row)
        .with("damprig.name", found.case.as_str())
        .with("damprig.case", found.case_text.as_str())
        .with("damprig.fixed", fixed_parameters(&found.case_text, &varied));
    Ok(sealed_parquet::identified(&table.finish(about)?)?.0)
}

/// The identity of a table, which its figure states too.
#[must_use]
pub fn identity(table: &RecordBatch) -> String {
    table.schema().metadata().get(IDENTITY).cloned().unwrap_or_default()
}
