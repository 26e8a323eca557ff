//! Sensitivity indices as text.

use super::{Block, Rows};
use crate::report::numbers::significant;
use crate::study::bootstrap::IntervalEstimate;
use crate::study::sensitivity::SensitivityIndices;

/// What they are, then a table with a row for each key.
#[must_use]
pub fn blocks(sensitivity: &SensitivityIndices) -> Vec<Block> {
    let SensitivityIndices { column, unit, used, left_out, .. } = sensitivity;
    let (what, header, kind): (&str, &[&str], &str) = if sensitivity.is_of_variance() {
        ("shares of the variance of", &["key", "first order", "95 %", "total", "95 %"], "base points")
    } else {
        ("elementary effects on", &["key", "mean", "95 %", "µ*", "95 %", "σ", "95 %"], "trajectories")
    };
    let unit = if sensitivity.is_of_variance() || *unit == "1" { String::new() } else { format!(" ({unit})") };
    let mut text = format!("{what} {column}{unit}, {used} {kind}");
    if *left_out > 0 {
        text.push_str(&format!("; {left_out} are left out: {column} is missing at one of their points"));
    }
    let cells = |estimate: &IntervalEstimate| {
        let [low, high] = estimate.interval_95.map(number);
        [number(estimate.value), format!("{low} to {high}")]
    };
    let mut rows = Rows::new(header);
    for (key, estimates) in sensitivity.by_key() {
        rows.add([key.to_string()].into_iter().chain(estimates.iter().flat_map(cells)));
    }
    let table = (!sensitivity.indices.is_empty()).then_some(Block::Table(rows));
    std::iter::once(Block::Text(text)).chain(table).collect()
}

fn number(value: f64) -> String {
    if value.is_nan() { "–".into() } else { significant(value, 3) }
}
