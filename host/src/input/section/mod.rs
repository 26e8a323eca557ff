//! One TOML table, read key by key: keys that nothing reads are reported as unknown.
//!
//! Keys are declared ([`super::key`]): `quantities` reads them, `unusual` warns of unusual values, this module has the values by
//! name and the messages. A section may inherit: a key that it does not have is looked up in the table of the same name at the top
//! of the file. Every problem is reported to the [`Source`]; parsers continue with `None`, and the caller gets all problems at the
//! end.

mod free;
mod quantities;
mod unusual;

use std::cell::RefCell;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

pub use free::{FreeKey, FreeValue};
pub use quantities::Given;

use super::key::{Key, Range, number};
use super::{Problem, Source, Span, suggest};

/// Most characters of a value in a message.
const LONGEST: usize = 200;

/// A number and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// The value.
    pub value: f64,
    /// Where it was written.
    pub span: Span,
}

/// A text and its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// The value.
    pub value: String,
    /// Where it was written.
    pub span: Span,
}

/// A table of the file, with its name in messages.
#[derive(Debug)]
pub struct Section<'a> {
    source: &'a Source,
    path: String,
    span: Span,
    own: &'a DeTable<'a>,
    inherited: Option<(&'static str, &'a DeTable<'a>)>,
    known: RefCell<Vec<&'static str>>,
    missing: RefCell<Vec<(Vec<&'static str>, Problem)>>,
}

impl<'a> Section<'a> {
    /// The whole file.
    #[must_use]
    pub fn root(source: &'a Source, document: &'a Spanned<DeTable<'a>>) -> Self {
        Self::new(source, String::new(), document.span(), document.get_ref(), None)
    }

    fn new(
        source: &'a Source,
        path: String,
        span: Span,
        own: &'a DeTable<'a>,
        inherited: Option<(&'static str, &'a DeTable<'a>)>,
    ) -> Self {
        Self { source, path, span, own, inherited, known: RefCell::default(), missing: RefCell::default() }
    }

    /// The full name of a key of this section in messages (`set_up[2].particle.mass_kg`).
    #[must_use]
    pub fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) }
    }

    /// Place of the section.
    #[must_use]
    pub fn span(&self) -> Span {
        self.span.clone()
    }

    /// The file.
    #[must_use]
    pub fn source(&self) -> &'a Source {
        self.source
    }

    fn value(&self, key: &'static str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.known.borrow_mut().push(key);
        self.own.get(key).or_else(|| self.inherited?.1.get(key))
    }

    /// Whether the section itself, not what it inherits, has the key.
    #[must_use]
    pub fn has_own(&self, key: &str) -> bool {
        self.own.contains_key(key)
    }

    /// Reports that the value of `key`, written at `span`, is not allowed.
    pub fn refuse(&self, key: &str, span: &Span, allowed: impl Into<String>, help: Option<String>) {
        let value = self.source.written(span).and_then(|t| t.lines().next()).unwrap_or_default();
        // An inherited value is reported once, under the name of its own table.
        let name = match self.inherited {
            Some((table, keys)) if !self.own.contains_key(key) && keys.contains_key(key) => format!("{table}.{key}"),
            _ => self.full(key),
        };
        self.source.report(Problem {
            title: format!("`{name}` = {} is not allowed", beginning(value)),
            span: span.clone(),
            allowed: allowed.into(),
            help,
        });
    }

    /// As [`Section::refuse`], for the value of `key` in the section or the table that it inherits from.
    pub fn reject(&self, key: &'static str, allowed: impl Into<String>, help: Option<String>) {
        self.refuse(key, &self.span_of(key), allowed, help);
    }

    /// Place of the value of `key`; the section's place if it has none.
    pub fn span_of(&self, key: &'static str) -> Span {
        self.value(key).map_or(self.span(), Spanned::span)
    }

    fn absence(&self, key: &str, what: impl Into<String>) -> Problem {
        let title = format!("`{}` is missing", self.full(key));
        Problem { title, span: self.span(), allowed: what.into(), help: None }
    }

    /// A finite number within its unit's bounds, if the key is there: for a key that is not declared.
    pub fn number(&self, name: &'static str) -> Option<Number> {
        self.number_in(&number(name, Range::Any, ""))
    }

    fn number_in(&self, key: &Key) -> Option<Number> {
        let value = self.value(key.name)?;
        let span = value.span();
        let number = finite(value);
        let refusal = match number {
            None => Some("must be a finite number".to_string()),
            Some(value) => key.refusal(value),
        };
        if let Some(allowed) = refusal {
            self.refuse(key.name, &span, allowed, None);
            return None;
        }
        number.map(|value| Number { value, span })
    }

    /// A text, if the key is there.
    fn text(&self, key: &'static str) -> Option<Text> {
        let value = self.value(key)?;
        match value.get_ref() {
            DeValue::String(s) => Some(Text { value: s.to_string(), span: value.span() }),
            other => {
                let help = Some(format!("this is a TOML {}; put a text in quotes", other.type_str()));
                self.refuse(key, &value.span(), "must be a text", help);
                None
            }
        }
    }

    /// One of a list of words, if the key is there: its index.
    fn choice(&self, key: &'static str, words: &[&'static str]) -> Option<usize> {
        let text = self.text(key)?;
        let index = words.iter().position(|w| *w == text.value);
        if index.is_none() {
            let list: Vec<String> = words.iter().map(|w| format!("{w:?}")).collect();
            let help =
                suggest::near(&text.value, words.iter().copied()).first().map(|w| format!("did you mean {w:?}?"));
            self.refuse(key, &text.span, format!("must be {}", list.join(" or ")), help);
        }
        index
    }

    /// A list of texts, if the key is there.
    fn texts(&self, key: &'static str) -> Option<Vec<Text>> {
        let list = self.list(key)?;
        let mut texts = Vec::new();
        for item in list {
            match item.get_ref() {
                DeValue::String(s) => texts.push(Text { value: s.to_string(), span: item.span() }),
                _ => {
                    self.refuse(key, &item.span(), "must be a text in quotes", None);
                    return None;
                }
            }
        }
        Some(texts)
    }

    /// A list of finite numbers within the key's range, if the key is there and is a list.
    fn numbers(&self, key: &Key) -> Option<Vec<Number>> {
        let mut numbers = Vec::new();
        let mut is_valid = true;
        for item in self.list(key.name)? {
            let Some(value) = finite(item) else {
                self.refuse(key.name, &item.span(), "must be a finite number", None);
                return None;
            };
            if let Some(allowed) = key.refusal(value) {
                self.refuse(key.name, &item.span(), allowed, None);
                is_valid = false;
            }
            numbers.push(Number { value, span: item.span() });
        }
        is_valid.then_some(numbers)
    }

    fn list(&self, key: &'static str) -> Option<&'a [Spanned<DeValue<'a>>]> {
        let value = self.value(key)?;
        match value.get_ref() {
            DeValue::Array(list) => Some(list),
            _ => {
                self.refuse(key, &value.span(), "must be a list in square brackets", None);
                None
            }
        }
    }

    /// Whether the value of `key` is a text.
    fn is_text(&self, key: &'static str) -> bool {
        self.value(key).is_some_and(|v| v.get_ref().is_str())
    }

    /// Whether the value of `key` is a table.
    fn is_table(&self, key: &'static str) -> bool {
        self.value(key).is_some_and(|v| v.get_ref().is_table())
    }

    /// Whether the value of `key` is a list.
    fn is_list(&self, key: &'static str) -> bool {
        self.value(key).is_some_and(|v| v.get_ref().is_array())
    }

    /// A table inside this one that takes missing keys from `inherited`, the table of that name at the top of the file. None
    /// without a table of its own.
    fn table(&self, key: &'static str, inherited: Option<&'a DeTable<'a>>) -> Option<Section<'a>> {
        let value = self.value(key)?;
        let Some(own) = value.get_ref().as_table() else {
            let help = Some(format!("write `[{}]` or `{key} = {{ … }}`", self.full(key)));
            let allowed =
                if value.get_ref().is_array() { "must be one table, no list of them" } else { "must be a table" };
            self.refuse(key, &value.span(), allowed, help);
            return None;
        };
        Some(Section::new(self.source, self.full(key), value.span(), own, inherited.map(|t| (key, t))))
    }

    /// The table at the top of the file, read in place of one of this section's own.
    pub fn inherited_table(&self, key: &'static str, inherited: Option<&'a DeTable<'a>>) -> Option<Section<'a>> {
        Some(Section::new(self.source, key.to_string(), self.span(), inherited?, None))
    }

    /// The table itself, to be inherited from; its key is known, its content is not read yet.
    pub fn raw_table(&self, key: &'static str) -> Option<&'a DeTable<'a>> {
        self.table(key, None).map(|s| s.own)
    }

    /// The tables of a list of tables (`[[set_up]]`), named `key[1]`, `key[2]` …
    fn tables(&self, key: &'static str) -> Vec<Section<'a>> {
        let Some(value) = self.value(key) else { return Vec::new() };
        let items = value.get_ref().as_array().filter(|list| list.iter().all(|item| item.get_ref().is_table()));
        let Some(items) = items else {
            self.refuse(key, &value.span(), format!("must be a list of tables, each headed `[[{key}]]`"), None);
            return Vec::new();
        };
        let section = |(i, item): (usize, &'a Spanned<DeValue<'a>>)| {
            let own = item.get_ref().as_table()?;
            let path = format!("{}[{}]", self.full(key), i + 1);
            Some(Section::new(self.source, path, item.span(), own, None))
        };
        items.iter().enumerate().filter_map(section).collect()
    }

    /// Ends the reading: reports unknown and missing keys.
    pub fn finish(&self) {
        let mut names: Vec<&str> = self.known.borrow().clone();
        names.sort_unstable();
        names.dedup();
        let mut answered = Vec::new();
        let tables = [Some((self.path.as_str(), self.own)), self.inherited];
        for (path, table) in tables.into_iter().flatten() {
            let absent: Vec<&str> = names.iter().copied().filter(|k| !table.contains_key(*k)).collect();
            for (key, value) in table.iter().filter(|(k, _)| !names.contains(&k.get_ref().as_ref())) {
                let help = suggest::replacement(key.get_ref(), finite(value), &absent).map(|(right, help)| {
                    answered.push(right);
                    help
                });
                let dot = if path.is_empty() { "" } else { "." };
                self.source.report(Problem {
                    title: format!("unknown key `{path}{dot}{}`", key.get_ref()),
                    span: key.span(),
                    allowed: format!("allowed here: {}", names.join(", ")),
                    help,
                });
            }
        }
        // A misspelt key is reported once.
        for (keys, problem) in self.missing.take() {
            if !answered.iter().any(|a| keys.contains(&a.as_str())) {
                self.source.report(problem);
            }
        }
    }
}

fn finite(value: &Spanned<DeValue>) -> Option<f64> {
    let number = match value.get_ref() {
        DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse().ok(),
        DeValue::Float(f) => f.as_str().parse().ok(),
        _ => None,
    };
    number.filter(|value| f64::is_finite(*value))
}

/// A value as a message shows it: of a long list its beginning.
fn beginning(value: &str) -> std::borrow::Cow<'_, str> {
    match value.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{} …", &value[..end]).into(),
        None => value.into(),
    }
}
