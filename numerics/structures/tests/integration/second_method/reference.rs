//! The motion: steps, events by changes of sign, impacts, and the states of the joints after each event.

use super::convex::{self, Hold, solve};
use super::equations::{Contact, Drive, End, Equations, Grip, Moment, Pattern, dot};
use super::runge_kutta::{Phase, step};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Release;
use damprig_structures::{Body, SetUp, State};

/// Length of a step times the fastest rate, rad: the method's error is then about 1e-13 of the motion in a cycle.
const STEP_RAD: f64 = 0.2;

/// Bounce height, relative to the displacements, below which a particle comes to rest on its wall.
const LOWEST_BOUNCE: f64 = 1e-14;

/// Gaps, relative to the displacements, that count as closed at an impact.
const CLOSED: f64 = 1e-12;

/// Relative velocities, relative to the fastest motion, that count as zero after an event.
const AT_REST: f64 = 1e-12;

/// Accelerations, relative to the fastest motion, that count as zero when the state of a joint is found.
const BALANCED: f64 = 1e-10;

/// A guard that comes this near to zero without crossing it at the ends of a step is looked at between them, relative to its size.
const NEAR: f64 = 1e-4;

/// Depth below zero that rounding causes, relative to the size of a guard.
const NOISE: f64 = 3e-15;

/// Most events at one instant.
const AT_ONCE: u32 = 60;

/// A function that is positive as long as the pattern lasts.
#[derive(Clone, Copy, Debug)]
enum Guard {
    /// Room between a particle and a wall.
    Gap(usize, usize),
    /// Penetration of a soft wall.
    Penetration(usize, usize),
    /// Force of a soft wall.
    Pressure(usize, usize),
    /// Speed of a slipping joint.
    Slip(usize, f64),
    /// Distance of the force in a stuck joint from a limit with this sign: position in the list of stuck joints, joint.
    Limit(usize, usize, f64),
}

/// How often something happened.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Impacts on hard walls.
    pub impacts: u32,
    /// Instants with two or more of them.
    pub double_impacts: u32,
    /// Contacts with soft walls.
    pub soft_contacts: u32,
    /// Ends of a chatter.
    pub rests: u32,
    /// Times at which a particle or a friction joint stuck.
    pub sticks: u32,
    /// Times at which a second friction joint stuck while one did.
    pub double_sticks: u32,
}

/// A motion by the second method.
#[derive(Clone, Debug)]
pub struct Reference {
    equations: Equations,
    pattern: Pattern,
    state: Phase,
    /// Time since the start of the cycle, s: the excitation repeats.
    t: f64,
    cycle_s: f64,
    /// Largest displacement so far, m.
    scale: f64,
    /// The fastest mode, rad/s.
    fastest: f64,
    step_rad: f64,
    step_s: f64,
    at_once: u32,
    pub counts: Counts,
}

fn sign_of(side: usize) -> f64 {
    if side == 0 { -1.0 } else { 1.0 }
}

impl Reference {
    /// From `start` at t = 0; `cycle_s` is a period of the excitation, or any time with a base at rest. The displacements are at
    /// least of the size of `scale_m`.
    pub fn new(
        set_up: &SetUp,
        excitation: &Excitation,
        start: &State,
        cycle_s: f64,
        scale_m: f64,
    ) -> Result<Self, &'static str> {
        let equations = Equations::new(set_up, excitation);
        let mut state = Phase::default();
        let modes = start.modal.iter().zip(&start.modal_rate).map(|(q, v)| [*q, *v]);
        let bodies = start.particles.iter().chain(&start.tuned_masses).map(|body| [body.y_m, body.u_m_per_s]);
        for (number, [displacement, velocity]) in modes.chain(bodies).enumerate() {
            state.displacement[number] = displacement;
            state.velocity[number] = velocity;
        }
        let frequencies = set_up.structure.modes.iter().map(|mode| mode.angular_frequency_rad_per_s);
        let pattern = Pattern {
            grips: vec![Grip::Slip(0.0); equations.joints.len()],
            contacts: vec![Contact::Clear; equations.cages.len()],
            ..Pattern::default()
        };
        let mut reference = Self {
            equations,
            pattern,
            state,
            t: 0.0,
            cycle_s,
            scale: scale_m,
            fastest: frequencies.fold(0.0, f64::max),
            step_rad: STEP_RAD,
            step_s: 0.0,
            at_once: 0,
            counts: Counts::default(),
        };
        reference.classify()?;
        Ok(reference)
    }

    /// With other steps: their length times the fastest rate, rad.
    pub fn with_steps_rad(mut self, step_rad: f64) -> Self {
        self.step_s *= step_rad / self.step_rad;
        self.step_rad = step_rad;
        self
    }

    /// Largest displacement so far, m.
    pub fn scale_m(&self) -> f64 {
        self.scale
    }

    /// Runs to the end of the cycle.
    pub fn cycle(&mut self) -> Result<(), &'static str> {
        while self.t < self.cycle_s {
            self.advance()?;
        }
        self.t = 0.0;
        Ok(())
    }

    pub fn state(&self) -> State {
        let modes = self.equations.modes;
        let particles = self.equations.cages.len();
        let body =
            |number: usize| Body { y_m: self.state.displacement[number], u_m_per_s: self.state.velocity[number] };
        State {
            modal: self.state.displacement[..modes].to_vec(),
            modal_rate: self.state.velocity[..modes].to_vec(),
            particles: (modes..modes + particles).map(body).collect(),
            tuned_masses: self.equations.tuned_bodies.iter().map(|number| body(*number)).collect(),
        }
    }

    /// Largest difference of two states in the displacements of places and bodies, m, and in their velocities divided by the rate
    /// of the fastest mode.
    pub fn apart_m(&self, a: &State, b: &State) -> f64 {
        let phase = |state: &State| {
            let bodies = state.particles.iter().chain(&state.tuned_masses);
            let mut phase = Phase::default();
            for (number, q) in state.modal.iter().copied().chain(bodies.clone().map(|body| body.y_m)).enumerate() {
                phase.displacement[number] = q;
            }
            for (number, v) in state.modal_rate.iter().copied().chain(bodies.map(|body| body.u_m_per_s)).enumerate() {
                phase.velocity[number] = v;
            }
            phase
        };
        let (a, b) = (phase(a), phase(b));
        let mut worst = 0.0_f64;
        let mut take = |a: f64, b: f64, unit: f64| {
            worst = if (a - b).is_nan() { f64::NAN } else { worst.max((a - b).abs() / unit) }
        };
        for place in &self.equations.places {
            take(dot(&place.along, &a.displacement), dot(&place.along, &b.displacement), 1.0);
            take(dot(&place.along, &a.velocity), dot(&place.along, &b.velocity), self.fastest);
        }
        for body in self.equations.cages.iter().map(|cage| cage.body).chain(self.equations.tuned_bodies.iter().copied())
        {
            take(a.displacement[body], b.displacement[body], 1.0);
            take(a.velocity[body], b.velocity[body], self.fastest);
        }
        worst
    }

    fn speed(&self) -> f64 {
        self.scale * self.fastest
    }

    /// The state `h` later in the present pattern.
    fn later(&self, h: f64) -> Phase {
        step(|t, state| self.equations.rate(&self.pattern, t, state), self.t, &self.state, h)
    }

    fn moment(&self, after: f64, state: &Phase) -> Moment {
        self.equations.moment(&self.pattern, self.t + after, state)
    }

    /// Takes one step, or goes to the first event in it.
    fn advance(&mut self) -> Result<(), &'static str> {
        let rest = self.cycle_s - self.t;
        let is_last = rest <= self.step_s;
        let h = if is_last { rest } else { self.step_s };
        let end = self.later(h);
        let (before, after) = (self.moment(0.0, &self.state), self.moment(h, &end));
        let mut first: Option<(f64, Guard)> = None;
        for guard in self.guards() {
            let Some(at) = self.crossing(guard, h, &before, &after) else { continue };
            if first.is_none_or(|(earliest, _)| at < earliest) {
                first = Some((at, guard));
            }
        }
        let Some((at, guard)) = first else {
            self.state = end;
            self.t = if is_last { self.cycle_s } else { self.t + h };
            self.at_once = 0;
            self.settle();
            return Ok(());
        };
        self.at_once = if at > 1e-12 { 0 } else { self.at_once + 1 };
        if self.at_once > AT_ONCE {
            return Err("too many events at one instant");
        }
        self.state = self.later(at * h);
        self.t += at * h;
        self.settle();
        self.handle(guard)
    }

    /// Removes what rounding adds to the velocities of stuck joints and to the positions of particles at rest on a wall.
    fn settle(&mut self) {
        let drive = Drive::at(&self.equations.excitation, self.t);
        let Equations { joints, cages, places, .. } = &self.equations;
        let slips: Vec<f64> =
            self.pattern.stuck.iter().map(|joint| joints[*joint].of(&self.state.velocity, drive.base[1])).collect();
        for (row, joint) in self.pattern.inverse.iter().zip(&self.pattern.stuck) {
            let impulse: f64 = -row.iter().zip(&slips).map(|(a, b)| a * b).sum::<f64>();
            self.state.velocity.iter_mut().zip(&joints[*joint].response).for_each(|(v, r)| *v += r * impulse);
        }
        for (number, contact) in self.pattern.contacts.iter().enumerate() {
            let cage = &cages[number];
            if let Contact::Resting(side) = contact {
                let offset = joints[number].of(&self.state.displacement, drive.base[0]);
                self.state.displacement[cage.body] += cage.at[*side] - offset;
            }
            self.scale = self.scale.max(self.state.displacement[cage.body].abs());
        }
        for place in places {
            self.scale = self.scale.max(place.of(&self.state.displacement, drive.base[0]).abs());
        }
    }

    fn guards(&self) -> Vec<Guard> {
        let mut guards = Vec::new();
        for (number, cage) in self.equations.cages.iter().enumerate() {
            if self.pattern.grips[number] == Grip::Stuck {
                continue;
            }
            match self.pattern.contacts[number] {
                Contact::Clear => guards.extend([Guard::Gap(number, 0), Guard::Gap(number, 1)]),
                Contact::Resting(_) => {}
                Contact::Released(side) => guards.push(Guard::Penetration(number, side)),
                Contact::Pressing(side) => guards.push(match cage.ends[side] {
                    End::Soft { release: Release::ZeroForce, .. } => Guard::Pressure(number, side),
                    _ => Guard::Penetration(number, side),
                }),
            }
        }
        for (joint, friction) in self.equations.friction.iter().enumerate() {
            if let Grip::Slip(sign) = self.pattern.grips[joint]
                && *friction > 0.0
            {
                guards.push(Guard::Slip(joint, sign));
            }
        }
        for (row, joint) in self.pattern.stuck.iter().enumerate() {
            let limits = self.limits(*joint);
            let finite = [-1.0, 1.0].into_iter().zip(limits).filter(|(_, limit)| limit.is_finite());
            guards.extend(finite.map(|(sign, _)| Guard::Limit(row, *joint, sign)));
        }
        guards
    }

    /// Limits of the force in a joint without relative velocity.
    fn limits(&self, joint: usize) -> [f64; 2] {
        let friction = self.equations.friction[joint];
        match self.pattern.contacts.get(joint) {
            Some(Contact::Resting(0)) => [-friction, f64::INFINITY],
            Some(Contact::Resting(_)) => [f64::NEG_INFINITY, friction],
            _ => [-friction, friction],
        }
    }

    /// Value and rate of a guard, and the size that its rounding is judged by.
    fn value(&self, guard: Guard, moment: &Moment) -> (f64, f64, f64) {
        let relative = |joint: usize| moment.relative(&self.equations.joints[joint]);
        let past = |number: usize, side: usize| {
            let [offset, slip, acceleration, _] = relative(number);
            let sign = sign_of(side);
            [sign * (offset - self.equations.cages[number].at[side]), sign * slip, sign * acceleration]
        };
        match guard {
            Guard::Gap(number, side) => {
                let [past, slip, _] = past(number, side);
                (-past, -slip, self.scale)
            }
            Guard::Penetration(number, side) => {
                let [past, slip, _] = past(number, side);
                (past, slip, self.scale)
            }
            Guard::Pressure(number, side) => {
                let [past, slip, acceleration] = past(number, side);
                let End::Soft { stiffness, damping, .. } = self.equations.cages[number].ends[side] else {
                    unreachable!("only a soft wall presses")
                };
                let size = stiffness * self.scale + damping * self.speed();
                (stiffness * past + damping * slip, stiffness * slip + damping * acceleration, size)
            }
            Guard::Slip(joint, sign) => {
                let [_, slip, acceleration, _] = relative(joint);
                (sign * slip, sign * acceleration, self.speed())
            }
            Guard::Limit(row, joint, sign) => {
                let compliance = self.equations.compliance(&[joint])[0][0];
                let size = self.equations.friction[joint].max(self.speed() * self.fastest / compliance);
                let limit = self.limits(joint)[usize::from(sign > 0.0)];
                (sign * (limit - moment.forces[row]), -sign * moment.force_rates[row], size)
            }
        }
    }

    /// The fraction of a step of length `h` at which a guard becomes negative for the first time.
    fn crossing(&self, guard: Guard, h: f64, before: &Moment, after: &Moment) -> Option<f64> {
        let value = |at: f64| {
            let (value, rate, _) = self.value(guard, &self.moment(at * h, &self.later(at * h)));
            (value, rate * h)
        };
        let (g0, d0, _) = self.value(guard, before);
        let (g1, d1, size) = self.value(guard, after);
        let (d0, d1) = (d0 * h, d1 * h);
        let noise = NOISE * size;
        let mut high = 1.0;
        if g1 >= -noise {
            // The cubic with these values and slopes tells where the guard comes near zero; the motion itself decides.
            let c2 = 3.0 * (g1 - g0) - 2.0 * d0 - d1;
            let c3 = d0 + d1 - 2.0 * (g1 - g0);
            let discriminant = c2 * c2 - 3.0 * c3 * d0;
            if discriminant <= 0.0 {
                return None;
            }
            let root = discriminant.sqrt();
            let mut at = if c2 > 0.0 { -d0 / (c2 + root) } else { (root - c2) / (3.0 * c3) };
            let lowest = g0 + at * (d0 + at * (c2 + at * c3));
            if !(at > 0.0 && at < 1.0 && lowest < NEAR * size) {
                return None;
            }
            let mut is_below = false;
            for _ in 0..6 {
                let (g, d) = value(at);
                if g < -noise {
                    is_below = true;
                    break;
                }
                let next = (at - d / (2.0 * root)).clamp(0.0, 1.0);
                if (next - at).abs() < 1e-12 {
                    break;
                }
                at = next;
            }
            if !is_below {
                return None;
            }
            high = at;
        }
        let mut low = 0.0;
        if g0 <= 0.0 {
            // The pattern has just begun with this guard at zero.
            let Some(positive) = (1..40).map(|n| high * 0.5_f64.powi(n)).find(|at| value(*at).0 > 0.0) else {
                return Some(0.0);
            };
            low = positive;
        }
        Some(Self::root(value, low, high))
    }

    /// Root between `low`, where a function is positive, and `high`, where it is not, by Newton's method within the bracket.
    fn root(value: impl Fn(f64) -> (f64, f64), mut low: f64, mut high: f64) -> f64 {
        let mut at = 0.5 * (low + high);
        for _ in 0..100 {
            let (g, d) = value(at);
            if g > 0.0 {
                low = at;
            } else {
                high = at;
            }
            let newton = at - g / d;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - at).abs() <= 1e-15 || high - low <= 1e-16 * high {
                return next;
            }
            at = next;
        }
        at
    }

    fn handle(&mut self, guard: Guard) -> Result<(), &'static str> {
        match guard {
            Guard::Gap(number, side) => {
                if matches!(self.equations.cages[number].ends[side], End::Hard(_)) {
                    return self.impact();
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
    fn classify(&mut self) -> Result<(), &'static str> {
        let drive = Drive::at(&self.equations.excitation, self.t);
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
