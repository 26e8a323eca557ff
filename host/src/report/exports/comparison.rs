//! Writes a comparison as CSV: a row for each quantity of each point, in SI units.

use std::io::Write;

use csv::Writer;

use crate::compare::{ComparedExperiment, ComparedMetric, ComparedPoint, Comparison, PredictedQuantity};

/// The columns. Uncertainties are expanded, k = 2.
const COLUMNS: [&str; 16] = [
    "set_up",
    "experiment",
    "kind",
    "frequency_hz",
    "quantity",
    "unit",
    "measured",
    "measured_expanded",
    "on_measured_base",
    "on_measured_base_expanded",
    "on_measured_base_error",
    "on_ideal_base",
    "on_ideal_base_expanded",
    "on_ideal_base_error",
    "verdict",
    "is_sensitive",
];

/// Writes all rows.
///
/// # Errors
/// What the writer says.
pub fn write_csv(comparison: &Comparison, to: impl Write) -> Result<(), csv::Error> {
    let mut table = Writer::from_writer(to);
    table.write_record(COLUMNS)?;
    for experiment in &comparison.experiments {
        for point in &experiment.points {
            for own in &point.metrics {
                table.write_record(record(experiment, point, own))?;
            }
        }
    }
    table.flush()?;
    Ok(())
}

fn record(experiment: &ComparedExperiment, point: &ComparedPoint, own: &ComparedMetric) -> Vec<String> {
    let predicted = |p: &Option<PredictedQuantity>| {
        p.map_or(Default::default(), |p| [p.value.value, p.value.expanded, p.normalised_error].map(|v| v.to_string()))
    };
    let mut cells = vec![
        experiment.set_up.clone(),
        experiment.experiment.clone(),
        experiment.kind.to_string(),
        point.frequency_hz.map_or(String::new(), |f| f.to_string()),
        own.metric.name().to_string(),
        own.unit.to_string(),
        own.measured.value.to_string(),
        own.measured.expanded.to_string(),
    ];
    cells.extend::<[String; 3]>(predicted(&own.on_measured_base));
    cells.extend::<[String; 3]>(predicted(&own.on_ideal_base));
    cells.extend([own.verdict.text().to_string(), point.is_sensitive.to_string()]);
    cells
}
