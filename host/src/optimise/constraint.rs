//! A constraint: a metric and what must hold of it.

use super::keys::constraint as keys;
use crate::input::{Section, Span};
use crate::quantity::Quantity;
use crate::study::metric::METRICS;

/// What a constraint asks of its metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At most this.
    AtMost(f64),
    /// At least this.
    AtLeast(f64),
    /// This.
    Equals(f64),
    /// Nothing: its worst value is told, the smallest where the largest is wanted. This is a second objective.
    Unlimited {
        /// The largest value is the best.
        is_maximum: bool,
    },
}

/// A constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The metric.
    pub metric: Quantity,
    /// What is asked of it.
    pub limit: Limit,
    pub(super) span: Span,
}

impl Limit {
    /// By how much a value is beyond it, in the metric's unit; below 0 within it, infinite for a value that does not exist. Without a limit
    /// it only says which of two values is worse.
    #[must_use]
    pub fn excess(self, value: f64) -> f64 {
        match self {
            _ if value.is_nan() => f64::INFINITY,
            Self::AtMost(limit) => value - limit,
            Self::AtLeast(limit) => limit - value,
            Self::Equals(limit) => (value - limit).abs(),
            Self::Unlimited { is_maximum: false } => value,
            Self::Unlimited { is_maximum: true } => -value,
        }
    }

    /// By how much a value misses it, as a share of the limit (as a number where the limit is 0); 0 if it is kept.
    #[must_use]
    pub fn violation(self, value: f64) -> f64 {
        match self {
            Self::Unlimited { .. } => 0.0,
            Self::AtMost(limit) | Self::AtLeast(limit) | Self::Equals(limit) => {
                self.excess(value).max(0.0) / if limit == 0.0 { 1.0 } else { limit.abs() }
            }
        }
    }

    /// Whether a value keeps it; `None` without a limit.
    #[must_use]
    pub fn is_kept(self, value: f64) -> Option<bool> {
        let has_limit = !matches!(self, Self::Unlimited { .. });
        has_limit.then(|| self.violation(value) == 0.0)
    }

    /// In words, with a limit as `number` writes it.
    #[must_use]
    pub fn words(self, number: impl Fn(f64) -> String) -> String {
        match self {
            Self::AtMost(limit) => format!("at most {}", number(limit)),
            Self::AtLeast(limit) => format!("at least {}", number(limit)),
            Self::Equals(limit) => format!("equal to {}", number(limit)),
            Self::Unlimited { .. } => "second objective".into(),
        }
    }
}

/// Reads a table `[[constraint]]`.
pub(super) fn read(s: &Section) -> Option<Constraint> {
    let metric = s.word(&keys::METRIC);
    let limit = s.one_of(&keys::LIMIT);
    s.finish();
    let (place, value) = limit?;
    let limit = [Limit::AtMost, Limit::AtLeast, Limit::Equals][place](value);
    Some(Constraint { metric: METRICS[metric?], limit, span: s.span_of(keys::METRIC.name()) })
}
