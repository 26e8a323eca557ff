//! Bifurcation diagrams: a key of a case is changed in steps, up or down, and the motion goes on from step to step.
//!
//! At each value the cycles after a transient are sampled at drive phase 0: the Poincaré section. A motion that repeats every k
//! cycles has k points, a chaotic one fills a set. Where up and down differ, two motions exist.

use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};

use damprig_core::integrator::exact::{Exact, ExactState};
use damprig_core::io::Invalid;
use damprig_core::model::Initial;
use damprig_structures::State;

use crate::failure::Failure;
use crate::input::Source;
use crate::simulation::multi_degree::driver::{cycles, response_of_cycle};
use crate::simulation::{Case, SetValues};

/// What is swept.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The key with its tables.
    pub key: String,
    /// Its values, rising.
    pub values: Vec<f64>,
    /// Cycles at each value that are not sampled.
    pub settle_cycles: u32,
    /// Cycles at each value that are sampled.
    pub cycles: u32,
}

/// A key, its first and last value and their number, as the command line writes them: `KEY=FROM:TO:COUNT`.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepAxis {
    /// The key with its tables.
    pub key: String,
    /// Its values, rising.
    pub values: Vec<f64>,
}

impl FromStr for SweepAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "write KEY=FROM:TO:COUNT, for example particle.clearance_ratio=10:16:301";
        let (key, range) = text.split_once('=').ok_or_else(|| format!("there is no `=`; {form}"))?;
        let parts: Vec<&str> = range.split(':').collect();
        let [from, to, count] = parts[..] else { return Err(format!("{range:?} is not FROM:TO:COUNT; {form}")) };
        let number = |text: &str| {
            let number: f64 = text.trim().parse().map_err(|_| format!("{text:?} is not a number; {form}"))?;
            if number.is_finite() { Ok(number) } else { Err(format!("{text:?} is not finite; {form}")) }
        };
        let (from, to) = (number(from)?, number(to)?);
        let count: u32 = count.trim().parse().map_err(|_| format!("{count:?} is not a whole number; {form}"))?;
        if to <= from {
            return Err(format!("the last value {to} must be greater than the first, {from}"));
        }
        if !(2..=1_000_000).contains(&count) {
            return Err(format!("the number of values is {count}; it must be from 2 to 1000000"));
        }
        let last = f64::from(count - 1);
        let value = |n: u32| if n + 1 == count { to } else { from + (to - from) * (f64::from(n) / last) };
        Ok(Self { key: key.trim().into(), values: (0..count).map(value).collect() })
    }
}

/// Direction of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the smallest value to the largest.
    Up,
    /// From the largest value to the smallest.
    Down,
}

impl Direction {
    /// Name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
        }
    }
}

/// A cycle: the state at its end, at drive phase 0, and its largest |x|.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Direction of the sweep.
    pub direction: Direction,
    /// Value of the key.
    pub value: f64,
    /// x, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// y − x of particle or tuned mass, m; 0 without one.
    pub offset_m: f64,
    /// y′ − x′, m/s.
    pub slide_m_per_s: f64,
    /// Largest |x| of the cycle, m.
    pub cycle_max_m: f64,
}

/// The case of a file or a dict, with other values, for what needs a sine.
///
/// # Errors
/// A case that is refused, that is not driven by a sine, or that has spheres or, unless they are allowed, several places.
pub(super) fn sine_case(
    (source_name, text, name): (&str, &str, &str),
    values: &SetValues,
    what: &str,
    several_places: bool,
) -> Result<Case, Failure> {
    let case = Case::parse_changed(&Source::new(source_name, text), name, values)?;
    case.refuse_other_engines((source_name, text), values, what, several_places)?;
    if case.is_under_a_sine() {
        return Ok(case);
    }
    Err(Failure::Input(format!(
        "{source_name}: {what} needs a sine\n  write base = {{ kind = \"sine\", … }} or force = {{ kind = \"sine\", … }}"
    )))
}

/// The cases of a sweep, one for each value, with the values of `set` too, whose origin names who gives key and values.
///
/// # Errors
/// A case that the key and a value make and that is refused, or that is not driven by a sine.
pub fn cases(source_name: &str, text: &str, name: &str, sweep: &Sweep, set: &SetValues) -> Result<Vec<Case>, Failure> {
    let case = |value: &f64| {
        let lines = format!("{}{} = {value:?}\n", set.lines, sweep.key);
        let values = SetValues { origin: set.origin.clone(), lines };
        sine_case((source_name, text, name), &values, "a bifurcation diagram", true)
    };
    let cases: Vec<Case> = sweep.values.iter().map(case).collect::<Result<_, _>>()?;
    let modes = |case: &Case| case.multi_degree.as_ref().map(|several| several.set_up.structure.clone());
    if cases.windows(2).any(|pair| modes(&pair[0]) != modes(&pair[1])) {
        return Err(Failure::Input(format!(
            "{source_name}: `{}` changes the natural modes, and the motion goes on in them from value to value\n  sweep a key of a damper or of the \
             excitation",
            sweep.key
        )));
    }
    Ok(cases)
}

/// Where a sweep goes on.
#[derive(Clone, Debug)]
enum SweepStart {
    Initial(Initial),
    Several(State),
}

/// Sweeps in one direction. `go_on` sees the number of values done; its `false` stops the sweep there.
///
/// # Errors
/// A value that is not physical.
pub fn run(
    cases: &[Case],
    sweep: &Sweep,
    direction: Direction,
    go_on: &mut dyn FnMut(usize) -> bool,
) -> Result<Vec<Sample>, Failure> {
    let mut order: Vec<usize> = (0..cases.len()).collect();
    if direction == Direction::Down {
        order.reverse();
    }
    let mut samples = Vec::new();
    let mut start: Option<SweepStart> = None;
    for (done, place) in order.into_iter().enumerate() {
        if !go_on(done) {
            break;
        }
        let (case, value) = (&cases[place], sweep.values[place]);
        let sample = |state: &ExactState, cycle_max_m: f64| Sample {
            direction,
            value,
            x_m: state.x_m,
            v_m_per_s: state.v_m_per_s,
            offset_m: state.offset_m,
            slide_m_per_s: state.slide_m_per_s,
            cycle_max_m,
        };
        let counts = (sweep.settle_cycles, sweep.cycles);
        let mut keep = |state: &ExactState, cycle_max_m| samples.push(sample(state, cycle_max_m));
        let end = match (&case.multi_degree, start.take()) {
            (Some(several), Some(SweepStart::Several(state))) => {
                cycles(case, several, &several.inside(state, &case.excitation), counts, &mut keep)
                    .map(SweepStart::Several)
            }
            (Some(several), _) => cycles(case, several, &several.start, counts, &mut keep).map(SweepStart::Several),
            (None, Some(SweepStart::Initial(state))) => {
                exact_cycles(case, &inside(state, case), counts, &mut keep).map(SweepStart::Initial)
            }
            (None, _) => exact_cycles(case, &case.initial, counts, &mut keep).map(SweepStart::Initial),
        };
        start = Some(end.map_err(|invalid| Failure::Input(format!("{} = {value}: {invalid}", sweep.key)))?);
    }
    Ok(samples)
}

/// Simulates cycles of a case with one degree of freedom from a state: after those of a transient it passes the state at the end of each and its
/// largest |x| to `keep`. Returns the last state.
fn exact_cycles(
    case: &Case,
    initial: &Initial,
    (settle, count): (u32, u32),
    keep: &mut dyn FnMut(&ExactState, f64),
) -> Result<Initial, Invalid> {
    let mut motion = Exact::new(&case.set_up, &case.excitation, initial)?;
    let cycle_s = case.drive_period_s().unwrap_or_else(|| case.cycle_s());
    motion.run(f64::from(settle) * cycle_s, &mut ());
    for cycle in settle..settle + count {
        let mut response = response_of_cycle(cycle, cycle_s);
        motion.run(f64::from(cycle + 1) * cycle_s, &mut response);
        response.finish(motion.time_s());
        keep(motion.state(), response.last_cycle_max_m().unwrap_or(f64::NAN));
    }
    let state = motion.state();
    Ok(Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, y_m: state.y_m(), u_m_per_s: state.u_m_per_s() })
}

/// Sweeps in one or both directions, both at once. `go_on` sees the number of values begun in all directions; its `false` stops the
/// sweeps there.
///
/// # Errors
/// As [`run`].
pub fn run_all(
    cases: &[Case],
    sweep: &Sweep,
    directions: &[Direction],
    go_on: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Vec<Sample>, Failure> {
    let done = AtomicU64::new(0);
    let swept =
        |direction: Direction| run(cases, sweep, direction, &mut |_| go_on(done.fetch_add(1, Ordering::Relaxed)));
    let (first, second) = match directions {
        [first, second, ..] => rayon::join(|| swept(*first), || swept(*second)),
        [one] => (swept(*one), Ok(Vec::new())),
        [] => (Ok(Vec::new()), Ok(Vec::new())),
    };
    Ok([first?, second?].concat())
}

/// The state with a particle that a smaller cavity has no room for put at its wall. A soft wall without Hertz contact gives way.
fn inside(state: Initial, case: &Case) -> Initial {
    let Some(particle) = case.set_up.particle else { return state };
    let [low, high] = particle.ends_m();
    let [gives_way_low, gives_way_high] = particle.walls().map(|wall| wall.spring_and_dashpot().is_some());
    let from = if gives_way_low { f64::NEG_INFINITY } else { low };
    let to = if gives_way_high { f64::INFINITY } else { high };
    Initial { y_m: state.x_m + (state.y_m - state.x_m).clamp(from, to), ..state }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_both_its_ends_and_a_wrong_one_says_what_to_write() {
        let axis: SweepAxis = "a.b=1:2:3".parse().expect("it is valid");
        assert_eq!((axis.key.as_str(), &axis.values[..]), ("a.b", &[1.0, 1.5, 2.0][..]));
        for wrong in ["a.b", "a.b=1:2", "a.b=1:x:3", "a.b=2:1:3", "a.b=1:2:1", "a.b=1:inf:5"] {
            assert!(wrong.parse::<SweepAxis>().is_err(), "{wrong}");
        }
    }
}
