//! Main loop of the exact driver: advances arc by arc to an event or to the end of the run.

use super::endpoint_proof::Hit;
use super::excitation::{Excitation, Wave};
use super::flow::{ExactState, Flows, Leg, Path};
use super::guards;
use super::motion::{ARCS_PER_ANCHOR, Exact, Fresh, ROUNDINGS, Touch, Work};
use super::observe::Observer;
use super::squeeze::Squeeze;
use super::time::Time;
use crate::integrator::modes::{Coefficients, Contact, Grip, Mode, Sign, signed};
use crate::io::{Invalid, require};
use crate::model::{Initial, Release, SetUp};

/// Number of events at one instant after which a sliver of time is taken without guards; see [`Exact::unresolved`].
const MAX_EVENTS_AT_ONCE: u32 = 64;

/// Length of the sliver, as a fraction of an arc.
const SLIVER: f64 = 1e-6;

impl Exact {
    /// A set-up that starts from `initial` at t = 0.
    ///
    /// # Errors
    /// Names the first value that is not physical.
    pub fn new(set_up: &SetUp, excitation: &Excitation, initial: &Initial) -> Result<Self, Invalid> {
        Self::validate(set_up, excitation, initial)?;
        let c = Coefficients::new(set_up);
        let soft = set_up.particle.map_or([None; 2], |p| {
            p.walls().map(|wall| wall.hertz().map_or(wall.release(), |_| Some(Release::ZeroForce)))
        });
        let flows = Flows::new(set_up, excitation);
        let mode = Mode { grip: Grip::Absent, contact: Contact::Absent };
        let leg = Leg {
            path: Path::Alone,
            sliding: false,
            structure_acceleration: 0.0,
            particle_acceleration: 0.0,
            pressed: 0,
            rest_offset: 0.0,
            step_s: flows.step_s(Path::Alone, 0),
        };
        let mut exact = Self {
            c,
            has_particle: set_up.particle.is_some(),
            has_tmd: set_up.tmd.is_some(),
            soft,
            squeeze: Squeeze::new(set_up, excitation),
            flows,
            excitation: *excitation,
            state: ExactState::default(),
            wave: Wave::default(),
            time: Time::default(),
            mode,
            touch: Touch::Clear,
            left_past_m: 0.0,
            leg,
            fresh: Fresh::default(),
            fastest_m_per_s: 0.0,
            next_break_s: f64::INFINITY,
            started: false,
            arcs_since_anchor: 0,
            events_at_once: 0,
            unresolved: 0,
            work: Work::default(),
        };
        exact.reset(0.0, initial);
        Ok(exact)
    }

    /// Checks what [`Exact::new`] takes.
    ///
    /// # Errors
    /// Names the first value that is not physical.
    pub fn validate(set_up: &SetUp, excitation: &Excitation, initial: &Initial) -> Result<(), Invalid> {
        set_up.validate()?;
        require(!set_up.is_force_driven, "is_force_driven", 1.0, "false: a force is an excitation here")?;
        excitation.validate()?;
        set_up.validate_moving(initial)
    }

    /// Restarts from `initial` at time `t_s` and keeps the tables.
    pub fn reset(&mut self, t_s: f64, initial: &Initial) {
        let joined = self.has_particle || self.has_tmd;
        let mut offset_m = if joined { initial.y_m - initial.x_m } else { 0.0 };
        if self.has_particle {
            // A start "at the wall" is written as y = x ± d and may miss the wall by a rounding.
            let rounding = 4.0 * f64::EPSILON * (initial.x_m.abs() + initial.y_m.abs());
            for side in [-1, 1] {
                let past_m = signed(side, offset_m) - self.c.end(side);
                if past_m >= -rounding && (past_m <= rounding || !self.gives_way(side)) {
                    offset_m = self.c.wall(side);
                }
            }
        }
        self.state = ExactState {
            x_m: initial.x_m,
            v_m_per_s: initial.v_m_per_s,
            offset_m,
            slide_m_per_s: if joined { initial.u_m_per_s - initial.v_m_per_s } else { 0.0 },
        };
        self.time = Time::at(t_s);
        self.anchor();
        self.next_break_s = self.excitation.next_break_s(t_s);
        self.take_touch();
        self.fresh = Fresh::default();
        self.fastest_m_per_s = 0.0;
        self.started = false;
        self.events_at_once = 0;
    }

    /// Whether the wall of `side` is one into which a state may press: what a Hertz wall exerts does not follow from a state.
    pub(super) fn gives_way(&self, side: Sign) -> bool {
        self.soft(side).is_some() && self.squeeze.law(side).is_none()
    }

    /// Takes the contact with a soft wall from the state of a motion that starts now: the particle presses into the wall if it is beyond it and
    /// the wall pushes; else it leaves the wall.
    fn take_touch(&mut self) {
        let side = self.end_of_travel();
        let past_m = signed(side, self.state.offset_m) - self.c.end(side);
        if side == 0 || past_m <= 0.0 || !self.gives_way(side) {
            self.touch = Touch::Clear;
            return;
        }
        let link = self.flows.link(side);
        let push_n = link.stiffness * past_m + link.damping * signed(side, self.state.slide_m_per_s);
        let presses = push_n > 0.0 || self.soft(side) == Some(Release::ZeroPenetration);
        self.touch = if presses { Touch::Pressing(side) } else { Touch::Leaving(side) };
        self.left_past_m = past_m;
    }

    /// Continues from another state at time `t_s`, with the same set-up and excitation; the fastest impact so far is what
    /// the end of a chatter is judged by.
    pub fn resume(&mut self, t_s: f64, state: &ExactState, fastest_m_per_s: f64) {
        self.reset(t_s, &Initial::default());
        self.state = *state;
        self.take_touch();
        self.fastest_m_per_s = fastest_m_per_s;
    }

    /// Approach speed of the fastest impact since the start, m/s.
    #[must_use]
    pub fn fastest_m_per_s(&self) -> f64 {
        self.fastest_m_per_s
    }

    /// Advances to `until_s`, or to where the observer ends the run. Does nothing if `until_s` is in the past.
    pub fn run<O: Observer>(&mut self, until_s: f64, observer: &mut O) {
        if !self.started {
            self.started = true;
            self.start(observer);
        }
        loop {
            let limit_s = until_s.min(self.next_break_s);
            if self.time.until(limit_s) > 0.0 {
                if !observer.goes_on(self.time.seconds()) {
                    return;
                }
                self.advance(limit_s, observer);
            } else if self.time.until(until_s) > 0.0 {
                self.pass_break(observer);
            } else {
                return;
            }
        }
    }

    /// Passes an instant at which the excitation's closed form changes.
    fn pass_break<O: Observer>(&mut self, observer: &mut O) {
        let slip = self.slip();
        let stuck = self.mode.grip == Grip::Stuck;
        let before = self.base_velocity();
        let speed = self.flows.base_share * self.flows.turning * (self.wave.sine.abs() + self.wave.cosine.abs());
        self.next_break_s = self.excitation.next_break_s(self.time.seconds());
        self.anchor();
        let jump = self.base_velocity() - before;
        // A stuck structure keeps the base's previous velocity: a jump of the base velocity makes it slip; rounding
        // does not.
        let stays = stuck && jump.abs() <= ROUNDINGS * speed;
        self.resolve(if stays { 0.0 } else { slip - jump }, observer);
    }

    /// Advances by arcs, at most to `limit_s`, and handles the event at the end of the last arc, if any.
    #[inline]
    fn advance<O: Observer>(&mut self, limit_s: f64, observer: &mut O) {
        if let Some(Hit { side, .. }) = self.fly(limit_s, observer) {
            self.events_at_once = 1;
            self.reach_wall(side, self.slip(), observer);
        } else {
            self.walk(limit_s, observer);
        }
    }

    /// Advances by one arc, using its series.
    fn walk<O: Observer>(&mut self, limit_s: f64, observer: &mut O) {
        let rest_s = self.time.until(limit_s);
        if rest_s <= 0.0 {
            return;
        }
        let side = self.leg.pressed;
        let squeezed = if self.squeeze.law(side).is_some() { Some(self.squeezed(side)) } else { None };
        let h = self.leg.step_s;
        let full = rest_s > h;
        let (state, wave) = (self.state, self.wave);
        let most = if full { 1.0 } else { rest_s / h };
        self.work.arcs_walked += 1;
        let span = squeezed.unwrap_or_else(|| self.flows.span(&self.leg, &state, &wave));
        let (mut at, mut event) = (most, None);
        if self.events_at_once < MAX_EVENTS_AT_ONCE {
            (at, event) = guards::first(self, &span, most);
        } else {
            self.unresolved += 1;
            at = at.min(SLIVER);
        }
        if at > 0.0 {
            self.state = span.state(at);
            if !self.leg.sliding && !self.has_tmd {
                self.state.offset_m = state.offset_m;
                self.state.slide_m_per_s = 0.0;
            }
            if self.events_at_once >= MAX_EVENTS_AT_ONCE && self.wall_side() != 0 {
                self.state.offset_m = self.c.wall(self.wall_side());
            }
            self.wave = self.wave.turned(self.flows.turning * h * at);
            if squeezed.is_some() {
                self.squeeze.add_piece(at);
            }
            let ends = ((&state, &wave), (&self.state, &self.wave));
            self.report(ends.0, ends.1, (self.time, h * at), Some(span), observer);
            self.time = if event.is_none() && !full && at == most { Time::at(limit_s) } else { self.time.plus(h * at) };
            self.fresh = Fresh::default();
            self.events_at_once = 0;
        }
        if let Some(event) = event {
            self.events_at_once += 1;
            self.handle(event, observer);
        }
        self.arcs_since_anchor += 1;
        if self.arcs_since_anchor >= ARCS_PER_ANCHOR {
            self.anchor();
        }
    }
}
