//! The lanes: each carries a point through its steps; impacts are located in several lanes at once.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::modes::Contact;
use pulp::Simd;

use crate::motion::{Motion, pushed, rotated, turned};
use crate::point::{Outcome, Point};
use crate::table::{Prepared, Table, dot};
use crate::tops::Tops;
use crate::vector::{MOST_LANES, Mask, Vector};

/// Six-point Gauss–Legendre nodes and weights on [−1, 1]; the positive half.
const NODES: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691_04),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_36),
];

/// Share of the lanes that may still fly when the others' impacts are located.
const FEW: f64 = 0.25;

/// Steps that the exact engine takes at a time, up to the end of the cycle. Its end-point proof needs whole arcs, so a
/// single step would always be walked.
const EXACT_STEPS: f64 = 4.0;

/// Cycles after which a point stays with the exact engine if that has taken more than half of its steps.
const TRIAL_CYCLES: f64 = 64.0;

/// The part of a lane that only scalar code uses.
struct Lane {
    index: usize,
    cycles: f64,
    accumulations: u64,
    exact_steps: u64,
    point: Prepared,
}

/// The points in all lanes, in motion. Time counts in steps of each lane, velocities in m per step.
pub(crate) struct Engine<S: Simd> {
    zero: Vector<S>,
    table: Table<S>,
    lanes: [Option<Box<Lane>>; MOST_LANES],
    x: Vector<S>,
    v: Vector<S>,
    /// y − x and y′ − x′.
    offset: Vector<S>,
    slide: Vector<S>,
    /// Step within the cycle, and the excitation at its start.
    step: Vector<S>,
    sine: Vector<S>,
    cosine: Vector<S>,
    /// 1 in the lanes that fly, that meet a wall within the present step, and whose present step is undecided.
    flies: Vector<S>,
    meets: Vector<S>,
    unsure: Vector<S>,
    /// Cycles to go.
    left: Vector<S>,
    square: Vector<S>,
    impacts: Vector<S>,
    fastest: Vector<S>,
    taken: Vector<S>,
    tops: Tops<S>,
}

/// What the structure does over a whole step or its rest, as far as its largest |x| is concerned.
struct Bends<S: Simd> {
    /// It has at most one turning point, by proof.
    simple: Mask<S>,
    turns: Mask<S>,
}

#[inline(always)]
fn bends<S: Simd>(
    (v, v_end): (Vector<S>, Vector<S>),
    (a, a_end): (Vector<S>, Vector<S>),
    sag: Vector<S>,
    beyond: Vector<S>,
) -> Bends<S> {
    let zero = v.same(0.0);
    let one_way = zero.less(v * v_end).and(sag.less(v.abs().smaller(v_end.abs())));
    let bent = beyond.less(a.smaller(a_end)).or(a.larger(a_end).less(-beyond));
    Bends { simple: one_way.or(bent), turns: (v * v_end).less(zero) }
}

/// Steps of all lanes between two questions whether to go on: about a millisecond.
const STEPS_PER_QUESTION: u32 = 16_384;

impl<S: Simd> Engine<S> {
    #[inline(always)]
    pub fn new(simd: S) -> Self {
        let zero = Vector::splat(simd, 0.0);
        Self {
            zero,
            table: Table::new(simd),
            lanes: [const { None }; MOST_LANES],
            x: zero,
            v: zero,
            offset: zero,
            slide: zero,
            step: zero,
            sine: zero,
            cosine: zero,
            flies: zero,
            meets: zero,
            unsure: zero,
            left: zero,
            square: zero,
            impacts: zero,
            fastest: zero,
            taken: zero,
            tops: Tops::new(zero),
        }
    }

    /// Computes points from `next` until there is none, and hands each outcome to `done`; ends when `go_on` says no.
    #[inline(always)]
    pub fn run(
        &mut self,
        points: &[Point],
        mut next: impl FnMut() -> Option<(usize, Prepared)>,
        mut done: impl FnMut(usize, Outcome),
        go_on: &dyn Fn() -> bool,
    ) {
        let mut steps = 0u32;
        for lane in 0..S::F64_LANES {
            self.put(lane, points, next());
        }
        loop {
            let live = self.lanes.iter().flatten().count() as f64;
            if live == 0.0 {
                return;
            }
            // Locating an impact costs as much as several steps: it pays when most lanes have one.
            loop {
                let flying = self.flies.lanes().iter().sum::<f64>();
                if flying == 0.0 || (flying < live && flying <= FEW * live) {
                    break;
                }
                while self.fly() {
                    steps += 1;
                    if steps.is_multiple_of(STEPS_PER_QUESTION) && !go_on() {
                        return;
                    }
                }
                steps += 1;
                if steps.is_multiple_of(STEPS_PER_QUESTION) && !go_on() {
                    return;
                }
            }
            if self.zero.less(self.meets).any() {
                self.bounce();
            }
            for lane in 0..S::F64_LANES {
                if self.unsure.lanes()[lane] > 0.0 {
                    self.by_exact_engine(lane);
                }
                if self.lanes[lane].is_some() && self.left.lanes()[lane] <= 0.0 {
                    self.tops.compute(&self.table);
                    let (index, outcome) = self.outcome(lane, points);
                    done(index, outcome);
                    self.put(lane, points, next());
                }
            }
        }
    }

    /// Puts a point into a lane, or leaves it empty.
    #[inline(always)]
    fn put(&mut self, lane: usize, points: &[Point], point: Option<(usize, Prepared)>) {
        let Some((index, prepared)) = point else {
            self.lanes[lane] = None;
            for value in [&mut self.flies, &mut self.meets, &mut self.unsure] {
                value.lanes_mut()[lane] = 0.0;
            }
            return;
        };
        let (point, h) = (&points[index], prepared.step_s);
        self.table.set(lane, &prepared);
        let state = prepared.motion.state();
        self.x.lanes_mut()[lane] = state.x_m;
        self.v.lanes_mut()[lane] = state.v_m_per_s * h;
        self.offset.lanes_mut()[lane] = state.offset_m;
        self.slide.lanes_mut()[lane] = state.slide_m_per_s * h;
        self.flies.lanes_mut()[lane] = 1.0;
        self.left.lanes_mut()[lane] = point.cycles as f64;
        for value in [
            &mut self.step,
            &mut self.meets,
            &mut self.unsure,
            &mut self.square,
            &mut self.impacts,
            &mut self.fastest,
            &mut self.taken,
        ] {
            value.lanes_mut()[lane] = 0.0;
        }
        self.set_wave(lane, &prepared);
        self.tops.clear(lane, point.steady_from_cycle as f64);
        let cycles = point.cycles as f64;
        self.lanes[lane] = Some(Box::new(Lane { index, cycles, accumulations: 0, exact_steps: 0, point: prepared }));
    }

    #[inline(always)]
    fn outcome(&mut self, lane: usize, points: &[Point]) -> (usize, Outcome) {
        let state = self.lanes[lane].as_ref().expect("a lane that finishes has a point");
        let steps = state.cycles * state.point.wave.len() as f64;
        let steady = points[state.index].cycles.saturating_sub(points[state.index].steady_from_cycle);
        let (sum, max) = (self.tops.steady_sum.lanes()[lane], self.tops.steady_max.lanes()[lane]);
        let outcome = Outcome {
            steady_mean_m: (steady > 0).then(|| sum / steady as f64),
            steady_max_m: (steady > 0).then_some(max),
            last_cycle_max_m: self.tops.last_max.lanes()[lane],
            max_abs_x_m: self.tops.max.lanes()[lane],
            rms_x_m: libm::sqrt(self.square.lanes()[lane] / steps),
            impacts: self.impacts.lanes()[lane] as u64,
            accumulations: state.accumulations,
            lane_steps: self.taken.lanes()[lane] as u64,
            exact_steps: state.exact_steps,
            unresolved: state.point.motion.unresolved(),
        };
        (state.index, outcome)
    }

    /// Sets the excitation of a lane from its table.
    #[inline(always)]
    fn set_wave(&mut self, lane: usize, point: &Prepared) {
        let [sine, cosine] = point.wave[self.step.lanes()[lane] as usize];
        self.sine.lanes_mut()[lane] = sine;
        self.cosine.lanes_mut()[lane] = cosine;
    }

    /// Ends the step of these lanes, and their cycle where it was the last step. Rotates the excitation, and takes it from
    /// the table at the start of each cycle.
    #[inline(always)]
    fn end_step(&mut self, lanes: Mask<S>) {
        self.step = self.step + lanes.ones();
        let (sine, cosine) = rotated(self.sine, self.cosine, &self.table.turn);
        self.sine = lanes.select(sine, self.sine);
        self.cosine = lanes.select(cosine, self.cosine);
        let ends = lanes.and(self.table.steps.at_most(self.step));
        if ends.any() {
            self.step = ends.select(self.zero, self.step);
            self.sine = ends.select(self.table.wave[0], self.sine);
            self.cosine = ends.select(self.table.wave[1], self.cosine);
            self.tops.end_cycle(&self.table, ends);
            self.left = self.left - ends.ones();
            let over = ends.and(self.left.at_most(self.zero));
            self.flies = over.select(self.zero, self.flies);
        }
    }

    /// Takes a step in the flying lanes whose particle is proven to meet no wall; marks the others. Whether all of them fly
    /// on.
    #[inline(always)]
    fn fly(&mut self) -> bool {
        let (sine, cosine) = (self.sine, self.cosine);
        let table = &self.table;
        let unit = [self.x, self.v, sine, cosine];
        let (shift, gain) = (dot(&table.shift, &unit), dot(&table.gain, &unit));
        let (x, v) = (self.x + shift, self.v + gain);
        let offset = self.offset + (self.slide - (shift - self.v));
        let slide = self.slide - gain;
        let sizes = [self.x.abs(), self.v.abs()];
        let sag = table.sag[0] * sizes[0] + (table.sag[1] * sizes[1] + table.sag[2]);
        let fourth = table.fourth[0] * sizes[0] + (table.fourth[1] * sizes[1] + table.fourth[2]);
        // The proofs of core's exact engine: moves one way, or stays clear.
        let one_way = self.zero.less(self.slide * slide).and(sag.less(self.slide.abs().smaller(slide.abs())));
        let d = table.clearance;
        let side = self.zero.less(self.slide).ones() * 2.0 - d.same(1.0);
        let (gap, gap_end) = (d - side * self.offset, d - side * offset);
        let inner = d - fourth * (1.0 / 288.0);
        let third = d.same(1.0 / 3.0);
        let (first, second) = (self.offset + self.slide * third, offset - slide * third);
        let within = first.abs().less(inner).and(second.abs().less(inner));
        let clear = within.and(self.offset.abs().at_most(d)).and(offset.abs().less(d));
        let stays = clear.or(one_way.and(self.zero.less(gap_end)));
        let meets = one_way.and(gap_end.at_most(self.zero)).and(self.zero.less(gap));
        let (sine_end, cosine_end) = rotated(sine, cosine, &table.turn);
        let accelerations = (dot(&table.bent, &unit), dot(&table.bent, &[x, v, sine_end, cosine_end]));
        let bends = bends((self.v, v), accelerations, sag, fourth * 0.125);

        let flies = self.zero.less(self.flies);
        let takes = flies.and(stays).and(bends.simple);
        let meets = flies.and(meets);
        let turns = takes.and(bends.turns);
        self.tops.take(takes, sizes[0].larger(x.abs()));
        if turns.any() {
            self.tops.turn(table, turns, &unit, d.same(1.0), v);
        }
        self.square = self.square + takes.select(mean_square(table, &unit), self.zero);
        self.x = takes.select(x, self.x);
        self.v = takes.select(v, self.v);
        self.offset = takes.select(offset, self.offset);
        self.slide = takes.select(slide, self.slide);
        self.taken = self.taken + takes.ones();
        self.meets = self.meets + meets.ones();
        self.unsure = self.unsure + flies.without(takes).without(meets).ones();
        self.flies = takes.ones();
        self.end_step(takes);
        !flies.without(self.zero.less(self.flies)).any()
    }

    /// Locates the impacts of the lanes that meet a wall and takes their step. Lanes in which more may happen in it are
    /// left undecided.
    #[inline(always)]
    fn bounce(&mut self) {
        let (sine, cosine) = (self.sine, self.cosine);
        let table = &self.table;
        let one = self.zero.same(1.0);
        let meets = self.zero.less(self.meets);
        let unit = [self.x, self.v, sine, cosine];
        let motion = Motion::new(table, &unit);
        let (shift, gain) = (dot(&table.shift, &unit), dot(&table.gain, &unit));
        let d = table.clearance;
        let side = self.zero.less(self.slide).ones() * 2.0 - one;
        let gap = d - side * self.offset;
        let travel = side * (self.slide - (shift - self.v));
        let guess = inverse_cubic(gap, travel, side * self.slide, side * (self.slide - gain));
        let (at, there, found) = motion.gap_closes(meets, side, gap, self.slide, guess);

        let slide_before = self.slide - (there.v - self.v);
        let kick = table.kick * slide_before;
        let v_after = there.v + kick;
        let slide_after = -(table.restitution * slide_before);
        let rest = one - at;
        let (pushed_x, pushed_v) = pushed(table, rest);
        let (x, v) = (self.x + shift + kick * pushed_x, self.v + gain + kick * pushed_v);
        let offset = side * d + (slide_after * rest - (x - there.x - v_after * rest));
        let slide = slide_after - (v - v_after);
        // After the impact the particle moves one way, and the wall ahead stays out of reach.
        let sizes = [there.x.abs(), v_after.abs()];
        let sag_after = table.sag[0] * sizes[0] + (table.sag[1] * sizes[1] + table.sag[2]);
        let beyond_after = (table.fourth[0] * sizes[0] + (table.fourth[1] * sizes[1] + table.fourth[2])) * 0.125;
        let away = self.zero.less(slide_after * slide).and(sag_after.less(slide_after.abs().smaller(slide.abs())));
        let ahead = self.zero.less(d + side * offset);

        let (sine_end, cosine_end) = rotated(sine, cosine, &table.turn);
        let sag = table.sag[0] * self.x.abs() + (table.sag[1] * self.v.abs() + table.sag[2]);
        let fourth = table.fourth[0] * self.x.abs() + (table.fourth[1] * self.v.abs() + table.fourth[2]);
        let before = bends((self.v, there.v), (dot(&table.bent, &unit), there.a), sag, fourth * 0.125);
        let a_after = there.a + table.bent[1] * kick;
        let a_end = dot(&table.bent, &[x, v, sine_end, cosine_end]);
        let after = bends((v_after, v), (a_after, a_end), sag_after, beyond_after);

        let takes = meets.and(found).and(away).and(ahead).and(before.simple).and(after.simple);
        let turns = takes.and(before.turns);
        if turns.any() {
            self.tops.turn(table, turns, &unit, at, there.v);
        }
        let turns = takes.and(after.turns);
        if turns.any() {
            let (sine_there, cosine_there) = turned(sine, cosine, table.angle * at);
            self.tops.turn(table, turns, &[there.x, v_after, sine_there, cosine_there], rest, v);
        }
        self.tops.take(takes, self.x.abs().larger(there.x.abs()).larger(x.abs()));
        let square = mean_square(table, &unit) + square_after(table, &motion, at, rest, kick);
        self.square = self.square + takes.select(square, self.zero);
        self.impacts = self.impacts + takes.ones();
        let fastest = self.fastest.larger(slide_before.abs());
        self.fastest = takes.select(fastest, self.fastest);
        self.x = takes.select(x, self.x);
        self.v = takes.select(v, self.v);
        self.offset = takes.select(offset, self.offset);
        self.slide = takes.select(slide, self.slide);
        self.taken = self.taken + takes.ones();
        self.unsure = self.unsure + meets.without(takes).ones();
        self.flies = self.flies + takes.ones();
        self.meets = self.zero;
        self.end_step(takes);
    }

    /// Takes the present step of a lane by core's exact engine, and a few more at a time until its particle flies freely.
    #[inline(always)]
    fn by_exact_engine(&mut self, lane: usize) {
        let Some(mut state) = self.lanes[lane].take() else { return };
        let h = state.point.step_s;
        let mut step = self.step.lanes()[lane];
        let before = ExactState {
            x_m: self.x.lanes()[lane],
            v_m_per_s: self.v.lanes()[lane] / h,
            offset_m: self.offset.lanes()[lane],
            slide_m_per_s: self.slide.lanes()[lane] / h,
        };
        let motion = &mut state.point.motion;
        motion.resume(step * h, &before, self.fastest.lanes()[lane] / h);
        self.flies.lanes_mut()[lane] = 1.0;
        self.unsure.lanes_mut()[lane] = 0.0;
        let mut this = self.zero;
        this.lanes_mut()[lane] = 1.0;
        let this = self.zero.less(this);
        loop {
            let mut response = Response::new(Wanted { whole_run: true, ..Wanted::default() });
            // Chatter in every cycle keeps a point out of the lanes for good.
            let cycles = state.cycles - self.left.lanes()[lane];
            let stays = cycles >= TRIAL_CYCLES && state.exact_steps as f64 > self.taken.lanes()[lane];
            let rest = self.table.steps.lanes()[lane] - self.step.lanes()[lane];
            let steps = if stays { rest } else { rest.min(EXACT_STEPS) };
            step += steps;
            motion.run(step * h, &mut response);
            state.exact_steps += steps as u64;
            state.accumulations += response.accumulation_count();
            self.impacts.lanes_mut()[lane] += response.impact_count() as f64;
            self.square.lanes_mut()[lane] += response.square_m2_s() / h;
            self.tops.take(this, self.zero.same(response.max_abs_x_m()));
            for _ in 0..steps as u64 {
                self.end_step(this);
            }
            let free = matches!(motion.mode().contact, Contact::Free(direction) if direction != 0)
                && motion.state().offset_m.abs() < self.table.clearance.lanes()[lane];
            if (free && !stays) || self.left.lanes()[lane] <= 0.0 {
                break;
            }
        }
        let after = motion.state();
        self.x.lanes_mut()[lane] = after.x_m;
        self.v.lanes_mut()[lane] = after.v_m_per_s * h;
        self.offset.lanes_mut()[lane] = after.offset_m;
        self.slide.lanes_mut()[lane] = after.slide_m_per_s * h;
        self.fastest.lanes_mut()[lane] = motion.fastest_m_per_s() * h;
        self.set_wave(lane, &state.point);
        self.lanes[lane] = Some(state);
    }
}

/// Fraction of a step at which a gap that falls by `travel` over it has fallen by `gap`, from its rates of fall at both
/// ends: the cubic that interpolates time as a function of the gap.
#[inline(always)]
fn inverse_cubic<S: Simd>(gap: Vector<S>, travel: Vector<S>, rate: Vector<S>, rate_end: Vector<S>) -> Vector<S> {
    let one = gap.same(1.0);
    let w = gap / travel;
    let rest = one - w;
    let guess = w * (w * (gap.same(3.0) - w * 2.0) + travel * rest * (rest / rate - w / rate_end));
    gap.same(0.0).less(guess).and(guess.less(one)).select(guess, w)
}

/// What the push of an impact at `at` adds to the mean of x² over the step, by six-point quadrature: the relative error
/// of the rule on a whole step is 5·10⁻¹⁴.
#[inline(always)]
fn square_after<S: Simd>(
    table: &Table<S>,
    motion: &Motion<S>,
    at: Vector<S>,
    rest: Vector<S>,
    kick: Vector<S>,
) -> Vector<S> {
    let mut sum = at.same(0.0);
    let half = rest * 0.5;
    for (node, weight) in NODES {
        for node in [-node, node] {
            let since = half * (1.0 + node);
            let pushed = kick * pushed(table, since).0;
            sum = sum + pushed * (motion.displacement(at + since) * 2.0 + pushed) * weight;
        }
    }
    sum * half
}

/// Mean of x² over a step.
#[inline(always)]
fn mean_square<S: Simd>(table: &Table<S>, unit: &[Vector<S>; 4]) -> Vector<S> {
    let m = &table.means;
    let [x, v, s, c] = *unit;
    x * (m[0] * x + (m[1] * v + (m[2] * s + m[3] * c)))
        + (v * (m[4] * v + (m[5] * s + m[6] * c)))
        + (s * (m[7] * s + m[8] * c) + m[9] * c * c)
}
