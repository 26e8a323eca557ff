//! Reads the rows of a table into the type that its lines in the journal have: a column has the name of a field.

use arrow_array::RecordBatch;
use serde::de::DeserializeOwned;
use serde_json::{Map, Number, Value as Json};

use crate::failure::Failure;
use crate::table::values::{Value, values};

/// The rows. Fields whose column an earlier version did not write have their defaults; `complete` adds what the journal has beside the
/// columns, or in another form.
///
/// # Errors
/// A column of a type that run folders do not use, or a missing one that every version wrote.
pub(super) fn rows<R: DeserializeOwned>(
    batch: &RecordBatch,
    complete: impl Fn(&mut Map<String, Json>),
) -> Result<Vec<R>, Failure> {
    let schema = batch.schema();
    let mut columns = Vec::new();
    for (field, array) in schema.fields().iter().zip(batch.columns()) {
        let name = field.name();
        let values = values(array)
            .ok_or_else(|| Failure::Storage(format!("column `{name}` has the type {}", array.data_type())))?;
        columns.push((name.as_str(), values));
    }
    let row = |n: usize| {
        let mut fields: Map<String, Json> =
            columns.iter().map(|(name, values)| ((*name).to_string(), json(&values[n]))).collect();
        complete(&mut fields);
        serde_json::from_value(Json::Object(fields))
            .map_err(|error| Failure::Storage(format!("a row of a table: {error}")))
    };
    (0..batch.num_rows()).map(row).collect()
}

/// A number as the journal has it ([`super::json_float`]).
pub(super) fn number(value: f64) -> Json {
    Number::from_f64(value).map_or_else(|| Json::from(value.to_string()), Json::Number)
}

fn json(value: &Value) -> Json {
    match value {
        Value::Text(text) => Json::from(text.as_str()),
        Value::F64(value) => number(*value),
        Value::F32(value) => number(f64::from(*value)),
        Value::U64(count) => Json::from(*count),
        Value::Bool(flag) => Json::from(*flag),
    }
}
