//! Table of tracked resonances, CSV: a row for each measured point, and one for each that the set-up's model gives.

use std::path::Path;

use super::resonance::{TrackedCurve, TrackedPoint};
use crate::campaign::Campaign;
use crate::failure::Failure;
use crate::run_folder::own_files;
use crate::run_folder::schema::self_description::of_file;
use crate::table::csv::{CsvTable, Heads};
use crate::table::{Column, TableBuilder, Word};

/// A row.
struct ResonanceRow<'a> {
    set_up: &'a str,
    experiment: &'a str,
    from: &'static str,
    point: &'a TrackedPoint,
}

/// Writes the table of a run into its folder.
///
/// # Errors
/// Names the file when it cannot be written.
pub fn write(campaign: &Campaign, curves: &[TrackedCurve], path: &Path) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for curve in curves {
        let (set_up, experiment) = (campaign.set_ups[curve.set_up].name.as_str(), curve.experiment.as_str());
        for (from, points) in [("measured", &curve.measured), ("predicted", &curve.predicted)] {
            rows.extend(points.iter().map(|point| ResonanceRow { set_up, experiment, from, point }));
        }
    }
    let number = |name: &str, unit: &str, meaning: &str| Column::new(name, unit, meaning);
    let end = |name: &str, unit: &str| number(name, unit, "end of the 95 % interval");
    let table = TableBuilder::new(&rows)
        .column(number("set_up", "", "set-up"), |row| row.set_up.to_string())
        .column(number("experiment", "", "experiment"), |row| row.experiment.to_string())
        .column(number("from", "", "measured, or predicted from the model of the set-up"), |row| Word(row.from))
        .column(number("asked", "", "amplitude that was asked for"), |row| row.point.asked.clone())
        .column(number("resonance", "", "whether the point is at its resonance"), |row| Word(row.point.found.text()))
        .column(number("frequency_hz", "Hz", "mean frequency of the drive"), |row| row.point.frequency_hz)
        .column(number("phase_rad", "rad", "phase of x relative to z"), |row| row.point.phase_rad)
        .column(number("x_amplitude_m", "m", "amplitude of x at the drive frequency"), |row| row.point.x_m)
        .column(number("z_amplitude_m", "m", "amplitude of the base"), |row| row.point.z_m)
        .column(number("natural_frequency_hz", "Hz", "equivalent natural frequency"), |row| {
            row.point.natural_frequency_hz
        })
        .column(end("natural_frequency_low_hz", "Hz"), |row| row.point.natural_frequency_hz - row.point.frequency_95_hz)
        .column(end("natural_frequency_high_hz", "Hz"), |row| {
            row.point.natural_frequency_hz + row.point.frequency_95_hz
        })
        .column(number("damping_ratio", "1", "equivalent damping ratio"), |row| row.point.damping_ratio)
        .column(end("damping_ratio_low", "1"), |row| row.point.damping_ratio - row.point.damping_ratio_95)
        .column(end("damping_ratio_high", "1"), |row| row.point.damping_ratio + row.point.damping_ratio_95)
        .finish(of_file("a row for each point of a tracked resonance"))?;
    let failed = |e: &dyn std::fmt::Display| Failure::cannot("write", path, e.to_string());
    let mut bytes = Vec::new();
    let mut csv = CsvTable::new(&mut bytes, &table.schema(), Heads::Names).map_err(|e| failed(&e))?;
    csv.write(&table).and_then(|()| csv.finish().map(drop)).map_err(|e| failed(&e))?;
    own_files::replace(path, &bytes).map_err(|e| failed(&e))
}
