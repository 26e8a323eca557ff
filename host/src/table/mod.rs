//! Tables: [`TableBuilder`] makes one of rows of one type and columns that say by themselves what they are, [`file`](mod@file) writes it batch by
//! batch in any format, [`values`] reads columns.

pub mod csv;
pub mod file;
pub mod gathered;
pub mod mat_file;
mod mat_text;
pub mod parquet_properties;
pub mod values;

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float32Array, Float64Array, Int32Array, RecordBatch, StringArray,
    UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Metadata, Schema};

use crate::failure::Failure;
use crate::quantity::Quantity;

/// Key of what a row of the table is, in the metadata of its schema.
pub const DESCRIPTION: &str = "damprig.description";

/// Name, unit ("1" of a ratio or a count, "" of a name or a flag) and meaning of a column.
#[derive(Clone, Debug)]
pub struct Column {
    name: String,
    unit: String,
    meaning: String,
    further: Option<(&'static str, String)>,
}

impl Column {
    /// A column that is no [`Quantity`], for example a varied key of a case.
    #[must_use]
    pub fn new(name: impl Into<String>, unit: impl Into<String>, meaning: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into(), meaning: meaning.into(), further: None }
    }

    /// With a further entry in its metadata.
    #[must_use]
    pub fn with(self, key: &'static str, value: impl Into<String>) -> Self {
        Self { further: Some((key, value.into())), ..self }
    }

    /// Its field in a schema.
    #[must_use]
    pub fn field(self, kind: DataType) -> Field {
        let mut metadata = HashMap::from([("unit".to_string(), self.unit)]);
        if !self.meaning.is_empty() {
            metadata.insert("description".into(), self.meaning);
        }
        metadata.extend(self.further.map(|(key, value)| (key.to_string(), value)));
        Field::new(self.name, kind, false).with_metadata(metadata)
    }
}

impl From<Quantity> for Column {
    fn from(own: Quantity) -> Self {
        Self::new(own.name(), own.unit(), own.definition())
    }
}

/// A value that columns have.
pub trait Cell: Sized {
    /// The values as a column.
    fn array(values: impl Iterator<Item = Self>) -> ArrayRef;
    /// Whether values may be missing.
    const MAY_BE_MISSING: bool = false;
}

macro_rules! cells {
    ($($kind:ty: $array:ident;)*) => {
        $(impl Cell for $kind {
            fn array(values: impl Iterator<Item = Self>) -> ArrayRef {
                Arc::new($array::from_iter_values(values))
            }
        })*
    };
}

cells! {
    f64: Float64Array;
    f32: Float32Array;
    u64: UInt64Array;
    u32: UInt32Array;
    i32: Int32Array;
    &str: StringArray;
    String: StringArray;
}

impl Cell for bool {
    fn array(values: impl Iterator<Item = Self>) -> ArrayRef {
        Arc::new(values.map(Some).collect::<BooleanArray>())
    }
}

impl Cell for Option<f64> {
    const MAY_BE_MISSING: bool = true;
    fn array(values: impl Iterator<Item = Self>) -> ArrayRef {
        Arc::new(values.collect::<Float64Array>())
    }
}

/// One of few words, of which a column keeps each once.
#[derive(Clone, Copy, Debug)]
pub struct Word(pub &'static str);

impl Cell for Word {
    fn array(values: impl Iterator<Item = Self>) -> ArrayRef {
        Arc::new(values.map(|word| Some(word.0)).collect::<DictionaryArray<Int32Type>>())
    }
}

/// A table of `rows` under construction.
#[derive(Debug)]
pub struct TableBuilder<'r, R> {
    rows: &'r [R],
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
}

impl<'r, R> TableBuilder<'r, R> {
    /// Without columns.
    #[must_use]
    pub fn new(rows: &'r [R]) -> Self {
        Self { rows, fields: Vec::new(), arrays: Vec::new() }
    }

    /// With a column of what `get` takes from each row.
    #[must_use]
    pub fn column<C: Cell>(mut self, column: impl Into<Column>, get: impl Fn(&'r R) -> C) -> Self {
        let array = C::array(self.rows.iter().map(get));
        self.fields.push(column.into().field(array.data_type().clone()).with_nullable(C::MAY_BE_MISSING));
        self.arrays.push(array);
        self
    }

    /// The table, with what it says of itself.
    ///
    /// # Errors
    /// The table library's: a defect of this module.
    pub fn finish(self, about: Metadata) -> Result<RecordBatch, Failure> {
        let schema = Schema::new_with_metadata(self.fields, about);
        Ok(RecordBatch::try_new(Arc::new(schema), self.arrays)?)
    }
}

/// The table with the present names of columns that an older version named otherwise.
#[must_use]
pub fn with_present_names(batch: RecordBatch) -> RecordBatch {
    let schema = batch.schema();
    let present = |field: &Field| Quantity::formerly(field.name()).map(|own| field.clone().with_name(own.name()));
    if !schema.fields().iter().any(|field| present(field).is_some()) {
        return batch;
    }
    let fields: Vec<Field> =
        schema.fields().iter().map(|field| present(field).unwrap_or_else(|| field.as_ref().clone())).collect();
    let renamed = Arc::new(Schema::new_with_metadata(fields, schema.metadata().clone()));
    RecordBatch::try_new(renamed, batch.columns().to_vec()).unwrap_or(batch)
}
