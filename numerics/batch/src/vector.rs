//! A vector of `f64`, one value a lane, with the arithmetic operators.
//!
//! Every operation acts on each lane alone and is rounded as IEEE 754 says; none is fused. A lane therefore has the same
//! bits whatever the number of lanes and the instruction set.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::{Simd, bytemuck};

/// Largest number of lanes.
pub(crate) const MOST_LANES: usize = 8;

/// A value per lane.
#[derive(Clone, Copy)]
pub(crate) struct Vector<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// A truth value per lane.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: Simd> {
    simd: S,
    value: S::m64s,
}

impl<S: Simd> Vector<S> {
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self { simd, value: simd.splat_f64s(value) }
    }

    #[inline(always)]
    pub fn same(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }

    #[inline(always)]
    pub fn lanes(&self) -> &[f64] {
        bytemuck::cast_slice(std::slice::from_ref(&self.value))
    }

    #[inline(always)]
    pub fn lanes_mut(&mut self) -> &mut [f64] {
        bytemuck::cast_slice_mut(std::slice::from_mut(&mut self.value))
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { value: self.simd.abs_f64s(self.value), ..self }
    }

    #[inline(always)]
    pub fn less(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, value: self.simd.less_than_f64s(self.value, other.value) }
    }

    #[inline(always)]
    pub fn at_most(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, value: self.simd.less_than_or_equal_f64s(self.value, other.value) }
    }

    #[inline(always)]
    pub fn smaller(self, other: Self) -> Self {
        self.less(other).select(self, other)
    }

    #[inline(always)]
    pub fn larger(self, other: Self) -> Self {
        other.less(self).select(self, other)
    }
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub fn select(self, yes: Vector<S>, no: Vector<S>) -> Vector<S> {
        Vector { simd: self.simd, value: self.simd.select_f64s(self.value, yes.value, no.value) }
    }

    #[inline(always)]
    pub fn and(self, other: Self) -> Self {
        Self { value: self.simd.and_m64s(self.value, other.value), ..self }
    }

    #[inline(always)]
    pub fn or(self, other: Self) -> Self {
        Self { value: self.simd.or_m64s(self.value, other.value), ..self }
    }

    /// Lanes of `self` that are not in `other`.
    #[inline(always)]
    pub fn without(self, other: Self) -> Self {
        let both = self.simd.and_m64s(self.value, other.value);
        Self { value: self.simd.xor_m64s(self.value, both), ..self }
    }

    #[inline(always)]
    pub fn any(self) -> bool {
        self.simd.first_true_m64s(self.value) < S::F64_LANES
    }

    /// 1 in the lanes that are set, else 0.
    #[inline(always)]
    pub fn ones(self) -> Vector<S> {
        self.select(Vector::splat(self.simd, 1.0), Vector::splat(self.simd, 0.0))
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $simd:ident) => {
        impl<S: Simd> $trait for Vector<S> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { simd: self.simd, value: self.simd.$simd(self.value, other.value) }
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Mul<f64> for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * self.same(other)
    }
}

impl<S: Simd> Neg for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.simd.neg_f64s(self.value), ..self }
    }
}
