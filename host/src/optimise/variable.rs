//! What a variable can be made as and how far off it may be then, and what is not known: `[[variable]]` and `[[uncertain]]`.

use super::keys::{uncertain, variable};
use crate::input::Section;
use crate::input::key::KeyedQuantity;
use crate::input::section::Number;
use crate::study::axis::{self, AxisValues, StudyAxis};
use crate::study::distribution::{self, Distribution};

/// Tolerance of a variable as a share of its value (of its range where it is 0), unless the file states one.
pub const TOLERANCE: f64 = 1e-3;

/// Most values that a variable can have in steps.
const MAX_STEPS: f64 = 1e6;

/// The values that can be made.
#[derive(Clone, Debug, PartialEq)]
pub enum ValueChoice {
    /// All, to the digits that the tolerance leaves.
    Digits,
    /// The least one and whole steps from it.
    Steps(f64),
    /// These, rising.
    Listed(Vec<f64>),
}

/// How far from the nominal value the made one may be, to either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// In the key's unit.
    Absolute(f64),
    /// As a share of the nominal value.
    Relative(f64),
}

/// A variable: its axis is one of the optimisation's.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Least and largest value.
    pub range: (f64, f64),
    /// What can be made.
    pub choice: ValueChoice,
    /// What the file states; the objective counts within it.
    pub stated: Option<Tolerance>,
}

/// What is not known: its axis is one of the optimisation's.
#[derive(Clone, Debug, PartialEq)]
pub struct UncertainVariable {
    /// Its values, rising, all as likely; `None` for a range or a distribution.
    pub values: Option<Vec<f64>>,
}

impl Variable {
    /// How far from this value the made one may be, to either side, in the key's unit.
    #[must_use]
    pub fn tolerance(&self, value: f64) -> f64 {
        let (from, to) = self.range;
        match self.stated {
            Some(Tolerance::Absolute(tolerance)) => tolerance,
            Some(Tolerance::Relative(share)) => share * value.abs(),
            None => TOLERANCE * if value == 0.0 { to - from } else { value.abs() },
        }
    }

    /// The value nearest to this one that can be made: of digits, rounded to the power of ten at or below the tolerance, or the end of
    /// the range that rounding crosses.
    #[must_use]
    pub fn made(&self, value: f64) -> f64 {
        let (from, to) = self.range;
        match &self.choice {
            ValueChoice::Digits => {
                let tolerance = self.tolerance(value);
                if tolerance > 0.0 { in_steps(0.0, power_of_ten(tolerance), value).clamp(from, to) } else { value }
            }
            ValueChoice::Steps(step) => {
                let most = ((to - from) / step + 1e-9).floor();
                in_steps(from, *step, value.clamp(from, from + most * step))
            }
            ValueChoice::Listed(values) => {
                let nearest = values.iter().copied().min_by(|a, b| (a - value).abs().total_cmp(&(b - value).abs()));
                nearest.unwrap_or(value)
            }
        }
    }

    /// How many steps between values that can be made are in a tolerance that is stated in the key's unit, if it has a whole number of them.
    #[must_use]
    pub fn steps_in_tolerance(&self) -> Option<usize> {
        let Some(Tolerance::Absolute(tolerance)) = self.stated else { return None };
        let step = match self.choice {
            ValueChoice::Steps(step) => step,
            ValueChoice::Digits => power_of_ten(tolerance),
            ValueChoice::Listed(_) => return None,
        };
        let steps = (tolerance / step).round();
        ((tolerance / step - steps).abs() < 1e-9 && steps >= 1.0).then_some(steps as usize)
    }

    /// All values that can be made, rising, if there are at most so many: of digits only where a tolerance is stated in the key's unit.
    #[must_use]
    pub fn all(&self, most: usize) -> Option<Vec<f64>> {
        let (from, to) = self.range;
        let step = match (&self.choice, self.stated) {
            (ValueChoice::Listed(values), _) => return Some(values.clone()).filter(|values| values.len() <= most),
            (ValueChoice::Steps(step), _) => *step,
            (ValueChoice::Digits, Some(Tolerance::Absolute(tolerance))) => power_of_ten(tolerance),
            (ValueChoice::Digits, _) => return None,
        };
        let count = (to - from) / step;
        if count >= most as f64 {
            return None;
        }
        let mut values: Vec<f64> = (0..=count.ceil() as usize).map(|n| self.made(from + n as f64 * step)).collect();
        values.dedup();
        Some(values)
    }
}

/// The power of ten at or below a number.
fn power_of_ten(number: f64) -> f64 {
    libm::pow(10.0, libm::floor(libm::log10(number) + 1e-12))
}

/// The nearest value a whole number of steps from the first. Read from its digits, so that a printed value is the evaluated one.
fn in_steps(first: f64, step: f64, value: f64) -> f64 {
    let value = first + ((value - first) / step).round() * step;
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// A variable and its axis.
pub(super) fn read(s: &Section) -> Option<(StudyAxis, Variable)> {
    let key = s.text_of(&variable::KEY);
    let step = s.is_given(&variable::STEP).then(|| s.scalar(&variable::STEP));
    let tolerance = s.is_given(&variable::TOLERANCE).then(|| s.one_of(&variable::TOLERANCE));
    let if_equal = "leave the variable out, and state it in the case";
    let ends = [s.placed(&variable::FROM), s.placed(&variable::TO)];
    let range = read_range(s, [&variable::FROM, &variable::TO, &variable::SCALE, &variable::VALUES], ends, if_equal);
    s.finish();
    let key = axis::checked_key(s, key?)?;
    let range = range?;
    let tolerance = match tolerance {
        Some(tolerance) => Some(tolerance?),
        None => None,
    };
    let stated = tolerance.map(|(place, value)| [Tolerance::Absolute, Tolerance::Relative][place](value));
    let width = range.to - range.from;
    if matches!(stated, Some(Tolerance::Absolute(tolerance)) if tolerance >= width) {
        let help = "it is in the unit of the key; relative_tolerance = 0.01 is one of 1 %";
        s.reject(variable::TOLERANCE.name(), format!("must be below the range, {width}"), Some(help.into()));
        return None;
    }
    let choice = match (step, range.values.clone()) {
        (Some(_), Some(_)) => {
            s.reject(variable::STEP.name(), "does not go with `values`", Some("leave one of them out".into()));
            return None;
        }
        (Some(step), None) => {
            let step = step?;
            if step >= width || width / step > MAX_STEPS {
                let allowed = format!("must be below the range, {width}, and at least a millionth of it");
                s.reject(variable::STEP.name(), allowed, Some("it is in the unit of the key".into()));
                return None;
            }
            ValueChoice::Steps(step)
        }
        (None, Some(values)) => ValueChoice::Listed(values),
        (None, None) => ValueChoice::Digits,
    };
    let variable = Variable { range: (range.from, range.to), choice, stated };
    Some((range.axis(key.value, key.span), variable))
}

/// The keys of a distribution of what is not known.
const DISTRIBUTION: distribution::DistributionKeys = distribution::DistributionKeys {
    distribution: &uncertain::DISTRIBUTION,
    mean: &uncertain::MEAN,
    standard_deviation: &uncertain::STANDARD_DEVIATION,
    ends: [&uncertain::FROM, &uncertain::TO],
    scale: &uncertain::SCALE,
};

/// What is not known and its axis.
pub(super) fn read_uncertain(s: &Section) -> Option<(StudyAxis, UncertainVariable)> {
    let key = s.text_of(&uncertain::KEY);
    let if_equal = "leave the table out, and state it in the case";
    let ends = [s.placed(&uncertain::FROM), s.placed(&uncertain::TO)];
    let distribution = distribution::read(s, &DISTRIBUTION, &ends);
    // A distribution is read above; what is wrong with it has its message.
    let is_range = matches!(distribution, Some(None));
    let keys = [&uncertain::FROM, &uncertain::TO, &uncertain::SCALE, &uncertain::VALUES];
    let range = is_range.then(|| read_range(s, keys, ends, if_equal));
    let has_values = s.is_given(&uncertain::VALUES);
    s.finish();
    let key = axis::checked_key(s, key?)?;
    if let Some((distribution, value_spans)) = distribution? {
        if has_values {
            let help = "leave one of them out";
            s.reject(uncertain::VALUES.name(), "does not go with a distribution", Some(help.into()));
            return None;
        }
        let (values, is_log) = (AxisValues::Drawn(distribution), distribution.is_log());
        let axis = StudyAxis { key: key.value, values, is_log, reduce: None, span: key.span, value_spans };
        return Some((axis, UncertainVariable { values: None }));
    }
    let range = range??;
    let values = range.values.clone();
    Some((range.axis(key.value, key.span), UncertainVariable { values }))
}

/// A range, or a list of values with its ends.
struct VariableRange {
    from: f64,
    to: f64,
    is_log: bool,
    values: Option<Vec<f64>>,
    spans: Vec<crate::input::Span>,
}

impl VariableRange {
    fn axis(self, key: String, span: crate::input::Span) -> StudyAxis {
        let values = AxisValues::Drawn(Distribution::uniform(self.from, self.to, self.is_log));
        StudyAxis { key, values, is_log: self.is_log, reduce: None, span, value_spans: self.spans }
    }
}

/// Reads `scale` of a range with these ends, or `values`.
fn read_range(
    s: &Section,
    [from, to, scale, values]: [&KeyedQuantity; 4],
    ends: [Option<Number>; 2],
    if_equal: &str,
) -> Option<VariableRange> {
    let is_log = s.word(scale) == Some(1);
    let has_range = s.is_given(from) || s.is_given(to);
    if s.is_given(values) {
        let mut numbers = s.numbers_of(values)?;
        if has_range {
            s.reject(
                values.name(),
                "does not go with `from` and `to`",
                Some("leave the range out, or the list".into()),
            );
            return None;
        }
        numbers.sort_by(|a, b| a.value.total_cmp(&b.value));
        numbers.dedup_by(|a, b| a.value == b.value);
        let [first, .., last] = &numbers[..] else {
            s.reject(values.name(), "must have two different values", Some(if_equal.into()));
            return None;
        };
        let (from, to, spans) = (first.value, last.value, vec![first.span.clone(), last.span.clone()]);
        let values = Some(numbers.iter().map(|number| number.value).collect());
        return Some(VariableRange { from, to, is_log: false, values, spans });
    }
    let [Some(from), Some(to)] = ends else {
        let help = "give both `from` and `to`, or the values that there are as values = […]";
        let is_half = s.is_given(from) || s.is_given(to);
        // A number that is refused has its message.
        if !(s.is_given(from) && s.is_given(to)) {
            s.reject("key", if is_half { "has half a range" } else { "has no range" }, Some(help.into()));
        }
        return None;
    };
    let (first, last) = axis::checked_range(s, &from, &to, is_log, if_equal)?;
    Some(VariableRange { from: first, to: last, is_log, values: None, spans: vec![from.span, to.span] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variable(choice: ValueChoice, stated: Option<Tolerance>) -> Variable {
        Variable { range: (5e-5, 4.05e-4), choice, stated }
    }

    #[test]
    fn what_is_made_is_a_step_a_listed_value_or_has_the_digits_that_the_tolerance_leaves() {
        let steps = variable(ValueChoice::Steps(1e-5), None);
        assert_eq!([1.37e-4, 0.0, 1.0].map(|value| steps.made(value)), [1.4e-4, 5e-5, 4e-4]);
        let listed = variable(ValueChoice::Listed(vec![1e-4, 1.5e-4, 4e-4]), None);
        assert_eq!([0.0, 1.3e-4, 1.0].map(|value| listed.made(value)), [1e-4, 1.5e-4, 4e-4]);
        let digits = variable(ValueChoice::Digits, Some(Tolerance::Absolute(3e-5)));
        assert_eq!([1.37e-4, 0.0, 1.0].map(|value| digits.made(value)), [1.4e-4, 5e-5, 4.05e-4]);
        assert_eq!(variable(ValueChoice::Digits, None).made(1.23456e-4), 1.235e-4);
        assert_eq!(variable(ValueChoice::Digits, Some(Tolerance::Relative(0.1))).made(1.23456e-4), 1.2e-4);
    }

    #[test]
    fn all_values_that_can_be_made_are_counted_where_steps_or_a_tolerance_separate_them() {
        let steps = variable(ValueChoice::Steps(1e-5), None).all(100).expect("36 values");
        assert_eq!((steps.len(), steps[0], steps[7], steps[35]), (36, 5e-5, 1.2e-4, 4e-4));
        assert!(steps.iter().all(|value| (value * 1e5 - (value * 1e5).round()).abs() < 1e-9));
        let digits = variable(ValueChoice::Digits, Some(Tolerance::Absolute(3e-5))).all(100).expect("37 values");
        assert_eq!((digits.len(), digits[0], digits[1], digits[36]), (37, 5e-5, 6e-5, 4.05e-4));
        assert_eq!(variable(ValueChoice::Steps(1e-5), None).all(30), None);
        assert_eq!(variable(ValueChoice::Digits, None).all(1000), None);
        assert_eq!(variable(ValueChoice::Listed(vec![1.0, 2.0]), None).all(2), Some(vec![1.0, 2.0]));
    }
}
