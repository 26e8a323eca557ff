//! The forces of Hertz walls over a piece: cubics that have the law's force at Gauss's four instants of the motion under them.
//!
//! Displacements and velocities depend linearly on the forces; Newton's method finds those of all contacts together.

use nalgebra::{DMatrix, DVector};

use crate::events::Few;
use crate::linear::C64;
use crate::motion::Motion;
use crate::polynomial::Polynomial;
use crate::push::{POWERS, at};
use crate::squeeze::Squeeze;
use crate::system::{System, Watched};

/// What the error of a piece counts in which a contact ends.
const PARTING: f64 = 10.0;

/// Newton's steps after which a piece is halved.
const MAX_NEWTON_STEPS: u32 = 12;

/// Last change of a force in Newton's method, relative to what the error may be, and to the force.
const CONVERGED: [f64; 2] = [1e-6, 1e-13];

/// Gauss's instants of a piece, as fractions of it, and three at which the force is compared with the law.
const INSTANTS: [f64; 7] = [
    0.069_431_844_202_973_71,
    0.330_009_478_207_571_87,
    0.669_990_521_792_428_1,
    0.930_568_155_797_026_3,
    0.0,
    0.5,
    1.0,
];

/// The instants at the ends.
pub(crate) const BEGIN: usize = 4;
const LAST: usize = 6;

/// δ and δ′.
pub(crate) type Depth = [f64; 2];

/// A force as Σ cₖ sᵏ of the fraction s of the piece, N.
pub(crate) type Powers = [f64; POWERS];

/// A contact whose force changes.
pub(crate) struct Sliding<'a> {
    pub particle: usize,
    pub mass_kg: f64,
    /// That of the penetration.
    pub guard: &'a Watched,
    /// z′ of the natural motions per force.
    pub natural: &'a [C64],
    pub squeeze: &'a Squeeze,
    /// Whether it has no force ([`Squeeze::is_faint`]).
    pub is_faint: bool,
    /// δ without the forces, but for natural motions.
    pub polynomial: Polynomial,
    /// Rounding of δ, m.
    pub rounding_m: f64,
}

/// What the contacts are over a piece: without their forces, and per power of time of each force, at every instant.
pub(crate) struct Moved {
    pub alone: Vec<[Depth; INSTANTS.len()]>,
    per_power: Vec<Vec<[[Depth; POWERS]; INSTANTS.len()]>>,
    /// The powers of a cubic per value at Gauss's instants.
    powers_of: [Powers; POWERS],
}

impl Motion {
    pub(crate) fn moved(&self, system: &System, sliding: &[Sliding], length_s: f64) -> Moved {
        let rates = &system.linear.natural.rates;
        let mut moved = Moved {
            alone: vec![Default::default(); sliding.len()],
            per_power: vec![vec![Default::default(); sliding.len()]; sliding.len()],
            powers_of: powers_of_values(),
        };
        let mut ahead: Few<C64> = Few::new();
        let mut solved: Few<[C64; POWERS]> = Few::new();
        for (i, s) in INSTANTS.into_iter().enumerate() {
            ahead.clear();
            solved.clear();
            for (z, rate) in self.z.iter().zip(rates) {
                let turned = (rate * (s * length_s)).exp();
                ahead.push(z * turned);
                solved.push(at(rate * length_s, s, turned));
            }
            for (b, of) in sliding.iter().enumerate() {
                let here = of.guard.guard.at(&ahead, ahead.len(), of.polynomial.at(s * length_s));
                moved.alone[b][i] = [here.value, here.slope];
                for (c, by) in sliding.iter().enumerate() {
                    let depths = &mut moved.per_power[b][c][i];
                    let natural = of.guard.guard.coefficients.iter().zip(by.natural).zip(rates.iter().zip(&solved));
                    for ((coefficient, load), (rate, solved)) in natural {
                        let share = coefficient * load * length_s;
                        if share != C64::ZERO {
                            for (depth, solved) in depths.iter_mut().zip(solved) {
                                let more = share * solved;
                                depth[0] += more.re;
                                depth[1] += (rate * more).re;
                            }
                        }
                    }
                    if b == c {
                        // The particle's own flight under sᵏ.
                        let mut rise = length_s / of.mass_kg;
                        for (k, depth) in depths.iter_mut().enumerate() {
                            rise *= s;
                            let slope = rise / (k + 1) as f64;
                            depth[1] -= slope;
                            depth[0] -= slope * s * length_s / (k + 2) as f64;
                        }
                    }
                }
            }
        }
        moved
    }

    /// The forces of all contacts as powers of the fraction of the piece, and the largest error relative to what is allowed; `None` if Newton's method
    /// does not converge.
    pub(crate) fn forces(&self, sliding: &[Sliding], moved: &Moved, length_s: f64) -> Option<(Vec<Powers>, f64)> {
        let allowed_n = |of: &Sliding| of.squeeze.allowed_n_s(self.piece.tolerance) / length_s;
        let first_n = |row: usize| {
            let (b, of) = (row / POWERS, &sliding[row / POWERS]);
            if of.is_faint { 0.0 } else { of.squeeze.law(moved.alone[b][BEGIN]).0 }
        };
        let mut values = DVector::from_fn(POWERS * sliding.len(), |row, _| first_n(row));
        for _ in 0..MAX_NEWTON_STEPS {
            let (change, rounding_n) = moved.newton_step(sliding, &values)?;
            values += &change;
            let [of_error, of_force] = CONVERGED;
            let most_n = values.amax();
            let is_small = |(row, change): (usize, &f64)| {
                let allowed_n = allowed_n(&sliding[row / POWERS]);
                change.abs() <= (of_error * allowed_n).max(of_force * most_n).max(rounding_n[row])
            };
            if !change.iter().all(|change| change.is_finite()) {
                return None;
            }
            if change.iter().enumerate().all(is_small) {
                let forces = moved.powers(&values);
                let error = |(b, of): (usize, &Sliding)| moved.error_n(of, b, &forces) / allowed_n(of);
                let error = sliding.iter().enumerate().map(error).fold(0.0, f64::max);
                return Some((forces, error));
            }
        }
        None
    }
}

impl Moved {
    /// The powers of the forces with these values at Gauss's instants.
    fn powers(&self, values: &DVector<f64>) -> Vec<Powers> {
        let of = |b: usize| self.powers_of.map(|row| (0..POWERS).map(|n| row[n] * values[b * POWERS + n]).sum());
        (0..self.alone.len()).map(of).collect()
    }

    /// δ and δ′ of a contact at an instant under these forces.
    fn depth(&self, b: usize, i: usize, forces: &[Powers]) -> Depth {
        let mut depth = self.alone[b][i];
        for (per_power, force) in self.per_power[b].iter().zip(forces) {
            for (per, power) in per_power[i].iter().zip(force) {
                depth = [depth[0] + per[0] * power, depth[1] + per[1] * power];
            }
        }
        depth
    }

    /// The change of the forces at Gauss's instants towards those of the law, and the rounding of each.
    fn newton_step(&self, sliding: &[Sliding], values: &DVector<f64>) -> Option<(DVector<f64>, Few<f64>)> {
        let (count, forces) = (values.len(), self.powers(values));
        let mut jacobian = DMatrix::identity(count, count);
        let mut off = DVector::zeros(count);
        let mut rounding_n: Few<f64> = Few::new();
        for row in 0..count {
            let (b, i) = (row / POWERS, row % POWERS);
            if sliding[b].is_faint {
                rounding_n.push(0.0);
                continue;
            }
            let (force, [by_depth, by_rate]) = sliding[b].squeeze.law(self.depth(b, i, &forces));
            off[row] = force - values[row];
            rounding_n.push(sliding[b].rounding_m * by_depth);
            for column in 0..count {
                let (c, n) = (column / POWERS, column % POWERS);
                let per_power = &self.per_power[b][c][i];
                let by = |which: usize| (0..POWERS).map(|k| per_power[k][which] * self.powers_of[k][n]).sum::<f64>();
                jacobian[(row, column)] -= by_depth * by(0) + by_rate * by(1);
            }
        }
        Some((jacobian.lu().solve(&off)?, rounding_n))
    }

    /// What the cubic of a contact is off by in the piece, beyond rounding.
    fn error_n(&self, of: &Sliding, b: usize, forces: &[Powers]) -> f64 {
        let off = |i: usize| {
            let cubic = forces[b].iter().rev().fold(0.0, |sum, power| sum * INSTANTS[i] + power);
            let (force, [by_depth, _]) = of.squeeze.law(self.depth(b, i, forces));
            ((cubic - force).abs() - of.rounding_m * by_depth).max(0.0)
        };
        let parts = if self.depth(b, LAST, forces)[0] <= 0.0 { PARTING } else { 1.0 };
        // Without a force it is off at Gauss's instants too.
        let first = if of.is_faint { 0 } else { POWERS };
        parts * (first..INSTANTS.len()).map(off).fold(0.0, f64::max)
    }
}

/// The powers of the cubic through values at Gauss's instants: per power and value.
fn powers_of_values() -> [Powers; POWERS] {
    let mut powers_of = [[0.0; POWERS]; POWERS];
    for n in 0..POWERS {
        // Lagrange's polynomial of the value.
        let (mut polynomial, mut degree) = ([1.0, 0.0, 0.0, 0.0], 0);
        for other in (0..POWERS).filter(|other| *other != n) {
            let gap = INSTANTS[n] - INSTANTS[other];
            degree += 1;
            for k in (0..=degree).rev() {
                let below = if k > 0 { polynomial[k - 1] } else { 0.0 };
                polynomial[k] = (below - INSTANTS[other] * polynomial[k]) / gap;
            }
        }
        for (row, power) in powers_of.iter_mut().zip(polynomial) {
            row[n] = power;
        }
    }
    powers_of
}
