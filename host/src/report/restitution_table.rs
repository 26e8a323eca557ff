//! Table of restitution over the approach speed, CSV or Parquet: a row for each impact of drop tests.

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::identify::restitution::Impact;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet;
use crate::table::{Column, TableBuilder};

/// The table; `taken_from` are the files. What was not measured is NaN.
///
/// # Errors
/// The table library's error.
pub fn table(impacts: &[Impact], taken_from: &str) -> Result<RecordBatch, Failure> {
    let optional = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let uncertainty = |name: &str, unit: &str, of: &str| {
        Column::new(
            name,
            unit,
            format!("standard uncertainty of the {of} as far as the measurement shows it; 0 where it does not"),
        )
    };
    let (speed, e) = ("approach speed", "coefficient of restitution");
    let sideways = |impact: &Impact, place: usize| impact.sideways_m_per_s.map_or(f64::NAN, |both| both[place]);
    let table = TableBuilder::new(impacts)
        .column(Column::new("source", "", "file of the impact"), |impact| impact.source.clone())
        .column(Column::new("drop", "1", "number of the drop, from 1"), |impact| impact.drop)
        .column(Column::new("impact", "1", "number of the impact in its drop, from 1"), |impact| impact.number)
        .column(Column::new("t_s", "s", "time of the impact in its file"), |impact| optional(impact.time_s))
        .column(Column::new("speed_m_per_s", "m/s", speed), |impact| impact.speed_m_per_s)
        .column(uncertainty("speed_standard_uncertainty_m_per_s", "m/s", speed), |impact| {
            impact.speed_standard_uncertainty_m_per_s
        })
        .column(Column::new("coefficient", "1", e), |impact| impact.coefficient)
        .column(uncertainty("coefficient_standard_uncertainty", "1", e), |impact| {
            impact.coefficient_standard_uncertainty
        })
        .column(Column::new("coefficient_by_times", "1", format!("{e} by the times of the flights")), |impact| {
            optional(impact.coefficient_by_times)
        })
        .column(Column::new("coefficient_by_heights", "1", format!("{e} by the heights of the flights")), |impact| {
            optional(impact.coefficient_by_heights)
        })
        .column(Column::new("sideways_before_m_per_s", "m/s", "speed along the floor before the impact"), |impact| {
            sideways(impact, 0)
        })
        .column(Column::new("sideways_after_m_per_s", "m/s", "speed along the floor after the impact"), |impact| {
            sideways(impact, 1)
        });
    let about = of_file("a row for each impact").with("damprig.taken_from", taken_from);
    Ok(sealed_parquet::identified(&table.finish(about)?)?.0)
}
