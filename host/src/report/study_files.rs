//! Draws the table of a complete study beside itself and makes its page.

use std::path::PathBuf;

use crate::continuation::FoundBranches;
use crate::failure::Failure;
use crate::report::documents;
use crate::report::figures::sensitivity as indices;
use crate::report::figures::study::{self, StudyFigure};
use crate::report::page;
use crate::report::plot;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet::{self, IDENTITY};
use crate::study::Study;
use crate::study::data_set::{DataSet, TABLE};
use crate::study::sensitivity::{SensitivityIndex, SensitivityIndices};
use crate::study::sums::Sums;
use crate::study::table::StudyTable;
use crate::table::{Column, TableBuilder};

/// Name of the page.
pub const PAGE: &str = "study.html";

/// Name of the table of sensitivity indices.
pub const SENSITIVITY: &str = "sensitivity.parquet";

/// Rows of a table that is drawn at most: it is read whole.
pub const MAX_DRAWN: u64 = 2_000_000;

/// What was drawn.
#[derive(Debug)]
pub struct DrawnFiles {
    /// Where the page is.
    pub page: PathBuf,
    /// Sensitivity indices, of a study that has them.
    pub sensitivity: Vec<SensitivityIndices>,
    /// Names of the figures that could not be drawn, files of curves that are not on the map, and why.
    pub undrawn: Vec<(String, String)>,
}

/// Reads the table, writes its figures and the page beside it. `best`: row and value of the best point; `scope`: what the page says first. `None`
/// for a table of more than [`MAX_DRAWN`] rows.
///
/// # Errors
/// A table that is missing or damaged, a file that cannot be written.
pub fn write(
    study: &Study,
    data_set: &DataSet,
    best: Option<(u64, f64)>,
    scope: &str,
) -> Result<Option<DrawnFiles>, Failure> {
    if study.rows() > MAX_DRAWN {
        return Ok(None);
    }
    let store = data_set.store();
    let shown = store.path(TABLE).display().to_string();
    let bytes = store.get(TABLE)?.ok_or_else(|| Failure::Storage(format!("{shown} is missing")))?;
    let table = StudyTable::read(&shown, bytes)?;
    let (overlays, mut undrawn) = overlays(study);
    let sensitivity = SensitivityIndices::of(study, &table);
    let identity = &data_set.manifest().identity;
    let source = plot::source("study", identity);
    let figures: Vec<StudyFigure> = study::draw(study, &table, best.map(|(row, _)| row), &overlays)
        .into_iter()
        .chain(sensitivity.iter().filter_map(|of_metric| indices::draw(study, of_metric)))
        .map(|figure| StudyFigure { picture: figure.picture.map(|drawn| drawn.of_source(&source)), ..figure })
        .collect();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for StudyFigure { stem, picture, .. } in &figures {
        match picture {
            Ok(picture) => {
                files.push((format!("{stem}.svg"), picture.svg().into()));
                files.push((format!("{stem}.png"), picture.png()?));
            }
            Err(error) => undrawn.push((stem.clone(), error.to_string())),
        }
    }
    if !sensitivity.is_empty() {
        files.push((SENSITIVITY.into(), sensitivity_table(&sensitivity, identity)?));
    }
    let found = documents::study::found(study, best, &sensitivity);
    files.push((PAGE.into(), page::study::page(study, (scope, &found), figures, &source).into()));
    let mut sums = Sums::default().of_stored(store, TABLE)?;
    for (name, bytes) in &files {
        store.replace(name, bytes)?;
        sums.add(name, bytes);
    }
    sums.write(store)?;
    Ok(Some(DrawnFiles { page: store.path(PAGE), sensitivity, undrawn }))
}

/// The table of sensitivity indices: a row for each index of each key and metric.
fn sensitivity_table(sensitivity: &[SensitivityIndices], identity: &str) -> Result<Vec<u8>, Failure> {
    let rows: Vec<(&SensitivityIndices, &SensitivityIndex)> =
        sensitivity.iter().flat_map(|of| of.indices.iter().map(move |index| (of, index))).collect();
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    let mut about = of_file("a row for each sensitivity index of each key and metric");
    about.insert(IDENTITY, identity);
    let batch = TableBuilder::new(&rows)
        .column(Column::new("column", "", "column of the study's table"), |row| row.0.column.as_str())
        .column(Column::new("unit", "", "its unit, which effects have too"), |row| row.0.unit)
        .column(Column::new("key", "", "varied key of the case"), |row| row.1.key.as_str())
        .column(Column::new("index", "", "which index"), |row| row.1.index)
        .column(Column::new("value", "", "its value: a share of the variance, or in the unit of the column"), |row| {
            finite(row.1.estimate.value)
        })
        .column(Column::new("low", "", "lower end of its 95 % interval"), |row| finite(row.1.estimate.interval_95[0]))
        .column(Column::new("high", "", "upper end of its 95 % interval"), |row| finite(row.1.estimate.interval_95[1]))
        .column(Column::new("used", "1", "base points or trajectories behind it"), |row| row.0.used as u64)
        .column(Column::new("left_out", "1", "those at which the metric is missing"), |row| row.0.left_out as u64)
        .finish(about)?;
    sealed_parquet::bytes(&batch)
}

/// What the overlays of the map find, and why those that find nothing are left out.
fn overlays(study: &Study) -> (Vec<FoundBranches>, Vec<(String, String)>) {
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for overlay in &study.overlays {
        let shown = overlay.path.display().to_string();
        match overlay.continuation.follow(&|_| true) {
            Ok(curves) if curves.curves.is_empty() => {
                let reason = "no special point of it can be followed in both parameters; the map has no curve of it";
                left_out.push((shown, reason.into()));
            }
            Ok(curves) => found.push(curves),
            Err(refusal) => left_out.push((shown, format!("the map has no curve of it: {refusal}"))),
        }
    }
    (found, left_out)
}
