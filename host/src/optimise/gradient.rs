//! Gradient steps from several starts, for an objective that is smooth between few kinks: the worst of simulations.
//!
//! Around a point each of the simulations that may be the worst is a parabola along each variable, from central differences of that
//! simulation alone (its expansion), which costs far less than the point with its band. A step goes to the least worst of the expansions within reach
//! (so at a tie all that tie count), and is made if the simulated objective is better there; the reach grows where the expansions
//! predict that, and shrinks where they do not. The differences need no periodic motion and hold for every damper and metric.
//!
//! The starts cover the ranges. When they end on few local optima, more of these are unlikely (the rule of Boender and Rinnooy Kan,
//! Mathematical Programming 37, 1987); an objective with jumps has many, and is left to another search.

use rayon::prelude::*;

use super::evaluate::{Evaluated, GoOnAfter, Top, number, of_top};
use super::file::Optimisation;
use crate::failure::Failure;
use crate::study::sampling::{Sampling, SamplingMethod};

/// Starts that are followed side by side, and at most.
const TOGETHER: usize = 8;
const STARTS: usize = 32;

/// Ends within this share of the objective and this distance, as a share of the ranges, are the same optimum: those on a plateau are not.
const SAME: (f64, f64) = (1e-3, 0.1);

/// Most points of a descent.
const POINTS: usize = 24;

/// Reach of the first step, the longest and the shortest one, as shares of the ranges.
const REACH: [f64; 3] = [0.25, 0.5, 3e-4];

/// A descent ends where a step promises less than this share of the objective.
const FLAT: f64 = 3e-5;

/// Simulations whose values are within this share of the worst may be the worst after a step; and the most of them.
const NEAR: f64 = 0.3;
const TOPS: usize = 8;

/// Step of the differences as a share of the reach: what is smaller than that does not lead a step astray, as small ripples do.
const STEP: f64 = 0.1;

/// Rounds in which the weights of the expansions approach those of the least worst point, halvings in each, and the share of the value
/// within which they are there.
const ROUNDS: usize = 200;
const HALVINGS: usize = 30;
const GAP: f64 = 1e-6;

/// Most simulations for the differences at a point.
pub(super) const fn most_simulations(variables: usize) -> u64 {
    (2 * variables * TOPS) as u64
}

/// What the descents found.
pub(super) struct Descents {
    /// Their points.
    pub points: Vec<Evaluated>,
    /// Whether other local optima are unlikely.
    pub is_complete: bool,
}

/// Evaluates a point at these shares of the ranges; `None` when stopped.
pub(super) type EvaluatePoint<'a> = &'a (dyn Fn(&[f64]) -> Option<Evaluated> + Sync);

/// Descends from so many starts as are needed to know that the objective has few local optima, or that it may have many.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub(super) fn descents(
    optimisation: &Optimisation,
    evaluate: EvaluatePoint,
    go_on: GoOnAfter,
) -> Result<Descents, Failure> {
    let sampling = Sampling { method: SamplingMethod::Sobol, count: STARTS + 1, seed: optimisation.seed };
    // The first point of the sequence is a corner.
    let starts = &sampling.shares(optimisation.variables.len())[1..];
    let most = optimisation.evaluations as usize;
    let descent = Descent { optimisation, evaluate, go_on, most: POINTS.min(most / (2 * TOGETHER)).max(1) };
    let (mut points, mut ends, mut optima) = (Vec::new(), 0, Vec::<(f64, Vec<f64>)>::new());
    let mut is_complete = false;
    for part in starts.chunks(TOGETHER) {
        if points.len() + part.len() * descent.most > most {
            break;
        }
        let descend = |start: &Vec<f64>| descent.from(start);
        let followed: Vec<Vec<Evaluated>> = part.par_iter().map(descend).collect::<Result<_, Failure>>()?;
        for points in &followed {
            let ends = points.iter().map(|point| (point.cost(optimisation.is_maximum), point.shares.clone()));
            let Some(end) = ends.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            if !optima.iter().any(|known| is_same(known, &end)) {
                optima.push(end);
            }
        }
        ends += followed.len();
        points.extend(followed.into_iter().flatten());
        is_complete = is_likely_all(optima.len(), ends);
        if is_complete || !is_likely_all(optima.len(), STARTS) {
            break;
        }
    }
    Ok(Descents { points, is_complete })
}

/// Whether two ends, with cost and place, are the same optimum.
fn is_same((cost, at): &(f64, Vec<f64>), (other, there): &(f64, Vec<f64>)) -> bool {
    (cost - other).abs() <= SAME.0 * cost.abs() && at.iter().zip(there).all(|(a, b)| (a - b).abs() <= SAME.1)
}

/// Whether so many optima of so many descents are likely all: their expected number is below half a one more.
fn is_likely_all(optima: usize, descents: usize) -> bool {
    let (optima, descents) = (optima as f64, descents as f64);
    descents > optima + 2.0 && optima * (descents - 1.0) / (descents - optima - 2.0) < optima + 0.5
}

struct Descent<'a> {
    optimisation: &'a Optimisation,
    evaluate: EvaluatePoint<'a>,
    go_on: GoOnAfter<'a>,
    /// Most points.
    most: usize,
}

impl Descent<'_> {
    fn from(&self, start: &[f64]) -> Result<Vec<Evaluated>, Failure> {
        let [mut reach, longest, shortest] = REACH;
        let Some(mut best) = (self.evaluate)(start) else { return Ok(Vec::new()) };
        let mut points = vec![best.clone()];
        while points.len() < self.most && reach > shortest {
            let Some(expansions) = Failure::unless_interrupted(self.expansions(&best, STEP * reach))? else { break };
            let step = expansions.step(&best.shares, reach);
            let (cost, length) = (self.cost(&best), step.iter().fold(0.0, |most: f64, along| most.max(along.abs())));
            let expected = cost - expansions.worst(&step);
            if expected.is_nan() || expected <= FLAT * cost.abs() {
                break;
            }
            let to: Vec<f64> = best.shares.iter().zip(&step).map(|(at, along)| at + along).collect();
            let Some(point) = (self.evaluate)(&to) else { break };
            let gain = cost - self.cost(&point);
            reach = if gain > 0.75 * expected { longest.min(2.0 * length) } else { 0.25 * length };
            points.push(point.clone());
            if gain > 0.0 {
                best = point;
            }
        }
        Ok(points)
    }

    fn cost(&self, point: &Evaluated) -> f64 {
        point.cost(self.optimisation.is_maximum)
    }

    /// The expansions at a point, from differences over `small` to either side.
    fn expansions(&self, at: &Evaluated, small: f64) -> Result<Expansions, Failure> {
        let sign = if self.optimisation.is_maximum { -1.0 } else { 1.0 };
        let worst = self.cost(at);
        let mut tops: Vec<&Top> = at.tops.iter().filter(|top| sign * top.value >= worst - NEAR * worst.abs()).collect();
        tops.sort_by(|a, b| (sign * b.value).total_cmp(&(sign * a.value)));
        tops.truncate(TOPS);
        let expansion = |top: &Top| {
            let mut expansion = Expansion { value: sign * top.value, along: Vec::new() };
            for (place, axis) in self.optimisation.variable_axes().iter().enumerate() {
                let share = at.shares[place];
                let (less, more) = ((share - small).max(0.0), (share + small).min(1.0));
                let moved = |to: f64| -> Result<f64, Failure> {
                    if to == share {
                        return Ok(expansion.value);
                    }
                    let mut values = top.values.clone();
                    values[place] += number(axis, to) - number(axis, share);
                    Ok(sign * of_top(self.optimisation, top, &values, self.go_on)?)
                };
                let (below, above) = (moved(less)?, moved(more)?);
                let is_inside = less < share && share < more;
                let bend = if is_inside { (above - 2.0 * expansion.value + below) / (small * small) } else { 0.0 };
                expansion.along.push(((above - below) / (more - less), bend.max(0.0)));
            }
            Ok(expansion)
        };
        Ok(Expansions(tops.into_iter().map(expansion).collect::<Result<_, Failure>>()?))
    }
}

/// A simulation's expansion to the second order: its value, and slope and bend along each variable.
struct Expansion {
    value: f64,
    along: Vec<(f64, f64)>,
}

/// The simulations that may be the worst.
struct Expansions(Vec<Expansion>);

impl Expansion {
    fn at(&self, step: &[f64]) -> f64 {
        let along = |((slope, bend), step): (&(f64, f64), &f64)| slope * step + 0.5 * bend * step * step;
        self.value + self.along.iter().zip(step).map(along).sum::<f64>()
    }
}

impl Expansions {
    fn worst(&self, step: &[f64]) -> f64 {
        self.0.iter().map(|expansion| expansion.at(step)).fold(f64::NAN, f64::max)
    }

    /// The step to the least worst point within reach and the ranges: the saddle point of the weighted expansions. Weight moves from the
    /// least of those that have some to the worst one.
    fn step(&self, shares: &[f64], reach: f64) -> Vec<f64> {
        let count = self.0.len().max(1) as f64;
        let mut weights = vec![1.0 / count; self.0.len()];
        let mut best = vec![0.0; shares.len()];
        for _ in 0..ROUNDS {
            let step = self.least(&weights, shares, reach);
            if self.worst(&step) < self.worst(&best) {
                best.clone_from(&step);
            }
            let at: Vec<f64> = self.0.iter().map(|expansion| expansion.at(&step)).collect();
            let by_value = |a: &usize, b: &usize| at[*a].total_cmp(&at[*b]);
            let weighted = (0..at.len()).filter(|place| weights[*place] > 0.0);
            let (Some(worst), Some(least)) = ((0..at.len()).max_by(by_value), weighted.min_by(by_value)) else { break };
            if at[worst] - at[least] <= GAP * at[worst].abs() {
                break;
            }
            // The least value is concave along the way: its top is where the two are equal.
            let moved = |share: f64| {
                let mut moved = weights.clone();
                moved[worst] += share * weights[least];
                moved[least] -= share * weights[least];
                moved
            };
            let (mut from, mut to) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (from + to);
                let step = self.least(&moved(middle), shares, reach);
                if self.0[worst].at(&step) > self.0[least].at(&step) { from = middle } else { to = middle }
            }
            weights = moved(to);
        }
        best
    }

    /// The step to the least value of the weighted expansions. A little bend makes it unique.
    fn least(&self, weights: &[f64], shares: &[f64], reach: f64) -> Vec<f64> {
        let along = |(place, share): (usize, &f64)| {
            let sum = |of: &dyn Fn(&(f64, f64)) -> f64| -> f64 {
                self.0.iter().zip(weights).map(|(expansion, weight)| weight * of(&expansion.along[place])).sum()
            };
            let steepest =
                self.0.iter().map(|expansion| expansion.along[place].0.abs()).fold(f64::MIN_POSITIVE, f64::max);
            let (slope, bend) = (sum(&|along| along.0), sum(&|along| along.1) + 0.02 * steepest / reach);
            (-slope / bend).clamp((-reach).max(-share), reach.min(1.0 - share))
        };
        shares.iter().enumerate().map(along).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(lines: &[(f64, &[f64])]) -> Expansions {
        let line = |(value, slopes): &(f64, &[f64])| Expansion {
            value: *value,
            along: slopes.iter().map(|slope| (*slope, 0.0)).collect(),
        };
        Expansions(lines.iter().map(line).collect())
    }

    #[test]
    fn a_step_goes_to_where_the_worst_simulations_tie() {
        let two = lines(&[(1.0, &[-1.0]), (0.8, &[1.0])]);
        assert!((two.step(&[0.5], 0.25)[0] - 0.1).abs() < 1e-6);
        // 1 − x − y, 0.9 + x and 0.8 + y meet at 0, 0.1, where no step makes all smaller.
        let three = lines(&[(1.0, &[-1.0, -1.0]), (0.9, &[1.0, 0.0]), (0.8, &[0.0, 1.0])]);
        let step = three.step(&[0.5, 0.5], 0.25);
        assert!((three.worst(&step) - 0.9).abs() < 2e-6 && step[0].abs() < 1e-5, "{step:?}");
    }

    #[test]
    fn a_step_stays_within_reach_and_within_the_ranges() {
        let falling = lines(&[(1.0, &[-1.0, 1.0])]);
        assert_eq!(falling.step(&[0.5, 0.1], 0.25), [0.25, -0.1]);
        let bent = Expansions(vec![Expansion { value: 1.0, along: vec![(-1.0, 20.0)] }]);
        // At slope/bend, but for the little bend that is added: 0.02·1/0.25 of 20.
        assert!((bent.step(&[0.5], 0.25)[0] - 0.05).abs() < 0.005 * 0.05);
    }

    /// w (N − 1)/(N − w − 2) < w + 1/2.
    #[test]
    fn more_different_ends_need_more_starts() {
        let least = |optima: usize| (1..=1000).find(|descents| is_likely_all(optima, *descents));
        assert_eq!([1, 2, 3, 4].map(least), [Some(8), Some(17), Some(30), Some(47)]);
        let near = |cost: f64, place: f64| is_same(&(2.0, vec![0.5, 0.2]), &(cost, vec![0.45, place]));
        assert!(near(2.001, 0.25) && !near(2.003, 0.25) && !near(2.0, 0.4), "a plateau is no optimum");
    }
}
