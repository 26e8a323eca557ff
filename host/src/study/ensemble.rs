//! Several starts of the particle at each point of a study.

use super::keys::ensemble;
use super::over::Over;
use crate::input::Section;

/// Quantiles over the starts unless the study states others.
const QUANTILES: [f64; 3] = [0.05, 0.5, 0.95];

/// Several starts of the particle at each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble {
    /// Places of the particle at the start as shares of the clearance from the centre, −1 to 1.
    pub shares: Vec<f64>,
    /// The value over the starts that maps, curves and the best point have.
    pub over: Over,
    /// Quantiles over the starts that the table has, rising; that of `over` is one of them.
    pub quantiles: Vec<f64>,
}

/// Reads `[ensemble]`.
pub(super) fn read(s: &Section, is_maximum: bool) -> Option<Option<Ensemble>> {
    let starts = s.scalar(&ensemble::STARTS);
    let over = s.word(&ensemble::OVER).map(|place| Over::ALL[place]);
    let quantiles = s.numbers_of(&ensemble::QUANTILES);
    let is_given = s.is_given(&ensemble::QUANTILES);
    s.finish();
    let last = starts? - 1.0;
    let shares = (0..=last as usize).map(|n| 2.0 * (n as f64 / last) - 1.0).collect();
    let mut quantiles: Vec<f64> = match quantiles {
        Some(quantiles) => quantiles.iter().map(|number| number.value).collect(),
        None if is_given => return None,
        None => QUANTILES.to_vec(),
    };
    if quantiles.is_empty() {
        s.reject(
            ensemble::QUANTILES.name(),
            "must have at least one quantile",
            Some("leave it out for 0.05, 0.5 and 0.95".into()),
        );
        return None;
    }
    let over = over?;
    // Where the largest objective is the best, its bad side is below and that of the other metrics above.
    let sides = [over.quantile(is_maximum), over.quantile(false)];
    quantiles.extend(sides.into_iter().flatten().filter(|_| over != Over::Worst));
    quantiles.sort_by(f64::total_cmp);
    quantiles.dedup();
    Some(Some(Ensemble { shares, over, quantiles }))
}
