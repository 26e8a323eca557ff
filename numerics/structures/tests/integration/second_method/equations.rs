//! Equations of motion in modal coordinates and absolute displacements of the bodies, written without the crate's sources.

use super::runge_kutta::{DOF, Phase, Vector};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Hertz, ImpactLaw, Release, Wall};
use damprig_structures::{HarmonicForce, SetUp};
use std::f64::consts::TAU;

/// Steps of a contact with a Hertz wall: δ^1.5 is not smooth where it begins and ends, and with a share s of the contact as a step the error is 0.01 s^2.5 of
/// the impulse there. In this many radians of [`super::reference`]'s steps, at this speed.
const HERTZ_RAD: f64 = 140.0;
const HERTZ_M_PER_S: f64 = 0.3;

/// The excitation at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drive {
    /// z and its first three derivatives.
    pub base: [f64; 4],
    /// Force and its derivative.
    pub force: [f64; 2],
}

impl Drive {
    /// `beside` is a force beside a sine of the base.
    fn at(excitation: &Excitation, beside: Option<HarmonicForce>, t: f64) -> Self {
        let harmonic = |amplitude_n: f64, w: f64, phase_rad: f64| {
            let (sine, cosine) = (w * t + phase_rad).sin_cos();
            [amplitude_n * sine, amplitude_n * w * cosine]
        };
        match *excitation {
            Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: w, phase_rad } => {
                let [a, b] = harmonic(amplitude_m, w, phase_rad);
                let force = beside.map_or([0.0; 2], |beside| harmonic(beside.amplitude_n, w, beside.phase_rad));
                Self { base: [a, b, -w * w * a, -w * w * b], force }
            }
            Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s: w, phase_rad } => {
                Self { base: [0.0; 4], force: harmonic(amplitude_n, w, phase_rad) }
            }
            _ => Self::default(),
        }
    }

    /// Its derivative; the third derivative of the base's acceleration has no use.
    fn rate(&self) -> Self {
        Self { base: [self.base[1], self.base[2], self.base[3], 0.0], force: [self.force[1], 0.0] }
    }
}

/// The relative displacement of two points, `along · displacement + base · z`, and a force on it.
#[derive(Clone, Copy, Debug)]
pub struct Relative {
    pub along: Vector,
    pub base: f64,
    /// M⁻¹ `along`: accelerations per force.
    pub response: Vector,
}

impl Relative {
    pub fn of(&self, displacement: &Vector, base: f64) -> f64 {
        dot(&self.along, displacement) + self.base * base
    }
}

pub fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A wall: the impact law of a hard one, spring, dashpot and release of a soft one, the law of one with Hertz contact.
#[derive(Clone, Copy, Debug)]
pub enum End {
    Hard(ImpactLaw<f64>),
    Soft { stiffness: f64, damping: f64, release: Release },
    Hertz(Hertz),
}

/// A particle: its walls, their positions, and the acceleration by its weight.
#[derive(Clone, Copy, Debug)]
pub struct Cage {
    pub ends: [End; 2],
    pub at: [f64; 2],
    pub weight: f64,
    /// Its place among the degrees of freedom.
    pub body: usize,
}

/// What presses or holds a particle at its walls. The side is 0 at the negative wall, 1 at the positive one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    Clear,
    /// At rest on a hard wall.
    Resting(usize),
    /// Pressing into a soft wall.
    Pressing(usize),
    /// Released by a soft wall before it is back inside the clearance.
    Released(usize),
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grip {
    Stuck,
    /// It slips in the direction of this sign; 0 where nothing rubs.
    Slip(f64),
}

/// The discrete state: which equations hold.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    pub grips: Vec<Grip>,
    pub contacts: Vec<Contact>,
    /// β of the contact of each particle with a Hertz wall.
    pub dissipation: Vec<f64>,
    /// The stuck joints.
    pub stuck: Vec<usize>,
    /// Their forces per relative acceleration, with the opposite sign.
    pub inverse: Vec<Vec<f64>>,
}

#[derive(Clone, Debug)]
pub struct Equations {
    pub modes: usize,
    squares: Vector,
    dashpots: Vector,
    coupling: Vec<f64>,
    participation: Vector,
    /// The joint of each particle, then the friction joints.
    pub joints: Vec<Relative>,
    /// Coulomb force of each joint.
    pub friction: Vec<f64>,
    pub cages: Vec<Cage>,
    tuned: Vec<(Relative, f64, f64)>,
    pub tuned_bodies: Vec<usize>,
    /// Displacement of each place.
    pub places: Vec<Relative>,
    driven: Option<usize>,
    beside: Option<HarmonicForce>,
    pub excitation: Excitation,
}

impl Equations {
    pub fn new(set_up: &SetUp, excitation: &Excitation) -> Self {
        let structure = &set_up.structure;
        let modes = structure.modes.len();
        let bodies = set_up.impact_dampers.len() + set_up.tuned_masses.len();
        assert!(modes + bodies <= DOF, "at most {DOF} degrees of freedom");
        let mut inverse_mass = [0.0; DOF];
        inverse_mass[..modes].fill(1.0);
        let mut masses = set_up.impact_dampers.iter().map(|d| d.particle.mass_kg).collect::<Vec<_>>();
        masses.extend(set_up.tuned_masses.iter().map(|t| t.tmd.mass_kg));
        for (number, mass) in masses.iter().enumerate() {
            inverse_mass[modes + number] = 1.0 / mass;
        }
        // `plus` and `minus` are places, `body` a degree of freedom on the plus side.
        let relative = |body: Option<usize>, plus: Option<usize>, minus: Option<usize>, base: f64| {
            let (mut along, mut of_base) = ([0.0; DOF], base);
            for (place, sign) in [(plus, 1.0), (minus, -1.0)] {
                let Some(place) = place else { continue };
                for (mode, coordinate) in structure.modes.iter().zip(&mut along) {
                    *coordinate += sign * mode.shape[place];
                }
                of_base += sign * structure.influence[place];
            }
            if let Some(body) = body {
                along[body] += 1.0;
            }
            let mut response = along;
            response.iter_mut().zip(&inverse_mass).for_each(|(r, m)| *r *= m);
            Relative { along, base: of_base, response }
        };
        let mut joints = Vec::new();
        let mut friction = Vec::new();
        let mut cages = Vec::new();
        for (number, damper) in set_up.impact_dampers.iter().enumerate() {
            let particle = &damper.particle;
            joints.push(relative(Some(modes + number), None, Some(damper.place), 0.0));
            let weight = set_up.gravity_m_per_s2 * particle.mass_kg;
            friction.push(particle.friction_coefficient * weight * particle.cavity.level());
            cages.push(Cage {
                ends: particle.walls().map(|wall| match wall {
                    Wall::Hertz(law) => End::Hertz(law),
                    Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release } => {
                        End::Soft { stiffness: stiffness_n_per_m, damping: damping_n_s_per_m, release }
                    }
                    _ => End::Hard(wall.impact_law::<f64>(1.0).expect("a hard wall")),
                }),
                at: particle.ends_m(),
                weight: set_up.gravity_m_per_s2 * particle.cavity.rise(),
                body: modes + number,
            });
        }
        for joint in &set_up.friction_dampers {
            let base = if joint.other.is_some() { 0.0 } else { -1.0 };
            joints.push(relative(None, Some(joint.place), joint.other, base));
            friction.push(joint.damper.force_n);
        }
        let first_tuned = modes + set_up.impact_dampers.len();
        let tuned = set_up.tuned_masses.iter().enumerate().map(|(number, mass)| {
            let spring = relative(Some(first_tuned + number), None, Some(mass.place), 0.0);
            (spring, mass.tmd.stiffness_n_per_m, mass.tmd.damping_n_s_per_m)
        });
        let mut of_modes = [[0.0; DOF]; 3];
        for (number, mode) in structure.modes.iter().enumerate() {
            let w = mode.angular_frequency_rad_per_s;
            of_modes[0][number] = w * w;
            of_modes[1][number] = 2.0 * mode.damping_ratio * w;
            of_modes[2][number] = mode.participation;
        }
        Self {
            modes,
            squares: of_modes[0],
            dashpots: of_modes[1],
            coupling: structure.coupling_per_s.clone(),
            participation: of_modes[2],
            tuned: tuned.collect(),
            tuned_bodies: (first_tuned..first_tuned + set_up.tuned_masses.len()).collect(),
            places: (0..structure.influence.len()).map(|place| relative(None, Some(place), None, 0.0)).collect(),
            joints,
            friction,
            cages,
            driven: set_up.driven_place.or(set_up.force_beside_base.map(|force| force.place)),
            beside: set_up.force_beside_base,
            excitation: *excitation,
        }
    }

    /// Relative accelerations of the joints `of` per force between them.
    pub fn compliance(&self, of: &[usize]) -> Vec<Vec<f64>> {
        let between = |i: &usize, j: &usize| dot(&self.joints[*i].along, &self.joints[*j].response);
        of.iter().map(|i| of.iter().map(|j| between(i, j)).collect()).collect()
    }

    /// Accelerations without the forces in stuck joints. All forces are linear in state and excitation, but for weights, friction and
    /// the rest positions of soft walls, which `constants` multiplies: 0 gives the rate of change of the accelerations from
    /// that of state and excitation.
    fn free(&self, pattern: &Pattern, state: &Phase, drive: &Drive, constants: f64) -> Vector {
        let (q, v) = (&state.displacement, &state.velocity);
        let mut acceleration = [0.0; DOF];
        for i in 0..self.modes {
            acceleration[i] = -self.squares[i] * q[i] - self.dashpots[i] * v[i] - self.participation[i] * drive.base[2];
            for (j, c) in self.coupling.iter().skip(i * self.modes).take(self.modes).enumerate() {
                acceleration[i] -= c * v[j];
            }
        }
        let mut push = |relative: &Relative, force: f64| {
            acceleration.iter_mut().zip(&relative.response).for_each(|(a, r)| *a += r * force);
        };
        for (joint, relative) in self.joints.iter().enumerate() {
            let mut force = match pattern.grips[joint] {
                Grip::Slip(sign) => -constants * sign * self.friction[joint],
                Grip::Stuck => 0.0,
            };
            if let Some(Contact::Pressing(side)) = pattern.contacts.get(joint) {
                let cage = &self.cages[joint];
                if let End::Soft { stiffness, damping, .. } = cage.ends[*side] {
                    let past = relative.of(q, drive.base[0]) - constants * cage.at[*side];
                    force -= stiffness * past + damping * relative.of(v, drive.base[1]);
                }
            }
            if force != 0.0 {
                push(relative, force);
            }
        }
        for (spring, stiffness, damping) in &self.tuned {
            push(spring, -stiffness * spring.of(q, drive.base[0]) - damping * spring.of(v, drive.base[1]));
        }
        if let Some(place) = self.driven {
            push(&self.places[place], drive.force[0]);
        }
        for cage in &self.cages {
            acceleration[cage.body] -= constants * cage.weight;
        }
        acceleration
    }

    /// The force of the Hertz wall that a particle presses into, along its joint, and its rate.
    fn squeezed(&self, pattern: &Pattern, joint: usize, [state, rate]: [&Phase; 2], drive: &Drive) -> Option<[f64; 2]> {
        let Contact::Pressing(side) = *pattern.contacts.get(joint)? else { return None };
        let End::Hertz(law) = self.cages[joint].ends[side] else { return None };
        let (sign, relative) = (if side == 0 { -1.0 } else { 1.0 }, &self.joints[joint]);
        let depth = sign * (relative.of(&state.displacement, drive.base[0]) - self.cages[joint].at[side]);
        let speed = sign * relative.of(&state.velocity, drive.base[1]);
        let share = 1.0 + pattern.dissipation[joint] * speed;
        if depth <= 0.0 || share <= 0.0 {
            return Some([0.0; 2]);
        }
        let elastic = law.stiffness_n_per_m15 * depth.powf(1.5);
        let faster = sign * relative.of(&rate.velocity, drive.base[2]) * pattern.dissipation[joint];
        Some([-sign * elastic * share, -sign * elastic * (1.5 * speed / depth * share + faster)])
    }

    /// Adds the accelerations by Hertz walls, or with `which` = 1 their rates.
    fn squeeze(&self, pattern: &Pattern, phases: [&Phase; 2], drive: &Drive, acceleration: &mut Vector, which: usize) {
        for joint in 0..self.cages.len() {
            if let Some(force) = self.squeezed(pattern, joint, phases, drive) {
                let response = &self.joints[joint].response;
                acceleration.iter_mut().zip(response).for_each(|(a, r)| *a += r * force[which]);
            }
        }
    }

    /// Adds the forces that keep stuck joints without a relative acceleration; `base` is the acceleration of the base.
    fn held(&self, pattern: &Pattern, acceleration: &mut Vector, base: f64) -> Vec<f64> {
        let relative: Vec<f64> = pattern.stuck.iter().map(|joint| self.joints[*joint].of(acceleration, base)).collect();
        let forces: Vec<f64> =
            pattern.inverse.iter().map(|row| -row.iter().zip(&relative).map(|(a, b)| a * b).sum::<f64>()).collect();
        for (joint, force) in pattern.stuck.iter().zip(&forces) {
            acceleration.iter_mut().zip(&self.joints[*joint].response).for_each(|(a, r)| *a += r * force);
        }
        forces
    }

    /// What drives at t.
    pub fn drive(&self, t: f64) -> Drive {
        Drive::at(&self.excitation, self.beside, t)
    }

    /// Velocities and accelerations.
    pub fn rate(&self, pattern: &Pattern, t: f64, state: &Phase) -> Phase {
        let drive = self.drive(t);
        let mut acceleration = self.free(pattern, state, &drive, 1.0);
        self.squeeze(pattern, [state; 2], &drive, &mut acceleration, 0);
        if !pattern.stuck.is_empty() {
            self.held(pattern, &mut acceleration, drive.base[2]);
        }
        Phase { displacement: state.velocity, velocity: acceleration }
    }

    /// Everything that guards look at.
    pub fn moment(&self, pattern: &Pattern, t: f64, state: &Phase) -> Moment {
        let drive = self.drive(t);
        let mut acceleration = self.free(pattern, state, &drive, 1.0);
        self.squeeze(pattern, [state; 2], &drive, &mut acceleration, 0);
        let forces = self.held(pattern, &mut acceleration, drive.base[2]);
        let rate = Phase { displacement: state.velocity, velocity: acceleration };
        let mut jerk = self.free(pattern, &rate, &drive.rate(), 0.0);
        self.squeeze(pattern, [state, &rate], &drive, &mut jerk, 1);
        let force_rates = self.held(pattern, &mut jerk, drive.base[3]);
        Moment { drive, state: *state, acceleration, forces, jerk, force_rates }
    }

    /// Rates of the accelerations where no force in a stuck joint changes.
    pub fn rates(&self, pattern: &Pattern, state: &Phase, acceleration: &Vector, drive: &Drive) -> Vector {
        let rate = Phase { displacement: state.velocity, velocity: *acceleration };
        let mut rates = self.free(pattern, &rate, &drive.rate(), 0.0);
        self.squeeze(pattern, [state, &rate], drive, &mut rates, 1);
        rates
    }

    /// An upper bound of the fastest rate of the motion, rad/s.
    pub fn fastest(&self, pattern: &Pattern) -> f64 {
        let mut square = self.squares.iter().fold(0.0_f64, |most, square| most.max(*square));
        let mut damping = self.dashpots.iter().fold(0.0_f64, |most, rate| most.max(*rate));
        damping += self.coupling.iter().map(|c| c.abs()).sum::<f64>();
        let mut link = |relative: &Relative, k: f64, c: f64| {
            let compliance = dot(&relative.along, &relative.response);
            square += k * compliance;
            damping += c * compliance;
        };
        for (spring, stiffness, dashpot) in &self.tuned {
            link(spring, *stiffness, *dashpot);
        }
        for (number, contact) in pattern.contacts.iter().enumerate() {
            if let Contact::Pressing(side) = contact
                && let End::Soft { stiffness, damping, .. } = self.cages[number].ends[*side]
            {
                link(&self.joints[number], stiffness, damping);
            }
        }
        let rate = |(number, contact): (usize, &Contact)| {
            let Contact::Pressing(side) = *contact else { return 0.0 };
            let End::Hertz(law) = self.cages[number].ends[side] else { return 0.0 };
            let reduced_kg = 1.0 / self.compliance(&[number])[0][0];
            HERTZ_RAD / law.elastic_duration_s(reduced_kg, HERTZ_M_PER_S)
        };
        let squeezed = pattern.contacts.iter().enumerate().map(rate).fold(0.0, f64::max);
        (square.sqrt() + damping).max(squeezed).max(self.excitation.angular_frequency_rad_per_s()).max(TAU)
    }
}

/// Motion, forces and their rates at an instant.
#[derive(Clone, Debug)]
pub struct Moment {
    pub drive: Drive,
    pub state: Phase,
    pub acceleration: Vector,
    /// Forces of the stuck joints, in the order of [`Pattern::stuck`].
    pub forces: Vec<f64>,
    pub jerk: Vector,
    pub force_rates: Vec<f64>,
}

impl Moment {
    /// Relative displacement and its first three derivatives.
    pub fn relative(&self, relative: &Relative) -> [f64; 4] {
        let base = &self.drive.base;
        [
            relative.of(&self.state.displacement, base[0]),
            relative.of(&self.state.velocity, base[1]),
            relative.of(&self.acceleration, base[2]),
            relative.of(&self.jerk, base[3]),
        ]
    }
}
