//! The set-up file of a campaign or case: tables of a set-up that are read for the keys that the campaign itself leaves out.
//!
//! `set_up_file = "identified.toml"` at the top names it. It has `[structure]`, `[particle]`, `[friction_damper]` and `[tmd]` with
//! the keys of a set-up, and a list `[[identified]]` that says where the values come from. Its values are the last resort:
//! those of the set-up come first, then those at the top of the campaign.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::DeTable;

use super::TABLES;
use super::keys::set_up;
use crate::input::key::{Quantity, Table};
use crate::input::{Section, Source};

/// The key at the top of a campaign or case.
pub const SET_UP_FILE: &str = "set_up_file";

/// The list of a set-up file that says where its values come from.
pub const IDENTIFIED: &str = "identified";

/// The tables that a set-up file may have.
const PARTS: [Quantity; 4] = [set_up::STRUCTURE, set_up::PARTICLE, set_up::FRICTION_DAMPER, set_up::TMD];

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

/// Where a run folder keeps the set-up file of its campaign, given the subfolder for copies.
#[must_use]
pub fn kept(copies: &Path, file: &str) -> PathBuf {
    let name = Path::new(file).file_name().unwrap_or_default().to_string_lossy();
    copies.join(format!("set_up-{name}"))
}

/// Reads the text of the set-up file that a campaign or case names, and attaches it to its source: the text with its
/// name, or `None` without one, or after a problem has been reported. `copies` is the subfolder of a run folder for copies; none for
/// a case, which has no run folder.
pub fn attach(root: &Section, copies: Option<&str>) -> Option<SetUpText> {
    let named = root.text(SET_UP_FILE)?;
    let own = Path::new(root.source().name()).parent().unwrap_or(Path::new("")).to_path_buf();
    let copy = copies.map(|copies| kept(&own.join(copies), &named.value)).filter(|copy| copy.is_file());
    let path = copy.unwrap_or_else(|| own.join(&named.value));
    match Source::read(&path) {
        Ok(file) => {
            let padded = root.source().attach(file.name(), file.text());
            Some(SetUpText { file: named.value, text: file.text().to_string(), padded })
        }
        Err(error) => {
            let help = "write the path relative to this file; `damprig identify … --out FILE` makes one";
            root.refuse(SET_UP_FILE, &named.span, error.to_string().replace('\n', ";"), Some(help.into()));
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
        for part in PARTS {
            if let Some(table) = root.table(part.name(), None) {
                check_table(&table, part.name());
            }
        }
        let entries = root.tables(IDENTIFIED);
        let identified: Vec<Option<Identified>> = entries.iter().map(read_identified).collect();
        root.finish();
        let identified: Option<Vec<Identified>> = identified.into_iter().collect();
        Some(SetUpFile { file: self.file.clone(), text: self.text.clone(), identified: identified? })
    }
}

/// Checks the keys of a table against the declarations, and the tables inside it.
fn check_table(section: &Section, path: &str) {
    let variants: Vec<&Table> = TABLES.iter().filter(|table| table.path == path).collect();
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

fn read_identified(entry: &Section) -> Option<Identified> {
    let text = |key, what| entry.required(key, what, Section::text).map(|text| text.value);
    let number = |key, what| entry.required(key, what, Section::number).map(|number| number.value);
    let ends = entry.required("interval_95", "both ends of the 95 % interval", Section::numbers);
    let (key, value) = (text("key", "the key that was identified"), number("value", "the value"));
    let uncertainty = number("standard_uncertainty", "its standard uncertainty");
    let unit = entry.text("unit").map(|text| text.value).unwrap_or_default();
    let method = entry.text("method").map(|text| text.value).unwrap_or_default();
    let taken_from = text("taken_from", "the run or file that it was taken from");
    let date = entry.text("date").map(|text| text.value).unwrap_or_default();
    let damprig = entry.text("damprig").map(|text| text.value).unwrap_or_default();
    entry.finish();
    let ends = ends?;
    let [low, high] = &ends[..] else {
        entry.reject("interval_95", "must have two ends", None);
        return None;
    };
    Some(Identified {
        key: key?,
        value: value?,
        standard_uncertainty: uncertainty?,
        interval_95: [low.value, high.value],
        unit,
        method,
        taken_from: taken_from?,
        date,
        damprig,
    })
}

/// `own` with the keys of `file` for the quantities that `own` does not state; `path` is the name of both.
pub(super) fn completed<'a>(path: &str, own: Option<&DeTable<'a>>, file: &DeTable<'a>) -> DeTable<'a> {
    let Some(own) = own else { return file.clone() };
    let mut table = own.clone();
    let declared = TABLES.iter().filter(|declared| declared.path == path).flat_map(|declared| declared.quantities);
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
