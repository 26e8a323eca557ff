//! Basins of attraction: which motion each start of a grid ends on.
//!
//! A start is followed until its motion repeats after at most [`MAX_PERIODS`] drive periods. Motions whose states at the same drive phase
//! agree are one attractor. Where nothing fixes a place, all places count as one: that of a particle that meets no wall, and that of a
//! structure which its friction damper holds.

use std::sync::atomic::{AtomicU64, Ordering};

use damprig_core::analysis::section::Section;
use damprig_core::integrator::exact::{Arc, Exact, ExactState, Impact, Observer};
use damprig_core::integrator::modes::Grip;
use damprig_core::io::Invalid;
use rayon::prelude::*;

use super::bifurcation::{SweepAxis, sine_case};
use crate::failure::Failure;
use crate::simulation::motion::Piece;
use crate::simulation::multi_degree::driver::response_of_cycle;
use crate::simulation::{Case, SetValues, initial};

/// Most drive periods after which a motion repeats.
pub const MAX_PERIODS: usize = 16;

/// Periods between two looks at whether the motion repeats.
const BLOCK: u32 = 100;

/// Periods that a look takes.
const LOOK: u32 = 2 * MAX_PERIODS as u32;

/// Fewest periods of a start: those of two looks.
pub const MIN_CYCLES: u32 = 2 * (BLOCK + LOOK);

/// Most starts: their table has 60 MB.
pub const MAX_STARTS: usize = 1_000_000;

/// States of one attractor agree within this share of the motion.
const SAME: f64 = 1e-3;

/// A motion has settled when, as its states approach each other, it is within this share of where it goes.
const SETTLED: f64 = 1e-4;

/// Changes of this share from period to period are roundings.
const ROUNDED: f64 = 1e-10;

/// Impacts slower than this share of the motion's speeds are those of a particle that drifts from wall to wall, slower from time to time: the
/// motion that it approaches has none.
const SLOW: f64 = 1e-3;

/// Place of the compared states after drive phase 0, in periods: impacts of simple orbits are elsewhere.
const SECTION: f64 = 0.37;

/// The starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Two keys of `initial` with their values; the first one varies fastest.
    pub axes: [SweepAxis; 2],
    /// Most drive periods of a motion.
    pub most_cycles: u32,
}

impl Grid {
    /// Its number of starts.
    #[must_use]
    pub fn starts(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// The values of both keys at a start.
    #[must_use]
    pub fn at(&self, start: usize) -> [f64; 2] {
        let [x, y] = &self.axes;
        [x.values[start % x.values.len()], y.values[start / x.values.len()]]
    }
}

/// A periodic motion on which starts end.
#[derive(Clone, Debug, PartialEq)]
pub struct Attractor {
    /// Drive periods after which it repeats.
    pub periods: usize,
    /// Impacts in those periods.
    pub impacts: u32,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Its state at drive phase 0 with the smallest x.
    pub state: ExactState,
    /// Starts that end on it.
    pub starts: usize,
    /// Its states at the section.
    section: Vec<ExactState>,
    /// Whether the friction damper holds the structure all the time.
    is_held: bool,
}

impl Attractor {
    /// What it is, in words: "repeats every cycle, 2 impacts, max |x| 12.3 mm".
    #[must_use]
    pub fn description(&self) -> String {
        let every = if self.periods == 1 { "every cycle".into() } else { format!("every {} cycles", self.periods) };
        let impacts = match self.impacts {
            0 => "no impact".into(),
            1 => "1 impact".into(),
            count => format!("{count} impacts"),
        };
        format!("repeats {every}, {impacts}, max |x| {:.4} mm", 1e3 * self.max_abs_x_m)
    }

    /// Whether it is the same motion, begun anywhere.
    fn is(&self, other: &Self) -> bool {
        if (self.periods, self.impacts > 0, self.is_held) != (other.periods, other.impacts > 0, other.is_held) {
            return false;
        }
        let (count, compared) = (self.periods, ComparedState { place: !self.is_held, second: self.impacts > 0 });
        let size = MotionSize::of(&self.section);
        (0..count).any(|shift| {
            (0..count).all(|n| size.apart(&self.section[n], &other.section[(n + shift) % count], compared) <= SAME)
        })
    }
}

/// What of two states is compared beside the velocity of the structure.
#[derive(Clone, Copy)]
struct ComparedState {
    /// Its place.
    place: bool,
    /// The second mass.
    second: bool,
}

/// Sizes of a motion.
struct MotionSize {
    length_m: f64,
    speed_m_per_s: f64,
}

impl MotionSize {
    fn of(states: &[ExactState]) -> Self {
        let most = |of: fn(&ExactState) -> f64| states.iter().map(of).fold(0.0, f64::max);
        Self {
            length_m: most(|s| s.x_m.abs().max(s.offset_m.abs())),
            speed_m_per_s: most(|s| s.v_m_per_s.abs().max(s.slide_m_per_s.abs())),
        }
    }

    /// The difference of two states as a share of the motion.
    fn apart(&self, a: &ExactState, b: &ExactState, compared: ComparedState) -> f64 {
        let share = |difference: f64, size: f64| if difference == 0.0 { 0.0 } else { difference.abs() / size };
        let mut most = share(a.v_m_per_s - b.v_m_per_s, self.speed_m_per_s);
        if compared.place {
            most = most.max(share(a.x_m - b.x_m, self.length_m));
        }
        if compared.second {
            most = most.max(share(a.offset_m - b.offset_m, self.length_m));
            most = most.max(share(a.slide_m_per_s - b.slide_m_per_s, self.speed_m_per_s));
        }
        most
    }

    /// The smallest number of periods after which the states repeat, and their largest change over it.
    fn period(&self, states: &[ExactState], compared: ComparedState) -> Option<(usize, f64)> {
        let change =
            |k: usize| states.iter().zip(&states[k..]).map(|(a, b)| self.apart(a, b, compared)).fold(0.0, f64::max);
        (1..=MAX_PERIODS).map(|k| (k, change(k))).find(|(_, change)| *change <= SAME)
    }
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Basins {
    /// The attractors, that of the most starts first.
    pub attractors: Vec<Attractor>,
    /// Of each start the place of its attractor; `None` if its motion does not repeat.
    pub ends: Vec<Option<usize>>,
    /// Of each start the last state, at drive phase 0.
    pub states: Vec<ExactState>,
    /// Of each start whether the particle has passed a soft wall ([`Exact::passed_wall_by_m`]): it has no attractor then.
    pub passed: Vec<bool>,
    /// Starts in whose motion too many events fell on one instant.
    pub unresolved: usize,
}

impl Basins {
    /// Numbers of starts whose motion does not repeat, and of those whose particle passes a soft wall.
    #[must_use]
    pub fn without_attractor(&self) -> [usize; 2] {
        let passed = self.passed.iter().filter(|passed| **passed).count();
        [self.ends.iter().filter(|end| end.is_none()).count() - passed, passed]
    }
}

/// Counts impacts that are not slow, and measures how far the structure slips in its friction damper.
#[derive(Default)]
struct Course {
    /// Slower impacts are not counted, m/s.
    slow_m_per_s: f64,
    impacts: u32,
    fastest_m_per_s: f64,
    slipped_m: f64,
    /// Whether it has been held at all.
    was_held: bool,
}

impl Course {
    /// Whether the friction damper holds the structure during a look: in a period it slips by no more than this share of the motion.
    fn is_held(&self, size: &MotionSize) -> bool {
        self.was_held && self.slipped_m <= SAME * size.length_m * f64::from(LOOK)
    }
}

impl Observer for Course {
    fn arc(&mut self, arc: &Arc<'_>) {
        if arc.mode.grip == Grip::Stuck {
            self.was_held = true;
        } else if self.was_held {
            let [from_m, to_m] = [0.0, arc.length_s].map(|after_s| arc.at(after_s)).map(|at| at.state.x_m - at.z_m);
            self.slipped_m += (to_m - from_m).abs();
        }
    }

    fn impact(&mut self, impact: &Impact) {
        self.impacts += u32::from(impact.approach_speed_m_per_s > self.slow_m_per_s);
        self.fastest_m_per_s = self.fastest_m_per_s.max(impact.approach_speed_m_per_s);
    }
}

/// The end of a start.
struct StartEnd {
    attractor: Option<Attractor>,
    state: ExactState,
    has_passed: bool,
    is_unresolved: bool,
}

/// Follows every start of a case on all cores. `go_on` sees how many starts are done; its `false` ends the work, and nothing is answered.
///
/// # Errors
/// A key that is none of `initial`, too many starts, a start that is refused, or a case that is not driven by a sine or has several places.
pub fn run(
    (source_name, text, name): (&str, &str, &str),
    grid: &Grid,
    set: &SetValues,
    go_on: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Option<Basins>, Failure> {
    let keys =
        [&initial::X, &initial::V, &initial::Y, &initial::U].map(|quantity| format!("initial.{}", quantity.name()));
    if let Some(axis) = grid.axes.iter().find(|axis| !keys.contains(&axis.key)) {
        let keys = keys.join(", ");
        return Err(Failure::Input(format!(
            "`{}` is no start\n  a basin is a set of starts of one case: take two of {keys}",
            axis.key
        )));
    }
    if grid.starts() > MAX_STARTS {
        return Err(Failure::Input(format!("{} starts are too many: at most {MAX_STARTS}", grid.starts())));
    }
    if grid.axes[0].key == grid.axes[1].key {
        return Err(Failure::Input(format!("both axes have the key `{}`: take two keys", grid.axes[0].key)));
    }
    let done = AtomicU64::new(0);
    let follow = |start: usize| -> Result<Option<StartEnd>, Failure> {
        if !go_on(done.fetch_add(1, Ordering::Relaxed)) {
            return Ok(None);
        }
        let [x, y] = grid.at(start);
        let lines = format!("{}{} = {x:?}\n{} = {y:?}\n", set.lines, grid.axes[0].key, grid.axes[1].key);
        let values = SetValues { origin: set.origin.clone(), lines };
        let case = sine_case((source_name, text, name), &values, "a map of basins", false)?;
        end(&case, grid.most_cycles)
            .map(Some)
            .map_err(|invalid| Failure::Input(format!("start {}: {invalid}", start + 1)))
    };
    let ends: Option<Vec<StartEnd>> = (0..grid.starts()).into_par_iter().map(follow).collect::<Result<_, _>>()?;
    Ok(ends.map(gathered))
}

/// Follows a motion until it repeats.
fn end(case: &Case, most_cycles: u32) -> Result<StartEnd, Invalid> {
    let cycle_s = case.drive_period_s().unwrap_or_else(|| case.cycle_s());
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    motion.run(SECTION * cycle_s, &mut ());
    let mut section = Section::new(motion, cycle_s);
    let (mut taken, mut repeats, mut slow_m_per_s, mut is_held) = (0, None, 0.0, false);
    let mut before: Option<(usize, f64)> = None;
    while repeats.is_none() && taken + BLOCK + LOOK <= most_cycles {
        section.skip(BLOCK.into());
        let mut course = Course::default();
        let states: Vec<ExactState> = (0..LOOK).map(|_| section.next(&mut course)).collect();
        taken += BLOCK + LOOK;
        let size = MotionSize::of(&states);
        slow_m_per_s = SLOW * size.speed_m_per_s;
        is_held = course.is_held(&size);
        let compared = ComparedState { place: !is_held, second: course.fastest_m_per_s > slow_m_per_s };
        let found = size.period(&states, compared);
        if let Some((periods, _)) = found.filter(|found| is_settled(*found, before)) {
            repeats = Some(states[states.len() - periods..].to_vec());
        }
        before = found;
    }
    let mut motion = section.into_motion();
    let first = taken + 1;
    motion.run(f64::from(first) * cycle_s, &mut ());
    let mut found = Attractor {
        periods: repeats.as_ref().map_or(1, Vec::len),
        impacts: 0,
        max_abs_x_m: 0.0,
        state: *motion.state(),
        starts: 0,
        section: Vec::new(),
        is_held,
    };
    let mut course = Course { slow_m_per_s, ..Course::default() };
    for cycle in first..first + found.periods as u32 {
        if motion.state().x_m < found.state.x_m {
            found.state = *motion.state();
        }
        let mut response = response_of_cycle(cycle, cycle_s);
        motion.run(f64::from(cycle + 1) * cycle_s, &mut (&mut response, &mut course));
        response.finish(motion.time_s());
        found.max_abs_x_m = found.max_abs_x_m.max(response.last_cycle_max_m().unwrap_or(0.0));
    }
    found.impacts = course.impacts;
    let has_passed = motion.passed_wall_by_m().is_some();
    Ok(StartEnd {
        attractor: repeats.filter(|_| !has_passed).map(|section| Attractor { section, ..found }),
        state: *motion.state(),
        has_passed,
        is_unresolved: motion.unresolved() > 0,
    })
}

/// Whether a motion has settled whose states change by a share over some periods, and did at the look before: what is left of its transient follows
/// from how much smaller the change has become.
fn is_settled((periods, change): (usize, f64), before: Option<(usize, f64)>) -> bool {
    if change <= ROUNDED {
        return true;
    }
    let Some((_, earlier)) = before.filter(|before| before.0 == periods) else { return false };
    let rate = (change / earlier).powf(periods as f64 / f64::from(BLOCK + LOOK));
    rate < 1.0 && change / (1.0 - rate) <= SETTLED
}

/// Gathers equal attractors, those of the most starts first.
fn gathered(ends: Vec<StartEnd>) -> Basins {
    let mut found: Vec<Attractor> = Vec::new();
    let mut basins = Basins {
        passed: ends.iter().map(|end| end.has_passed).collect(),
        unresolved: ends.iter().filter(|end| end.is_unresolved).count(),
        ..Basins::default()
    };
    for end in ends {
        basins.states.push(end.state);
        basins.ends.push(end.attractor.map(|attractor| {
            let place = found.iter().position(|known| known.is(&attractor)).unwrap_or_else(|| {
                found.push(attractor);
                found.len() - 1
            });
            found[place].starts += 1;
            place
        }));
    }
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by_key(|place| std::cmp::Reverse(found[*place].starts));
    let mut rank = vec![0; found.len()];
    order.iter().enumerate().for_each(|(number, place)| rank[*place] = number);
    basins.ends.iter_mut().flatten().for_each(|place| *place = rank[*place]);
    basins.attractors = order.into_iter().map(|place| found[place].clone()).collect();
    basins
}
