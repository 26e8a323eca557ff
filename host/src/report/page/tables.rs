//! Tables of results on the report page, and its number and time formats.

use maud::{Markup, html};

use super::data::PageData;
use crate::host_time;
use crate::quantity::Quantity;
use crate::report::figures::campaign::mean_responses;
use crate::report::numbers::trimmed;
use crate::report::peak::{Peak, points_of};
use crate::run_folder::ResultRow;
use crate::run_folder::schema::results::steadiness_text;

/// Columns of the table of points, after the names.
const POINT_HEADS: [Quantity; 10] = [
    Quantity::FrequencyHz,
    Quantity::XOverZ,
    Quantity::XOverZLockIn,
    Quantity::MeanCycleMaxM,
    Quantity::ZAmplitudeM,
    Quantity::PhaseRad,
    Quantity::MaxAbsXM,
    Quantity::Cycles,
    Quantity::Steadiness,
    Quantity::Segment,
];

/// Columns of the table of transients before and after the error of the base.
const DISPLACEMENT_HEADS: [Quantity; 5] =
    [Quantity::MaxAbsXM, Quantity::PredictedMaxAbsXM, Quantity::RmsXM, Quantity::MaxAbsZM, Quantity::MaxAbsXMinusZM];
const DECAY_HEADS: [Quantity; 6] = [
    Quantity::Impacts,
    Quantity::PredictedImpacts,
    Quantity::StartM,
    Quantity::DampingRatio,
    Quantity::FrequencyHz,
    Quantity::Cycles,
];

/// Head of a column.
fn head(own: Quantity) -> Markup {
    let (label, unit) = own.head();
    html! { th { (label) @if !unit.is_empty() { small { (unit) } } } }
}

/// Date, time and UTC offset.
pub(super) fn moment(text: &str) -> String {
    match host_time::parse(text) {
        Some(time) => time.strftime("%Y-%m-%d %H:%M:%S %:z").to_string(),
        None => text.to_string(),
    }
}

/// A number with fixed decimals, or a dash for NaN.
pub(super) fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}").replace('-', "−") } else { "–".into() }
}

/// A number without trailing zeros, or a dash for NaN.
pub(super) fn short(value: f64, decimals: usize) -> String {
    if value.is_finite() { trimmed(value, decimals).replace('-', "−") } else { "–".into() }
}

/// Peak of X/Z (cycle maxima), a row for each experiment on each set-up.
pub(super) fn peaks(data: &PageData) -> Markup {
    html! {
        @if !curves(data).is_empty() {
            div.wide { table {
                thead { tr {
                    th.word { "Set-up" } th.word { "Experiment" }
                    th { "Peak X/Z" small { "cycle maxima" } } th { "X/Z there" small { "lock-in" } } th { "at" small { "Hz" } } th { "Peak" } th { "Steadiness" }
                    th { "Largest |x|" small { "mm" } } th { "Points" } th { "Settled points" small { "steady or stationary" } }
                } }
                tbody {
                    @for (set_up, experiment) in &curves(data) {
                        @let own = || data.points_of(set_up).filter(|p| p.experiment == *experiment);
                        @if let Some(peak) = own().max_by(|a, b| a.x_over_z().total_cmp(&b.x_over_z())) {
                            tr {
                                td.word { (label(data, set_up)) } td.word { (experiment) }
                                td { (number(peak.x_over_z(), 2)) }
                                td { (number(peak.x_over_z_lock_in(), 2)) }
                                td { (short(peak.frequency_hz, 4)) }
                                @match peak_of(data, set_up, experiment) {
                                    Some(peak) => { td.odd[!peak.is_resolved()] { (peak.verdict()) } }
                                    None => { td { "–" } }
                                }
                                td.odd[!peak.steadiness.is_settled()] { (steadiness_text(peak.steadiness)) }
                                td { (number(largest_m(own()) * 1e3, 2)) }
                                td { (own().count()) }
                                td { (own().filter(|p| p.steadiness.is_settled()).count()) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

/// A line for each peak that is not resolved.
pub(super) fn peak_notes(data: &PageData) -> Vec<String> {
    let Ok(campaign) = &data.campaign else { return Vec::new() };
    Peak::notes(campaign, &data.points)
}

/// What the dampers make of the peak of X/Z, a line for each experiment with its repeats.
pub(super) fn headlines(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    html! {
        @for line in Peak::headlines(campaign, |set_up, experiment| mean_responses(campaign, &data.points, set_up, experiment)) { p.headline { (line) } }
    }
}

/// The peak of an experiment on a set-up; none if the campaign cannot be read.
fn peak_of(data: &PageData, set_up: &str, experiment: &str) -> Option<Peak> {
    let campaign = data.campaign.as_ref().ok()?;
    let own = campaign.set_ups.iter().find(|own| own.name == set_up)?;
    let points = points_of(&data.points, set_up, experiment);
    Peak::measured(own, campaign.experiments.iter().find(|e| e.name == experiment)?, &points)
}

/// Largest |x| of a set-up, m; NaN without points.
pub(super) fn largest(data: &PageData, name: &str) -> f64 {
    largest_m(data.points_of(name))
}

fn largest_m<'a>(points: impl Iterator<Item = &'a ResultRow>) -> f64 {
    points.map(|p| f64::from(p.max_abs_x_m)).fold(f64::NAN, f64::max)
}

/// Set-ups and experiments with points that drove the base, in the order of the run.
fn curves(data: &PageData) -> Vec<(String, String)> {
    let mut curves: Vec<(String, String)> = Vec::new();
    for point in data.points.iter().filter(|point| !data.has_own_base(&point.experiment)) {
        let curve = (point.set_up.clone(), point.experiment.clone());
        if !curves.contains(&curve) {
            curves.push(curve);
        }
    }
    curves
}

/// Label of a set-up, with its name if they differ.
pub(super) fn label(data: &PageData, name: &str) -> String {
    let found = data.manifest.set_ups.iter().find(|s| s.name == name).map(|s| s.label.as_str());
    match found {
        Some(label) if !label.is_empty() && label != name => format!("{label} ({name})"),
        _ => name.to_string(),
    }
}

/// Table of all points, a row each.
pub(super) fn results(data: &PageData) -> Markup {
    let place = |p: &ResultRow| (p.set_up.clone(), p.experiment.clone());
    let mm = |metres: f32, decimals| number(f64::from(metres) * 1e3, decimals);
    let is_first = |n: usize| n > 0 && place(&data.points[n]) != place(&data.points[n - 1]);
    html! {
        div.wide { table {
            thead { tr {
                th.word { "Set-up" } th.word { "Experiment" }
                @for own in POINT_HEADS { (head(own)) }
            } }
            tbody {
                @for (n, point) in data.points.iter().enumerate() {
                    tr.first[is_first(n)] {
                        td.word { (point.set_up) }
                        td.word { (point.experiment) }
                        td { (short(point.frequency_hz, 4)) }
                        td { (number(point.x_over_z(), 3)) }
                        td { (number(point.x_over_z_lock_in(), 3)) }
                        td { (mm(point.mean_cycle_max_m, 3)) }
                        td.odd[point.drive_saturated] { (mm(point.z_amplitude_m, 4)) }
                        td { (number(f64::from(point.phase_rad).to_degrees(), 1)) }
                        td { (mm(point.max_abs_x_m, 2)) }
                        td { (point.cycles) }
                        td.odd[!point.steadiness.is_settled()] { (steadiness_text(point.steadiness)) }
                        td { (point.segment) }
                    }
                }
            }
        } }
        p.under { "Segment: number of earlier starts of the experiment on the set-up. "
            code { "results.parquet" } " has all columns in full precision." }
    }
}

/// Table of playbacks, impulses and free vibrations, a row each.
pub(super) fn transients(data: &PageData) -> Markup {
    let rows = data.taken.transients();
    let mm = |metres: f32| number(f64::from(metres) * 1e3, 3);
    html! {
        @if !rows.is_empty() {
            div.wide { table {
                thead { tr {
                    th.word { "Set-up" } th.word { "Experiment" } th.word { "Kind" }
                    @for own in DISPLACEMENT_HEADS { (head(own)) }
                    th { "Base error" small { "% of the demand" } }
                    @for own in DECAY_HEADS { (head(own)) }
                } }
                tbody {
                    @for row in rows {
                        tr {
                            td.word { (label(data, &row.set_up)) }
                            td.word { (row.experiment) }
                            td.word { (row.kind.replace('_', " ")) }
                            td { (mm(row.max_abs_x_m)) }
                            td { (number(row.predicted_max_abs_x_m * 1e3, 3)) }
                            td { (mm(row.rms_x_m)) }
                            td.odd[row.drive_saturated] { (mm(row.max_abs_z_m)) }
                            td { (mm(row.max_abs_x_minus_z_m)) }
                            td { (number(f64::from(100.0 * row.base_error_rms_m / row.wanted_rms_m), 2)) }
                            td { (row.impacts) }
                            td { (if row.predicted_max_abs_x_m.is_nan() { "–".to_string() } else { row.predicted_impacts.to_string() }) }
                            td { (number(row.start_m * 1e3, 3)) }
                            td { (number(row.damping_ratio, 5)) }
                            td { (number(row.frequency_hz, 4)) }
                            td { @if row.cycles > 0 { (row.cycles) } @else { "–" } }
                        }
                    }
                }
            } }
            p.under { "Predicted and measured are compared in words under the table of set-ups." }
            p.under { code { "transients.parquet" } " has all columns." }
        }
    }
}
