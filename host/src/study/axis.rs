//! An axis of a study: a key of the case and its values.

use super::distribution::{self, Distribution, between};
use super::keys::axis as keys;
use crate::input::key::KeyUnit;
use crate::input::section::{Given, Number, Text};
use crate::input::{Section, Span};

/// The value of an axis at a point.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisValue {
    /// A number, in the key's unit.
    Number(f64),
    /// A word.
    Word(String),
}

impl AxisValue {
    /// As a TOML value.
    #[must_use]
    pub fn toml(&self) -> String {
        match self {
            Self::Number(number) => format!("{number:?}"),
            Self::Word(word) => toml::Value::from(word.as_str()).to_string(),
        }
    }
}

/// Where the values of an axis come from.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisValues {
    /// These numbers.
    Numbers(Vec<f64>),
    /// These words.
    Words(Vec<String>),
    /// Drawn from a distribution.
    Drawn(Distribution),
    /// Those of points from outside, between two ends.
    Given {
        /// Lower end.
        from: f64,
        /// Upper end.
        to: f64,
    },
}

/// How the points of an axis become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduction {
    /// The largest value; over frequencies also between the values.
    Maximum,
    /// The smallest value; over frequencies also between the values.
    Minimum,
    /// The mean.
    Mean,
    /// The largest of the values alone.
    GridMaximum,
    /// The largest value; over frequencies it is looked for as the answer of an optimisation is.
    ScanMaximum,
}

impl Reduction {
    const ALL: [Self; 5] = [Self::Maximum, Self::Minimum, Self::Mean, Self::GridMaximum, Self::ScanMaximum];

    /// Of some values, with the place of the largest or smallest; not a number if one of them is not.
    #[must_use]
    pub fn of(self, values: &[f64]) -> (f64, usize) {
        if let Some(place) = values.iter().position(|value| value.is_nan()) {
            return (f64::NAN, place);
        }
        let extreme = |is_better: fn(f64, f64) -> bool| {
            let mut best = 0;
            for place in 1..values.len() {
                if is_better(values[place], values[best]) {
                    best = place;
                }
            }
            (values.get(best).copied().unwrap_or(f64::NAN), best)
        };
        match self {
            Self::Maximum | Self::GridMaximum | Self::ScanMaximum => extreme(|new, old| new > old),
            Self::Minimum => extreme(|new, old| new < old),
            Self::Mean => (values.iter().sum::<f64>() / values.len() as f64, 0),
        }
    }

    /// What it gives, in a word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Maximum | Self::GridMaximum | Self::ScanMaximum => "maximum",
            Self::Minimum => "minimum",
            Self::Mean => "mean",
        }
    }
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyAxis {
    /// The key with its tables: `particle.clearance_ratio`.
    pub key: String,
    /// Its values.
    pub values: AxisValues,
    /// Whether the values are spaced evenly in the logarithm.
    pub is_log: bool,
    /// How its points become one, if they do.
    pub reduce: Option<Reduction>,
    /// Where the file has its key.
    pub span: Span,
    /// Where the file has its values: each of a list, or both ends of a range.
    pub value_spans: Vec<Span>,
}

impl StudyAxis {
    /// Number of its values; 1 for a scattered axis.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.values {
            AxisValues::Numbers(numbers) => numbers.len(),
            AxisValues::Words(words) => words.len(),
            AxisValues::Drawn(_) | AxisValues::Given { .. } => 1,
        }
    }

    /// Whether its values are drawn or from outside, one for each point, and no grid.
    #[must_use]
    pub fn is_scattered(&self) -> bool {
        matches!(self.values, AxisValues::Drawn(_) | AxisValues::Given { .. })
    }

    /// Adds a number in its place; does nothing where there is one or the values are no list of numbers.
    pub fn insert(&mut self, number: f64) {
        if let AxisValues::Numbers(numbers) = &mut self.values
            && !numbers.contains(&number)
        {
            numbers.insert(numbers.partition_point(|own| *own < number), number);
        }
    }

    /// Whether it is a band of drive frequencies whose extreme is looked for between its values too.
    #[must_use]
    pub fn is_refined(&self) -> bool {
        let is_drive = self.key.starts_with("base.") || self.key.starts_with("force.");
        let is_frequency =
            matches!(self.short_key(), "frequency_hz" | "frequency_ratio" | "angular_frequency_rad_per_s");
        let is_grid = matches!(&self.values, AxisValues::Numbers(numbers) if numbers.len() > 1);
        is_drive
            && is_frequency
            && is_grid
            && matches!(self.reduce, Some(Reduction::Maximum | Reduction::Minimum | Reduction::ScanMaximum))
    }

    /// Its value at a place of a grid, or at a share of a range, 0 to 1.
    #[must_use]
    pub fn value(&self, place: usize, share: f64) -> AxisValue {
        match &self.values {
            AxisValues::Numbers(numbers) => AxisValue::Number(numbers[place]),
            AxisValues::Words(words) => AxisValue::Word(words[place].clone()),
            AxisValues::Drawn(distribution) => AxisValue::Number(distribution.quantile(share)),
            AxisValues::Given { from, to } => AxisValue::Number(between(*from, *to, false, share)),
        }
    }

    /// Where the file has a value; `None` for one between the ends of a range.
    pub(super) fn span_of(&self, value: &AxisValue) -> Option<Span> {
        let own = self.checked_values();
        let place = own.iter().position(|own| own == value)?;
        let of_list = self.value_spans.get(place).filter(|_| self.value_spans.len() == own.len());
        let end = if place == 0 { self.value_spans.first() } else { self.value_spans.last() };
        of_list.or(end.filter(|_| place == 0 || place + 1 == own.len())).cloned()
    }

    /// The key's last part, which ends with its unit.
    #[must_use]
    pub fn short_key(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or(&self.key)
    }

    /// Symbol of its unit; empty for a plain number or a word.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        KeyUnit::of(self.short_key()).map_or("", |unit| unit.symbol)
    }

    /// The values with which the case is checked before the study: all of a list, both ends of a scattered one.
    #[must_use]
    pub fn checked_values(&self) -> Vec<AxisValue> {
        match &self.values {
            AxisValues::Drawn(Distribution { from, to, .. }) | AxisValues::Given { from, to } => {
                vec![AxisValue::Number(*from), AxisValue::Number(*to)]
            }
            _ => (0..self.count()).map(|place| self.value(place, 0.0)).collect(),
        }
    }
}

/// The keys of an axis that is drawn from a distribution.
const DISTRIBUTION: distribution::DistributionKeys = distribution::DistributionKeys {
    distribution: &keys::DISTRIBUTION,
    mean: &keys::MEAN,
    standard_deviation: &keys::STANDARD_DEVIATION,
    ends: [&keys::FROM, &keys::TO],
    scale: &keys::SCALE,
};

/// Reads an `[[axis]]`. `has_sampling`: a range without a `count` is drawn from; `missing_count` says what to do about one that is not.
pub(crate) fn read(s: &Section, has_sampling: bool, missing_count: &str) -> Option<StudyAxis> {
    let key = s.text_of(&keys::KEY);
    let ends = [s.placed(&keys::FROM), s.placed(&keys::TO)];
    let count = s.scalar(&keys::COUNT);
    let is_log = s.word(&keys::SCALE) == Some(1);
    let numbers = s.is_given(&keys::VALUES).then(|| s.given(&keys::VALUES));
    let reduce = s.word(&keys::REDUCE).map(|place| Reduction::ALL[place]);
    let distribution = distribution::read(s, &DISTRIBUTION, &ends);
    s.finish();
    let key = checked_key(s, key?)?;
    if let Some((distribution, value_spans)) = distribution? {
        if !has_sampling || numbers.is_some() || s.is_given(&keys::COUNT) || reduce.is_some() {
            let allowed = "is for an axis whose values are drawn: one of a study with [sampling], without `count`, `values`, `words` and `reduce`";
            s.reject(keys::DISTRIBUTION.name(), allowed, None);
            return None;
        }
        let (values, is_log) = (AxisValues::Drawn(distribution), distribution.is_log());
        return Some(StudyAxis { key: key.value, values, is_log, reduce, span: key.span, value_spans });
    }
    let is_range = s.is_given(&keys::FROM) || s.is_given(&keys::TO) || s.is_given(&keys::COUNT);
    let mut value_spans = Vec::new();
    let values = match numbers {
        Some(_) if is_range => {
            s.reject(
                keys::VALUES.name(),
                "does not go with `from`, `to` and `count`",
                Some("leave out the range, or the list".into()),
            );
            return None;
        }
        Some(given) => read_list(s, given?.1, &mut value_spans)?,
        None => {
            let [from, to] = match ends {
                [Some(from), Some(to)] => [from, to],
                _ if !is_range => {
                    s.reject(
                        keys::KEY.name(),
                        "has no values",
                        Some("give `from`, `to` and `count`, or `values`".into()),
                    );
                    return None;
                }
                _ => {
                    if !s.is_given(&keys::FROM) || !s.is_given(&keys::TO) {
                        s.reject(keys::KEY.name(), "has half a range", Some("give both `from` and `to`".into()));
                    }
                    return None;
                }
            };
            value_spans = vec![from.span.clone(), to.span.clone()];
            let (from, to) = checked_range(s, &from, &to, is_log, "give one value as values = […]")?;
            match count {
                Some(count) => {
                    let last = count - 1.0;
                    AxisValues::Numbers(
                        (0..count as usize).map(|n| between(from, to, is_log, n as f64 / last)).collect(),
                    )
                }
                None if s.is_given(&keys::COUNT) => return None,
                None if has_sampling && reduce.is_none() => AxisValues::Drawn(Distribution::uniform(from, to, is_log)),
                None => {
                    s.reject(keys::KEY.name(), "has a range without a number of values", Some(missing_count.into()));
                    return None;
                }
            }
        }
    };
    Some(StudyAxis { key: key.value, values, is_log, reduce, span: key.span, value_spans })
}

/// Whether a text can be a key with its tables: `particle.clearance_ratio`.
pub(super) fn is_key(text: &str) -> bool {
    let is_part = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    text.split('.').all(is_part)
}

/// A key of a case with its tables.
pub(crate) fn checked_key(s: &Section, key: Text) -> Option<Text> {
    if is_key(&key.value) {
        return Some(key);
    }
    let help = "for example key = \"particle.clearance_ratio\"".to_string();
    let allowed = "must be a key of the case with its tables, separated by points";
    s.refuse(keys::KEY.name(), &key.span, allowed, Some(help));
    None
}

/// Both ends of a range, if they are its ends; `if_equal` says what to do about a single value.
pub(crate) fn checked_range(
    s: &Section,
    from: &Number,
    to: &Number,
    is_log: bool,
    if_equal: &str,
) -> Option<(f64, f64)> {
    if to.value <= from.value {
        let help = if to.value == from.value { if_equal } else { "exchange them" };
        s.refuse("to", &to.span, format!("must be greater than `from` = {}", from.value), Some(help.into()));
        return None;
    }
    if is_log && from.value <= 0.0 {
        s.refuse("from", &from.span, "must be greater than 0 with scale = \"log\"", None);
        return None;
    }
    Some((from.value, to.value))
}

fn read_list(s: &Section, given: Given, spans: &mut Vec<Span>) -> Option<AxisValues> {
    let values = match given {
        Given::Numbers(numbers) => {
            spans.extend(numbers.iter().map(|number| number.span.clone()));
            AxisValues::Numbers(numbers.into_iter().map(|number| number.value).collect())
        }
        Given::Texts(words) => {
            spans.extend(words.iter().map(|word| word.span.clone()));
            AxisValues::Words(words.into_iter().map(|word| word.value).collect())
        }
        _ => return None,
    };
    let is_empty = match &values {
        AxisValues::Numbers(numbers) => numbers.is_empty(),
        AxisValues::Words(words) => words.is_empty(),
        AxisValues::Drawn(_) | AxisValues::Given { .. } => false,
    };
    if is_empty {
        let key = s.written(&keys::VALUES).map_or("values", |key| key.name);
        s.reject(key, "must have at least one value", None);
        return None;
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduction_gives_the_value_and_its_place_and_a_missing_value_stays_missing() {
        assert_eq!(Reduction::Maximum.of(&[1.0, 3.0, 2.0]), (3.0, 1));
        assert_eq!(Reduction::Minimum.of(&[2.0, 3.0, 1.0]), (1.0, 2));
        assert_eq!(Reduction::Mean.of(&[2.0, 4.0]).0, 3.0);
        assert!(Reduction::Maximum.of(&[1.0, f64::NAN]).0.is_nan());
    }
}
