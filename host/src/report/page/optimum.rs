//! The page of an optimisation, `optimum.html`: the decision, the dampers compared, the curves and the files.

use maud::html;

use super::{document, drawn_in_both};
use crate::optimise::{Optimisation, Optimum};
use crate::report::documents::optimum::{alone, compared, ranked};
use crate::report::plot::Picture;

/// The figures, each broad and narrow.
#[derive(Debug)]
pub struct OptimumFigures {
    /// The objective's metric over the band.
    pub over_band: Option<[Picture; 2]>,
    /// The front of two objectives.
    pub front: Option<[Picture; 2]>,
}

/// Makes the page. `scope` is the command's first line, `source` the optimisation's name and the date.
#[must_use]
pub fn page(
    optimisation: &Optimisation,
    answer: &Optimum,
    scope: &str,
    figures: OptimumFigures,
    source: &str,
) -> String {
    let all = ranked(answer);
    let caption = "The objective's metric over the band at each optimum with its nominal values; the band around a curve has its least and largest \
                   value within the tolerances, for all uncertain values and from all starts that the search compared points by.";
    let front = "Each point is an optimum: the best objective with the second one no worse than there. The knee is furthest from the line \
                 between the ends.";
    let content = html! {
        header { h1 { (optimisation.name) } p.under { (scope) } }
        @if let Some(figure) = figures.over_band { section { (drawn_in_both(figure, caption)) } }
        @if let Some(figure) = figures.front { section { (drawn_in_both(figure, front)) } }
        @if all.len() > 1 {
            section { h2 { "Dampers under the same rules" } (compared(answer).html()) }
        }
        @for of in &all {
            section {
                h2 { (of.name) }
                @let own = optimisation.alternatives.iter().find(|own| own.name == of.name).unwrap_or(optimisation);
                (alone(own, of).html())
            }
        }
        section { h2 { "Optimisation" } pre { code { (optimisation.text) } } }
        section { h2 { "Case" } p.under { (optimisation.case_path.display()) } pre { code { (optimisation.case_text) } } }
        footer { "Made by " (crate::VERSION_LINE) ": " (source) ". " code { "answer.json" } " beside this page has all numbers." }
    };
    document(&optimisation.name, &content)
}
