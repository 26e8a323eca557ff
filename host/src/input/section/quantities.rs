//! Reads quantities as they are declared ([`crate::input::key`]): under one of their keys, within its range, required or not.

use toml::de::DeTable;

use super::{Number, Section, Text};
use crate::input::Problem;
use crate::input::key::{DefaultValue, Key, Kind, Need, Quantity, Table};

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
    /// A table.
    Table(Section<'a>),
}

impl<'a> Section<'a> {
    /// The keys of a quantity that are written, here or in the table that the section inherits from.
    fn found(&self, quantity: &Quantity) -> Vec<&'static Key> {
        quantity.keys.iter().filter(|key| self.value(key.name).is_some()).collect()
    }

    /// Whether a quantity is written, here or in the table that the section inherits from.
    #[must_use]
    pub fn is_given(&self, quantity: &Quantity) -> bool {
        !self.found(quantity).is_empty()
    }

    /// The key under which a quantity is written; the section's own before an inherited one.
    pub fn written(&self, quantity: &Quantity) -> Option<&'static Key> {
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
    pub fn given(&self, quantity: &Quantity) -> Option<(usize, Given<'a>)> {
        let key = self.written(quantity);
        let mut need = quantity.need;
        let mut reason = None;
        while let Need::If(other, name, then, otherwise) = need {
            let holds = self.written(other).is_some_and(|key| key.name == name);
            need = if holds { *then } else { *otherwise };
            reason = Some((name, holds));
        }
        match (key, need) {
            // The section's own keys override inherited ones.
            (Some(key), Need::Forbidden) => {
                if self.has_own(key.name) || !reason.is_some_and(|(other, _)| self.has_own(other)) {
                    self.forbid(key, reason);
                }
                None
            }
            (Some(key), _) => Some((quantity.keys.iter().position(|k| k.name == key.name)?, self.read(key)?)),
            (None, Need::Required) => {
                // If any of its keys is a number, the message asks for a number.
                let is_number = |key: &&Key| matches!(key.kind, Kind::Number(_));
                let first = quantity.keys.iter().find(is_number).unwrap_or(&quantity.keys[0]);
                let names: Vec<&'static str> = quantity.keys.iter().map(|key| key.name).collect();
                let list: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
                let what = match &list[..] {
                    [list @ .., last] if !list.is_empty() => format!("give {} or {last}", list.join(", ")),
                    _ => first.doc.into(),
                };
                self.missing.borrow_mut().push((names, self.absence(first.name, what)));
                None
            }
            (None, Need::Default(DefaultValue::Word(word))) => {
                let Kind::Word(words) = quantity.keys[0].kind else { return None };
                Some((0, Given::Word(words.iter().position(|w| *w == word)?)))
            }
            (None, Need::Default(value)) => Some((0, Given::Number(value.number()?))),
            (None, _) => None,
        }
    }

    /// Reports a key that is not allowed; `reason`: the other key, and whether that is written.
    fn forbid(&self, key: &'static Key, reason: Option<(&'static str, bool)>) {
        match reason {
            Some((other, true)) if key.kind == Kind::Table => self.source.report(Problem {
                title: format!("`{}` and `{}` are both given", self.full(key.name), self.full(other)),
                span: self.span_of(key.name),
                allowed: "one or the other".into(),
                help: Some(format!("leave out `{}` or `{other}`", key.name)),
            }),
            Some((other, true)) => {
                let help = Some(format!("leave out `{other}` or `{}`", key.name));
                self.reject(key.name, format!("`{other}` is given too, and says it"), help);
            }
            Some((other, false)) => self.reject(key.name, format!("goes with `{other}`, which is not given"), None),
            None => self.reject(key.name, "must be left out", None),
        }
    }

    fn read(&self, key: &'static Key) -> Option<Given<'a>> {
        match key.kind {
            Kind::Number(range) => {
                let number = self.number_in(key.name, range)?;
                self.warn_if_unusual(key, number.value);
                Some(Given::Number(number.value))
            }
            Kind::Numbers => self.numbers(key.name).map(Given::Numbers),
            Kind::Word(words) => self.choice(key.name, words).map(Given::Word),
            Kind::TextOrPlace if !self.is_text(key.name) => {
                let is_place = |v: f64| v >= 1.0 && v.fract() == 0.0 && v < 1e6;
                let place = self.number_if(key.name, is_place, "a place from 1 up, or a name in quotes");
                place.map(|number| Given::Number(number.value))
            }
            Kind::Text | Kind::TextOrPlace => self.text(key.name).map(Given::Text),
            Kind::Table => self.table(key.name, None).map(Given::Table),
        }
    }

    /// A declared quantity that is a number: the place of its key, and the value.
    pub fn one_of(&self, quantity: &Quantity) -> Option<(usize, f64)> {
        match self.given(quantity)? {
            (place, Given::Number(value)) => Some((place, value)),
            _ => None,
        }
    }

    /// A declared number.
    pub fn scalar(&self, quantity: &Quantity) -> Option<f64> {
        self.one_of(quantity).map(|(_, value)| value)
    }

    /// A declared word, by its place among the key's words.
    pub fn word(&self, quantity: &Quantity) -> Option<usize> {
        match self.given(quantity)? {
            (_, Given::Word(place)) => Some(place),
            _ => None,
        }
    }

    /// A declared text.
    pub fn text_of(&self, quantity: &Quantity) -> Option<Text> {
        match self.given(quantity)? {
            (_, Given::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// A declared table, which takes missing keys from `inherited`, as [`table`](Self::table) does.
    pub fn table_of(&self, quantity: &Quantity, inherited: Option<&'a DeTable<'a>>) -> Option<Section<'a>> {
        match self.given(quantity)? {
            (place, Given::Table(_)) => self.table(quantity.keys[place].name, inherited),
            _ => None,
        }
    }

    /// Which of `tables` the section is, by its kind. When the kind is unknown the other keys cannot be checked: do not
    /// [`finish`](Self::finish) it.
    pub fn variant(&self, tables: &[Table]) -> Option<usize> {
        let kinds: Vec<&'static str> = tables.iter().filter_map(|table| table.kind).collect();
        if self.value("kind").is_none() {
            let list: Vec<String> = kinds.iter().map(|kind| format!("kind = {kind:?}")).collect();
            self.source.report(self.absence("kind", format!("write {}", list.join(" or "))));
        }
        self.choice("kind", &kinds)
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
