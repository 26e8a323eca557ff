//! The table of a study, for figures.

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_select::concat::concat_batches;
use bytes::Bytes;

use super::Study;
use super::axis::AxisValues;
use super::evaluate::main_column;
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::run_folder::read::parquet_file;

/// Relative difference of cycle maxima, or of the response between starts, from which a point is marked in a map.
pub const MARKED: f64 = 0.01;

/// Values on both axes from which a map is drawn. Fewer of one axis are a curve each.
pub const MIN_OF_MAP: usize = 8;

/// A table that has been read.
#[derive(Clone, Debug)]
pub struct StudyTable {
    batch: RecordBatch,
}

impl StudyTable {
    /// Reads a file's content; `shown` is its name in messages.
    ///
    /// # Errors
    /// A file that is damaged.
    pub fn read(shown: &str, bytes: Bytes) -> Result<Self, Failure> {
        let batches = parquet_file::content(shown, bytes)?.batches;
        let failed = |error: &dyn std::fmt::Display| Failure::Storage(format!("{shown}: {error}"));
        let schema = batches.first().map(RecordBatch::schema).ok_or_else(|| failed(&"it has no rows"))?;
        Ok(Self { batch: concat_batches(&schema, &batches).map_err(|error| failed(&error))? })
    }

    /// The numbers of a column, one for each row; what is missing is not a number. `None` without such a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.batch.column_by_name(name)?.as_primitive_opt::<Float64Type>()?;
        Some(column.iter().map(|value| value.unwrap_or(f64::NAN)).collect())
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.batch.num_rows()
    }

    /// Names of the columns.
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        self.batch.schema().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// The words of a column, one for each row. `None` without such a column.
    #[must_use]
    pub fn words(&self, name: &str) -> Option<Vec<String>> {
        let column = self.batch.column_by_name(name)?.as_string_opt::<i32>()?;
        Some(column.iter().map(|word| word.unwrap_or_default().to_string()).collect())
    }

    /// Where the motion differs from cycle to cycle: the largest cycle maximum is above their mean by [`MARKED`]. `None` if the
    /// study has no such metric.
    #[must_use]
    pub fn varies(&self, study: &Study) -> Option<Vec<bool>> {
        let spread = self.column(&main_column(study, Quantity::CycleSpread))?;
        Some(spread.iter().map(|spread| *spread > MARKED).collect())
    }

    /// Where the response depends on the start: the metric's values over the starts differ by [`MARKED`]. `None` without several
    /// starts.
    #[must_use]
    pub fn depends_on_start(&self, study: &Study, metric: Quantity) -> Option<Vec<bool>> {
        study.ensemble.as_ref()?;
        let [least, most] = ["min", "max"].map(|end| self.column(&format!("{}_{end}", metric.name())));
        Some(least?.iter().zip(most?).map(|(least, most)| most - least > MARKED * most.abs()).collect())
    }
}

/// The numbers along a kept axis, if it is a grid of them.
#[must_use]
pub fn numbers(study: &Study, place: usize) -> Option<&[f64]> {
    match &study.axes[place].values {
        AxisValues::Numbers(numbers) => Some(numbers),
        _ => None,
    }
}
