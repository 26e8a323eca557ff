//! Largest |x| of each cycle: turning points wait until several lanes have one, then all are computed together.

use pulp::Simd;

use crate::motion::Motion;
use crate::table::Table;
use crate::vector::{Mask, Vector};

/// Largest |x| of the present cycle, of the steady cycles and of the run, for each lane.
///
/// A lane has at most one turning point waiting. If its cycle ends first, the cycle's largest |x| waits with it. When a
/// lane needs the place again, the waiting ones of all lanes are computed. The order of the additions within a lane does
/// not depend on when that is.
pub(crate) struct Tops<S: Simd> {
    /// Largest |x| of the present cycle so far.
    now: Vector<S>,
    /// 1 where a turning point waits: state at the start of its motion, its length, and the velocity at its end.
    waits: Vector<S>,
    unit: [Vector<S>; 4],
    length: Vector<S>,
    last: Vector<S>,
    /// 1 where the waiting turning point is of the cycle before, and the largest other |x| of that cycle.
    late: Vector<S>,
    late_max: Vector<S>,
    /// Cycles finished.
    pub cycles: Vector<S>,
    pub steady_from: Vector<S>,
    pub steady_sum: Vector<S>,
    pub steady_max: Vector<S>,
    pub last_max: Vector<S>,
    pub max: Vector<S>,
}

impl<S: Simd> Tops<S> {
    #[inline(always)]
    pub fn new(zero: Vector<S>) -> Self {
        Self {
            now: zero,
            waits: zero,
            unit: [zero; 4],
            length: zero.same(1.0),
            last: zero,
            late: zero,
            late_max: zero,
            cycles: zero,
            steady_from: zero,
            steady_sum: zero,
            steady_max: zero,
            last_max: zero,
            max: zero,
        }
    }

    /// Clears a lane whose turning points have been computed.
    #[inline(always)]
    pub fn clear(&mut self, lane: usize, steady_from: f64) {
        for value in [
            &mut self.now,
            &mut self.cycles,
            &mut self.steady_sum,
            &mut self.steady_max,
            &mut self.last_max,
            &mut self.max,
        ] {
            value.lanes_mut()[lane] = 0.0;
        }
        self.steady_from.lanes_mut()[lane] = steady_from;
    }

    /// Takes values of |x|.
    #[inline(always)]
    pub fn take(&mut self, lanes: Mask<S>, size: Vector<S>) {
        self.now = lanes.select(self.now.larger(size), self.now);
    }

    /// Takes motions whose velocity changes its sign once in their `length`, to `last` at the end.
    #[inline(always)]
    pub fn turn(
        &mut self,
        table: &Table<S>,
        lanes: Mask<S>,
        unit: &[Vector<S>; 4],
        length: Vector<S>,
        last: Vector<S>,
    ) {
        let zero = last.same(0.0);
        if lanes.and(zero.less(self.waits)).any() {
            self.compute(table);
        }
        for (kept, new) in self.unit.iter_mut().zip(unit) {
            *kept = lanes.select(*new, *kept);
        }
        self.length = lanes.select(length, self.length);
        self.last = lanes.select(last, self.last);
        self.waits = self.waits + lanes.ones();
    }

    /// Ends the cycle in these lanes.
    #[inline(always)]
    pub fn end_cycle(&mut self, table: &Table<S>, lanes: Mask<S>) {
        let zero = self.now.same(0.0);
        if lanes.and(zero.less(self.late)).any() {
            self.compute(table);
        }
        let waiting = lanes.and(zero.less(self.waits));
        self.late = self.late + waiting.ones();
        self.late_max = waiting.select(self.now, self.late_max);
        self.finish(lanes.without(waiting), self.now);
        self.now = lanes.select(zero, self.now);
    }

    /// Computes the waiting turning points.
    #[inline(always)]
    pub fn compute(&mut self, table: &Table<S>) {
        let zero = self.now.same(0.0);
        let waits = zero.less(self.waits);
        if !waits.any() {
            return;
        }
        let top = Motion::new(table, &self.unit).top(waits, self.length, self.last).abs();
        let late = zero.less(self.late);
        self.take(waits.without(late), top);
        self.finish(late, self.late_max.larger(top));
        self.waits = zero;
        self.late = zero;
    }

    /// The largest |x| of the oldest unfinished cycle of these lanes.
    #[inline(always)]
    fn finish(&mut self, lanes: Mask<S>, max: Vector<S>) {
        let steady = lanes.and(self.steady_from.at_most(self.cycles));
        self.steady_sum = self.steady_sum + steady.select(max, max.same(0.0));
        self.steady_max = steady.select(self.steady_max.larger(max), self.steady_max);
        self.last_max = lanes.select(max, self.last_max);
        self.max = lanes.select(self.max.larger(max), self.max);
        self.cycles = self.cycles + lanes.ones();
    }
}
