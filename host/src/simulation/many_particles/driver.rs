//! Runs a case with a many-particle damper, step by step.

use damprig_core::integrator::exact;
use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::modes::{Contact, Grip, Mode};
use damprig_core::io::Invalid;
use damprig_particles::{Damper, Motion, Start, State};
use serde::Serialize;

use super::cycles::{CycleMeter, SpheresCycle, SpheresFigures};
use crate::simulation::Case;
use crate::simulation::collector::{Collector, RunOptions, run_in_parts};
use crate::simulation::motion::{ImpactRecord, MotionState, Phase, Piece, Viewer};
use crate::simulation::result::Summary;

/// Results that only a many-particle damper has.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpheresResult {
    /// Step of the calculation, s.
    pub step_s: f64,
    /// Collisions between spheres.
    pub collisions: u64,
    /// Largest overlap of two surfaces over the diameter: a large one means contacts that are too soft.
    pub largest_overlap_ratio: f64,
    /// Lost along the lines of centres of contacts, J.
    pub lost_in_impacts_j: f64,
    /// Lost in friction, J.
    pub lost_in_friction_j: f64,
    /// Lost in the structure's viscous damping, J.
    pub lost_in_structure_j: f64,
    /// Work of base and force, J.
    pub work_j: f64,
    /// What the energy book misses, J: held plus lost, less work and what was held at the start.
    pub energy_error_j: f64,
    /// The cycles, at most the first 100 000.
    pub cycles: Vec<SpheresCycle>,
    /// The last ten cycles together, or all if there are fewer.
    #[serde(skip)]
    pub last: SpheresFigures,
}

/// A motion with its start of the energy book.
struct SpheresRun {
    motion: Motion<exact::Excitation>,
    book_j: f64,
    duration_s: f64,
    steps: u64,
    impacts: Vec<ImpactRecord>,
}

/// Steps between two calls of `go_on`, times the number of spheres: some milliseconds.
const SPHERE_STEPS_PER_CALL: u64 = 100_000;

/// Steps between two calls of `go_on`.
fn steps_per_call(damper: &Damper) -> u64 {
    (SPHERE_STEPS_PER_CALL / damper.count.max(1) as u64).max(1)
}

impl SpheresRun {
    fn new(case: &Case, damper: &Damper, duration_s: f64) -> Result<Self, Invalid> {
        let start = Start { x_m: case.initial.x_m, v_m_per_s: case.initial.v_m_per_s };
        let motion = Motion::new(case.set_up.structure, damper, case.excitation, start)?;
        let book_j = motion.energies().book_j();
        Ok(Self { motion, book_j, duration_s, steps: 0, impacts: Vec::new() })
    }

    /// Makes a step and shows it to a viewer. Nothing is shown beyond the duration.
    fn step(&mut self, viewer: &mut impl Viewer) {
        let from = *self.motion.state();
        let impacts = &mut self.impacts;
        self.motion.step(&mut |impact| {
            impacts.push(ImpactRecord {
                t_s: impact.t_s,
                side: impact.side,
                approach_speed_m_per_s: impact.approach_speed_m_per_s,
                y_m: impact.centre_m,
                damper: None,
            });
        });
        self.steps += 1;
        let to = *self.motion.state();
        let length_s = to.t_s.min(self.duration_s) - from.t_s;
        if length_s > 0.0 && to.t_s >= viewer.pieces_from_s() {
            viewer.piece(&StepPiece { from, to, length_s });
        }
        for impact in self.impacts.drain(..).filter(|impact| impact.t_s <= self.duration_s) {
            viewer.impact(&impact);
        }
    }

    fn reached_s(&self) -> f64 {
        self.motion.state().t_s.min(self.duration_s)
    }

    fn result(&self, damper: &Damper, meter: CycleMeter) -> SpheresResult {
        let energies = self.motion.energies();
        let mut last = SpheresFigures::default();
        meter.last.iter().for_each(|cycle| last.add(cycle));
        SpheresResult {
            step_s: self.motion.step_s(),
            collisions: self.motion.collisions(),
            largest_overlap_ratio: self.motion.largest_overlap_m() / damper.diameter_m,
            lost_in_impacts_j: energies.lost_in_impacts_j,
            lost_in_friction_j: energies.lost_in_friction_j,
            lost_in_structure_j: energies.lost_in_structure_j,
            work_j: energies.work_j,
            energy_error_j: energies.book_j() - self.book_j,
            cycles: meter.cycles,
            last,
        }
    }
}

/// Runs the case.
///
/// # Errors
/// Names a value that is not physical.
pub fn run<V: Viewer>(
    case: &Case,
    damper: &Damper,
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> Result<(Summary, ExactState, SpheresResult), Invalid> {
    let mut at = SpheresRun::new(case, damper, case.run.duration_s)?;
    let mut response = Response::new(wanted);
    let mut meter = CycleMeter::new(case.cycle_s(), case.set_up.structure.mass_kg, &at.motion);
    let steps_per_call = steps_per_call(damper);
    run_in_parts(case.run.duration_s, options, collector, |until_s, collector, go_on| {
        let mut viewer = (&mut response, collector.all());
        while at.reached_s() < until_s {
            if at.steps.is_multiple_of(steps_per_call) && !go_on(at.reached_s()) {
                break;
            }
            at.step(&mut viewer);
            meter.step(&at.motion);
        }
        at.reached_s()
    });
    response.finish(at.reached_s());
    let summary = Summary::of(case, &response, at.reached_s(), 0);
    let end = motion_state(at.motion.state()).state;
    let result = at.result(damper, meter);
    Ok((summary, end, result))
}

/// Runs a case up to `end_s`, s, and gives its response and the figures of its whole cycles from the cycle `first_cycle` on. `None` if it was
/// stopped: `go_on` is asked now and then.
///
/// # Errors
/// Names a value that is not physical.
pub fn counted(
    case: &Case,
    damper: &Damper,
    first_cycle: u64,
    end_s: f64,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<(Response, SpheresFigures)>, Invalid> {
    let mut at = SpheresRun::new(case, damper, end_s)?;
    let cycle_s = case.cycle_s();
    let steps_per_call = steps_per_call(damper);
    let goes_on = |at: &SpheresRun| !at.steps.is_multiple_of(steps_per_call) || go_on();
    while at.motion.state().t_s + at.motion.step_s() < first_cycle as f64 * cycle_s {
        if !goes_on(&at) {
            return Ok(None);
        }
        at.step(&mut ());
    }
    let wanted = Wanted { cycle_s: Some(cycle_s), steady_from_cycle: Some(first_cycle), whole_run: true };
    let mut response = Response::new(wanted);
    response.skip_to(first_cycle);
    let mut meter = CycleMeter::new(cycle_s, case.set_up.structure.mass_kg, &at.motion);
    while at.reached_s() < end_s {
        if !goes_on(&at) {
            return Ok(None);
        }
        at.step(&mut response);
        meter.step(&at.motion);
    }
    response.finish(end_s);
    Ok(Some((response, meter.all)))
}

/// A step as a piece of motion: cubics through places and velocities at its ends.
struct StepPiece {
    from: State,
    to: State,
    /// To its end, or to the end of the run within it, s.
    length_s: f64,
}

fn motion_state(state: &State) -> MotionState {
    MotionState {
        t_s: state.t_s,
        state: ExactState {
            x_m: state.x_m,
            v_m_per_s: state.v_m_per_s,
            offset_m: state.spheres_m - state.x_m,
            slide_m_per_s: state.spheres_m_per_s - state.v_m_per_s,
        },
        z_m: state.drive.base_m,
        base_velocity_m_per_s: state.drive.base_velocity_m_per_s,
    }
}

/// Value and rate at a share of an interval of `step_s` of the cubic with these values and rates at its ends.
fn cubic(share: f64, step_s: f64, from: (f64, f64), to: (f64, f64)) -> (f64, f64) {
    let rise = to.0 - from.0;
    let (a, b) = (step_s * from.1 - rise, rise - step_s * to.1);
    let rest = 1.0 - share;
    let bend = a * rest + b * share;
    let value = from.0 + rise * share + share * rest * bend;
    let rate = rise + (rest - share) * bend + share * rest * (b - a);
    (value, rate / step_s)
}

impl Piece for StepPiece {
    fn start_s(&self) -> f64 {
        self.from.t_s
    }

    fn length_s(&self) -> f64 {
        self.length_s
    }

    fn at(&self, after_s: f64) -> MotionState {
        let (from, to) = (motion_state(&self.from), motion_state(&self.to));
        let step_s = to.t_s - from.t_s;
        let between = |of: fn(&MotionState) -> (f64, f64)| cubic(after_s / step_s, step_s, of(&from), of(&to));
        let (x_m, v_m_per_s) = between(|s| (s.state.x_m, s.state.v_m_per_s));
        let (offset_m, slide_m_per_s) = between(|s| (s.state.offset_m, s.state.slide_m_per_s));
        let (z_m, base_velocity_m_per_s) = between(|s| (s.z_m, s.base_velocity_m_per_s));
        MotionState {
            t_s: from.t_s + after_s,
            state: ExactState { x_m, v_m_per_s, offset_m, slide_m_per_s },
            z_m,
            base_velocity_m_per_s,
        }
    }

    fn phase(&self) -> Phase {
        Phase { mode: Mode { grip: Grip::Absent, contact: Contact::Absent }, pressing: false }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::input::Source;
    use crate::simulation::{cost, simulate};

    fn many(count: usize) -> Case {
        let text = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}
             initial = {{ x_m = 0.01 }}
             run = {{ duration_s = 10 }}
             many_particles = {{ count = {count}, diameter_m = 0.001, mass_ratio = 0.1, restitution = 0.5,
                 contact_time_s = 0.001, clearance_m = 0.02, width_m = 0.1, height_m = 0.05 }}"
        );
        Case::parse(&Source::new("case.toml", text.replace(",\n", ",")), "case").expect("sound")
    }

    #[test]
    fn many_spheres_ask_before_the_first_step_and_after_a_few() {
        let case = many(20_000);
        let damper = case.many_particles.as_ref().expect("spheres");
        let asked = Cell::new(0);
        let go_on = || {
            asked.set(asked.get() + 1);
            asked.get() < 2
        };
        let options = RunOptions { keep: false, longest_part_s: 10.0, go_on: &mut |_| go_on() };
        let result = simulate(&case, &mut (), options).expect("physical");
        let reached_s = result.stopped_at_s.expect("stopped");
        assert!((reached_s / damper.step_s(&case.set_up.structure) - 5.0).abs() < 1e-9, "{reached_s} s");
        asked.set(0);
        assert!(matches!(counted(&case, damper, 0, 10.0, &go_on), Ok(None)));
        assert_eq!(asked.get(), 2);
        assert!(matches!(counted(&case, damper, 3, 10.0, &|| false), Ok(None)));
    }

    #[test]
    fn the_estimate_of_many_spheres_goes_by_their_steps() {
        let case = many(20_000);
        let cost = cost::estimate(&case).expect("physical");
        let step_s = case.many_particles.as_ref().expect("spheres").step_s(&case.set_up.structure);
        assert_eq!(cost.arcs, (10.0 / step_s).ceil());
        assert!(cost.trial_s >= step_s, "{cost:?}");
        // From a nanosecond to a millisecond for a step of a sphere, on any machine.
        let sphere_steps = 20_000.0 * cost.arcs;
        assert!((1e-9..1e-3).contains(&(cost.seconds / sphere_steps)), "{cost:?}");
    }

    #[test]
    fn a_cubic_has_the_values_and_rates_at_its_ends_and_follows_a_cubic() {
        let of = |t: f64| (2.0 - t + 3.0 * t * t - t * t * t, -1.0 + 6.0 * t - 3.0 * t * t);
        for share in [0.0, 0.3, 1.0] {
            let (value, rate) = cubic(share, 0.5, of(1.0), of(1.5));
            let expected = of(1.0 + 0.5 * share);
            assert!((value - expected.0).abs() < 1e-14 && (rate - expected.1).abs() < 1e-14);
        }
    }
}
