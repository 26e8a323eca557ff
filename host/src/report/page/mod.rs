//! The report page of a run, `report.html`: one self-contained file (no network, figures inlined) for screen and print.
//!
//! The page depends on the run folder alone, so making it again gives the same page. `data` gathers its contents; the
//! template escapes all text.

pub mod comparison;
mod data;
mod gaps;
mod health;
mod set_ups;
mod tables;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::campaign::Campaign;
use crate::input::shown;
use crate::report::figures::campaign::{PlottedPoint, phase, response, transients};
use crate::report::figures::{FigureError, Picture};
use crate::run_folder::RunFolder;
use data::PageData;

const STYLE: &str = concat!(include_str!("../look.css"), include_str!("style.css"));

/// A report page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// The HTML text.
    pub html: String,
    /// Unreadable parts of the run, which the page lists too.
    pub unreadable: Vec<String>,
}

/// Makes the page of a run. It names the parts that cannot be read.
#[must_use]
pub fn page(run: &RunFolder) -> Page {
    let data = PageData::of(run);
    let m = &data.manifest;
    let title = format!("{} – {}", m.campaign, data.id);
    let content = html! {
        header {
            h1 { (m.campaign) }
            p.under { (data.id) " · started " (tables::moment(&m.started)) }
            (health::state(&data))
        }
        (health::warnings(&data))
        section { h2 { "Results" } (responses(&data)) (tables::peaks(&data)) (histories(run, &data)) (tables::transients(&data)) }
        section { h2 { "Set-ups and experiments" } (set_ups::set_ups(&data)) (set_ups::experiments(&data)) (set_ups::acting(&data)) }
        @if !data.points.is_empty() {
            section { h2 { "All points" } (tables::results(&data)) }
        }
        section { h2 { "Samples, link and losses" } (health::link(&data)) }
        section { h2 { "Rig and program" } (health::versions(&data)) }
        footer {
            "Made by " (crate::VERSION_LINE) " from the run folder. "
            code { "damprig runs verify" } " checks the files, "
            code { "damprig runs report" } " makes this page again."
        }
    };
    Page { html: document(&title, &content), unreadable: data.all_unreadable() }
}

/// A self-contained HTML document with this content.
fn document(title: &str, content: &Markup) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // The browser fetches and runs nothing, whatever the names in the run contain.
                meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { main { (content) } }
        }
    };
    // The template escapes what HTML reserves; control characters and direction marks are spelled out here.
    shown(&markup.into_string()).into_owned()
}

type DrawFigure = fn(&Campaign, &[PlottedPoint]) -> Result<Picture, FigureError>;

/// The frequency responses.
fn responses(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else {
        return html! { p.note { "No figure: the campaign cannot be read." } };
    };
    if data.points.is_empty() {
        return html! { @if data.taken.transients().is_empty() { p { "No point was measured." } } };
    }
    let points = data.plotted_points();
    let drawings: [(DrawFigure, &str); 2] = [
        (response, "Amplitude ratio X/Z (cycle maxima) over frequency. Hollow markers: not steady within the dwell."),
        (phase, "Phase of x relative to z over frequency."),
    ];
    html! {
        @for (draw, caption) in drawings {
            (drawn(draw(campaign, &points), caption))
        }
    }
}

/// x over time of records, pulses and free vibrations.
fn histories(run: &RunFolder, data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    let caption = "x over time of records, pulses and free vibrations, from the samples of the measured window.";
    match transients(campaign, run.path(), data.taken.transients()) {
        Ok(None) => html! {},
        Ok(Some(picture)) => drawn(Ok(picture), caption),
        Err(error) => drawn(Err(error), caption),
    }
}

fn drawn(picture: Result<Picture, FigureError>, caption: &str) -> Markup {
    html! {
        @match picture {
            // The drawing escapes its own text.
            Ok(picture) => figure { (PreEscaped(without_prolog(picture.svg()))) figcaption { (caption) } },
            Err(error) => p.note.bad { (error) },
        }
    }
}

/// The SVG without its XML declaration.
fn without_prolog(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}
