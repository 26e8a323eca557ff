//! The periodic orbit as a boundary value problem of several segments.
//!
//! Unknowns of segment i: its state at the start, q_i = (x, x′, y − x, y′ − x′, phase of the drive), and its duration T_i. With the
//! flow φ, the reset R and the guard g of its end:
//! `q_{i+1} − R(φ(q_i, T_i)) = 0` and `g(φ(q_i, T_i)) = 0`; after the last segment comes the first, with the drive's phase
//! less the turns of the orbit. Every derivative is exact: those by state and duration from the flow, those by
//! parameters by dual numbers.

use nalgebra::{Complex, DMatrix, DVector, Schur};

use crate::dual::{Dual, Real};
use crate::flow::place::PHASE;
use crate::flow::{N, STATE, Square, Vector, by_state, complete, dot, exponential, row_times, steps, times};
use crate::parameter::Parameter;
use crate::passage::Passage;
use crate::sequence::{Guard, Sequence};
use crate::system::System;

/// Unknowns of a segment.
pub const UNKNOWNS: usize = STATE + 1;

/// Residual and derivatives, generic in the number.
#[derive(Clone, Debug)]
pub struct Linearised<T> {
    /// The residual.
    pub residual: Vec<T>,
    /// Derivatives by the unknowns, row by row.
    pub by_unknowns: Vec<Vec<T>>,
    /// Derivatives by each parameter.
    pub by_parameters: Vec<Vec<T>>,
}

/// A condition on the flow of a segment besides the boundary value problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// A guard is zero at the time that is an unknown of its own.
    Zero(usize, Guard, When),
    /// The rate of a guard is zero.
    Flat(usize, Guard, When),
    /// A segment has no duration.
    Empty(usize),
}

/// An instant of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// Its start.
    Start,
    /// Its end.
    End,
    /// An unknown time after its start.
    Inside,
}

impl Condition {
    /// Whether it has an unknown time.
    #[must_use]
    pub fn has_time(&self) -> bool {
        matches!(self, Self::Zero(_, _, When::Inside) | Self::Flat(_, _, When::Inside))
    }
}

/// The boundary value problem of one sequence.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryProblem<'a> {
    /// The system.
    pub system: &'a System,
    /// The sequence.
    pub sequence: &'a Sequence,
    /// The free parameters.
    pub parameters: &'a [Parameter],
}

/// A row and its derivatives: by the state at the start, by the time, by each parameter.
struct RowAt<T> {
    value: T,
    by_state: [T; STATE],
    by_time: T,
    by_parameters: Vec<T>,
}

/// The flow of a segment up to a time, with derivatives.
struct Reached<T> {
    end: Vector<T>,
    rate: Vector<T>,
    by_state: Vec<[T; STATE]>,
    by_parameters: Vec<Vector<T>>,
}

impl<T: Real> Reached<T> {
    fn row(&self, row: &Vector<T>, row_by_parameters: &[Vector<T>]) -> RowAt<T> {
        let by_state = std::array::from_fn(|k| (0..N).fold(T::of(0.0), |sum, n| sum + row[n] * self.by_state[n][k]));
        let by_parameters = row_by_parameters
            .iter()
            .zip(&self.by_parameters)
            .map(|(change, moved)| dot(change, &self.end) + dot(row, moved))
            .collect();
        RowAt { value: dot(row, &self.end), by_state, by_time: dot(row, &self.rate), by_parameters }
    }
}

impl BoundaryProblem<'_> {
    /// Number of unknowns and of equations.
    #[must_use]
    pub fn len(&self) -> usize {
        UNKNOWNS * self.sequence.segments.len()
    }

    /// The settings of the parameters.
    #[must_use]
    pub fn settings<T: Copy>(&self, values: &[T]) -> Vec<(Parameter, T)> {
        self.parameters.iter().copied().zip(values.iter().copied()).collect()
    }

    fn reach<T: Real>(&self, n: usize, state: &[T], time: T, settings: &[(Parameter, T)]) -> Reached<T> {
        let phase = &self.sequence.segments[n].phase;
        let start = complete(state);
        let a = self.system.equations(settings).matrix(phase);
        let mut flow = None;
        let mut by_parameters = Vec::with_capacity(settings.len());
        for along in 0..settings.len() {
            let a = self.system.equations_along(settings, along).matrix(phase);
            let moved = exponential(&a, Dual::constant(time));
            by_parameters.push(std::array::from_fn(|row| {
                (0..N).fold(T::of(0.0), |sum, k| sum + moved[row][k].slope * start[k])
            }));
            flow.get_or_insert_with(|| moved.map(|row| row.map(|entry| entry.value)));
        }
        let flow = flow.unwrap_or_else(|| exponential(&a, time));
        let end = times(&flow, &start);
        Reached { rate: times(&a, &end), by_state: by_state(&flow, &start), end, by_parameters }
    }

    /// Residual and derivatives. `twist` multiplies the images in the last segment: 1 for a periodic orbit, −1 for the
    /// disturbances that change sign after it.
    #[must_use]
    pub fn linearise<T: Real>(&self, unknowns: &[T], values: &[T], twist: f64) -> Linearised<T> {
        let settings = self.settings(values);
        let equations = self.system.equations(&settings);
        let along: Vec<_> = (0..values.len()).map(|k| self.system.equations_along(&settings, k)).collect();
        let (count, size) = (self.sequence.segments.len(), self.len());
        let zero = T::of(0.0);
        let mut residual = vec![zero; size];
        let mut by_unknowns = vec![vec![zero; size]; size];
        let mut by_parameters = vec![vec![zero; size]; values.len()];
        for (n, segment) in self.sequence.segments.iter().enumerate() {
            let own = UNKNOWNS * n;
            let after = UNKNOWNS * ((n + 1) % count);
            let is_last = n + 1 == count;
            let sign = T::of(if is_last { twist } else { 1.0 });
            let reached = self.reach(n, &unknowns[own..own + STATE], unknowns[own + STATE], &settings);
            let next = self.sequence.next(n);
            let reset = equations.reset(segment.end, next, &reached.end);
            let end = reached.end.map(Dual::constant);
            let resets: Vec<_> = along.iter().map(|along| along.reset(segment.end, next, &end)).collect();
            for k in 0..STATE {
                let changes: Vec<Vector<T>> = resets.iter().map(|reset| reset[k].map(|entry| entry.slope)).collect();
                let image = reached.row(&reset[k], &changes);
                let row = own + k;
                residual[row] = unknowns[after + k] - image.value;
                if k == PHASE && is_last {
                    let turns = T::of(std::f64::consts::TAU * f64::from(self.sequence.periods));
                    residual[row] = residual[row] + turns;
                }
                by_unknowns[row][after + k] = by_unknowns[row][after + k] + T::of(1.0);
                for j in 0..STATE {
                    by_unknowns[row][own + j] = by_unknowns[row][own + j] - sign * image.by_state[j];
                }
                by_unknowns[row][own + STATE] = by_unknowns[row][own + STATE] - sign * image.by_time;
                for (p, slope) in image.by_parameters.iter().enumerate() {
                    by_parameters[p][row] = -(sign * *slope);
                }
            }
            let guard = equations.guard(&segment.phase, segment.end);
            let changes = self.guard_changes(&along, n, segment.end, false);
            let guard = reached.row(&guard, &changes);
            let row = own + STATE;
            residual[row] = guard.value;
            by_unknowns[row][own..own + STATE].copy_from_slice(&guard.by_state);
            by_unknowns[row][own + STATE] = guard.by_time;
            for (p, slope) in guard.by_parameters.iter().enumerate() {
                by_parameters[p][row] = *slope;
            }
        }
        Linearised { residual, by_unknowns, by_parameters }
    }

    /// How the row of a guard, or of its rate, changes with each parameter.
    fn guard_changes<T: Real>(
        &self,
        along: &[crate::equations::Equations<Dual<T>>],
        n: usize,
        guard: Guard,
        is_rate: bool,
    ) -> Vec<Vector<T>> {
        let phase = &self.sequence.segments[n].phase;
        along
            .iter()
            .map(|along| {
                let row = along.guard(phase, guard);
                let row = if is_rate { along.rate(&row, phase) } else { row };
                row.map(|entry| entry.slope)
            })
            .collect()
    }

    /// The value of a condition at `time` (used inside a segment), and its gradient by the unknowns, the parameters and the
    /// time.
    #[must_use]
    pub fn condition(
        &self,
        condition: Condition,
        unknowns: &[f64],
        values: &[f64],
        time: f64,
    ) -> (f64, DVector<f64>, Vec<f64>, f64) {
        let mut gradient = DVector::zeros(self.len());
        let (n, guard, when, is_rate) = match condition {
            Condition::Zero(n, guard, when) => (n, guard, when, false),
            Condition::Flat(n, guard, when) => (n, guard, when, true),
            Condition::Empty(n) => {
                let place = UNKNOWNS * n + STATE;
                gradient[place] = 1.0;
                return (unknowns[place], gradient, vec![0.0; values.len()], 0.0);
            }
        };
        let settings = self.settings(values);
        let equations = self.system.equations(&settings);
        let along: Vec<_> = (0..values.len()).map(|k| self.system.equations_along(&settings, k)).collect();
        let own = UNKNOWNS * n;
        let at = match when {
            When::Start => 0.0,
            When::End => unknowns[own + STATE],
            When::Inside => time,
        };
        let reached = self.reach(n, &unknowns[own..own + STATE], at, &settings);
        let phase = &self.sequence.segments[n].phase;
        let row = equations.guard(phase, guard);
        let row = if is_rate { equations.rate(&row, phase) } else { row };
        let found = reached.row(&row, &self.guard_changes(&along, n, guard, is_rate));
        for k in 0..STATE {
            gradient[own + k] = found.by_state[k];
        }
        let mut by_time = 0.0;
        match when {
            When::Start => {}
            When::End => gradient[own + STATE] = found.by_time,
            When::Inside => by_time = found.by_time,
        }
        (found.value, gradient, found.by_parameters, by_time)
    }

    /// The derivative of one return in the states at the start of the first segment: its eigenvalues are the Floquet
    /// multipliers, and one zero for the direction of the motion.
    #[must_use]
    pub fn transition(&self, unknowns: &[f64], values: &[f64]) -> DMatrix<f64> {
        let settings = self.settings(values);
        let equations = self.system.equations(&settings);
        let mut product = DMatrix::identity(STATE, STATE);
        for (n, segment) in self.sequence.segments.iter().enumerate() {
            let own = UNKNOWNS * n;
            let start = complete(&unknowns[own..own + STATE]);
            let a = equations.matrix(&segment.phase);
            let guard = equations.guard(&segment.phase, segment.end);
            let reset = |end: &Vector<f64>| equations.reset(segment.end, self.sequence.next(n), end);
            product = Passage::new(&a, &start, unknowns[own + STATE], &guard, reset).matrix * product;
        }
        product
    }

    /// The completed states of a segment at equal steps, with its end, and the matrix of its mode.
    pub(crate) fn samples(
        &self,
        n: usize,
        unknowns: &[f64],
        settings: &[(Parameter, f64)],
        most_step: f64,
    ) -> (f64, Vec<Vector<f64>>, Square<f64>) {
        let own = UNKNOWNS * n;
        let duration = unknowns[own + STATE];
        let phase = &self.sequence.segments[n].phase;
        let a = self.system.equations(settings).matrix(phase);
        let count = steps(&a, duration, most_step);
        let step = duration / count as f64;
        let one = exponential(&a, step);
        let mut states = vec![complete(&unknowns[own..own + STATE])];
        for n in 0..count {
            states.push(times(&one, &states[n]));
        }
        (step, states, a)
    }

    /// Rates of a row: the row, its rate and so on, for the Taylor series.
    pub(crate) fn rates(row: &Vector<f64>, a: &Square<f64>, order: usize) -> Vec<Vector<f64>> {
        let mut rows = vec![*row];
        for n in 0..order {
            rows.push(row_times(&rows[n], a));
        }
        rows
    }
}

/// The eigenvalues of a transition matrix; infinite where it is not finite, as at a grazing.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let is_finite = matrix.iter().all(|entry| entry.is_finite());
    let schur = if is_finite { Schur::try_new(matrix.clone(), f64::EPSILON, MAX_SWEEPS) } else { None };
    schur.map_or_else(
        || vec![Complex::new(f64::INFINITY, 0.0); matrix.nrows()],
        |schur| schur.complex_eigenvalues().iter().copied().collect(),
    )
}

/// Most sweeps of the eigenvalue iteration.
const MAX_SWEEPS: usize = 1_000;
