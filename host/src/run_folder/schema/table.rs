//! Builds Arrow tables column by column; every column carries its unit and description as metadata.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema};

/// Key of what a row of the table is, in the metadata of its schema.
pub const DESCRIPTION: &str = "damprig.description";

/// A column without missing values, with its unit.
#[must_use]
pub fn field(name: &str, kind: DataType, unit: &str) -> Field {
    Field::new(name, kind, false).with_metadata(HashMap::from([("unit".to_string(), unit.to_string())]))
}

/// The column with its meaning.
pub(crate) fn described(field: Field, description: &str) -> Field {
    let mut metadata = field.metadata().clone();
    metadata.insert("description", description);
    field.with_metadata(metadata)
}

/// Name, unit ("1" for a ratio or a count, "" for names and flags) and description (may be empty) of a column.
type About = (&'static str, &'static str, &'static str);

/// A table of `rows` under construction.
pub(super) struct TableBuilder<'r, R> {
    rows: &'r [R],
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
}

impl<'r, R> TableBuilder<'r, R> {
    pub(super) fn new(rows: &'r [R]) -> Self {
        Self { rows, fields: Vec::new(), arrays: Vec::new() }
    }

    fn column(mut self, (name, unit, description): About, array: ArrayRef) -> Self {
        let mut field = field(name, array.data_type().clone(), unit);
        if !description.is_empty() {
            field = described(field, description);
        }
        self.fields.push(field);
        self.arrays.push(array);
        self
    }

    pub(super) fn text(self, about: About, get: impl Fn(&'r R) -> &'r str) -> Self {
        let array = Arc::new(StringArray::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn f64(self, about: About, get: impl Fn(&'r R) -> f64) -> Self {
        let array = Arc::new(Float64Array::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn f32(self, about: About, get: impl Fn(&'r R) -> f32) -> Self {
        let array = Arc::new(Float32Array::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn u32(self, about: About, get: impl Fn(&'r R) -> u32) -> Self {
        let array = Arc::new(UInt32Array::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn u64(self, about: About, get: impl Fn(&'r R) -> u64) -> Self {
        let array = Arc::new(UInt64Array::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn i32(self, about: About, get: impl Fn(&'r R) -> i32) -> Self {
        let array = Arc::new(Int32Array::from_iter_values(self.rows.iter().map(get)));
        self.column(about, array)
    }

    pub(super) fn bool(self, about: About, get: impl Fn(&'r R) -> bool) -> Self {
        let array = Arc::new(self.rows.iter().map(|row| Some(get(row))).collect::<BooleanArray>());
        self.column(about, array)
    }

    /// The table.
    ///
    /// # Errors
    /// When the columns differ in length: a defect of this module.
    pub(super) fn finish(self) -> Result<RecordBatch, String> {
        RecordBatch::try_new(Arc::new(Schema::new(self.fields)), self.arrays).map_err(|e| e.to_string())
    }
}
