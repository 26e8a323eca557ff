//! Dual numbers: values with an exact derivative along one direction. Nested, they give second derivatives.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number of the equations: an `f64`, or a [`Dual`] of one.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A constant.
    fn of(value: f64) -> Self;
    /// The value without derivatives.
    fn value(self) -> f64;
    /// Sine and cosine of an angle, rad.
    fn sin_cos(self) -> (Self, Self);
    /// Square root of a positive number.
    fn sqrt(self) -> Self;
    /// A positive number to a constant power.
    fn power(self, exponent: f64) -> Self;
    /// Natural logarithm of a positive number.
    fn ln(self) -> Self;
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }

    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn power(self, exponent: f64) -> Self {
        libm::pow(self, exponent)
    }

    fn ln(self) -> Self {
        libm::log(self)
    }
}

/// A value and its derivative along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T> {
    /// The value.
    pub value: T,
    /// Its derivative.
    pub slope: T,
}

impl<T: Real> Dual<T> {
    /// A value that does not change along the direction.
    pub fn constant(value: T) -> Self {
        Self { value, slope: T::of(0.0) }
    }

    /// The quantity along which the derivative is taken.
    pub fn variable(value: T) -> Self {
        Self { value, slope: T::of(1.0) }
    }
}

impl<T: Real> Add for Dual<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl<T: Real> Sub for Dual<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl<T: Real> Mul for Dual<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, slope: self.slope * other.value + self.value * other.slope }
    }
}

impl<T: Real> Div for Dual<T> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

impl<T: Real> Neg for Dual<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl<T: Real> Real for Dual<T> {
    fn of(value: f64) -> Self {
        Self::constant(T::of(value))
    }

    fn value(self) -> f64 {
        self.value.value()
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.value.sin_cos();
        (Self { value: sine, slope: cosine * self.slope }, Self { value: cosine, slope: -sine * self.slope })
    }

    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self { value: root, slope: self.slope / (root + root) }
    }

    fn power(self, exponent: f64) -> Self {
        Self {
            value: self.value.power(exponent),
            slope: self.slope * T::of(exponent) * self.value.power(exponent - 1.0),
        }
    }

    fn ln(self) -> Self {
        Self { value: self.value.ln(), slope: self.slope / self.value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_and_second_derivatives_are_those_of_calculus() {
        // f = sin(x)·√x/(1 + x) and its derivatives at 0.7.
        fn f<T: Real>(x: T) -> T {
            x.sin_cos().0 * x.sqrt() / (T::of(1.0) + x)
        }
        let x = 0.7;
        let twice = f(Dual { value: Dual::variable(x), slope: Dual::constant(1.0) });
        // ln f = ln sin x + ½ ln x − ln(1 + x)
        let (sine, cosine) = (x.sin(), x.cos());
        let first = cosine / sine + 0.5 / x - 1.0 / (1.0 + x);
        let change = -1.0 / (sine * sine) - 0.5 / (x * x) + 1.0 / ((1.0 + x) * (1.0 + x));
        let value = sine * x.sqrt() / (1.0 + x);
        assert!((twice.value.value - value).abs() < 1e-15);
        assert!((twice.slope.value - value * first).abs() < 1e-15);
        assert!((twice.slope.slope - value * (first * first + change)).abs() < 1e-14);
    }
}
