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
    /// Its derivatives from the fourth on, and whether one may not be zero: few are no cubics, and every step evaluates some.
    higher: [f64; ORDERS - 4],
    is_higher: bool,
}

impl Polynomial {
    /// The same with `factor` times another.
    #[inline]
    pub fn with(self, factor: f64, other: Self) -> Self {
        if other.is_higher {
            return self + factor * other;
        }
        Self {
            value: self.value + factor * other.value,
            slope: self.slope + factor * other.slope,
            bend: self.bend + factor * other.bend,
            jerk: self.jerk + factor * other.jerk,
            ..self
        }
    }

    pub fn constant(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    /// From its derivatives at zero, the value first.
    pub fn of([value, slope, bend, jerk, higher @ ..]: [f64; ORDERS]) -> Self {
        Self { value, slope, bend, jerk, higher, is_higher: higher != [0.0; ORDERS - 4] }
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
        !self.is_higher
    }

    /// Value and slope at t.
    #[inline]
    pub fn at(&self, t: f64) -> Here {
        if !self.is_cubic() {
            return Here { value: self.taylor(0, t), slope: self.taylor(1, t) };
        }
        Here {
            value: self.value + t * (self.slope + 0.5 * t * (self.bend + t * self.jerk * (1.0 / 3.0))),
            slope: self.slope + t * (self.bend + 0.5 * t * self.jerk),
        }
    }

    /// A derivative at t, where it is no cubic.
    #[cold]
    fn taylor(self, order: usize, t: f64) -> f64 {
        taylor(&self.derivatives()[order..], t)
    }

    /// Second derivative at t.
    #[inline]
    pub fn bend_at(&self, t: f64) -> f64 {
        if self.is_cubic() { self.bend + t * self.jerk } else { self.taylor(2, t) }
    }

    /// Its derivative.
    pub fn rate(&self) -> Self {
        if self.is_cubic() {
            return Self { value: self.slope, slope: self.bend, bend: self.jerk, ..Self::default() };
        }
        let [_, rates @ ..] = self.derivatives();
        let mut all = [0.0; ORDERS];
        all[..ORDERS - 1].copy_from_slice(&rates);
        Self::of(all)
    }

    /// The same with its origin `t` later.
    #[inline]
    pub fn after(&self, t: f64) -> Self {
        if self.is_cubic() {
            let Here { value, slope } = self.at(t);
            return Self { value, slope, bend: self.bend_at(t), ..*self };
        }
        let mut later = [0.0; ORDERS];
        later.iter_mut().enumerate().for_each(|(order, to)| *to = self.taylor(order, t));
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
    #[inline]
    pub fn is_constant(&self) -> bool {
        self.slope == 0.0 && self.bend == 0.0 && self.jerk == 0.0 && self.is_cubic()
    }

    /// The size of its terms up to time `t`.
    pub fn size(&self, t: f64) -> f64 {
        if !self.is_cubic() {
            return self.size_of(0, t);
        }
        let [value, slope, bend, jerk] = [self.value, self.slope, self.bend, self.jerk].map(f64::abs);
        value + t * (slope + 0.5 * t * (bend + t * jerk * (1.0 / 3.0)))
    }

    /// Bound of a derivative up to time `t`.
    #[inline]
    pub fn most(&self, order: usize, t: f64) -> f64 {
        match order {
            3 if self.is_cubic() => self.jerk.abs(),
            4.. if self.is_cubic() => 0.0,
            0..ORDERS => self.size_of(order, t),
            _ => 0.0,
        }
    }

    /// The size of the terms of a derivative up to time `t`.
    #[cold]
    fn size_of(self, order: usize, t: f64) -> f64 {
        taylor(&self.derivatives().map(f64::abs)[order..], t)
    }
}

/// Σ dₖ tᵏ/k!.
fn taylor(derivatives: &[f64], t: f64) -> f64 {
    derivatives.iter().enumerate().rev().fold(0.0, |sum, (k, of)| of + sum * t / (k + 1) as f64)
}

impl Add for Polynomial {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let mut sum = Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
            bend: self.bend + other.bend,
            jerk: self.jerk + other.jerk,
            ..self
        };
        if other.is_higher {
            sum.higher.iter_mut().zip(other.higher).for_each(|(sum, more)| *sum += more);
            sum.is_higher = true;
        }
        sum
    }
}

impl Mul<Polynomial> for f64 {
    type Output = Polynomial;

    #[inline]
    fn mul(self, of: Polynomial) -> Polynomial {
        let (value, slope, bend, jerk) = (self * of.value, self * of.slope, self * of.bend, self * of.jerk);
        let higher = if of.is_higher { of.higher.map(|derivative| self * derivative) } else { of.higher };
        Polynomial { value, slope, bend, jerk, higher, ..of }
    }
}
