//! Events: impacts, starts and ends of sliding, contacts with soft walls.

use damprig_core::integrator::modes::{Sign, sign, signed};
use damprig_core::model::Release;
use nalgebra::DMatrix;
use smallvec::{SmallVec, smallvec};

use crate::Refused;
use crate::bodies::{add, dot};
use crate::complementarity::{At, Limits, solve};
use crate::contacts::{Event, Slide, Touch};
use crate::linear::C64;
use crate::motion::{Motion, ROUNDINGS};
use crate::mount::{Joint, WallLaw};
use crate::observe::{Impact, Observer};

/// Bounces are compared with rounding only when slower than this fraction of the fastest impact.
const SLOW: f64 = 1e-4;

/// Particles within this share of the displacements from their walls meet them at the same instant: the roundings of many cycles part
/// two equal particles by less.
const ONE_INSTANT: f64 = 1e-12;

/// A list of what takes part in one instant: mostly few.
pub(crate) type Few<T> = SmallVec<[T; 8]>;

impl Motion {
    /// Decides at an instant which joints of zero relative velocity stick, and starts the next phase. `hints`: guards that are zero by
    /// definition besides those that follow from this decision.
    pub(crate) fn resolve(&mut self, zero: &[bool], hints: &[(Event, usize)]) -> Result<(), Refused> {
        let mut hints: Few<(Event, usize)> = hints.into();
        let mut candidates: Few<usize> = Few::new();
        for (joint, &is_zero) in zero.iter().enumerate() {
            let may_stick = self.contacts.may_stick(&self.mount, joint);
            let slip = if may_stick && !is_zero { self.slip_beyond_rounding(joint) } else { 0.0 };
            if may_stick && slip == 0.0 {
                candidates.push(joint);
            } else {
                self.set_direction(joint, sign(slip));
            }
        }
        let sticking = if candidates.is_empty() { Sticking::default() } else { self.sticking(&candidates, &[])? };
        for ((&joint, at), relative) in candidates.iter().zip(sticking.at).zip(sticking.relative) {
            match at {
                At::Inside => self.contacts.slides[joint] = Slide::Stuck,
                At::Low | At::High => {
                    let direction = if at == At::Low { 1 } else { -1 };
                    // Without a relative acceleration the velocity starts with the square of time.
                    let order = if relative == 0.0 { 2 } else { 1 };
                    self.start_sliding(joint, direction, order, &mut hints);
                }
            }
        }
        for particle in 0..self.mount.cavities.len() {
            let slides = self.contacts.slides[self.mount.joint_of(particle)] != Slide::Stuck;
            if slides && matches!(self.contacts.touches[particle], Touch::Wall(_)) {
                self.contacts.touches[particle] = Touch::None;
            }
        }
        self.phase(&hints)
    }

    /// Relative velocity of a joint; 0 where it is within rounding.
    fn slip_beyond_rounding(&self, joint: usize) -> f64 {
        let size: f64 = self.mount.joints[joint].row.iter().zip(&self.v).map(|(row, v)| (row * v).abs()).sum();
        let slip = self.slip(joint);
        if slip.abs() <= ROUNDINGS * size { 0.0 } else { slip }
    }

    /// A joint starts to slide from rest in `direction`; the relative velocity grows with the power `order` of time.
    fn start_sliding(&mut self, joint: usize, direction: Sign, order: usize, hints: &mut Few<(Event, usize)>) {
        hints.push((Event::Stops(joint), order));
        if let Some(particle) = self.mount.particle_of(joint)
            && let Touch::Wall(side) = self.contacts.touches[particle]
        {
            self.contacts.touches[particle] = Touch::None;
            hints.push((Event::Wall(particle, side), order + 1));
        }
        self.set_direction(joint, direction);
    }

    fn set_direction(&mut self, joint: usize, direction: Sign) {
        let has_friction = self.mount.joints[joint].friction_n > 0.0;
        self.contacts.slides[joint] = Slide::Free(if has_friction { direction } else { 0 });
    }

    /// The accelerations of all bodies when the joints in `free` have no force, and the sizes of their terms.
    fn accelerations(&self, free: &[usize]) -> (Vec<f64>, Vec<f64>) {
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
        let driven: Few<f64> = mount.force.iter().map(|f| (f * wave).re).collect();
        push(1.0, &driven);
        push(-self.base_cubic.bend, &bodies.inertia);
        for (i, cavity) in mount.cavities.iter().enumerate() {
            if cavity.weight_n != 0.0 {
                let mut unit: Few<f64> = smallvec![0.0; bodies.len()];
                unit[mount.permanent + i] = 1.0;
                push(-cavity.weight_n, &unit);
            }
            if let Touch::Pressing(side) = self.contacts.touches[i] {
                let (offset, slide) = self.offset(i);
                let away_n = match *cavity.wall(side) {
                    WallLaw::Hard(_) => continue,
                    WallLaw::Hertz(_) => -self.squeezed_n(i),
                    WallLaw::Soft { stiffness, damping, .. } => {
                        stiffness * (offset - cavity.wall_at(side)) + damping * slide
                    }
                    WallLaw::Piezoelectric(wall) => {
                        let beyond = signed(side, offset) - self.surface(i, side).0;
                        signed(side, wall.open_stiffness() * beyond)
                    }
                };
                push(-away_n, mount.offset_row(i));
            }
        }
        for (number, joint) in mount.joints.iter().enumerate().filter(|(number, _)| !free.contains(number)) {
            push(self.contacts.sliding_force(mount, number), &joint.row);
        }
        let per_mass = |x: Vec<f64>| x.iter().zip(bodies.divisors()).map(|(x, mass)| x / mass).collect();
        (per_mass(force), per_mass(size))
    }

    /// Solves for the joints of zero relative velocity, `candidates`; those in `without` have no force.
    fn sticking(&self, candidates: &[usize], without: &[usize]) -> Result<Sticking, Refused> {
        let (acceleration, size) = self.accelerations(&[candidates, without].concat());
        let w = self.compliance(candidates, |_| 1.0);
        let base = self.base_cubic.bend - self.mount.share * self.turning * self.turning * self.wave.sine;
        let mut a0 = Vec::new();
        let mut tolerance = Vec::new();
        for &joint in candidates {
            let Joint { row, influence, .. } = &self.mount.joints[joint];
            a0.push(dot(row, &acceleration) + influence * base);
            let sizes = row.iter().zip(&size).map(|(row, size)| (row * size).abs()).sum::<f64>();
            tolerance.push(ROUNDINGS * (sizes + (influence * base).abs()));
        }
        let limits: Vec<Limits> = candidates.iter().map(|&joint| self.contacts.limits(&self.mount, joint)).collect();
        let (force, at) = solve(&w, &a0, &limits, &tolerance).ok_or(Refused::Redundant)?;
        let relative = (0..a0.len())
            .map(|i| {
                let a = a0[i] + (0..force.len()).map(|j| w[(i, j)] * force[j]).sum::<f64>();
                if a.abs() <= tolerance[i] { 0.0 } else { a }
            })
            .collect();
        Ok(Sticking { at, relative, force, acceleration })
    }

    /// Relative accelerations of some joints per force in them, each along its row times its sign.
    fn compliance(&self, joints: &[usize], along: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let of = |i: usize, j: usize| along(i) * along(j) * self.mount.compliance[(joints[i], joints[j])];
        DMatrix::from_fn(joints.len(), joints.len(), of)
    }

    /// Handles the event that ends the present phase, and starts the next one.
    pub(crate) fn handle<O: Observer>(&mut self, event: Event, observer: &mut O) -> Result<(), Refused> {
        self.leave();
        self.handled = Some(event);
        let mut zero = self.stuck();
        match event {
            Event::Stops(joint) => {
                let slip = self.slip(joint);
                // The particle takes what rounding has left.
                if let Some(particle) = self.mount.particle_of(joint) {
                    self.v[self.mount.permanent + particle] -= slip;
                }
                zero[joint] = true;
                self.resolve(&zero, &[])
            }
            Event::Breaks(joint, direction) => {
                let mut hints = Few::new();
                for (joint, direction) in self.breaking(joint, direction) {
                    self.start_sliding(joint, direction, 2, &mut hints);
                }
                self.phase(&hints)
            }
            Event::Wall(particle, side) => {
                self.place_at_wall(particle, side);
                if self.mount.cavities[particle].is_soft(side) {
                    let approaches = signed(side, self.slip_beyond_rounding(self.mount.joint_of(particle))) > 0.0;
                    let speed_m_per_s = if approaches { signed(side, self.offset(particle).1) } else { 0.0 };
                    if self.begin_pressing(particle, side, speed_m_per_s) > 0.0 {
                        observer.impact(&self.impact(particle, side, speed_m_per_s, 0.0));
                    }
                    return self.resolve(&zero, &[(Event::Releases(particle, side), 1)]);
                }
                self.contacts.touches[particle] = Touch::Wall(side);
                let mut hits: Few<(usize, Sign)> = smallvec![(particle, side)];
                self.others_at_walls(particle, &mut hits);
                self.hit(&hits, zero, observer)
            }
            Event::Releases(particle, side) => {
                let cavity = &self.mount.cavities[particle];
                let past = signed(side, self.offset(particle).0) - cavity.end(side);
                let keeps =
                    matches!(cavity.wall(side), WallLaw::Soft { release: Release::ZeroForce, .. }) && past > 0.0;
                if keeps {
                    self.contacts.touches[particle] = Touch::Leaving(side);
                    return self.resolve(&zero, &[]);
                }
                if let Some(contact) = self.end_contact(particle) {
                    observer.contact(&contact);
                }
                self.contacts.touches[particle] = Touch::None;
                self.place_at_wall(particle, side);
                self.resolve(&zero, &[(Event::Wall(particle, side), 1)])
            }
            Event::Inside(particle, side) => {
                self.contacts.touches[particle] = Touch::None;
                self.place_at_wall(particle, side);
                self.resolve(&zero, &[(Event::Wall(particle, side), 1)])
            }
        }
    }

    /// All joints whose force reaches its limit at this instant, to within rounding, with the direction in which each will slide.
    fn breaking(&self, joint: usize, direction: Sign) -> Few<(usize, Sign)> {
        let mut all: Few<(usize, Sign)> = smallvec![(joint, direction)];
        for (n, (guard, live)) in self.systems[self.system].guards.iter().zip(&self.guards).enumerate() {
            let Event::Breaks(other, direction) = guard.event else { continue };
            let here = guard.guard.at(&self.z, self.z.len(), guard.with_flight(&self.free, live.polynomial).at(0.0));
            // The size of what cancels in the guard: forces may be limited to 0.
            let size = self.reach(n).size();
            if other != joint && here.value <= ONE_INSTANT * size && here.slope < 0.0 {
                all.push((other, direction));
            }
        }
        all
    }

    /// Other particles that meet a hard wall at this instant, to within rounding.
    fn others_at_walls(&mut self, except: usize, hits: &mut Few<(usize, Sign)>) {
        for i in (0..self.mount.cavities.len()).filter(|&i| i != except) {
            let is_stuck = self.contacts.slides[self.mount.joint_of(i)] == Slide::Stuck;
            if is_stuck || self.contacts.touches[i] != Touch::None {
                continue;
            }
            let (offset, slide) = self.offset(i);
            let side = sign(slide);
            let cavity = &self.mount.cavities[i];
            let size = cavity.end(side).abs() + self.q[self.mount.permanent + i].abs();
            if side != 0 && !cavity.is_soft(side) && cavity.end(side) - signed(side, offset) <= ONE_INSTANT * size {
                self.place_at_wall(i, side);
                self.contacts.touches[i] = Touch::Wall(side);
                hits.push((i, side));
            }
        }
    }

    /// What an observer is told of an impact now.
    fn impact(&self, damper: usize, side: Sign, approach_speed_m_per_s: f64, impulse_n_s: f64) -> Impact {
        // The impulse acts against the mean of approach and separation.
        let separation_m_per_s = -signed(side, self.offset(damper).1);
        let lost_j = 0.5 * impulse_n_s * (approach_speed_m_per_s - separation_m_per_s);
        let base_m = self.mount.cavities[damper].influence * self.base().0;
        let y_m = self.q[self.mount.permanent + damper] + base_m;
        Impact { time_s: self.time_s(), damper, side, approach_speed_m_per_s, y_m, impulse_n_s, lost_j }
    }

    /// Impacts at one instant: of the particles in `hits`, together with those that rest at a wall.
    pub(crate) fn hit<O: Observer>(
        &mut self,
        hits: &[(usize, Sign)],
        mut zero: Few<bool>,
        observer: &mut O,
    ) -> Result<(), Refused> {
        let mut closed: Few<Closed> = Few::new();
        for (particle, touch) in self.contacts.touches.iter().enumerate() {
            if let Touch::Wall(side) = *touch {
                let rests = self.contacts.slides[self.mount.joint_of(particle)] == Slide::Stuck;
                let approach = if rests { 0.0 } else { signed(side, self.offset(particle).1) };
                let e = match self.mount.cavities[particle].wall(side) {
                    WallLaw::Hard(law) if approach > 0.0 => law.at(approach),
                    _ => 0.0,
                };
                closed.push(Closed { particle, side, approach, e, stays: false });
            }
        }
        let is_hit = |closed: &Closed| hits.iter().any(|(particle, _)| *particle == closed.particle);
        let fastest = closed.iter().filter(|closed| is_hit(closed)).map(|closed| closed.approach).fold(0.0, f64::max);
        self.fastest_m_per_s = self.fastest_m_per_s.max(fastest);
        let before: Few<f64> = self.v[..].into();
        let mut pushed = self.impulses(&closed)?;
        let speed = self.fastest(&before).max(self.fastest(&self.v));
        // Bounces that rounding hides end: these particles stay on their walls.
        for contact in &mut closed {
            let leaves = -signed(contact.side, self.offset(contact.particle).1);
            let is_slow = leaves > 0.0 && leaves <= SLOW * self.fastest_m_per_s;
            contact.stays = is_slow && self.is_hidden(contact, leaves, &zero)?;
        }
        if closed.iter().any(|contact| contact.stays) {
            self.v.copy_from_slice(&before);
            pushed = self.impulses(&closed)?;
        }
        for &(damper, side) in hits {
            if let Some((closed, pushed)) = closed.iter().zip(&pushed).find(|(closed, _)| closed.particle == damper) {
                observer.impact(&self.impact(damper, side, closed.approach, pushed.impulse_n_s));
            }
        }
        let mut hints: Few<(Event, usize)> = Few::new();
        for (&Closed { particle, side, e, stays, .. }, pushed) in closed.iter().zip(pushed) {
            let joint = self.mount.joint_of(particle);
            zero[joint] = stays || (pushed.is_pushed && e == 0.0) || self.slip_beyond_rounding(joint) == 0.0;
            if !zero[joint] {
                self.contacts.slides[joint] = Slide::Free(0);
                self.contacts.touches[particle] = Touch::None;
                hints.push((Event::Wall(particle, side), 1));
            }
        }
        // The impulses move joints that stuck, unless they do not act on them.
        for (joint, is_zero) in zero.iter_mut().enumerate() {
            let particle = self.mount.particle_of(joint);
            let is_closed = particle.is_some_and(|particle| matches!(self.contacts.touches[particle], Touch::Wall(_)));
            let size: f64 = self.mount.joints[joint].row.iter().map(|x| x.abs()).sum();
            *is_zero &= is_closed || self.slip(joint).abs() <= ROUNDINGS * size * speed;
            if let Some(particle) = particle.filter(|_| *is_zero) {
                self.v[self.mount.permanent + particle] -= self.slip(joint);
            }
        }
        self.resolve(&zero, &hints)
    }

    /// Applies the impulses of closed contacts (Moreau's law): each separates at least at e times its approach, at exactly that where it
    /// has an impulse; one that stays does not separate.
    fn impulses(&mut self, closed: &[Closed]) -> Result<Few<ContactImpulse>, Refused> {
        let (impulse, at): (Few<f64>, Few<At>) = if let [only] = closed {
            let joint = self.mount.joint_of(only.particle);
            let w = self.mount.compliance[(joint, joint)];
            (smallvec![only.bounce() / w], smallvec![At::Inside])
        } else {
            let joints: Vec<usize> = closed.iter().map(|closed| self.mount.joint_of(closed.particle)).collect();
            let w = self.compliance(&joints, |i| f64::from(closed[i].side));
            let a0: Vec<f64> = closed.iter().map(|closed| -closed.bounce()).collect();
            let low = |closed: &Closed| if closed.stays { f64::NEG_INFINITY } else { 0.0 };
            let limits: Vec<Limits> =
                closed.iter().map(|closed| Limits { low: low(closed), high: f64::INFINITY }).collect();
            let tolerance = vec![f64::EPSILON * self.fastest(&self.v); closed.len()];
            let (impulse, at) = solve(&w, &a0, &limits, &tolerance).ok_or(Refused::Redundant)?;
            (impulse.into(), at.into())
        };
        for (closed, impulse) in closed.iter().zip(&impulse) {
            let row = self.mount.offset_row(closed.particle);
            let away = -signed(closed.side, *impulse);
            let mass = self.mount.bodies.divisors();
            self.v.iter_mut().zip(row.iter().zip(mass)).for_each(|(v, (row, mass))| *v += row * away / mass);
        }
        let pushed =
            |(impulse, at): (&f64, &At)| ContactImpulse { impulse_n_s: *impulse, is_pushed: *at == At::Inside };
        Ok(impulse.iter().zip(&at).map(pushed).collect())
    }

    /// The largest magnitude of the velocities of what has a mass.
    fn fastest(&self, v: &[f64]) -> f64 {
        let masses = v.iter().zip(&self.mount.bodies.mass).filter(|(_, mass)| **mass > 0.0);
        masses.fold(0.0, |most: f64, (v, _)| most.max(v.abs()))
    }

    /// Whether a particle that has left a wall at `speed` would return from a height within rounding, while the joints in `zero` stick
    /// if they can.
    fn is_hidden(&self, closed: &Closed, speed: f64, zero: &[bool]) -> Result<bool, Refused> {
        let own = self.mount.joint_of(closed.particle);
        let can_stick = |joint: &usize| zero[*joint] && *joint != own && self.contacts.may_stick(&self.mount, *joint);
        let candidates: Few<usize> = (0..zero.len()).filter(can_stick).collect();
        let Sticking { force, acceleration, .. } = self.sticking(&candidates, &[own])?;
        let held = candidates.iter().zip(force).map(|(joint, force)| self.mount.compliance[(own, *joint)] * force);
        let pressing = signed(closed.side, dot(&self.mount.joints[own].row, &acceleration) + held.sum::<f64>());
        let cavity = &self.mount.cavities[closed.particle];
        let size = cavity.end(closed.side).abs() + self.q[self.mount.permanent + closed.particle].abs();
        Ok(pressing > 0.0 && speed * speed <= ROUNDINGS * size * pressing)
    }
}

/// What the joints of zero relative velocity do.
#[derive(Default)]
struct Sticking {
    /// Where each force is.
    at: Vec<At>,
    /// Relative acceleration of each.
    relative: Vec<f64>,
    /// Force of each.
    force: Vec<f64>,
    /// Accelerations of the bodies without these forces.
    acceleration: Vec<f64>,
}

/// What a contact has from impacts at one instant.
struct ContactImpulse {
    impulse_n_s: f64,
    /// Whether it has an impulse.
    is_pushed: bool,
}

impl Closed {
    /// Change of its relative velocity by an impulse, m/s.
    fn bounce(&self) -> f64 {
        if self.stays { self.approach } else { (1.0 + self.e) * self.approach }
    }
}

/// A particle at a hard wall at the instant of an impact.
#[derive(Clone, Copy, Debug)]
struct Closed {
    particle: usize,
    side: Sign,
    /// Speed towards the wall, m/s; 0 of a particle that rests at it.
    approach: f64,
    /// e at this speed.
    e: f64,
    /// It does not separate: its bounce would be within rounding.
    stays: bool,
}
