//! Finds where a value is written in a file, for problems that are found after it was read.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Source, Span};

/// A step of a path into a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathStep<'a> {
    /// A key of a table.
    Key(&'a str),
    /// A place in a list of tables, from 0.
    Item(usize),
}

impl Source {
    /// Place of the value at `path`; `None` if it is not written.
    #[must_use]
    pub fn locate(&self, path: &[PathStep<'_>]) -> Option<Span> {
        locate_in(self.text(), path)
    }
}

/// Place of the value at `path` in a text in TOML; `None` if it is not written.
#[must_use]
pub fn locate_in(text: &str, path: &[PathStep<'_>]) -> Option<Span> {
    let document = DeTable::parse(text).ok()?;
    let (PathStep::Key(first), rest) = path.split_first()? else { return None };
    let first: &Spanned<DeValue> = document.get_ref().get(*first)?;
    let found = rest.iter().try_fold(first, |value, step| match (step, value.get_ref()) {
        (PathStep::Key(key), DeValue::Table(table)) => table.get(*key),
        (PathStep::Item(place), DeValue::Array(list)) => list.get(*place),
        _ => None,
    })?;
    Some(found.span())
}

/// The path as messages write it: `set_up[2].particle.mass_kg`.
#[must_use]
pub fn path_text(path: &[PathStep<'_>]) -> String {
    let mut text = String::new();
    for step in path {
        match step {
            PathStep::Key(key) if text.is_empty() => text.push_str(key),
            PathStep::Key(key) => text.extend([".", key]),
            PathStep::Item(place) => text.push_str(&format!("[{}]", place + 1)),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::PathStep::{Item, Key};
    use super::*;

    #[test]
    fn a_value_is_found_in_tables_and_lists_of_tables() {
        let text = "a = 1\n[[set_up]]\nz = 2\n[[set_up]]\nparticle = { mass_kg = 3 }\n";
        let source = Source::new("t", text);
        let path = [Key("set_up"), Item(1), Key("particle"), Key("mass_kg")];
        assert_eq!(&text[source.locate(&path).unwrap()], "3");
        assert_eq!(path_text(&path), "set_up[2].particle.mass_kg");
        for absent in [&[Key("b")][..], &[Key("a"), Key("b")], &[Key("set_up"), Item(2)], &[]] {
            assert_eq!(source.locate(absent), None);
        }
    }
}
