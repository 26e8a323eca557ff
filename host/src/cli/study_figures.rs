//! What `damprig study run` and `merge` end with: the best point, the figures and the page.

use super::outcome::{Failure, Outcome};
use crate::report::study_files::{self, MOST_DRAWN};
use crate::report::terminal;
use crate::study::data_set::DataSet;
use crate::study::run::{self, Progress};
use crate::study::{Study, evaluate};

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
    let best = progress.best.map(|(row, _)| row);
    match study_files::write(study, data_set, best, &summary).map_err(Failure::failed)? {
        None => warn!("warning: a table of more than {MOST_DRAWN} rows is not drawn"),
        Some(drawn) => {
            drawn.undrawn.iter().for_each(|(stem, error)| warn!("warning: {stem}: {error}"));
            say!("Page:  {}", drawn.page.display());
        }
    }
    Ok(())
}
