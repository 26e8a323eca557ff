//! The answer of a comparison: plain data, as `comparison.json` has it.

use std::ops::Range;

use serde::Serialize;
use serde_json::{Map, Value};

use damprig_motion::read_run::SimulatedMotion;

use super::continued::Continued;
use crate::quantity::Quantity;

/// Coverage factor of the expanded uncertainties: 95 % of a normal distribution.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// A run compared with its simulations.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Name of the run folder.
    pub run: String,
    /// Name of its campaign.
    pub campaign: String,
    /// Its start, local time in the form of RFC 3339.
    pub started: String,
    /// How the run ended, in words.
    pub state: String,
    /// Where the simulated set-ups are from.
    pub set_ups_from: String,
    /// Program that compared.
    pub damprig: &'static str,
    /// Factor of the expanded uncertainties.
    pub coverage_factor: f64,
    /// What the uncertainties rest on, in words.
    pub assumptions: Vec<String>,
    /// What is not compared, and why.
    pub missing: Vec<String>,
    /// Files of the run that could not be read.
    pub unreadable: Vec<String>,
    /// Each experiment on each set-up, in the order of the campaign.
    pub experiments: Vec<ComparedExperiment>,
    /// Periodic motions of the model behind the sheets of experiments that keep the response.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub continued: Vec<Continued>,
}

/// An experiment on a set-up.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedExperiment {
    /// Name of the set-up.
    pub set_up: String,
    /// Its name for people.
    pub label: String,
    /// Name of the experiment.
    pub experiment: String,
    /// `stepped_sine`, `playback`, `impulse` or `free_vibration`.
    pub kind: &'static str,
    /// The parameters of the simulated set-up, by name with the unit.
    pub parameters: Map<String, Value>,
    /// What has to be known about the comparison.
    pub notes: Vec<String>,
    /// Its points; one of a record, a pulse or a free vibration.
    pub points: Vec<ComparedPoint>,
}

/// A compared point.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedPoint {
    /// Drive frequency, Hz; none without a drive frequency.
    pub frequency_hz: Option<f64>,
    /// Nearby trajectories diverge: maxima and time histories of two runs differ, their statistics are compared.
    pub is_sensitive: bool,
    /// Why the simulation on the measured base motion is missing.
    pub without_measured_base: Option<String>,
    /// What may explain a difference.
    pub remarks: Vec<String>,
    /// The quantities.
    pub metrics: Vec<ComparedMetric>,
    /// Measured less simulated x, tick by tick; none without samples of every tick.
    pub residual: Option<Residual>,
    /// Time histories for figures.
    #[serde(skip)]
    pub history: Option<PointHistory>,
}

impl ComparedPoint {
    /// A quantity of the point.
    #[must_use]
    pub fn metric(&self, metric: Quantity) -> Option<&ComparedMetric> {
        self.metrics.iter().find(|own| own.metric == metric)
    }
}

/// A value with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertainValue {
    /// The value, in the quantity's SI unit.
    pub value: f64,
    /// Expanded uncertainty, k = 2.
    pub expanded: f64,
}

/// A prediction of a quantity beside its measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedQuantity {
    /// The prediction.
    #[serde(flatten)]
    pub value: UncertainValue,
    /// Normalised error: measured less predicted, over the root of the sum of both expanded uncertainties squared.
    pub normalised_error: f64,
}

impl PredictedQuantity {
    /// Whether measurement and prediction agree within their uncertainties.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.normalised_error.abs() <= 1.0
    }
}

/// A compared quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedMetric {
    /// The quantity.
    pub metric: Quantity,
    /// Its unit.
    pub unit: &'static str,
    /// The measured value.
    pub measured: UncertainValue,
    /// Simulated on the measured base motion.
    pub on_measured_base: Option<PredictedQuantity>,
    /// Simulated on the commanded base motion.
    pub on_ideal_base: Option<PredictedQuantity>,
    /// Of the prediction that decides.
    pub verdict: Verdict,
}

/// Whether a measured and a predicted value agree within their uncertainties.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// |E_n| is at most 1.
    Agrees,
    /// |E_n| is above 1.
    Differs,
    /// There is no prediction.
    NotCompared,
}

impl Verdict {
    /// In words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
            Self::NotCompared => "not compared",
        }
    }

    pub(super) fn of(predicted: Option<&PredictedQuantity>) -> Self {
        match predicted {
            Some(predicted) if predicted.agrees() => Self::Agrees,
            Some(_) => Self::Differs,
            None => Self::NotCompared,
        }
    }
}

impl ComparedMetric {
    /// The prediction that decides: on the measured base motion, if there is one.
    #[must_use]
    pub fn predicted(&self) -> Option<&PredictedQuantity> {
        self.on_measured_base.as_ref().or(self.on_ideal_base.as_ref())
    }
}

/// Measured less simulated x over the measured ticks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Its RMS, m.
    pub rms_m: f64,
    /// RMS of the measured x, m.
    pub rms_x_m: f64,
    /// RMS noise of a reading of x, m.
    pub noise_rms_m: f64,
}

impl Residual {
    /// The residual of measured readings of x in these ticks of a simulation; `None` where they differ in number.
    pub(super) fn of(
        measured_m: &[f32],
        motion: &SimulatedMotion,
        ticks: &Range<usize>,
        noise_rms_m: f64,
    ) -> Option<Self> {
        let simulated = motion.readings.get(ticks.clone())?;
        let difference_m: Vec<f32> = measured_m.iter().zip(simulated).map(|(m, s)| m - s.x_m).collect();
        (measured_m.len() == simulated.len() && !measured_m.is_empty()).then(|| Self {
            rms_m: rms(&difference_m),
            rms_x_m: rms(measured_m),
            noise_rms_m,
        })
    }
}

fn rms(values: &[f32]) -> f64 {
    (values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// Measured and simulated x of the end of a point, or of a transient.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointHistory {
    /// Time of the first reading after the start of the measurement, s.
    pub from_s: f64,
    /// Readings per second.
    pub rate_hz: f64,
    /// Measured x, m; empty without samples of every tick.
    pub measured_m: Vec<f32>,
    /// Simulated x, m.
    pub simulated_m: Vec<f32>,
    /// Times (s after the start of the measurement) and sides of measured and of simulated impacts.
    pub measured_impacts: Vec<(f64, i8)>,
    /// Of the simulated ones.
    pub simulated_impacts: Vec<(f64, i8)>,
    /// Whether the base was the measured one.
    pub on_measured_base: bool,
}

impl Comparison {
    /// Numbers of compared quantities: all, and those that agree.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        let points = self.experiments.iter().flat_map(|experiment| &experiment.points);
        let predicted = || points.clone().flat_map(|point| &point.metrics).filter_map(ComparedMetric::predicted);
        (predicted().count(), predicted().filter(|predicted| predicted.agrees()).count())
    }
}
