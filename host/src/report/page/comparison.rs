//! The page of a comparison, `comparison.html`: one self-contained file with the look of the report page.

use maud::{Markup, html};

use super::{document, drawn};
use crate::compare::{ComparedExperiment, ComparedMetric, ComparedPoint, Comparison, Metric, Predicted, Verdict};
use crate::report::figures::comparison::{phase_plane, response, time_history};
use crate::report::numbers::{normalised_error, significant, trimmed, with_uncertainty};

/// The page's HTML text.
#[must_use]
pub fn comparison_page(comparison: &Comparison) -> String {
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
        @for experiment in &comparison.experiments { (section(experiment)) }
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

fn section(experiment: &ComparedExperiment) -> Markup {
    let is_sweep = experiment.kind == "stepped_sine";
    html! {
        section {
            h2 { (experiment.label) ": " (experiment.experiment) }
            @for note in &experiment.notes { p.note { (note) } }
            @if is_sweep {
                (drawn(response(experiment), "X/Z (cycle maxima) over frequency with expanded uncertainties; below, the normalised error, within ±1 where both agree."))
            }
            @for point in shown_points(experiment) { (histories(point)) }
            (table(experiment))
        }
    }
}

/// The points whose histories are shown: that of the largest X/Z, and the one that differs most.
fn shown_points(experiment: &ComparedExperiment) -> Vec<&ComparedPoint> {
    let with_history = || experiment.points.iter().filter(|point| point.history.is_some());
    let value = |point: &&ComparedPoint| point.metric(Metric::XOverZ).map_or(0.0, |own| own.measured.value);
    let error = |point: &&ComparedPoint| {
        let own = point.metric(Metric::XOverZ).and_then(ComparedMetric::predicted);
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
            significant(100.0 * residual.rms_m / residual.x_rms_m, 2),
            significant(residual.noise_rms_m * 1e6, 2)
        )
    });
    let parted = if point.is_sensitive {
        " Neighbouring starts part here: the histories of two runs differ, their statistics are compared."
    } else {
        ""
    };
    html! {
        (drawn(time_history(history), &format!("{at}.{residual}{parted}")))
        div.half { (drawn(phase_plane(history), &format!("{at}: phase plane."))) }
    }
}

/// A row for each quantity of each point.
fn table(experiment: &ComparedExperiment) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "f" small { "Hz" } } th.word { "Quantity" } th.word { "Verdict" } th { "Measured" small { "± U" } }
                th { "Predicted" small { "measured base, ± U" } } th { "E" sub { "n" } }
                th { "Predicted" small { "ideal base, ± U" } } th { "E" sub { "n" } }
            } }
            tbody {
                @for point in &experiment.points {
                    @for (n, own) in point.metrics.iter().enumerate() { (row(point, own, n == 0)) }
                    @let about = remarks(point);
                    @if !about.is_empty() { tr { td {} td.word colspan="7" { (about) } } }
                }
            }
        } }
    }
}

fn row(point: &ComparedPoint, own: &ComparedMetric, is_first: bool) -> Markup {
    let (unit, scale) = own.metric.shown_unit();
    let value = |value: f64, expanded: f64| with_uncertainty(value * scale, expanded * scale).replace('-', "−");
    let predicted = |p: &Option<Predicted>| p.as_ref().map_or("–".into(), |p| value(p.value.value, p.value.expanded));
    let error = |p: &Option<Predicted>| {
        p.as_ref().map_or("–".into(), |p| normalised_error(p.normalised_error).replace('-', "−"))
    };
    html! {
        tr.first[is_first] {
            td { @if is_first { (point.frequency_hz.map_or("–".into(), |f| trimmed(f, 4))) } }
            td.word.short { (own.metric.name()) @if !unit.is_empty() { " (" (unit) ")" } }
            td.word.odd[own.verdict == Verdict::Differs] { (own.verdict.text()) }
            td.short { (value(own.measured.value, own.measured.expanded)) }
            td.short { (predicted(&own.on_measured_base)) }
            td { (error(&own.on_measured_base)) }
            td.short { (predicted(&own.on_ideal_base)) }
            td { (error(&own.on_ideal_base)) }
        }
    }
}

fn remarks(point: &ComparedPoint) -> String {
    let sensitive =
        point.is_sensitive.then(|| "neighbouring starts part; the prediction is the mean over them".to_string());
    let without = point.without_measured_base.as_ref().map(|why| format!("without the measured base: {why}"));
    let all: Vec<String> = point.remarks.iter().cloned().chain(sensitive).chain(without).collect();
    all.join("; ")
}
