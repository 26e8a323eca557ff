//! Restitution over the approach speed: e(v) = min(coefficient·(v/reference_speed)^(−exponent), maximum), and whether one constant is enough.
//!
//! Each impact has an approach speed v and a coefficient e with a covariance from its measurement. Impacts that are alike still differ, so that
//! each e has a further variance τ² of its own, which is chosen so that the sum of the weighted squares is its expectation (Paule and Mandel,
//! J. Res. NBS 87, 377, 1982). Where the uncertainty of a file's times is not known either, both parts are those of the greatest restricted
//! likelihood (Patterson and Thompson, Biometrika 58, 545, 1971). Constant and power are fitted by generalised least squares. An error of v acts on what is left with the slope of
//! the fit.

use nalgebra::DMatrix;
use serde::Serialize;

use super::least_squares::{Joined, RestitutionModel};
use crate::statistics::{Value, student_95, student_tail};

/// An impact.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Impact {
    /// The file that it is from.
    pub source: String,
    /// Number of the drop in the file, from 1.
    pub drop: u32,
    /// Number of the impact in its drop, from 1.
    pub number: u32,
    /// Time in the file, s, where known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Approach speed, m/s.
    pub speed_m_per_s: f64,
    /// Its standard uncertainty, m/s, as far as the measurement shows it.
    pub speed_standard_uncertainty_m_per_s: f64,
    /// Coefficient of restitution.
    pub coefficient: f64,
    /// Its standard uncertainty, as far as the measurement shows it.
    pub coefficient_standard_uncertainty: f64,
    /// From the times of the flights before and after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficient_by_times: Option<f64>,
    /// From the heights of the flights before and after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficient_by_heights: Option<f64>,
    /// Speed along the wall before and after it, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sideways_m_per_s: Option<[f64; 2]>,
}

/// Impacts whose measurement errors go together: those of a file.
#[derive(Clone, Debug)]
pub struct Impacts {
    /// The impacts.
    pub all: Vec<Impact>,
    /// Covariance of all e, then of the logarithms of all v.
    pub covariance: DMatrix<f64>,
    /// Whether the covariance is absolute; otherwise it is known up to a factor, which the scatter shows.
    pub is_absolute: bool,
    /// Degrees of freedom of an absolute covariance.
    pub degrees_of_freedom: f64,
    /// How they were measured.
    pub method: &'static str,
}

/// The power of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    /// e at the reference speed.
    pub coefficient: Value,
    /// Reference speed, m/s: near the middle of the measured ones; exact.
    pub reference_speed_m_per_s: f64,
    /// Exponent of the fall of e.
    pub exponent: Value,
    /// Upper limit of e: where the impacts show it, else e of the fit at the slowest of them.
    pub maximum: Value,
    /// Whether the impacts show an upper limit.
    pub is_maximum_found: bool,
    /// Covariance of coefficient and exponent.
    pub covariance: f64,
}

impl Power {
    /// Whether a wall can have this law: e falls with the speed, at most as fast as 1/v, from a maximum below 1.
    pub fn is_a_wall(&self) -> bool {
        self.exponent.value > 0.0 && self.exponent.value <= 1.0 && (0.0..1.0).contains(&self.maximum.value)
    }

    /// Without an upper limit that the impacts show: it is e at the slowest of them, or at the fastest where e rises.
    pub fn of(
        coefficient: Value,
        reference_speed_m_per_s: f64,
        exponent: Value,
        covariance: f64,
        [slowest, fastest]: [f64; 2],
    ) -> Self {
        let power = Self {
            coefficient,
            reference_speed_m_per_s,
            exponent,
            maximum: coefficient,
            is_maximum_found: false,
            covariance,
        };
        let maximum = power.unlimited(if exponent.value < 0.0 { fastest } else { slowest });
        Self { maximum, ..power }
    }

    /// e at a speed, m/s.
    #[must_use]
    pub fn at(&self, speed_m_per_s: f64) -> f64 {
        (self.coefficient.value * (speed_m_per_s / self.reference_speed_m_per_s).powf(-self.exponent.value))
            .min(self.maximum.value)
    }

    /// Probability of an exponent as far from 0, if e is constant.
    fn chance(&self) -> f64 {
        let freedom = self.exponent.degrees_of_freedom.clamp(1.0, 1e4) as u32;
        student_tail(self.exponent.value / self.exponent.standard_uncertainty, freedom)
    }

    /// The power without its upper limit.
    fn unlimited(&self, speed_m_per_s: f64) -> Value {
        let ln = (speed_m_per_s / self.reference_speed_m_per_s).ln();
        let factor = (-self.exponent.value * ln).exp();
        let by = [factor, -self.coefficient.value * factor * ln];
        let [c, n] = [self.coefficient, self.exponent].map(|value| value.standard_uncertainty.powi(2));
        let variance = by[0] * by[0] * c + by[1] * by[1] * n + 2.0 * by[0] * by[1] * self.covariance;
        Value {
            value: self.coefficient.value * factor,
            standard_uncertainty: variance.max(0.0).sqrt(),
            ..self.coefficient
        }
    }
}

/// What the impacts show.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// One e for all speeds.
    pub constant: Value,
    /// e over the speed; none where all speeds are alike, or there are too few impacts.
    pub power: Option<Power>,
    /// Probability of an exponent as far from 0 as the fitted one, if e is constant.
    pub chance: Option<f64>,
    /// Standard deviation of e from impact to impact beyond the measurement's, for the constant and for the power.
    pub scatter: [f64; 2],
    /// Slowest and fastest approach, m/s.
    pub speeds_m_per_s: [f64; 2],
    /// Number of impacts.
    pub impacts: usize,
    /// Chance below which one constant is not enough: this share of good records is contradicted.
    pub level: f64,
}

/// Chance below which one constant is not enough: of drop tests, which have few impacts.
const FEW: f64 = 0.01;
/// Of a run, which has many.
const MANY: f64 = 0.001;
/// Ratio of the fastest to the slowest speed from which they differ.
pub const APART: f64 = 1.05;

impl Law {
    /// Of fits with one e and with a power of the speed.
    pub fn of_fit(constant: Value, power: Power, speeds_m_per_s: [f64; 2], impacts: usize) -> Self {
        let chance = Some(power.chance());
        Self { constant, power: Some(power), chance, scatter: [0.0; 2], speeds_m_per_s, impacts, level: MANY }
    }

    /// Whether the impacts contradict a constant e.
    #[must_use]
    pub fn depends_on_speed(&self) -> bool {
        self.chance.is_some_and(|chance| chance < self.level)
    }
}

/// Finds what the impacts show; `None` for a single impact whose uncertainty is not known.
#[must_use]
pub fn law(groups: &[Impacts]) -> Option<Law> {
    let joined = Joined::new(groups)?;
    let constant = joined.fit(RestitutionModel::Constant)?;
    let [slowest, fastest] = [joined.ln_v.min().exp(), joined.ln_v.max().exp()];
    let power = (joined.e.len() > 1 && fastest > APART * slowest && slowest > 0.0).then(|| joined.power()).flatten();
    let chance = power.as_ref().map(|(power, _)| power.chance());
    Some(Law {
        constant: constant.value(0),
        scatter: [constant.scatter, power.as_ref().map_or(constant.scatter, |(_, scatter)| *scatter)],
        power: power.map(|(power, _)| power),
        chance,
        speeds_m_per_s: [slowest, fastest],
        impacts: joined.e.len(),
        level: FEW,
    })
}

/// Without the rounding of a logarithm.
pub fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// Ends of the 95 % interval of the upper limit: where it was not found, e of slower impacts is not known below 1.
#[must_use]
pub fn interval_of_maximum(power: &Power) -> [f64; 2] {
    let half = student_95(power.maximum.degrees_of_freedom) * power.maximum.standard_uncertainty;
    let low = power.maximum.value - half;
    [low, if power.is_maximum_found { power.maximum.value + half } else { 1.0f64.max(power.maximum.value) }]
}
