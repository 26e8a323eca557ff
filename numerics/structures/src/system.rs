//! The system of one state of the contacts: its natural motions and its guards.

use damprig_core::integrator::modes::signed;
use damprig_core::model::Release;

use crate::Refused;
use crate::basis::Constraint;
use crate::bodies::{Bodies, Link};
use crate::contacts::{Contacts, Event, Slide, Touch};
use crate::flight::Flight;
use crate::guard::{Guard, Step};
use crate::linear::{C64, Linear, Rest, Signal};
use crate::mount::{Cavity, Mount, WallLaw};
use crate::piezoelectric::Piezoelectric;
use crate::polynomial::Polynomial;
use crate::push::Push;

/// Longest step of a system in which nothing swings, s.
const LONGEST_S: f64 = 1.0;

/// A guard with what it consists of.
#[derive(Clone, Debug)]
pub(crate) struct Watched {
    pub event: Event,
    pub guard: Guard,
    /// Its natural motions are those of the guard before it with the opposite sign: the two walls of a particle.
    pub is_mirrored: bool,
    source: Source,
    /// Part that is the same in every phase.
    constant: f64,
    /// Per cubic of the base's displacement, and of its velocity.
    of_base: [f64; 2],
    flight: Flying,
}

/// Where the cubic of a guard comes from.
#[derive(Clone, Debug)]
enum Source {
    /// A displacement and its velocity, each times a factor.
    Signal(Signal, [f64; 2]),
    /// The force of the constraint with this number, times a factor.
    Holding(usize, f64),
}

/// What of a particle in free flight a guard contains: the particle's number among the free ones, and the factor.
#[derive(Clone, Copy, Debug)]
enum Flying {
    Nothing,
    Displacement(usize, f64),
    Velocity(usize, f64),
}

impl Watched {
    /// A guard of a displacement and its velocity, each times a factor, without other parts.
    fn of(event: Event, signal: Signal, factors: [f64; 2], rates: &[C64]) -> Self {
        let [of, of_rate] = factors;
        let coefficients = signal.coefficients.iter().zip(rates).map(|(c, rate)| c * of + c * rate * of_rate).collect();
        Self {
            event,
            guard: Guard::new(coefficients, rates),
            is_mirrored: false,
            source: Source::Signal(signal, factors),
            constant: 0.0,
            of_base: [0.0; 2],
            flight: Flying::Nothing,
        }
    }

    /// The polynomial in a phase, but for a free particle: `base` is the base's cubic.
    pub fn polynomial(&self, system: &System, rest: &Rest, base: Polynomial) -> Polynomial {
        let of_motion = match &self.source {
            Source::Signal(signal, [of, of_rate]) => {
                let cubic = signal.polynomial(rest);
                *of * cubic + *of_rate * cubic.rate()
            }
            Source::Holding(which, factor) => {
                *factor * system.linear.holding_rest(&system.bodies, *which, rest, (&system.force, base))
            }
        };
        let [of, of_rate] = self.of_base;
        Polynomial::constant(self.constant) + of_motion + of * base + of_rate * base.rate()
    }

    /// The size of what cancels in its polynomial where it is zero.
    pub fn scale(&self, free: &[Flight]) -> f64 {
        match self.flight {
            Flying::Nothing => self.constant.abs(),
            Flying::Displacement(n, factor) => (factor * free[n].0.value).abs(),
            Flying::Velocity(n, factor) => (factor * free[n].0.slope).abs(),
        }
    }

    /// Raises a guard of a particle in free flight by moving the particle, or by changing its velocity.
    pub fn lift(&self, free: &mut [Flight], by: f64) {
        match self.flight {
            Flying::Nothing => {}
            Flying::Displacement(n, factor) => free[n].0.value += by / factor,
            Flying::Velocity(n, factor) => free[n].0.slope += by / factor,
        }
    }

    /// The polynomial from now on with that of a free particle; `own`: without it.
    #[inline]
    pub fn with_flight(&self, free: &[Flight], own: Polynomial) -> Polynomial {
        match self.flight {
            Flying::Nothing => own,
            Flying::Displacement(n, factor) => own.with(factor, free[n].0),
            Flying::Velocity(n, factor) => own.with(factor, free[n].0.rate()),
        }
    }
}

/// A Hertz wall that is pressed.
#[derive(Clone, Debug)]
pub(crate) struct Pushed {
    pub particle: usize,
    /// On the members per force of the wall.
    pub push: Push,
    /// Number of the guard that is its penetration; `None` where friction holds the particle.
    pub guard: Option<usize>,
}

/// The system of one state of the contacts.
#[derive(Clone, Debug)]
pub(crate) struct System {
    pub contacts: Contacts,
    /// Its bodies, by their numbers among all.
    pub members: Vec<usize>,
    pub bodies: Bodies,
    pub linear: Linear,
    /// Constant force on each member, N.
    pub force: Vec<f64>,
    /// Particles in free flight.
    pub free: Vec<usize>,
    pub guards: Vec<Watched>,
    /// Hertz walls that are pressed.
    pub pushes: Vec<Pushed>,
    /// Absolute displacement of every place, but for the influence times the base's cubic.
    pub places: Vec<Signal>,
    pub steps: Vec<Step>,
    longest_s: f64,
}

impl System {
    pub fn new(mount: &Mount, contacts: &Contacts, turning: f64) -> Result<Self, Refused> {
        let mut members: Vec<usize> = (0..mount.permanent).collect();
        let mut free = Vec::new();
        for (particle, touch) in contacts.touches.iter().enumerate() {
            let is_stuck = contacts.slides[mount.joint_of(particle)] == Slide::Stuck;
            let is_link = matches!(*touch, Touch::Pressing(side) if !mount.cavities[particle].is_hertz(side));
            if is_stuck || is_link {
                members.push(mount.permanent + particle);
            } else {
                free.push(particle);
            }
        }
        let of = |all: &[f64]| -> Vec<f64> { members.iter().map(|&i| all[i]).collect() };
        let all = &mount.bodies;
        let (constant, pressed) = contacts.loads(mount);
        let links = all.links.iter().chain(&pressed);
        let bodies = Bodies {
            mass: of(&all.mass),
            inertia: of(&all.inertia),
            stiffness: of(&all.stiffness),
            damping: of(&all.damping),
            coupling: all.coupling.clone(),
            links: links.map(|link| Link { row: of(&link.row), ..*link }).collect(),
        };
        let sticks = mount.joints.iter().enumerate().filter(|(number, _)| contacts.slides[*number] == Slide::Stuck);
        let stuck =
            sticks.map(|(number, joint)| (number, Constraint { row: of(&joint.row), influence: joint.influence }));
        let force: Vec<C64> = members.iter().map(|&i| mount.force[i]).collect();
        let (stuck, constraints): (Vec<usize>, Vec<Constraint>) = stuck.unzip();
        let linear = Linear::new(&bodies, &constraints, turning, &force)?;
        let slowest = linear.slowest_per_s();
        let mut system = Self {
            contacts: contacts.clone(),
            force: members.iter().map(|&i| constant[i]).collect(),
            members,
            bodies,
            linear,
            free,
            guards: Vec::new(),
            pushes: Vec::new(),
            places: Vec::new(),
            steps: Vec::new(),
            longest_s: if slowest.is_finite() { 2.0 / slowest } else { LONGEST_S },
        };
        system.places = mount.places.iter().map(|place| system.place(&place.shape, place.influence)).collect();
        system.watch_sliding(mount);
        system.watch_sticking(mount, &stuck, &force);
        for particle in 0..mount.cavities.len() {
            system.watch_walls(mount, particle);
            system.push_walls(mount, particle);
        }
        Ok(system)
    }

    /// Length of the steps of a level, s.
    pub fn length_s(&self, level: usize) -> f64 {
        self.longest_s * 0.5_f64.powi(i32::try_from(level).unwrap_or(i32::MAX))
    }

    /// Prepares the steps up to a level.
    pub fn make_steps(&mut self, level: usize) {
        while self.steps.len() <= level {
            let length_s = self.length_s(self.steps.len());
            self.steps.push(Step::new(&self.linear.natural.rates, length_s));
        }
    }

    /// Absolute displacement of a place from its shape and its influence, but for the influence times the base's cubic.
    pub fn place(&self, shape: &[f64], influence: f64) -> Signal {
        let mut row = shape.to_vec();
        row.resize(self.members.len(), 0.0);
        let mut signal = self.linear.displacement(&row);
        signal.coefficients[self.linear.natural.wave] -= C64::new(0.0, influence);
        signal
    }

    /// A row over all bodies for its members.
    fn own(&self, row: &[f64]) -> Vec<f64> {
        self.members.iter().map(|&i| row[i]).collect()
    }

    /// Joints that slide until they stop. The velocity of a particle in free flight is no part of the system.
    fn watch_sliding(&mut self, mount: &Mount) {
        for (number, joint) in mount.joints.iter().enumerate() {
            let Slide::Free(direction) = self.contacts.slides[number] else { continue };
            if direction == 0 {
                continue;
            }
            let flying =
                mount.particle_of(number).and_then(|particle| self.free.iter().position(|&free| free == particle));
            let along = f64::from(direction);
            // y′ − x′ with the absolute velocity x′ of the place.
            let base = if flying.is_some() { -mount.influence_of(number) } else { joint.influence };
            let mut signal = self.linear.displacement(&self.own(&joint.row));
            signal.coefficients[self.linear.natural.wave] -= C64::new(0.0, base);
            let guard = Watched::of(Event::Stops(number), signal, [0.0, along], &self.linear.natural.rates);
            let flight = flying.map_or(Flying::Nothing, |n| Flying::Velocity(n, along));
            self.guards.push(Watched { flight, of_base: [0.0, along * base], ..guard });
        }
    }

    /// Joints that stick until their force reaches a limit. At its lower limit it cannot hold back a motion along the row.
    fn watch_sticking(&mut self, mount: &Mount, stuck: &[usize], force: &[C64]) {
        for (which, &joint) in stuck.iter().enumerate() {
            let limits = self.contacts.limits(mount, joint);
            let holding = self.linear.holding(&self.bodies, which, force);
            for (limit, direction) in [(limits.low, 1), (limits.high, -1)] {
                if limit.is_infinite() {
                    continue;
                }
                let factor = f64::from(direction);
                self.guards.push(Watched {
                    event: Event::Breaks(joint, direction),
                    is_mirrored: false,
                    guard: Guard::new(holding.iter().map(|c| c * factor).collect(), &self.linear.natural.rates),
                    source: Source::Holding(which, factor),
                    constant: -factor * limit,
                    of_base: [0.0; 2],
                    flight: Flying::Nothing,
                });
            }
        }
    }

    /// Walls that a particle in free flight will reach, and the soft wall that it presses into.
    fn watch_walls(&mut self, mount: &Mount, particle: usize) {
        let (cavity, touch) = (&mount.cavities[particle], self.contacts.touches[particle]);
        let is_stuck = self.contacts.slides[mount.joint_of(particle)] == Slide::Stuck;
        if let Some(n) = self.free.iter().position(|&free| free == particle) {
            let place = self.place(&cavity.place, cavity.influence);
            let mut first = 0.0;
            for side in [-1_i8, 1] {
                // Gap to the wall, or what is left of the penetration.
                let is_leaving = touch == Touch::Leaving(side);
                let is_pressed = touch == Touch::Pressing(side);
                let sign = if is_leaving || is_pressed { -1.0 } else { 1.0 };
                let factor = sign * f64::from(side);
                let is_mirrored = side == 1 && factor == -first;
                first = factor;
                let wall = cavity.piezoelectric(side);
                let is_mirrored = is_mirrored && wall.or(cavity.piezoelectric(-1)).is_none();
                let place = wall.map_or_else(|| place.clone(), |wall| self.place_and_surface(cavity, wall, factor));
                let event = match sign {
                    1.0 => Event::Wall(particle, side),
                    _ if is_pressed => Event::Releases(particle, side),
                    _ => Event::Inside(particle, side),
                };
                self.guards.push(Watched {
                    is_mirrored,
                    constant: sign * cavity.end(side),
                    of_base: [factor * cavity.influence, 0.0],
                    flight: Flying::Displacement(n, -factor),
                    ..Watched::of(event, place, [factor, 0.0], &self.linear.natural.rates)
                });
            }
        }
        if let Touch::Pressing(side) = touch
            && !is_stuck
            && let WallLaw::Soft { stiffness, damping, release } = *cavity.wall(side)
        {
            let row = self.own(mount.offset_row(particle));
            // The penetration, or the force.
            let (of, of_rate) = match release {
                Release::ZeroPenetration => (1.0, 0.0),
                Release::ZeroForce => (stiffness, damping),
            };
            let factors = [of, of_rate].map(|of| signed(side, of));
            let displacement = self.linear.displacement(&row);
            self.guards.push(Watched {
                constant: -of * cavity.end(side),
                ..Watched::of(Event::Releases(particle, side), displacement, factors, &self.linear.natural.rates)
            });
        }
        // A surface that stands elsewhere with its charge reaches and leaves a particle that sticks, too.
        for side in [-1_i8, 1] {
            let (event, sign) = match touch {
                Touch::Pressing(pressed) if pressed == side => (Event::Releases(particle, side), 1.0),
                Touch::None if is_stuck => (Event::Wall(particle, side), -1.0),
                _ => continue,
            };
            if let Some(wall) = cavity.piezoelectric(side) {
                let mut row = self.own(mount.offset_row(particle));
                row.iter_mut().for_each(|of| *of = signed(side, *of));
                row[wall.charge] -= wall.stands_m_per_c();
                let beyond = self.linear.displacement(&row);
                self.guards.push(Watched {
                    constant: -sign * cavity.end(side),
                    ..Watched::of(event, beyond, [sign, 0.0], &self.linear.natural.rates)
                });
            }
        }
    }

    /// The Hertz wall that a particle presses into, with the guard of its penetration.
    fn push_walls(&mut self, mount: &Mount, particle: usize) {
        if let Touch::Pressing(side) = self.contacts.touches[particle]
            && mount.cavities[particle].is_hertz(side)
        {
            let row = self.own(mount.offset_row(particle)).iter().map(|of| -signed(side, *of)).collect();
            let guard = self.guards.iter().position(|guard| guard.event == Event::Releases(particle, side));
            self.pushes.push(Pushed { particle, push: self.linear.push(row), guard });
        }
    }

    /// Displacement of a particle's place and `factor` times that of the wall's surface by its charge, as [`System::place`].
    fn place_and_surface(&self, cavity: &Cavity, wall: &Piezoelectric, factor: f64) -> Signal {
        let mut shape = cavity.place.clone();
        shape.resize(wall.charge, 0.0);
        shape.push(factor * wall.stands_m_per_c());
        self.place(&shape, cavity.influence)
    }
}
