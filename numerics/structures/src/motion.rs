//! The engine: motion from event to event.

use std::collections::HashMap;

use damprig_core::integrator::exact::excitation::Wave;
use damprig_core::integrator::exact::time::Time;
use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::modes::{Sign, sign, signed};
use damprig_core::model::Release;
use nalgebra::DMatrix;

use crate::contact::{self, At, Limits};
use crate::guard::{Bounds, Here, Step, Verdict};
use crate::linear::{C64, Rest, add, dot};
use crate::mount::{Mount, WallLaw};
use crate::observe::{Impact, Observer, Piece};
use crate::system::{Contacts, Event, Free, Slide, System, Touch};
use crate::{Body, Refused, SetUp, State};

/// Roundings that may remain in a sum of cancelling terms.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// Events at one instant after which a small step is taken without guards.
const MAX_EVENTS_AT_ONCE: u32 = 64;

/// Steps are the longest one divided by powers of two; this is the last.
const LAST_LEVEL: usize = 48;

/// Steps after which the amplitudes of the natural motions are taken anew.
const STEPS_PER_AMPLITUDE: u32 = 16;

/// A set-up in motion under an excitation in closed form.
#[derive(Clone, Debug)]
pub struct Motion {
    mount: Mount,
    excitation: Excitation,
    turning: f64,
    time: Time,
    wave: Wave,
    next_break_s: f64,
    /// Displacements and velocities of all bodies relative to the base; valid between phases.
    q: Vec<f64>,
    v: Vec<f64>,
    contacts: Contacts,
    systems: Vec<System>,
    known: HashMap<Contacts, usize>,
    /// The present phase.
    system: usize,
    rest: Rest,
    z: Vec<C64>,
    amplitudes: Vec<f64>,
    steps_since_amplitudes: u32,
    guards: Vec<Live>,
    free: Vec<Flight>,
    level: usize,
    bounds: Vec<Option<Vec<Bounds>>>,
    events_at_once: u32,
    unresolved: u32,
}

/// A guard during a phase.
#[derive(Clone, Copy, Debug)]
struct Live {
    constant: f64,
    /// Derivatives at the start that are zero by definition.
    fresh: usize,
}

/// A particle in free flight, from the start of the present step.
#[derive(Clone, Copy, Debug)]
struct Flight {
    y: f64,
    u: f64,
    acceleration: f64,
}

impl Flight {
    fn after(&self, t: f64) -> Self {
        Self { y: self.y + t * (self.u + 0.5 * t * self.acceleration), u: self.u + t * self.acceleration, ..*self }
    }
}

impl Free for Flight {
    fn parts(&self) -> (f64, f64, f64) {
        (self.y, self.u, self.acceleration)
    }
}

/// The first event within a step.
struct First {
    at_s: f64,
    event: Event,
    z: Vec<C64>,
}

impl Motion {
    /// Starts at t = 0 from `start`.
    ///
    /// # Errors
    /// A value out of range, a motion that has no closed form here, or dampers that the engine does not have.
    pub fn new(set_up: &SetUp, excitation: &Excitation, start: &State) -> Result<Self, Refused> {
        let mount = Mount::new(set_up, excitation)?;
        set_up.validate_state(start)?;
        let count = mount.bodies.len();
        let contacts = Contacts {
            joints: vec![0; mount.frictions.len()],
            particles: vec![(Slide::Free(0), Touch::None); mount.cavities.len()],
        };
        let mut motion = Self {
            turning: excitation.angular_frequency_rad_per_s(),
            excitation: *excitation,
            time: Time::default(),
            wave: excitation.wave(Time::default()),
            next_break_s: excitation.next_break_s(0.0),
            q: vec![0.0; count],
            v: vec![0.0; count],
            contacts,
            systems: Vec::new(),
            known: HashMap::new(),
            system: 0,
            rest: Rest::default(),
            z: Vec::new(),
            amplitudes: Vec::new(),
            steps_since_amplitudes: 0,
            guards: Vec::new(),
            free: Vec::new(),
            level: 4,
            bounds: Vec::new(),
            events_at_once: 0,
            unresolved: 0,
            mount,
        };
        motion.put(start);
        motion.begin()?;
        Ok(motion)
    }

    /// The present time, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time.seconds()
    }

    /// Number of times that more than 64 events fell on one instant and a small step was taken without guards.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.unresolved
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> State {
        let (mut q, mut v) = (self.q.clone(), self.v.clone());
        self.settle(&self.z, &self.free, &mut q, &mut v);
        let mount = &self.mount;
        let (z, rate) = self.base();
        let body = |i: usize, influence: f64| Body { y_m: q[i] + influence * z, u_m_per_s: v[i] + influence * rate };
        State {
            modal: q[..mount.modes].to_vec(),
            modal_rate: v[..mount.modes].to_vec(),
            tuned_masses: (mount.modes..mount.fixed).zip(&mount.tuned_influence).map(|(i, of)| body(i, *of)).collect(),
            particles: (mount.fixed..q.len()).zip(&mount.cavities).map(|(i, of)| body(i, of.influence)).collect(),
        }
    }

    /// z and z′, m and m/s; 0 where a force drives.
    #[must_use]
    pub fn base(&self) -> (f64, f64) {
        let share = self.share();
        (share * (self.wave.offset + self.wave.sine), share * self.turning * self.wave.cosine)
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

    fn share(&self) -> f64 {
        if self.mount.moves_base { 1.0 } else { 0.0 }
    }

    /// Takes the bodies' state from `state`.
    fn put(&mut self, state: &State) {
        let (z, rate) = self.base();
        let mount = &self.mount;
        self.q[..mount.modes].copy_from_slice(&state.modal);
        self.v[..mount.modes].copy_from_slice(&state.modal_rate);
        let tuned = state.tuned_masses.iter().zip(&mount.tuned_influence).map(|(body, of)| (body, *of));
        let particles = state.particles.iter().zip(&mount.cavities).map(|(body, of)| (body, of.influence));
        for (i, (body, influence)) in (mount.modes..).zip(tuned.chain(particles)) {
            self.q[i] = body.y_m - influence * z;
            self.v[i] = body.u_m_per_s - influence * rate;
        }
    }

    /// Contacts of the first instant.
    fn begin(&mut self) -> Result<(), Refused> {
        let mut zero = vec![false; self.joints()];
        let mut hits = Vec::new();
        for (joint, zero) in zero.iter_mut().enumerate() {
            let row = self.joint_row(joint);
            *zero = self.slip(joint, &row) == 0.0;
        }
        for i in 0..self.mount.cavities.len() {
            let (offset, slide) = self.offset(i);
            for side in [-1, 1] {
                // A start "at the wall" is written as y = x ± d and may miss the wall by a rounding.
                let x = self.q[self.mount.fixed + i].abs() + offset.abs();
                if signed(side, offset) >= self.mount.cavities[i].end(side) - 8.0 * f64::EPSILON * x {
                    self.place_at_wall(i, side);
                    let approach = signed(side, slide);
                    if self.mount.cavities[i].is_soft(side) {
                        if approach > 0.0 {
                            self.contacts.particles[i].1 = Touch::Pressing(side);
                        }
                    } else {
                        self.contacts.particles[i].1 = Touch::Wall(side);
                        if approach > 0.0 {
                            hits.push((i, side));
                        }
                    }
                }
            }
        }
        if hits.is_empty() { self.resolve(&zero, &[]) } else { self.hit(&hits, zero, &mut ()) }
    }

    /// Number of joints: friction dampers, then particles.
    fn joints(&self) -> usize {
        self.mount.frictions.len() + self.mount.cavities.len()
    }

    /// The relative displacement of a joint as a row over all bodies.
    fn joint_row(&self, joint: usize) -> Vec<f64> {
        match self.mount.frictions.get(joint) {
            Some(friction) => friction.row.clone(),
            None => self.mount.offset_row(joint - self.mount.frictions.len()),
        }
    }

    /// Relative velocity of a joint.
    fn slip(&self, joint: usize, row: &[f64]) -> f64 {
        let influence = self.mount.frictions.get(joint).map_or(0.0, |friction| friction.influence);
        dot(row, &self.v) + influence * self.base().1
    }

    /// y − x and y′ − x′ of a particle.
    fn offset(&self, particle: usize) -> (f64, f64) {
        let row = self.mount.offset_row(particle);
        (dot(&row, &self.q), dot(&row, &self.v))
    }

    fn place_at_wall(&mut self, particle: usize, side: Sign) {
        let cavity = &self.mount.cavities[particle];
        let x = dot(&cavity.place, &self.q);
        self.q[self.mount.fixed + particle] = x + signed(side, cavity.end(side));
    }

    /// Writes the state of natural motions and flights over `q` and `v`.
    fn settle(&self, z: &[C64], free: &[Flight], q: &mut [f64], v: &mut [f64]) {
        let system = &self.systems[self.system];
        let (mut of, mut rate) = (vec![0.0; system.members.len()], vec![0.0; system.members.len()]);
        system.linear.leave(&self.rest, z, &mut of, &mut rate);
        for (n, &i) in system.members.iter().enumerate() {
            (q[i], v[i]) = (of[n], rate[n]);
        }
        let (base, base_rate) = self.base();
        for (&i, flight) in system.free.iter().zip(free) {
            let influence = self.mount.cavities[i].influence;
            q[self.mount.fixed + i] = flight.y - influence * base;
            v[self.mount.fixed + i] = flight.u - influence * base_rate;
        }
    }

    /// Limits of a joint's force at zero relative velocity.
    fn limits(&self, joint: usize) -> Limits {
        let frictions = self.mount.frictions.len();
        if let Some(friction) = self.mount.frictions.get(joint) {
            return Limits { low: -friction.force_n, high: friction.force_n };
        }
        let particle = joint - frictions;
        let friction = self.mount.cavities[particle].friction_n;
        match self.contacts.particles[particle].1 {
            Touch::Wall(1) => Limits { low: f64::NEG_INFINITY, high: friction },
            Touch::Wall(_) => Limits { low: -friction, high: f64::INFINITY },
            _ => Limits { low: -friction, high: friction },
        }
    }

    /// Decides at an instant which joints of zero relative velocity stick, and starts the next phase. `hints`: guards that are zero by
    /// definition besides those that follow from this decision.
    fn resolve(&mut self, zero: &[bool], hints: &[(Event, usize)]) -> Result<(), Refused> {
        let mut hints = hints.to_vec();
        let frictions = self.mount.frictions.len();
        let rows: Vec<Vec<f64>> = (0..self.joints()).map(|joint| self.joint_row(joint)).collect();
        let mut candidates = Vec::new();
        for joint in 0..self.joints() {
            let limits = self.limits(joint);
            let may_stick = limits.low < limits.high;
            if zero[joint] && may_stick {
                candidates.push(joint);
            } else {
                let direction = if may_stick { sign(self.slip(joint, &rows[joint])) } else { 0 };
                self.set_direction(joint, direction);
            }
        }
        let (at, acceleration) = self.sticking(&rows, &candidates)?;
        for ((&joint, at), acceleration) in candidates.iter().zip(at).zip(acceleration) {
            match at {
                At::Inside if joint < frictions => self.contacts.joints[joint] = 0,
                At::Inside => self.contacts.particles[joint - frictions].0 = Slide::Stuck,
                At::Low | At::High => {
                    let direction = if at == At::Low { 1 } else { -1 };
                    // A relative acceleration of zero: the joint starts to slide with the third power of time.
                    let order = if acceleration == 0.0 { 2 } else { 1 };
                    self.start_sliding(joint, direction, order, &mut hints);
                }
            }
        }
        for particle in 0..self.mount.cavities.len() {
            let (slide, touch) = &mut self.contacts.particles[particle];
            if let (Slide::Free(_), Touch::Wall(_)) = (&slide, &touch) {
                *touch = Touch::None;
            }
        }
        self.phase(&hints)
    }

    /// A joint starts to slide from rest in `direction`; the relative velocity grows with the power `order` of time.
    fn start_sliding(&mut self, joint: usize, direction: Sign, order: usize, hints: &mut Vec<(Event, usize)>) {
        let frictions = self.mount.frictions.len();
        hints.push((Event::Stops(joint), order));
        if let Some(particle) = joint.checked_sub(frictions)
            && let Touch::Wall(side) = self.contacts.particles[particle].1
        {
            self.contacts.particles[particle].1 = Touch::None;
            hints.push((Event::Wall(particle, side), order + 1));
        }
        self.set_direction(joint, direction);
    }

    fn set_direction(&mut self, joint: usize, direction: Sign) {
        match joint.checked_sub(self.mount.frictions.len()) {
            None => self.contacts.joints[joint] = direction,
            Some(particle) => {
                let has_friction = self.mount.cavities[particle].friction_n > 0.0;
                self.contacts.particles[particle].0 = Slide::Free(if has_friction { direction } else { 0 });
            }
        }
    }

    /// The accelerations of all bodies when the joints in `free` have no force, and the sizes of their terms.
    fn accelerations(&self, rows: &[Vec<f64>], free: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let mount = &self.mount;
        let bodies = &mount.bodies;
        let mut force: Vec<f64> = bodies.springs(&self.q).iter().map(|f| -f).collect();
        let mut size: Vec<f64> = force.iter().map(|f| f.abs()).collect();
        let mut push = |more: f64, row: &[f64]| {
            add(&mut force, more, row);
            size.iter_mut().zip(row).for_each(|(size, row)| *size += (more * row).abs());
        };
        push(-1.0, &bodies.dashpots(&self.v));
        let wave = C64::new(self.wave.cosine, self.wave.sine);
        let driven: Vec<f64> = mount.force.iter().map(|f| (f * wave).re).collect();
        push(1.0, &driven);
        for (i, cavity) in mount.cavities.iter().enumerate() {
            let mut unit = vec![0.0; bodies.len()];
            unit[mount.fixed + i] = 1.0;
            push(-cavity.weight_n, &unit);
            if let Touch::Pressing(side) = self.contacts.particles[i].1
                && let WallLaw::Soft { stiffness, damping, .. } = *cavity.wall(side)
            {
                let (offset, slide) = self.offset(i);
                let row = &rows[mount.frictions.len() + i];
                push(-(stiffness * (offset - signed(side, cavity.end(side))) + damping * slide), row);
            }
        }
        for (joint, row) in rows.iter().enumerate().filter(|(joint, _)| !free.contains(joint)) {
            push(self.sliding_force(joint), row);
        }
        let per_mass = |x: Vec<f64>| x.iter().zip(&bodies.mass).map(|(x, mass)| x / mass).collect();
        (per_mass(force), per_mass(size))
    }

    /// Force of a sliding joint along its row, N.
    fn sliding_force(&self, joint: usize) -> f64 {
        self.contacts.sliding_force(&self.mount, joint)
    }

    /// Solves for the joints of zero relative velocity. Returns where each is and its relative acceleration.
    fn sticking(&self, rows: &[Vec<f64>], candidates: &[usize]) -> Result<(Vec<At>, Vec<f64>), Refused> {
        if candidates.is_empty() {
            return Ok((Vec::new(), Vec::new()));
        }
        let (acceleration, size) = self.accelerations(rows, candidates);
        let w = self.compliance(rows, candidates);
        let base = -self.share() * self.turning * self.turning * self.wave.sine;
        let mut a0 = Vec::new();
        let mut tolerance = Vec::new();
        for &joint in candidates {
            let row = &rows[joint];
            let influence = self.mount.frictions.get(joint).map_or(0.0, |friction| friction.influence);
            a0.push(dot(row, &acceleration) + influence * base);
            let sizes = row.iter().zip(&size).map(|(row, size)| (row * size).abs()).sum::<f64>();
            tolerance.push(ROUNDINGS * (sizes + (influence * base).abs()));
        }
        let limits: Vec<Limits> = candidates.iter().map(|&joint| self.limits(joint)).collect();
        let (force, at) = contact::solve(&w, &a0, &limits, &tolerance).ok_or(Refused::Redundant)?;
        let relative = (0..a0.len())
            .map(|i| {
                let a = a0[i] + (0..force.len()).map(|j| w[(i, j)] * force[j]).sum::<f64>();
                if a.abs() <= tolerance[i] { 0.0 } else { a }
            })
            .collect();
        Ok((at, relative))
    }

    /// W = Bᵀ M⁻¹ B of some joints.
    fn compliance(&self, rows: &[Vec<f64>], joints: &[usize]) -> DMatrix<f64> {
        let mass = &self.mount.bodies.mass;
        DMatrix::from_fn(joints.len(), joints.len(), |i, j| {
            rows[joints[i]].iter().zip(&rows[joints[j]]).zip(mass).map(|((a, b), mass)| a * b / mass).sum()
        })
    }

    /// Starts the phase of the present contacts.
    fn phase(&mut self, hints: &[(Event, usize)]) -> Result<(), Refused> {
        self.system = match self.known.get(&self.contacts) {
            Some(&system) => system,
            None => {
                let system = System::new(&self.mount, &self.contacts, self.turning)?;
                self.systems.push(system);
                self.known.insert(self.contacts.clone(), self.systems.len() - 1);
                self.systems.len() - 1
            }
        };
        let system = &self.systems[self.system];
        let of = |all: &[f64]| -> Vec<f64> { system.members.iter().map(|&i| all[i]).collect() };
        let (q, v) = (of(&self.q), of(&self.v));
        self.rest = system.linear.rest(&system.bodies, &q, &system.force, &self.wave, self.mount.moves_base);
        let wave = C64::new(self.wave.cosine, self.wave.sine);
        system.linear.enter(&self.rest, &q, &v, wave, &mut self.z);
        let (base, base_rate) = self.base();
        let frictions = self.mount.frictions.len();
        self.free.clear();
        for &i in &self.systems[self.system].free.clone() {
            let cavity = &self.mount.cavities[i];
            let body = self.mount.fixed + i;
            let acceleration = (self.sliding_force(frictions + i) - cavity.weight_n) / cavity.mass;
            self.free.push(Flight {
                y: self.q[body] + cavity.influence * base,
                u: self.v[body] + cavity.influence * base_rate,
                acceleration,
            });
        }
        let system = &self.systems[self.system];
        self.guards.clear();
        for guard in &system.guards {
            let fresh = hints.iter().find(|(event, _)| *event == guard.event).map_or(0, |(_, order)| *order);
            let share_offset = if self.mount.moves_base { self.wave.offset } else { 0.0 };
            let constant = guard.constant(system, &self.rest, share_offset);
            self.guards.push(Live { constant, fresh });
        }
        self.take_amplitudes();
        Ok(())
    }

    fn take_amplitudes(&mut self) {
        self.amplitudes.clear();
        self.amplitudes.extend(self.z.iter().map(|z| z.norm()));
        self.bounds.clear();
        self.steps_since_amplitudes = 0;
    }

    /// Advances by one step, at most to `limit_s`, and handles the event at its end, if any.
    fn advance<O: Observer>(&mut self, limit_s: f64, observer: &mut O) -> Result<(), Refused> {
        if let Some(event) = self.immediate() {
            self.events_at_once += 1;
            if self.events_at_once < MAX_EVENTS_AT_ONCE {
                let z = self.z.clone();
                return self.handle(event, &z, observer);
            }
            self.unresolved += 1;
        }
        let blind = self.events_at_once >= MAX_EVENTS_AT_ONCE;
        let rest_s = self.time.until(limit_s);
        let mut level = if blind { 20 } else { self.level };
        loop {
            let length_s = self.systems[self.system].length_s(level);
            if length_s < rest_s {
                self.systems[self.system].make_steps(level);
                if let Some(first) = self.try_step(Some(level), length_s, blind || level >= LAST_LEVEL) {
                    self.level = if first.is_none() { level.saturating_sub(1) } else { level };
                    return self.take(length_s, None, first, observer);
                }
                level += 1;
            } else if let Some(first) = self.try_step(None, rest_s, blind || level >= LAST_LEVEL) {
                self.level = level;
                return self.take(rest_s, Some(limit_s), first, observer);
            } else {
                // Less than the rest.
                while self.systems[self.system].length_s(level) >= rest_s {
                    level += 1;
                }
            }
        }
    }

    /// A guard that fails at once: its value is not above rounding, and it falls.
    fn immediate(&mut self) -> Option<Event> {
        let system = &self.systems[self.system];
        for (guard, live) in system.guards.iter().zip(&mut self.guards) {
            if live.fresh > 0 {
                continue;
            }
            let parabola = guard.parabola(&self.free, live.constant);
            let here = guard.guard.at(&self.z, self.z.len(), parabola.at(0.0));
            if here.value <= 0.0 {
                if here.slope > 0.0 {
                    live.fresh = 1;
                } else {
                    return Some(guard.event);
                }
            }
        }
        None
    }

    /// Judges all guards over a step. `None`: undecided; `Some(None)`: no event.
    fn try_step(&mut self, level: Option<usize>, length_s: f64, blind: bool) -> Option<Option<First>> {
        if blind {
            return Some(None);
        }
        let system = &self.systems[self.system];
        let own;
        let step = match level {
            Some(level) => &system.steps[level],
            None => {
                own = Step::new(&system.linear.rates, length_s);
                &own
            }
        };
        let end: Vec<C64> = self.z.iter().zip(&step.turn).map(|(z, turn)| z * turn).collect();
        let mut falls: Vec<usize> = Vec::new();
        for (n, (guard, live)) in system.guards.iter().zip(&self.guards).enumerate() {
            let parabola = guard.parabola(&self.free, live.constant);
            let bounds = guard.guard.bounds(step, &self.amplitudes);
            if live.fresh > 1 {
                let (mut value, mut most) = guard.guard.derivative(&self.z, &system.linear.rates, live.fresh as i32);
                if live.fresh == 2 {
                    value += parabola.bend;
                    most += parabola.bend.abs();
                }
                let (_, next) = guard.guard.derivative(&self.z, &system.linear.rates, live.fresh as i32 + 1);
                let rises = value > ROUNDINGS * most;
                if rises && next * length_s < (live.fresh + 1) as f64 * value {
                    continue;
                }
                return None;
            }
            let mut start = guard.guard.at(&self.z, step.slow, parabola.at(0.0));
            let is_zero = live.fresh == 1;
            if is_zero && step.slow == self.z.len() {
                start.value = 0.0;
            }
            let at_end = guard.guard.at(&end, step.slow, parabola.at(length_s));
            match bounds.judge(length_s, start, at_end, is_zero) {
                Verdict::Clear => {}
                Verdict::Falls => falls.push(n),
                Verdict::Unsure => return None,
            }
        }
        let mut first: Option<First> = None;
        for n in falls {
            let limit_s = first.as_ref().map_or(length_s, |first| first.at_s);
            if let Some(found) = self.root(n, length_s, limit_s) {
                first = Some(found);
            }
        }
        Some(first)
    }

    /// The root of a guard that falls through zero once within `length_s`; `None` if it is after `limit_s`.
    fn root(&self, which: usize, length_s: f64, limit_s: f64) -> Option<First> {
        let system = &self.systems[self.system];
        let guard = &system.guards[which];
        let parabola = guard.parabola(&self.free, self.guards[which].constant);
        let rates = &system.linear.rates;
        let at = |t: f64| -> (Vec<C64>, Here) {
            let z: Vec<C64> = self.z.iter().zip(rates).map(|(z, rate)| z * (rate * t).exp()).collect();
            let here = guard.guard.at(&z, z.len(), parabola.at(t));
            (z, here)
        };
        let (mut low, mut high) = (0.0, length_s);
        let start = guard.guard.at(&self.z, self.z.len(), parabola.at(0.0));
        let mut t = (start.value / -start.slope).clamp(0.0, length_s);
        if !t.is_finite() || t == 0.0 || t == length_s {
            t = 0.5 * length_s;
        }
        for _ in 0..100 {
            let (z, here) = at(t);
            if here.value > 0.0 {
                low = t;
            } else {
                high = t;
            }
            if low > limit_s {
                return None;
            }
            let newton = t - here.value / here.slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let is_close = (newton - t).abs() <= 4.0 * f64::EPSILON * t.max(f64::MIN_POSITIVE);
            if is_close || next <= low || next >= high || high - low <= f64::EPSILON * high {
                return (t <= limit_s).then_some(First { at_s: t, event: guard.event, z });
            }
            t = next;
        }
        let (z, _) = at(high);
        (high <= limit_s).then_some(First { at_s: high, event: guard.event, z })
    }

    /// Moves to the end of a step or to the event within it.
    fn take<O: Observer>(
        &mut self,
        length_s: f64,
        end_s: Option<f64>,
        first: Option<First>,
        observer: &mut O,
    ) -> Result<(), Refused> {
        let taken_s = first.as_ref().map_or(length_s, |first| first.at_s);
        if O::PIECES && taken_s > 0.0 {
            observer.piece(&Piece::new(self.piece_parts(), self.time.seconds(), taken_s));
        }
        let z = match &first {
            Some(first) => first.z.clone(),
            None => {
                let rates = &self.systems[self.system].linear.rates;
                let known = self.systems[self.system].steps.iter().find(|step| step.length_s == length_s);
                match known {
                    Some(step) => self.z.iter().zip(&step.turn).map(|(z, turn)| z * turn).collect(),
                    None => self.z.iter().zip(rates).map(|(z, rate)| z * (rate * length_s).exp()).collect(),
                }
            }
        };
        self.free.iter_mut().for_each(|flight| *flight = flight.after(taken_s));
        self.time = match (end_s, &first) {
            (Some(end_s), None) => Time::at(end_s),
            _ => self.time.plus(taken_s),
        };
        self.wave = self.excitation.wave(self.time);
        self.z = z;
        let wave = self.systems[self.system].linear.wave;
        self.z[wave] = C64::new(self.wave.cosine, self.wave.sine);
        if taken_s > 0.0 {
            self.events_at_once = 0;
            self.guards.iter_mut().for_each(|live| live.fresh = 0);
        }
        self.steps_since_amplitudes += 1;
        match first {
            Some(First { event, .. }) => {
                self.events_at_once += 1;
                let z = self.z.clone();
                self.handle(event, &z, observer)
            }
            None => {
                if self.steps_since_amplitudes >= STEPS_PER_AMPLITUDE {
                    self.take_amplitudes();
                }
                Ok(())
            }
        }
    }

    fn piece_parts(&self) -> crate::observe::Parts<'_> {
        crate::observe::Parts {
            mount: &self.mount,
            system: &self.systems[self.system],
            rest: &self.rest,
            z: &self.z,
            offset_m: self.share() * self.wave.offset,
        }
    }

    /// An instant at which the excitation's closed form changes.
    fn pass_break(&mut self) -> Result<(), Refused> {
        let z = self.z.clone();
        self.leave(&z);
        let before = self.base().1;
        self.next_break_s = self.excitation.next_break_s(self.time.seconds());
        self.wave = self.excitation.wave(self.time);
        let jump = self.base().1 - before;
        let mut zero = self.stuck();
        if jump != 0.0 {
            // Absolute velocities go on: the modal ones relative to the base jump by −Γ.
            for (v, inertia, mass) in self
                .v
                .iter_mut()
                .zip(&self.mount.bodies.inertia)
                .zip(&self.mount.bodies.mass)
                .map(|((v, inertia), mass)| (v, inertia, mass))
            {
                *v -= inertia / mass * jump;
            }
            for (joint, zero) in zero.iter_mut().enumerate() {
                let moved = self.mount.frictions.get(joint).is_some_and(|friction| friction.force_n > 0.0);
                *zero &= !moved;
            }
        }
        self.resolve(&zero, &[])
    }

    /// Ends the phase: bodies take their state.
    fn leave(&mut self, z: &[C64]) {
        let (mut q, mut v) = (std::mem::take(&mut self.q), std::mem::take(&mut self.v));
        self.settle(z, &self.free, &mut q, &mut v);
        (self.q, self.v) = (q, v);
    }

    /// Joints that stick now.
    fn stuck(&self) -> Vec<bool> {
        let particles = self.contacts.particles.iter().map(|(slide, _)| *slide == Slide::Stuck);
        self.contacts.joints.iter().map(|joint| *joint == 0).chain(particles).collect()
    }

    fn handle<O: Observer>(&mut self, event: Event, z: &[C64], observer: &mut O) -> Result<(), Refused> {
        self.leave(z);
        let mut zero = self.stuck();
        match event {
            Event::Stops(joint) => {
                let row = self.joint_row(joint);
                let slip = self.slip(joint, &row);
                // The velocity of the lighter side takes what rounding has left.
                if let Some(particle) = joint.checked_sub(self.mount.frictions.len()) {
                    self.v[self.mount.fixed + particle] -= slip;
                }
                zero[joint] = true;
                self.resolve(&zero, &[])
            }
            Event::Breaks(joint, direction) => {
                let mut hints = Vec::new();
                self.start_sliding(joint, direction, 2, &mut hints);
                self.phase(&hints)
            }
            Event::Wall(particle, side) => {
                self.place_at_wall(particle, side);
                if self.mount.cavities[particle].is_soft(side) {
                    self.contacts.particles[particle].1 = Touch::Pressing(side);
                    let approach_speed_m_per_s = signed(side, self.offset(particle).1);
                    observer.impact(&Impact { time_s: self.time_s(), damper: particle, side, approach_speed_m_per_s });
                    return self.resolve(&zero, &[(Event::Releases(particle, side), 1)]);
                }
                self.contacts.particles[particle].1 = Touch::Wall(side);
                let mut hits = vec![(particle, side)];
                self.others_at_walls(particle, &mut hits);
                self.hit(&hits, zero, observer)
            }
            Event::Releases(particle, side) => {
                let cavity = &self.mount.cavities[particle];
                let past = signed(side, self.offset(particle).0) - cavity.end(side);
                let keeps = matches!(cavity.wall(side), WallLaw::Soft { release: Release::ZeroForce, .. }) && past > 0.0;
                if keeps {
                    self.contacts.particles[particle].1 = Touch::Leaving(side);
                    return self.resolve(&zero, &[]);
                }
                self.contacts.particles[particle].1 = Touch::None;
                self.place_at_wall(particle, side);
                self.resolve(&zero, &[(Event::Wall(particle, side), 1)])
            }
            Event::Inside(particle, side) => {
                self.contacts.particles[particle].1 = Touch::None;
                self.place_at_wall(particle, side);
                self.resolve(&zero, &[(Event::Wall(particle, side), 1)])
            }
        }
    }

    /// Other particles that meet a hard wall at this instant, to within rounding.
    fn others_at_walls(&mut self, except: usize, hits: &mut Vec<(usize, Sign)>) {
        for i in (0..self.mount.cavities.len()).filter(|&i| i != except) {
            if self.contacts.particles[i].1 != Touch::None || self.contacts.particles[i].0 == Slide::Stuck {
                continue;
            }
            let (offset, slide) = self.offset(i);
            let side = sign(slide);
            let cavity = &self.mount.cavities[i];
            let size = cavity.end(side).abs() + self.q[self.mount.fixed + i].abs();
            if side != 0 && !cavity.is_soft(side) && cavity.end(side) - signed(side, offset) <= ROUNDINGS * size {
                self.place_at_wall(i, side);
                self.contacts.particles[i].1 = Touch::Wall(side);
                hits.push((i, side));
            }
        }
    }

    /// Impacts at one instant: of the particles in `hits`, together with those that rest at a wall.
    fn hit<O: Observer>(&mut self, hits: &[(usize, Sign)], mut zero: Vec<bool>, observer: &mut O) -> Result<(), Refused> {
        let frictions = self.mount.frictions.len();
        let rows: Vec<Vec<f64>> = (0..self.joints()).map(|joint| self.joint_row(joint)).collect();
        let mut closed: Vec<(usize, Sign, f64)> = Vec::new();
        for (i, (slide, touch)) in self.contacts.particles.iter().enumerate() {
            if let Touch::Wall(side) = *touch {
                let closing = if *slide == Slide::Stuck { 0.0 } else { signed(side, dot(&rows[frictions + i], &self.v)) };
                closed.push((i, side, closing));
            }
        }
        for &(damper, side) in hits {
            if let Some((.., approach)) = closed.iter().find(|(i, ..)| *i == damper) {
                observer.impact(&Impact { time_s: self.time_s(), damper, side, approach_speed_m_per_s: *approach });
            }
        }
        let before = self.v.clone();
        let restitution: Vec<f64> = closed
            .iter()
            .map(|&(i, side, closing)| match self.mount.cavities[i].wall(side) {
                WallLaw::Hard(law) if closing > 0.0 => law.at(closing),
                _ => 0.0,
            })
            .collect();
        let closes = self.impulses(&rows, &closed, &restitution)?;
        let size = before.iter().chain(&self.v).fold(0.0, |most: f64, v| most.max(v.abs()));
        let mut hints = Vec::new();
        let mut resting = restitution.clone();
        for (n, &(i, side, closing)) in closed.iter().enumerate() {
            let joint = frictions + i;
            let after = signed(side, dot(&rows[joint], &self.v));
            let stays = closes[n] && (restitution[n] == 0.0 || closing <= 0.0);
            zero[joint] = stays;
            if !stays {
                // It leaves the wall.
                self.contacts.particles[i].1 = Touch::None;
                self.set_direction(joint, sign(-signed(side, 1.0)));
                hints.push((Event::Wall(i, side), 1));
                if closes[n] && self.is_invisible(&rows, i, side, -after)? {
                    resting[n] = 0.0;
                }
            }
        }
        if resting != restitution {
            self.v.copy_from_slice(&before);
            self.impulses(&rows, &closed, &resting)?;
            for (n, &(i, side, _)) in closed.iter().enumerate().filter(|(n, _)| resting[*n] != restitution[*n]) {
                let joint = frictions + i;
                zero[joint] = true;
                self.contacts.particles[i].1 = Touch::Wall(side);
                hints.retain(|(event, _)| *event != Event::Wall(i, side));
                let _ = n;
            }
        }
        // The impulses move joints that stuck.
        for joint in 0..frictions {
            let moved = self.slip(joint, &rows[joint]);
            zero[joint] = zero[joint] && moved.abs() <= ROUNDINGS * size * rows[joint].iter().map(|x| x.abs()).sum::<f64>();
        }
        for i in 0..self.mount.cavities.len() {
            let joint = frictions + i;
            if zero[joint] && self.contacts.particles[i].1 == Touch::None {
                let moved = dot(&rows[joint], &self.v);
                zero[joint] = moved.abs() <= ROUNDINGS * size;
            }
            if zero[joint] {
                let slide = dot(&rows[joint], &self.v);
                self.v[self.mount.fixed + i] -= slide;
            }
        }
        self.resolve(&zero, &hints)
    }

    /// Applies the impulses of closed contacts (Moreau's law): each separates at least at e times its approach, at exactly that where it
    /// has an impulse. Returns which have one.
    fn impulses(
        &mut self,
        rows: &[Vec<f64>],
        closed: &[(usize, Sign, f64)],
        restitution: &[f64],
    ) -> Result<Vec<bool>, Refused> {
        let frictions = self.mount.frictions.len();
        let towards: Vec<Vec<f64>> = closed
            .iter()
            .map(|&(i, side, _)| rows[frictions + i].iter().map(|x| signed(side, *x)).collect())
            .collect();
        let all: Vec<usize> = (0..closed.len()).collect();
        let w = self.compliance(&towards, &all);
        let a0: Vec<f64> = closed.iter().zip(restitution).map(|((.., closing), e)| -(1.0 + e) * closing).collect();
        let limits = vec![Limits { low: 0.0, high: f64::INFINITY }; closed.len()];
        let size = self.v.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let tolerance = vec![f64::EPSILON * size; closed.len()];
        let (impulse, at) = contact::solve(&w, &a0, &limits, &tolerance).ok_or(Refused::Redundant)?;
        for (row, impulse) in towards.iter().zip(&impulse) {
            for ((v, row), mass) in self.v.iter_mut().zip(row).zip(&self.mount.bodies.mass) {
                *v -= row * impulse / mass;
            }
        }
        Ok(at.iter().map(|at| *at == At::Inside).collect())
    }

    /// Whether a particle that has left a wall at `speed` would return from a height within rounding.
    fn is_invisible(&self, rows: &[Vec<f64>], particle: usize, side: Sign, speed: f64) -> Result<bool, Refused> {
        let frictions = self.mount.frictions.len();
        let (acceleration, _) = self.accelerations(rows, &[]);
        let pressing = signed(side, dot(&rows[frictions + particle], &acceleration));
        let cavity = &self.mount.cavities[particle];
        let size = cavity.end(side).abs() + self.q[self.mount.fixed + particle].abs();
        Ok(pressing > 0.0 && speed * speed <= 8.0 * f64::EPSILON * size * pressing)
    }
}
