//! What `damprig study run` and `merge` end with: the best point, the figures and the page.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use serde::Serialize;
use serde_json::{Value as Json, json};

use super::arguments::JsonArg;
use super::output::print_place;
use crate::failure::{Failure, Outcome};
use crate::report::documents;
use crate::report::numbers::duration;
use crate::report::study_files::{self, MAX_DRAWN};
use crate::study::axis::AxisValue;
use crate::study::data_set::{DataSet, TABLE};
use crate::study::run::{self, StudyProgress};
use crate::study::sensitivity::SensitivityIndices;
use crate::study::{Study, evaluate};

/// Says that parts are of an older version.
pub(super) fn without_digest(parts: u64) -> String {
    let have = if parts == 1 { "part has" } else { "parts have" };
    format!("{parts} {have} no digest; written by an older version, so that a changed result in them is not noticed")
}

/// What `--json` prints.
#[derive(Serialize)]
struct StudyJson<'a> {
    name: &'a str,
    rows: u64,
    table: &'a Path,
    best: Option<Best>,
    sensitivity: Vec<SensitivityIndices>,
}

/// The best point.
#[derive(Serialize)]
struct Best {
    row: u64,
    column: String,
    value: f64,
    at: BTreeMap<String, Json>,
}

impl Best {
    fn of(study: &Study, (row, value): (u64, f64)) -> Self {
        let values = study.points.values(&study.axes, row, 0);
        let json = |value: &AxisValue| match value {
            AxisValue::Number(number) => json!(number),
            AxisValue::Word(word) => json!(word),
        };
        let kept = study.points.kept().iter();
        let at = kept.map(|place| (study.axes[*place].key.clone(), json(&values[*place]))).collect();
        Self { row, column: evaluate::main_column(study, study.objective), value, at }
    }
}

/// Draws the table beside itself and makes the page; prints where it is, with --quiet too, how long it took since `start`, which point is best and
/// sensitivity indices; or all of it as JSON.
pub(super) fn say_result(
    study: &Study,
    data_set: &DataSet,
    progress: &StudyProgress,
    (table, start): (&Path, Instant),
    json: JsonArg,
) -> Outcome {
    let scope = documents::study::scope(study, run::cycles(study));
    let took = duration(start.elapsed().as_secs_f64());
    if !json.is_given() {
        print_place(&format!("Table: {} ({} rows, {took})", table.display(), study.rows()));
    }
    if progress.best.is_none() {
        let column = evaluate::main_column(study, study.objective);
        warn!("warning: no point has a value of {column}");
    }
    if progress.unresolved > 0 {
        let points = if progress.unresolved == 1 { "point has" } else { "points have" };
        warn!(
            "warning: {} {points} instants with too many events, which were not resolved (column unresolved)",
            progress.unresolved
        );
    }
    let parts = progress.without_digest;
    if parts > 0 {
        warn!("warning: {}", without_digest(parts));
    }
    let drawn = study_files::write(study, data_set, progress.best, &scope);
    let complete = |error: &dyn std::fmt::Display| {
        let (table, again) = (data_set.store().path(TABLE), "`damprig study merge` draws it again");
        Failure::Failed(format!("{error}\n  {} is complete; {again}", table.display()))
    };
    let drawn = drawn.map_err(|error| complete(&error))?;
    match &drawn {
        None => warn!(
            "warning: a table of more than {MAX_DRAWN} rows is not drawn, and no sensitivity indices are computed of it"
        ),
        Some(drawn) => drawn.undrawn.iter().for_each(|(stem, error)| warn!("warning: {stem}: {error}")),
    }
    let (page, sensitivity) = drawn.map(|drawn| (drawn.page, drawn.sensitivity)).unzip();
    let sensitivity = sensitivity.unwrap_or_default();
    let found = documents::study::found(study, progress.best, &sensitivity);
    let best = progress.best.map(|best| Best::of(study, best));
    json.print(&StudyJson { name: &study.name, rows: study.rows(), table, best, sensitivity })?;
    if !found.is_empty() {
        say!("{found}");
    }
    if let Some(page) = page {
        say!("Page:  {}", page.display());
    }
    Ok(())
}
