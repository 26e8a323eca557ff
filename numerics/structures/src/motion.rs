//! The engine: state, phases between events, and the run. Steps are in [`super::stepping`], events in [`super::events`].

use std::collections::HashMap;
use std::sync::Arc;

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::exact::excitation::Wave;
use damprig_core::integrator::exact::time::Time;
use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::model::Release;

use crate::bodies::dot;
use crate::contacts::{Contacts, Event, Slide, Touch};
use crate::events::Few;
use crate::flight::Flight;
use crate::guard::Reach;
use crate::linear::{C64, Rest};
use crate::mount::{Mount, WallLaw};
use crate::observe::{Observer, Parts};
use crate::polynomial::Polynomial;
use crate::squeeze::{Squeeze, SqueezedPiece};
use crate::stepping::{AtEnds, FIRST_BLIND_LEVEL, Now};
use crate::system::System;
use crate::{Refused, SetUp, State};

/// Roundings that may remain in a sum of cancelling terms.
pub(crate) const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// A set-up in motion under an excitation in closed form, or on a base that follows cubics.
#[derive(Clone, Debug)]
pub struct Motion {
    pub(crate) mount: Arc<Mount>,
    pub(crate) excitation: Excitation,
    pub(crate) turning: f64,
    pub(crate) time: Time,
    pub(crate) wave: Wave,
    /// The base's displacement from the present instant on, but for the wave's sine; 0 where a force drives.
    pub(crate) base_cubic: Polynomial,
    pub(crate) next_break_s: f64,
    /// Displacements and velocities of all bodies relative to the base; valid between phases.
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) contacts: Contacts,
    pub(crate) systems: Vec<System>,
    pub(crate) known: HashMap<Contacts, usize>,
    /// The system of the present phase.
    pub(crate) system: usize,
    pub(crate) rest: Rest,
    /// The natural motions, now and at the end of a step that is being judged.
    pub(crate) z: Vec<C64>,
    pub(crate) ahead: Vec<C64>,
    /// Those at the root of a guard that is being searched.
    pub(crate) root: Vec<C64>,
    /// Rounding of each natural motion at the start of the phase.
    pub(crate) roundings: Vec<f64>,
    pub(crate) amplitudes: Vec<f64>,
    pub(crate) steps_since_amplitudes: u32,
    pub(crate) guards: Vec<Live>,
    /// Guards that are zero by definition at the present instant, and how many of their derivatives.
    pub(crate) zeros: Vec<(Event, usize)>,
    /// What the natural motions can do to each guard; of one that is mirrored, that before it holds.
    pub(crate) reaches: Vec<Reach>,
    pub(crate) here: AtEnds,
    /// Guards that fall through zero in the step being judged.
    pub(crate) falls: Vec<usize>,
    pub(crate) free: Vec<Flight>,
    /// Contacts with Hertz walls, by particle, and the piece of motion that their forces are cubics in.
    pub(crate) squeezes: Vec<Option<Squeeze>>,
    pub(crate) piece: SqueezedPiece,
    pub(crate) level: usize,
    /// Steps until a longer one is tried.
    pub(crate) patience: u32,
    pub(crate) events_at_once: u32,
    /// Level of the next step without guards.
    pub(crate) blind_level: usize,
    /// Joints that no step decided about; those of the particles too.
    pub(crate) blind: Vec<bool>,
    /// Whether the step that was judged last does without a guard.
    pub(crate) is_unguarded: bool,
    pub(crate) unresolved: u32,
    /// Speed of the fastest impact, m/s.
    pub(crate) fastest_m_per_s: f64,
    /// The event that ended the last step, if any.
    pub(crate) handled: Option<Event>,
}

/// A guard during a phase.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Live {
    /// Its polynomial from the present instant on, but for a free particle.
    pub polynomial: Polynomial,
    /// Derivatives at the start that are zero by definition.
    pub fresh: usize,
}

impl Motion {
    /// Starts at t = 0 from `start`.
    ///
    /// # Errors
    /// A value out of range, a particle beyond a hard wall, a motion that has no closed form here, or a damper that the engine does
    /// not have.
    pub fn new(set_up: &SetUp, excitation: &Excitation, start: &State) -> Result<Self, Refused> {
        Self::start(set_up, excitation, [0.0; 4], start)
    }

    /// Starts at t = 0 from `start` on a base that follows the cubic z = Σ cₖ tᵏ, m, with the coefficients `base`, up to [`Motion::follow`].
    ///
    /// # Errors
    /// As [`Motion::new`].
    pub fn on_base(set_up: &SetUp, base: [f64; 4], start: &State) -> Result<Self, Refused> {
        Self::start(set_up, &Excitation::Fixed, base, start)
    }

    fn start(set_up: &SetUp, excitation: &Excitation, base: [f64; 4], start: &State) -> Result<Self, Refused> {
        let mount = Mount::new(set_up, excitation)?;
        set_up.validate_state(start)?;
        let count = mount.bodies.len();
        let contacts = Contacts {
            slides: vec![Slide::Free(0); mount.joints.len()],
            touches: vec![Touch::None; mount.cavities.len()],
        };
        let mut motion = Self {
            turning: excitation.angular_frequency_rad_per_s(),
            excitation: *excitation,
            time: Time::default(),
            wave: excitation.wave(Time::default()),
            base_cubic: Polynomial::default(),
            next_break_s: excitation.next_break_s(0.0),
            q: vec![0.0; count],
            v: vec![0.0; count],
            contacts,
            systems: Vec::new(),
            known: HashMap::new(),
            system: 0,
            rest: Rest::default(),
            z: Vec::new(),
            ahead: Vec::new(),
            root: Vec::new(),
            roundings: Vec::new(),
            amplitudes: Vec::new(),
            steps_since_amplitudes: 0,
            guards: Vec::new(),
            zeros: Vec::new(),
            reaches: Vec::new(),
            falls: Vec::new(),
            here: AtEnds::default(),
            free: Vec::new(),
            squeezes: vec![None; mount.cavities.len()],
            piece: SqueezedPiece::default(),
            level: 4,
            patience: 0,
            events_at_once: 0,
            blind_level: FIRST_BLIND_LEVEL,
            blind: vec![false; mount.joints.len()],
            is_unguarded: false,
            unresolved: 0,
            fastest_m_per_s: 0.0,
            handled: None,
            mount: Arc::new(mount),
        };
        motion.base_cubic = Polynomial::constant(motion.mount.share * motion.wave.offset) + Polynomial::of_powers(base);
        (motion.q, motion.v) = motion.mount.bodies_in(start, motion.base());
        motion.begin()?;
        Ok(motion)
    }

    /// The present time, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time.seconds()
    }

    /// Number of steps that were taken without the guards of a joint or particle: more than 64 events fell on one instant, or halving a step
    /// decided nothing.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.unresolved
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> State {
        let (q, v) = self.bodies();
        self.mount.state_of(&q, &v, self.base())
    }

    /// Displacements and velocities of all bodies relative to the base.
    pub(crate) fn bodies(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (self.q.clone(), self.v.clone());
        self.settle(&mut q, &mut v);
        (q, v)
    }

    /// z and z′, m and m/s; 0 where a force drives.
    #[must_use]
    pub fn base(&self) -> (f64, f64) {
        let share = self.mount.share;
        let Polynomial { value, slope, .. } = self.base_cubic;
        (value + share * self.wave.sine, slope + share * self.turning * self.wave.cosine)
    }

    /// Advances to `until_s`, or to where the observer ends the run.
    ///
    /// # Errors
    /// The contacts lead to a motion that has no closed form here.
    pub fn run<O: Observer>(&mut self, until_s: f64, observer: &mut O) -> Result<(), Refused> {
        loop {
            let limit_s = until_s.min(self.next_break_s);
            if self.time.until(limit_s) > 0.0 {
                if !observer.goes_on(self.time.seconds()) {
                    return Ok(());
                }
                self.advance(limit_s, observer)?;
            } else if self.time.until(until_s) > 0.0 {
                self.pass_break()?;
            } else {
                return Ok(());
            }
        }
    }

    /// Contacts of the first instant.
    fn begin(&mut self) -> Result<(), Refused> {
        let zero: Few<bool> = (0..self.mount.joints.len()).map(|joint| self.slip(joint) == 0.0).collect();
        let mut hits = Vec::new();
        for particle in 0..self.mount.cavities.len() {
            let (offset, slide) = self.offset(particle);
            for side in [-1, 1] {
                // A start "at the wall" is written as y = x ± d and may miss the wall by a rounding.
                let rounding = 8.0 * f64::EPSILON * (self.q[self.mount.permanent + particle].abs() + offset.abs());
                let cavity = &self.mount.cavities[particle];
                let (surface, surface_rate) = self.surface(particle, side);
                let past = signed(side, offset) - surface;
                if past > rounding && cavity.is_soft(side) {
                    self.begin_inside(particle, side, (past, signed(side, slide) - surface_rate));
                    continue;
                }
                if past > rounding {
                    let [from_m, to_m] = [-1, 1].map(|side| signed(side, self.surface(particle, side).0));
                    return Err(Refused::Outside { damper: particle, offset_m: offset, from_m, to_m });
                }
                if past < -rounding {
                    continue;
                }
                let is_soft = cavity.is_soft(side);
                self.place_at_wall(particle, side);
                let approaches = signed(side, slide) > self.surface(particle, side).1;
                if !is_soft {
                    self.contacts.touches[particle] = Touch::Wall(side);
                    if approaches {
                        hits.push((particle, side));
                    }
                } else if approaches {
                    self.begin_pressing(particle, side, signed(side, slide));
                }
            }
        }
        if hits.is_empty() { self.resolve(&zero, &[]) } else { self.hit(&hits, zero, &mut ()) }
    }

    /// A particle begins in a soft wall, at a penetration with its rate, as where another motion ended: it presses, or leaves where the force would pull.
    fn begin_inside(&mut self, particle: usize, side: Sign, (past, rate): (f64, f64)) {
        match *self.mount.cavities[particle].wall(side) {
            WallLaw::Soft { stiffness, damping, release: Release::ZeroForce }
                if stiffness * past + damping * rate <= 0.0 =>
            {
                self.contacts.touches[particle] = Touch::Leaving(side);
            }
            _ => {
                self.begin_pressing(particle, side, rate.max(0.0));
            }
        }
    }

    /// Relative velocity of a joint.
    pub(crate) fn slip(&self, joint: usize) -> f64 {
        let joint = &self.mount.joints[joint];
        dot(&joint.row, &self.v) + joint.influence * self.base().1
    }

    /// y − x and y′ − x′ of a particle.
    pub(crate) fn offset(&self, particle: usize) -> (f64, f64) {
        let row = self.mount.offset_row(particle);
        (dot(row, &self.q), dot(row, &self.v))
    }

    pub(crate) fn place_at_wall(&mut self, particle: usize, side: Sign) {
        let cavity = &self.mount.cavities[particle];
        let x = dot(&cavity.place, &self.q);
        self.q[self.mount.permanent + particle] = x + signed(side, self.surface(particle, side).0);
    }

    /// Distance of the surface of a wall that nothing touches from y = x, towards its side, m, and its rate: it stands elsewhere with the charge of a
    /// piezoelectric wall.
    pub(crate) fn surface(&self, particle: usize, side: Sign) -> (f64, f64) {
        let cavity = &self.mount.cavities[particle];
        cavity.piezoelectric(side).map_or((cavity.end(side), 0.0), |wall| {
            let stands = wall.stands_m_per_c();
            (cavity.end(side) + stands * self.q[wall.charge], stands * self.v[wall.charge])
        })
    }

    /// Writes the state of the natural motions and flights over `q` and `v`.
    fn settle(&self, q: &mut [f64], v: &mut [f64]) {
        let system = &self.systems[self.system];
        let permanent = self.mount.permanent;
        if system.members.len() == permanent {
            system.linear.leave(&self.rest, &self.z, &mut q[..permanent], &mut v[..permanent]);
        } else {
            let (mut of, mut rate) = (vec![0.0; system.members.len()], vec![0.0; system.members.len()]);
            system.linear.leave(&self.rest, &self.z, &mut of, &mut rate);
            for (n, &i) in system.members.iter().enumerate() {
                (q[i], v[i]) = (of[n], rate[n]);
            }
        }
        let (base, base_rate) = self.base();
        for (&i, flight) in system.free.iter().zip(&self.free) {
            let influence = self.mount.cavities[i].influence;
            q[permanent + i] = flight.0.value - influence * base;
            v[permanent + i] = flight.0.slope - influence * base_rate;
        }
    }

    /// Ends the phase: bodies take their state.
    pub(crate) fn leave(&mut self) {
        let (mut q, mut v) = (std::mem::take(&mut self.q), std::mem::take(&mut self.v));
        self.settle(&mut q, &mut v);
        (self.q, self.v) = (q, v);
    }

    /// Starts the phase of the present contacts. `hints`: guards whose first derivatives are zero by definition, and how many; those of
    /// earlier events at this instant still are.
    pub(crate) fn phase(&mut self, hints: &[(Event, usize)]) -> Result<(), Refused> {
        for hint in hints {
            self.zeros.retain(|(event, _)| *event != hint.0);
            self.zeros.push(*hint);
        }
        if self.systems.get(self.system).is_none_or(|system| system.contacts != self.contacts) {
            self.system = self.find_system()?;
        }
        let changes = self.hold_forces();
        self.enter();
        if changes {
            self.squeeze();
            self.enter();
        }
        let system = &self.systems[self.system];
        self.here.slow = None;
        self.guards.clear();
        for guard in &system.guards {
            let polynomial = guard.polynomial(system, &self.rest, self.base_cubic);
            let hint = self.zeros.iter().find(|(event, _)| *event == guard.event).map_or(0, |(_, order)| *order);
            let mut fresh = hint;
            if hint > 0 {
                // More derivatives than those by definition may be zero: at a wall that a particle touches without speed.
                let whole = guard.with_flight(&self.free, polynomial);
                let now = Now { z: &self.z, rates: &system.linear.natural.rates, roundings: &self.roundings };
                let rising = guard.leading(&now, whole, hint).filter(|(_, value)| *value > 0.0);
                fresh = rising.map_or(hint, |(order, _)| order);
            }
            self.guards.push(Live { polynomial, fresh });
        }
        self.take_amplitudes();
        Ok(())
    }

    /// The natural motions and flights of the bodies under the present forces of Hertz walls.
    fn enter(&mut self) {
        let system = &self.systems[self.system];
        let permanent = self.mount.permanent;
        let wave = C64::new(self.wave.cosine, self.wave.sine);
        let of = |all: &[f64]| -> Vec<f64> { system.members.iter().map(|&i| all[i]).collect() };
        let (more_q, more_v);
        let (q, v) = if system.members.len() == permanent {
            (&self.q[..permanent], &self.v[..permanent])
        } else {
            (more_q, more_v) = (of(&self.q), of(&self.v));
            (&more_q[..], &more_v[..])
        };
        let base_motion = (self.base_cubic, self.mount.share * self.wave.sine);
        system.linear.rest(&system.bodies, q, &system.force, base_motion, &mut self.rest);
        let force = |particle: usize| self.squeezes[particle].as_ref().map_or_else(Polynomial::default, |of| of.force);
        if !system.pushes.is_empty() {
            let pushes = system.pushes.iter().map(|pushed| (&pushed.push, force(pushed.particle)));
            system.linear.pushed(&pushes.collect::<Vec<_>>(), self.piece.length_s, &mut self.rest);
        }
        system.linear.enter(&self.rest, q, v, wave, (&mut self.z, &mut self.roundings));
        let (base, base_rate) = self.base();
        self.free.clear();
        for &i in &system.free {
            let (cavity, body) = (&self.mount.cavities[i], permanent + i);
            let friction = self.contacts.sliding_force(&self.mount, self.mount.joint_of(i));
            let mut force = Polynomial::constant(friction - cavity.weight_n);
            if let Some(squeeze) = &self.squeezes[i] {
                force = force + squeeze.inwards();
            }
            self.free.push(Flight::new(
                self.q[body] + cavity.influence * base,
                self.v[body] + cavity.influence * base_rate,
                1.0 / cavity.mass * force,
            ));
        }
    }

    /// The system of the present contacts.
    fn find_system(&mut self) -> Result<usize, Refused> {
        if let Some(&system) = self.known.get(&self.contacts) {
            return Ok(system);
        }
        self.systems.push(System::new(&self.mount, &self.contacts, self.turning)?);
        self.known.insert(self.contacts.clone(), self.systems.len() - 1);
        Ok(self.systems.len() - 1)
    }

    /// Takes the amplitudes of the natural motions, and what these can do to the guards.
    pub(crate) fn take_amplitudes(&mut self) {
        self.amplitudes.clear();
        self.amplitudes.extend(self.z.iter().map(|z| z.norm_sqr().sqrt()));
        let guards = &self.systems[self.system].guards;
        self.reaches.resize_with(guards.len().max(self.reaches.len()), Reach::default);
        for (reach, guard) in self.reaches.iter_mut().zip(guards).filter(|(_, guard)| !guard.is_mirrored) {
            reach.take(&guard.guard, &self.amplitudes);
        }
        self.steps_since_amplitudes = 0;
    }

    /// What the natural motions can do to a guard.
    pub(crate) fn reach(&self, guard: usize) -> &Reach {
        &self.reaches[guard - usize::from(self.systems[self.system].guards[guard].is_mirrored)]
    }

    pub(crate) fn parts(&self) -> Parts<'_> {
        Parts {
            mount: &self.mount,
            system: &self.systems[self.system],
            rest: &self.rest,
            z: &self.z,
            end: &self.ahead,
            free: &self.free,
            squeezes: &self.squeezes,
            base: self.base_cubic,
        }
    }

    /// An instant at which the excitation's closed form changes.
    pub(crate) fn pass_break(&mut self) -> Result<(), Refused> {
        self.leave();
        let before = self.base().1;
        self.next_break_s = self.excitation.next_break_s(self.time.seconds());
        self.wave = self.excitation.wave(self.time);
        self.base_cubic = Polynomial::constant(self.mount.share * self.wave.offset);
        self.base_has_jumped(self.base().1 - before)
    }

    /// Goes on after the base's velocity has jumped: absolute velocities go on, those relative to the base jump.
    pub(crate) fn base_has_jumped(&mut self, jump_m_per_s: f64) -> Result<(), Refused> {
        let mut zero = self.stuck();
        if jump_m_per_s != 0.0 {
            let (inertia, mass) = (&self.mount.bodies.inertia, self.mount.bodies.divisors());
            self.v
                .iter_mut()
                .zip(inertia.iter().zip(mass))
                .for_each(|(v, (inertia, mass))| *v -= inertia / mass * jump_m_per_s);
            zero[..self.mount.joint_of(0)].fill(false);
        }
        self.resolve(&zero, &[])
    }

    /// Joints that stick now.
    pub(crate) fn stuck(&self) -> Few<bool> {
        self.contacts.slides.iter().map(|slide| *slide == Slide::Stuck).collect()
    }
}
