//! Table of response spectra, CSV or Parquet: a row for each damping ratio and period.

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::run_folder::schema::self_description::of_file;
use crate::run_folder::sealed_parquet;
use crate::spectrum::{PeakMethod, SpectrumPoint};
use crate::table::{Column, TableBuilder};

/// The table; `record` names the file of the record.
///
/// # Errors
/// The table library's error.
pub fn table(points: &[SpectrumPoint], record: &str, method: PeakMethod) -> Result<RecordBatch, Failure> {
    let table = TableBuilder::new(points)
        .column(Column::new("damping_ratio", "1", "damping ratio of the oscillator"), |p| p.damping_ratio)
        .column(Column::new("period_s", "s", "undamped period of the oscillator"), |p| p.period_s)
        .column(Column::new("sd_m", "m", "largest displacement relative to the ground"), |p| p.sd_m)
        .column(Column::new("sv_m_per_s", "m/s", "largest velocity relative to the ground"), |p| p.sv_m_per_s)
        .column(Column::new("sa_m_per_s2", "m/s^2", "largest absolute acceleration"), |p| p.sa_m_per_s2)
        .column(Column::new("psv_m_per_s", "m/s", "pseudo velocity, Sd times the angular frequency"), |p| p.psv_m_per_s)
        .column(Column::new("psa_m_per_s2", "m/s^2", "pseudo acceleration, Sd times its square"), |p| p.psa_m_per_s2);
    let about = of_file("a row for each damping ratio and period of a response spectrum")
        .with("damprig.record", record)
        .with("damprig.method", method.text());
    Ok(sealed_parquet::identified(&table.finish(about)?)?.0)
}
