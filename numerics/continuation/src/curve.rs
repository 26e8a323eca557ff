//! Curves of special points in two parameters: the boundary value problem and the point's own conditions, in pseudo-arclength steps.
//! [`crate::defining`] has the conditions.

use nalgebra::{DMatrix, DVector};

use crate::boundary_problem::{BoundaryProblem, Linearised};
use crate::branch::{BranchEnd, Steps};
use crate::defining::Defining;
use crate::newton::{Solution, solve};
use crate::orbit::Orbit;
use crate::parameter::Parameter;
use crate::sequence::Sequence;
use crate::special::{Special, SpecialKind};
use crate::system::System;

/// A curve of special points of one kind.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Kind.
    pub kind: SpecialKind,
    /// What it means.
    pub meaning: String,
    /// The orbits on it, each with the values of both parameters.
    pub orbits: Vec<Orbit>,
    /// How it ends at its first and at its last orbit. A grazing there means that another event is grazed too.
    pub ends: [BranchEnd; 2],
}

struct CurveFollower<'a> {
    problem: BoundaryProblem<'a>,
    ranges: [(f64, f64); 2],
    weights: DVector<f64>,
}

/// A violation shallower than this, relative to the motion, is the grazing of the curve itself or that of its mirror image.
const SHALLOW: f64 = 1e-7;

/// Shortest step.
const SHORTEST: f64 = 1e-7;

impl System {
    /// Follows a special point that was found over `parameters[0]` in both parameters. `None` for points where another branch crosses
    /// without a symmetry, which are not followed, and where no curve could be started.
    #[must_use]
    pub fn curve(
        &self,
        sequence: &Sequence,
        special: &Special,
        parameters: [Parameter; 2],
        ranges: [(f64, f64); 2],
        steps: Steps,
    ) -> Option<Curve> {
        let problem = BoundaryProblem { system: self, sequence, parameters: &parameters };
        let size = problem.len();
        let values = [special.parameter, self.value(parameters[1])];
        let mut defining = Defining::of(&problem, special, &values)?;
        let extra = defining.extra_unknowns();
        let mean = special.unknowns.iter().map(|u| u * u).sum::<f64>() / size as f64;
        let mut weights = DVector::from_element(size + 2 + extra, 1.0 / (size as f64 * mean.max(1.0)));
        (weights[size], weights[size + 1]) = (1.0, 1.0);
        let follower = CurveFollower { problem, ranges, weights };
        let mut start = DVector::from_column_slice(&special.unknowns).resize_vertically(size + 2 + extra, 0.0);
        for n in 0..2 {
            start[size + n] = (values[n] - ranges[n].0) / (ranges[n].1 - ranges[n].0);
        }
        if extra == 1 {
            start[size + 2] = defining.first_extra(special);
        }
        // Along the second parameter first: the point was found over the first one.
        let mut along = DVector::zeros(size + 2 + extra);
        along[size + 1] = 1.0;
        let start = follower.correct(&mut defining, start.clone(), &start, &along, 0.0)?.unknowns;
        let along = follower.tangent(&defining, &start, &along)?;
        let (ahead, ahead_end) = follower.trace(&mut defining, &start, &along, steps);
        let (mut back, back_end) = follower.trace(&mut defining, &start, &-along, steps);
        back.reverse();
        back.push(follower.orbit(&start));
        back.extend(ahead);
        Some(Curve {
            kind: special.kind.clone(),
            meaning: special.meaning.clone(),
            orbits: back,
            ends: [back_end, ahead_end],
        })
    }
}

type CurvePoint = DVector<f64>;

impl CurveFollower<'_> {
    fn values(&self, point: &CurvePoint) -> [f64; 2] {
        let size = self.problem.len();
        std::array::from_fn(|n| self.ranges[n].0 + (self.ranges[n].1 - self.ranges[n].0) * point[size + n])
    }

    fn unknowns<'p>(&self, point: &'p CurvePoint) -> &'p [f64] {
        &point.as_slice()[..self.problem.len()]
    }

    fn orbit(&self, point: &CurvePoint) -> Orbit {
        self.problem.orbit(self.unknowns(point), &self.values(point))
    }

    fn inner(&self, a: &CurvePoint, b: &CurvePoint) -> f64 {
        a.iter().zip(b).zip(&self.weights).map(|((a, b), w)| a * b * w).sum()
    }

    /// Residual and derivatives of the orbit and the defining conditions; the last row is free.
    fn derivatives(&self, defining: &Defining, point: &CurvePoint) -> Option<(CurvePoint, DMatrix<f64>)> {
        let size = self.problem.len();
        let (unknowns, values) = (self.unknowns(point), self.values(point));
        let scale: [f64; 2] = std::array::from_fn(|n| self.ranges[n].1 - self.ranges[n].0);
        let Linearised { residual, by_unknowns, by_parameters } = self.problem.linearise::<f64>(unknowns, &values, 1.0);
        let extent = point.len();
        let mut right = DVector::from_vec(residual).resize_vertically(extent, 0.0);
        let mut matrix = DMatrix::zeros(extent, extent);
        for row in 0..size {
            for k in 0..size {
                matrix[(row, k)] = by_unknowns[row][k];
            }
            for n in 0..2 {
                matrix[(row, size + n)] = by_parameters[n][row] * scale[n];
            }
        }
        let extra = if defining.extra_unknowns() == 1 { point[size + 2] } else { 0.0 };
        let rows = defining.rows(&self.problem, unknowns, &values, extra)?;
        for (n, row) in rows.into_iter().enumerate() {
            right[size + n] = row.value;
            for k in 0..size {
                matrix[(size + n, k)] = row.by_unknowns[k];
            }
            for p in 0..2 {
                matrix[(size + n, size + p)] = row.by_parameters[p] * scale[p];
            }
            if defining.extra_unknowns() == 1 {
                matrix[(size + n, size + 2)] = row.by_extra;
            }
        }
        if let Some(direction) = defining.unfolding() {
            for row in 0..size {
                right[row] += extra * direction[row];
                matrix[(row, size + 2)] = direction[row];
            }
        }
        Some((right, matrix))
    }

    fn correct(
        &self,
        defining: &mut Defining,
        guess: CurvePoint,
        anchor: &CurvePoint,
        tangent: &CurvePoint,
        arc: f64,
    ) -> Option<Solution> {
        let last = guess.len() - 1;
        let solution = solve(guess, |point| {
            let Some((mut residual, mut matrix)) = self.derivatives(defining, point) else {
                return (DVector::from_element(point.len(), f64::NAN), DMatrix::zeros(point.len(), point.len()));
            };
            residual[last] = self.inner(tangent, &(point - anchor)) - arc;
            for k in 0..=last {
                matrix[(last, k)] = tangent[k] * self.weights[k];
            }
            (residual, matrix)
        })?;
        let point = &solution.unknowns;
        let extra = if defining.extra_unknowns() == 1 { point[self.problem.len() + 2] } else { 0.0 };
        defining.follow(&self.problem, self.unknowns(point), &self.values(point), extra)?;
        Some(solution)
    }

    fn tangent(&self, defining: &Defining, point: &CurvePoint, along: &CurvePoint) -> Option<CurvePoint> {
        let last = point.len() - 1;
        let (mut right, mut matrix) = self.derivatives(defining, point)?;
        right.fill(0.0);
        right[last] = 1.0;
        for k in 0..=last {
            matrix[(last, k)] = along[k] * self.weights[k];
        }
        let direction = matrix.lu().solve(&right)?;
        let length = self.inner(&direction, &direction).sqrt();
        (length.is_finite() && length > 0.0).then(|| direction / length)
    }

    /// Whether another event than that of the curve is missing or one too many.
    fn is_wrong(&self, point: &CurvePoint) -> bool {
        let violations = self.problem.violations(self.unknowns(point), &self.values(point));
        violations.iter().any(|violation| violation.depth > SHALLOW)
    }

    fn trace(
        &self,
        defining: &mut Defining,
        start: &CurvePoint,
        along: &CurvePoint,
        steps: Steps,
    ) -> (Vec<Orbit>, BranchEnd) {
        let size = self.problem.len();
        let (mut at, mut along) = (start.clone(), along.clone());
        let mut step = 0.2 * steps.longest;
        let mut orbits = Vec::new();
        while orbits.len() < steps.most_orbits {
            let next = self.correct(defining, &at + &along * step, &at, &along, step);
            let next = next.and_then(|solution| {
                let tangent = self.tangent(defining, &solution.unknowns, &along)?;
                (self.inner(&tangent, &along) > 0.95).then_some((solution, tangent))
            });
            let Some((solution, tangent)) = next else {
                step *= 0.5;
                if step < SHORTEST {
                    return (orbits, BranchEnd::NoConvergence);
                }
                continue;
            };
            let point = solution.unknowns;
            if self.is_wrong(&point) {
                step *= 0.5;
                if step < 1e-3 * steps.longest {
                    return (orbits, BranchEnd::Grazing);
                }
                continue;
            }
            if let Some(n) = (0..2).find(|n| !(0.0..=1.0).contains(&point[size + n])) {
                // The last orbit lies on the edge.
                let edge = if point[size + n] < 0.0 { 0.0 } else { 1.0 };
                let share = (edge - at[size + n]) / (point[size + n] - at[size + n]);
                let guess = &at + (&point - &at) * share;
                let mut across = DVector::zeros(point.len());
                across[size + n] = 1.0;
                let mut anchor = guess.clone();
                anchor[size + n] = edge;
                if let Some(solution) = self.correct(defining, guess, &anchor, &across, 0.0) {
                    orbits.push(self.orbit(&solution.unknowns));
                }
                return (orbits, BranchEnd::Range);
            }
            orbits.push(self.orbit(&point));
            (at, along) = (point, tangent);
            if solution.steps <= 6 {
                step = (1.5 * step).min(steps.longest);
            }
        }
        (orbits, BranchEnd::TooLong)
    }
}
