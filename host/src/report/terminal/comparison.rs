//! Text of `damprig compare`: a row for each point, and the quantities that differ.

use super::table;
use crate::compare::{
    ComparedExperiment, ComparedMetric, ComparedPoint, Comparison, PredictedQuantity, UncertainValue, Verdict,
};
use crate::quantity::Quantity;
use crate::report::numbers::{normalised_error, trimmed, with_uncertainty};

/// Most differences that are listed.
const MAX_LISTED: usize = 24;

/// The lines below the header of the comparison.
#[must_use]
pub fn text(comparison: &Comparison) -> String {
    let mut lines = vec![points(comparison)];
    let (all, agreeing) = comparison.counts();
    lines.push(if all == 0 {
        "No quantity could be compared.".into()
    } else {
        format!("{agreeing} of {all} quantities agree: |E_n| ≤ 1 with expanded uncertainties, k = 2.")
    });
    let differences = differences(comparison);
    if !differences.is_empty() {
        lines.push("Differences:".into());
        lines.extend(differences.iter().take(MAX_LISTED).cloned());
        let more = differences.len().saturating_sub(MAX_LISTED);
        lines.extend((more > 0).then(|| format!("  and {more} more; --out or --json has all")));
    }
    for experiment in &comparison.experiments {
        lines.extend(experiment.notes.iter().map(|note| format!("{}: {note}", place(experiment, None))));
    }
    lines.extend(without_measured_base(comparison));
    lines.extend(comparison.assumptions.iter().cloned());
    lines.extend(comparison.missing.iter().map(|what| format!("Not compared: {what}")));
    lines.join("\n")
}

fn place(experiment: &ComparedExperiment, point: Option<&ComparedPoint>) -> String {
    let at = point.and_then(|point| point.frequency_hz).map_or(String::new(), |f| format!(", {} Hz", trimmed(f, 4)));
    format!("{}, {}{at}", experiment.set_up, experiment.experiment)
}

/// The quantity of a point that its row shows.
fn leading(point: &ComparedPoint) -> Option<&ComparedMetric> {
    point.metric(Quantity::XOverZ).or_else(|| point.metric(Quantity::RmsXM))
}

fn shown(metric: Quantity, value: &UncertainValue) -> String {
    let scale = metric.shown_unit().1;
    with_uncertainty(value.value * scale, value.expanded * scale)
}

fn points(comparison: &Comparison) -> String {
    let header = [
        "point",
        "measured",
        "predicted\n(measured base)",
        "E_n",
        "predicted\n(ideal base)",
        "E_n",
        "agree",
        "verdict",
    ];
    let mut table = table(&header);
    for experiment in &comparison.experiments {
        for point in &experiment.points {
            let Some(own) = leading(point) else { continue };
            let (unit, _) = own.metric.shown_unit();
            let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
            let value =
                |p: &Option<PredictedQuantity>| p.as_ref().map_or("–".into(), |p| shown(own.metric, &p.value));
            let error = |p: &Option<PredictedQuantity>| {
                p.as_ref().map_or("–".into(), |p| normalised_error(p.normalised_error))
            };
            let compared = || point.metrics.iter().filter_map(ComparedMetric::predicted);
            let sensitive = if point.is_sensitive { "\n(sensitive)" } else { "" };
            table.add_row([
                format!("{}\n{}{unit}", place(experiment, Some(point)), own.metric.label()),
                shown(own.metric, &own.measured),
                value(&own.on_measured_base),
                error(&own.on_measured_base),
                value(&own.on_ideal_base),
                error(&own.on_ideal_base),
                format!("{} of {}", compared().filter(|p| p.agrees()).count(), compared().count()),
                format!("{}{sensitive}", own.verdict.text()),
            ]);
        }
    }
    table.to_string()
}

/// A line for each quantity that differs, with what may explain it.
fn differences(comparison: &Comparison) -> Vec<String> {
    let mut lines = Vec::new();
    for experiment in &comparison.experiments {
        for point in &experiment.points {
            let differing = point.metrics.iter().filter(|own| own.verdict == Verdict::Differs);
            for own in differing {
                let Some(predicted) = own.predicted() else { continue };
                let (unit, _) = own.metric.shown_unit();
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                let why =
                    if point.remarks.is_empty() { String::new() } else { format!(" ({})", point.remarks.join("; ")) };
                lines.push(format!(
                    "  {}: {} measured {}{unit}, predicted {}{unit}, E_n = {}{why}",
                    place(experiment, Some(point)),
                    own.metric.label(),
                    shown(own.metric, &own.measured),
                    shown(own.metric, &predicted.value),
                    normalised_error(predicted.normalised_error)
                ));
            }
        }
    }
    lines
}

/// Why points have no simulation on the measured base, each reason once.
fn without_measured_base(comparison: &Comparison) -> Vec<String> {
    let mut reasons: Vec<(String, usize)> = Vec::new();
    for point in comparison.experiments.iter().flat_map(|experiment| &experiment.points) {
        let Some(why) = &point.without_measured_base else { continue };
        match reasons.iter_mut().find(|(known, _)| known == why) {
            Some((_, count)) => *count += 1,
            None => reasons.push((why.clone(), 1)),
        }
    }
    reasons.into_iter().map(|(why, count)| format!("Without the measured base ({count} points): {why}.")).collect()
}
