//! The motion within one mode, in closed form: w(t) = exp(A t) w(0).
//!
//! The state is completed by the drive's phase, its sine and cosine and the constant 1. In every mode the equations of
//! motion are then linear with a constant matrix.

use crate::dual::Real;

/// Length of the completed state.
pub const N: usize = 8;

/// Length of the state: x, x′, y − x, y′ − x′ and the drive's phase.
pub const STATE: usize = 5;

/// Places in the completed state.
pub mod place {
    /// x.
    pub const X: usize = 0;
    /// x′.
    pub const V: usize = 1;
    /// y − x.
    pub const OFFSET: usize = 2;
    /// y′ − x′.
    pub const SLIDE: usize = 3;
    /// Phase of the drive, rad.
    pub const PHASE: usize = 4;
    /// Its sine.
    pub const SINE: usize = 5;
    /// Its cosine.
    pub const COSINE: usize = 6;
    /// The constant 1.
    pub const ONE: usize = 7;
}

/// A completed state, or a row that is multiplied with one.
pub type Vector<T> = [T; N];

/// A matrix of the completed state.
pub type Square<T> = [[T; N]; N];

/// Completes a state.
pub fn complete<T: Real>(state: &[T]) -> Vector<T> {
    let (sine, cosine) = state[place::PHASE].sin_cos();
    [state[0], state[1], state[2], state[3], state[4], sine, cosine, T::of(1.0)]
}

/// `row · column`.
pub fn dot<T: Real>(row: &Vector<T>, column: &Vector<T>) -> T {
    let mut sum = row[0] * column[0];
    for n in 1..N {
        sum = sum + row[n] * column[n];
    }
    sum
}

/// `matrix · column`.
pub fn times<T: Real>(matrix: &Square<T>, column: &Vector<T>) -> Vector<T> {
    std::array::from_fn(|row| dot(&matrix[row], column))
}

/// `row · matrix`.
pub fn row_times<T: Real>(row: &Vector<T>, matrix: &Square<T>) -> Vector<T> {
    let mut sums = [T::of(0.0); N];
    for (factor, line) in row.iter().zip(matrix) {
        for n in 0..N {
            sums[n] = sums[n] + *factor * line[n];
        }
    }
    sums
}

fn product<T: Real>(left: &Square<T>, right: &Square<T>) -> Square<T> {
    std::array::from_fn(|row| row_times(&left[row], right))
}

/// Derivatives of exp(A t)·complete(q) by the state q, from `flow` = exp(A t) and `start` = complete(q).
pub fn by_state<T: Real>(flow: &Square<T>, start: &Vector<T>) -> Vec<[T; STATE]> {
    use place::{COSINE, PHASE, SINE};
    flow.iter()
        .map(|row| {
            let phase = row[PHASE] + row[SINE] * start[COSINE] - row[COSINE] * start[SINE];
            [row[0], row[1], row[2], row[3], phase]
        })
        .collect()
}

/// Number of equal steps of a duration in each of which the fastest rate of a mode turns by at most `most_rad`.
pub fn steps(a: &Square<f64>, duration: f64, most_rad: f64) -> usize {
    use place::{OFFSET, ONE, PHASE, SLIDE, V, X};
    let fastest = [a[V][X], a[SLIDE][OFFSET]].map(|stiffness| libm::sqrt(stiffness.abs()));
    let fastest = fastest.into_iter().chain([a[SLIDE][SLIDE].abs(), a[PHASE][ONE], 1.0]).fold(0.0, f64::max);
    (duration.abs() * fastest / most_rad).ceil().clamp(4.0, 4_000.0) as usize
}

/// Terms of the exponential's series; at a norm of 1/2 the rest is below 10⁻¹⁷.
const TERMS: u32 = 14;

/// exp(A t), by its series at t/2ⁿ and n squarings.
pub fn exponential<T: Real>(a: &Square<T>, t: T) -> Square<T> {
    let columns = |n: usize| a.iter().map(|row| row[n].value().abs()).sum::<f64>();
    let norm = (0..N).map(columns).fold(0.0, f64::max) * t.value().abs();
    let mut halvings = 0;
    let mut share = 1.0;
    while norm * share > 0.5 && halvings < 60 {
        halvings += 1;
        share *= 0.5;
    }
    let step = t * T::of(share);
    let scaled: Square<T> = a.map(|row| row.map(|entry| entry * step));
    // Without the identity, so that a short step keeps its digits.
    let mut sum = scaled;
    for n in (2..=TERMS).rev() {
        // sum = A + A·sum/n, from the last term.
        let factor = T::of(1.0 / f64::from(n));
        let next = product(&scaled, &sum);
        sum = std::array::from_fn(|i| std::array::from_fn(|j| scaled[i][j] + next[i][j] * factor));
    }
    for _ in 0..halvings {
        // (1 + s)² − 1 = 2 s + s²
        let square = product(&sum, &sum);
        sum = std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] + sum[i][j] + square[i][j]));
    }
    for (n, row) in sum.iter_mut().enumerate() {
        row[n] = row[n] + T::of(1.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_of_a_damped_oscillator_is_its_closed_form() {
        let (omega, zeta, t) = (7.0, 0.05, 3.3);
        let mut a = [[0.0; N]; N];
        a[0][1] = 1.0;
        a[1][0] = -omega * omega;
        a[1][1] = -2.0 * zeta * omega;
        let e = exponential(&a, t);
        let ringing = omega * f64::sqrt(1.0 - zeta * zeta);
        let decay = f64::exp(-zeta * omega * t);
        let (sine, cosine) = (f64::sin(ringing * t), f64::cos(ringing * t));
        let expected = [
            [decay * (cosine + zeta * omega / ringing * sine), decay * sine / ringing],
            [-decay * omega * omega / ringing * sine, decay * (cosine - zeta * omega / ringing * sine)],
        ];
        // Ten squarings of a matrix of norm 7.
        for i in 0..2 {
            for j in 0..2 {
                assert!((e[i][j] - expected[i][j]).abs() < 7.0 * 1024.0 * f64::EPSILON, "{i} {j}");
            }
        }
        assert!((e[7][7] - 1.0).abs() < 1e-15);
    }
}
