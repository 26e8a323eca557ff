//! Main loop of the exact driver: advances arc by arc to an event or to the end of the run.

use core::cell::OnceCell;

use super::excitation::{Excitation, Wave};
use super::flow::{ExactState, Flows, Leg, Path, Span};
use super::guards;
use super::observe::{Arc, Observer};
use super::quick::Hit;
use super::time::Time;
use crate::integrator::modes::{self, Coefficients, Contact, Grip, Mode, Sign, Situation, sign, signed};
use crate::io::Invalid;
use crate::model::{Initial, Release, SetUp, Wall};

/// Arcs after which the rotating pair is computed afresh from the time, so that its rounding error cannot accumulate.
pub(super) const ARCS_PER_ANCHOR: u32 = 64;

/// Number of events at one instant after which a sliver of time is taken without guards; see [`Exact::unresolved`].
const MOST_EVENTS_AT_ONCE: u32 = 64;

/// Length of the sliver, as a fraction of an arc.
const SLIVER: f64 = 1e-6;

/// State of the contact with a soft wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Touch {
    /// No contact: the particle is between the walls, or there is no soft wall.
    #[default]
    Clear,
    /// The particle presses into the wall on that side.
    Pressing(Sign),
    /// The wall has released the particle, which is not yet back inside the clearance.
    Leaving(Sign),
}

/// Roundings that may remain in a sum of five cancelling terms, each the result of a few operations.
pub(super) const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// For guards that start an arc at their limit: the number of leading coefficients that are zero by definition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fresh {
    pub gap_side: Sign,
    pub gap: usize,
    pub slide: usize,
    pub slip: usize,
    pub press: usize,
}

/// Counters of the computing effort of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Arcs decided by the end-point proof.
    pub arcs_proved: u64,
    /// Arcs decided by walking along their guards.
    pub arcs_walked: u64,
    /// Impacts located by Newton's method.
    pub impacts_located: u64,
    /// Evaluations of a series for those impacts.
    pub newton_steps: u64,
    /// Evaluations of a sine and cosine pair.
    pub sines: u64,
}

/// A set-up in motion under an excitation in closed form.
///
/// ```
/// use damprig_core::integrator::exact::{Exact, Excitation};
/// use damprig_core::model::{Initial, SetUp, Structure};
///
/// let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0));
/// let initial = Initial { x_m: 0.035, ..Initial::default() };
/// let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial)?;
/// motion.run(0.2, &mut ()); // half a period
/// assert!((motion.state().x_m + 0.035).abs() < 1e-15);
/// # Ok::<(), damprig_core::io::Invalid>(())
/// ```
#[derive(Clone, Debug)]
pub struct Exact {
    pub(super) c: Coefficients<f64>,
    pub(super) has_particle: bool,
    pub(super) has_tmd: bool,
    pub(super) soft: Option<Release>,
    pub(super) flows: Flows,
    pub(super) excitation: Excitation,
    pub(super) state: ExactState,
    pub(super) wave: Wave,
    pub(super) time: Time,
    pub(super) mode: Mode,
    pub(super) touch: Touch,
    pub(super) leg: Leg,
    pub(super) fresh: Fresh,
    /// Approach speed of the fastest impact since the start, m/s.
    pub(super) fastest_m_per_s: f64,
    next_break_s: f64,
    started: bool,
    pub(super) arcs_since_anchor: u32,
    pub(super) events_at_once: u32,
    unresolved: u32,
    pub(super) work: Work,
}

impl Exact {
    /// A set-up that starts from `initial` at t = 0.
    ///
    /// # Errors
    /// Names the first value that is not physical.
    pub fn new(set_up: &SetUp, excitation: &Excitation, initial: &Initial) -> Result<Self, Invalid> {
        set_up.validate()?;
        excitation.validate()?;
        set_up.validate_initial(initial)?;
        let c = Coefficients::new(set_up);
        let soft = set_up.particle.and_then(|p| match p.wall {
            Wall::Voigt { release, .. } => Some(release),
            Wall::Restitution { .. } => None,
        });
        let flows = Flows::new(set_up, excitation);
        let mode = Mode { grip: Grip::Absent, contact: Contact::Absent };
        let leg = Leg {
            path: Path::Alone,
            sliding: false,
            structure_acceleration: 0.0,
            particle_acceleration: 0.0,
            rest_offset: 0.0,
            step_s: flows.step_s(Path::Alone),
        };
        let mut exact = Self {
            c,
            has_particle: set_up.particle.is_some(),
            has_tmd: set_up.tmd.is_some(),
            soft,
            flows,
            excitation: *excitation,
            state: ExactState::default(),
            wave: Wave::default(),
            time: Time::default(),
            mode,
            touch: Touch::Clear,
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

    /// Restarts from `initial` at time `t_s` and keeps the tables.
    pub fn reset(&mut self, t_s: f64, initial: &Initial) {
        let joined = self.has_particle || self.has_tmd;
        let mut offset_m = if joined { initial.y_m - initial.x_m } else { 0.0 };
        if self.has_particle {
            // A start "at the wall" is written as y = x ± d and may miss the wall by a rounding.
            let d = self.c.clearance;
            if offset_m.abs() >= d - 4.0 * f64::EPSILON * (initial.x_m.abs() + initial.y_m.abs()) {
                offset_m = if offset_m > 0.0 { d } else { -d };
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
        self.touch = Touch::Clear;
        self.fresh = Fresh::default();
        self.fastest_m_per_s = 0.0;
        self.started = false;
        self.events_at_once = 0;
    }

    /// The present time, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time.seconds()
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &ExactState {
        &self.state
    }

    /// The present mode; valid after the first call of [`Exact::run`].
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The present contact with a soft wall.
    #[must_use]
    pub fn touch(&self) -> Touch {
        self.touch
    }

    /// Number of times that more than 64 events fell on one instant and a millionth of an arc was taken without guards.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.unresolved
    }

    /// Computing effort since [`Exact::new`].
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Present z and z′, m and m/s.
    #[must_use]
    pub fn base(&self) -> (f64, f64) {
        (self.wave.offset + self.flows.base_share * self.wave.sine, self.base_velocity())
    }

    /// The shortest full arc of this set-up, s. A stiff wall or a fast excitation shortens it and so raises the
    /// computing effort.
    #[must_use]
    pub fn shortest_arc_s(&self) -> f64 {
        [Path::Alone, Path::Together, Path::Coupled, Path::CarriedCoupled]
            .into_iter()
            .map(|path| self.flows.step_s(path))
            .fold(f64::INFINITY, f64::min)
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

    fn anchor(&mut self) {
        self.wave = self.excitation.wave(self.time);
        self.arcs_since_anchor = 0;
        self.work.sines += 1;
    }

    pub(super) fn base_velocity(&self) -> f64 {
        self.flows.base_share * self.flows.turning * self.wave.cosine
    }

    /// x′ − z′, exactly zero when stuck, m/s.
    pub(super) fn slip(&self) -> f64 {
        match self.mode.grip {
            Grip::Stuck => 0.0,
            Grip::Absent | Grip::Slip(_) => self.state.v_m_per_s - self.base_velocity(),
        }
    }

    /// Side of the hard wall that the particle touches.
    pub(super) fn wall_side(&self) -> Sign {
        if self.soft.is_some() { 0 } else { self.end_of_travel() }
    }

    /// Side of the cavity whose wall, hard or soft, the particle touches or presses into; 0 between the walls.
    pub(super) fn end_of_travel(&self) -> Sign {
        if self.has_particle && self.state.offset_m.abs() >= self.c.clearance { sign(self.state.offset_m) } else { 0 }
    }

    pub(super) fn situation(&self, slip: f64) -> Situation<f64> {
        let link = &self.flows.link;
        let joint = |rest: f64| link.stiffness * (self.state.offset_m - rest) + link.damping * self.state.slide_m_per_s;
        let (state, share) = (&self.state, self.flows.base_share);
        let spring_size = state.x_m.abs() + self.wave.offset.abs() + share * self.wave.sine.abs();
        let dashpot_size = state.v_m_per_s.abs() + share * self.flows.turning * self.wave.cosine.abs();
        Situation {
            stretch: self.state.x_m - (self.wave.offset + self.flows.base_share * self.wave.sine),
            slip,
            slide: self.state.slide_m_per_s,
            side: self.wall_side(),
            base_acceleration: -self.flows.base_share * self.flows.turning * self.flows.turning * self.wave.sine,
            joint_force: match self.touch {
                _ if self.has_tmd => joint(0.0),
                Touch::Pressing(side) => joint(signed(side, self.c.clearance)),
                Touch::Clear | Touch::Leaving(_) => 0.0,
            },
            applied_force: (1.0 - self.flows.base_share) * self.wave.sine,
            rounding: ROUNDINGS * (self.c.stiffness * spring_size + self.c.damping * dashpot_size) / self.c.mass,
        }
    }

    /// Switches to the mode that follows from the state; `slip` is zero when the damper may stick.
    pub(super) fn resolve<O: Observer>(&mut self, slip: f64, observer: &mut O) {
        let before = self.mode;
        let mode = modes::resolve(&self.c, self.has_particle, &self.situation(slip));
        let released = before.contact != mode.contact && self.state.slide_m_per_s == 0.0;
        if released
            && let Contact::Free(direction) = mode.contact
            && direction != 0
        {
            self.fresh.slide = self.fresh.slide.max(1);
            let side = self.wall_side();
            if side != 0 {
                (self.fresh.gap_side, self.fresh.gap) = (side, 2);
            }
        }
        if slip == 0.0 && matches!(mode.grip, Grip::Slip(_)) {
            self.fresh.slip = self.fresh.slip.max(1);
        }
        self.set_mode(mode, observer);
    }

    pub(super) fn set_mode<O: Observer>(&mut self, mode: Mode, observer: &mut O) {
        if mode != self.mode {
            observer.mode(self.time.seconds(), mode);
        }
        self.mode = mode;
        self.set_leg();
        self.depart();
    }

    /// Derives the equations of motion from the mode.
    #[inline]
    pub(super) fn set_leg(&mut self) {
        let mode = self.mode;
        let held = matches!(mode.contact, Contact::Held(_));
        let pressed = if let Touch::Pressing(side) = self.touch { side } else { 0 };
        let joined = self.has_tmd || (pressed != 0 && !held);
        let (path, force) = match mode.grip {
            Grip::Stuck if joined => (Path::CarriedCoupled, 0.0),
            Grip::Stuck => (Path::Carried, 0.0),
            Grip::Absent | Grip::Slip(_) => {
                let force =
                    self.c.drag(mode.contact) - self.c.resistance(mode.grip) + self.c.stiffness * self.wave.offset;
                (
                    if joined {
                        Path::Coupled
                    } else if held {
                        Path::Together
                    } else {
                        Path::Alone
                    },
                    force,
                )
            }
        };
        self.leg = Leg {
            path,
            sliding: matches!(mode.contact, Contact::Free(_)),
            structure_acceleration: force / self.c.moving_mass(mode.contact),
            particle_acceleration: match mode.contact {
                Contact::Free(direction) => -signed(direction, self.c.friction_acceleration),
                Contact::Absent | Contact::Held(_) => 0.0,
            },
            rest_offset: signed(pressed, self.c.clearance),
            step_s: self.flows.step_s(path),
        };
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
        let h = self.leg.step_s;
        let rest_s = self.time.until(limit_s);
        if rest_s <= 0.0 {
            return;
        }
        let full = rest_s > h;
        let (state, wave) = (self.state, self.wave);
        let most = if full { 1.0 } else { rest_s / h };
        self.work.arcs_walked += 1;
        let span = self.flows.span(&self.leg, &state, &wave);
        let (mut at, mut event) = (most, None);
        if self.events_at_once < MOST_EVENTS_AT_ONCE {
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
            if self.events_at_once >= MOST_EVENTS_AT_ONCE && self.has_particle && self.soft.is_none() {
                let d = self.c.clearance;
                self.state.offset_m = self.state.offset_m.clamp(-d, d);
            }
            self.wave = self.wave.turned(self.flows.turning * h * at);
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

    /// Reports an arc that starts at `time` to the observer, with state and wave at both ends.
    #[inline]
    pub(super) fn report<O: Observer>(
        &self,
        (start, wave): (&ExactState, &Wave),
        (end, end_wave): (&ExactState, &Wave),
        (time, length_s): (Time, f64),
        span: Option<Span>,
        observer: &mut O,
    ) {
        if O::ARCS {
            observer.arc(&Arc {
                flows: &self.flows,
                leg: &self.leg,
                wave: *wave,
                end_wave: *end_wave,
                span: span.map_or_else(OnceCell::new, OnceCell::from),
                start_s: time.seconds(),
                length_s,
                mode: self.mode,
                start: *start,
                end: *end,
            });
        }
    }
}
