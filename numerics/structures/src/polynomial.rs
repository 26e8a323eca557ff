//! Polynomials in time: the parts of a motion that are no exponentials. Cubics, but for pieces of a contact with a Hertz wall.

use std::ops::{Add, Mul};

use crate::events::Few;
use crate::guard::Here;

/// Derivatives that are kept, the value among them.
pub(crate) const ORDERS: usize = 8;

/// `value + slope t + bend t²/2 + jerk t³/6`, and higher powers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Polynomial {
    pub value: f64,
    pub slope: f64,
    pub bend: f64,
    pub jerk: f64,
    /// Its derivatives from the fourth on.
    pub higher: [f64; ORDERS - 4],
}

impl Polynomial {
    pub fn constant(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    /// From its derivatives at zero, the value first.
    pub fn of([value, slope, bend, jerk, higher @ ..]: [f64; ORDERS]) -> Self {
        Self { value, slope, bend, jerk, higher }
    }

    /// Σ cₖ tᵏ.
    pub fn of_powers([c0, c1, c2, c3]: [f64; 4]) -> Self {
        Self { value: c0, slope: c1, bend: 2.0 * c2, jerk: 6.0 * c3, ..Self::default() }
    }

    /// Its derivatives at zero, the value first.
    pub fn derivatives(&self) -> [f64; ORDERS] {
        let mut all = [self.value, self.slope, self.bend, self.jerk, 0.0, 0.0, 0.0, 0.0];
        all[4..].copy_from_slice(&self.higher);
        all
    }

    /// Its derivative of this order at zero; of order 0 its value.
    pub fn derivative(&self, order: usize) -> f64 {
        self.derivatives().get(order).copied().unwrap_or(0.0)
    }

    #[inline]
    pub fn is_cubic(&self) -> bool {
        self.higher == [0.0; ORDERS - 4]
    }

    /// Value and slope at t.
    #[inline]
    pub fn at(&self, t: f64) -> Here {
        if !self.is_cubic() {
            let all = self.derivatives();
            return Here { value: taylor(&all, t), slope: taylor(&all[1..], t) };
        }
        Here {
            value: self.value + t * (self.slope + 0.5 * t * (self.bend + t * self.jerk * (1.0 / 3.0))),
            slope: self.slope + t * (self.bend + 0.5 * t * self.jerk),
        }
    }

    /// Second derivative at t.
    pub fn bend_at(&self, t: f64) -> f64 {
        if self.is_cubic() { self.bend + t * self.jerk } else { taylor(&self.derivatives()[2..], t) }
    }

    /// Its derivative.
    pub fn rate(&self) -> Self {
        let [fourth, fifth, sixth, seventh] = self.higher;
        let higher = [fifth, sixth, seventh, 0.0];
        Self { value: self.slope, slope: self.bend, bend: self.jerk, jerk: fourth, higher }
    }

    /// The same with its origin `t` later.
    pub fn after(&self, t: f64) -> Self {
        if self.is_cubic() {
            let Here { value, slope } = self.at(t);
            return Self { value, slope, bend: self.bend_at(t), ..*self };
        }
        let all = self.derivatives();
        let mut later = [0.0; ORDERS];
        later.iter_mut().enumerate().for_each(|(order, to)| *to = taylor(&all[order..], t));
        Self::of(later)
    }

    /// Coefficients of the powers of `s = t/h`, up to the highest that may not be zero.
    pub fn powers(&self, h: f64) -> Few<f64> {
        let count = if self.is_constant() {
            1
        } else if self.is_cubic() {
            4
        } else {
            ORDERS
        };
        let mut powers: Few<f64> = self.derivatives()[..count].into();
        let mut factor = 1.0;
        for (k, power) in powers.iter_mut().enumerate().skip(1) {
            factor *= h / k as f64;
            *power *= factor;
        }
        powers
    }

    /// Whether it is a constant.
    pub fn is_constant(&self) -> bool {
        self.slope == 0.0 && self.bend == 0.0 && self.jerk == 0.0 && self.is_cubic()
    }

    /// The size of its terms up to time `t`.
    pub fn size(&self, t: f64) -> f64 {
        let [value, slope, bend, jerk, ..] = self.derivatives().map(f64::abs);
        let size = value + t * (slope + 0.5 * t * (bend + t * jerk * (1.0 / 3.0)));
        if self.is_cubic() { size } else { self.most(0, t) }
    }

    /// Bound of a derivative up to time `t`.
    #[inline]
    pub fn most(&self, order: usize, t: f64) -> f64 {
        match order {
            3 if self.is_cubic() => self.jerk.abs(),
            4.. if self.is_cubic() => 0.0,
            0..ORDERS => taylor(&self.derivatives().map(f64::abs)[order..], t),
            _ => 0.0,
        }
    }
}

/// Σ dₖ tᵏ/k!.
fn taylor(derivatives: &[f64], t: f64) -> f64 {
    derivatives.iter().enumerate().rev().fold(0.0, |sum, (k, of)| of + sum * t / (k + 1) as f64)
}

impl Add for Polynomial {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let mut higher = self.higher;
        higher.iter_mut().zip(other.higher).for_each(|(sum, more)| *sum += more);
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
            bend: self.bend + other.bend,
            jerk: self.jerk + other.jerk,
            higher,
        }
    }
}

impl Mul<Polynomial> for f64 {
    type Output = Polynomial;

    fn mul(self, of: Polynomial) -> Polynomial {
        Polynomial {
            value: self * of.value,
            slope: self * of.slope,
            bend: self * of.bend,
            jerk: self * of.jerk,
            higher: of.higher.map(|derivative| self * derivative),
        }
    }
}
