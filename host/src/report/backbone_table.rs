//! Table of damping ratio and frequency over the amplitude, CSV or Parquet: a row for each window of a free vibration.

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::identify::backbone::Row;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet;
use crate::table::{Column, TableBuilder};

/// The table; `taken_from` is the record.
///
/// # Errors
/// The table library's error.
pub fn table(rows: &[Row], taken_from: &str) -> Result<RecordBatch, Failure> {
    let end =
        |name: &str, unit: &str, of: &str| Column::new(name, unit, format!("end of the 95 % interval of the {of}"));
    let (zeta, frequency) = ("damping ratio", "natural frequency");
    let uncertainty =
        |name: &str, unit: &str, of: &str| Column::new(name, unit, format!("standard uncertainty of the {of}"));
    let table = TableBuilder::new(rows)
        .column(Column::new("from_s", "s", "first time of the window"), |row| row.from_s)
        .column(Column::new("to_s", "s", "last time of the window"), |row| row.to_s)
        .column(Column::new("amplitude_m", "m", "amplitude of the window"), |row| row.amplitude_m)
        .column(Column::new("damping_ratio", "1", zeta), |row| row.damping_ratio)
        .column(uncertainty("damping_ratio_standard_uncertainty", "1", zeta), |row| {
            row.damping_ratio_standard_uncertainty
        })
        .column(end("damping_ratio_low", "1", zeta), |row| row.damping_ratio_interval_95[0])
        .column(end("damping_ratio_high", "1", zeta), |row| row.damping_ratio_interval_95[1])
        .column(Column::new("natural_frequency_hz", "Hz", frequency), |row| row.natural_frequency_hz)
        .column(uncertainty("natural_frequency_standard_uncertainty_hz", "Hz", frequency), |row| {
            row.natural_frequency_standard_uncertainty_hz
        })
        .column(end("natural_frequency_low_hz", "Hz", frequency), |row| row.natural_frequency_interval_95_hz[0])
        .column(end("natural_frequency_high_hz", "Hz", frequency), |row| row.natural_frequency_interval_95_hz[1]);
    let about = of_file("a row for each window of a free vibration").with("damprig.taken_from", taken_from);
    Ok(sealed_parquet::identified(&table.finish(about)?)?.0)
}
