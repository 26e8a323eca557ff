//! The level at which a ball touches the floor, and how long it stays there.
//!
//! A contact of the length τ lets two flights meet below the floor, by τ·ab/(a + b) with their speeds a and b at the floor: deeper for fast
//! impacts than for slow ones. The floor is the level at which the times between the flights are the same for all impacts: to first order a line
//! of the depths over ab/(a + b), whose slope is τ and whose value at 0 is the level. The speeds of an impact are those at the floor. A single
//! impact does not tell its contact time.

use nalgebra::DVector;

use super::fit::Fit;
use super::frames::{Bounce, meeting};

/// The floor of a film.
#[derive(Clone, Debug)]
pub(super) struct Floor {
    /// Flights before the impacts, and a step near each.
    impacts: Vec<(usize, f64)>,
    weights: Vec<f64>,
    /// Mean contact time, in steps; below 0 only by noise.
    pub(super) contact: f64,
    /// Its standard uncertainty.
    pub(super) contact_uncertainty: f64,
    /// Standard deviation of the level from impact to impact beyond the noise.
    pub(super) uneven: f64,
    /// Standard uncertainty of the level by that.
    pub(super) level_by_uneven: f64,
}

/// Ratio of the greatest to the least abscissa that makes a line.
const APART: f64 = 1.02;
/// Steps of Newton's method at most.
const STEPS: usize = 20;
/// Part of a flight that a contact may last.
const LONGEST: f64 = 0.3;

/// The impacts between flights: the flight before each, and the last step that may belong to it.
pub(super) fn impacts(at: &[f64], flights: &[Bounce]) -> Vec<(usize, f64)> {
    let touches = |n: &usize| flights[*n].touches(&flights[n + 1]);
    (0..flights.len().saturating_sub(1)).filter(touches).map(|n| (n, at[flights[n].candidates.end - 1])).collect()
}

impl Floor {
    /// The floor under these impacts, for readings of this variance; `None` for one impact, or speeds that are all alike.
    pub(super) fn of(fit: &Fit, impacts: Vec<(usize, f64)>, variance: f64) -> Option<Self> {
        let points: Vec<(f64, f64)> = impacts.iter().map(|impact| depth(fit, &fit.parameters, *impact, None)).collect();
        let least = points.iter().map(|point| point.0).fold(f64::INFINITY, f64::min);
        let most = points.iter().map(|point| point.0).fold(0.0, f64::max);
        let is_usable = points.len() > 1 && points.iter().all(|(x, depth)| *x > 0.0 && depth.is_finite());
        if !is_usable || most < APART * least {
            return None;
        }
        let weight = |impact: &(usize, f64)| {
            let places: Vec<usize> = fit.places(impact.0).collect();
            let by = DVector::from_iterator(
                places.len(),
                places.iter().map(|place| fit.slope(*place, variance, |moved| depth(fit, moved, *impact, None).1)),
            );
            let own = fit.covariance.select_rows(&places).select_columns(&places);
            (by.dot(&(own * &by)) * variance).recip()
        };
        let weights: Vec<f64> = impacts.iter().map(weight).collect();
        if weights.iter().any(|weight| !weight.is_finite()) {
            return None;
        }
        let mut floor =
            Self { impacts, weights, contact: 0.0, contact_uncertainty: 0.0, uneven: 0.0, level_by_uneven: 0.0 };
        let level = floor.level(fit, &fit.parameters);
        let points = floor.points(fit, &fit.parameters, level);
        let (left, contact) = floor.line(&points);
        floor.contact = contact;
        let of_all: f64 = floor.weights.iter().sum();
        let mean = points.iter().zip(&floor.weights).map(|((x, _), w)| w * x).sum::<f64>() / of_all;
        let spread: f64 = points.iter().zip(&floor.weights).map(|((x, _), w)| w * (x - mean).powi(2)).sum();
        let freedom = points.len() as f64 - 2.0;
        let chi_square: f64 =
            points.iter().zip(&floor.weights).map(|((x, depth), w)| w * (depth - left - contact * x).powi(2)).sum();
        // Beyond what noise leaves: an uneven floor, a contact time that goes with the speed.
        let excess = if freedom > 0.0 { (chi_square / freedom - 1.0).max(0.0) } else { 0.0 };
        floor.contact_uncertainty = ((1.0 + excess) / spread).sqrt();
        floor.uneven = (excess * points.len() as f64 / of_all).sqrt();
        floor.level_by_uneven = (excess * (of_all.recip() + mean * mean / spread)).sqrt();
        let shortest = floor.impacts.windows(2).map(|pair| pair[1].1 - pair[0].1).fold(f64::INFINITY, f64::min);
        (contact.abs() < LONGEST * shortest).then_some(floor)
    }

    /// Value at 0 and slope of the weighted line.
    fn line(&self, points: &[(f64, f64)]) -> (f64, f64) {
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            points.iter().zip(&self.weights).map(|((x, y), w)| w * of(*x, *y)).sum::<f64>()
        };
        let total = sum(&|_, _| 1.0);
        let (x, y) = (sum(&|x, _| x) / total, sum(&|_, y| y) / total);
        let slope = sum(&|a, b| (a - x) * (b - y)) / sum(&|a, _| (a - x).powi(2));
        (y - slope * x, slope)
    }

    /// The level for these parameters, by Newton's method.
    pub(super) fn level(&self, fit: &Fit, parameters: &DVector<f64>) -> f64 {
        let depths = self.impacts.iter().map(|impact| depth(fit, parameters, *impact, None).1);
        let mut level = depths.sum::<f64>() / self.impacts.len() as f64;
        for _ in 0..STEPS {
            let (step, _) = self.line(&self.points(fit, parameters, level));
            level += step;
            if step.abs() < 1e-10 {
                break;
            }
        }
        level
    }

    fn points(&self, fit: &Fit, parameters: &DVector<f64>, level: f64) -> Vec<(f64, f64)> {
        self.impacts.iter().map(|impact| depth(fit, parameters, *impact, Some(level))).collect()
    }
}

/// ab/(a + b) at a level, and how far below it the flights beside an impact meet; at the height at which they meet, and that height.
fn depth(fit: &Fit, parameters: &DVector<f64>, (pair, near): (usize, f64), level: Option<f64>) -> (f64, f64) {
    let [before, after] = [pair, pair + 1].map(|n| fit.flight(n, parameters));
    let met = meeting(&before, &after, near);
    let ends = level.map_or([met; 2], |level| [crossing(&before, level, met), crossing(&after, level, met)]);
    let (a, b) = (before.velocity(ends[0]), -after.velocity(ends[1]));
    let x = a * b / (a + b);
    // To first order the depth is the time between the flights, times ab/(a + b).
    (x, if level.is_some() { x * (ends[1] - ends[0]) } else { before.height(met) })
}

/// The step near `near` at which a flight is at a level.
pub(super) fn crossing(flight: &super::fit::Flight, level: f64, near: f64) -> f64 {
    let mut at = near;
    for _ in 0..20 {
        let step = (level - flight.height(at)) / flight.velocity(at);
        at += step;
        if step.abs() < 1e-12 {
            break;
        }
    }
    at
}
