//! What is known of the parameters, and which points narrow it most.

use nalgebra::{DMatrix, DVector};

use super::point::CandidatePoint;

/// What is known of the parameters, each in units of its standard uncertainty before, and of the sensors' scale.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterCovariance {
    covariance: DMatrix<f64>,
    /// Place of the parameter to narrow.
    only: Option<usize>,
}

impl ParameterCovariance {
    /// Before any point: the file has no correlations.
    #[must_use]
    pub fn before(parameters: usize, only: Option<usize>) -> Self {
        Self { covariance: DMatrix::identity(parameters + 1, parameters + 1), only }
    }

    /// After a point with these changes of ln(X/Z) and this relative uncertainty.
    #[must_use]
    pub fn after(&self, changes: &DVector<f64>, relative_uncertainty: f64) -> Self {
        let moved = &self.covariance * changes;
        let variance = relative_uncertainty * relative_uncertainty + changes.dot(&moved);
        Self { covariance: &self.covariance - &moved * moved.transpose() / variance, only: self.only }
    }

    /// Standard uncertainty of each parameter, of that before any point.
    #[must_use]
    pub fn shares(&self) -> Vec<f64> {
        (0..self.covariance.nrows() - 1).map(|n| self.covariance[(n, n)].max(0.0).sqrt()).collect()
    }

    /// What a point is chosen by: the uncertainty of the parameter to narrow, of that before any point, or of all together the root of the
    /// determinant for each parameter.
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        let count = self.covariance.nrows() - 1;
        match self.only {
            Some(n) => self.covariance[(n, n)].max(0.0).sqrt(),
            None => {
                let determinant = self.covariance.view((0, 0), (count, count)).clone_owned().determinant();
                determinant.max(0.0).powf(0.5 / count as f64)
            }
        }
    }

    /// The places of the candidates that narrow most, one after another, each at most once, and what is known after each.
    #[must_use]
    pub fn choose(&self, candidates: &[CandidatePoint], points: usize) -> Vec<(usize, Self)> {
        let mut chosen: Vec<(usize, Self)> = Vec::new();
        while chosen.len() < points {
            let known = chosen.last().map_or(self, |(_, known)| known);
            let left = (0..candidates.len()).filter(|n| chosen.iter().all(|(place, _)| place != n));
            let after = left.map(|n| (n, known.after(&candidates[n].changes, candidates[n].relative_uncertainty)));
            let Some(best) = after.min_by(|a, b| a.1.uncertainty().total_cmp(&b.1.uncertainty())) else { break };
            chosen.push(best);
        }
        chosen
    }
}
