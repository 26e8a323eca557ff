//! A set-up as bodies, joints and walls: what the engine computes with.

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::modes::Sign;
use damprig_core::model::{ImpactLaw, Release};

use nalgebra::DMatrix;

use crate::linear::{Bodies, C64, Link};
use crate::{Refused, SetUp};

/// Where the base moves, a displacement per displacement of the base.
pub(crate) type Influence = f64;

/// A wall of a cavity.
#[derive(Clone, Copy, Debug)]
pub(crate) enum WallLaw {
    Hard(ImpactLaw<f64>),
    Soft { stiffness: f64, damping: f64, release: Release },
}

/// A particle in its cavity.
#[derive(Clone, Debug)]
pub(crate) struct Cavity {
    /// Its place's displacement per modal coordinate.
    pub place: Vec<f64>,
    /// ι of the place.
    pub influence: Influence,
    /// m, kg.
    pub mass: f64,
    /// Distance of the walls from y = x, each towards its side, m.
    pub ends: [f64; 2],
    pub walls: [WallLaw; 2],
    /// Largest friction force, N.
    pub friction_n: f64,
    /// Weight along −y, N.
    pub weight_n: f64,
}

impl Cavity {
    pub fn end(&self, side: Sign) -> f64 {
        self.ends[usize::from(side > 0)]
    }

    pub fn wall(&self, side: Sign) -> &WallLaw {
        &self.walls[usize::from(side > 0)]
    }

    pub fn is_soft(&self, side: Sign) -> bool {
        matches!(self.wall(side), WallLaw::Soft { .. })
    }
}

/// A friction damper: Coulomb friction on the relative velocity of its joint, to which the base adds `influence · z′`.
#[derive(Clone, Debug)]
pub(crate) struct Friction {
    pub influence: Influence,
    pub force_n: f64,
}

/// A mounted set-up. Bodies are the modal coordinates, the tuned masses and the particles, in this order, relative to the base.
#[derive(Clone, Debug)]
pub(crate) struct Mount {
    pub modes: usize,
    /// Modal coordinates and tuned masses.
    pub fixed: usize,
    /// Without soft walls.
    pub bodies: Bodies,
    pub cavities: Vec<Cavity>,
    pub frictions: Vec<Friction>,
    /// Relative displacement of each joint over the bodies: friction dampers, then y − x of the particles.
    pub rows: Vec<Vec<f64>>,
    /// Bᵀ M⁻¹ B of all joints: relative acceleration per joint force, 1/kg.
    pub compliance: DMatrix<f64>,
    /// F̂ on each body.
    pub force: Vec<C64>,
    /// The driven place's row; empty where the base moves.
    pub moves_base: bool,
    /// ι of what each tuned mass is mounted on.
    pub tuned_influence: Vec<Influence>,
}

impl Mount {
    pub fn new(set_up: &SetUp, excitation: &Excitation) -> Result<Self, Refused> {
        set_up.validate()?;
        excitation.validate()?;
        let structure = &set_up.structure;
        let moves_base = excitation.moves_base();
        let share = if moves_base { 1.0 } else { 0.0 };
        let modes = structure.modes.len();
        let shape = |place: usize| -> Vec<f64> { structure.modes.iter().map(|mode| mode.shape[place]).collect() };
        let influence = |place: usize| share * structure.influence[place];
        let (tuned, particles) = (&set_up.tuned_masses, &set_up.impact_dampers);
        let fixed = modes + tuned.len();
        let count = fixed + particles.len();
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
        let others = tuned.iter().map(|tuned| (tuned.tmd.mass_kg, tuned.place));
        for (mass, place) in others.chain(particles.iter().map(|damper| (damper.particle.mass_kg, damper.place))) {
            bodies.mass.push(mass);
            bodies.inertia.push(mass * influence(place));
            bodies.stiffness.push(0.0);
            bodies.damping.push(0.0);
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
        if let Some(place) = set_up.driven_place.filter(|_| !moves_base) {
            force.iter_mut().zip(row(place)).for_each(|(force, row)| *force = C64::new(0.0, -row));
        }
        let cavities = particles
            .iter()
            .map(|damper| {
                let particle = &damper.particle;
                let [negative, positive] = particle.ends_m();
                let wall = |wall: damprig_core::model::Wall| match wall.impact_law(1.0) {
                    Some(law) => Ok(WallLaw::Hard(law)),
                    None => match (wall.spring_and_dashpot(), wall.release()) {
                        (Some((stiffness, damping)), Some(release)) => {
                            Ok(WallLaw::Soft { stiffness, damping, release })
                        }
                        _ => Err(Refused::Hertz),
                    },
                };
                let [first, second] = particle.walls();
                let gravity = set_up.gravity_m_per_s2 * particle.mass_kg;
                Ok(Cavity {
                    place: shape(damper.place),
                    influence: influence(damper.place),
                    mass: particle.mass_kg,
                    ends: [-negative, positive],
                    walls: [wall(first)?, wall(second)?],
                    friction_n: particle.friction_coefficient * gravity * particle.cavity.level(),
                    weight_n: gravity * particle.cavity.rise(),
                })
            })
            .collect::<Result<Vec<_>, Refused>>()?;
        let mut rows = Vec::new();
        let frictions = set_up
            .friction_dampers
            .iter()
            .map(|joint| {
                let mut row = row(joint.place);
                let mut other = share;
                if let Some(place) = joint.other {
                    row.iter_mut().zip(shape(place)).for_each(|(row, shape)| *row -= shape);
                    other = influence(place);
                }
                rows.push(row);
                Friction { influence: influence(joint.place) - other, force_n: joint.damper.force_n }
            })
            .collect();
        for (i, damper) in particles.iter().enumerate() {
            let mut row: Vec<f64> = row(damper.place).iter().map(|x| -x).collect();
            row[fixed + i] = 1.0;
            rows.push(row);
        }
        let compliance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            rows[i]
                .iter()
                .zip(&rows[j])
                .zip(&bodies.mass)
                .map(|((a, b), mass): ((&f64, &f64), &f64)| a * b / mass)
                .sum()
        });
        let tuned_influence = tuned.iter().map(|tuned| influence(tuned.place)).collect();
        Ok(Self { modes, fixed, bodies, cavities, frictions, rows, compliance, force, moves_base, tuned_influence })
    }

    /// y − x of a particle, as a row over the bodies.
    pub fn offset_row(&self, particle: usize) -> &[f64] {
        &self.rows[self.frictions.len() + particle]
    }
}
