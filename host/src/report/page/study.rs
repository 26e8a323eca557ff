//! The page of a study, `study.html`: figures, best point and files of the study in one self-contained file.

use maud::html;

use super::{document, drawn, drawn_in_both};
use crate::report::figures::study::StudyFigure;
use crate::study::Study;

/// Makes the page. `summary` is the text of the command, a line for each statement, `texts` its tables; `source` the study's identity and the
/// date.
#[must_use]
pub fn page(
    study: &Study,
    summary: &[String],
    (texts, figures): (&[String], Vec<StudyFigure>),
    source: &str,
) -> String {
    let content = html! {
        header { h1 { (study.name) } @for line in summary { p.under { (line) } } }
        section { @for figure in figures {
            @match (figure.picture, figure.narrow) {
                (Ok(broad), Some(narrow)) => (drawn_in_both([broad, narrow], &figure.caption)),
                (picture, _) => (drawn(picture, &figure.caption)),
            }
        } }
        @for text in texts { section { pre { code { (text) } } } }
        section { h2 { "Study" } pre { code { (study.text) } } }
        section { h2 { "Case" } p.under { (study.case_path.display()) } pre { code { (study.case_text) } } }
        footer { "Made by " (crate::VERSION_LINE) ": " (source) ". " code { "table.parquet" } " beside this page has all numbers." }
    };
    document(&study.name, &content)
}
