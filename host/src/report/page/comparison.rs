//! The page of a comparison, `comparison.html`: one self-contained file with the look of the report page. What differs comes first; the rest is
//! folded.

use maud::{Markup, html};

use super::{BOTH, document, drawn, drawn_in_both};
use crate::compare::{ComparedExperiment, ComparedMetric, ComparedPoint, Comparison, PredictedQuantity, Verdict};
use crate::quantity::Quantity;
use crate::report::figures::comparison::{phase_plane, response, time_history};
use crate::report::figures::force_surface;
use crate::report::numbers::{normalised_error, significant, trimmed, with_uncertainty};
use crate::report::plot::Picture;

/// Sheets of a run before the periodic motions of its model.
#[derive(Debug)]
pub struct Sheets {
    /// Their figure.
    pub picture: Picture,
    /// Measured and continued folds, in words.
    pub folds: Vec<String>,
}

/// The page's HTML text.
#[must_use]
pub fn comparison_page(comparison: &Comparison, sheets: Option<Sheets>) -> String {
    let (all, agreeing) = comparison.counts();
    let content = html! {
        header {
            h1 { (comparison.campaign) ": measured and predicted" }
            p.under { (comparison.run) " · " (comparison.state) " · set-ups of " (comparison.set_ups_from) }
            p { @if all == 0 { span.state.bad { "nothing compared" } }
                @else if agreeing == all { span.state.good { "agrees" } }
                @else { span.state.bad { (all - agreeing) " differ" } }
                " " (agreeing) " of " (all) " quantities agree: |E" sub { "n" } "| ≤ 1 with expanded uncertainties, k = 2." }
        }
        @for what in comparison.missing.iter().chain(&comparison.unreadable) { p.note.bad { (what) } }
        (contents(comparison))
        (differences(comparison))
        @if let Some(Sheets { picture, folds }) = sheets {
            section {
                h2 { "Responses that were kept" }
                (drawn(Ok(picture), &format!("{} {}", force_surface::CAPTION, force_surface::CONTINUED)))
                @for line in &folds { p { (line) } }
            }
        }
        @for (n, experiment) in comparison.experiments.iter().enumerate() { (section(n, experiment)) }
        section {
            h2 { "How it is compared" }
            p { "Measured and simulated cover the same ticks from the same start, and the board's own code measures both. E" sub { "n" } " is the \
                difference over the root of the sum of both expanded uncertainties squared." }
            @for assumption in &comparison.assumptions { p { (assumption) } }
        }
        footer { "Made by " (comparison.damprig) " (" code { "damprig compare" } "). docs/COMPARE.md derives the uncertainties." }
    };
    document(&format!("Measured and predicted – {}", comparison.run), &content)
}

fn name(experiment: &ComparedExperiment) -> String {
    format!("{}: {}", experiment.label, experiment.experiment)
}

/// Number of quantities of an experiment that were compared, and how many of them differ.
fn counts(experiment: &ComparedExperiment) -> (usize, usize) {
    let all = || experiment.points.iter().flat_map(|point| &point.metrics);
    let of = |verdict: Verdict| all().filter(|own| own.verdict == verdict).count();
    (of(Verdict::Agrees) + of(Verdict::Differs), of(Verdict::Differs))
}

fn verdict(experiment: &ComparedExperiment) -> Markup {
    html! {
        @match counts(experiment) {
            (0, _) => span { "nothing compared" },
            (all, 0) => span { "all " (all) " agree" },
            (all, differing) => span.differs { (differing) " of " (all) " differ" },
        }
    }
}

/// The experiments, those that differ most first, with links to their sections.
fn contents(comparison: &Comparison) -> Markup {
    let mut all: Vec<(usize, &ComparedExperiment)> = comparison.experiments.iter().enumerate().collect();
    all.sort_by_key(|(_, experiment)| std::cmp::Reverse(counts(experiment).1));
    html! {
        @if all.len() > 1 {
            nav {
                h2 { "Contents" }
                ul { @for (n, experiment) in all {
                    li { a href=(format!("#experiment-{n}")) { (name(experiment)) } " – " (verdict(experiment)) }
                } }
            }
        }
    }
}

/// Most differences in the table at the top; the tables of the experiments have all.
const MAX_DIFFERENCES: usize = 40;

/// The quantities that differ, the largest normalised error first.
fn differences(comparison: &Comparison) -> Markup {
    let rows = comparison.experiments.iter().enumerate().flat_map(|(n, experiment)| {
        let all = experiment.points.iter().flat_map(|point| point.metrics.iter().map(move |own| (point, own)));
        all.filter(|(_, own)| own.verdict == Verdict::Differs).map(move |(point, own)| (n, experiment, point, own))
    });
    let error = |own: &ComparedMetric| own.predicted().map_or(0.0, |predicted| predicted.normalised_error.abs());
    let mut rows: Vec<_> = rows.collect();
    rows.sort_by(|a, b| error(b.3).total_cmp(&error(a.3)));
    html! {
        @if !rows.is_empty() {
            section {
                h2 { "Differences" }
                div.wide { table {
                    thead { tr { th.word { "Set-up and experiment" } (heads()) } }
                    tbody { @for (n, experiment, point, own) in rows.iter().take(MAX_DIFFERENCES) {
                        tr {
                            td.word { a href=(format!("#experiment-{n}")) { (name(experiment)) } }
                            (cells(point, own, true))
                        }
                    } }
                } }
                @if rows.len() > MAX_DIFFERENCES {
                    p.under { "The " (MAX_DIFFERENCES) " largest of " (rows.len()) "; the tables of the experiments have all." }
                }
            }
        }
    }
}

/// An experiment: its figures, open if something differs, and its table, folded.
fn section(n: usize, experiment: &ComparedExperiment) -> Markup {
    let is_sweep = experiment.kind == "stepped_sine";
    html! {
        details.part open[counts(experiment).1 > 0] {
            summary { h2 { (name(experiment)) " – " (verdict(experiment)) } }
            // A link to what is folded unfolds it.
            div id=(format!("experiment-{n}")) {
                @for note in &experiment.notes { p.note { (note) } }
                @if is_sweep {
                    (drawn_in_both(BOTH.map(|breadth| response(experiment, breadth)), "X/Z (cycle maxima) over frequency with expanded uncertainties; below, the normalised error, within ±1 where both agree."))
                }
                details {
                    summary { "Histories" }
                    @for point in shown_points(experiment) { (histories(point)) }
                }
                details {
                    summary { "All quantities" }
                    (table(experiment))
                }
            }
        }
    }
}

/// The points whose histories are shown: that of the largest X/Z, and the one that differs most.
fn shown_points(experiment: &ComparedExperiment) -> Vec<&ComparedPoint> {
    let with_history = || experiment.points.iter().filter(|point| point.history.is_some());
    let value = |point: &&ComparedPoint| point.metric(Quantity::XOverZ).map_or(0.0, |own| own.measured.value);
    let error = |point: &&ComparedPoint| {
        let own = point.metric(Quantity::XOverZ).and_then(ComparedMetric::predicted);
        own.map_or(0.0, |predicted| predicted.normalised_error.abs())
    };
    let largest = with_history().max_by(|a, b| value(a).total_cmp(&value(b)));
    let worst = with_history().max_by(|a, b| error(a).total_cmp(&error(b))).filter(|point| error(point) > 1.0);
    let worst = worst.filter(|worst| largest.is_none_or(|largest| !std::ptr::eq(*worst, largest)));
    largest.into_iter().chain(worst).collect()
}

fn histories(point: &ComparedPoint) -> Markup {
    let Some(history) = &point.history else { return html! {} };
    let at = point
        .frequency_hz
        .map_or("The measured window".to_string(), |f| format!("The last cycles at {} Hz", trimmed(f, 4)));
    let residual = point.residual.map_or(String::new(), |residual| {
        format!(
            " Residual over the whole window: {} µm RMS, {} % of x; noise of a reading: {} µm.",
            significant(residual.rms_m * 1e6, 3),
            significant(100.0 * residual.rms_m / residual.rms_x_m, 2),
            significant(residual.noise_rms_m * 1e6, 2)
        )
    });
    let parted = if point.is_sensitive {
        " Nearby trajectories diverge here: the histories of two runs differ, their statistics are compared."
    } else {
        ""
    };
    html! {
        (drawn(Ok(time_history(history)), &format!("{at}.{residual}{parted}")))
        div.half { (drawn(Ok(phase_plane(history)), &format!("{at}: phase plane."))) }
    }
}

/// A row for each quantity of each point, and its remarks.
fn table(experiment: &ComparedExperiment) -> Markup {
    html! {
        div.wide { table {
            thead { tr { (heads()) } }
            tbody {
                @for point in &experiment.points {
                    @for (n, own) in point.metrics.iter().enumerate() { tr.first[n == 0] { (cells(point, own, n == 0)) } }
                    @let about = remarks(point);
                    @if !about.is_empty() { tr { td {} td.word colspan="7" { (about) } } }
                }
            }
        } }
    }
}

/// Heads of the columns of [`cells`].
fn heads() -> Markup {
    html! {
        th { "f" small { "Hz" } } th.word { "Quantity" } th.word { "Verdict" } th { "Measured" small { "± U" } }
        th { "Predicted" small { "measured base, ± U" } } th { "E" sub { "n" } }
        th { "Predicted" small { "ideal base, ± U" } } th { "E" sub { "n" } }
    }
}

/// The cells of a quantity of a point.
fn cells(point: &ComparedPoint, own: &ComparedMetric, has_frequency: bool) -> Markup {
    let (unit, scale) = own.metric.shown_unit();
    let value = |value: f64, expanded: f64| with_uncertainty(value * scale, expanded * scale).replace('-', "−");
    let predicted =
        |p: &Option<PredictedQuantity>| p.as_ref().map_or("–".into(), |p| value(p.value.value, p.value.expanded));
    let error = |p: &Option<PredictedQuantity>| {
        p.as_ref().map_or("–".into(), |p| normalised_error(p.normalised_error).replace('-', "−"))
    };
    html! {
        td { @if has_frequency { (point.frequency_hz.map_or("–".into(), |f| trimmed(f, 4))) } }
        td.word.short { (own.metric.label()) @if !unit.is_empty() { " (" (unit) ")" } }
        td.word.odd[own.verdict == Verdict::Differs] { (own.verdict.text()) }
        td.short { (value(own.measured.value, own.measured.expanded)) }
        td.short { (predicted(&own.on_measured_base)) }
        td { (error(&own.on_measured_base)) }
        td.short { (predicted(&own.on_ideal_base)) }
        td { (error(&own.on_ideal_base)) }
    }
}

fn remarks(point: &ComparedPoint) -> String {
    let sensitive =
        point.is_sensitive.then(|| "nearby trajectories diverge; the prediction is the mean over them".to_string());
    let without = point.without_measured_base.as_ref().map(|why| format!("without the measured base: {why}"));
    let all: Vec<String> = point.remarks.iter().cloned().chain(sensitive).chain(without).collect();
    all.join("; ")
}
