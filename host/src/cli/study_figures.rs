//! What `damprig study run` and `merge` end with: the best point, the figures and the page.

use crate::failure::{Failure, Outcome};
use crate::report::study_files::{self, MAX_DRAWN};
use crate::report::terminal;
use crate::study::data_set::{DataSet, TABLE};
use crate::study::run::{self, Progress};
use crate::study::{Study, evaluate};

/// Says that parts are of an older version.
pub(super) fn without_digest(parts: u64) -> String {
    let have = if parts == 1 { "part has" } else { "parts have" };
    format!("{parts} {have} no digest; written by an older version, so that a changed result in them is not noticed")
}

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
    if progress.unresolved > 0 {
        let points = if progress.unresolved == 1 { "point has" } else { "points have" };
        warn!(
            "warning: {} {points} instants with too many events, which were not resolved (column unresolved)",
            progress.unresolved
        );
    }
    let best = progress.best.map(|(row, _)| row);
    let parts = progress.without_digest;
    if parts > 0 {
        warn!("warning: {}", without_digest(parts));
    }
    let drawn = study_files::write(study, data_set, best, &summary);
    let complete = |error: &dyn std::fmt::Display| {
        let (table, again) = (data_set.store().path(TABLE), "`damprig study merge` draws it again");
        Failure::Failed(format!("{error}\n  {} is complete; {again}", table.display()))
    };
    match drawn.map_err(|error| complete(&error))? {
        None => warn!("warning: a table of more than {MAX_DRAWN} rows is not drawn"),
        Some(drawn) => {
            drawn.undrawn.iter().for_each(|(stem, error)| warn!("warning: {stem}: {error}"));
            say!("Page:  {}", drawn.page.display());
        }
    }
    Ok(())
}
