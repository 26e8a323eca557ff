//! Runs a case on a recorded base motion with the sampled driver, one sample interval after the other.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::modes::{Contact, Grip, Mode, Sign, signed};
use damprig_core::integrator::polynomial::{Polynomial, derivative, derivative_increment, increment};
use damprig_core::integrator::sampled::{self, Flight, Joined, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::io::Invalid;
use damprig_core::model::Wall;

use super::Case;
use super::collector::{Collector, RunOptions, run_in_parts};
use super::motion::{AccumulationRecord, ImpactRecord, MotionState, Phase, Piece, Viewer};
use super::result::Summary;
use crate::motion_record::Record;

/// Runs the case on its record.
///
/// # Errors
/// Names a value that is not physical, or a natural frequency too high for the record's sample rate.
pub(super) fn run<V: Viewer>(
    case: &Case,
    record: &Record,
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> Result<(Summary, ExactState), Invalid> {
    let steps = Sampled::<f64>::steps_per_sample(&case.set_up, record.step_s)?;
    let units = Units::metres(record.step_s / f64::from(steps));
    let motion = Joined::<f64>::joined(&case.set_up, units, &case.initial)?;
    Ok(play(case, record, (motion, steps), wanted, collector, options))
}

/// Sample intervals between two calls of `go_on`; each has at most 255 steps.
const INTERVALS_PER_CHECK: u64 = 64;

fn play<V: Viewer>(
    case: &Case,
    record: &Record,
    (mut motion, steps): (Joined<f64>, u8),
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> (Summary, ExactState) {
    let step_s = motion.units().step_s;
    let mut play = record.play();
    let mut at = SampledRun {
        step: 0,
        step_s,
        duration_s: case.run.duration_s,
        reached_s: 0.0,
        state: ExactState::default(),
        mode: Mode { grip: Grip::Absent, contact: Contact::Absent },
        wall: SoftWall::of(case, step_s),
        response: Response::new(wanted),
    };
    let mut interval = 0_u64;
    run_in_parts(case.run.duration_s, options, collector, |until_s, collector, go_on| {
        let mut viewer = collector.all();
        while interval as f64 * record.step_s < until_s {
            if interval % INTERVALS_PER_CHECK == INTERVALS_PER_CHECK - 1 && !go_on(at.reached_s) {
                break;
            }
            let segment = play.next_segment();
            for part in 0..steps {
                at.step = interval * u64::from(steps) + u64::from(part);
                let mut observer = SampledObserver { at: &mut at, viewer: &mut viewer };
                motion.step_observed(&segment.part(part, steps), &mut observer);
            }
            interval += 1;
        }
        at.reached_s
    });
    at.response.finish(at.reached_s);
    let summary = Summary {
        rms_x_minus_z_m: Some(at.response.rms_x_minus_z_m()),
        record_start_jump_m_per_s: record.start_jump_m_per_s(),
        ..Summary::of(&at.response, at.reached_s, motion.unresolved())
    };
    (summary, at.state)
}

/// The soft wall of a case.
#[derive(Clone, Copy, Debug)]
struct SoftWall {
    clearance_m: f64,
    stiffness_n_per_m: f64,
    /// c1 over the time step, N/m.
    damping_n_per_m: f64,
    /// Side of the present contact.
    pressing: Option<Sign>,
}

impl SoftWall {
    fn of(case: &Case, step_s: f64) -> Option<Self> {
        let particle = case.set_up.particle?;
        let Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } = particle.wall else { return None };
        Some(Self {
            clearance_m: particle.clearance_m,
            stiffness_n_per_m,
            damping_n_per_m: damping_n_s_per_m / step_s,
            pressing: None,
        })
    }

    /// The largest force of a flight in contact, N; `None` without contact.
    fn largest_force_n(&self, flight: &Flight<f64>, length: f64) -> Option<f64> {
        let side = self.pressing?;
        let mut force = derivative(&flight.offset).map(|rate| signed(side, self.damping_n_per_m * rate));
        for (f, w) in force.iter_mut().zip(&flight.offset) {
            *f += signed(side, self.stiffness_n_per_m * w);
        }
        force[0] -= self.stiffness_n_per_m * self.clearance_m;
        let value = |p: &Polynomial<f64>, at: f64| p[0] + increment(p, at);
        let rate = derivative(&force);
        let ends = value(&force, 0.0).max(value(&force, length));
        if !(rate[0] > 0.0 && value(&rate, length) < 0.0) {
            return Some(ends);
        }
        let (mut low, mut high) = (0.0, length);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if value(&rate, middle) > 0.0 { low = middle } else { high = middle }
        }
        Some(ends.max(value(&force, low)))
    }
}

/// Where the run is, and its response so far.
struct SampledRun {
    step: u64,
    step_s: f64,
    duration_s: f64,
    reached_s: f64,
    state: ExactState,
    mode: Mode,
    wall: Option<SoftWall>,
    response: Response,
}

impl SampledRun {
    /// The time `after` steps from the start of the present one, s.
    fn time_s(&self, after: f64) -> f64 {
        (self.step as f64 + after) * self.step_s
    }
}

/// Passes the sampled driver's motion to the response and a viewer, up to the end of the run.
struct SampledObserver<'a, V> {
    at: &'a mut SampledRun,
    viewer: &'a mut V,
}

impl<V: Viewer> sampled::Observer<f64> for SampledObserver<'_, V> {
    fn mode(&mut self, mode: Mode) {
        self.at.mode = mode;
    }

    fn flight(&mut self, start: f64, length: f64, flight: &Flight<f64>) {
        let at = &mut *self.at;
        let start_s = at.time_s(start);
        // The record's last interval may reach beyond the end of the run.
        let mut length_s = length * at.step_s;
        let ends = start_s + length_s >= at.duration_s * (1.0 - 1e-15);
        if ends {
            length_s = length_s.min(at.duration_s - start_s);
        }
        if length_s <= 0.0 {
            return;
        }
        let pressed_n = at.wall.and_then(|wall| wall.largest_force_n(flight, length_s / at.step_s));
        if let Some(pressed_n) = pressed_n {
            at.response.take_force(|least_n| least_n.max(pressed_n));
        }
        let phase = Phase { mode: at.mode, pressing: pressed_n.is_some() };
        let piece = FlightPiece { start_s, length_s, step_s: at.step_s, flight, phase };
        at.response.piece(&piece);
        self.viewer.piece(&piece);
        at.state = piece.at(length_s).state;
        at.reached_s = if ends { at.duration_s } else { start_s + length_s };
    }

    fn impact(&mut self, impact: &sampled::Impact<f64>) {
        let at = &mut *self.at;
        let t_s = at.time_s(impact.at);
        if t_s <= at.duration_s {
            let approach_speed_m_per_s = impact.approach / at.step_s;
            let record = ImpactRecord { t_s, side: impact.side, approach_speed_m_per_s, y_m: at.state.y_m() };
            Viewer::impact(&mut at.response, &record);
            self.viewer.impact(&record);
        }
    }

    fn accumulation(&mut self, after: f64, side: Sign) {
        let t_s = self.at.time_s(after);
        if t_s <= self.at.duration_s {
            self.at.response.take_accumulation();
            self.viewer.accumulation(&AccumulationRecord { t_s, side });
        }
    }

    fn contact_start(&mut self, _: f64, side: Sign) {
        if let Some(wall) = &mut self.at.wall {
            wall.pressing = Some(side);
        }
    }

    fn contact_end(&mut self, after: f64, _: Sign, separation: f64) {
        let at = &mut *self.at;
        if let Some(wall) = &mut at.wall {
            wall.pressing = None;
            at.response.take_contact_end(at.time_s(after), separation / at.step_s);
        }
    }
}

/// A flight in simulated time.
struct FlightPiece<'a> {
    start_s: f64,
    length_s: f64,
    step_s: f64,
    flight: &'a Flight<f64>,
    phase: Phase,
}

impl Piece for FlightPiece<'_> {
    fn start_s(&self) -> f64 {
        self.start_s
    }

    fn length_s(&self) -> f64 {
        self.length_s
    }

    fn at(&self, after_s: f64) -> MotionState {
        let after = after_s / self.step_s;
        let of =
            |p: &Polynomial<f64>| (p[0] + increment(p, after), (p[1] + derivative_increment(p, after)) / self.step_s);
        let (x_m, v_m_per_s) = of(&self.flight.x);
        let (offset_m, slide_m_per_s) = of(&self.flight.offset);
        let (stretch_m, slip_m_per_s) = of(&self.flight.stretch);
        MotionState {
            t_s: self.start_s + after_s,
            state: ExactState { x_m, v_m_per_s, offset_m, slide_m_per_s },
            z_m: x_m - stretch_m,
            base_velocity_m_per_s: v_m_per_s - slip_m_per_s,
        }
    }

    fn phase(&self) -> Phase {
        self.phase
    }
}

#[cfg(test)]
mod tests {
    use crate::input::Source;
    use crate::simulation::{Case, RunOptions, simulate};

    #[test]
    fn a_run_on_a_record_is_stopped_within_a_part() {
        let folder = tempfile::tempdir().expect("a folder");
        let rows: String = (0..2001).map(|n| format!("{},{}\n", f64::from(n) * 0.005, 0.001)).collect();
        std::fs::write(folder.path().join("motion.csv"), format!("time_s,acceleration_g\n{rows}")).expect("a file");
        let text = r#"structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
                      base = { kind = "record", file = "motion.csv", quantity = "acceleration", unit = "g" }
                      run = { duration_s = 10 }"#;
        let file = folder.path().join("case.toml");
        std::fs::write(&file, text).expect("a file");
        let case = Case::parse(&Source::read(&file).expect("a text"), "case").expect("a case");
        let mut left = 5;
        let mut go_on = |_: f64| {
            left -= 1;
            left > 0
        };
        // With a single part, a check between parts would never happen.
        let options = RunOptions { keep: false, longest_part_s: 1e9, go_on: &mut go_on };
        let answer = simulate(&case, &mut (), options).expect("it is physical");
        let stopped_at_s = answer.stopped_at_s.expect("it was stopped");
        assert!(stopped_at_s > 0.3 && stopped_at_s < 2.0, "{stopped_at_s}");
    }
}
