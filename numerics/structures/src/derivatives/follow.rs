//! Follows a small change of a motion from interval to interval.

use std::collections::{HashMap, HashSet};
use std::ops::{Add, Mul, Sub};
use std::rc::Rc;

use nalgebra::{DMatrix, DVector};

use super::equations::{Equations, MORE};
use super::record::{End, StateInterval, intervals};
use super::series::Series;
use super::setting::{Known, Setting, Sloped, all_or_none, sloped};
use super::stencil::relative;
use super::{MotionCase, NoDerivatives, Varied};
use crate::contacts::{Contacts, Event, Slide};

/// Products of numbers in a second, about, and the longest time that they may take.
const PRODUCTS_PER_S: f64 = 2e8;
const MAX_S: f64 = 60.0;

/// Intervals after which the growth is looked at.
const INTERVALS_PER_CHECK: usize = 64;

/// Steps of an interval above which the exponential of its matrix takes less time.
const MANY_STEPS: f64 = 16.0;

/// What a motion is followed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// What a motion is, from a given start.
    Motion,
    /// The same on an orbit, whose start moves with the quantities.
    Orbit,
    /// The end of an orbit alone.
    Map,
}

/// A motion with its changes, up to some instant.
pub(super) struct Follower<'a> {
    pub purpose: Purpose,
    pub nominal: Setting<'a>,
    /// Of each quantity.
    pub others: Vec<[Setting<'a>; 6]>,
    pub known: HashMap<Contacts, Rc<Known>>,
    /// The largest displacement and velocity of the motion, times the root of the body's mass.
    pub sizes: [f64; 2],
    pub w: DVector<f64>,
    /// The changes of w at its time.
    pub s: DMatrix<f64>,
    /// The changes at the start of an orbit, and w.
    pub start: DMatrix<f64>,
    pub start_w: DVector<f64>,
    /// The last instant at which something happened.
    pub time: Sloped,
    pub last_event: Option<Sloped>,
    /// Events with their times, s.
    pub events: Vec<(f64, Event)>,
    /// Damper, time and approach speed of each.
    pub impacts: Vec<(usize, Sloped, Sloped)>,
    /// Of each place: where its displacement may be largest, and the integral of its square.
    pub peaks: Vec<Vec<Sloped>>,
    pub squares: Vec<Sloped>,
    /// What may change before an event is lost or gained, in magnitude.
    pub margins: Vec<Sloped>,
}

/// Follows the changes of a motion to its end. Gives the growth too.
pub(super) fn follow<'a>(
    case: &'a MotionCase,
    varied: &'a [Varied],
    purpose: Purpose,
    goes_on: &mut dyn FnMut(f64) -> bool,
) -> Result<(Follower<'a>, f64), NoDerivatives> {
    let (intervals, end) = intervals(case)?;
    let others = varied.iter().map(|varied| {
        let [a, b, c, d, e, f] = &varied.cases;
        let of = Setting::of;
        Ok([of(a)?, of(b)?, of(c)?, of(d)?, of(e)?, of(f)?])
    });
    let others: Vec<[Setting; 6]> = others.collect::<Result<_, NoDerivatives>>()?;
    let mut follower = Follower::new(Setting::of(case)?, others, purpose);
    follower.check_work(&intervals)?;
    follower.take_sizes(intervals.iter().map(|interval| &interval.start).chain([&end]));
    follower.begin(&intervals[0])?;
    for (n, interval) in intervals.iter().enumerate() {
        if n % INTERVALS_PER_CHECK == 0 {
            follower.check_growth()?;
            if !goes_on(follower.time.value) {
                return Err(NoDerivatives::Stopped);
            }
        }
        let next = intervals.get(n + 1);
        follower.pass(interval, next.map_or(&end, |next| &next.start), next.map(|next| &next.contacts))?;
    }
    let growth = follower.check_growth()?;
    Ok((follower, growth))
}

impl<'a> Follower<'a> {
    fn new(nominal: Setting<'a>, others: Vec<[Setting<'a>; 6]>, purpose: Purpose) -> Self {
        let bodies = nominal.mount.bodies.len();
        let (size, columns) = (2 * bodies + MORE, others.len() + 2 * bodies);
        let zero = Sloped { value: 0.0, slopes: DVector::zeros(columns) };
        let places = nominal.mount.places.len();
        Self {
            purpose,
            known: HashMap::new(),
            sizes: [0.0; 2],
            w: nominal.start(),
            s: DMatrix::zeros(size, columns),
            start: DMatrix::zeros(0, 0),
            start_w: DVector::zeros(0),
            time: zero.clone(),
            last_event: None,
            events: Vec::new(),
            impacts: Vec::new(),
            peaks: vec![Vec::new(); places],
            squares: vec![zero; places],
            margins: Vec::new(),
            nominal,
            others,
        }
    }

    /// Number of bodies: modes, tuned masses and particles.
    pub(super) fn bodies(&self) -> usize {
        self.nominal.mount.bodies.len()
    }

    /// The changes per relative change of the quantities of what each setting gives.
    pub(super) fn changes<T>(&self, of: impl Fn(&Setting) -> T) -> Vec<T>
    where
        for<'b> &'b T: Sub<&'b T, Output = T>,
        T: Mul<f64, Output = T> + Sub<Output = T> + Add<Output = T>,
    {
        self.others.iter().map(|six| relative(six.each_ref().map(&of))).collect()
    }

    /// The equations of a state of the contacts.
    pub(super) fn known(&mut self, contacts: &Contacts) -> Result<Rc<Known>, NoDerivatives> {
        if let Some(known) = self.known.get(contacts) {
            return Ok(Rc::clone(known));
        }
        let together = NoDerivatives::Together { time_s: self.time.value };
        let of = |setting: &Setting| Equations::new(&setting.mount, contacts, setting.turning);
        let equations = of(&self.nominal).ok_or(together.clone())?;
        let mut changes = Vec::with_capacity(self.others.len());
        for six in &self.others {
            changes.push(Equations::change(all_or_none(six.each_ref().map(of)).ok_or(together.clone())?));
        }
        let known = Rc::new(Known::new(equations, changes, &self.nominal.mount.bodies.mass));
        self.known.insert(contacts.clone(), Rc::clone(&known));
        Ok(known)
    }

    /// A row with its changes, of the present state.
    pub(super) fn sloped(&self, row: &DVector<f64>, changes: &[DVector<f64>]) -> Sloped {
        sloped(row, changes, &self.w, &self.s)
    }

    /// Whether the derivatives come in reasonable time.
    fn check_work(&mut self, intervals: &[StateInterval]) -> Result<(), NoDerivatives> {
        let check = |products: f64| {
            if products > MAX_S * PRODUCTS_PER_S { Err(NoDerivatives::Long) } else { Ok(()) }
        };
        // Equations of each state of the contacts, six for each quantity.
        let kinds = intervals.iter().map(|interval| &interval.contacts).collect::<HashSet<_>>().len();
        let of_equations = (kinds * 6 * self.others.len()) as f64 * (self.s.nrows() as f64).powi(3);
        check(of_equations)?;
        let mut of_steps = 0.0;
        for interval in intervals {
            let known = self.known(&interval.contacts)?;
            of_steps += known.steps(interval.length_s) * known.rates.len() as f64;
        }
        check(of_equations + of_steps * self.s.ncols() as f64 * Series::PRODUCTS)
    }

    /// The largest displacement and velocity in some states.
    fn take_sizes<'w>(&mut self, states: impl Iterator<Item = &'w Vec<f64>>) {
        let bodies = self.bodies();
        for w in states {
            for (i, w) in w.iter().enumerate().take(2 * bodies) {
                self.sizes[i / bodies] = self.sizes[i / bodies].max(self.size_of(i) * w.abs());
            }
        }
        self.sizes[1] = self.sizes[1].max(self.sizes[0] * self.lowest_rad_per_s());
    }

    /// The changes of the start, before the first interval.
    fn begin(&mut self, first: &StateInterval) -> Result<(), NoDerivatives> {
        let is_orbit = self.purpose != Purpose::Motion;
        let bodies = self.bodies();
        // What acts at the first instant may be more than the start says.
        self.check_state(&first.start)?;
        for (column, change) in self.changes(|setting| setting.start()).iter().enumerate() {
            self.s.set_column(column, change);
        }
        let quantities = self.others.len();
        for i in 0..2 * bodies {
            self.s[(i, quantities + i)] = 1.0;
        }
        self.w = DVector::from_column_slice(&first.start);
        let known = self.known(&first.contacts)?;
        for which in 0..known.equations.events.len() {
            if self.is_zero(&known, which) && !is_orbit {
                let guard = known.guard(which, &self.w, &self.s);
                self.margin_of_zero(&guard.slopes, self.size_of_row(&known.equations.guards.row(which).transpose()));
            }
        }
        self.hold(&first.contacts, !is_orbit)?;
        if is_orbit {
            self.take_free_starts();
        }
        self.see_places(&known);
        Ok(())
    }

    /// Takes what moves joints that stick out of the changes, which is rounding, or at the start a disturbance that friction does not let
    /// begin. A start that is given may not move them with a quantity.
    fn hold(&mut self, contacts: &Contacts, is_given: bool) -> Result<(), NoDerivatives> {
        let (known, bodies) = (self.known(contacts)?, self.bodies());
        let mount = &self.nominal.mount;
        let stuck: Vec<usize> = (0..mount.joints.len()).filter(|&j| contacts.slides[j] == Slide::Stuck).collect();
        if stuck.is_empty() {
            return Ok(());
        }
        let mut slips = DMatrix::zeros(stuck.len(), self.s.ncols());
        for (k, &joint) in stuck.iter().enumerate() {
            let row = known.row_of(|equations| equations.slips.row(joint).transpose());
            let slip = self.sloped(&row.0, &row.1);
            slips.row_mut(k).copy_from(&slip.slopes.transpose());
            if is_given {
                self.margin_of_zero(&slip.slopes, self.size_of_row(&row.0));
            }
        }
        let mount = &self.nominal.mount;
        let compliance = DMatrix::from_fn(stuck.len(), stuck.len(), |k, l| mount.compliance[(stuck[k], stuck[l])]);
        if let Some(impulses) = compliance.lu().solve(&slips) {
            for (k, &joint) in stuck.iter().enumerate() {
                for (i, (row, mass)) in mount.joints[joint].row.iter().zip(&mount.bodies.mass).enumerate() {
                    let mut change = self.s.row_mut(bodies + i);
                    change -= impulses.row(k) * (row / mass);
                }
            }
        }
        Ok(())
    }

    /// Follows an interval and what happens at its end; `next`: w after it, and `after` the contacts.
    fn pass(&mut self, interval: &StateInterval, next: &[f64], after: Option<&Contacts>) -> Result<(), NoDerivatives> {
        let known = self.known(&interval.contacts)?;
        let ends = if let End::Event(event) = interval.end { Some(event) } else { None };
        let is_map = self.purpose == Purpose::Map;
        if is_map {
            self.follow_whole(&known, interval);
        } else {
            self.follow_steps(&known, interval, ends);
        }
        let a = &known.equations.a;
        let rate = a * &self.w;
        let end_s = self.time.value + interval.length_s;
        let shift = match ends {
            Some(event) => {
                let together = NoDerivatives::Together { time_s: end_s };
                let which = known.equations.guard(event).ok_or(together.clone())?;
                let guard = known.guard(which, &self.w, &self.s);
                let row = known.equations.guards.row(which);
                let speed = (row * &rate)[0];
                if speed.is_nan() || speed >= 0.0 {
                    return Err(together);
                }
                let bend = (row * (a * &rate))[0];
                // It is missed if it curves away by this.
                if bend > 0.0 {
                    self.margin(0.5 * speed * speed / bend, &guard.slopes);
                }
                guard.slopes / -speed
            }
            None => {
                let mut shift = DVector::zeros(self.s.ncols());
                let moves = self.changes(|setting| setting.time_s(interval.end));
                shift.iter_mut().zip(moves).for_each(|(shift, moves)| *shift = moves);
                shift
            }
        };
        // The squares on both sides of what happens at a moving instant are equal.
        if interval.end == End::Motion {
            for place in 0..self.squares.len() {
                let x = (known.equations.places.row(place) * &self.w)[0];
                self.squares[place].slopes += x * x * &shift;
            }
        }
        let driven = self.s.rows(2 * self.bodies(), MORE).clone_owned();
        self.s += &rate * shift.transpose();
        self.time = Sloped { value: end_s, slopes: shift };
        if let Some(event) = ends {
            self.events.push((end_s, event));
            if !is_map {
                self.margin_of_order();
                self.margin_of_stop(event, interval, after)?;
            }
        }
        self.happen(interval, (&known, next), after)?;
        self.w = DVector::from_column_slice(next);
        self.see_places(&known);
        let Some(after) = after else { return Ok(()) };
        if ends.is_some() {
            self.hold(after, false)?;
        }
        let known = self.known(after)?;
        if !is_map {
            self.margins_of_held(&known);
        }
        // From the instant that moves back to the time of the motion.
        self.s -= &known.equations.a * &self.w * self.time.slopes.transpose();
        if ends.is_some() {
            // An event does not change what drives: without this its rounding would stay for good.
            self.s.rows_mut(2 * self.bodies(), MORE).copy_from(&driven);
        }
        Ok(())
    }

    /// Follows an interval at its length, whatever lies between.
    fn follow_whole(&mut self, known: &Known, interval: &StateInterval) {
        let count = known.steps(interval.length_s);
        if count > MANY_STEPS {
            (self.w, self.s) = known.whole(&self.w, &self.s, self.others.len(), interval.length_s, self.sizes[1]);
            return;
        }
        let length_s = interval.length_s / count;
        for _ in 0..count as usize {
            (self.w, self.s) = Series::new(known, (&self.w, &self.s), length_s).at(1.0);
        }
    }

    /// Follows an interval at its length, and notes what lies between.
    fn follow_steps(&mut self, known: &Known, interval: &StateInterval, ends: Option<Event>) {
        let count = known.steps(interval.length_s);
        let length_s = interval.length_s / count;
        for n in 0..count as usize {
            let series = Series::new(known, (&self.w, &self.s), length_s);
            for place in 0..self.peaks.len() {
                let (x, slopes) = series.row(&known.place_rows(place));
                Series::add_square(&mut self.squares[place], (&x, &slopes), length_s);
                if let Some(at) = Series::turn(&x, |before, after| before * after < 0.0) {
                    let (w, s) = series.at(at);
                    self.see(place, known.place(place, &w, &s));
                }
            }
            for (which, event) in known.equations.events.iter().enumerate() {
                // A guard may leave zero with zero rate: what it does in the first step is then rounding.
                if Some(*event) == ends || (n == 0 && self.is_zero(known, which)) {
                    continue;
                }
                let values = series.values(&known.equations.guards.row(which).transpose());
                if let Some(at) = Series::turn(&values, |before, after| before < 0.0 && after > 0.0) {
                    let (w, s) = series.at(at);
                    let guard = known.guard(which, &w, &s);
                    self.margin(guard.value.max(0.0), &guard.slopes);
                }
            }
            (self.w, self.s) = series.at(1.0);
        }
    }
}
