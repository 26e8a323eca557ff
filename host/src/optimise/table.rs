//! Writes an optimisation to a folder: the answer as JSON, and all evaluated points and the neighbourhood as Parquet tables.

use std::fs;
use std::path::Path;

use super::answer::Optimum;
use super::evaluate::Evaluated;
use super::file::Optimisation;
use super::search::SearchOutcome;
use crate::failure::Failure;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::{own_files, sealed_parquet};
use crate::simulation::fixed_parameters;
use crate::storage::create_folder;
use crate::table::{Column, TableBuilder};

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
pub fn check_folder(folder: &Path) -> Result<(), Failure> {
    let why = match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => return Ok(()),
        Ok(false) => "is not empty".to_string(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => format!("cannot be read: {error}"),
    };
    Err(Failure::Input(format!(
        "--out: {} {why}\n  give a new folder, or replace its files with --force; nothing was computed",
        folder.display()
    )))
}

/// Writes all files.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write(
    optimisation: &Optimisation,
    found: &SearchOutcome,
    answer: &Optimum,
    folder: &Path,
) -> Result<(), Failure> {
    create_folder(folder)?;
    let stages: Vec<&str> = found.points.iter().map(|(stage, _)| stage.name()).collect();
    let points: Vec<&Evaluated> = found.points.iter().map(|(_, point)| point).collect();
    write_table(optimisation, Some(&stages), &points, &folder.join(EVALUATIONS))?;
    let neighbourhood = folder.join(NEIGHBOURHOOD);
    if answer.neighbourhood.is_empty() {
        // One of an earlier answer, which this one replaces.
        own_files::remove(&neighbourhood)?;
    } else {
        let points: Vec<&Evaluated> = answer.neighbourhood.iter().collect();
        write_table(optimisation, None, &points, &neighbourhood)?;
    }
    let path = folder.join(ANSWER);
    let text = serde_json::to_vec_pretty(answer).map_err(|error| Failure::cannot("write", &path, error))?;
    own_files::replace(&path, &text)
}

fn write_table(
    optimisation: &Optimisation,
    stages: Option<&[&str]>,
    points: &[&Evaluated],
    path: &Path,
) -> Result<(), Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::cannot("write", path, error);
    let rows: Vec<(usize, &Evaluated)> = points.iter().copied().enumerate().collect();
    let some = |value: f64| Some(value).filter(|value| !value.is_nan());
    let mut table = TableBuilder::new(&rows);
    if let Some(stages) = stages {
        let stage =
            Column::new("stage", "", "part of the search: all (that can be made), gradient, sobol, swarm, nelder_mead");
        table = table.column(stage, |(place, _)| stages[*place]);
    }
    for (variable, axis) in optimisation.variable_axes().iter().enumerate() {
        let unit = if axis.unit().is_empty() { "1" } else { axis.unit() };
        let column = Column::new(axis.key.as_str(), unit, "variable of the optimisation");
        table = table.column(column, move |(_, point)| some(point.values[variable]));
    }
    let metric = optimisation.objective;
    let objective = Column::new(metric.name(), metric.unit(), format!("objective: {}", metric.definition()));
    table = table.column(objective, |(_, point)| some(point.objective));
    for (place, constraint) in optimisation.constraints.iter().enumerate() {
        let (metric, limit) = (constraint.metric, constraint.limit.words(|limit| format!("{limit}")));
        let meaning = format!("constraint, {limit}: {}", metric.definition());
        let column = Column::new(format!("constraint_{}", metric.name()), metric.unit(), meaning);
        table = table.column(column, move |(_, point)| some(point.constraints[place]));
    }
    let scenarios = "scenarios of tolerances and uncertain values behind the objective; 1 at the nominal values alone";
    let violation = "sum of the violations of the constraints as shares of their limits";
    let unresolved = "how often too many events fell on one instant";
    if optimisation.is_robust() {
        table =
            table.column(Column::new("scenarios", "1", scenarios), |(_, point)| point.scenarios(optimisation) as u32);
    }
    let table = table
        .column(Column::new("violation", "1", violation), |(_, point)| some(point.violation))
        .column(Column::new("unresolved", "1", unresolved), |(_, point)| some(point.unresolved));
    let keys: Vec<&str> = optimisation.axes.iter().map(|axis| axis.key.as_str()).collect();
    let row =
        if stages.is_some() { "a row for each evaluated point" } else { "a row for each point around the optimum" };
    let about = of_file(row)
        .with("damprig.name", optimisation.name.as_str())
        .with("damprig.optimisation", optimisation.text.as_str())
        .with("damprig.case", optimisation.case_text.as_str())
        .with("damprig.fixed", fixed_parameters(&optimisation.case_text, &keys));
    let batch = table.finish(about).map_err(|error| failed(&error))?;
    let bytes = sealed_parquet::bytes(&batch).map_err(|error| failed(&error))?;
    own_files::replace(path, &bytes)
}
