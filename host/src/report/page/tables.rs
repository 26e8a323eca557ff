//! The tables of results, and how numbers and times are written on the page.

use maud::{Markup, html};

use super::facts::{Facts, Point};
use crate::report::figures::campaign::trimmed;

/// A date and time with its zone, without what a reader does not need.
pub(super) fn moment(text: &str) -> String {
    match text.parse::<jiff::Zoned>() {
        Ok(time) => time.strftime("%Y-%m-%d %H:%M:%S %:z").to_string(),
        Err(_) => text.to_string(),
    }
}

/// A number, or a dash where there is none.
pub(super) fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}").replace('-', "−") } else { "–".into() }
}

/// The same without trailing zeros.
pub(super) fn short(value: f64, decimals: usize) -> String {
    if value.is_finite() { trimmed(value, decimals).replace('-', "−") } else { "–".into() }
}

pub(super) fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or("–".into(), |v| short(v, decimals))
}

fn yes_no(value: bool) -> &'static str {
    if value { "yes" } else { "no" }
}

/// Each set-up's highest X/Z.
pub(super) fn peaks(facts: &Facts) -> Markup {
    let names = set_ups(facts);
    html! {
        @if !facts.points.is_empty() {
            div.wide { table {
                thead { tr {
                    th.word { "Set-up" }
                    th { "Peak X/Z" } th { "at" small { "Hz" } } th { "Steady" }
                    th { "Largest |x|" small { "mm" } } th { "Points" } th { "of them steady" }
                } }
                tbody {
                    @for name in &names {
                        @if let Some(peak) = peak(facts, name) {
                            tr {
                                td.word { (label(facts, name)) }
                                td { (number(peak.shown.x_over_z, 2)) }
                                td { (short(peak.shown.frequency_hz, 4)) }
                                td.odd[!peak.shown.steady] { (yes_no(peak.shown.steady)) }
                                td { (number(largest(facts, name) * 1e3, 2)) }
                                td { (facts.points_of(name).count()) }
                                td { (facts.points_of(name).filter(|p| p.shown.steady).count()) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

fn peak<'a>(facts: &'a Facts, name: &'a str) -> Option<&'a Point> {
    facts.points_of(name).max_by(|a, b| a.shown.x_over_z.total_cmp(&b.shown.x_over_z))
}

/// Largest |x| that a set-up came to, m; NaN without a point.
pub(super) fn largest(facts: &Facts, name: &str) -> f64 {
    facts.points_of(name).map(|p| p.x_max_m).fold(f64::NAN, f64::max)
}

/// The set-ups that have points, in the order in which those were run.
fn set_ups(facts: &Facts) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for point in &facts.points {
        if !names.contains(&point.shown.set_up) {
            names.push(point.shown.set_up.clone());
        }
    }
    names
}

/// A set-up's name for people, with the one of the tables where that is another.
pub(super) fn label(facts: &Facts, name: &str) -> String {
    let found = facts.manifest.set_ups.iter().find(|s| s.name == name).map(|s| s.label.as_str());
    match found {
        Some(label) if !label.is_empty() && label != name => format!("{label} ({name})"),
        _ => name.to_string(),
    }
}

/// A row a point.
pub(super) fn results(facts: &Facts) -> Markup {
    let place = |p: &Point| (p.shown.set_up.clone(), p.experiment.clone());
    let is_first = |n: usize| n > 0 && place(&facts.points[n]) != place(&facts.points[n - 1]);
    html! {
        div.wide { table {
            thead { tr {
                th.word { "Set-up" } th.word { "Experiment" }
                th { "f" small { "Hz" } } th { "X/Z" }
                th { "X" small { "mm, mean cycle max" } } th { "Z" small { "mm, lock-in" } }
                th { "Phase" small { "°" } } th { "max|x|" small { "mm" } }
                th { "Cycles" } th { "Steady" } th { "Segment" }
            } }
            tbody {
                @for (n, point) in facts.points.iter().enumerate() {
                    tr.first[is_first(n)] {
                        td.word { (point.shown.set_up) }
                        td.word { (point.experiment) }
                        td { (short(point.shown.frequency_hz, 4)) }
                        td { (number(point.shown.x_over_z, 3)) }
                        td { (number(point.x_m * 1e3, 3)) }
                        td.odd[point.saturated] { (number(point.z_m * 1e3, 4)) }
                        td { (number(point.shown.phase_rad.to_degrees(), 1)) }
                        td { (number(point.x_max_m * 1e3, 2)) }
                        td { (point.cycles) }
                        td.odd[!point.shown.steady] { (yes_no(point.shown.steady)) }
                        td { (point.segment) }
                    }
                }
            }
        } }
        p.under { "Segment: how many times the experiment had been started on the set-up before. "
            code { "results.parquet" } " has all columns in full precision." }
    }
}

/// A row a record, pulse or free vibration; nothing when there are none.
pub(super) fn transients(facts: &Facts) -> Markup {
    let rows = facts.taken.transients();
    let mm = |metres: f32| number(f64::from(metres) * 1e3, 3);
    html! {
        @if !rows.is_empty() {
            div.wide { table {
                thead { tr {
                    th.word { "Set-up" } th.word { "Experiment" } th.word { "Kind" }
                    th { "max|x|" small { "mm" } } th { "predicted" small { "mm" } }
                    th { "RMS x" small { "mm" } } th { "max|z|" small { "mm" } }
                    th { "max|x−z|" small { "mm" } } th { "Base error" small { "% of the demand" } }
                    th { "Impacts" } th { "x0" small { "mm" } } th { "ζ" small { "of its decay" } }
                    th { "f" small { "Hz" } } th { "Cycles" }
                } }
                tbody {
                    @for row in rows {
                        tr {
                            td.word { (label(facts, &row.set_up)) }
                            td.word { (row.experiment) }
                            td.word { (row.kind.replace('_', " ")) }
                            td { (mm(row.x_peak_m)) }
                            td { (number(row.predicted_x_peak_m * 1e3, 3)) }
                            td { (mm(row.x_rms_m)) }
                            td.odd[row.drive_saturated] { (mm(row.z_peak_m)) }
                            td { (mm(row.relative_peak_m)) }
                            td { (number(f64::from(100.0 * row.base_error_rms_m / row.wanted_rms_m), 2)) }
                            td { (row.impacts) }
                            td { (number(row.start_m * 1e3, 3)) }
                            td { (number(row.damping_ratio, 5)) }
                            td { (number(row.frequency_hz, 4)) }
                            td { @if row.cycles > 0 { (row.cycles) } @else { "–" } }
                        }
                    }
                }
            } }
            p.under { code { "transients.parquet" } " has all columns, " code { "transients.png" } " x over time." }
        }
    }
}
