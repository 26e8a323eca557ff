//! The set-up file of a campaign or case: tables of a set-up that are read for the keys that the campaign itself leaves out.
//!
//! `set_up_file = "identified.toml"` at the top names it. It has `[structure]`, `[particle]`, `[friction_damper]` and `[tmd]` with
//! the keys of a set-up, and a list `[[identified]]` that says where the values come from. Its values are the last resort:
//! those of the set-up come first, then those at the top of the campaign.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::DeTable;

use super::TABLES as SET_UP_TABLES;
use super::keys::{PARTS, SET_UP_FILE, set_up};
use crate::failure::Failure;
use crate::input::key::Need::{Optional, Required};
use crate::input::key::Range::Any;
use crate::input::key::{KeyedQuantity, Table, ValueKind, key, number, tables};
use crate::input::{Section, Source};

/// The list of a set-up file that says where its values come from.
pub const IDENTIFIED: &str = identified::TABLE.path;

tables! {
    "The tables of a set-up file other than those of a set-up."

    "The top of a set-up file."
    top("") {
        STRUCTURE: Optional, [set_up::STRUCTURE.keys[0]];
        PARTICLE: Optional, [set_up::PARTICLE.keys[0]];
        FRICTION_DAMPER: Optional, [set_up::FRICTION_DAMPER.keys[0]];
        TMD: Optional, [set_up::TMD.keys[0]];
        IDENTIFIED: Optional, [key("identified", ValueKind::Tables, "where the values of the file come from, an entry for each")];
    }

    "Where a value comes from; `damprig identify` writes it."
    identified("identified") {
        KEY: Required, [key("key", ValueKind::Text, "the key that was identified, with its table")];
        VALUE: Required, [number("value", Any, "the value as identified, in the key's unit")];
        UNCERTAINTY: Required, [number("standard_uncertainty", Any, "its standard uncertainty")];
        INTERVAL: Required, [key("interval_95", ValueKind::Numbers(Any), "both ends of the 95 % interval")];
        UNIT: Optional, [key("unit", ValueKind::Text, "unit of the value")];
        METHOD: Optional, [key("method", ValueKind::Text, "method of the identification")];
        TAKEN_FROM: Required, [key("taken_from", ValueKind::Text, "the run or file that it was taken from")];
        DATE: Optional, [key("date", ValueKind::Text, "when it was identified")];
        DAMPRIG: Optional, [key("damprig", ValueKind::Text, "program that identified it")];
    }
}

/// The key of a campaign or a case that names the file.
const NAMED: KeyedQuantity = KeyedQuantity { keys: &[SET_UP_FILE], need: Optional };

/// Where a value of a set-up file comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// Its key, with its table: `structure.damping_ratio`.
    pub key: String,
    /// The value as identified, in the key's unit.
    pub value: f64,
    /// Standard uncertainty.
    pub standard_uncertainty: f64,
    /// Ends of the 95 % interval.
    pub interval_95: [f64; 2],
    /// Unit.
    pub unit: String,
    /// Method.
    pub method: String,
    /// Run or file.
    pub taken_from: String,
    /// When it was identified.
    pub date: String,
    /// Program that identified it.
    pub damprig: String,
}

/// A set-up file as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUpFile {
    /// Its path as the campaign names it.
    pub file: String,
    /// Its text.
    pub text: String,
    /// Where its values come from.
    pub identified: Vec<Identified>,
}

impl SetUpFile {
    /// Reads a file that no campaign or case needs to name.
    ///
    /// # Errors
    /// All its problems, each with file, line, key, value, what is allowed and the likely fix.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let source = Source::read(path)?;
        let identified = source.read_toml(source.text(), "the set-up file is not TOML", read_all);
        source.verdict()?;
        let (file, text) = (source.name().to_string(), source.text().to_string());
        Ok(Self { file, text, identified: identified.unwrap_or_default() })
    }
}

/// Where a run folder keeps the set-up file of its campaign, given the subfolder for copies.
#[must_use]
pub fn kept(copies: &Path, file: &str) -> PathBuf {
    let name = Path::new(file).file_name().unwrap_or_default().to_string_lossy();
    copies.join(format!("set_up-{name}"))
}

/// Reads the text of the set-up file that a campaign or case names, and attaches it to its source: the text with its
/// name, or `None` without one, or after a problem has been reported.
pub fn attach(root: &Section) -> Option<SetUpText> {
    let named = root.text_of(&NAMED)?;
    let own = Path::new(root.source().name()).parent().unwrap_or(Path::new("")).to_path_buf();
    let copy = root.source().copies().and_then(|copies| copies.set_up_file.clone());
    let path = copy.unwrap_or_else(|| own.join(&named.value));
    match root.source().read_named(&path) {
        Ok(file) => {
            let padded = root.source().attach(file.name(), file.text());
            Some(SetUpText { file: named.value, text: file.text().to_string(), padded })
        }
        Err(error) => {
            let help = "write the path relative to this file; `damprig identify … --out FILE` makes one";
            root.refuse(SET_UP_FILE.name, &named.span, error.to_string().replace('\n', ";"), Some(help.into()));
            None
        }
    }
}

/// The text of a set-up file.
#[derive(Debug)]
pub struct SetUpText {
    file: String,
    text: String,
    /// The text after as many blanks as the campaign has bytes: places in it are places of the attached file.
    padded: String,
}

impl SetUpText {
    /// Parses the text; `None` after a problem has been reported.
    pub fn parse<'s>(&'s self, source: &Source) -> Option<Spanned<DeTable<'s>>> {
        DeTable::parse(&self.padded)
            .map_err(|error| {
                source.report(crate::input::Problem {
                    title: "the set-up file is not TOML".into(),
                    span: error.span().unwrap_or_default(),
                    allowed: error.message().to_string(),
                    help: None,
                });
            })
            .ok()
    }

    /// Checks every key of the parsed file, also those that no set-up uses; gives its origin. `None` after a problem.
    pub fn check(&self, source: &Source, document: &Spanned<DeTable>) -> Option<SetUpFile> {
        let root = Section::root(source, document);
        let identified = read_all(&root);
        root.finish();
        Some(SetUpFile { file: self.file.clone(), text: self.text.clone(), identified: identified? })
    }
}

/// Checks every key of structure and dampers at the top of a file, also those that no set-up uses.
pub fn check_parts(root: &Section) {
    for part in PARTS {
        if let Some(table) = root.table_of(&part, None) {
            check_table(&table, part.name());
        }
    }
}

/// Checks the keys of a table against the declarations, and the tables inside it.
fn check_table(section: &Section, path: &str) {
    let variants: Vec<&Table> = SET_UP_TABLES.iter().filter(|table| table.path == path).collect();
    let kinds: Vec<Table> = variants.iter().filter(|table| table.kind.is_some()).map(|table| **table).collect();
    let declared = if kinds.is_empty() {
        variants.first().copied()
    } else {
        section.variant(&kinds).and_then(|place| variants.get(place).copied())
    };
    let Some(declared) = declared else { return };
    for (name, inner) in section.check_keys(declared) {
        check_table(&inner, &format!("{path}.{name}"));
    }
    section.finish();
}

/// Checks the tables, and reads where the values come from; `None` after a problem.
fn read_all(root: &Section) -> Option<Vec<Identified>> {
    check_parts(root);
    let entries = root.tables_of(&top::IDENTIFIED);
    let identified: Vec<Option<Identified>> = entries.iter().map(read_identified).collect();
    identified.into_iter().collect()
}

fn read_identified(entry: &Section) -> Option<Identified> {
    let text = |quantity| entry.text_of(quantity).map(|text| text.value);
    let ends = entry.numbers_of(&identified::INTERVAL);
    let (key, taken_from) = (text(&identified::KEY), text(&identified::TAKEN_FROM));
    let value = entry.scalar(&identified::VALUE);
    let uncertainty = entry.scalar(&identified::UNCERTAINTY);
    let [unit, method, date, damprig] =
        [&identified::UNIT, &identified::METHOD, &identified::DATE, &identified::DAMPRIG].map(text);
    entry.finish();
    let ends = ends?;
    let [low, high] = &ends[..] else {
        entry.reject(identified::INTERVAL.name(), "must have two ends", None);
        return None;
    };
    Some(Identified {
        key: key?,
        value: value?,
        standard_uncertainty: uncertainty?,
        interval_95: [low.value, high.value],
        unit: unit.unwrap_or_default(),
        method: method.unwrap_or_default(),
        taken_from: taken_from?,
        date: date.unwrap_or_default(),
        damprig: damprig.unwrap_or_default(),
    })
}

/// `own` with the keys of `file` for the quantities that `own` does not state; `path` is the name of both.
pub(super) fn completed<'a>(path: &str, own: Option<&DeTable<'a>>, file: &DeTable<'a>) -> DeTable<'a> {
    let Some(own) = own else { return file.clone() };
    let mut table = own.clone();
    let declared =
        SET_UP_TABLES.iter().filter(|declared| declared.path == path).flat_map(|declared| declared.quantities);
    let stated: Vec<&str> = declared
        .filter(|quantity| quantity.keys.iter().any(|key| own.contains_key(key.name)))
        .flat_map(|quantity| quantity.keys.iter().map(|key| key.name))
        .collect();
    for (key, value) in file {
        if !stated.contains(&key.get_ref().as_ref()) && !own.contains_key(key.get_ref().as_ref()) {
            table.insert(key.clone(), value.clone());
        }
    }
    table
}
