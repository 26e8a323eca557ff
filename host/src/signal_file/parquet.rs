//! Parquet files: their columns of numbers.

use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::Contents;
use super::columns::{FileColumn, signals};
use super::unit::of_column;
use crate::table::values::numbers;

/// Parses a Parquet file.
pub(super) fn parse(bytes: &[u8]) -> Result<Contents, String> {
    let damaged = |error: &dyn std::fmt::Display| format!("the Parquet file cannot be read: {error}");
    let reader = ParquetRecordBatchReaderBuilder::try_new(Bytes::copy_from_slice(bytes))
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(|error| damaged(&error))?;
    let batches: Result<Vec<_>, _> = reader.collect();
    let batches = batches.map_err(|error| damaged(&error))?;
    let (mut columns, mut remarks) = (Vec::new(), Vec::new());
    let Some(first) = batches.first() else { return Err("it has no rows".into()) };
    for field in first.schema().fields() {
        let values: Result<Vec<Vec<f64>>, _> = batches.iter().map(|batch| numbers(batch, field.name())).collect();
        let Ok(values) = values else {
            remarks.push(format!("The column {:?} is not read: it has no numbers.", field.name()));
            continue;
        };
        let (name, of_name) = of_column(field.name());
        let unit_text = field.metadata().get("unit").cloned().unwrap_or(of_name);
        let values: Vec<f64> = values.concat();
        if values.iter().all(|value| value.is_finite()) {
            columns.push(FileColumn { name, unit_text, values, imaginary: None });
        } else {
            remarks.push(format!("The column {:?} is not read: values are missing.", field.name()));
        }
    }
    Ok(Contents { kind: "Parquet table", signals: signals(columns, &mut remarks), remarks })
}
