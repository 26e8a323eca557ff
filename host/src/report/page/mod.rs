//! `report.html`: a run on one page for people, complete in itself (no network, figures inlined), for the screen in light
//! and dark and for A4.
//!
//! It holds nothing that is not in the run folder, and nothing of when or where it was made: made again from the same
//! folder it is the same page. What it tells is gathered by [`facts`](self), text is escaped by the template. The terminal's
//! words are [`crate::cli`]'.

mod facts;
mod gaps;
mod health;
mod set_ups;
mod tables;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::campaign::Campaign;
use crate::report::figures::campaign::{Shown, phase, response};
use crate::report::figures::{FigureError, Picture};
use crate::run_folder::RunFolder;
use facts::Facts;

const STYLE: &str = include_str!("style.css");

/// A finished page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// The file's text.
    pub html: String,
    /// What of the run cannot be read, as the page says too.
    pub unreadable: Vec<String>,
}

/// The page of a run, as far as it can be read: what cannot is named on it.
#[must_use]
pub fn page(run: &RunFolder) -> Page {
    let facts = Facts::of(run);
    let m = &facts.manifest;
    let title = format!("{} – {}", m.campaign, facts.id);
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing is fetched, nothing is run, whatever a name in the run may look like.
                meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    header {
                        h1 { (m.campaign) }
                        p.under { (facts.id) " · started " (tables::moment(&m.started)) }
                        (health::state(&facts))
                    }
                    (health::warnings(&facts))
                    section { h2 { "What came of it" } (figures(&facts)) (tables::peaks(&facts)) (tables::transients(&facts)) }
                    section { h2 { "What was run" } (set_ups::set_ups(&facts)) (set_ups::experiments(&facts)) (set_ups::acting(&facts)) }
                    @if !facts.points.is_empty() {
                        section { h2 { "Results" } (tables::results(&facts)) }
                    }
                    section { h2 { "Samples, link and losses" } (health::link(&facts)) }
                    section { h2 { "Rig and program" } (health::versions(&facts)) }
                    footer {
                        (crate::VERSION_LINE) ". Made from the run folder alone; "
                        code { "damprig runs verify" } " checks its files, "
                        code { "damprig runs report" } " makes this page again."
                    }
                }
            }
        }
    };
    Page { html: markup.into_string(), unreadable: facts.all_unreadable() }
}

type Drawing = fn(&Campaign, &[Shown]) -> Result<Picture, FigureError>;

fn figures(facts: &Facts) -> Markup {
    let Ok(campaign) = &facts.campaign else {
        return html! { p.note { "There is no figure: the campaign cannot be read." } };
    };
    if facts.points.is_empty() {
        return html! { @if facts.taken.transients().is_empty() { p { "No point was taken." } } };
    }
    let shown = facts.shown();
    let drawings: [(Drawing, &str); 2] = [
        (response, "Vibration amplitude ratio over frequency. Hollow: not steady within the dwell."),
        (phase, "Phase of the structure relative to the base."),
    ];
    html! {
        @for (draw, caption) in drawings {
            @match draw(campaign, &shown) {
                // Its texts are escaped where it is drawn.
                Ok(picture) => figure { (PreEscaped(without_prolog(picture.svg()))) figcaption { (caption) } },
                Err(error) => p.note.bad { (error) },
            }
        }
    }
}

/// An SVG within a page has no declaration of its own.
fn without_prolog(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}
