//! Runs the sampled engine step by step for its response and a viewer, compiled in this crate and so at its level of optimisation.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::modes::{Contact, Grip, Mode, Sign, signed};
use damprig_core::integrator::polynomial::{Polynomial, derivative, derivative_increment, increment};
use damprig_core::integrator::sampled::{self, Flight, Joined};
use damprig_core::integrator::units::Units;
use damprig_core::io::Invalid;
use damprig_core::model::{Initial, SetUp};

use super::{AccumulationRecord, ImpactRecord, MotionState, Phase, Piece, Viewer};

/// A motion on samples of its base, up to an end that may lie within a step.
pub struct SampledRun {
    motion: Joined<f64>,
    at: Reached,
}

impl SampledRun {
    /// A set-up in steps of `step_s` from `initial` up to `duration_s`, s.
    ///
    /// # Errors
    /// Names a value that is not physical, or that needs shorter steps.
    pub fn new(
        set_up: &SetUp,
        initial: &Initial,
        [step_s, duration_s]: [f64; 2],
        wanted: Wanted,
    ) -> Result<Self, Invalid> {
        let motion = Joined::joined(set_up, Units::metres(step_s), initial)?;
        let at = Reached {
            step: 0,
            step_s,
            duration_s,
            reached_s: 0.0,
            state: ExactState::default(),
            mode: Mode { grip: Grip::Absent, contact: Contact::Absent },
            walls: [-1, 1].map(|side| SoftWall::of(set_up, side, step_s)),
            pressing: None,
            response: Response::new(wanted),
        };
        Ok(Self { motion, at })
    }

    /// Makes a step. Nothing is shown beyond the end.
    pub fn step(&mut self, base: &BaseSegment<f64>, viewer: &mut dyn Viewer) {
        self.motion.step(base, &mut SampledObserver { at: &mut self.at, viewer });
        self.at.step += 1;
    }

    /// Time reached, s.
    #[must_use]
    pub fn reached_s(&self) -> f64 {
        self.at.reached_s
    }

    /// State there.
    #[must_use]
    pub fn state(&self) -> ExactState {
        self.at.state
    }

    /// Steps in which the event search was given up.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.motion.unresolved()
    }

    /// The response up to there.
    #[must_use]
    pub fn into_response(mut self) -> Response {
        self.at.response.finish(self.at.reached_s);
        self.at.response
    }
}

/// A soft wall.
#[derive(Clone, Copy, Debug)]
struct SoftWall {
    side: Sign,
    /// Distance from y = x towards its side, m.
    end_m: f64,
    stiffness_n_per_m: f64,
    /// c1 over the time step, N/m.
    damping_n_per_m: f64,
}

impl SoftWall {
    fn of(set_up: &SetUp, side: Sign, step_s: f64) -> Option<Self> {
        let (particle, place) = (set_up.particle?, usize::from(side > 0));
        let (stiffness_n_per_m, damping_n_s_per_m) = particle.walls()[place].spring_and_dashpot()?;
        let end_m = signed(side, particle.ends_m()[place]);
        Some(Self { side, end_m, stiffness_n_per_m, damping_n_per_m: damping_n_s_per_m / step_s })
    }

    /// The largest force of a flight in contact, N.
    fn largest_force_n(&self, flight: &Flight<f64>, length: f64) -> f64 {
        let side = self.side;
        let mut force = derivative(&flight.offset).map(|rate| signed(side, self.damping_n_per_m * rate));
        for (f, w) in force.iter_mut().zip(&flight.offset) {
            *f += signed(side, self.stiffness_n_per_m * w);
        }
        force[0] -= self.stiffness_n_per_m * self.end_m;
        let value = |p: &Polynomial<f64>, at: f64| p[0] + increment(p, at);
        let rate = derivative(&force);
        let ends = value(&force, 0.0).max(value(&force, length));
        if !(rate[0] > 0.0 && value(&rate, length) < 0.0) {
            return ends;
        }
        let (mut low, mut high) = (0.0, length);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if value(&rate, middle) > 0.0 { low = middle } else { high = middle }
        }
        ends.max(value(&force, low))
    }
}

/// Where the run is, and its response so far.
struct Reached {
    step: u64,
    step_s: f64,
    duration_s: f64,
    reached_s: f64,
    state: ExactState,
    mode: Mode,
    /// The soft walls at the negative and the positive side.
    walls: [Option<SoftWall>; 2],
    /// Side of the present contact with one of them.
    pressing: Option<Sign>,
    response: Response,
}

impl Reached {
    /// The soft wall of the present contact.
    fn pressed(&self) -> Option<&SoftWall> {
        self.walls[usize::from(self.pressing? > 0)].as_ref()
    }

    /// The time `after` steps from the start of the present one, s.
    fn time_s(&self, after: f64) -> f64 {
        (self.step as f64 + after) * self.step_s
    }
}

/// Passes the sampled driver's motion to the response and a viewer, up to the end of the run.
struct SampledObserver<'a> {
    at: &'a mut Reached,
    viewer: &'a mut dyn Viewer,
}

impl sampled::SampledObserver<f64> for SampledObserver<'_> {
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
        let pressed_n = at.pressed().map(|wall| wall.largest_force_n(flight, length_s / at.step_s));
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

    fn impact(&mut self, impact: &sampled::SampledImpact<f64>) {
        let at = &mut *self.at;
        let t_s = at.time_s(impact.at);
        if t_s <= at.duration_s {
            let approach_speed_m_per_s = impact.approach / at.step_s;
            let record =
                ImpactRecord { t_s, side: impact.side, approach_speed_m_per_s, y_m: at.state.y_m(), damper: None };
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
        self.at.pressing = Some(side);
    }

    fn contact_end(&mut self, after: f64, _: Sign, separation: f64) {
        let at = &mut *self.at;
        at.pressing = None;
        at.response.take_contact_end(at.time_s(after), separation / at.step_s);
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
