//! What a judge looks at: tables of computed parts, and the published values.

use std::cell::RefCell;
use std::collections::BTreeSet;

use super::Number;
use crate::catalogue::Catalogue;
use crate::found::find;
use crate::published::{Origin, Published, PublishedValue};
use crate::results::{ResultError, Results};
use damprig::study::table::StudyTable;

/// A published value counts as reproduced within this share of it. The document prints two or three digits, and the error of its
/// scheme (its step is not stated) is not known.
pub const REPRODUCED: f64 = 0.05;

/// A change of the response counts from this share of it on, as for the hatching of maps.
pub const NOTABLE: f64 = 0.01;

/// What a judge looks at.
#[derive(Clone, Debug)]
pub struct Evidence<'a> {
    /// Items and parts.
    catalogue: &'a Catalogue,
    /// What was computed.
    pub results: &'a Results,
    /// What is printed.
    published: &'a Published,
    /// Parts that were asked for and have not been computed.
    not_computed: RefCell<BTreeSet<String>>,
}

/// A printed value beside the computed one.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Its label.
    pub label: String,
    /// As printed.
    pub printed: f64,
    /// As computed.
    pub computed: f64,
    /// The 5 and 95 % quantiles over the starts of the particle, where they were computed.
    pub band: Option<(f64, f64)>,
}

impl Pair {
    /// Whether the computed value reproduces the printed one.
    #[must_use]
    pub fn is_reproduced(&self) -> bool {
        let is_in_band = self.band.is_some_and(|(low, high)| (low..=high).contains(&self.printed));
        self.deviation().abs() <= REPRODUCED || is_in_band
    }

    /// Relative deviation of the computed value from the printed one.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        self.computed / self.printed - 1.0
    }
}

impl<'a> Evidence<'a> {
    /// What a judge looks at.
    #[must_use]
    pub fn new(catalogue: &'a Catalogue, results: &'a Results, published: &'a Published) -> Self {
        Self { catalogue, results, published, not_computed: RefCell::default() }
    }

    /// Parts that the judge asked for and that have not been computed, as item/part.
    #[must_use]
    pub fn not_computed(&self) -> Vec<String> {
        self.not_computed.borrow().iter().cloned().collect()
    }

    fn noted<T>(&self, result: Result<T, ResultError>) -> Result<T, ResultError> {
        if let Err(ResultError::Missing { item, part }) = &result {
            self.not_computed.borrow_mut().insert(format!("{item}/{part}"));
        }
        result
    }

    /// The table of a study.
    ///
    /// # Errors
    /// A part that has not been computed; a file that is damaged.
    pub fn study(&self, item: &str, part: &str) -> Result<Numbers, ResultError> {
        Ok(Numbers { table: self.noted(self.results.study(item, part))?, shown: format!("{item}/{part}") })
    }

    /// A printed value.
    ///
    /// # Errors
    /// A label that published.toml does not have, or has as a gap.
    pub fn printed(&self, item: &str, label: &str) -> Result<f64, ResultError> {
        let missing = || ResultError::Wrong(format!("published.toml has no value {label:?} of {item}"));
        self.published.value(item, label).ok_or_else(missing)
    }

    /// The values that the document computed for an item, beside those of a part, as far as it has their rows.
    ///
    /// # Errors
    /// No such item or part; a part that has not been computed; a gap in the published values; no row of any value.
    pub fn pairs(&self, item: &str, part: &str) -> Result<Vec<Pair>, ResultError> {
        let item = self.catalogue.find(item)?;
        let shown = format!("{}/{part}", item.name);
        let part = item.part(part).ok_or_else(|| ResultError::Wrong(format!("there is no part {shown}")))?;
        let mut pairs = Vec::new();
        for value in self.published.of(&item.name).filter(|value| value.origin == Origin::Computed) {
            let gap =
                || ResultError::Wrong(format!("published.toml has no value for {:?} of {}", value.label, item.name));
            let printed = value.value.ok_or_else(gap)?;
            let found = |value: &PublishedValue| find(self.catalogue, self.results, item, part, value);
            match found(value) {
                Ok(computed) => {
                    // A table over several starts has quantiles.
                    let quantile = |share: &str| {
                        let quantity = value.quantity.as_ref().map(|quantity| format!("{quantity}_{share}"));
                        found(&PublishedValue { quantity, ..value.clone() }).ok()
                    };
                    let band = quantile("q05").zip(quantile("q95"));
                    pairs.push(Pair { label: value.label.clone(), printed, computed, band });
                }
                Err(missing @ ResultError::Missing { .. }) => return self.noted(Err(missing)),
                Err(ResultError::Wrong(_)) => {}
            }
        }
        if pairs.is_empty() {
            return Err(ResultError::Wrong(format!("{shown}: it has no row for the values of published.toml")));
        }
        Ok(pairs)
    }
}

fn is_same(value: f64, wanted: f64) -> bool {
    (value - wanted).abs() <= 1e-9 * wanted.abs().max(1.0)
}

/// A computed table. What it lacks is an error that names it.
#[derive(Clone, Debug)]
pub struct Numbers {
    table: StudyTable,
    shown: String,
}

impl Numbers {
    /// A column of numbers: at least one, and all finite, so that no verdict follows from what is not there.
    ///
    /// # Errors
    /// The table has no such column, no row, or a row without a value in it.
    pub fn column(&self, name: &str) -> Result<Vec<f64>, ResultError> {
        let values = self.table.column(name).ok_or_else(|| self.lacks(name))?;
        match values.iter().position(|value| !value.is_finite()) {
            _ if values.is_empty() => Err(self.wrong("its table has no rows")),
            Some(row) => Err(self.wrong(&format!("{name} has no value in row {row} of its table"))),
            None => Ok(values),
        }
    }

    /// An error that names the table.
    #[must_use]
    pub fn wrong(&self, what: &str) -> ResultError {
        ResultError::Wrong(format!("{}: {what}", self.shown))
    }

    /// A column of words.
    ///
    /// # Errors
    /// The table has no such column.
    pub fn words(&self, name: &str) -> Result<Vec<String>, ResultError> {
        self.table.words(name).ok_or_else(|| self.lacks(name))
    }

    fn lacks(&self, name: &str) -> ResultError {
        self.wrong(&format!("its table has no column {name}"))
    }

    /// The rows in which every key has its value; at least one.
    ///
    /// # Errors
    /// The table has no such column, or no such row.
    pub fn rows(&self, keys: &[(&str, f64)]) -> Result<Vec<usize>, ResultError> {
        let mut rows: Vec<usize> = (0..self.table.rows()).collect();
        for &(key, value) in keys {
            let column = self.column(key)?;
            rows.retain(|&row| is_same(column[row], value));
        }
        if rows.is_empty() {
            return Err(self.wrong(&format!("it has no row with {keys:?}")));
        }
        Ok(rows)
    }

    /// The value of `column` in the first row in which every key has its value.
    ///
    /// # Errors
    /// As [`Numbers::rows`].
    pub fn at(&self, keys: &[(&str, f64)], column: &str) -> Result<f64, ResultError> {
        Ok(self.column(column)?[self.rows(keys)?[0]])
    }

    /// The different values of a column, rising.
    ///
    /// # Errors
    /// The table has no such column.
    pub fn values(&self, column: &str) -> Result<Vec<f64>, ResultError> {
        let mut values = self.column(column)?;
        values.sort_by(f64::total_cmp);
        values.dedup();
        Ok(values)
    }

    /// The row with the least value of a column.
    ///
    /// # Errors
    /// As [`Numbers::column`].
    pub fn least(&self, column: &str) -> Result<usize, ResultError> {
        let values = self.column(column)?;
        let least = (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b]));
        least.ok_or_else(|| self.lacks(column))
    }
}

/// Least and largest of some numbers.
#[must_use]
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// The value below which a share of some numbers lies; not a number if there are none.
#[must_use]
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(place).copied().unwrap_or(f64::NAN)
}

/// The middle one of some numbers; the lower of the two middle ones if their number is even.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN)
}

/// A number without a published one beside it.
pub(super) fn number(label: impl Into<String>, value: f64, unit: &'static str) -> Number {
    Number { label: label.into(), value, unit, published: None }
}

/// A number beside the published one.
pub(super) fn beside(label: impl Into<String>, value: f64, unit: &'static str, published: f64) -> Number {
    Number { label: label.into(), value, unit, published: Some(published) }
}

/// A value with three digits, for sentences.
pub(super) fn short(value: f64) -> String {
    if value.abs() < 1e-12 {
        return "0".into();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 12) as usize)
}

/// A share in per cent, for sentences.
pub(super) fn percent(share: f64) -> String {
    format!("{} %", short(100.0 * share))
}
