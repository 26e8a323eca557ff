//! The structure's motion over one step in all lanes, as a series, and the roots that impacts and turning points need.

use damprig_core::integrator::exact::series::TERMS;
use pulp::Simd;

use crate::table::Table;
use crate::vector::{Mask, Vector};

const BENT: usize = TERMS - 2;

/// Newton steps after which a lane counts as undecided: a bracket halves in each of them at least.
const MOST_STEPS: u32 = 64;

/// Length of a Newton step, in steps of time, from which on Taylor's terms up to the second give the root and the motion
/// there: the next change the velocity by half its square, 5·10⁻¹⁷.
const NEAR: f64 = 1e-8;

/// The same for the height of a turning point: the next term is a third of its cube, 10⁻¹⁷.
const NEAR_TOP: f64 = 3e-6;

/// A motion: displacement and velocity at the start, and the rest of its series.
pub(crate) struct Motion<S: Simd> {
    pub x: Vector<S>,
    pub v: Vector<S>,
    bend: [Vector<S>; BENT],
}

/// Displacement, velocity and acceleration at an instant.
#[derive(Clone, Copy)]
pub(crate) struct Instant<S: Simd> {
    pub x: Vector<S>,
    pub v: Vector<S>,
    pub a: Vector<S>,
}

impl<S: Simd> Motion<S> {
    /// From displacement, velocity, sine and cosine.
    #[inline(always)]
    pub fn new(table: &Table<S>, unit: &[Vector<S>; 4]) -> Self {
        let mut bend = [unit[0]; BENT];
        for (n, bend) in bend.iter_mut().enumerate() {
            *bend = (table.columns[0][n + 2] * unit[0] + table.columns[1][n + 2] * unit[1])
                + (table.columns[2][n + 2] * unit[2] + table.columns[3][n + 2] * unit[3]);
        }
        Self { x: unit[0], v: unit[1], bend }
    }

    /// Displacement at `t`.
    #[inline(always)]
    pub fn displacement(&self, t: Vector<S>) -> Vector<S> {
        let square = t * t;
        let (mut even, mut odd) = (self.bend[BENT - 2], self.bend[BENT - 1]);
        for n in (0..BENT - 2).step_by(2).rev() {
            even = even * square + self.bend[n];
            odd = odd * square + self.bend[n + 1];
        }
        self.x + (self.v * t + (even + odd * t) * square)
    }

    #[inline(always)]
    pub fn at(&self, t: Vector<S>) -> Instant<S> {
        let square = t * t;
        let mut sums = [[self.x; 3]; 2];
        // Displacement, rate and acceleration, in even and in odd powers.
        for (half, sums) in sums.iter_mut().enumerate() {
            let n = BENT - 2 + half;
            let bend = self.bend[n];
            *sums = [bend, bend * (n + 2) as f64, bend * ((n + 2) * (n + 1)) as f64];
        }
        for n in (0..BENT - 2).step_by(2).rev() {
            for (half, [curved, rate, a]) in sums.iter_mut().enumerate() {
                let bend = self.bend[n + half];
                let order = n + half + 2;
                *curved = *curved * square + bend;
                *rate = *rate * square + bend * order as f64;
                *a = *a * square + bend * (order * (order - 1)) as f64;
            }
        }
        let [even, odd] = sums;
        let [curved, rate, a] = [even[0] + odd[0] * t, even[1] + odd[1] * t, even[2] + odd[2] * t];
        Instant { x: self.x + (self.v * t + curved * square), v: self.v + rate * t, a }
    }

    /// The instant at which the gap `g(τ) = gap − side·(slide τ − (x(τ) − x(0) − x′(0) τ))` closes, in the lanes of
    /// `wanted`, where it must fall from above zero to below it once. Returns the instant, the motion there, and the
    /// lanes that were found.
    #[inline(always)]
    pub fn gap_closes(
        &self,
        wanted: Mask<S>,
        side: Vector<S>,
        gap: Vector<S>,
        slide: Vector<S>,
        guess: Vector<S>,
    ) -> (Vector<S>, Instant<S>, Mask<S>) {
        let zero = gap.same(0.0);
        let near = gap.same(NEAR);
        let (mut low, mut high, mut t) = (zero, gap.same(1.0), guess);
        let (mut root, mut found) = (t, zero);
        let mut there = Instant { x: self.x, v: self.v, a: zero };
        for _ in 0..MOST_STEPS {
            let now = self.at(t);
            let curved = now.x - self.x - self.v * t;
            let here = gap - side * (slide * t - curved);
            let speed = side * (slide - (now.v - self.v));
            let step = here / speed;
            // Two terms of the series reversion.
            let more = step + side * now.a / speed * (step * step * 0.5);
            let open = zero.less(wanted.ones() - found);
            let settled = open.and(step.abs().at_most(near));
            if settled.any() {
                root = settled.select(t + more, root);
                there.x = settled.select(now.x + more * (now.v + more * now.a * 0.5), there.x);
                there.v = settled.select(now.v + more * now.a, there.v);
                there.a = settled.select(now.a, there.a);
                found = found + settled.ones();
                if !open.without(settled).any() {
                    break;
                }
            }
            let above = zero.less(here);
            low = above.select(t, low);
            high = above.select(high, t);
            let next = t + more;
            let inside = low.less(next).and(next.less(high));
            t = inside.select(next, (low + high) * 0.5);
        }
        (root, there, zero.less(found))
    }

    /// The displacement at which the velocity is zero, in the lanes of `wanted`, where it must change its sign once
    /// between 0 and `length`, from its value at 0 to `last`.
    #[inline(always)]
    pub fn top(&self, wanted: Mask<S>, length: Vector<S>, last: Vector<S>) -> Vector<S> {
        let zero = length.same(0.0);
        let near = length.same(NEAR_TOP);
        let rises = zero.less(self.v).ones() * 2.0 - length.same(1.0);
        // Time as a function of the velocity: a parabola through both ends with the slope at the start.
        let part = self.v / (self.v - last);
        let first = (last - self.v) / (self.bend[0] * 2.0);
        let curved = first * part + (length - first) * (part * part);
        let good = zero.less(curved).and(curved.less(length));
        let mut t = good.select(curved, length * part);
        let (mut low, mut high) = (zero, length);
        let (mut top, mut found) = (zero, zero);
        for _ in 0..MOST_STEPS {
            let now = self.at(t);
            let newton = -(now.v / now.a);
            // The third derivative by its first terms speeds the search up.
            let third = (self.bend[1] + (self.bend[2] * 4.0 + self.bend[3] * 10.0 * t) * t) * 6.0;
            let step = newton - third / now.a * (newton * newton * 0.5);
            let open = zero.less(wanted.ones() - found);
            let settled = open.and(newton.abs().at_most(near));
            if settled.any() {
                top = settled.select(now.x + now.v * newton * 0.5, top);
                found = found + settled.ones();
                if !open.without(settled).any() {
                    break;
                }
            }
            let before = zero.less(now.v * rises);
            low = before.select(t, low);
            high = before.select(high, t);
            let next = t + step;
            let inside = low.less(next).and(next.less(high));
            t = inside.select(next, (low + high) * 0.5);
        }
        top
    }
}

/// Taylor coefficients of (cos a − 1)/a² and sin a/a in a², highest first.
const COSINE: [f64; 8] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
];
const SINE: [f64; 8] = [
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];

/// Sine and cosine of the excitation `angle` later, for angles up to 0.8 rad.
#[inline(always)]
pub(crate) fn turned<S: Simd>(sine: Vector<S>, cosine: Vector<S>, angle: Vector<S>) -> (Vector<S>, Vector<S>) {
    let square = angle * angle;
    let (mut less, mut share) = (angle.same(COSINE[0]), angle.same(SINE[0]));
    for n in 1..8 {
        less = less * square + angle.same(COSINE[n]);
        share = share * square + angle.same(SINE[n]);
    }
    rotated(sine, cosine, &[less * square, share * angle])
}

/// Sine and cosine after a rotation by the angle with the given cosine less one and sine.
#[inline(always)]
pub(crate) fn rotated<S: Simd>(sine: Vector<S>, cosine: Vector<S>, by: &[Vector<S>; 2]) -> (Vector<S>, Vector<S>) {
    (sine + (sine * by[0] + cosine * by[1]), cosine + (cosine * by[0] - sine * by[1]))
}

/// Displacement and velocity at `t` of a structure that starts from x = 0 with velocity 1 at rest of the excitation.
#[inline(always)]
pub(crate) fn pushed<S: Simd>(table: &Table<S>, t: Vector<S>) -> (Vector<S>, Vector<S>) {
    let c = &table.columns[1];
    let square = t * t;
    let (mut even, mut odd) = (c[TERMS - 2], c[TERMS - 1]);
    let (mut even_rate, mut odd_rate) = (c[TERMS - 1] * (TERMS - 1) as f64, c[TERMS - 2] * (TERMS - 2) as f64);
    for n in (0..TERMS - 2).step_by(2).rev() {
        even = even * square + c[n];
        odd = odd * square + c[n + 1];
        even_rate = even_rate * square + c[n + 1] * (n + 1) as f64;
        if n > 0 {
            odd_rate = odd_rate * square + c[n] * n as f64;
        }
    }
    (even + odd * t, even_rate + odd_rate * t)
}
