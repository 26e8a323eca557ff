//! The system of one state of the contacts: its natural motions and its guards.

use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::model::Release;

use crate::Refused;
use crate::guard::{Guard, Parabola, Step};
use crate::linear::{Bodies, C64, Constraint, Linear, Link, Rest, Signal};
use crate::mount::{Mount, WallLaw};

/// Longest step of a system in which nothing swings, s.
const LONGEST_S: f64 = 1.0;

/// Whether a particle moves relative to its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Slide {
    /// In this direction; 0 without friction.
    Free(Sign),
    /// It moves with its place.
    Stuck,
}

/// What a particle touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Touch {
    None,
    /// It rests at the hard wall of that side.
    Wall(Sign),
    /// It presses into the soft wall of that side.
    Pressing(Sign),
    /// That soft wall does not push it; it is not yet back inside the clearance.
    Leaving(Sign),
}

/// The state of all contacts.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Contacts {
    /// Direction of slip of each friction damper; 0: it sticks.
    pub joints: Vec<Sign>,
    pub particles: Vec<(Slide, Touch)>,
}

impl Contacts {
    /// Force of a sliding joint along its row, N. Joints are the friction dampers, then the particles.
    pub fn sliding_force(&self, mount: &Mount, joint: usize) -> f64 {
        match mount.frictions.get(joint) {
            Some(friction) => -signed(self.joints[joint], friction.force_n),
            None => {
                let particle = joint - mount.frictions.len();
                match self.particles[particle].0 {
                    Slide::Free(direction) => -signed(direction, mount.cavities[particle].friction_n),
                    Slide::Stuck => 0.0,
                }
            }
        }
    }
}

/// What ends a state of the contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// The relative velocity of a joint becomes zero.
    Stops(usize),
    /// The force of a joint that sticks reaches a limit; it will slide in that direction.
    Breaks(usize, Sign),
    /// A particle reaches a wall.
    Wall(usize, Sign),
    /// A soft wall releases a particle.
    Releases(usize, Sign),
    /// A released particle is back inside the clearance.
    Inside(usize, Sign),
}

/// A guard with what it consists of.
#[derive(Clone, Debug)]
pub(crate) struct Watched {
    pub event: Event,
    pub guard: Guard,
    signal: Source,
    constant: f64,
    /// Sign of the excitation's constant part, per base displacement.
    offset: f64,
    /// A free particle's displacement or velocity: its number among the free ones, and the factor.
    body: Option<(usize, f64)>,
    of_rate: bool,
}

#[derive(Clone, Debug)]
enum Source {
    /// A displacement or velocity times a factor.
    Signal(Signal, f64),
    /// The force of the constraint with this number, times a factor.
    Holding(usize, f64),
}

impl Watched {
    /// The constant part in a phase.
    pub fn constant(&self, system: &System, rest: &Rest, base_offset_m: f64) -> f64 {
        let of_motion = match &self.signal {
            Source::Signal(signal, factor) => factor * signal.constant(rest),
            Source::Holding(which, factor) => {
                factor * system.linear.holding_rest(&system.bodies, *which, rest, &system.force)
            }
        };
        self.constant + of_motion + self.offset * base_offset_m
    }

    /// Raises a guard of a free particle by moving the particle, or by changing its velocity.
    pub fn lift<F: Free>(&self, free: &mut [F], by: f64) {
        if let Some((n, factor)) = self.body {
            let by = by / factor;
            free[n].shift(if self.of_rate { (0.0, by) } else { (by, 0.0) });
        }
    }

    /// The part that is a parabola from now on.
    pub fn parabola<F: Free>(&self, free: &[F], constant: f64) -> Parabola {
        let Some((n, factor)) = self.body else { return Parabola { value: constant, ..Parabola::default() } };
        let (y, u, a) = free[n].parts();
        if self.of_rate {
            Parabola { value: constant + factor * u, slope: factor * a, bend: 0.0 }
        } else {
            Parabola { value: constant + factor * y, slope: factor * u, bend: factor * a }
        }
    }
}

/// A body in free flight.
pub(crate) trait Free {
    /// Displacement, velocity and acceleration.
    fn parts(&self) -> (f64, f64, f64);

    /// Adds to displacement and velocity.
    fn shift(&mut self, by: (f64, f64));
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
    pub steps: Vec<Step>,
    longest_s: f64,
}

impl System {
    pub fn new(mount: &Mount, contacts: &Contacts, turning: f64) -> Result<Self, Refused> {
        let count = mount.bodies.len();
        let mut members: Vec<usize> = (0..mount.fixed).collect();
        let mut free = Vec::new();
        for (i, (slide, touch)) in contacts.particles.iter().enumerate() {
            if *slide == Slide::Stuck || matches!(touch, Touch::Pressing(_)) {
                members.push(mount.fixed + i);
            } else {
                free.push(i);
            }
        }
        let of = |all: &[f64]| -> Vec<f64> { members.iter().map(|&i| all[i]).collect() };
        let all = &mount.bodies;
        let mut bodies = Bodies {
            mass: of(&all.mass),
            inertia: of(&all.inertia),
            stiffness: of(&all.stiffness),
            damping: of(&all.damping),
            coupling: all.coupling.clone(),
            links: all.links.iter().map(|link| Link { row: of(&link.row), ..*link }).collect(),
        };
        let mut constant = vec![0.0; count];
        let mut stuck = Vec::new();
        let mut joints = Vec::new();
        for (joint, friction) in mount.frictions.iter().enumerate() {
            if contacts.joints[joint] == 0 {
                stuck.push(Constraint { row: of(&mount.rows[joint]), influence: friction.influence });
                joints.push((joint, -friction.force_n, friction.force_n));
            } else {
                crate::linear::add(&mut constant, contacts.sliding_force(mount, joint), &mount.rows[joint]);
            }
        }
        for (i, (slide, touch)) in contacts.particles.iter().enumerate() {
            let (cavity, row) = (&mount.cavities[i], mount.offset_row(i));
            let joint = mount.frictions.len() + i;
            constant[mount.fixed + i] -= cavity.weight_n;
            if let Touch::Pressing(side) = *touch
                && let WallLaw::Soft { stiffness, damping, .. } = *cavity.wall(side)
            {
                bodies.links.push(Link { row: of(row), stiffness, damping });
                crate::linear::add(&mut constant, stiffness * signed(side, cavity.end(side)), row);
            }
            match slide {
                Slide::Free(_) => {
                    crate::linear::add(&mut constant, contacts.sliding_force(mount, joint), row);
                }
                Slide::Stuck => {
                    let friction = cavity.friction_n;
                    let (low, high) = match touch {
                        Touch::Wall(1) => (f64::NEG_INFINITY, friction),
                        Touch::Wall(_) => (-friction, f64::INFINITY),
                        _ => (-friction, friction),
                    };
                    stuck.push(Constraint { row: of(row), influence: 0.0 });
                    joints.push((joint, low, high));
                }
            }
        }
        let force: Vec<C64> = members.iter().map(|&i| mount.force[i]).collect();
        let linear = Linear::new(&bodies, &stuck, turning, &force)?;
        let slowest =
            linear.rates.iter().map(|rate| rate.norm()).filter(|rate| *rate > 0.0).fold(f64::INFINITY, f64::min);
        let mut system = Self {
            contacts: contacts.clone(),
            force: members.iter().map(|&i| constant[i]).collect(),
            members,
            bodies,
            linear,
            free,
            guards: Vec::new(),
            steps: Vec::new(),
            longest_s: if slowest.is_finite() { 2.0 / slowest } else { LONGEST_S },
        };
        system.watch(mount, contacts, &joints, &force);
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
            self.steps.push(Step::new(&self.linear.rates, length_s));
        }
    }

    /// Displacement of a place as a signal.
    pub fn place(&self, place: &[f64]) -> Signal {
        let mut row = place.to_vec();
        row.resize(self.members.len(), 0.0);
        self.linear.displacement(&row)
    }

    fn watch(&mut self, mount: &Mount, contacts: &Contacts, stuck: &[(usize, f64, f64)], force: &[C64]) {
        let rates = self.linear.rates.clone();
        let wave = self.linear.wave;
        let turning = rates[wave].im;
        let guard =
            |coefficients: &[C64], factor: f64| Guard::new(coefficients.iter().map(|c| c * factor).collect(), &rates);
        let own = |row: &[f64]| -> Vec<f64> { self.members.iter().map(|&i| row[i]).collect() };
        let mut guards = Vec::new();
        for (joint, friction) in mount.frictions.iter().enumerate().filter(|(joint, _)| contacts.joints[*joint] != 0) {
            let mut signal = self.linear.velocity(&own(&mount.rows[joint]));
            signal.coefficients[wave] += friction.influence * turning;
            let factor = f64::from(contacts.joints[joint]);
            guards.push(Watched {
                event: Event::Stops(joint),
                guard: guard(&signal.coefficients, factor),
                signal: Source::Signal(signal, factor),
                constant: 0.0,
                offset: 0.0,
                body: None,
                of_rate: false,
            });
        }
        for (which, &(joint, low, high)) in stuck.iter().enumerate() {
            let coefficients = self.linear.holding(&self.bodies, which, force);
            for (limit, factor) in [(low, 1.0), (high, -1.0)].into_iter().filter(|(limit, _)| limit.is_finite()) {
                guards.push(Watched {
                    // At its lower limit the force can not hold back a motion along the row.
                    event: Event::Breaks(joint, if factor > 0.0 { 1 } else { -1 }),
                    guard: guard(&coefficients, factor),
                    signal: Source::Holding(which, factor),
                    constant: -factor * limit,
                    offset: 0.0,
                    body: None,
                    of_rate: false,
                });
            }
        }
        for (i, &(slide, touch)) in contacts.particles.iter().enumerate() {
            let cavity = &mount.cavities[i];
            let Slide::Free(direction) = slide else { continue };
            let joint = mount.frictions.len() + i;
            if let Touch::Pressing(side) = touch {
                let row = own(mount.offset_row(i));
                let WallLaw::Soft { stiffness, damping, release } = *cavity.wall(side) else { continue };
                let displacement = self.linear.displacement(&row);
                let velocity = self.linear.velocity(&row);
                let factor = f64::from(side);
                if direction != 0 {
                    let along = f64::from(direction);
                    guards.push(Watched {
                        event: Event::Stops(joint),
                        guard: guard(&velocity.coefficients, along),
                        signal: Source::Signal(velocity.clone(), along),
                        constant: 0.0,
                        offset: 0.0,
                        body: None,
                        of_rate: false,
                    });
                }
                let (coefficients, scale): (Vec<C64>, f64) = match release {
                    Release::ZeroPenetration => (displacement.coefficients.clone(), 1.0),
                    Release::ZeroForce => {
                        let both = displacement.coefficients.iter().zip(&velocity.coefficients);
                        (both.map(|(x, v)| x * stiffness + v * damping).collect(), stiffness)
                    }
                };
                guards.push(Watched {
                    event: Event::Releases(i, side),
                    guard: guard(&coefficients, factor),
                    signal: Source::Signal(displacement, factor * scale),
                    constant: -scale * cavity.end(side),
                    offset: 0.0,
                    body: None,
                    of_rate: false,
                });
                continue;
            }
            let number = self.free.iter().position(|&free| free == i);
            let mut place = cavity.place.clone();
            place.resize(self.members.len(), 0.0);
            let mut x = self.linear.displacement(&place);
            x.coefficients[wave] += C64::new(0.0, -cavity.influence);
            if direction != 0 {
                let mut velocity = self.linear.velocity(&place);
                velocity.coefficients[wave] += cavity.influence * turning;
                let along = f64::from(direction);
                guards.push(Watched {
                    event: Event::Stops(joint),
                    guard: guard(&velocity.coefficients, -along),
                    signal: Source::Signal(velocity, -along),
                    constant: 0.0,
                    offset: 0.0,
                    body: number.map(|n| (n, along)),
                    of_rate: true,
                });
            }
            for side in [-1_i8, 1] {
                // Gap to the wall, or what is left of the penetration.
                let is_leaving = touch == Touch::Leaving(side);
                let factor = if is_leaving { -f64::from(side) } else { f64::from(side) };
                guards.push(Watched {
                    event: if is_leaving { Event::Inside(i, side) } else { Event::Wall(i, side) },
                    guard: guard(&x.coefficients, factor),
                    signal: Source::Signal(x.clone(), factor),
                    constant: if is_leaving { -cavity.end(side) } else { cavity.end(side) },
                    offset: factor * cavity.influence,
                    body: number.map(|n| (n, -factor)),
                    of_rate: false,
                });
            }
        }
        self.guards = guards;
    }
}
