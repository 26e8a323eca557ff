//! Text of `damprig calibrate`: the points with their residuals, the settings before and after, the verdict.

use super::plain_table;
use crate::calibrate::record::CalibrationRecord;
use crate::calibrate::{CalibrationPoint, Channel};
use crate::report::numbers::{significant, with_uncertainty};
use crate::settings::decimal;

/// The calibration in words and tables.
#[must_use]
pub fn text(record: &CalibrationRecord) -> String {
    let channel = record.kind();
    let about = channel.about();
    let (date, before) = (&record.date, &record.before);
    let mut text =
        format!("Calibration of {channel} ({about}), {date}; before: {before}\nTaken from {}\n", record.taken_from);
    text += &format!("{}\n", points(record));
    let (unit, factor) = channel.shown_reading();
    text += &format!("residual: {} {unit} (RMS per degree of freedom)\n", significant(record.residual * factor, 3));
    let mut estimates = plain_table(&["quantity", "value ± standard uncertainty", "95 % interval", "unit", "method"]);
    for estimate in &record.estimates {
        let [low, high] = estimate.interval_95.map(|end| significant(end, 7));
        estimates.add_row([
            estimate.quantity.to_string(),
            with_uncertainty(estimate.value, estimate.standard_uncertainty),
            format!("{low} to {high}"),
            estimate.unit.to_string(),
            estimate.method.to_string(),
        ]);
    }
    text += &format!("{estimates}\n");
    if !record.changes.is_empty() {
        let mut changes = plain_table(&["setting", "before", "after"]);
        for change in &record.changes {
            changes.add_row([change.setting.clone(), decimal(change.before), decimal(change.after)]);
        }
        text += &format!("{changes}\n");
    }
    text += &format!("Verdict: {}", record.verdict);
    record.remarks.iter().for_each(|remark| text += &format!("\n{remark}"));
    record.checked.iter().for_each(|point| text += &checked(channel, point));
    text
}

/// The points as a table.
fn points(record: &CalibrationRecord) -> comfy_table::Table {
    let channel = record.kind();
    let ((reference, of_reference), (reading, of_reading)) = (channel.shown_reference(), channel.shown_reading());
    let has_side = record.points.iter().any(|p| p.side != 0);
    let has_frequency = record.points.iter().any(|p| p.frequency_hz > 0.0);
    let mut header = vec!["point".to_string()];
    header.extend(has_side.then(|| "wall".to_string()));
    header.extend(has_frequency.then(|| "frequency (Hz)".to_string()));
    header.extend([
        format!("reference ({reference})"),
        format!("reading ({reading})"),
        format!("residual ({reading})"),
    ]);
    let mut table = plain_table(&header.iter().map(String::as_str).collect::<Vec<_>>());
    for (place, (point, residual)) in record.points.iter().zip(&record.residuals).enumerate() {
        let mut row = vec![(place + 1).to_string()];
        row.extend(has_side.then(|| if point.side > 0 { "+d".to_string() } else { "−d".to_string() }));
        row.extend(
            has_frequency
                .then(|| if point.frequency_hz > 0.0 { significant(point.frequency_hz, 4) } else { "–".to_string() }),
        );
        let outlier = if record.outliers.contains(&place) { "  outlier" } else { "" };
        row.extend([
            format!("{:.5}", point.reference * of_reference + 0.0),
            format!("{:.5}", point.reading * of_reading + 0.0),
            format!("{:+.5}{outlier}", residual * of_reading),
        ]);
        table.add_row(row);
    }
    table
}

/// A point that was measured with the new settings.
fn checked(channel: Channel, point: &CalibrationPoint) -> String {
    let ((reference, of_reference), (reading, of_reading)) = (channel.shown_reference(), channel.shown_reading());
    format!(
        "\nChecked with the new settings: {:.5} {reference} reads {:.5} {reading}, {:+.5} {reading} off",
        point.reference * of_reference,
        point.reading * of_reading,
        (point.reading - point.reference) * of_reading
    )
}
