//! Forces that are cubics in time over a piece, and what the natural motions do under them: `z′ = λ z + l(t)` with a cubic l.
//!
//! A natural motion that turns far in the piece has the exact solution that is a cubic itself. Of a slow one this would be larger than the motion by
//! (λh)⁻⁴: it has the power series from z = 0 instead, up to [`ORDERS`].

use crate::linear::C64;
use crate::polynomial::{ORDERS, Polynomial};

/// |λ|h up to which a natural motion is slow: what its series leaves out there is as large as the rounding of the exact solution, 10⁻¹⁰ of h·l where l is
/// mainly its cubic power. In a piece of a contact that power is small.
const SLOW: f64 = 0.04;

/// Powers of time that a force has: 1, t, t² and t³.
pub(crate) const POWERS: usize = 4;

/// A force along a row of the bodies.
#[derive(Clone, Debug)]
pub(crate) struct Push {
    /// On each body per force.
    pub row: Vec<f64>,
    /// z′ of each natural motion per force.
    pub natural: Vec<C64>,
    /// Acceleration against the row per force, 1/kg.
    pub compliance: f64,
}

/// Derivatives at zero of a solution of z′ = λ z + l over a piece of this length.
pub(crate) fn response(rate: C64, load: C64, force: &Polynomial, length_s: f64) -> [C64; ORDERS] {
    let force = force.derivatives();
    let mut z = [C64::ZERO; ORDERS];
    if rate.norm() * length_s <= SLOW {
        for n in 1..ORDERS {
            z[n] = rate * z[n - 1] + load * if n <= POWERS { force[n - 1] } else { 0.0 };
        }
    } else {
        for n in (0..POWERS).rev() {
            z[n] = (z[n + 1] - load * force[n]) / rate;
        }
    }
    z
}

/// z/h at s·h from z = 0 under the loads 1, s, s² and s³ with this λh; `turned` is e^{λsh}.
pub(crate) fn at(turn: C64, s: f64, turned: C64) -> [C64; POWERS] {
    // Σ xⁿ⁻ᵐ sⁿ/n! from n = m on, for m from 1 on.
    let mut sums = [C64::ZERO; ORDERS];
    let mut power = [1.0; ORDERS];
    for m in 1..ORDERS {
        power[m] = power[m - 1] * s / m as f64;
    }
    if turn.norm() <= SLOW {
        for m in (1..ORDERS).rev() {
            sums[m] = turn * if m + 1 < ORDERS { sums[m + 1] } else { C64::ZERO } + power[m];
        }
    } else {
        sums[0] = turned;
        for m in 1..=POWERS {
            sums[m] = (sums[m - 1] - power[m - 1]) / turn;
        }
    }
    [sums[1], sums[2], sums[3] * 2.0, sums[4] * 6.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against 2000 steps of the midpoint rule, whose error is 10⁻⁷, on both sides of where natural motions become slow.
    #[test]
    fn slow_and_fast_natural_motions_follow_their_loads() {
        let h = 0.3;
        let force = Polynomial::of([0.7, -1.1, 3.0, 40.0, 0.0, 0.0, 0.0, 0.0]);
        let load = C64::new(0.2, 1.3);
        for turn in [C64::new(-1e-3, 0.01), C64::new(-1e-3, 0.0399), C64::new(-1e-3, 0.0401), C64::new(-0.2, 3.0)] {
            let rate = turn / h;
            let steps = 2000;
            let mut z = C64::ZERO;
            for n in 0..steps {
                let (from, dt) = (h * f64::from(n) / f64::from(steps), h / f64::from(steps));
                let middle = (z + (rate * z + load * force.at(from).value) * (0.5 * dt), from + 0.5 * dt);
                z += (rate * middle.0 + load * force.at(middle.1).value) * dt;
            }
            let turned = turn.exp();
            let solution = response(rate, load, &force, h);
            let value = (0..ORDERS).rev().fold(C64::ZERO, |sum, n| solution[n] + sum * h / (n + 1) as f64);
            let from_zero = value - solution[0] * turned;
            assert!((from_zero - z).norm() < 1e-6 * z.norm(), "{turn}: {from_zero} {z}");
            let powers = force.powers(h);
            let sum: C64 = at(turn, 1.0, turned).iter().zip(&powers).map(|(at, power)| load * at * *power * h).sum();
            assert!((sum - from_zero).norm() < 1e-9 * z.norm(), "{turn}: {sum} {from_zero}");
        }
    }
}
