//! The motion: steps, events by changes of sign, impacts, and the states of the joints after each event.

mod events;
mod guards;

use super::equations::{Contact, Equations, Grip, Moment, Pattern, dot};
use super::runge_kutta::{Phase, step};
use damprig_core::integrator::exact::Excitation;
use damprig_structures::{Body, SetUp, State};
use guards::Guard;

/// Length of a step times the fastest rate, rad: the method's error is then about 1e-13 of the motion in a cycle.
const STEP_RAD: f64 = 0.2;

/// Most events at one instant.
const AT_ONCE: u32 = 60;

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
            dissipation: vec![0.0; equations.cages.len()],
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
            charges_c: Vec::new(),
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
        let drive = self.equations.drive(self.t);
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
}
