//! The convex problem of contacts at one instant: which joints stick, and the impulses of impacts.

use nalgebra::{DMatrix, DVector};

/// Force or impulse of a joint within its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    pub low: f64,
    pub high: f64,
}

/// Where the solution of one joint lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum At {
    /// At the lower limit: the relative acceleration is 0 or greater.
    Low,
    /// Between the limits: the relative acceleration is 0.
    Inside,
    /// At the upper limit: the relative acceleration is 0 or less.
    High,
}

/// Pivots after which the problem counts as unsolved.
const MAX_PIVOTS: usize = 10_000;

/// Solves `a = a₀ + W λ` with λ within its limits: a joint strictly within them has a = 0, one at its lower limit a ≥ 0, one at its
/// upper limit a ≤ 0. W is symmetric and positive definite, so that the solution is unique.
///
/// Pivots by the least index that violates its condition, which ends for such a W (Murty 1974; Júdice and Pires 1992 for two
/// limits). `tolerance` is the rounding of each a. Returns λ and where each lies; `None` if W is singular.
pub(crate) fn solve(w: &DMatrix<f64>, a0: &[f64], limits: &[Limits], tolerance: &[f64]) -> Option<(Vec<f64>, Vec<At>)> {
    let n = a0.len();
    let mut at: Vec<At> = vec![At::Inside; n];
    for _ in 0..MAX_PIVOTS {
        let force = forces(w, a0, limits, &at)?;
        let violated = (0..n).find_map(|i| {
            let rounding = tolerance[i] / w[(i, i)];
            let a = || a0[i] + (0..n).map(|j| w[(i, j)] * force[j]).sum::<f64>();
            match at[i] {
                At::Inside if force[i] < limits[i].low - rounding => Some((i, At::Low)),
                At::Inside if force[i] > limits[i].high + rounding => Some((i, At::High)),
                At::Low if a() < -tolerance[i] => Some((i, At::Inside)),
                At::High if a() > tolerance[i] => Some((i, At::Inside)),
                _ => None,
            }
        });
        match violated {
            Some((i, to)) => at[i] = to,
            None => return Some((force, at)),
        }
    }
    None
}

/// The forces when each joint is at its place.
fn forces(w: &DMatrix<f64>, a0: &[f64], limits: &[Limits], at: &[At]) -> Option<Vec<f64>> {
    let n = a0.len();
    let mut force: Vec<f64> = (0..n)
        .map(|i| match at[i] {
            At::Low => limits[i].low,
            At::High => limits[i].high,
            At::Inside => 0.0,
        })
        .collect();
    let inside: Vec<usize> = (0..n).filter(|&i| at[i] == At::Inside).collect();
    if inside.is_empty() {
        return Some(force);
    }
    let matrix = DMatrix::from_fn(inside.len(), inside.len(), |i, j| w[(inside[i], inside[j])]);
    let right = DVector::from_fn(inside.len(), |i, _| {
        -a0[inside[i]] - (0..n).map(|j| w[(inside[i], j)] * force[j]).sum::<f64>()
    });
    let solved = matrix.cholesky()?.solve(&right);
    for (value, &i) in solved.iter().zip(&inside) {
        force[i] = *value;
    }
    Some(force)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_of_random_problems_meets_its_conditions() {
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..2_000 {
            let n = rng.usize(1..6);
            let root = DMatrix::from_fn(n, n + 1, |_, _| rng.f64() - 0.5);
            let w = &root * root.transpose();
            let a0: Vec<f64> = (0..n).map(|_| rng.f64() * 4.0 - 2.0).collect();
            let limits: Vec<Limits> = (0..n)
                .map(|_| match rng.u8(0..3) {
                    0 => Limits { low: 0.0, high: f64::INFINITY },
                    1 => Limits { low: f64::NEG_INFINITY, high: rng.f64() },
                    _ => {
                        let high = rng.f64();
                        Limits { low: -high, high }
                    }
                })
                .collect();
            let (force, at) = solve(&w, &a0, &limits, &vec![1e-12; n]).expect("a solution");
            for i in 0..n {
                let a = a0[i] + (0..n).map(|j| w[(i, j)] * force[j]).sum::<f64>();
                let near = 1e-9 * (1.0 + force[i].abs());
                assert!(force[i] >= limits[i].low - near && force[i] <= limits[i].high + near);
                match at[i] {
                    At::Inside => assert!(a.abs() < 1e-9 * (1.0 + force.iter().map(|f| f.abs()).sum::<f64>()), "{a}"),
                    At::Low => assert!(a > -1e-9, "{a}"),
                    At::High => assert!(a < 1e-9, "{a}"),
                }
            }
        }
    }
}
