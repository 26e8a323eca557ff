//! Writes identified values as a set-up file: the tables of a set-up with these keys, and where each value comes from.
//!
//! [`crate::setup::set_up_file`] reads it for campaigns and cases.

use toml::{Table, Value};

use super::Identification;
use crate::failure::Failure;
use crate::setup::IDENTIFIED;

/// The text of a set-up file with these results. `earlier` is the text of the file that they are added to: values of the same
/// keys are replaced, all others kept.
///
/// # Errors
/// When `earlier` is not TOML, or has something else under a table's name.
pub fn text(identified: &Identification, earlier: Option<&str>) -> Result<String, Failure> {
    let mut file: Table = earlier
        .unwrap_or_default()
        .parse()
        .map_err(|e| Failure::Input(format!("the set-up file to add to is not TOML: {e}")))?;
    let keyed: Vec<_> = identified.estimates.iter().filter(|estimate| estimate.key.is_some()).collect();
    // The words of a kind decide which other keys are allowed, so they replace a table of another kind.
    for (key, word) in &identified.words {
        let place = table_of(&mut file, key)?;
        if place.0.get(place.1).is_some_and(|old| old.as_str() != Some(word)) {
            place.0.clear();
        }
    }
    for (key, word) in &identified.words {
        let (table, name) = table_of(&mut file, key)?;
        table.insert(name.into(), Value::String((*word).into()));
    }
    // One coefficient replaces a table, and a constant one a power of the speed too.
    let has = |key: &str| keyed.iter().any(|estimate| estimate.key == Some(key));
    let law = ["particle.wall.exponent", "particle.wall.reference_speed_m_per_s", "particle.wall.maximum"];
    let is_constant = has("particle.wall.coefficient") && !law.iter().any(|key| has(key));
    let table = ["particle.wall.coefficients", "particle.wall.speeds_m_per_s"];
    let replaced: Vec<&str> = match (has("particle.wall.coefficient"), is_constant) {
        (false, _) => vec![],
        (true, false) => table.to_vec(),
        (true, true) => law.into_iter().chain(table).collect(),
    };
    for key in &replaced {
        let (table, name) = table_of(&mut file, key)?;
        table.remove(name);
    }
    for estimate in &keyed {
        let (table, name) = table_of(&mut file, estimate.key.unwrap_or_default())?;
        table.insert(name.into(), Value::Float(estimate.value));
    }
    let Some(Value::Array(list)) = file.remove(IDENTIFIED).or(Some(Value::Array(vec![]))) else {
        return Err(Failure::Input(format!("`{IDENTIFIED}` must be a list of tables, each headed `[[{IDENTIFIED}]]`")));
    };
    let is_kept = |entry: &Value| {
        let key = entry.get("key").and_then(Value::as_str);
        let is_replaced = key.is_some_and(|key| replaced.contains(&key));
        !is_replaced && !keyed.iter().any(|estimate| estimate.key == key)
    };
    let mut list: Vec<Value> = list.into_iter().filter(is_kept).collect();
    for estimate in keyed {
        let mut entry = Table::new();
        let texts = [
            ("key", estimate.key.unwrap_or_default()),
            ("unit", estimate.unit),
            ("method", estimate.method),
            ("taken_from", &identified.taken_from),
            ("date", &identified.date),
            ("damprig", identified.damprig),
        ];
        entry.extend(texts.map(|(name, text)| (name.to_string(), Value::String(text.into()))));
        entry.insert("value".into(), Value::Float(estimate.value));
        entry.insert("standard_uncertainty".into(), Value::Float(estimate.standard_uncertainty));
        entry.insert("interval_95".into(), Value::Array(estimate.interval_95.map(Value::Float).to_vec()));
        list.push(Value::Table(entry));
    }
    file.insert(IDENTIFIED.into(), Value::Array(list));
    let body = toml::to_string(&file).map_err(|e| Failure::Input(format!("cannot write the set-up file: {e}")))?;
    let head = "# Identified parameters, written by `damprig identify`. A campaign or case reads them with\n# \
                set_up_file = \"THIS FILE\" at its top; its own keys override these values.\n";
    Ok(format!("{head}{body}"))
}

/// The table of a dotted key, made where it is missing, and the key's last part.
fn table_of<'f, 'k>(file: &'f mut Table, key: &'k str) -> Result<(&'f mut Table, &'k str), Failure> {
    let (path, name) = key.rsplit_once('.').unwrap_or(("", key));
    let mut table = file;
    for part in path.split('.').filter(|part| !part.is_empty()) {
        let value = table.entry(part).or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(inner) = value else {
            return Err(Failure::Input(format!("`{part}` of the set-up file to add to must be a table")));
        };
        table = inner;
    }
    Ok((table, name))
}
