//! An identified quantity with its uncertainty.

use serde::Serialize;

use crate::statistics::Value;

/// An identified quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name for people.
    pub quantity: &'static str,
    /// Its value, in `unit`.
    pub value: f64,
    /// Standard uncertainty, in `unit`.
    pub standard_uncertainty: f64,
    /// Ends of the 95 % interval, in `unit`.
    pub interval_95: [f64; 2],
    /// SI unit; "" for a ratio.
    pub unit: &'static str,
    /// How it was found.
    pub method: &'static str,
    /// The key of a set-up that it is the value of, if there is one.
    pub key: Option<&'static str>,
}

impl Estimate {
    /// Of a value without a key.
    #[must_use]
    pub fn new(quantity: &'static str, unit: &'static str, method: &'static str, value: &Value) -> Self {
        Self {
            quantity,
            value: value.value,
            standard_uncertainty: value.standard_uncertainty,
            interval_95: value.interval_95(),
            unit,
            method,
            key: None,
        }
    }

    /// The same as the value of a set-up's key.
    #[must_use]
    pub fn of_key(mut self, key: &'static str) -> Self {
        self.key = Some(key);
        self
    }

    /// Of a quantity that is never negative: the value of a set-up's key where it is found.
    #[must_use]
    pub fn not_negative(
        quantity: &'static str,
        unit: &'static str,
        method: &'static str,
        value: &Value,
        key: Option<&'static str>,
    ) -> Self {
        let (at_least_0, interval_95) = value.not_negative();
        let key = key.filter(|_| value.is_found());
        Self { value: at_least_0, interval_95, key, ..Self::new(quantity, unit, method, value) }
    }
}
