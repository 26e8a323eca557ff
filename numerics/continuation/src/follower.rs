//! Pseudo-arclength steps along a branch of one sequence, and the test functions of its special points.

use nalgebra::{DMatrix, DVector};

use crate::boundary_problem::{BoundaryProblem, Linearised, UNKNOWNS, eigenvalues};
use crate::newton::{Solution, solve};

/// A point of a branch: the unknowns and the parameter in units of its range.
pub(crate) type Point = DVector<f64>;

/// Steps along a branch.
pub(crate) struct Follower<'a> {
    pub problem: BoundaryProblem<'a>,
    /// Parameter at 0 and its unit.
    pub origin: f64,
    pub scale: f64,
    /// Weights of the inner product.
    weights: DVector<f64>,
}

/// Test functions at a point; each changes its sign at its special point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tests {
    /// Change of the parameter along the branch.
    pub fold: f64,
    /// Zero where a multiplier is +1.
    pub plus: f64,
    /// Zero where a multiplier is −1.
    pub minus: f64,
    /// Number of complex multipliers outside the unit circle.
    pub outside: usize,
    /// |μ| − 1 of the complex multipliers nearest to the circle.
    pub circle: Option<f64>,
}

/// Largest error of the multipliers by rounding at which their crossing of the unit circle is looked for.
const RESOLVED: f64 = 1e-7;

impl<'a> Follower<'a> {
    /// Follows `problem`, with a typical solution `unknowns`, over the parameter range.
    pub fn new(problem: BoundaryProblem<'a>, unknowns: &[f64], (from, to): (f64, f64)) -> Self {
        let count = unknowns.len() as f64;
        let size = unknowns.iter().map(|u| u * u).sum::<f64>() / count;
        let weight = 1.0 / (count * size.max(1.0));
        let mut weights = DVector::from_element(unknowns.len() + 1, weight);
        weights[unknowns.len()] = 1.0;
        Self { problem, origin: from, scale: to - from, weights }
    }

    /// The point of a solution at a value of the parameter.
    pub fn point(&self, unknowns: &[f64], value: f64) -> Point {
        let mut point = DVector::from_column_slice(unknowns).push(0.0);
        point[unknowns.len()] = (value - self.origin) / self.scale;
        point
    }

    /// Value of the parameter.
    pub fn value(&self, point: &Point) -> f64 {
        self.origin + self.scale * point[self.problem.len()]
    }

    /// The unknowns of the boundary value problem.
    pub fn unknowns<'p>(&self, point: &'p Point) -> &'p [f64] {
        &point.as_slice()[..self.problem.len()]
    }

    pub fn inner(&self, a: &Point, b: &Point) -> f64 {
        a.iter().zip(b).zip(&self.weights).map(|((a, b), w)| a * b * w).sum()
    }

    pub fn derivatives(&self, point: &Point, twist: f64) -> (DVector<f64>, DMatrix<f64>) {
        let Linearised { residual, by_unknowns, by_parameters } =
            self.problem.linearise(self.unknowns(point), &[self.value(point)], twist);
        let size = self.problem.len();
        let matrix = DMatrix::from_fn(size + 1, size + 1, |row, k| match (row < size, k < size) {
            (true, true) => by_unknowns[row][k],
            (true, false) => by_parameters[0][row] * self.scale,
            (false, _) => 0.0,
        });
        (DVector::from_vec(residual).push(0.0), matrix)
    }

    /// The orbit whose distance from `anchor` along `tangent` is `arc`.
    pub fn correct(&self, guess: Point, anchor: &Point, tangent: &Point, arc: f64) -> Option<Solution> {
        let size = self.problem.len();
        solve(guess, |point| {
            let (mut residual, mut matrix) = self.derivatives(point, 1.0);
            residual[size] = self.inner(tangent, &(point - anchor)) - arc;
            for k in 0..=size {
                matrix[(size, k)] = tangent[k] * self.weights[k];
            }
            (residual, matrix)
        })
    }

    /// The orbit at a value of the parameter.
    pub fn correct_at(&self, guess: Point, value: f64) -> Option<Solution> {
        let size = self.problem.len();
        let place = (value - self.origin) / self.scale;
        solve(guess, |point| {
            let (mut residual, mut matrix) = self.derivatives(point, 1.0);
            residual[size] = point[size] - place;
            matrix[(size, size)] = 1.0;
            (residual, matrix)
        })
    }

    /// As [`Follower::correct`] where another branch crosses. There the matrix is singular; with `right` and `left`, the directions of
    /// the crossing in the unknowns and in the equations, it is not: the orbit stays on the chord in the first, and the
    /// second takes up what remains of the equations, zero on a branch of mirror-symmetric orbits.
    pub fn correct_at_crossing(
        &self,
        guess: &Point,
        (anchor, tangent, arc): (&Point, &Point, f64),
        (left, right): &(DVector<f64>, DVector<f64>),
    ) -> Option<Point> {
        let size = self.problem.len();
        let solution = solve(guess.clone().push(0.0), |extended| {
            let point = extended.rows(0, size + 1).into_owned();
            let (residual, matrix) = self.derivatives(&point, 1.0);
            let mut residual = residual.push(0.0);
            let mut matrix = matrix.resize(size + 2, size + 2, 0.0);
            residual[size] = self.inner(tangent, &(&point - anchor)) - arc;
            for k in 0..=size {
                matrix[(size, k)] = tangent[k] * self.weights[k];
            }
            for k in 0..size {
                residual[k] += extended[size + 1] * left[k];
                matrix[(k, size + 1)] = left[k];
                residual[size + 1] += right[k] * (point[k] - guess[k]);
                matrix[(size + 1, k)] = right[k];
            }
            (residual, matrix)
        })?;
        Some(solution.unknowns.rows(0, size + 1).into_owned())
    }

    /// Left and right singular vectors of the smallest singular value of the equations' derivatives by the unknowns.
    pub fn crossing(&self, point: &Point) -> Option<(DVector<f64>, DVector<f64>)> {
        let size = self.problem.len();
        let (_, matrix) = self.derivatives(point, 1.0);
        let svd = matrix.view((0, 0), (size, size)).into_owned().svd(true, true);
        Some((svd.u?.column(size - 1).into_owned(), svd.v_t?.row(size - 1).transpose()))
    }

    /// The direction of the branch, of length 1, on the side of `along`.
    pub fn tangent(&self, point: &Point, along: &Point) -> Option<Point> {
        let size = self.problem.len();
        let (mut right, mut matrix) = self.derivatives(point, 1.0);
        right.fill(0.0);
        right[size] = 1.0;
        for k in 0..=size {
            matrix[(size, k)] = along[k] * self.weights[k];
        }
        let direction = matrix.lu().solve(&right)?;
        let length = self.inner(&direction, &direction).sqrt();
        (length.is_finite() && length > 0.0).then(|| direction / length)
    }

    /// The direction in which the parameter grows (`sign` 1) or falls (−1).
    pub fn first_tangent(&self, point: &Point, sign: f64) -> Option<Point> {
        let mut along = DVector::zeros(self.problem.len() + 1);
        along[self.problem.len()] = sign;
        self.tangent(point, &along)
    }

    /// The disturbance that returns multiplied by `twist` (±1), of length 1; the parameter stays.
    pub fn neutral_direction(&self, point: &Point, twist: f64) -> Option<Point> {
        let size = self.problem.len();
        let (_, matrix) = self.derivatives(point, twist);
        let svd = matrix.view((0, 0), (size, size)).into_owned().svd(false, true);
        let row = svd.v_t?.row(size - 1).transpose();
        let direction = row.push(0.0);
        let length = self.inner(&direction, &direction).sqrt();
        (length > 0.0).then(|| direction / length)
    }

    pub fn tests(&self, point: &Point, tangent: &Point) -> Tests {
        let transition = self.problem.transition(self.unknowns(point), &[self.value(point)]);
        // Beside multipliers beyond this the small ones are rounding.
        let is_resolved = transition.norm() * f64::EPSILON < RESOLVED;
        let multipliers = eigenvalues(&transition);
        let complex = || multipliers.iter().filter(|m| is_resolved && m.im.abs() > 1e-9 * m.norm());
        let circle = complex().map(|m| m.norm() - 1.0).min_by(|a, b| a.abs().total_cmp(&b.abs()));
        Tests {
            fold: tangent[self.problem.len()],
            plus: self.determinant(point, 1.0),
            minus: self.determinant(point, -1.0),
            outside: complex().filter(|m| m.norm() > 1.0).count(),
            circle,
        }
    }

    /// Determinant of the boundary value problem, its rows divided by their sizes: zero where a multiplier is `twist`. It keeps its
    /// digits where other multipliers are large.
    fn determinant(&self, point: &Point, twist: f64) -> f64 {
        let size = self.problem.len();
        let (_, matrix) = self.derivatives(point, twist);
        let mut matrix = matrix.view((0, 0), (size, size)).into_owned();
        for mut row in matrix.row_iter_mut() {
            let largest = row.amax();
            row /= largest.max(f64::MIN_POSITIVE);
        }
        matrix.lu().determinant()
    }

    /// The point with the segments passed twice.
    pub fn doubled(&self, point: &Point) -> Vec<f64> {
        let unknowns = self.unknowns(point);
        let mut twice = unknowns.to_vec();
        twice.extend_from_slice(unknowns);
        let turns = std::f64::consts::TAU * f64::from(self.problem.sequence.periods);
        for segment in unknowns.len() / UNKNOWNS..2 * (unknowns.len() / UNKNOWNS) {
            twice[UNKNOWNS * segment + crate::flow::place::PHASE] += turns;
        }
        twice
    }
}
