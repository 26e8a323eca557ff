//! Response of a run: extrema, mean square, cycle maxima and contact figures, in constant memory.

use super::arc_roots::{ArcMotion, inverse_cubic};
use super::excitation::Wave;
use super::flow::ExactState;
use super::observe::{Accumulation, Arc, ContactEnd, Impact, Observer};
use super::oscillator::{Oscillator, dot};
use super::series::{self, Series};
use crate::integrator::modes::{Sign, signed};

/// Selects which results of a run are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Length of a cycle, s: cycle j is [jT, (j+1)T). `None`: no cycle maxima.
    pub cycle_s: Option<f64>,
    /// First cycle that counts as steady state.
    pub steady_from_cycle: Option<u64>,
    /// Also compute the mean square and the extrema relative to the base over the whole run.
    pub whole_run: bool,
}

/// Accumulates the results of a run: an observer of the exact engine, and for other drivers a meter that is given their pieces
/// ([`Response::take_x`], [`Response::take_whole`]), impacts and contacts.
#[derive(Clone, Debug)]
pub struct Response {
    wanted: Wanted,
    square_m2_s: f64,
    relative_square_m2_s: f64,
    length_s: f64,
    max_abs_x_m: f64,
    max_abs_x_minus_z_m: f64,
    impacts: u64,
    /// Of the impacts on the walls at the negative and the positive side, m/s.
    fastest_m_per_s: [f64; 2],
    accumulations: u64,
    cycle: u64,
    cycle_max_m: f64,
    last_cycle_max_m: Option<f64>,
    steady_max_m: f64,
    steady_sum_m: f64,
    steady_cycles: u64,
    peak_force_n: Option<f64>,
    /// Time, s, and approach speed, m/s.
    first_touch: Option<(f64, f64)>,
    first_contact: Option<(f64, f64)>,
}

impl Response {
    /// An empty response.
    #[must_use]
    pub fn new(wanted: Wanted) -> Self {
        Self {
            wanted,
            square_m2_s: 0.0,
            relative_square_m2_s: 0.0,
            length_s: 0.0,
            max_abs_x_m: 0.0,
            max_abs_x_minus_z_m: 0.0,
            impacts: 0,
            fastest_m_per_s: [0.0; 2],
            accumulations: 0,
            cycle: 0,
            cycle_max_m: 0.0,
            last_cycle_max_m: None,
            steady_max_m: 0.0,
            steady_sum_m: 0.0,
            steady_cycles: 0,
            peak_force_n: None,
            first_touch: None,
            first_contact: None,
        }
    }

    /// √(1/T ∫x² dt) over the observed time, m.
    #[must_use]
    pub fn rms_x_m(&self) -> f64 {
        if self.length_s > 0.0 { libm::sqrt(self.square_m2_s / self.length_s) } else { 0.0 }
    }

    /// √(1/T ∫(x − z)² dt) over the observed time, m; 0 from the exact engine, whose base does not drift.
    #[must_use]
    pub fn rms_x_minus_z_m(&self) -> f64 {
        if self.length_s > 0.0 { libm::sqrt(self.relative_square_m2_s / self.length_s) } else { 0.0 }
    }

    /// ∫x² dt over the observed time, m²·s.
    #[must_use]
    pub fn square_m2_s(&self) -> f64 {
        self.square_m2_s
    }

    /// Largest |x|, m.
    #[must_use]
    pub fn max_abs_x_m(&self) -> f64 {
        self.max_abs_x_m.max(self.cycle_max_m)
    }

    /// Largest |x − z|, m.
    #[must_use]
    pub fn max_abs_x_minus_z_m(&self) -> f64 {
        self.max_abs_x_minus_z_m
    }

    /// Number of impacts (first touches of a soft wall). The impacts of a summed chatter are not counted.
    #[must_use]
    pub fn impact_count(&self) -> u64 {
        self.impacts
    }

    /// The largest approach speed of an impact (first touch of a soft wall) at the negative and at the positive side, m/s; 0 without
    /// one.
    #[must_use]
    pub fn fastest_m_per_s(&self) -> [f64; 2] {
        self.fastest_m_per_s
    }

    /// Number of chatters that ended with the particle at rest on a hard wall and whose last impacts were summed.
    /// [`Observer::accumulation`] reports when each ended.
    #[must_use]
    pub fn accumulation_count(&self) -> u64 {
        self.accumulations
    }

    /// Largest |x| of the last complete cycle, m.
    #[must_use]
    pub fn last_cycle_max_m(&self) -> Option<f64> {
        self.last_cycle_max_m
    }

    /// Largest |x| over the cycles and mean of the cycle maxima, from the first steady cycle on, m; complete cycles
    /// only.
    #[must_use]
    pub fn steady_m(&self) -> Option<(f64, f64)> {
        (self.steady_cycles > 0).then(|| (self.steady_max_m, self.steady_sum_m / self.steady_cycles as f64))
    }

    /// Largest force of a soft wall, N.
    #[must_use]
    pub fn peak_contact_force_n(&self) -> Option<f64> {
        self.peak_force_n
    }

    /// Duration of the first contact with a soft wall, s, and separation speed over approach speed.
    #[must_use]
    pub fn first_contact(&self) -> Option<(f64, f64)> {
        self.first_contact
    }

    /// Declares that the observed run starts with this cycle.
    pub fn skip_to(&mut self, cycle: u64) {
        self.cycle = cycle;
    }

    /// Closes the last cycle of a run that covers exactly a whole number of cycles.
    pub fn finish(&mut self, end_s: f64) {
        if let Some(cycle_s) = self.wanted.cycle_s
            && end_s >= (self.cycle + 1) as f64 * cycle_s * (1.0 - 1e-12)
        {
            self.close_cycle();
        }
    }

    fn close_cycle(&mut self) {
        let max = self.cycle_max_m;
        self.last_cycle_max_m = Some(max);
        self.max_abs_x_m = self.max_abs_x_m.max(max);
        if self.wanted.steady_from_cycle.is_some_and(|first| self.cycle >= first) {
            self.steady_max_m = self.steady_max_m.max(max);
            self.steady_sum_m += max;
            self.steady_cycles += 1;
        }
        self.cycle += 1;
        self.cycle_max_m = 0.0;
    }

    /// Takes |x| of a piece of motion between two times, s, cut where cycles end. Inside the piece time counts from 0 to `end` in a unit of its
    /// own, which `own` converts seconds after its start to; `largest` gives the largest |x|, m, between two such times, if above a value.
    #[inline]
    pub fn take_x(
        &mut self,
        [start_s, end_s]: [f64; 2],
        end: f64,
        own: impl Fn(f64) -> f64,
        largest: impl Fn(f64, f64, f64) -> f64,
    ) {
        let mut from = 0.0;
        if let Some(cycle_s) = self.wanted.cycle_s {
            loop {
                let boundary_s = (self.cycle + 1) as f64 * cycle_s;
                if boundary_s >= end_s {
                    break;
                }
                let to = own(boundary_s - start_s).clamp(from, end);
                self.cycle_max_m = largest(from, to, self.cycle_max_m);
                self.close_cycle();
                from = to;
            }
        }
        self.cycle_max_m = largest(from, end, self.cycle_max_m);
    }

    /// Takes the rest of what is wanted of the whole run from a piece of `length_s`: `add_squares` adds its ∫x² dt and ∫(x − z)² dt, m²·s; `largest` gives its largest
    /// |x − z|, m, if above a value.
    #[inline]
    pub fn take_whole(
        &mut self,
        length_s: f64,
        add_squares: impl FnOnce(&mut f64, &mut f64),
        largest: impl FnOnce(f64) -> f64,
    ) {
        if self.wanted.whole_run {
            add_squares(&mut self.square_m2_s, &mut self.relative_square_m2_s);
            self.length_s += length_s;
            self.max_abs_x_minus_z_m = largest(self.max_abs_x_minus_z_m);
        }
    }

    /// Takes the largest force of a soft wall during a piece in contact; `largest` gives it, N, if above a value.
    pub fn take_force(&mut self, largest: impl FnOnce(f64) -> f64) {
        self.peak_force_n = Some(largest(self.peak_force_n.unwrap_or(0.0)));
    }

    /// Takes an impact at `time_s` on the wall of `side`, or the first touch of a soft wall, with this approach speed.
    pub fn take_impact(&mut self, time_s: f64, side: Sign, approach_speed_m_per_s: f64) {
        self.impacts += 1;
        let fastest = &mut self.fastest_m_per_s[usize::from(side > 0)];
        *fastest = fastest.max(approach_speed_m_per_s);
        if self.first_touch.is_none() {
            self.first_touch = Some((time_s, approach_speed_m_per_s));
        }
    }

    /// Takes the end of a chatter with the particle at rest on a wall.
    pub fn take_accumulation(&mut self) {
        self.accumulations += 1;
    }

    /// Takes the end of a contact with a soft wall at `time_s`.
    pub fn take_contact_end(&mut self, time_s: f64, separation_speed_m_per_s: f64) {
        if let (None, Some((touch_s, approach_speed_m_per_s))) = (self.first_contact, self.first_touch) {
            self.first_contact = Some((time_s - touch_s, separation_speed_m_per_s / approach_speed_m_per_s));
        }
    }
}

/// The largest |p| over `[from, to]`, if above `least`.
///
/// It is that of the ends if p cannot rise above `least` between them (it deviates from its chord by at most max |p″| h²/8), or has no turning point
/// (its slope changes by at most max |p″| h, so that it cannot reach zero from both ends).
fn largest_abs(p: &Series, from: f64, to: f64, least: f64) -> f64 {
    let (first, last) = (series::value_and_slope(p, from), series::value_and_slope(p, to));
    let ends = first.0.abs().max(last.0.abs());
    let length = to - from;
    let bend = 2.0 * series::curvature_bound(p, to) * length;
    if ends + 0.125 * bend * length <= least {
        return least;
    }
    if first.1 * last.1 > 0.0 && first.1.abs() + last.1.abs() > bend {
        return least.max(ends);
    }
    let above = series::largest(p, from, to, least);
    series::largest(&p.map(|c| -c), from, to, above)
}

/// Eight-point Gauss–Legendre nodes and weights on [−1, 1], the positive half: exact up to degree 15.
pub const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// ∫₀^to f dτ by eight-point quadrature. For a product of two displacements of an arc (at most 1.6 rad of its fastest
/// term) the relative error of the rule is below 10⁻¹⁷.
pub(crate) fn integral(to: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let half = 0.5 * to;
    let mut sum = 0.0;
    for (node, weight) in NODES {
        sum += weight * (f(half * (1.0 - node)) + f(half * (1.0 + node)));
    }
    sum * half
}

/// Mean of p² over τ = 0 … `to`, by the same rule.
fn mean_square(p: &Series, to: f64) -> f64 {
    let half = 0.5 * to;
    let mut at = [half; 2 * NODES.len()];
    for (pair, (node, _)) in at.chunks_exact_mut(2).zip(NODES) {
        pair[0] -= half * node;
        pair[1] += half * node;
    }
    let values = series::values(p, &at);
    let pairs = values.chunks_exact(2).zip(NODES);
    pairs.map(|(pair, (_, weight))| 0.5 * weight * (pair[0] * pair[0] + pair[1] * pair[1])).sum()
}

impl Observer for Response {
    fn arc(&mut self, arc: &Arc<'_>) {
        let (start_s, length_s, end) = (arc.start_s, arc.length_s, arc.end_fraction());
        self.take_x(
            [start_s, start_s + length_s],
            end,
            move |after_s| after_s / length_s * end,
            move |from, to, least_m| arc.largest_abs_x_m(from, to, least_m),
        );
        self.take_whole(
            length_s,
            |square_m2_s, _| *square_m2_s += arc.square_m2_s(),
            |least_m| arc.largest_abs_x_minus_z_m(least_m),
        );
        if self.wanted.whole_run
            && let Some(force) = arc.contact_force()
        {
            self.take_force(|least_n| series::largest(&force, 0.0, end, least_n));
        }
    }

    fn impact(&mut self, impact: &Impact) {
        self.take_impact(impact.time_s, impact.side, impact.approach_speed_m_per_s);
    }

    fn accumulation(&mut self, _: &Accumulation) {
        self.take_accumulation();
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        self.take_contact_end(end.time_s, end.separation_speed_m_per_s);
    }
}

impl Arc<'_> {
    /// The largest |x| between two fractions of the series' interval, m, if above `least_m`.
    #[must_use]
    #[inline]
    pub fn largest_abs_x_m(&self, from: f64, to: f64, least_m: f64) -> f64 {
        self.oscillation()
            .and_then(|x| x.turns_once((from, to), self.end_fraction(), least_m))
            .unwrap_or_else(|| largest_abs(&self.span().x, from, to, least_m))
    }

    /// The largest |x − z| of the arc, m, if above `least_m`.
    #[must_use]
    #[inline]
    pub fn largest_abs_x_minus_z_m(&self, least_m: f64) -> f64 {
        let end = self.end_fraction();
        self.relative_oscillation().and_then(|q| q.turns_once((0.0, end), end, least_m)).unwrap_or_else(|| {
            let span = self.span();
            let mut stretch = span.x;
            for (s, z) in stretch.iter_mut().zip(&span.base) {
                *s -= z;
            }
            largest_abs(&stretch, 0.0, end, least_m)
        })
    }

    /// ∫x² dt over the arc, m²·s.
    #[must_use]
    pub fn square_m2_s(&self) -> f64 {
        let end = self.end_fraction();
        let x = match self.oscillation() {
            Some(x) if end == 1.0 => return x.table.mean_square(&x.start) * x.table.step_s,
            Some(x) => x.table.series(&x.start),
            None => self.span().x,
        };
        mean_square(&x, end) * self.length_s
    }

    /// The structure's motion, if it is one oscillator.
    #[inline]
    fn oscillation(&self) -> Option<Oscillation<'_>> {
        let table = self.flows.oscillator(self.leg.path)?;
        let constant = self.leg.structure_acceleration;
        let unit = |state: &ExactState, wave: &Wave| [state.x_m, state.v_m_per_s, constant, wave.sine, wave.cosine];
        Some(Oscillation {
            table,
            wave: &self.wave,
            start: unit(&self.start, &self.wave),
            end: unit(&self.end, &self.end_wave),
        })
    }

    /// The structure's motion relative to the base, if it is one oscillator.
    #[inline]
    fn relative_oscillation(&self) -> Option<Oscillation<'_>> {
        let table = self.flows.relative_oscillator(self.leg.path)?;
        let share = self.flows.base_share;
        // In the structure's acceleration the spring's end is at the wave's offset; here it is at zero.
        let constant = self.leg.structure_acceleration - table.stiffness_per_mass * self.wave.offset;
        let unit = |state: &ExactState, wave: &Wave| {
            let z = wave.offset + share * wave.sine;
            let rate = share * self.flows.turning * wave.cosine;
            [state.x_m - z, state.v_m_per_s - rate, constant, wave.sine, wave.cosine]
        };
        Some(Oscillation {
            table,
            wave: &self.wave,
            start: unit(&self.start, &self.wave),
            end: unit(&self.end, &self.end_wave),
        })
    }

    /// The force that a soft wall exerts, N, over the series' interval; `None` without contact.
    #[must_use]
    #[inline]
    pub fn contact_force(&self) -> Option<Series> {
        if let Some((_, squeeze)) = self.squeeze {
            return Some(squeeze.force);
        }
        (self.leg.pressed != 0).then(|| self.force_of_wall())
    }

    fn force_of_wall(&self) -> Series {
        let side = self.leg.pressed;
        let span = self.span();
        let link = self.flows.link(side);
        let mut force = series::derivative(&span.offset).map(|rate| signed(side, link.damping / span.step_s * rate));
        for (f, w) in force.iter_mut().zip(&span.offset) {
            *f += signed(side, link.stiffness * w);
        }
        force[0] -= link.stiffness * signed(side, self.leg.rest_offset);
        force
    }
}

/// The motion of an oscillator during an arc: displacement, velocity, constant acceleration, sine and cosine at both
/// ends.
struct Oscillation<'a> {
    table: &'a Oscillator,
    wave: &'a Wave,
    start: [f64; 5],
    end: [f64; 5],
}

impl Oscillation<'_> {
    /// The largest magnitude between two fractions of the series' interval, m, if above `least_m`, where the velocity is
    /// proven to change sign at most once; `None` without that proof. The arc ends at `arc_end`.
    #[inline]
    fn turns_once(&self, (from, to): (f64, f64), arc_end: f64, least_m: f64) -> Option<f64> {
        let ends = self.start[0].abs().max(self.end[0].abs());
        if ends + self.table.bulge(&self.start) <= least_m {
            return Some(least_m);
        }
        self.turning_point((from, to), arc_end, least_m)
    }

    fn turning_point(&self, (from, to): (f64, f64), arc_end: f64, least_m: f64) -> Option<f64> {
        let (table, start, end) = (self.table, &self.start, &self.end);
        let (bent, bent_end) = (dot(&table.rates[0], start), dot(&table.rates[0], end));
        // Largest deviation of the acceleration from its chord.
        let beyond = dot(&table.fourth, &start.map(f64::abs)) * 0.125;
        let ends = start[0].abs().max(end[0].abs());
        if ends + (bent.abs().max(bent_end.abs()) + beyond) * 0.125 <= least_m {
            return Some(least_m);
        }
        if !(bent.min(bent_end) > beyond || bent.max(bent_end) < -beyond) {
            return None;
        }
        let whole = from == 0.0 && to == arc_end;
        if whole && start[1] * end[1] >= 0.0 {
            return Some(least_m.max(ends));
        }
        let motion = ArcMotion::new(table, start, self.wave);
        let h = table.step_s;
        let first = if from == 0.0 { (start[0], start[1] * h) } else { motion.at(from) };
        let last = if to == arc_end { (end[0], end[1] * h) } else { motion.at(to) };
        let most = least_m.max(first.0.abs()).max(last.0.abs());
        if first.1 * last.1 >= 0.0 {
            return Some(most);
        }
        let length = to - from;
        let at = from + length * inverse_cubic(first.1, first.1 - last.1, -bent * length, -bent_end * length);
        motion.top(at).map(|(_, x)| most.max(x.abs()))
    }
}
