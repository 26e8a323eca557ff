//! The JSON Schema (draft 2020-12) of a kind of input file, for editors that complete and check TOML.
//!
//! It has what the declarations have: types, ranges, words, defaults, which keys exclude or need each other. What only the parser
//! knows (a ramp within its settling time, files that exist, the limits of a board) is checked by `damprig run --dry-run`. A
//! quantity of a set-up may come from the top of the campaign or from a set-up file, so its keys are required only where
//! neither can give it.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::{FileKind, is_part, kinds_at, path_of, plain};
use crate::input::key::{DefaultValue, Key, KeyUnit, KeyedQuantity, Need, Range, Table, ValueKind};
use crate::setup::PARTS;

/// The schema of a kind of file.
#[must_use]
pub fn schema(file: FileKind) -> Value {
    let mut builder = SchemaBuilder::of(file, "");
    let mut root = builder.root();
    root["$schema"] = "https://json-schema.org/draft/2020-12/schema".into();
    root["title"] = file.title().into();
    root["$defs"] = builder.definitions.into_iter().collect::<Map<_, _>>().into();
    root
}

struct SchemaBuilder {
    file: FileKind,
    tables: Vec<Table>,
    /// Before the names of the tables' schemas.
    prefix: &'static str,
    /// The schemas of the tables by their names.
    definitions: BTreeMap<String, Value>,
}

/// Which needs of quantities a schema states.
#[derive(Clone, Copy, PartialEq)]
enum Needs {
    /// All.
    All,
    /// Only which keys of the table exclude each other: others may come from elsewhere.
    Exclusions,
}

impl SchemaBuilder {
    fn of(file: FileKind, prefix: &'static str) -> Self {
        Self { file, tables: file.tables(), prefix, definitions: BTreeMap::new() }
    }

    /// The schema of the whole file.
    fn root(&mut self) -> Value {
        let mut root = self.table("");
        if self.file == FileKind::Case {
            // These have the structure in place of the set-up.
            let others = ["set_up_file", "storey", "beam", "mode", "matrices"].map(|key| json!({ "required": [key] }));
            root["if"] = json!({ "not": { "anyOf": others } });
            root["then"] = self.without_set_up_file();
        }
        root
    }

    /// The schema of the name of a case's file or of a case's tables. Those of an alternative complete the optimisation's own.
    fn text_or_case(&mut self, path: &str) -> Value {
        let mut builder = Self::of(FileKind::Case, "case.");
        let case = if path.is_empty() { builder.root() } else { without_needs(builder.table("")) };
        self.definitions.append(&mut builder.definitions);
        json!({ "oneOf": [{ "type": "string" }, case] })
    }

    /// The name of the schema of the table at `path`, which is built once.
    fn definition(&mut self, path: &str) -> String {
        let name = format!("{}{path}", self.prefix);
        if !self.definitions.contains_key(&name) {
            self.definitions.insert(name.clone(), Value::Null);
            let schema = self.table(path);
            self.definitions.insert(name.clone(), schema);
        }
        format!("#/$defs/{name}")
    }

    /// The needs that the schema of a table states: a part of a set-up may be completed, a set-up file requires nothing.
    fn needs(&self, path: &str) -> Needs {
        let is_completed = is_part(path) && (self.file == FileKind::SetUp || !path.contains('.'));
        if is_completed { Needs::Exclusions } else { Needs::All }
    }

    /// The schema of the table at `path`: one of its kinds, if it has several.
    fn table(&mut self, path: &str) -> Value {
        let kinds = kinds_at(&self.tables, path);
        let mut kinds: Vec<Value> = kinds.into_iter().map(|(kind, tables)| self.object(path, kind, &tables)).collect();
        if kinds.len() == 1 { kinds.remove(0) } else { json!({ "type": "object", "oneOf": kinds }) }
    }

    /// The schema of a table of one kind.
    fn object(&mut self, path: &str, kind: Option<&str>, tables: &[Table]) -> Value {
        let doc = tables.iter().find(|table| table.kind == kind).map_or("", |table| table.doc);
        let mut properties = Map::new();
        let mut required = Vec::new();
        let mut conditions = Vec::new();
        if let Some(kind) = kind {
            properties.insert("kind".into(), json!({ "const": kind, "description": doc }));
            required.push("kind");
        }
        for quantity in tables.iter().flat_map(|table| table.quantities) {
            if kind.is_some() && quantity.name() == "kind" {
                continue;
            }
            for key in quantity.keys {
                properties.insert(key.name.into(), self.key(path, quantity, key));
            }
            for other in excluded(quantity) {
                conditions.push(other);
            }
            match (self.needs(path), quantity.need) {
                (Needs::All, Need::Required) if quantity.keys.len() == 1 => required.push(quantity.name()),
                (Needs::All, need) => conditions.extend(condition(quantity, need)),
                (Needs::Exclusions, Need::If(_, name, Need::Forbidden, _)) => {
                    conditions.push(not_together(quantity, name))
                }
                (Needs::Exclusions, _) => {}
            }
        }
        let mut schema = json!({
            "type": "object",
            "description": doc,
            "properties": properties,
            "additionalProperties": false,
        });
        if !required.is_empty() {
            schema["required"] = required.into();
        }
        if !conditions.is_empty() {
            schema["allOf"] = conditions.into();
        }
        schema
    }

    /// The schema of a key's value.
    fn key(&mut self, path: &str, quantity: &KeyedQuantity, key: &Key) -> Value {
        let inner = path_of(&self.tables, path, key.name);
        let mut schema = match key.kind {
            ValueKind::Number(range) => number(key, range),
            ValueKind::Numbers(range) => json!({ "type": "array", "items": number(key, range) }),
            ValueKind::NumbersOrTable(range) => json!({ "oneOf": [
                { "type": "array", "items": number(key, range), "minItems": 1 },
                { "$ref": self.definition(&inner) },
            ] }),
            ValueKind::Word(words) => json!({ "enum": words }),
            ValueKind::Text => json!({ "type": "string" }),
            ValueKind::Texts => json!({ "type": "array", "items": { "type": "string" } }),
            ValueKind::TextOrPlace => json!({ "type": ["string", "integer"], "minimum": 1 }),
            ValueKind::TextOrCase => self.text_or_case(path),
            ValueKind::Table => json!({ "$ref": self.definition(&inner) }),
            // Several dampers are for a case with several places.
            ValueKind::OneOrMoreTables if self.file != FileKind::Case => json!({ "$ref": self.definition(&inner) }),
            ValueKind::OneOrMoreTables => {
                let one = json!({ "$ref": self.definition(&inner) });
                json!({ "oneOf": [one, { "type": "array", "items": one }] })
            }
            ValueKind::Tables => json!({ "type": "array", "items": { "$ref": self.definition(&inner) } }),
        };
        schema["description"] = description(key).into();
        // A default is that of the quantity's first key.
        if quantity.name() == key.name
            && let Some(default) = quantity.default_value()
        {
            schema["default"] = match default {
                DefaultValue::Word(word) => word.into(),
                _ => default.written().parse().map_or(Value::Null, plain_value),
            };
        }
        if key.kind == ValueKind::Tables && matches!(quantity.need, Need::Required) {
            schema["minItems"] = 1.into();
        }
        schema
    }

    /// A case without a set-up file has the whole of its set-up.
    fn without_set_up_file(&self) -> Value {
        let mut properties = Map::new();
        for part in PARTS {
            let needs: Vec<Value> = kinds_at(&self.tables, part.name())
                .iter()
                .flat_map(|(_, tables)| tables)
                .flat_map(|table| table.quantities)
                .filter_map(|quantity| condition(quantity, quantity.need))
                .collect();
            properties.insert(part.name().into(), json!({ "allOf": needs }));
        }
        json!({ "required": [PARTS[0].name()], "properties": properties })
    }
}

/// A finite number of a range, within its unit's largest magnitude.
fn number(key: &Key, range: Range) -> Value {
    let mut schema = json!({ "type": if matches!(range, Range::Whole(..)) { "integer" } else { "number" } });
    let most = key.unit().map_or(f64::MAX, |unit| unit.most);
    let [low, high] = range.ends();
    let low = low.unwrap_or((-most, false));
    let high = high.filter(|(high, _)| *high < most).unwrap_or((most, false));
    for ((end, is_excluded), name, excluded) in
        [(low, "minimum", "exclusiveMinimum"), (high, "maximum", "exclusiveMaximum")]
    {
        if end.abs() < f64::MAX {
            schema[if is_excluded { excluded } else { name }] = plain_value(end);
        }
    }
    match range {
        Range::NotZero => schema["not"] = json!({ "const": 0 }),
        Range::ZeroOr(low, _) => schema["anyOf"] = json!([{ "const": 0 }, { "minimum": plain_value(low) }]),
        _ => {}
    }
    schema
}

/// The schema of a table that another one completes.
fn without_needs(mut table: Value) -> Value {
    if let Some(table) = table.as_object_mut() {
        table.remove("required");
        table.remove("allOf");
    }
    table
}

fn plain_value(number: f64) -> Value {
    plain(number).parse::<i64>().map_or_else(|_| number.into(), Value::from)
}

/// The meaning of a key with its unit and its usual range.
fn description(key: &Key) -> String {
    let symbol = key.unit().map_or("", |unit: &KeyUnit| unit.symbol);
    let mut text = key.doc.to_string();
    if key.kind.range().is_some() && !symbol.is_empty() {
        text.push_str(&format!(" ({symbol})"));
    }
    if let Some((least, most)) = key.usual {
        text.push_str(&format!("; usually from {} to {}", plain(least), plain(most)));
    }
    text
}

fn required(names: &[&str]) -> Value {
    json!({ "required": names })
}

/// No two keys of a quantity may be written.
fn excluded(quantity: &KeyedQuantity) -> Vec<Value> {
    let keys = quantity.keys;
    let pairs = keys.iter().enumerate().flat_map(|(n, a)| keys[n + 1..].iter().map(|b| [a.name, b.name]));
    pairs.map(|pair| json!({ "not": required(&pair) })).collect()
}

/// No key of a quantity may be written beside another key.
fn not_together(quantity: &KeyedQuantity, other: &str) -> Value {
    let pairs: Vec<Value> = quantity.keys.iter().map(|key| required(&[other, key.name])).collect();
    json!({ "not": { "anyOf": pairs } })
}

/// What a need demands of the table, beside that no two keys of the quantity are written.
fn condition(quantity: &KeyedQuantity, need: Need) -> Option<Value> {
    let any: Vec<Value> = quantity.keys.iter().map(|key| required(&[key.name])).collect();
    match need {
        Need::Required => Some(json!({ "anyOf": any })),
        Need::Forbidden => Some(json!({ "not": { "anyOf": any } })),
        Need::RequiredUnless(_) | Need::Optional | Need::Default(_) => None,
        Need::If(_, name, then, otherwise) => Some(branch(required(&[name]), quantity, then, otherwise)),
        Need::IfWord(other, word, then, otherwise) => {
            let name = other.name();
            let mut is_word = json!({ "properties": { name: { "const": word } } });
            // A word that is left out is the default.
            if !matches!(other.default_value(), Some(DefaultValue::Word(default)) if default == word) {
                is_word["required"] = json!([name]);
            }
            Some(branch(is_word, quantity, then, otherwise))
        }
    }
}

fn branch(condition: Value, quantity: &KeyedQuantity, then: &Need, otherwise: &Need) -> Value {
    let mut schema = json!({ "if": condition });
    for (name, need) in [("then", then), ("else", otherwise)] {
        if let Some(demanded) = self::condition(quantity, *need) {
            schema[name] = demanded;
        }
    }
    schema
}
