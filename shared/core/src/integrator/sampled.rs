//! Sampled integrator: advances the motion one base sample at a time, as on the board, for `f32`, `f64` and fixed
//! point.
//!
//! One step is one [`BaseSegment`] of base motion. Within it the system is linear until a set-valued force changes its
//! mode. The solution is computed as a Taylor polynomial (a *flight*), exact to the degree kept. A flight ends at the
//! first time at which a guard (gap, relative velocity, force limit) would be violated. The mode laws are in
//! [`super::modes`], the root finder in [`super::polynomial`].
//!
//! States advance by increments, `x += Δx`, never `x = Φx`: in `f32` the latter loses 0.2 % of a damping of 0.0038.
//! Time is counted in steps (velocities in lengths per step). The particle's position is stored relative to the
//! structure, so a held particle and the wall positions are exact. Only IEEE-exact operations are used: `f32` gives the
//! same bits on every machine.
//!
//! # Accuracy of the small scalars
//! Errors against `f64` in free vibration from x0 = 35 mm at 1 kHz (`tests/integration/scalars.rs` prints them): the
//! largest error of x over 10 s in parts of x0, the error of the first ten impact times, and the error of the RMS
//! over 30 cycles.
//!
//! | d/x0, e, μi | `f32`: x | impacts, s | RMS | fixed point: x | impacts, s | RMS |
//! |---|---|---|---|---|---|---|
//! | 0.4, 0.4, 0 | 5e-5 | 8e-8 | 4e-7 | 3e-7 | 9e-11 | 5e-10 |
//! | 0.8, 0.4, 0.08 | 5e-7 | 9e-8 | 3e-7 | 4e-9 | 5e-10 | 1e-9 |
//! | 0.85, 0.55, 0 | 4e-5 | 4e-7 | 2e-6 | 2e-7 | 3e-10 | 9e-9 |
//! | 1.2, 0.3, 0.05 | 5e-7 | 4e-7 | 2e-7 | 2e-8 | 8e-10 | 4e-9 |
//!
//! The relative error of the effective damping ratio over 30 cycles of the bare structure is 7e-6 in `f32` and 2e-8 in
//! fixed point. Where an impact falls on the other side of a sample, the velocity at that one sample differs by the
//! impact's change of velocity.

mod correct;
mod flight;
mod guards;
mod joint;
mod observer;

use super::base::BaseSegment;
use super::modes::{self, Coefficients, Contact, Grip, Mode, Sign, Situation, signed};
use super::polynomial;
use super::units::Units;
use crate::io::{Invalid, require};
use crate::model::{Initial, SetUp};
use crate::scalar::Scalar;

pub use flight::Flight;
use flight::Weights;
pub use joint::{Joined, Joint, Rigid, SampledLink, WallTouch};
pub use observer::{SampledImpact, SampledObserver};

/// The largest (fastest rate × step) for which a flight's polynomial is accurate enough; see [`polynomial::COEFFICIENTS`].
pub const LARGEST_RATE_PER_STEP: f64 = 0.1;

/// Largest number of events in one step of [`Sampled::step`].
const MAX_EVENTS_PER_STEP: u8 = 64;

/// Displacements and velocities of structure and particle, in [`Units`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampledState<S> {
    /// x.
    pub x: S,
    /// x′.
    pub v: S,
    /// y − x.
    pub offset: S,
    /// y′ − x′.
    pub slide: S,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SampledEvent {
    Wall(Sign),
    SlideStops,
    SlipStops,
    HoldBreaks(Sign),
    GripBreaks,
    LetGo(Sign),
    Inside(Sign),
}

/// A set-up in motion, driven by base samples, or by samples of a force over its stiffness ([`SetUp::is_force_driven`]); `J` selects whether soft walls or a tuned mass are part of it.
#[derive(Clone, Copy, Debug)]
pub struct Sampled<S, J = Rigid> {
    c: Coefficients<S>,
    has_particle: bool,
    /// The segments stand for a force over its static deflection, and the base rests.
    is_force_driven: bool,
    alone: Weights<S>,
    together: Weights<S>,
    state: SampledState<S>,
    mode: Option<Mode>,
    /// The particle has just been released: its slide starts from zero by definition, regardless of rounding.
    slide_released: bool,
    /// The friction damper has just been released.
    slip_released: bool,
    unresolved: u32,
    units: Units,
    joint: J,
}

impl<S: Scalar> Sampled<S> {
    /// Number of steps into which a sample interval must be divided for this set-up.
    ///
    /// # Errors
    /// More than 200 steps would be needed: the structure is too fast for the sampling rate, or its damping too strong.
    pub fn steps_per_sample(set_up: &SetUp, sample_s: f64) -> Result<u8, Invalid> {
        let structure = &set_up.structure;
        let (omega, decay) = (structure.angular_frequency_rad_per_s(), structure.damping_n_s_per_m / structure.mass_kg);
        let steps = |rate: f64| libm::ceil(rate * sample_s / LARGEST_RATE_PER_STEP).max(1.0);
        require(
            steps(omega) <= 200.0,
            "structure.stiffness_n_per_m",
            structure.stiffness_n_per_m,
            "low enough for the sampling rate (natural angular frequency × sample interval at most 20)",
        )?;
        require(
            steps(decay) <= 200.0,
            "structure.damping_n_s_per_m",
            structure.damping_n_s_per_m,
            "low enough for the sampling rate (damping over mass × sample interval at most 20)",
        )?;
        let steps = steps(omega.max(decay));
        Ok(steps as u8)
    }

    /// A set-up in `units` that starts from `initial` (absolute positions and velocities of structure and particle).
    /// Base samples are then in `units` too.
    ///
    /// # Errors
    /// Names a value that is not physical, or a soft wall or tuned mass; those need [`Joined`].
    pub fn new(set_up: &SetUp, units: Units, initial: &Initial) -> Result<Self, Invalid> {
        set_up.validate()?;
        set_up.validate_without_hertz()?;
        set_up.validate_initial(initial)?;
        if let Some(tmd) = &set_up.tmd {
            require(false, "tmd.mass_kg", tmd.mass_kg, "left out: a tuned mass is for `Joined`")?;
        }
        for (stiffness_n_per_m, _) in
            set_up.particle.iter().flat_map(|p| p.walls()).filter_map(|w| w.spring_and_dashpot())
        {
            require(
                false,
                "particle.wall.stiffness_n_per_m",
                stiffness_n_per_m,
                "left out: soft walls are for `Joined`",
            )?;
        }
        Ok(Self::with_joint(set_up, units, initial, Rigid))
    }
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    fn with_joint(set_up: &SetUp, units: Units, initial: &Initial, joint: J) -> Self {
        let c = Coefficients::in_units(set_up, &units);
        let mut sampled = Self {
            c,
            has_particle: set_up.particle.is_some(),
            is_force_driven: set_up.is_force_driven,
            alone: Weights::new(&c, c.mass),
            together: Weights::new(&c, c.mass + c.particle_mass),
            state: SampledState::default(),
            mode: None,
            slide_released: false,
            slip_released: false,
            unresolved: 0,
            units,
            joint,
        };
        sampled.reset(initial);
        sampled
    }

    /// Restarts with everything at rest in its neutral position, as from [`SetUp::neutral`] but without a division.
    pub fn rest(&mut self) {
        self.state = SampledState { offset: self.c.middle(), ..SampledState::default() };
        if let Some(link) = self.joint.link_mut() {
            link.touch = WallTouch::Clear;
            link.touched = false;
        }
        self.mode = None;
        self.slide_released = false;
        self.slip_released = false;
        self.unresolved = 0;
    }

    /// Restarts from `initial`.
    pub fn reset(&mut self, initial: &Initial) {
        let is_tuned = self.joint.link().is_some_and(SampledLink::is_tuned);
        let has_second = self.has_particle || is_tuned;
        let offset = if has_second { initial.y_m - initial.x_m } else { 0.0 };
        let slide = if has_second { initial.u_m_per_s - initial.v_m_per_s } else { 0.0 };
        let (length, velocity) = (self.units.length_m, self.units.velocity_m_per_s());
        let offset = S::from_f64(offset / length);
        self.rest();
        self.state = SampledState {
            x: S::from_f64(initial.x_m / length),
            v: S::from_f64(initial.v_m_per_s / velocity),
            offset: if is_tuned { offset } else { offset.min(self.c.wall(1)).max(self.c.wall(-1)) },
            slide: S::from_f64(slide / velocity),
        };
    }

    /// The state at the end of the last step.
    #[must_use]
    pub fn state(&self) -> &SampledState<S> {
        &self.state
    }

    /// The mode at the end of the last step; `None` before the first step.
    #[must_use]
    pub fn mode(&self) -> Option<Mode> {
        self.mode
    }

    /// The units of all quantities.
    #[must_use]
    pub fn units(&self) -> &Units {
        &self.units
    }

    /// The coefficients of the set-up in its units.
    #[must_use]
    pub fn coefficients(&self) -> &Coefficients<S> {
        &self.c
    }

    /// Number of steps that exceeded their event limit and were completed without event search.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.unresolved
    }

    /// Advances by one step of base motion, with at most 64 events in it. The base velocity must be continuous from
    /// step to step, as in the steps of [`super::base::BaseTrack`], because a sticking structure moves with the base.
    /// Where the base velocity jumps, restart with [`Sampled::reset`].
    pub fn step(&mut self, base: &BaseSegment<S>, observer: &mut (impl SampledObserver<S> + ?Sized)) {
        self.step_bounded(base, MAX_EVENTS_PER_STEP, observer);
    }

    /// Advances by one step of base motion, with at most `most_events` events in it: this bounds the work for all
    /// inputs. The last event ends a chatter: a particle that would bounce on a hard wall again within the step comes
    /// to rest there. The rest of the step is computed without events; a particle that would pass a hard wall stays at
    /// it. [`Sampled::unresolved`] counts such steps.
    pub fn step_bounded(
        &mut self,
        base: &BaseSegment<S>,
        most_events: u8,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let mut base = *base;
        if self.mode.is_none() {
            self.mode = Some(self.resolve(&base, self.state.v - self.ground(&base).velocity()));
        }
        let (mut start, mut events) = (S::ZERO, 0);
        while events < most_events {
            let rest = S::ONE - start;
            let mode = self.current_mode();
            let flight = self.flight(mode, &base);
            let longest = self.joint.link().map_or(rest, |link| link.longest(mode, rest));
            let (length, event) = self.next_event(mode, &flight, &base, longest);
            self.fly(start, mode, &flight, length, observer);
            if event.is_none() && length >= rest {
                return;
            }
            start += length;
            base = base.from(length);
            if let Some(event) = event {
                events += 1;
                self.handle(event, mode, &base, start, observer);
            }
        }
        self.unresolved += 1;
        self.end_chatter(start, &base, observer);
        let mode = self.current_mode();
        self.fly(start, mode, &self.flight(mode, &base), S::ONE - start, observer);
        let side = self.side();
        if side != 0 {
            self.state.offset = self.c.wall(side);
        }
    }

    fn fly(
        &mut self,
        start: S,
        mode: Mode,
        flight: &Flight<S>,
        length: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        observer.mode(mode);
        observer.flight(start, length, flight);
        if let Some((side, force)) = self.joint.link().and_then(|link| link.wall_force(&flight.offset)) {
            observer.wall_force(start, length, side, &force);
        }
        self.advance(mode, flight, length);
        if length > S::ZERO {
            self.slide_released = false;
            self.slip_released = false;
            if let Some(link) = self.joint.link_mut() {
                link.touched = false;
            }
        }
    }

    fn current_mode(&self) -> Mode {
        self.mode.unwrap_or(Mode { grip: Grip::Absent, contact: Contact::Absent })
    }

    /// The motion of what carries the structure's springs, dashpot and friction damper.
    fn ground(&self, base: &BaseSegment<S>) -> BaseSegment<S> {
        if self.is_force_driven { BaseSegment::at_rest(S::ZERO) } else { *base }
    }

    fn advance(&mut self, mode: Mode, flight: &Flight<S>, length: S) {
        let state = &mut self.state;
        state.x += polynomial::increment(&flight.x, length);
        state.v = flight.x[1] + polynomial::derivative_increment(&flight.x, length);
        if matches!(mode.contact, Contact::Free(_)) || self.joint.link().is_some_and(SampledLink::is_tuned) {
            state.offset += polynomial::increment(&flight.offset, length);
            state.slide += polynomial::derivative_increment(&flight.offset, length);
        }
    }

    /// Side of the hard wall that the particle touches; 0 between the walls.
    fn side(&self) -> Sign {
        let side = if self.has_particle { self.c.side(self.state.offset) } else { 0 };
        if self.is_soft(side) { 0 } else { side }
    }

    /// Whether the wall of `side` is soft.
    fn is_soft(&self, side: Sign) -> bool {
        self.joint.link().is_some_and(|link| link.is_soft(side))
    }

    fn resolve(&self, base: &BaseSegment<S>, slip: S) -> Mode {
        let situation = Situation {
            stretch: self.state.x - base.0[0],
            slip,
            slide: self.state.slide,
            side: self.side(),
            base_acceleration: self.ground(base).acceleration(),
            joint_force: self.joint.link().map_or(S::ZERO, |link| link.force(self.state.offset, self.state.slide)),
            applied_force: S::ZERO,
            rounding: S::ZERO,
        };
        modes::resolve(&self.c, self.has_particle, &situation)
    }

    fn handle(
        &mut self,
        event: SampledEvent,
        mode: Mode,
        base: &BaseSegment<S>,
        at: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let ground_velocity = self.ground(base).velocity();
        let slip = match mode.grip {
            Grip::Stuck => S::ZERO,
            Grip::Absent | Grip::Slip(_) => self.state.v - ground_velocity,
        };
        match event {
            SampledEvent::Wall(side) => {
                self.state.offset = self.c.wall(side);
                if self.is_soft(side) {
                    self.touch(side, slip, base, at, observer);
                } else if signed(side, self.state.slide) > S::ZERO {
                    self.hit(side, mode, base, at, observer);
                } else {
                    self.mode = Some(self.resolve(base, slip));
                }
            }
            SampledEvent::SlideStops => {
                self.state.slide = S::ZERO;
                self.mode = Some(self.resolve(base, slip));
            }
            SampledEvent::SlipStops => {
                self.state.v = ground_velocity;
                self.mode = Some(self.resolve(base, S::ZERO));
            }
            SampledEvent::HoldBreaks(direction) => {
                self.slide_released = true;
                self.mode = Some(Mode { contact: Contact::Free(direction), ..mode });
                self.press_from_rest(direction, at, observer);
            }
            SampledEvent::GripBreaks => {
                self.slip_released = true;
                self.state.v = ground_velocity;
                self.mode = Some(Mode { grip: Grip::Slip(self.breaking_direction(mode, base)), ..mode });
            }
            SampledEvent::LetGo(side) => self.let_go(side, slip, base, at, observer),
            SampledEvent::Inside(side) => self.inside(side),
        }
    }

    /// Applies an impact on the wall on `side`; the particle may come to rest there.
    fn hit(
        &mut self,
        side: Sign,
        mode: Mode,
        base: &BaseSegment<S>,
        at: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let approach = self.state.slide;
        let ground_velocity = self.ground(base).velocity();
        let before = if mode.grip == Grip::Stuck { ground_velocity } else { self.state.v };
        let restitution = self.c.restitution(side).at(approach.abs());
        let (v, slide) = modes::impact(&self.c, restitution, before, approach);
        self.state.v = v;
        self.state.slide = slide;
        self.mode = Some(self.resolve(base, v - ground_velocity));
        // A bounce whose height is within rounding of the clearance ends a chatter.
        let pressing = self.pressing(side, base);
        let height = self.c.reach * S::EPSILON * S::from_u8(16);
        let rests = pressing > S::ZERO && slide * slide <= pressing * height * S::from_u8(4);
        if rests {
            self.stay_at_wall(base);
        }
        observer.impact(&SampledImpact { at, side, approach: approach.abs(), kick: self.state.v - before });
        // Without restitution a single impact ends the bouncing.
        if rests && restitution > S::ZERO {
            observer.accumulation(at, side);
        }
    }

    /// Half the acceleration, relative to the structure, with which the particle is pressed towards the wall on `side`.
    fn pressing(&self, side: Sign, base: &BaseSegment<S>) -> S {
        signed(side, self.flight(self.current_mode(), base).offset[2])
    }

    /// Brings the particle at a wall to rest relative to the structure.
    fn stay_at_wall(&mut self, base: &BaseSegment<S>) {
        (self.state.v, _) = modes::impact(&self.c, S::ZERO, self.state.v, self.state.slide);
        self.state.slide = S::ZERO;
        self.mode = Some(self.resolve(base, self.state.v - self.ground(base).velocity()));
    }

    /// Brings a particle at a hard wall to rest if it would bounce on that wall again within the step.
    fn end_chatter(&mut self, at: S, base: &BaseSegment<S>, observer: &mut (impl SampledObserver<S> + ?Sized)) {
        let side = self.side();
        if side != 0 && self.state.slide.abs() <= self.pressing(side, base) * (S::ONE - at) {
            self.stay_at_wall(base);
            observer.accumulation(at, side);
        }
    }
}
