//! What `damprig study run` and `merge` end with: the best point, the figures and the page.

use super::outcome::{Failure, Outcome};
use crate::report::figures::study::StudyFigure;
use crate::report::{figures, page, terminal};
use crate::study::data_set::{DataSet, TABLE};
use crate::study::run::{self, Progress};
use crate::study::table::StudyTable;
use crate::study::{Study, evaluate};

/// Name of the page.
const PAGE: &str = "study.html";

/// Rows of a table that is drawn at most: it is read whole.
const MOST_DRAWN: u64 = 2_000_000;

/// Says which point is best, draws the table beside itself and makes the page.
pub(super) fn say_result(study: &Study, data_set: &DataSet, progress: &Progress) -> Outcome {
    let mut summary = vec![terminal::study::scope(study, run::cycles(study))];
    if let Some((row, value)) = progress.best {
        summary.push(terminal::study::best(study, row, value));
        say!("{}", summary[1]);
    } else {
        let column = evaluate::main_column(study, study.objective);
        warn!("warning: no point has a value of {column}");
    }
    if study.rows() > MOST_DRAWN {
        warn!("warning: a table of more than {MOST_DRAWN} rows is not drawn");
        return Ok(());
    }
    let store = data_set.store();
    let shown = store.address(TABLE).display().to_string();
    let bytes = store.get(TABLE).map_err(Failure::failed)?;
    let bytes = bytes.ok_or_else(|| Failure::Failed(format!("{shown} is missing")))?;
    let table = StudyTable::read(&shown, bytes).map_err(Failure::failed)?;
    let figures = figures::study::draw(study, &table, progress.best.map(|(row, _)| row));
    for StudyFigure { stem, picture, .. } in &figures {
        match picture {
            Ok(picture) => {
                store.replace(&format!("{stem}.svg"), picture.svg().as_bytes()).map_err(Failure::failed)?;
                let png = picture.png().map_err(Failure::failed)?;
                store.replace(&format!("{stem}.png"), &png).map_err(Failure::failed)?;
            }
            Err(error) => warn!("warning: {stem}: {error}"),
        }
    }
    let page = page::study::page(study, &summary, figures);
    store.replace(PAGE, page.as_bytes()).map_err(Failure::failed)?;
    say!("Page:  {}", store.address(PAGE).display());
    Ok(())
}
