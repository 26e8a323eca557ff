//! Reads what is not declared as a quantity: switches, and tables whose keys are any.

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Section, Span, finite};

/// A value of a table whose keys are not declared.
#[derive(Clone, Debug, PartialEq)]
pub enum FreeValue {
    /// A number.
    Number(f64),
    /// A word.
    Word(String),
}

/// A key that is not declared, with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeKey {
    /// The key with its tables, joined by points.
    pub key: String,
    /// Its value.
    pub value: FreeValue,
    /// Where the value is written.
    pub span: Span,
}

impl Section<'_> {
    /// A switch, if the key is there.
    pub fn switch(&self, key: &'static str) -> Option<bool> {
        let value = self.value(key)?;
        match value.get_ref() {
            DeValue::Boolean(on) => Some(*on),
            _ => {
                self.refuse(key, &value.span(), "must be true or false", None);
                None
            }
        }
    }

    /// The section with all that is in it, whose keys need not be declared. Do not [`finish`](Self::finish) it.
    #[must_use]
    pub fn as_toml(&self) -> toml::Table {
        let document = Spanned::new(self.span(), self.own.clone());
        toml::Table::deserialize(toml::de::Deserializer::from(document)).unwrap_or_default()
    }

    /// All keys of the section and of the tables in it, in the order of the file; they need not be declared. Do not
    /// [`finish`](Self::finish) the section.
    #[must_use]
    pub fn free_keys(&self) -> Vec<FreeKey> {
        let mut keys = Vec::new();
        self.add_keys("", self.own, &mut keys);
        keys
    }

    fn add_keys(&self, path: &str, table: &DeTable, keys: &mut Vec<FreeKey>) {
        for (name, value) in table {
            let key = if path.is_empty() { name.get_ref().to_string() } else { format!("{path}.{}", name.get_ref()) };
            if let Some(table) = value.get_ref().as_table() {
                self.add_keys(&key, table, keys);
                continue;
            }
            match free_value(value) {
                Some(read) => keys.push(FreeKey { key, value: read, span: value.span() }),
                None => self.refuse(&key, &value.span(), "must be a number, or a word in quotes", None),
            }
        }
    }
}

fn free_value(value: &Spanned<DeValue>) -> Option<FreeValue> {
    match value.get_ref() {
        DeValue::String(word) => Some(FreeValue::Word(word.to_string())),
        _ => finite(value).map(FreeValue::Number),
    }
}
