//! Columns of the host's tables as arrays: numbers as they are, names as codes into a list of them.

use std::collections::HashMap;

use arrow_array::cast::AsArray;
use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type, Int32Type, UInt32Type, UInt64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::Field;
use damprig::failure::Failure;
use damprig::table::values::{description, unit};
use numpy::{Element, IntoPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The values of a column over all batches.
enum Values {
    F64(Vec<f64>),
    F32(Vec<f32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    U32(Vec<u32>),
    Bool(Vec<bool>),
    /// Codes, and the names that they stand for.
    Names(Vec<i32>, Names),
}

/// Names in the order in which they came up.
#[derive(Default)]
struct Names {
    known: HashMap<String, i32>,
    list: Vec<String>,
}

impl Names {
    fn code(&mut self, name: &str) -> i32 {
        if let Some(code) = self.known.get(name) {
            return *code;
        }
        let code = self.list.len() as i32;
        self.known.insert(name.to_string(), code);
        self.list.push(name.to_string());
        code
    }
}

/// A named column with its unit and meaning.
struct Column {
    name: String,
    unit: String,
    about: String,
    values: Values,
}

/// A table, column by column.
#[derive(Default)]
pub struct Columns(Vec<Column>);

impl Columns {
    /// All batches one after another. They have one schema.
    ///
    /// # Errors
    /// A column of a type that run folders do not have, or batches that differ.
    pub fn of(batches: &[RecordBatch]) -> Result<Self, Failure> {
        let Some(first) = batches.first() else { return Ok(Self::default()) };
        let schema = first.schema();
        let column = |(place, field): (usize, &std::sync::Arc<Field>)| -> Result<Column, Failure> {
            let arrays: Vec<&dyn Array> = batches
                .iter()
                .map(|batch| batch.columns().get(place).map(AsRef::as_ref))
                .collect::<Option<_>>()
                .ok_or_else(|| Failure::Storage(format!("a part of the table lacks its column `{}`", field.name())))?;
            let values = values(&arrays).ok_or_else(|| {
                Failure::Storage(format!("column `{}` has the type {}", field.name(), field.data_type()))
            })?;
            Ok(Column {
                name: field.name().clone(),
                unit: unit(field).into(),
                about: description(field).into(),
                values,
            })
        };
        Ok(Self(schema.fields().iter().enumerate().map(column).collect::<Result<_, _>>()?))
    }

    /// As a dict: `columns` by name (an array, or a pair of codes and names), `units` and `descriptions`.
    ///
    /// # Errors
    /// Python's.
    pub fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let (columns, units, descriptions) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
        for column in self.0 {
            units.set_item(&column.name, column.unit)?;
            descriptions.set_item(&column.name, column.about)?;
            match column.values {
                Values::F64(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::F32(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::I32(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::U64(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::U32(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::Bool(values) => columns.set_item(column.name, values.into_pyarray(py))?,
                Values::Names(codes, names) => columns.set_item(column.name, (codes.into_pyarray(py), names.list))?,
            }
        }
        let dict = PyDict::new(py);
        dict.set_item("columns", columns)?;
        dict.set_item("units", units)?;
        dict.set_item("descriptions", descriptions)?;
        Ok(dict)
    }
}

/// The values of a column; `None` for a type that run folders do not use.
fn values(arrays: &[&dyn Array]) -> Option<Values> {
    let all = arrays;
    numbers::<Float64Type>(all)
        .map(Values::F64)
        .or_else(|| numbers::<Float32Type>(all).map(Values::F32))
        .or_else(|| numbers::<Int32Type>(all).map(Values::I32))
        .or_else(|| numbers::<UInt64Type>(all).map(Values::U64))
        .or_else(|| numbers::<UInt32Type>(all).map(Values::U32))
        .or_else(|| flags(all))
        .or_else(|| names(all))
}

fn numbers<T: ArrowPrimitiveType<Native: Element>>(arrays: &[&dyn Array]) -> Option<Vec<T::Native>> {
    let mut values = Vec::with_capacity(arrays.iter().map(|array| array.len()).sum());
    for array in arrays {
        values.extend_from_slice(array.as_primitive_opt::<T>()?.values());
    }
    Some(values)
}

fn flags(arrays: &[&dyn Array]) -> Option<Values> {
    let mut values = Vec::new();
    for array in arrays {
        values.extend(array.as_boolean_opt()?.values().iter());
    }
    Some(Values::Bool(values))
}

fn names(arrays: &[&dyn Array]) -> Option<Values> {
    let (mut codes, mut names) = (Vec::new(), Names::default());
    for array in arrays {
        if let Some(texts) = array.as_string_opt::<i32>() {
            codes.extend(texts.iter().map(|text| names.code(text.unwrap_or(""))));
            continue;
        }
        let dictionary = array.as_dictionary_opt::<Int32Type>()?;
        let own: Vec<i32> =
            dictionary.values().as_string_opt::<i32>()?.iter().map(|text| names.code(text.unwrap_or(""))).collect();
        let code = |key: Option<i32>| key.and_then(|key| own.get(usize::try_from(key).ok()?)).copied();
        codes.extend(dictionary.keys().iter().map(|key| code(key).unwrap_or(-1)));
    }
    Some(Values::Names(codes, names))
}
