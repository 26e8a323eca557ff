//! The keys of input files as a module of Python (python/damprig/keys.py): a `TypedDict` for each table, so that an editor completes a
//! dict and a type checker finds a wrong key or word before anything runs.
//!
//! No key is required: which of them a table needs depends on others, and the parser says so.

use std::collections::BTreeMap;

use super::{FileKind, kinds_at, path_of};
use crate::input::key::{Key, KeyedQuantity, Range, Table, ValueKind};

const HEAD: &str = "\
\"\"\"The keys of input files as types: annotate a dict, and an editor completes its keys and finds wrong ones before it runs.

>>> from damprig.keys import Case
>>> case: Case = {\"structure\": {\"mass_kg\": 1.6, \"natural_frequency_hz\": 2.5, \"damping_ratio\": 0.0038}}

`damprig keys --python` prints this file from the declarations that the parsers use; docs/KEYS.md has ranges and defaults too. No key is
required here: which of them a table needs depends on the others.
\"\"\"

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Literal, TypedDict, Union
";

/// Words of Python that cannot name a field of a class.
const RESERVED: [&str; 4] = ["from", "in", "is", "with"];

/// The key of a study or a continuation that names its case.
const CASE: &str = "case";

/// The module.
#[must_use]
pub fn module() -> String {
    let mut builder =
        TypedDictBuilder { file: FileKind::Case, tables: Vec::new(), named: BTreeMap::new(), text: String::new() };
    for file in [FileKind::Case, FileKind::Campaign, FileKind::Study, FileKind::Optimisation, FileKind::Continuation] {
        builder.file = file;
        builder.tables = file.tables();
        builder.table("");
    }
    format!("{HEAD}{}", builder.text)
}

struct TypedDictBuilder {
    file: FileKind,
    tables: Vec<Table>,
    /// The names of the types so far, by what they are: equal tables share one.
    named: BTreeMap<String, String>,
    text: String,
}

impl TypedDictBuilder {
    /// The name of the type of the table at `path`, which is written after those inside it. Those of a case have no prefix.
    fn table(&mut self, path: &str) -> String {
        let prefix = if self.file == FileKind::Case && !path.is_empty() { "" } else { self.file.name() };
        let name = camel(&format!("{prefix}.{path}"));
        let kinds = kinds_at(&self.tables, path);
        if let [(None, tables)] = &kinds[..] {
            return self.class(name, path, None, tables);
        }
        let of_kind = |kind: Option<&str>| format!("{name}{}", camel(kind.unwrap_or_default()));
        let all: Vec<String> =
            kinds.iter().map(|(kind, tables)| self.class(of_kind(*kind), path, *kind, tables)).collect();
        self.write(name, |name| format!("{name} = Union[{}]", all.join(", ")))
    }

    /// Writes a type unless there is an equal one; its name.
    fn write(&mut self, name: String, text: impl Fn(&str) -> String) -> String {
        if let Some(equal) = self.named.get(&text("")) {
            return equal.clone();
        }
        self.text.push_str(&format!("\n\n{}\n", text(&name)));
        self.named.insert(text(""), name.clone());
        name
    }

    /// The name of the class of a table of one kind.
    fn class(&mut self, name: String, path: &str, kind: Option<&str>, tables: &[Table]) -> String {
        let doc = docstring(tables.iter().find(|table| table.kind == kind).map_or("", |table| table.doc));
        let mut fields = Vec::new();
        if let Some(kind) = kind {
            fields.push(("kind", format!("Literal[\"{kind}\"]"), String::new()));
        }
        for quantity in tables.iter().flat_map(|table| table.quantities) {
            if kind.is_some() && quantity.name() == "kind" {
                continue;
            }
            fields.extend(quantity.keys.iter().map(|key| (key.name, self.of_key(path, key), meaning(quantity, key))));
        }
        if fields.iter().any(|(key, ..)| RESERVED.contains(key)) {
            let field = |(key, of, meaning): &(&str, String, String)| {
                format!("        \"{key}\": \"{}\",  # {meaning}\n", of.replace('"', "'"))
            };
            let fields: String = fields.iter().map(field).collect();
            let call =
                |name: &str| format!("TypedDict(\n    \"{name}\",\n    {{\n{fields}    }},\n    total=False,\n)");
            return self.write(name, |name| format!("# {doc}\n{name} = {}", call(name)));
        }
        let field = |(key, of, meaning): &(&str, String, String)| {
            let meaning = if meaning.is_empty() { String::new() } else { format!("\n    \"\"\"{meaning}\"\"\"") };
            format!("\n    {key}: {of}{meaning}")
        };
        let fields: String = fields.iter().map(field).collect();
        self.write(name, |name| format!("class {name}(TypedDict, total=False):\n    \"\"\"{doc}\"\"\"\n{fields}"))
    }

    /// The type of a key's value.
    fn of_key(&mut self, path: &str, key: &Key) -> String {
        let inner = path_of(&self.tables, path, key.name);
        match key.kind {
            ValueKind::Number(range) => number(range).into(),
            ValueKind::Numbers(range) => format!("Sequence[{}]", number(range)),
            ValueKind::NumbersOrTable(range) => format!("Union[Sequence[{}], {}]", number(range), self.table(&inner)),
            ValueKind::Word(words) => {
                let words: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
                format!("Literal[{}]", words.join(", "))
            }
            // In Python a dict names its case by a file or has its tables.
            ValueKind::Text if key.name == CASE => "Union[str, os.PathLike[str], Case]".into(),
            ValueKind::Text => "str".into(),
            ValueKind::Texts => "Sequence[str]".into(),
            ValueKind::TextOrPlace => "Union[str, int]".into(),
            ValueKind::TextOrCase => "Union[str, os.PathLike[str], Case]".into(),
            ValueKind::Table => self.table(&inner),
            ValueKind::OneOrMoreTables if self.file != FileKind::Case => self.table(&inner),
            ValueKind::OneOrMoreTables => {
                let one = self.table(&inner);
                format!("Union[{one}, Sequence[{one}]]")
            }
            ValueKind::Tables => format!("Sequence[{}]", self.table(&inner)),
        }
    }
}

fn number(range: Range) -> &'static str {
    if matches!(range, Range::Whole(..)) { "int" } else { "float" }
}

/// The meaning of a key; of a further key of a quantity also that it stands for the first one.
fn meaning(quantity: &KeyedQuantity, key: &Key) -> String {
    let unit = key.unit().map_or("", |unit| unit.symbol);
    let unit = if key.kind.range().is_some() && !unit.is_empty() { format!(" ({unit})") } else { String::new() };
    let instead =
        if quantity.name() == key.name { String::new() } else { format!(", in place of {}", quantity.name()) };
    docstring(&format!("{}{unit}{instead}", key.doc))
}

/// A text inside a docstring.
fn docstring(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "'")
}

/// The words of a path as one name: `particle.positive_wall` is `ParticlePositiveWall`.
fn camel(words: &str) -> String {
    let parts = words.split(['.', '_', '-', ' ']).filter(|part| !part.is_empty());
    parts.map(|part| part[..1].to_uppercase() + &part[1..]).collect()
}
