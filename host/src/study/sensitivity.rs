//! Sensitivity indices of a study's metrics, from its table: those of Sobol' or Morris, as its sampling says.

use serde::Serialize;

use super::Study;
use super::bootstrap::IntervalEstimate;
use super::elementary_effects;
use super::evaluate::main_column;
use super::sampling::SamplingMethod;
use super::sobol_indices;
use super::table::StudyTable;
use crate::quantity::Quantity;

/// An index of one input of one metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensitivityIndex {
    /// Key of the case.
    pub key: String,
    /// Which: `first_order` or `total` (shares of the variance), `mean_effect`, `mean_absolute_effect` (µ*) or `effect_deviation` (σ).
    pub index: &'static str,
    /// Its value and 95 % interval: of a share a plain number, of an effect in the unit of the metric, for the whole range of the key.
    #[serde(flatten)]
    pub estimate: IntervalEstimate,
}

/// The indices of a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensitivityIndices {
    /// The metric.
    #[serde(skip)]
    pub metric: Quantity,
    /// Its column of the table.
    pub column: String,
    /// Its unit, which effects have too; `1` of a plain number.
    pub unit: &'static str,
    /// How they are found: `sobol_indices` or `morris`.
    pub method: &'static str,
    /// Base points, or trajectories, behind them.
    pub used: usize,
    /// Those that are left out, because the metric is missing at one of their points.
    pub left_out: usize,
    /// For each key its indices, in the order of the axes; empty if all are left out.
    pub indices: Vec<SensitivityIndex>,
}

/// Names of Sobol' indices, and of those of elementary effects.
const SHARES: [&str; 2] = ["first_order", "total"];
const EFFECTS: [&str; 3] = ["mean_effect", "mean_absolute_effect", "effect_deviation"];

impl SensitivityIndices {
    /// Of each metric of a study whose sampling is for indices; none of another study.
    #[must_use]
    pub fn of(study: &Study, table: &StudyTable) -> Vec<Self> {
        let Some(sampling) = study.sampling.filter(|sampling| sampling.method.is_for_indices()) else {
            return Vec::new();
        };
        let shares = study.points.shares();
        let keys: Vec<&str> = study.points.kept().iter().map(|place| study.axes[*place].key.as_str()).collect();
        let of_metric = |metric: &Quantity| {
            let (column, unit) = (main_column(study, *metric), metric.unit());
            let values = table.column(&column)?;
            let named =
                |names: &'static [&'static str], key: &str, estimates: &[IntervalEstimate]| -> Vec<SensitivityIndex> {
                    let index = |(index, estimate): (&&'static str, &IntervalEstimate)| SensitivityIndex {
                        key: key.into(),
                        index,
                        estimate: *estimate,
                    };
                    names.iter().zip(estimates).map(index).collect()
                };
            let (indices, used): (Vec<Vec<SensitivityIndex>>, usize) =
                if sampling.method == SamplingMethod::SobolIndices {
                    let (found, used) = sobol_indices::indices(&values, keys.len());
                    (keys.iter().zip(&found).map(|(key, found)| named(&SHARES, key, found)).collect(), used)
                } else {
                    let (found, used) = elementary_effects::effects(shares, &values, keys.len());
                    (keys.iter().zip(&found).map(|(key, found)| named(&EFFECTS, key, found)).collect(), used)
                };
            let (method, left_out) = (sampling.method.name(), sampling.count - used);
            Some(Self { metric: *metric, column, unit, method, used, left_out, indices: indices.concat() })
        };
        study.metrics.iter().filter_map(of_metric).collect()
    }

    /// The estimates of each key, in the order of their names.
    pub fn by_key(&self) -> impl Iterator<Item = (&str, Vec<IntervalEstimate>)> {
        let keys = self.indices.chunk_by(|a, b| a.key == b.key);
        keys.map(|of_key| (of_key[0].key.as_str(), of_key.iter().map(|index| index.estimate).collect()))
    }

    /// Whether they are shares of the variance, and not elementary effects.
    #[must_use]
    pub fn is_of_variance(&self) -> bool {
        self.method == SamplingMethod::SobolIndices.name()
    }
}
