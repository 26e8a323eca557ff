//! The page of a study, `study.html`: figures, best point and files of the study in one self-contained file.

use maud::html;

use super::{document, drawn, drawn_in_both};
use crate::report::documents::Document;
use crate::report::figures::study::StudyFigure;
use crate::study::Study;

/// Makes the page. `scope` is the command's first line, `found` what it prints below; `source` the study's identity and the date.
#[must_use]
pub fn page(study: &Study, (scope, found): (&str, &Document), figures: Vec<StudyFigure>, source: &str) -> String {
    let content = html! {
        header { h1 { (study.name) } p.under { (scope) } }
        section { @for figure in figures {
            @match (figure.picture, figure.narrow) {
                (Ok(broad), Some(narrow)) => (drawn_in_both([broad, narrow], &figure.caption)),
                (picture, _) => (drawn(picture, &figure.caption)),
            }
        } }
        @if !found.is_empty() { section { (found.html()) } }
        section { h2 { "Study" } pre { code { (study.text) } } }
        section { h2 { "Case" } p.under { (study.case_path.display()) } pre { code { (study.case_text) } } }
        footer { "Made by " (crate::VERSION_LINE) ": " (source) ". " code { "table.parquet" } " beside this page has all numbers." }
    };
    document(&study.name, &content)
}
