//! Reads columns of a record batch by name, as texts or numbers.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type, Int32Type, UInt32Type, UInt64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::Field;

use crate::failure::Failure;

/// A value of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A name.
    Text(String),
    /// Double precision.
    F64(f64),
    /// Single precision.
    F32(f32),
    /// A count.
    U64(u64),
    /// A flag.
    Bool(bool),
}

impl Value {
    /// The value as a number: a flag is 0 or 1; `None` for a name.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Text(_) => None,
            Self::F64(value) => Some(*value),
            Self::F32(value) => Some(f64::from(*value)),
            Self::U64(value) => Some(*value as f64),
            Self::Bool(value) => Some(f64::from(u8::from(*value))),
        }
    }
}

/// The shortest text that gives the same value when it is read in the same precision.
impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Text(value) => f.write_str(value),
            Self::F64(value) => value.fmt(f),
            Self::F32(value) => value.fmt(f),
            Self::U64(value) => value.fmt(f),
            Self::Bool(value) => value.fmt(f),
        }
    }
}

/// All values of a column; `None` for a type that run folders do not use.
#[must_use]
pub fn values(array: &dyn Array) -> Option<Vec<Value>> {
    if let Some(a) = array.as_string_opt::<i32>() {
        return Some(a.iter().map(|v| Value::Text(v.unwrap_or("").into())).collect());
    }
    if let Some(a) = array.as_dictionary_opt::<Int32Type>() {
        let names = a.downcast_dict::<arrow_array::StringArray>()?;
        return Some(names.into_iter().map(|v| Value::Text(v.unwrap_or("").into())).collect());
    }
    macro_rules! numbers {
        ($kind:ty, $variant:path, $from:expr) => {
            if let Some(a) = array.as_primitive_opt::<$kind>() {
                return Some(a.values().iter().map(|v| $variant($from(*v))).collect());
            }
        };
    }
    // A missing number is none.
    if let Some(a) = array.as_primitive_opt::<Float64Type>() {
        return Some(a.iter().map(|v| Value::F64(v.unwrap_or(f64::NAN))).collect());
    }
    numbers!(Float32Type, Value::F32, |v| v);
    numbers!(Int32Type, Value::F64, f64::from);
    numbers!(UInt64Type, Value::U64, |v| v);
    numbers!(UInt32Type, Value::U64, u64::from);
    array.as_boolean_opt().map(|a| a.values().iter().map(Value::Bool).collect())
}

/// A named column.
///
/// # Errors
/// When the table has no such column, or it is of another type than runs have.
pub fn column(batch: &RecordBatch, name: &str) -> Result<Vec<Value>, Failure> {
    let array =
        batch.column_by_name(name).ok_or_else(|| Failure::Storage(format!("a table lacks its column `{name}`")))?;
    values(array).ok_or_else(|| Failure::Storage(format!("column `{name}` has the type {}", array.data_type())))
}

/// A column of names.
///
/// # Errors
/// As [`column()`].
pub fn texts(batch: &RecordBatch, name: &str) -> Result<Vec<String>, Failure> {
    Ok(column(batch, name)?.iter().map(Value::to_string).collect())
}

/// A column of numbers.
///
/// # Errors
/// As [`column()`]; names become NaN.
pub fn numbers(batch: &RecordBatch, name: &str) -> Result<Vec<f64>, Failure> {
    Ok(column(batch, name)?.iter().map(|v| v.number().unwrap_or(f64::NAN)).collect())
}

/// The unit of a column; "" for names and flags.
#[must_use]
pub fn unit(field: &Field) -> &str {
    field.metadata().get("unit").map_or("", String::as_str)
}

/// The meaning of a column; empty if none is recorded.
#[must_use]
pub fn description(field: &Field) -> &str {
    field.metadata().get("description").map_or("", String::as_str)
}
