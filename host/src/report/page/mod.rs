//! The report page of a run, `report.html`: one self-contained file (no network, figures inlined) for screen and print.
//!
//! The page depends on the run folder alone, so making it again gives the same page. `data` gathers its contents; the
//! template escapes all text.

pub mod comparison;
mod data;
mod gaps;
mod health;
pub mod optimum;
mod repeats;
mod script;
mod set_ups;
pub mod study;
mod tables;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::campaign::Campaign;
use crate::failure::Failure;
use crate::input::shown;
use crate::report::figures::campaign::{groups, phase, response, responses_of_runs, transients, wall_force};
use crate::report::figures::{self, force_surface, peak_motion, resonance};
use crate::report::force_surface::ForceSurface;
use crate::report::plot::palette::Look;
use crate::report::plot::{Breadth, Picture};
use crate::report::resonance::{TrackedCurve, table as table_of_resonances};
use crate::run_folder::RunFolder;
use data::PageData;

const STYLE: &str = concat!(include_str!("../look.css"), include_str!("style.css"));

/// A report page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportPage {
    /// The HTML text.
    pub html: String,
    /// Unreadable parts of the run, which the page lists too.
    pub unreadable: Vec<String>,
}

/// Makes the page of a run. It names the parts that cannot be read.
#[must_use]
pub fn page(run: &RunFolder) -> ReportPage {
    let data = PageData::of(run);
    let title = format!("{} – {}", data.manifest.campaign, data.id);
    let content = html! {
        (content(run, &data))
        (footer())
    };
    ReportPage { html: document(&title, &content), unreadable: data.all_unreadable() }
}

/// Makes one page of several runs: their frequency responses in one figure, or in one for each set-up, then the content of each page.
#[must_use]
pub fn page_of_runs(runs: &[RunFolder]) -> ReportPage {
    let all: Vec<PageData> = runs.iter().map(PageData::of).collect();
    let plotted: Vec<_> = all
        .iter()
        .filter_map(|data| Some((data.id.as_str(), data.campaign.as_ref().ok()?, data.points.as_slice())))
        .collect();
    let caption =
        "Amplitude ratio X/Z (cycle maxima) over frequency of all runs. Hollow markers: not steady within the dwell.";
    let content = html! {
        header { h1 { (all.len()) " runs" } @for data in &all { p.under { (data.id) } } }
        @for ((set_up, broad), (_, narrow)) in responses_of_runs(&plotted, Breadth::Broad).into_iter().zip(responses_of_runs(&plotted, Breadth::Narrow)) {
            @if let Some(set_up) = set_up { h3 { (set_up) } }
            (drawn_in_both([broad, narrow], caption))
        }
        @for (run, data) in runs.iter().zip(&all) { article { (self::content(run, data)) } }
        (footer())
    };
    let of_run = |data: &PageData| -> Vec<String> {
        data.all_unreadable().iter().map(|what| format!("{}: {what}", data.id)).collect()
    };
    ReportPage {
        html: document(&format!("{} runs", all.len()), &content),
        unreadable: all.iter().flat_map(of_run).collect(),
    }
}

fn footer() -> Markup {
    html! {
        footer {
            "Made by " (crate::VERSION_LINE) " from the run folder. "
            code { "damprig runs verify" } " checks the files, "
            code { "damprig runs report" } " makes this page again."
        }
    }
}

/// What a page says of a run.
fn content(run: &RunFolder, data: &PageData) -> Markup {
    let m = &data.manifest;
    html! {
        header {
            h1 { (m.campaign) }
            p.under { (data.id) " · started " (tables::moment(&m.started)) }
            @for (name, text) in m.plan.texts() {
                @if is_long(text) {
                    p.under { (name) ": " (text.chars().count()) " characters, below the results" }
                } @else {
                    p.under { (name) ": " (text) }
                }
            }
            @if let Some(seed) = m.plan.order_seed { p.under { "random order, seed " (seed) } }
            (health::state(data))
            (tables::headlines(data))
        }
        (health::warnings(data))
        section { h2 { "Results" } (responses(data)) (tables::peaks(data)) (motions(run, data)) (histories(run, data)) (tables::transients(data)) (repeats::repeats(data)) }
        (long_texts(data))
        section { h2 { "Set-ups and experiments" } (sketches(data)) (set_ups::set_ups(data)) (set_ups::experiments(data)) (set_ups::acting(data)) }
        @if !data.points.is_empty() {
            section.on-screen { h2 { "All points" } (tables::results(data)) }
            p.note.in-print {
                "Not printed: the table of all points (" code { "damprig runs export --format csv" } " writes it) and the motion at the peaks."
            }
        }
        section { h2 { "Samples, link and losses" } (health::link(data)) }
        section { h2 { "Rig and program" } (health::versions(data)) }
    }
}

/// Characters of a text above the results; a longer one is folded below them.
const MAX_CHARACTERS: usize = 400;

fn is_long(text: &str) -> bool {
    text.chars().count() > MAX_CHARACTERS || text.lines().count() > 8
}

/// The long texts of the campaign's plan, folded.
fn long_texts(data: &PageData) -> Markup {
    let texts: Vec<(&str, &str)> = data.manifest.plan.texts().filter(|(_, text)| is_long(text)).collect();
    html! {
        @if !texts.is_empty() {
            section {
                h2 { "Notes" }
                @for (name, text) in texts {
                    details.on-screen {
                        summary { (name) " (" (text.chars().count()) " characters)" }
                        p.text { (text) }
                    }
                    p.note.in-print { "Not printed: " (name) " (" (text.chars().count()) " characters)." }
                }
            }
        }
    }
}

/// A self-contained HTML document with this content and the script of its figures.
fn document(title: &str, content: &Markup) -> String {
    let policy = format!("default-src 'none'; style-src 'unsafe-inline'; script-src {}", script::source());
    let content = html! { main { (content) } script type="module" { (PreEscaped(&*script::SCRIPT)) } };
    document_that_may(title, &content, &policy)
}

/// A self-contained HTML document whose content may have images within it (`data:`), without a script.
#[must_use]
pub fn document_with_images(title: &str, content: &Markup) -> String {
    let content = html! { main { (content) } };
    document_that_may(title, &content, "default-src 'none'; style-src 'unsafe-inline'; img-src data:")
}

fn document_that_may(title: &str, content: &Markup, policy: &str) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // The browser fetches nothing and runs no other script, whatever the names in the run contain.
                meta http-equiv="Content-Security-Policy" content=(policy);
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (content) }
        }
    };
    // The template escapes what HTML reserves; control characters and direction marks are spelled out here.
    shown(&markup.into_string()).into_owned()
}

/// The frequency responses.
fn responses(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else {
        return html! { p.note { "No figure: the campaign cannot be read." } };
    };
    if data.points.is_empty() {
        return html! { @if data.taken.transients().is_empty() { p { "No point was measured." } } };
    }
    let points = &data.points;
    let surfaces = ForceSurface::of(campaign, &data.points);
    let tracked = TrackedCurve::of(campaign, &data.points, data.manifest.is_simulated());
    html! {
        @if !surfaces.is_empty() {
            (drawn(Ok(force_surface::draw(campaign, &surfaces, &[])), force_surface::CAPTION))
            @for line in force_surface::folds(campaign, &surfaces) { p { (line) } }
        }
        @if !tracked.is_empty() {
            (drawn(Ok(resonance::draw(campaign, &tracked)), resonance::CAPTION))
            (table_of_resonances(campaign, &tracked).html())
        }
        @for group in groups(campaign).into_iter().filter(|_| has_driven_base(campaign)) {
            @let group = group.as_deref();
            @if let Some(series) = group { h3 { (series) } }
            (drawn_in_both(
                BOTH.map(|breadth| response(campaign, points, group, breadth)),
                "Amplitude ratio X/Z (cycle maxima) over frequency. Hollow markers: not steady within the dwell. Bars: 95 % interval of X/Z \
                 as a mean over cycles, without the sensors' scale.",
            ))
            (drawn_in_both(BOTH.map(|breadth| phase(campaign, points, group, breadth)), "Phase of x relative to z over frequency."))
            @if let [Some(broad), Some(narrow)] = BOTH.map(|breadth| wall_force(campaign, &data.taken, group, breadth)) {
                (drawn_in_both([broad, narrow], "Largest force on a wall over frequency, of the points with impacts."))
            }
        }
    }
}

/// Whether an experiment drives the base by a stepped sine.
fn has_driven_base(campaign: &Campaign) -> bool {
    campaign.experiments.iter().any(|experiment| experiment.base_driven().is_some())
}

/// The set-ups as sketches.
fn sketches(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    html! {
        div.sketches { @for (place, set_up) in campaign.set_ups.iter().enumerate() {
            (drawn(Ok(figures::set_ups::draw(set_up, Look { set_up: place, run: 0 })), ""))
        } }
        p.under { "The set-ups, not to scale, each in the colour of its curves." }
    }
}

/// The motion at the peak of each frequency response.
fn motions(run: &RunFolder, data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    let caption = "The motion at each peak: x (in the colour of the set-up) and z (grey) over the last cycles of the dwell, triangles at impacts on the side of \
                   the wall; velocity over x; x and velocity once in each period of the drive (Poincaré section). One point: the motion \
                   repeats with the drive.";
    match peak_motion::draw(campaign, run, &data.taken) {
        Ok(None) => html! {},
        Ok(Some(picture)) => html! { div.on-screen { (drawn(Ok(picture), caption)) } },
        Err(error) => drawn(Err(error), caption),
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

/// The layouts of a figure that is on the page for a screen, and for a phone and print.
const BOTH: [Breadth; 2] = [Breadth::Broad, Breadth::Narrow];

/// A figure in both layouts, of which the style sheet shows one.
fn drawn_in_both([broad, narrow]: [Picture; 2], caption: &str) -> Markup {
    html! {
        figure.both {
            div.broad { (PreEscaped(broad.svg())) }
            div.narrow { (PreEscaped(narrow.svg())) }
            figcaption { (caption) }
        }
    }
}

fn drawn(picture: Result<Picture, Failure>, caption: &str) -> Markup {
    html! {
        @match picture {
            // The drawing escapes its own text.
            Ok(picture) => figure { (PreEscaped(picture.svg())) @if !caption.is_empty() { figcaption { (caption) } } },
            Err(error) => p.note.bad { (error) },
        }
    }
}
