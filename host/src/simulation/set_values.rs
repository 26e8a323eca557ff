//! Values of a case that are set from outside its file: by `--set key=value` and by the axes of a study.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::keys;
use crate::failure::Failure;
use crate::input::Span;
use crate::input::key::KeyedQuantity;
use crate::{motion_record, setup, structure};

/// Values in place of those of a case, as lines of TOML: `particle.wall.coefficient = 0.5`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SetValues {
    /// Who sets them, as messages name it: `--set`.
    pub origin: String,
    /// A line for each value.
    pub lines: String,
}

impl SetValues {
    /// From `key=value` texts of a command line. A value that is no TOML is a text without its quotes.
    ///
    /// # Errors
    /// Names the text without `=`, without a key, or with a key that another one sets too.
    pub fn from_arguments(arguments: &[String]) -> Result<Self, Failure> {
        Self::of("--set", arguments)
    }

    /// From `key=value` texts that `origin` gives.
    ///
    /// # Errors
    /// As [`SetValues::from_arguments`].
    pub fn of(origin: &str, arguments: &[String]) -> Result<Self, Failure> {
        let mut lines = String::new();
        for argument in arguments {
            let refused = |why: &str| {
                Failure::Input(format!("{origin} {argument:?}: {why}; write for example particle.wall.coefficient=0.5"))
            };
            let (key, value) = argument.split_once('=').ok_or_else(|| refused("there is no `=`"))?;
            let (key, value) = (key.trim(), value.trim());
            let is_key = !key.is_empty() && key.split('.').all(|part| !part.is_empty() && part.chars().all(is_bare));
            if !is_key {
                return Err(refused("before the `=` stands the key with its tables, separated by points"));
            }
            if value.is_empty() {
                return Err(refused("there is no value after the `=`"));
            }
            let as_it_is = format!("{key} = {value}\n");
            let is_one_value = DeTable::parse(&as_it_is).is_ok_and(|read| read.get_ref().len() == 1);
            let quoted = toml::Value::from(value).to_string();
            lines.push_str(&if is_one_value { as_it_is } else { format!("{key} = {quoted}\n") });
            if let Err(error) = DeTable::parse(&lines) {
                return Err(refused(error.message()));
            }
        }
        Ok(Self { origin: origin.into(), lines })
    }

    /// The same with a number at a key, whose tables in lists have their numbers.
    #[must_use]
    pub fn with(&self, key: &str, value: f64) -> Self {
        let mut all: toml::Value = toml::Value::Table(toml::from_str(&self.lines).unwrap_or_default());
        let parts: Vec<&str> = key.split('.').collect();
        put_number(&mut all, &parts, value);
        let lines = toml::to_string(&all).unwrap_or_default();
        Self { origin: self.origin.clone(), lines }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}

/// Puts a number at a path of keys and of numbers of tables in lists that are there.
fn put_number(into: &mut toml::Value, path: &[&str], number: f64) {
    let Some((first, rest)) = path.split_first() else {
        *into = number.into();
        return;
    };
    match into {
        toml::Value::Array(list) => {
            let place = first.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            if let Some(table) = place.and_then(|place| list.get_mut(place)) {
                put_number(table, rest, number);
            }
        }
        toml::Value::Table(table) => {
            put_number(table.entry(*first).or_insert_with(|| toml::Table::new().into()), rest, number);
        }
        _ => {}
    }
}

fn is_bare(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}

/// The path of what a table has under a key: of a table of a list that of the list.
fn inside(path: &str, name: &str) -> String {
    match (path.is_empty(), is_number(name)) {
        (true, _) => name.to_string(),
        (false, true) => path.to_string(),
        (false, false) => format!("{path}.{name}"),
    }
}

fn is_number(name: &str) -> bool {
    name.parse::<usize>().is_ok()
}

fn has_number(values: &DeTable) -> bool {
    values.iter().any(|(key, _)| is_number(key.get_ref()))
}

/// Whether the keys are numbers, from 1, of the tables of a list of this length.
fn are_of_list(values: &DeTable, length: usize) -> bool {
    let is_one = |key: &str| key.parse::<usize>().is_ok_and(|number| (1..=length).contains(&number));
    values.iter().all(|(key, value)| is_one(key.get_ref()) && value.get_ref().is_table())
}

/// Puts `values` into `own`, the table of a case at `path`; tables of a list have their numbers, from 1, as keys, which a list of one may leave out. A table with a `kind` replaces the case's own, others are put in key by
/// key. The other keys of a quantity are removed: a `clearance_ratio` replaces a `clearance_m`.
/// Returns where a value is for no table of a list, and why.
pub(super) fn put<'t>(own: &mut DeTable<'t>, values: &DeTable<'t>, path: &str) -> Vec<(Span, String)> {
    let mut lost = Vec::new();
    for (key, value) in values {
        let name = key.get_ref().as_ref();
        for other in alternatives(path, name) {
            own.remove(other);
        }
        let inside = inside(path, name);
        match (own.get_mut(name).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(own)), DeValue::Table(values)) if !values.contains_key("kind") => {
                lost.extend(put(own, values, &inside));
            }
            (Some(DeValue::Array(list)), DeValue::Table(values)) if list.len() == 1 && !has_number(values) => {
                if let Some(DeValue::Table(own)) = list.first_mut().map(Spanned::get_mut) {
                    lost.extend(put(own, values, &inside));
                }
            }
            (Some(DeValue::Array(list)), DeValue::Table(values)) if are_of_list(values, list.len()) => {
                for (number, values) in values {
                    let place = number.get_ref().parse::<usize>().map_or(0, |number| number - 1);
                    if let (Some(DeValue::Table(own)), DeValue::Table(values)) =
                        (list.get_mut(place).map(Spanned::get_mut), values.get_ref())
                    {
                        lost.extend(put(own, values, &inside));
                    }
                }
            }
            (Some(DeValue::Array(list)), DeValue::Table(_)) if !list.is_empty() => {
                let which = match list.len() {
                    1 => format!("the file has one: write {inside}.1"),
                    count => format!("the file has {count}: write {inside}.1 to {inside}.{count}"),
                };
                lost.push((key.span(), which));
            }
            _ => {
                own.insert(key.clone(), Spanned::clone(value));
            }
        }
    }
    lost
}

/// Two of the values that are keys of one quantity, with the tables of both: the later one would replace the other.
pub(super) fn both_of_one<'v, 't>(
    values: &'v DeTable<'t>,
    path: &str,
) -> Option<(&'v Spanned<std::borrow::Cow<'t, str>>, String, &'static str)> {
    values.iter().find_map(|(key, value)| {
        let name = key.get_ref().as_ref();
        let other = alternatives(path, name).find(|other| values.contains_key(*other));
        match (other, value.get_ref()) {
            (Some(other), _) => Some((key, inside(path, name), other)),
            (None, DeValue::Table(inner)) => both_of_one(inner, &inside(path, name)),
            _ => None,
        }
    })
}

/// The other keys of the quantity that a table has under this key.
fn alternatives(path: &str, name: &str) -> impl Iterator<Item = &'static str> {
    let has = |quantity: &&KeyedQuantity| quantity.key(name).is_some();
    let quantities = [keys::TABLES, structure::TABLES, setup::TABLES, motion_record::TABLES].concat().into_iter();
    let found: Vec<&'static KeyedQuantity> =
        quantities.filter(|table| table.path == path).flat_map(|table| table.quantities.iter().filter(has)).collect();
    let name = name.to_string();
    found.into_iter().flat_map(|quantity| quantity.keys).map(|key| key.name).filter(move |other| *other != name)
}

/// The keys of a case as written that `changed` keys do not replace, with their tables and values, as a JSON object.
#[must_use]
pub fn fixed_parameters(case: &str, changed: &[&str]) -> String {
    let written = toml::from_str::<serde_json::Value>(case).or_else(|_| serde_json::from_str(case)).unwrap_or_default();
    let mut fixed = serde_json::Map::new();
    flatten(written, String::new(), &mut fixed);
    for key in changed {
        let (path, name) = key.rsplit_once('.').unwrap_or(("", key));
        fixed.remove(*key);
        for other in alternatives(&without_numbers(path), name) {
            fixed.remove(format!("{path}.{other}").trim_start_matches('.'));
        }
    }
    serde_json::Value::from(fixed).to_string()
}

/// The keys of numbers of a case as written, with their tables and values; `values` replace some.
#[must_use]
pub fn numbers_of(case: &str, values: &SetValues) -> Vec<(String, f64)> {
    let mut set = serde_json::Map::new();
    flatten(toml::from_str(&values.lines).unwrap_or_default(), String::new(), &mut set);
    let changed: Vec<&str> = set.keys().map(String::as_str).collect();
    let mut all: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(&fixed_parameters(case, &changed)).unwrap_or_default();
    all.extend(set);
    all.into_iter().filter_map(|(key, value)| Some((key, value.as_f64()?))).collect()
}

/// A path without the numbers of tables in lists.
#[must_use]
pub fn without_numbers(path: &str) -> String {
    path.split('.').filter(|part| !is_number(part)).collect::<Vec<_>>().join(".")
}

fn flatten(value: serde_json::Value, key: String, flat: &mut serde_json::Map<String, serde_json::Value>) {
    match value {
        serde_json::Value::Object(table) => {
            for (name, value) in table {
                flatten(value, if key.is_empty() { name } else { format!("{key}.{name}") }, flat);
            }
        }
        serde_json::Value::Array(tables) if !tables.is_empty() && tables.iter().all(serde_json::Value::is_object) => {
            for (number, table) in (1..).zip(tables) {
                flatten(table, format!("{key}.{number}"), flat);
            }
        }
        value if !key.is_empty() => drop(flat.insert(key, value)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(case: &str, set: &[&str]) -> String {
        let arguments: Vec<String> = set.iter().map(ToString::to_string).collect();
        let values = SetValues::from_arguments(&arguments).expect("the arguments are sound");
        let mut document = DeTable::parse(case).expect("it is TOML");
        let set = DeTable::parse(&values.lines).expect("it is TOML");
        put(document.get_mut(), set.get_ref(), "");
        format!("{:?}", document.get_ref().iter().map(shown).collect::<Vec<_>>())
    }

    fn shown((key, value): (&Spanned<std::borrow::Cow<'_, str>>, &Spanned<DeValue<'_>>)) -> String {
        match value.get_ref() {
            DeValue::Table(table) => format!("{}{:?}", key.get_ref(), table.iter().map(shown).collect::<Vec<_>>()),
            DeValue::Float(number) => format!("{}={}", key.get_ref(), number.as_str()),
            DeValue::Integer(number) => format!("{}={}", key.get_ref(), number.as_str()),
            DeValue::String(text) => format!("{}='{text}'", key.get_ref()),
            _ => unreachable!("not in these tests"),
        }
        .replace('"', "")
    }

    #[test]
    fn a_value_replaces_the_other_key_of_its_quantity_and_leaves_the_rest() {
        let case = "particle = {mass_kg = 1, clearance_m = 0.02, wall = {kind = 'restitution', coefficient = 0.5}}";
        let all = changed(case, &["particle.clearance_ratio=12.5", "particle.wall.coefficient=0.25"]);
        assert!(all.contains("mass_kg=1") && all.contains("clearance_ratio=12.5"), "{all}");
        assert!(!all.contains("clearance_m") && all.contains("kind='restitution', coefficient=0.25"), "{all}");
    }

    #[test]
    fn a_table_with_its_kind_replaces_the_table_and_a_missing_table_is_made() {
        let case = "particle = {wall = {kind = 'restitution', coefficient = 0.5}}";
        let all = changed(case, &["particle.wall={kind='voigt', material='rubber'}", "friction_damper.force_n=0.5"]);
        assert!(all.contains("kind='voigt'") && !all.contains("coefficient"), "{all}");
        assert!(all.contains("friction_damper") && all.contains("force_n=0.5"), "{all}");
    }

    #[test]
    fn a_table_of_a_list_has_its_number_as_a_key() {
        let case = "particle = [{mass_kg = 1, clearance_m = 0.02}, {mass_kg = 2, clearance_m = 0.03}]";
        let mut document = DeTable::parse(case).expect("it is TOML");
        let set = DeTable::parse("particle.2.clearance_ratio = 9").expect("it is TOML");
        put(document.get_mut(), set.get_ref(), "");
        let list = document.get_ref().get("particle").and_then(|list| list.get_ref().as_array()).expect("a list");
        let keys = |n: usize| {
            list[n]
                .get_ref()
                .as_table()
                .map(|table| table.iter().map(|(key, _)| key.get_ref().to_string()).collect::<Vec<_>>())
        };
        assert_eq!(keys(0), Some(vec!["mass_kg".into(), "clearance_m".into()]));
        assert_eq!(keys(1), Some(vec!["mass_kg".into(), "clearance_ratio".into()]));
        let twice = DeTable::parse("particle.2 = {clearance_ratio = 9, clearance_m = 1}").expect("it is TOML");
        assert!(both_of_one(twice.get_ref(), "").is_some());
        let fixed = fixed_parameters(case, &["particle.2.clearance_ratio"]);
        assert_eq!(fixed, "{\"particle.1.clearance_m\":0.02,\"particle.1.mass_kg\":1,\"particle.2.mass_kg\":2}");
    }

    #[test]
    fn fixed_parameters_are_the_keys_that_are_not_changed() {
        let case = "particle = {mass_kg = 1, clearance_m = 0.02, wall = {coefficient = 0.5}}\n[run]\nduration_s = 8";
        let fixed = fixed_parameters(case, &["particle.clearance_ratio"]);
        assert_eq!(fixed, "{\"particle.mass_kg\":1,\"particle.wall.coefficient\":0.5,\"run.duration_s\":8}");
    }

    #[test]
    fn a_word_needs_no_quotes_and_a_wrong_argument_is_named() {
        assert!(changed("", &["particle.start=at_negative_wall"]).contains("start='at_negative_wall'"));
        for (wrong, why) in [
            ("particle.start", "no `=`"),
            ("=3", "the key"),
            ("a..b=3", "the key"),
            ("a=", "no value"),
            ("a b=1", "the key"),
        ] {
            let answer = SetValues::from_arguments(&[wrong.to_string()]).expect_err(wrong).to_string();
            assert!(answer.contains(why) && answer.contains(wrong.trim()), "{answer}");
        }
        let twice = ["a.b=1".to_string(), "a.b=2".to_string()];
        assert!(SetValues::from_arguments(&twice).expect_err("twice").to_string().contains("duplicate"));
    }
}
