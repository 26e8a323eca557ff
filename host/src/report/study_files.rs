//! Draws the table of a complete study beside itself and makes its page.

use std::path::PathBuf;

use crate::continuation::Found;
use crate::failure::Failure;
use crate::report::figures::study::{self, StudyFigure};
use crate::report::page;
use crate::report::plot;
use crate::study::Study;
use crate::study::data_set::{DataSet, TABLE};
use crate::study::sums::Sums;
use crate::study::table::StudyTable;

/// Name of the page.
pub const PAGE: &str = "study.html";

/// Rows of a table that is drawn at most: it is read whole.
pub const MAX_DRAWN: u64 = 2_000_000;

/// What was drawn.
#[derive(Debug)]
pub struct Drawn {
    /// Where the page is.
    pub page: PathBuf,
    /// Names of the figures that could not be drawn, files of curves that are not on the map, and why.
    pub undrawn: Vec<(String, String)>,
}

/// Reads the table, writes its figures and the page beside it. `best`: row of the best point; `summary`: what the page says first. `None`
/// for a table of more than [`MAX_DRAWN`] rows.
///
/// # Errors
/// A table that is missing or damaged, a file that cannot be written.
pub fn write(
    study: &Study,
    data_set: &DataSet,
    best: Option<u64>,
    summary: &[String],
) -> Result<Option<Drawn>, Failure> {
    if study.rows() > MAX_DRAWN {
        return Ok(None);
    }
    let store = data_set.store();
    let shown = store.path(TABLE).display().to_string();
    let bytes = store.get(TABLE)?.ok_or_else(|| Failure::Storage(format!("{shown} is missing")))?;
    let table = StudyTable::read(&shown, bytes)?;
    let (overlays, mut undrawn) = overlays(study);
    let source = plot::source("study", &data_set.manifest().identity);
    let figures: Vec<StudyFigure> = study::draw(study, &table, best, &overlays)
        .into_iter()
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
    files.push((PAGE.into(), page::study::page(study, summary, figures, &source).into()));
    let mut sums = Sums::default().of_stored(store, TABLE)?;
    for (name, bytes) in &files {
        store.replace(name, bytes)?;
        sums.add(name, bytes);
    }
    sums.write(store)?;
    Ok(Some(Drawn { page: store.path(PAGE), undrawn }))
}

/// What the overlays of the map find, and why those that find nothing are left out.
fn overlays(study: &Study) -> (Vec<Found>, Vec<(String, String)>) {
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for overlay in &study.overlays {
        let shown = overlay.path.display().to_string();
        match overlay.continuation.follow() {
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
