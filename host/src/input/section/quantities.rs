//! Reads quantities as they are declared ([`crate::input::key`]): under one of their keys, within its range, required or not.

use std::sync::LazyLock;

use toml::de::DeTable;

use super::{Number, Section, Text};
use crate::input::Problem;
use crate::input::key::{DefaultValue, Key, KeyedQuantity, Need, Table, ValueKind};

/// The value of a quantity.
#[derive(Debug)]
pub enum Given<'a> {
    /// A number.
    Number(f64),
    /// A list of numbers.
    Numbers(Vec<Number>),
    /// A word, by its place among the key's words.
    Word(usize),
    /// A text.
    Text(Text),
    /// A list of texts.
    Texts(Vec<Text>),
    /// A table.
    Table(Section<'a>),
    /// A list of tables.
    Tables(Vec<Section<'a>>),
}

/// What decided on the need of a quantity.
#[derive(Clone, Copy)]
struct Condition {
    other: &'static KeyedQuantity,
    /// Its key.
    key: &'static str,
    /// Its word, if the word decides.
    word: Option<&'static str>,
    holds: bool,
}

/// Stands in for a table that is left out.
static EMPTY: LazyLock<DeTable<'static>> = LazyLock::new(DeTable::new);

impl<'a> Section<'a> {
    /// The keys of a quantity that are written, here or in the table that the section inherits from.
    fn found(&self, quantity: &KeyedQuantity) -> Vec<&'static Key> {
        quantity.keys.iter().filter(|key| self.value(key.name).is_some()).collect()
    }

    /// Whether a quantity is written, here or in the table that the section inherits from.
    #[must_use]
    pub fn is_given(&self, quantity: &KeyedQuantity) -> bool {
        !self.found(quantity).is_empty()
    }

    /// Leaves a quantity to another reader of the same table.
    pub fn leave(&self, quantity: &KeyedQuantity) {
        self.found(quantity);
    }

    /// The key under which a quantity is written; the section's own before an inherited one.
    pub fn written(&self, quantity: &KeyedQuantity) -> Option<&'static Key> {
        let found = self.found(quantity);
        let own: Vec<&Key> = found.iter().copied().filter(|key| self.has_own(key.name)).collect();
        let found = if own.is_empty() { found } else { own };
        if let [first, second, ..] = found[..] {
            let help = Some(format!("leave out `{}` or `{}`", first.name, second.name));
            self.reject(second.name, format!("`{}` is given too, and says the same quantity", first.name), help);
        }
        found.first().copied()
    }

    /// A declared quantity: the place of its key among its keys, and the value; `None` if there is none, or after a problem
    /// has been reported.
    pub fn given(&self, quantity: &KeyedQuantity) -> Option<(usize, Given<'a>)> {
        let key = self.written(quantity);
        let (need, reason) = self.need(quantity);
        match (key, need) {
            // The section's own keys override inherited ones.
            (Some(key), Need::Forbidden) => {
                if self.has_own(key.name) || !reason.is_some_and(|reason| self.has_own(reason.key)) {
                    self.forbid(key, reason);
                }
                None
            }
            (Some(key), _) => Some((quantity.keys.iter().position(|k| k.name == key.name)?, self.read(key)?)),
            (None, Need::Required | Need::RequiredUnless(_)) => {
                self.lack(quantity);
                None
            }
            (None, Need::Default(DefaultValue::Word(word))) => {
                let ValueKind::Word(words) = quantity.keys[0].kind else { return None };
                Some((0, Given::Word(words.iter().position(|w| *w == word)?)))
            }
            (None, Need::Default(value)) => Some((0, Given::Number(value.number()?))),
            (None, _) => None,
        }
    }

    /// The need of a quantity in this section, and what decided on it.
    fn need(&self, quantity: &KeyedQuantity) -> (Need, Option<Condition>) {
        let mut need = quantity.need;
        let mut reason = None;
        loop {
            let (condition, then, otherwise) = match need {
                Need::If(other, key, then, otherwise) => {
                    let holds = self.written(other).is_some_and(|written| written.name == key);
                    (Condition { other, key, word: None, holds }, then, otherwise)
                }
                Need::IfWord(other, word, then, otherwise) => {
                    // A word that is missing or wrong has its own message.
                    let Some(actual) = self.word_in_force(other) else { return (Need::Optional, reason) };
                    (Condition { other, key: other.name(), word: Some(word), holds: actual == word }, then, otherwise)
                }
                _ => return (need, reason),
            };
            need = if condition.holds { *then } else { *otherwise };
            reason = Some(condition);
        }
    }

    /// The word of a quantity, written or by default, if it is one of its words.
    fn word_in_force(&self, quantity: &KeyedQuantity) -> Option<&'a str> {
        let key = &quantity.keys[0];
        let ValueKind::Word(words) = key.kind else { return None };
        let word = match (self.value(key.name), quantity.default_value()) {
            (Some(written), _) => written.get_ref().as_str()?,
            (None, Some(DefaultValue::Word(word))) => word,
            _ => return None,
        };
        words.contains(&word).then_some(word)
    }

    /// Reports that a quantity is missing.
    fn lack(&self, quantity: &KeyedQuantity) {
        // If any of its keys is a number, the message asks for a number.
        let is_number = |key: &&Key| matches!(key.kind, ValueKind::Number(_));
        let first = quantity.keys.iter().find(is_number).unwrap_or(&quantity.keys[0]);
        let names: Vec<&'static str> = quantity.keys.iter().map(|key| key.name).collect();
        let list: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let what = match (&list[..], first.kind) {
            ([list @ .., last], _) if !list.is_empty() => format!("give {} or {last}", list.join(", ")),
            (_, ValueKind::Word(words)) => {
                let words: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
                format!("{}: write {} = {}", first.doc, first.name, words.join(" or "))
            }
            _ => first.doc.into(),
        };
        self.missing.borrow_mut().push((names, self.absence(first.name, what)));
    }

    /// Reports a key that is not allowed; `reason`: what decided so.
    fn forbid(&self, key: &'static Key, reason: Option<Condition>) {
        let Some(Condition { other, key: name, word, holds }) = reason else {
            self.reject(key.name, "must be left out", None);
            return;
        };
        if let Some(word) = word {
            let allowed = if holds { "does not go with" } else { "goes only with" };
            self.reject(key.name, format!("{allowed} {name} = {word:?}"), Some("leave it out".into()));
        } else if !holds {
            self.reject(key.name, format!("goes with `{name}`, which is not given"), None);
        } else if matches!(key.kind, ValueKind::Table | ValueKind::OneOrMoreTables) {
            self.source.report(Problem {
                title: format!("`{}` and `{}` are both given", self.full(key.name), self.full(name)),
                span: self.span_of(key.name),
                allowed: "one or the other".into(),
                help: Some(format!("leave out `{}` or `{name}`", key.name)),
            });
        } else {
            let help = Some(format!("leave out `{name}` or `{}`", key.name));
            let meaning = other.key(name).map_or("", |key| key.doc);
            self.reject(key.name, format!("`{name}` is given too: {meaning}"), help);
        }
    }

    fn read(&self, key: &'static Key) -> Option<Given<'a>> {
        match key.kind {
            ValueKind::Number(_) => {
                let number = self.number_in(key)?;
                self.warn_if_unusual(key, &number);
                Some(Given::Number(number.value))
            }
            ValueKind::NumbersOrTable(_) if self.is_table(key.name) => self.table(key.name, None).map(Given::Table),
            ValueKind::Numbers(_) | ValueKind::NumbersOrTable(_) => {
                let numbers = self.numbers(key)?;
                // One warning for the list.
                if let Some(unusual) = numbers.iter().find(|number| key.is_unusual(number.value)) {
                    self.warn_if_unusual(key, unusual);
                }
                Some(Given::Numbers(numbers))
            }
            ValueKind::Word(words) => self.choice(key.name, words).map(Given::Word),
            ValueKind::TextOrPlace if !self.is_text(key.name) => {
                let place = self.number(key.name)?;
                if place.value >= 1.0 && place.value.fract() == 0.0 && place.value < 1e6 {
                    return Some(Given::Number(place.value));
                }
                self.refuse(key.name, &place.span, "must be a place from 1 up, or a name in quotes", None);
                None
            }
            ValueKind::TextOrCase if self.is_table(key.name) => self.table(key.name, None).map(Given::Table),
            ValueKind::Text | ValueKind::TextOrPlace | ValueKind::TextOrCase => self.text(key.name).map(Given::Text),
            ValueKind::Texts => self.texts(key.name).map(Given::Texts),
            ValueKind::OneOrMoreTables if self.is_list(key.name) => Some(Given::Tables(self.tables(key.name))),
            ValueKind::Table | ValueKind::OneOrMoreTables => self.table(key.name, None).map(Given::Table),
            ValueKind::Tables => Some(Given::Tables(self.tables(key.name))),
        }
    }

    /// A declared quantity that is a number: the place of its key, and the value.
    pub fn one_of(&self, quantity: &KeyedQuantity) -> Option<(usize, f64)> {
        match self.given(quantity)? {
            (place, Given::Number(value)) => Some((place, value)),
            _ => None,
        }
    }

    /// A declared number.
    pub fn scalar(&self, quantity: &KeyedQuantity) -> Option<f64> {
        self.one_of(quantity).map(|(_, value)| value)
    }

    /// A declared number with its place; a default has the place of the section.
    pub fn placed(&self, quantity: &KeyedQuantity) -> Option<Number> {
        let (place, value) = self.one_of(quantity)?;
        Some(Number { value, span: self.span_of(quantity.keys[place].name) })
    }

    /// A declared list of numbers.
    pub fn numbers_of(&self, quantity: &KeyedQuantity) -> Option<Vec<Number>> {
        match self.given(quantity)? {
            (_, Given::Numbers(numbers)) => Some(numbers),
            _ => None,
        }
    }

    /// A declared word, by its place among the key's words.
    pub fn word(&self, quantity: &KeyedQuantity) -> Option<usize> {
        match self.given(quantity)? {
            (_, Given::Word(place)) => Some(place),
            _ => None,
        }
    }

    /// A declared text.
    pub fn text_of(&self, quantity: &KeyedQuantity) -> Option<Text> {
        match self.given(quantity)? {
            (_, Given::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// A declared list of texts.
    pub fn texts_of(&self, quantity: &KeyedQuantity) -> Option<Vec<Text>> {
        match self.given(quantity)? {
            (_, Given::Texts(texts)) => Some(texts),
            _ => None,
        }
    }

    /// A declared table, which takes missing keys from `inherited`, the table of that name at the top of the file. None without a
    /// table of its own.
    pub fn table_of(&self, quantity: &KeyedQuantity, inherited: Option<&'a DeTable<'a>>) -> Option<Section<'a>> {
        match self.given(quantity)? {
            (place, Given::Table(_)) => self.table(quantity.keys[place].name, inherited),
            (place, Given::Tables(_)) => {
                let help = "several of a kind are mounted in a case with `storey`, `beam`, `mode` or `matrices`";
                self.reject(quantity.keys[place].name, "must be one table here", Some(help.into()));
                None
            }
            _ => None,
        }
    }

    /// A declared table that may be left out: then an empty one, whose quantities all have their defaults. `None` after a problem
    /// has been reported.
    pub fn part(&self, quantity: &KeyedQuantity) -> Option<Section<'a>> {
        if self.is_given(quantity) {
            return self.table_of(quantity, None);
        }
        Some(Section::new(self.source, self.full(quantity.name()), self.span(), &EMPTY, None))
    }

    /// A declared list of tables, or the one table in place of it; empty if it is left out, or after a problem has been reported.
    pub fn tables_of(&self, quantity: &KeyedQuantity) -> Vec<Section<'a>> {
        match self.written(quantity).and_then(|key| self.read(key)) {
            Some(Given::Tables(tables)) => tables,
            Some(Given::Table(table)) => vec![table],
            _ => Vec::new(),
        }
    }

    /// Which of `tables` the section is, by its kind. `None` after the problems of a section without a known kind have been
    /// reported: do not [`finish`](Self::finish) it.
    pub fn variant(&self, tables: &[Table]) -> Option<usize> {
        let kinds: Vec<&'static str> = tables.iter().filter_map(|table| table.kind).collect();
        if self.value("kind").is_some() {
            return self.choice("kind", &kinds);
        }
        let list: Vec<String> = kinds.iter().map(|kind| format!("kind = {kind:?}")).collect();
        let absence = self.absence("kind", format!("write {}", list.join(" or ")));
        self.missing.borrow_mut().push((vec!["kind"], absence));
        // A misspelt `kind` is answered as such, beside the keys of all kinds.
        let keys = tables.iter().flat_map(|table| table.quantities).flat_map(|quantity| quantity.keys);
        self.known.borrow_mut().extend(keys.map(|key| key.name));
        self.finish();
        None
    }

    /// Checks every key of a declared table that is written, each for itself; returns the tables inside it. Nothing is required:
    /// the table completes others.
    pub fn check_keys(&self, table: &Table) -> Vec<(&'static str, Section<'a>)> {
        let mut inner = Vec::new();
        for key in table.quantities.iter().flat_map(|quantity| quantity.keys) {
            if self.value(key.name).is_some()
                && let Some(Given::Table(section)) = self.read(key)
            {
                inner.push((key.name, section));
            }
        }
        inner
    }
}
