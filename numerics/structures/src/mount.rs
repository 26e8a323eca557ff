//! A set-up as bodies, joints and walls: what the engine computes with.

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::model::{Hertz, ImpactLaw, Release, Wall};

use nalgebra::DMatrix;

use crate::bodies::{Bodies, Link};
use crate::contacts::Event;
use crate::linear::C64;
use crate::piezoelectric::Piezoelectric;
use crate::{Body, PiezoelectricWall, Refused, SetUp, State};

/// A wall of a cavity.
#[derive(Clone, Copy, Debug)]
pub(crate) enum WallLaw {
    Hard(ImpactLaw<f64>),
    Soft { stiffness: f64, damping: f64, release: Release },
    Hertz(Hertz),
    Piezoelectric(Piezoelectric),
}

/// A particle in its cavity.
#[derive(Clone, Debug)]
pub(crate) struct Cavity {
    /// Its place's displacement per modal coordinate.
    pub place: Vec<f64>,
    /// ι of the place; 0 where a force drives.
    pub influence: f64,
    /// m, kg.
    pub mass: f64,
    /// Distance of the walls from y = x, each towards its side, m.
    pub ends: [f64; 2],
    pub walls: [WallLaw; 2],
    /// Weight along −y, N.
    pub weight_n: f64,
}

impl Cavity {
    pub fn end(&self, side: Sign) -> f64 {
        self.ends[usize::from(side > 0)]
    }

    /// y − x at the wall of `side`, m.
    pub fn wall_at(&self, side: Sign) -> f64 {
        signed(side, self.end(side))
    }

    pub fn wall(&self, side: Sign) -> &WallLaw {
        &self.walls[usize::from(side > 0)]
    }

    /// Whether its contacts take time.
    pub fn is_soft(&self, side: Sign) -> bool {
        !matches!(self.wall(side), WallLaw::Hard(_))
    }

    pub fn is_hertz(&self, side: Sign) -> bool {
        matches!(self.wall(side), WallLaw::Hertz(_))
    }

    pub fn piezoelectric(&self, side: Sign) -> Option<&Piezoelectric> {
        if let WallLaw::Piezoelectric(wall) = self.wall(side) { Some(wall) } else { None }
    }
}

/// A joint: Coulomb friction on a relative velocity, of a friction damper or of a particle against its place.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    /// The relative displacement over the bodies.
    pub row: Vec<f64>,
    /// What the base adds to it per displacement.
    pub influence: f64,
    /// Largest friction force, N.
    pub friction_n: f64,
}

/// What the modal coordinates and the base move a place by.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub shape: Vec<f64>,
    pub influence: f64,
}

/// A mounted set-up. Bodies are the modal coordinates, the tuned masses, the charges of piezoelectric walls and the
/// particles, in this order, relative to the base.
#[derive(Clone, Debug)]
pub(crate) struct Mount {
    /// Number of modal coordinates.
    pub modes: usize,
    /// Number of bodies that are part of every system: modal coordinates, tuned masses and charges.
    pub permanent: usize,
    /// Without soft walls.
    pub bodies: Bodies,
    pub cavities: Vec<Cavity>,
    /// Friction dampers, then particles against their places.
    pub joints: Vec<Joint>,
    /// Bᵀ M⁻¹ B of all joints: relative acceleration per joint force, 1/kg.
    pub compliance: DMatrix<f64>,
    /// F̂ on each body.
    pub force: Vec<C64>,
    /// 1 where the excitation moves the base, 0 where it is a force.
    pub share: f64,
    /// Shape and influence of every place; no influence where a force drives.
    pub places: Vec<Place>,
    /// ι of what each tuned mass is mounted on; 0 where a force drives.
    pub tuned_influence: Vec<f64>,
}

impl Mount {
    pub fn new(set_up: &SetUp, excitation: &Excitation) -> Result<Self, Refused> {
        set_up.validate()?;
        excitation.validate()?;
        let structure = &set_up.structure;
        let share = if excitation.moves_base() { 1.0 } else { 0.0 };
        match (excitation.moves_base(), set_up.driven_place) {
            (false, None) => return Err(Refused::NoDrivenPlace),
            (true, Some(_)) if *excitation != Excitation::Fixed => return Err(Refused::BaseMoves),
            _ => {}
        }
        let modes = structure.modes.len();
        let shape = |place: usize| -> Vec<f64> { structure.modes.iter().map(|mode| mode.shape[place]).collect() };
        let influence = |place: usize| share * structure.influence[place];
        let (tuned, particles) = (&set_up.tuned_masses, &set_up.impact_dampers);
        let first_charge = modes + tuned.len();
        let permanent = first_charge + set_up.piezoelectric_walls().count();
        let count = permanent + particles.len();
        let row = |place: usize| {
            let mut row = shape(place);
            row.resize(count, 0.0);
            row
        };
        let mut bodies = Bodies { coupling: structure.coupling_per_s.clone(), ..Bodies::default() };
        for mode in &structure.modes {
            let omega = mode.angular_frequency_rad_per_s;
            bodies.mass.push(1.0);
            bodies.inertia.push(share * mode.participation);
            bodies.stiffness.push(omega * omega);
            bodies.damping.push(2.0 * mode.damping_ratio * omega);
        }
        let mass = |mass: f64, place: usize| [mass, mass * influence(place), 0.0, 0.0];
        let tuned_masses = tuned.iter().map(|tuned| mass(tuned.tmd.mass_kg, tuned.place));
        let charges = (first_charge..).zip(set_up.piezoelectric_walls());
        let charges = charges.map(|(charge, wall)| [0.0, 0.0, law(wall, charge).free_stiffness(), wall.load_ohm]);
        let particle_masses = particles.iter().map(|damper| mass(damper.particle.mass_kg, damper.place));
        for [mass, inertia, stiffness, damping] in tuned_masses.chain(charges).chain(particle_masses) {
            bodies.mass.push(mass);
            bodies.inertia.push(inertia);
            bodies.stiffness.push(stiffness);
            bodies.damping.push(damping);
        }
        for (i, tuned) in tuned.iter().enumerate() {
            let mut row: Vec<f64> = row(tuned.place).iter().map(|x| -x).collect();
            row[modes + i] = 1.0;
            let tmd = &tuned.tmd;
            bodies.links.push(Link { row, stiffness: tmd.stiffness_n_per_m, damping: tmd.damping_n_s_per_m });
        }
        let turning = excitation.angular_frequency_rad_per_s();
        let mut force: Vec<C64> =
            bodies.inertia.iter().map(|inertia| C64::new(0.0, -inertia * turning * turning)).collect();
        if let Some(place) = set_up.driven_place {
            force.iter_mut().zip(row(place)).for_each(|(force, row)| *force = C64::new(0.0, -row));
        }
        if let Some(beside) = set_up.force_beside_base {
            let Excitation::Sine { amplitude_m, phase_rad, .. } = *excitation else {
                return Err(Refused::NoSineBeside);
            };
            if amplitude_m == 0.0 {
                return Err(Refused::NoSineBeside);
            }
            let per_base = C64::from_polar(beside.amplitude_n / amplitude_m, beside.phase_rad - phase_rad);
            force.iter_mut().zip(row(beside.place)).for_each(|(force, row)| *force += C64::new(0.0, -row) * per_base);
        }
        let mut charges = first_charge..;
        let cavities = particles
            .iter()
            .map(|damper| {
                let particle = &damper.particle;
                let [negative, positive] = particle.ends_m();
                let mut wall = |wall: Wall, in_place: &Option<PiezoelectricWall>| {
                    if let (Some(in_place), Some(charge)) = (in_place, in_place.and_then(|_| charges.next())) {
                        return WallLaw::Piezoelectric(law(in_place, charge));
                    }
                    match wall {
                        Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release } => {
                            WallLaw::Soft { stiffness: stiffness_n_per_m, damping: damping_n_s_per_m, release }
                        }
                        Wall::Hertz(law) => WallLaw::Hertz(law),
                        _ => WallLaw::Hard(wall.impact_law(1.0).unwrap_or_default()),
                    }
                };
                let ([first, second], [in_first, in_second]) = (particle.walls(), &damper.piezoelectric);
                let gravity = set_up.gravity_m_per_s2 * particle.mass_kg;
                Cavity {
                    place: shape(damper.place),
                    influence: influence(damper.place),
                    mass: particle.mass_kg,
                    ends: [-negative, positive],
                    walls: [wall(first, in_first), wall(second, in_second)],
                    weight_n: gravity * particle.cavity.rise(),
                }
            })
            .collect();
        let mut joints = Vec::new();
        for damper in &set_up.friction_dampers {
            let mut row = row(damper.place);
            let mut other = share;
            if let Some(place) = damper.other {
                row.iter_mut().zip(shape(place)).for_each(|(row, shape)| *row -= shape);
                other = influence(place);
            }
            let friction_n = damper.damper.force_n;
            joints.push(Joint { row, influence: influence(damper.place) - other, friction_n });
        }
        for (i, damper) in particles.iter().enumerate() {
            let mut row: Vec<f64> = row(damper.place).iter().map(|x| -x).collect();
            row[permanent + i] = 1.0;
            let particle = &damper.particle;
            let normal_n = set_up.gravity_m_per_s2 * particle.mass_kg * particle.cavity.level();
            // Both sides are measured from the base at the same place.
            joints.push(Joint { row, influence: 0.0, friction_n: particle.friction_coefficient * normal_n });
        }
        let compliance = DMatrix::from_fn(joints.len(), joints.len(), |i, j| {
            let (a, b) = (joints[i].row.iter(), &joints[j].row);
            a.zip(b).zip(bodies.divisors()).map(|((a, b), mass)| a * b / mass).sum()
        });
        let tuned_influence = tuned.iter().map(|tuned| influence(tuned.place)).collect();
        let places = (0..structure.influence.len())
            .map(|place| Place { shape: shape(place), influence: influence(place) })
            .collect();
        Ok(Self { modes, permanent, bodies, cavities, joints, compliance, force, share, places, tuned_influence })
    }

    /// Displacements and velocities of all bodies relative to the base in `state`, while the base has z and z′.
    pub fn bodies_in(&self, state: &State, (z, rate): (f64, f64)) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (state.modal.clone(), state.modal_rate.clone());
        let tuned = state.tuned_masses.iter().zip(&self.tuned_influence).map(|(body, of)| (body, *of));
        let particles = state.particles.iter().zip(&self.cavities).map(|(body, of)| (body, of.influence));
        let relative = |(body, influence): (&Body, f64)| [body.y_m - influence * z, body.u_m_per_s - influence * rate];
        let charges = self.charges().zip(&state.charges_c);
        // While nothing touches the wall.
        let charges = charges.map(|(i, q)| [*q, -self.bodies.stiffness[i] / self.bodies.damping[i] * q]);
        for [of, of_rate] in tuned.map(relative).chain(charges).chain(particles.map(relative)) {
            q.push(of);
            v.push(of_rate);
        }
        (q, v)
    }

    /// The state of bodies with these displacements and velocities relative to the base, while the base has z and z′.
    pub fn state_of(&self, q: &[f64], v: &[f64], (z, rate): (f64, f64)) -> State {
        let body = |i: usize, influence: f64| Body { y_m: q[i] + influence * z, u_m_per_s: v[i] + influence * rate };
        let tuned = (self.modes..self.permanent).zip(&self.tuned_influence).map(|(i, of)| body(i, *of));
        let particles = (self.permanent..q.len()).zip(&self.cavities).map(|(i, of)| body(i, of.influence));
        State {
            modal: q[..self.modes].to_vec(),
            modal_rate: v[..self.modes].to_vec(),
            tuned_masses: tuned.collect(),
            particles: particles.collect(),
            charges_c: q[self.charges()].to_vec(),
        }
    }

    /// The charges among the bodies.
    fn charges(&self) -> std::ops::Range<usize> {
        self.modes + self.tuned_influence.len()..self.permanent
    }

    /// The piezoelectric walls with their dampers and sides, in the order of their charges.
    pub fn piezoelectric_walls(&self) -> impl Iterator<Item = (usize, Sign, &Piezoelectric)> {
        let walls = self.cavities.iter().enumerate().flat_map(|(n, cavity)| [-1, 1].map(|side| (n, side, cavity)));
        walls.filter_map(|(n, side, cavity)| cavity.piezoelectric(side).map(|wall| (n, side, wall)))
    }

    /// The joint of a particle.
    pub fn joint_of(&self, particle: usize) -> usize {
        self.joints.len() - self.cavities.len() + particle
    }

    /// The particle of a joint; `None` of a friction damper.
    pub fn particle_of(&self, joint: usize) -> Option<usize> {
        joint.checked_sub(self.joint_of(0))
    }

    /// The joint that an event happens in.
    pub fn joint_of_event(&self, event: Event) -> usize {
        match event {
            Event::Stops(joint) | Event::Breaks(joint, _) => joint,
            Event::Wall(particle, _) | Event::Releases(particle, _) | Event::Inside(particle, _) => {
                self.joint_of(particle)
            }
        }
    }

    /// ι of the place of a particle's joint; 0 of a friction damper.
    pub fn influence_of(&self, joint: usize) -> f64 {
        self.particle_of(joint).map_or(0.0, |particle| self.cavities[particle].influence)
    }

    /// y − x of a particle, as a row over the bodies.
    pub fn offset_row(&self, particle: usize) -> &[f64] {
        &self.joints[self.joint_of(particle)].row
    }
}

/// The equations of a wall with its charge.
fn law(wall: &PiezoelectricWall, charge: usize) -> Piezoelectric {
    let PiezoelectricWall { stiffness_n_per_m, capacitance_f, coupling_n_per_v, .. } = *wall;
    Piezoelectric { stiffness: stiffness_n_per_m, capacitance: capacitance_f, coupling: coupling_n_per_v, charge }
}
