//! A dict of Python as TOML, so that the host's readers check it and their messages show it line by line.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::{Table, Value};

use crate::failure::input_error;

/// The text of a dict; `name` is its name in messages.
///
/// # Errors
/// A key that is not a string, or a value that no file can have, with its place.
pub fn text(name: &str, dict: &Bound<'_, PyDict>) -> PyResult<String> {
    let table = table(name, dict)?;
    toml::to_string(&table).map_err(|error| wrong(dict.py(), name, &error.to_string()))
}

fn wrong(py: Python<'_>, place: &str, what: &str) -> PyErr {
    input_error(py, format!("{place}: {what}"))
}

fn table(place: &str, dict: &Bound<'_, PyDict>) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, value) in dict.iter() {
        let Ok(key) = key.cast::<PyString>() else {
            return Err(wrong(dict.py(), place, &format!("the key {} is not a string", key.repr()?)));
        };
        let key = key.to_cow()?.into_owned();
        let value = self::value(&format!("{place}[{key:?}]"), &value)?;
        table.insert(key, value);
    }
    Ok(table)
}

fn value(place: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_none() {
        return Err(wrong(value.py(), place, "None is not allowed; leave the key out"));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        return Ok(Value::Table(table(place, dict)?));
    }
    // Before the integers: a bool is one.
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(value.extract()?));
    }
    if value.is_instance_of::<PyInt>() {
        let number = value
            .extract()
            .map_err(|_| wrong(value.py(), place, &format!("{value} is beyond ±9.2e18; write a float")))?;
        return Ok(Value::Integer(number));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Value::String(value.extract()?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let items = value.try_iter()?.enumerate();
        let items: PyResult<Vec<Value>> =
            items.map(|(i, item)| self::value(&format!("{place}[{i}]"), &item?)).collect();
        return Ok(Value::Array(items?));
    }
    if let Ok(path) = value.call_method0("__fspath__") {
        return self::value(place, &path);
    }
    from_numpy(place, value)
}

/// An array or a scalar of NumPy.
fn from_numpy(place: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let kind = value.get_type().name()?;
    let (Ok(dimensions), Ok(plain)) = (value.getattr("ndim"), value.getattr("tolist")) else {
        return Err(wrong(
            value.py(),
            place,
            &format!("a value of type {kind} is not allowed; use numbers, strings, lists and dicts"),
        ));
    };
    if dimensions.extract::<usize>()? > 1 {
        let shape = value.getattr("shape")?.repr()?;
        return Err(wrong(
            value.py(),
            place,
            &format!("an array of shape {shape} is not allowed; it must have one dimension"),
        ));
    }
    let plain = plain.call0()?;
    if plain.get_type().is(value.get_type()) {
        return Err(wrong(value.py(), place, &format!("a value of type {kind} is not allowed")));
    }
    self::value(place, &plain)
}
