//! Cubics in time: the parts of a motion that are no exponentials.

use std::ops::{Add, Mul};

use crate::guard::Here;

/// `value + slope t + bend t²/2 + jerk t³/6`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cubic {
    pub value: f64,
    pub slope: f64,
    pub bend: f64,
    pub jerk: f64,
}

impl Cubic {
    pub fn constant(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    /// From its derivatives at zero, the value first.
    pub fn of([value, slope, bend, jerk]: [f64; 4]) -> Self {
        Self { value, slope, bend, jerk }
    }

    /// Σ cₖ tᵏ.
    pub fn of_powers([c0, c1, c2, c3]: [f64; 4]) -> Self {
        Self { value: c0, slope: c1, bend: 2.0 * c2, jerk: 6.0 * c3 }
    }

    /// Its derivatives at zero, the value first.
    pub fn derivatives(&self) -> [f64; 4] {
        [self.value, self.slope, self.bend, self.jerk]
    }

    /// Its derivative of this order at zero; of order 0 its value.
    pub fn derivative(&self, order: usize) -> f64 {
        self.derivatives().get(order).copied().unwrap_or(0.0)
    }

    /// Value and slope at t.
    #[inline]
    pub fn at(&self, t: f64) -> Here {
        Here {
            value: self.value + t * (self.slope + 0.5 * t * (self.bend + t * self.jerk * (1.0 / 3.0))),
            slope: self.slope + t * (self.bend + 0.5 * t * self.jerk),
        }
    }

    /// Second derivative at t.
    pub fn bend_at(&self, t: f64) -> f64 {
        self.bend + t * self.jerk
    }

    /// Its derivative.
    pub fn rate(&self) -> Self {
        Self { value: self.slope, slope: self.bend, bend: self.jerk, jerk: 0.0 }
    }

    /// The same with its origin `t` later.
    pub fn after(&self, t: f64) -> Self {
        let Here { value, slope } = self.at(t);
        Self { value, slope, bend: self.bend_at(t), jerk: self.jerk }
    }

    /// Whether it is a constant.
    pub fn is_constant(&self) -> bool {
        self.slope == 0.0 && self.bend == 0.0 && self.jerk == 0.0
    }

    /// The size of its terms up to time `t`.
    pub fn size(&self, t: f64) -> f64 {
        let [value, slope, bend, jerk] = self.derivatives().map(f64::abs);
        value + t * (slope + 0.5 * t * (bend + t * jerk * (1.0 / 3.0)))
    }
}

impl Add for Cubic {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
            bend: self.bend + other.bend,
            jerk: self.jerk + other.jerk,
        }
    }
}

impl Mul<Cubic> for f64 {
    type Output = Cubic;

    fn mul(self, of: Cubic) -> Cubic {
        Cubic::of(of.derivatives().map(|derivative| self * derivative))
    }
}
