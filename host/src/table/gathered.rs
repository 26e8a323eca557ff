//! A table in memory, column by column, for formats that are written as a whole.

use std::collections::HashSet;

use arrow_array::RecordBatch;
use arrow_schema::DataType;

use super::values::{Value, description, unit, values};
use crate::failure::Failure;

/// Longest name of a field in MATLAB.
const LONGEST_NAME: usize = 63;

/// The values of a column.
#[derive(Debug)]
pub enum Values {
    /// Numbers; flags are 0 or 1.
    Numbers(Vec<f64>),
    /// Names in full.
    Texts(Vec<String>),
    /// Places from 0 in a list of names. A name per row would dominate a table with a row per tick or impact.
    Places(Vec<usize>, Vec<String>),
}

/// A column of a table.
#[derive(Debug)]
pub struct ColumnValues {
    /// A letter, then letters, digits and underscores, at most 63; unique in its table.
    pub name: String,
    /// Empty for names and flags.
    pub unit: String,
    /// Its meaning; empty if none is recorded.
    pub description: String,
    /// Its values.
    pub values: Values,
}

/// How names are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Names {
    /// Each in full.
    InFull,
    /// As places in a list of the names that there are.
    AsPlaces,
}

/// Adds the rows of a batch to the columns, which are made from the first batch.
///
/// # Errors
/// A column of an unknown type, or one that only some files of the run have.
pub fn gather(columns: &mut Vec<ColumnValues>, batch: &RecordBatch, names: Names) -> Result<(), Failure> {
    let schema = batch.schema();
    if columns.is_empty() {
        let mut taken = HashSet::new();
        for field in schema.fields() {
            let is_text = matches!(field.data_type(), DataType::Utf8 | DataType::Dictionary(..));
            let values = match (is_text, names) {
                (false, _) => Values::Numbers(Vec::new()),
                (true, Names::InFull) => Values::Texts(Vec::new()),
                (true, Names::AsPlaces) => Values::Places(Vec::new(), Vec::new()),
            };
            let name = field_name(field.name(), |name| taken.contains(name));
            taken.insert(name.clone());
            let (unit, description) = (unit(field).to_string(), description(field).to_string());
            columns.push(ColumnValues { name, unit, description, values });
        }
    }
    for (index, (field, array)) in schema.fields().iter().zip(batch.columns()).enumerate() {
        let read = values(array.as_ref()).ok_or_else(|| {
            Failure::Storage(format!("column `{}` has the unknown type {}", field.name(), array.data_type()))
        })?;
        let Some(column) = columns.get_mut(index) else {
            return Err(Failure::Storage(format!("column `{}` is missing in some files of the run", field.name())));
        };
        column.values.extend(read);
    }
    Ok(())
}

impl Values {
    /// Number of values.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Numbers(all) => all.len(),
            Self::Texts(all) => all.len(),
            Self::Places(all, _) => all.len(),
        }
    }

    /// Takes the first values out, places as numbers.
    pub fn take_numbers(&mut self, count: usize) -> Vec<f64> {
        match self {
            Self::Numbers(all) => all.drain(..count).collect(),
            Self::Places(all, _) => all.drain(..count).map(|place| place as f64).collect(),
            Self::Texts(_) => Vec::new(),
        }
    }

    fn extend(&mut self, read: Vec<Value>) {
        match self {
            Self::Numbers(all) => all.extend(read.iter().map(|v| v.number().unwrap_or(f64::NAN))),
            Self::Texts(all) => all.extend(read.iter().map(Value::to_string)),
            Self::Places(all, names) => all.extend(read.iter().map(|value| {
                let name = value.to_string();
                names.iter().rposition(|n| *n == name).unwrap_or_else(|| {
                    names.push(name);
                    names.len() - 1
                })
            })),
        }
    }
}

/// A name that every format allows: a letter, then letters, digits and underscores, at most 63 characters.
fn field_name(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        plain.insert_str(0, "x_");
    }
    plain.truncate(LONGEST_NAME);
    let shorter = &plain[..plain.len().min(LONGEST_NAME - 5)];
    let numbered = (2..).map(|n| format!("{shorter}_{n}"));
    std::iter::once(plain.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_names_are_valid_in_matlab() {
        assert_eq!(field_name("x_m", |_| false), "x_m");
        assert_eq!(field_name("2nd force (N)", |_| false), "x_2nd_force__N_");
        assert_eq!(field_name("", |_| false), "x_");
        assert_eq!(field_name("x_m", |n| n == "x_m"), "x_m_2");
        let long = field_name(&"ä".repeat(80), |n| !n.ends_with('3'));
        assert!(long.len() <= LONGEST_NAME && long.ends_with("_3"), "{long}");
    }
}
