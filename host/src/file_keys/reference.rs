//! The key reference (docs/KEYS.md): a section for each table, a row for each key.

use super::{FileKind, is_part, plain};
use crate::input::key::{Key, KeyedQuantity, Need, Range, Table, ValueKind};
use crate::{optimise, quantity};

const HEAD: &str = "\
# Keys of input files
`damprig keys` prints this page from the declarations that the parsers use. `damprig schema` prints them as a JSON Schema: with the first line
`#:schema campaign.schema.json` an editor completes and checks the file (README.md).

A number has the unit in which the key ends. *Usual* values give no warning; others within the allowed range are used, with one.
Keys of one quantity exclude each other: they have *or* in the column *needed*.
";

/// A section of the page: its title, an introduction, and its tables.
type ReferenceSection = (&'static str, &'static str, Vec<Table>);

/// The page, in Markdown.
#[must_use]
pub fn reference() -> String {
    let own = |file: FileKind| file.tables().into_iter().filter(|table| !is_part(table.path)).collect();
    let parts = FileKind::SetUp.tables().into_iter().filter(|table| is_part(table.path)).collect();
    let sections: [ReferenceSection; 7] = [
        (
            "Campaign",
            "For `damprig run`. Structure and dampers have the keys of a set-up, below.",
            own(FileKind::Campaign),
        ),
        (
            "Case",
            "For `damprig simulate`, in TOML or JSON. Structure and dampers have the keys of a set-up, below.",
            own(FileKind::Case),
        ),
        (
            "Set-up",
            "Structure and dampers, in each `[[set_up]]` and at the top of a campaign, at the top of a case, and in a set-up file. A \
             set-up has the keys that it leaves out from the top of its campaign, then from the set-up file.",
            parts,
        ),
        ("Set-up file", "For the key `set_up_file` of a campaign or a case; docs/IDENTIFY.md.", own(FileKind::SetUp)),
        ("Study", "For `damprig study`; docs/STUDIES.md.", own(FileKind::Study)),
        (
            "Optimisation",
            "For `damprig optimise`; docs/OPTIMISE.md. `[[axis]]` and `[record]` have the keys of a study, above.",
            optimise::TABLES.to_vec(),
        ),
        ("Continuation", "For `damprig continue`; docs/CONTINUE.md.", own(FileKind::Continuation)),
    ];
    let mut page = HEAD.to_string();
    for (title, introduction, tables) in &sections {
        page.push_str(&format!("\n## {title}\n{introduction}\n"));
        let mut done: Vec<(&str, Option<&str>)> = Vec::new();
        for table in tables {
            if !done.contains(&(table.path, table.kind)) {
                done.push((table.path, table.kind));
                page.push_str(&text_of(table, tables));
            }
        }
    }
    page.push_str(&results());
    page
}

/// The names of results.
fn results() -> String {
    let mut text = "\n## Names of results\n\
        A column of a table, a key of JSON, a metric and an attribute in Python have the same name for the same quantity, which ends in its \
        unit.\n\n| name | unit | meaning |\n|---|---|---|\n"
        .to_string();
    for own in quantity::Quantity::ALL {
        let definition = own.definition().replace('|', "\\|");
        text.push_str(&format!("| `{}` | {} | {definition} |\n", own.name(), own.suffix()));
    }
    text
}

/// A table with its rows, which may come from several declarations.
fn text_of(table: &Table, tables: &[Table]) -> String {
    let own = tables.iter().filter(|other| (other.path, other.kind) == (table.path, table.kind));
    let rows: Vec<String> = own
        .flat_map(|table| table.quantities)
        .flat_map(|quantity| quantity.keys.iter().map(move |key| row(quantity, key)))
        .collect();
    let head = "| key | type or unit | allowed | usual | needed | meaning |\n|---|---|---|---|---|---|\n";
    let rows = if rows.is_empty() { "No further keys.\n".into() } else { format!("\n{head}{}", rows.concat()) };
    format!("\n### {}\n{}\n{rows}", heading(table, tables), table.doc)
}

fn heading(table: &Table, tables: &[Table]) -> String {
    let (parent, name) = table.path.rsplit_once('.').unwrap_or(("", table.path));
    let of_parent = tables.iter().filter(|other| other.path == parent).flat_map(|other| other.quantities);
    let is_list =
        of_parent.flat_map(|quantity| quantity.keys).any(|key| key.name == name && key.kind == ValueKind::Tables);
    let path = match (table.path, is_list) {
        ("", _) => "Top of the file".into(),
        (path, true) => format!("`[[{path}]]`"),
        (path, false) => format!("`[{path}]`"),
    };
    table.kind.map_or(path.clone(), |kind| format!("{path} with `kind = {kind:?}`"))
}

fn row(quantity: &KeyedQuantity, key: &Key) -> String {
    let usual = key.usual.map_or(String::new(), |(least, most)| format!("{} to {}", plain(least), plain(most)));
    let others: Vec<String> =
        quantity.keys.iter().filter(|other| *other != key).map(|k| format!("`{}`", k.name)).collect();
    let is_default = matches!(quantity.need, Need::Default(_)) && quantity.name() != key.name;
    let mut needed = if is_default { "optional".into() } else { needed(quantity.need) };
    if !others.is_empty() {
        needed.push_str(&format!(", or {}", others.join(" or ")));
    }
    // A bar would end the cell.
    let cells = [format!("`{}`", key.name), type_of(key), allowed(key), usual, needed, key.doc.into()];
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

fn type_of(key: &Key) -> String {
    let unit = key.unit().map_or("", |unit| unit.symbol);
    match key.kind {
        ValueKind::Number(_) if unit.is_empty() => "number".into(),
        ValueKind::Number(_) => unit.into(),
        ValueKind::Numbers(_) if unit.is_empty() => "list of numbers".into(),
        ValueKind::Numbers(_) => format!("list, {unit}"),
        ValueKind::NumbersOrTable(_) => format!("list, {unit}, or table"),
        ValueKind::Word(_) => "word".into(),
        ValueKind::Text => "text".into(),
        ValueKind::Texts => "list of texts".into(),
        ValueKind::TextOrPlace => "text, or place from 1".into(),
        ValueKind::TextOrCase => "text, or tables of a case".into(),
        ValueKind::Table => "table".into(),
        ValueKind::OneOrMoreTables => "table, or list of tables".into(),
        ValueKind::Tables => "list of tables".into(),
    }
}

fn allowed(key: &Key) -> String {
    match key.kind {
        ValueKind::Word(words) => words.iter().map(|word| format!("`{word:?}`")).collect::<Vec<_>>().join(", "),
        kind => kind.range().filter(|range| *range != Range::Any).map_or(String::new(), Range::allowed),
    }
}

/// Whether a quantity has to be written, in words.
pub(super) fn needed(need: Need) -> String {
    match need {
        Need::Required => "required".into(),
        Need::RequiredUnless(why) => format!("required, unless {why}"),
        Need::Optional => "optional".into(),
        Need::Default(value) => format!("default {}", value.written()),
        Need::Forbidden => "not allowed".into(),
        Need::If(_, name, then, otherwise) => conditional(&format!("`{name}`"), then, otherwise),
        Need::IfWord(other, word, then, otherwise) => {
            conditional(&format!("`{} = {word:?}`", other.name()), then, otherwise)
        }
    }
}

fn conditional(condition: &str, then: &Need, otherwise: &Need) -> String {
    match (then, otherwise) {
        (Need::Forbidden, otherwise) => format!("{}, not with {condition}", needed(*otherwise)),
        (then, Need::Forbidden) => format!("{}, only with {condition}", needed(*then)),
        (then, otherwise) => format!("{} with {condition}, otherwise {}", needed(*then), needed(*otherwise)),
    }
}
