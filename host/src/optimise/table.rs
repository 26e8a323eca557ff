//! Writes an optimisation to a folder: the answer as JSON, and all evaluated points and the neighbourhood as Parquet tables.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Schema, SchemaRef};

use super::answer::Answer;
use super::evaluate::Evaluated;
use super::file::Optimisation;
use super::search::Found;
use crate::input::Refusal;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::schema::table::{self, described};
use crate::run_folder::{StorageError, own_files, sealed_parquet};
use crate::simulation::fixed_parameters;

/// File with the answer.
pub const ANSWER: &str = "answer.json";

/// Table of all points that the search evaluated.
pub const EVALUATIONS: &str = "evaluations.parquet";

/// Table of the points around the optimum.
pub const NEIGHBOURHOOD: &str = "neighbourhood.parquet";

/// Refuses a folder that has files already, before anything is computed.
///
/// # Errors
/// Names the folder.
pub fn check_folder(folder: &Path) -> Result<(), Refusal> {
    let why = match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => return Ok(()),
        Ok(false) => "is not empty".to_string(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => format!("cannot be read: {error}"),
    };
    Err(Refusal(format!("--out: {} {why}\n  give a new folder; nothing was computed", folder.display())))
}

/// Writes all files.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write(optimisation: &Optimisation, found: &Found, answer: &Answer, folder: &Path) -> Result<(), StorageError> {
    fs::create_dir_all(folder).map_err(|error| StorageError::new("create", folder, error))?;
    let stages: Vec<&str> = found.points.iter().map(|(stage, _)| stage.name()).collect();
    let points: Vec<&Evaluated> = found.points.iter().map(|(_, point)| point).collect();
    write_table(optimisation, Some(&stages), &points, &folder.join(EVALUATIONS))?;
    if !answer.neighbourhood.is_empty() {
        let points: Vec<&Evaluated> = answer.neighbourhood.iter().collect();
        write_table(optimisation, None, &points, &folder.join(NEIGHBOURHOOD))?;
    }
    let path = folder.join(ANSWER);
    let text = serde_json::to_vec_pretty(answer).map_err(|error| StorageError::new("write", &path, error))?;
    own_files::replace(&path, &text)
}

fn write_table(
    optimisation: &Optimisation,
    stages: Option<&[&str]>,
    points: &[&Evaluated],
    path: &Path,
) -> Result<(), StorageError> {
    let failed = |error: &dyn std::fmt::Display| StorageError::new("write", path, error);
    let schema = schema(optimisation, stages.is_some());
    let mut arrays: Vec<ArrayRef> = Vec::new();
    if let Some(stages) = stages {
        arrays.push(Arc::new(StringArray::from_iter_values(stages)));
    }
    let mut column = |value: &dyn Fn(&Evaluated) -> f64| {
        let values = points.iter().map(|point| Some(value(point)).filter(|value| !value.is_nan()));
        arrays.push(Arc::new(values.collect::<Float64Array>()));
    };
    for variable in 0..optimisation.variables {
        column(&|point| point.values[variable]);
    }
    column(&|point| point.objective);
    for constraint in 0..optimisation.constraints.len() {
        column(&|point| point.constraints[constraint]);
    }
    column(&|point| point.violation);
    column(&|point| point.unresolved);
    let batch = RecordBatch::try_new(schema, arrays).map_err(|error| failed(&error))?;
    let bytes = sealed_parquet::bytes(&batch).map_err(|error| failed(&error))?;
    own_files::replace(path, &bytes)
}

fn schema(optimisation: &Optimisation, has_stage: bool) -> SchemaRef {
    let field = |name: &str, kind: DataType, unit: &str, doc: &str| {
        let unit = if unit.is_empty() && kind == DataType::Float64 { "1" } else { unit };
        described(table::field(name, kind, unit).with_nullable(true), doc)
    };
    let number = |name: &str, unit: &str, doc: &str| field(name, DataType::Float64, unit, doc);
    let mut fields = Vec::new();
    if has_stage {
        fields.push(field("stage", DataType::Utf8, "", "part of the search: sobol, swarm, nelder_mead"));
    }
    let variables = optimisation.variables().iter();
    fields.extend(variables.map(|axis| number(&axis.key, axis.unit(), "variable of the optimisation")));
    let metric = optimisation.objective;
    fields.push(number(metric.name(), metric.unit(), &format!("objective: {}", metric.doc())));
    for constraint in &optimisation.constraints {
        let (name, limit) = (constraint.metric.name(), constraint.limit.words(|limit| format!("{limit}")));
        let doc = format!("constraint, {limit}: {}", constraint.metric.doc());
        fields.push(number(&format!("constraint_{name}"), constraint.metric.unit(), &doc));
    }
    fields.push(number("violation", "", "sum of the violations of the constraints as shares of their limits"));
    fields.push(number("unresolved", "", "how often too many events fell on one instant"));
    let keys: Vec<&str> = optimisation.axes.iter().map(|axis| axis.key.as_str()).collect();
    let row = if has_stage { "a row for each evaluated point" } else { "a row for each point around the optimum" };
    let mut about = of_file(row);
    about.insert("damprig.name", optimisation.name.as_str());
    about.insert("damprig.optimisation", optimisation.text.as_str());
    about.insert("damprig.case", optimisation.case_text.as_str());
    about.insert("damprig.fixed", fixed_parameters(&optimisation.case_text, &keys));
    Arc::new(Schema::new_with_metadata(fields, about))
}
