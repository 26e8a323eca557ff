//! Warns of values outside the usual range of their key ([`Key::usual`]). The values are used as they are.

use super::{Number, Section};
use crate::input::key::{Key, KeyedQuantity};
use crate::input::{Problem, Span};

impl Section<'_> {
    /// Warns if a number that is written here is outside the usual range of its key.
    pub(super) fn warn_if_unusual(&self, key: &'static Key, number: &Number) {
        if key.is_unusual(number.value) {
            let title = format!("`{}` = {} is unusual", self.full(key.name), shown_number(number.value));
            self.warn(&number.span, title, key);
        }
    }

    /// Warns if a quantity that is written under another key amounts to an unusual value of its key `name`.
    pub fn warn_if_it_means(&self, quantity: &KeyedQuantity, name: &str, value: f64) {
        let (Some(written), Some(key)) = (self.written(quantity), quantity.key(name)) else { return };
        if written.name != name && key.is_unusual(value) {
            let title = format!("`{}` means an unusual {name} = {}", self.full(written.name), shown_number(value));
            self.warn(&self.span_of(written.name), title, key);
        }
    }

    fn warn(&self, span: &Span, title: String, key: &Key) {
        let Some((least, most)) = key.usual else { return };
        let symbol = key.unit().map_or("", |unit| unit.symbol);
        let space = if symbol.is_empty() { "" } else { " " };
        self.source.warn(Problem {
            title,
            span: span.clone(),
            allowed: format!("usually from {least} to {most}{space}{symbol}: {}", key.doc),
            help: Some("the value is used as it is".into()),
        });
    }
}

/// A number with at most six significant digits.
fn shown_number(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
