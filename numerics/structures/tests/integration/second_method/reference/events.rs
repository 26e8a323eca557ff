//! What an event does: impacts, and which joints stick and slip afterwards.

use super::super::convex::{self, Hold, solve};
use super::super::equations::{Contact, End, Grip};
use super::guards::Guard;
use super::{Reference, sign_of};

/// Bounce height, relative to the displacements, below which a particle comes to rest on its wall.
const LOWEST_BOUNCE: f64 = 1e-14;

/// Gaps, relative to the displacements, that count as closed at an impact.
const CLOSED: f64 = 1e-12;

/// Relative velocities, relative to the fastest motion, that count as zero after an event.
const AT_REST: f64 = 1e-12;

/// Accelerations, relative to the fastest motion, that count as zero when the state of a joint is found.
const BALANCED: f64 = 1e-10;

impl Reference {
    pub fn handle(&mut self, guard: Guard) -> Result<(), &'static str> {
        match guard {
            Guard::Gap(number, side) => {
                if matches!(self.equations.cages[number].ends[side], End::Hard(_)) {
                    return self.impact();
                }
                if let End::Hertz(law) = self.equations.cages[number].ends[side] {
                    let now = self.moment(0.0, &self.state);
                    let [_, slip, ..] = now.relative(&self.equations.joints[number]);
                    self.pattern.dissipation[number] = law.rate_s_per_m(sign_of(side) * slip);
                }
                self.counts.soft_contacts += 1;
                self.pattern.contacts[number] = Contact::Pressing(side);
            }
            Guard::Penetration(number, _) => self.pattern.contacts[number] = Contact::Clear,
            Guard::Pressure(number, side) => self.pattern.contacts[number] = Contact::Released(side),
            Guard::Slip(..) | Guard::Limit(..) => {}
        }
        self.classify()
    }

    /// All impacts of this instant together.
    fn impact(&mut self) -> Result<(), &'static str> {
        let now = self.moment(0.0, &self.state);
        // Particle, side, approach speed, e.
        let mut closed: Vec<(usize, usize, f64, f64)> = Vec::new();
        for (number, cage) in self.equations.cages.iter().enumerate() {
            let [offset, slip, ..] = now.relative(&self.equations.joints[number]);
            for side in [0, 1] {
                let End::Hard(law) = cage.ends[side] else { continue };
                let approach = sign_of(side) * slip;
                if self.pattern.contacts[number] == Contact::Resting(side) {
                    closed.push((number, side, 0.0, 0.0));
                } else if sign_of(side) * (cage.at[side] - offset) <= CLOSED * self.scale
                    && approach >= -AT_REST * self.speed()
                {
                    let approach = approach.max(0.0);
                    closed.push((number, side, approach, if approach > 0.0 { law.at(approach) } else { 0.0 }));
                }
            }
        }
        let struck = closed.iter().filter(|contact| contact.2 > AT_REST * self.speed()).count();
        self.counts.impacts += u32::try_from(struck).expect("few contacts");
        self.counts.double_impacts += u32::from(struck > 1);
        let numbers: Vec<usize> = closed.iter().map(|contact| contact.0).collect();
        let mut w = self.equations.compliance(&numbers);
        for (i, row) in w.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry *= sign_of(closed[i].1) * sign_of(closed[j].1);
            }
        }
        // A wall that a particle comes to rest on holds it.
        let mut limits = vec![[0.0, f64::INFINITY]; closed.len()];
        let velocity = self.state.velocity;
        loop {
            let b: Vec<f64> = closed.iter().map(|(.., approach, e)| -(1.0 + e) * approach).collect();
            let (impulses, violation) = solve(&w, &b, &limits);
            if violation > BALANCED * self.speed() {
                return Err("no impulses fit the law of impact");
            }
            self.state.velocity = velocity;
            for ((number, side, ..), held) in closed.iter().zip(&impulses) {
                let joint = &self.equations.joints[*number];
                let impulse = -sign_of(*side) * held.force;
                self.state.velocity.iter_mut().zip(&joint.response).for_each(|(v, r)| *v += r * impulse);
            }
            let after = self.moment(0.0, &self.state);
            for (number, side, ..) in &closed {
                let cage = &self.equations.cages[*number];
                let [offset, slip, ..] = after.relative(&self.equations.joints[*number]);
                self.state.displacement[cage.body] += cage.at[*side] - offset;
                let is_at_rest = -sign_of(*side) * slip <= AT_REST * self.speed();
                self.pattern.contacts[*number] = if is_at_rest { Contact::Resting(*side) } else { Contact::Clear };
            }
            self.classify()?;
            let after = self.moment(0.0, &self.state);
            let mut is_final = true;
            for ((number, side, _, e), limits) in closed.iter_mut().zip(&mut limits) {
                let [_, slip, acceleration, _] = after.relative(&self.equations.joints[*number]);
                let (leaving, pressing) = (-sign_of(*side) * slip, sign_of(*side) * acceleration);
                let bounces = leaving > AT_REST * self.speed() && limits[0] == 0.0;
                if bounces && pressing > 0.0 && leaving * leaving < 2.0 * pressing * LOWEST_BOUNCE * self.scale {
                    (*e, *limits) = (0.0, [f64::NEG_INFINITY, f64::INFINITY]);
                    is_final = false;
                }
            }
            if is_final {
                return Ok(());
            }
            self.counts.rests += 1;
        }
    }

    /// Finds which joints stick and which slip from here on.
    pub fn classify(&mut self) -> Result<(), &'static str> {
        let drive = self.equations.drive(self.t);
        let count = self.equations.joints.len();
        let stuck_before = std::mem::take(&mut self.pattern.stuck);
        self.pattern.inverse.clear();
        let mut still = Vec::new();
        for joint in 0..count {
            let slip = self.equations.joints[joint].of(&self.state.velocity, drive.base[1]);
            let is_still = slip.abs() <= AT_REST * self.speed();
            let is_resting = matches!(self.pattern.contacts.get(joint), Some(Contact::Resting(_)));
            if is_resting && !is_still {
                self.pattern.contacts[joint] = Contact::Clear;
            }
            if is_still && (is_resting || self.equations.friction[joint] > 0.0) {
                still.push(joint);
            }
            self.pattern.grips[joint] = Grip::Slip(if is_still { 0.0 } else { slip.signum() });
        }
        let free = self.moment(0.0, &self.state);
        let w = self.equations.compliance(&still);
        let limits: Vec<[f64; 2]> = still.iter().map(|joint| self.limits(*joint)).collect();
        let b: Vec<f64> = still.iter().map(|joint| free.relative(&self.equations.joints[*joint])[2]).collect();
        let balanced = BALANCED * self.speed() * self.fastest;
        let (mut answer, violation) = solve(&w, &b, &limits);
        if violation > balanced {
            return Err("no forces fit the joints");
        }
        // A joint at its limit without a relative acceleration: the rates of force and acceleration decide.
        let mut acceleration = free.acceleration;
        for (joint, held) in still.iter().zip(&answer) {
            let response = &self.equations.joints[*joint].response;
            acceleration.iter_mut().zip(response).for_each(|(a, r)| *a += r * held.force);
        }
        let rates = self.equations.rates(&self.pattern, &self.state, &acceleration, &drive);
        let undecided: Vec<usize> = (0..still.len()).filter(|i| answer[*i].acceleration.abs() <= balanced).collect();
        let near = |i: usize, side: usize| w[i][i] * (limits[i][side] - answer[i].force).abs() <= balanced;
        let limits_of_rates: Vec<[f64; 2]> = undecided
            .iter()
            .map(|i| [if near(*i, 0) { 0.0 } else { f64::NEG_INFINITY }, if near(*i, 1) { 0.0 } else { f64::INFINITY }])
            .collect();
        if limits_of_rates.iter().flatten().any(|limit| *limit == 0.0) {
            let b: Vec<f64> =
                undecided.iter().map(|i| self.equations.joints[still[*i]].of(&rates, drive.base[3])).collect();
            let (second, violation) = solve(&convex::part(&w, &undecided), &b, &limits_of_rates);
            if violation > balanced * self.fastest {
                return Err("no rates of the forces fit the joints");
            }
            for (i, held) in undecided.iter().zip(second) {
                answer[*i].hold = held.hold;
            }
        }
        for (joint, held) in still.iter().zip(&answer) {
            self.pattern.grips[*joint] = match held.hold {
                Hold::Inside => Grip::Stuck,
                Hold::Lower => Grip::Slip(1.0),
                Hold::Upper => Grip::Slip(-1.0),
            };
            if held.hold == Hold::Inside {
                self.pattern.stuck.push(*joint);
            } else if let Some(contact @ Contact::Resting(_)) = self.pattern.contacts.get_mut(*joint) {
                *contact = Contact::Clear;
            }
        }
        let compliance = self.equations.compliance(&self.pattern.stuck);
        self.pattern.inverse = convex::inverse(&compliance).ok_or("the forces in the joints are not determined")?;
        self.step_s = self.step_rad / self.equations.fastest(&self.pattern);
        let friction_joints =
            |stuck: &[usize]| stuck.iter().filter(|joint| **joint >= self.equations.cages.len()).count();
        let (before, now) = (friction_joints(&stuck_before), friction_joints(&self.pattern.stuck));
        self.counts.sticks += u32::from(self.pattern.stuck.len() > stuck_before.len());
        self.counts.double_sticks += u32::from(now > 1 && before < 2);
        Ok(())
    }
}
