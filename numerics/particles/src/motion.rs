//! Follows the motion of structure and spheres, step by step.

use core::f64::consts::PI;

use damprig_core::io::{Invalid, finite, not_negative, positive, require};
use damprig_core::model::{Hertz, Structure};

use crate::cavity::{Cavity, packing};
use crate::contact::{ContactEnergy, ContactLaw, Elasticity, History};
use crate::energy::Energies;
use crate::excitation::{Drive, Excitation};
use crate::forces::{BoxMotion, Contacts, Spheres, WallImpact};
use crate::neighbours::Neighbours;
use crate::vector::{Vector, dot, length, plus, plus_times};

/// Spheres of one size in a box on the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damper {
    /// Number of spheres; from 1 to [`MAX_SPHERES`].
    pub count: usize,
    /// Of each, m; greater than 0.
    pub diameter_m: f64,
    /// Of all together, kg; greater than 0.
    pub mass_kg: f64,
    /// e of every contact, from 0.01 to 1.
    pub restitution: f64,
    /// μ of every contact; 0 or greater. Without friction the spheres do not rotate.
    pub friction_coefficient: f64,
    /// What presses the surfaces of every contact apart.
    pub elasticity: Elasticity,
    /// The box.
    pub cavity: Cavity,
    /// Downwards, m/s²; 0 or greater.
    pub gravity_m_per_s2: f64,
    /// Steps of the shortest contact (Hertz: at [`FAST_M_PER_S`](crate::FAST_M_PER_S)), and at least so many of half a period of the structure; 4 or more.
    pub steps_per_contact: f64,
    /// Of the places at the start.
    pub seed: u64,
}

/// Most spheres: so many make about 80 steps in a second of computing, and a run of 10 s takes an hour.
pub const MAX_SPHERES: usize = 100_000;

/// Least coefficient of restitution: a smaller one needs ever stiffer dashpots.
pub const MIN_RESTITUTION: f64 = 0.01;

/// Speed of a slow contact, m/s.
const SLOW_M_PER_S: f64 = 1e-3;

/// Least steps of the shortest contact.
pub const MIN_STEPS: f64 = 4.0;

impl Damper {
    /// Mass of a sphere, kg.
    #[must_use]
    pub fn sphere_kg(&self) -> f64 {
        self.mass_kg / self.count as f64
    }

    /// Constants of the contacts on a structure of this mass, kg.
    #[must_use]
    pub fn law(&self, structure_kg: f64) -> ContactLaw {
        let contact = (self.elasticity, self.restitution, self.friction_coefficient);
        ContactLaw::new(contact, (self.sphere_kg(), 0.5 * self.diameter_m), structure_kg)
    }

    /// Duration of an elastic Hertz contact of two spheres that meet at 1 mm/s, s.
    #[must_use]
    pub fn slow_contact_s(&self) -> f64 {
        Hertz::elastic(self.law(self.mass_kg).pair.stiffness()).elastic_duration_s(0.5 * self.sphere_kg(), SLOW_M_PER_S)
    }

    /// Length of a step, s: that of the shortest contact or of half a period of the structure, whichever is shorter, over
    /// [`Damper::steps_per_contact`].
    #[must_use]
    pub fn step_s(&self, structure: &Structure) -> f64 {
        let law = self.law(structure.mass_kg);
        let half_period_s = PI / self.structure_rate_rad_per_s(structure, &law);
        law.shortest_contact_s().min(half_period_s) / self.steps_per_contact
    }

    /// Fastest rate of the structure, rad/s: with all spheres against an end of the box, or more with heavy damping.
    fn structure_rate_rad_per_s(&self, structure: &Structure, law: &ContactLaw) -> f64 {
        let count = self.count as f64;
        let stiffness_n_per_m = structure.stiffness_n_per_m + count * law.end_stiffness_n_per_m;
        let damping_n_s_per_m = structure.damping_n_s_per_m + count * law.end_damping_n_s_per_m;
        (stiffness_n_per_m / structure.mass_kg).sqrt().max(damping_n_s_per_m / structure.mass_kg)
    }

    /// Checks that every value is physical and that the box holds the spheres.
    ///
    /// # Errors
    /// Names the first parameter outside its range, spelled as in case files.
    pub fn validate(&self) -> Result<(), Invalid> {
        require(
            (1..=MAX_SPHERES).contains(&self.count),
            "many_particles.count",
            self.count as f64,
            "a whole number from 1 to 100000",
        )?;
        positive("many_particles.diameter_m", self.diameter_m)?;
        positive("many_particles.mass_kg", self.mass_kg)?;
        require(
            (MIN_RESTITUTION..=1.0).contains(&self.restitution),
            "many_particles.restitution",
            self.restitution,
            "from 0.01 to 1",
        )?;
        not_negative("many_particles.friction_coefficient", self.friction_coefficient)?;
        match self.elasticity {
            Elasticity::Spring { stiffness_n_per_m } => {
                positive("many_particles.stiffness_n_per_m", stiffness_n_per_m)?
            }
            Elasticity::Hertz { youngs_modulus_pa, poisson_ratio } => {
                positive("many_particles.youngs_modulus_pa", youngs_modulus_pa)?;
                let allowed = (0.0..=0.5).contains(&poisson_ratio);
                require(allowed, "many_particles.poisson_ratio", poisson_ratio, "from 0 to 0.5")?;
            }
        }
        positive("many_particles.length_m", self.cavity.length_m)?;
        positive("many_particles.width_m", self.cavity.width_m)?;
        positive("many_particles.height_m", self.cavity.height_m)?;
        not_negative("gravity_m_per_s2", self.gravity_m_per_s2)?;
        require(
            self.steps_per_contact.is_finite() && self.steps_per_contact >= MIN_STEPS,
            "many_particles.steps_per_contact",
            self.steps_per_contact,
            "4 or more",
        )?;
        require(
            self.count <= self.cavity.capacity(self.diameter_m),
            "many_particles.count",
            self.count as f64,
            "at most what the box holds in a cubic packing",
        )
    }
}

/// The motion at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Start {
    /// x, m; the middle of the box is there too.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
}

/// Structure, base and spheres at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Time, s.
    pub t_s: f64,
    /// x of the structure, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// Base motion and force.
    pub drive: Drive,
    /// Mean of the spheres' centres along the motion, m.
    pub spheres_m: f64,
    /// Mean of their velocities along the motion, m/s.
    pub spheres_m_per_s: f64,
    /// Mean of their speeds in the box, m/s.
    pub mean_speed_m_per_s: f64,
}

impl State {
    /// Speed in the box that the spheres have in common, m/s.
    #[must_use]
    pub fn common_speed_m_per_s(&self) -> f64 {
        (self.spheres_m_per_s - self.v_m_per_s).abs()
    }
}

/// Powers of support, force, damping and contacts, W.
#[derive(Clone, Copy, Debug, Default)]
struct Powers {
    work_w: f64,
    structure_w: f64,
    contacts: ContactEnergy,
}

/// A motion of structure and spheres.
#[derive(Clone, Debug)]
pub struct Motion<E> {
    structure: Structure,
    excitation: E,
    spheres: Spheres,
    contacts: Contacts,
    steps: u64,
    state: State,
    acceleration: f64,
    /// Of base and excitation, N.
    outer_n: f64,
    powers: Powers,
    /// Stored in contacts at the start, along and across, J.
    stored_j: [f64; 2],
    /// Energy put into contacts since the start, along and across, J.
    into_contacts_j: [f64; 2],
    lost_in_structure_j: f64,
    work_j: f64,
    /// Accelerations before the step.
    old: (Vec<Vector>, Vec<Vector>),
}

impl<E: Excitation> Motion<E> {
    /// From the packing that the damper's seed gives; the spheres are at rest in the box.
    ///
    /// # Errors
    /// Names the first value that is not physical.
    pub fn new(structure: Structure, damper: &Damper, excitation: E, start: Start) -> Result<Self, Invalid> {
        damper.validate()?;
        let packed = packing(&damper.cavity, damper.count, damper.diameter_m, damper.seed).unwrap_or_default();
        let centres: Vec<Vector> = packed.into_iter().map(|[x, y, z]| [x + start.x_m, y, z]).collect();
        let velocities = vec![[start.v_m_per_s, 0.0, 0.0]; centres.len()];
        Self::placed(structure, damper, excitation, start, (centres, velocities))
    }

    /// From given centres (m: along the motion in the fixed frame, across it from the middle of the box, upwards from its
    /// floor) and as many velocities (m/s, in the fixed frame).
    ///
    /// # Errors
    /// Names the first value that is not physical; a number of spheres that is not the damper's.
    pub fn placed(
        structure: Structure,
        damper: &Damper,
        excitation: E,
        start: Start,
        (centres_m, velocities): (Vec<[f64; 3]>, Vec<[f64; 3]>),
    ) -> Result<Self, Invalid> {
        damper.validate()?;
        positive("structure.mass_kg", structure.mass_kg)?;
        finite("initial.x_m", start.x_m)?;
        finite("initial.v_m_per_s", start.v_m_per_s)?;
        let count = damper.count;
        let is_complete = centres_m.len() == count && velocities.len() == count;
        require(is_complete, "many_particles.count", count as f64, "the number of centres and of velocities")?;
        let spinning = if damper.friction_coefficient > 0.0 { count } else { 0 };
        let spheres = Spheres {
            centres_m,
            velocities,
            spins: vec![[0.0; 3]; spinning],
            accelerations: vec![[0.0; 3]; count],
            spin_accelerations: vec![[0.0; 3]; spinning],
        };
        let contacts = Contacts {
            law: damper.law(structure.mass_kg),
            cavity: damper.cavity,
            radius_m: 0.5 * damper.diameter_m,
            sphere_kg: damper.sphere_kg(),
            gravity_m_per_s2: damper.gravity_m_per_s2,
            step_s: damper.step_s(&structure),
            neighbours: Neighbours::new(&damper.cavity, count, damper.diameter_m),
            walls: vec![[History::default(); 6]; count],
            energy: ContactEnergy::default(),
            largest_overlap_m: 0.0,
            collisions: 0,
        };
        let mut motion = Self {
            structure,
            excitation,
            spheres,
            contacts,
            steps: 0,
            state: State { x_m: start.x_m, v_m_per_s: start.v_m_per_s, ..State::default() },
            acceleration: 0.0,
            outer_n: 0.0,
            powers: Powers::default(),
            stored_j: [0.0; 2],
            into_contacts_j: [0.0; 2],
            lost_in_structure_j: 0.0,
            work_j: 0.0,
            old: (vec![[0.0; 3]; count], vec![[0.0; 3]; spinning]),
        };
        motion.act(&mut |_| ());
        motion.stored_j = [motion.contacts.energy.normal_j, motion.contacts.energy.tangential_j];
        motion.powers = motion.powers();
        motion.measure();
        Ok(motion)
    }

    /// Accelerations from the present places and velocities.
    fn act(&mut self, on_impact: &mut impl FnMut(WallImpact)) {
        let state = &mut self.state;
        state.drive = self.excitation.at(state.t_s);
        let at = BoxMotion { x_m: state.x_m, v_m_per_s: state.v_m_per_s, t_s: state.t_s };
        let on_box_n = self.contacts.act(&mut self.spheres, &at, on_impact);
        self.outer_n = support_n(&self.structure, state) + state.drive.force_n;
        self.acceleration = (self.outer_n + on_box_n) / self.structure.mass_kg;
    }

    fn powers(&self) -> Powers {
        let (state, drive) = (&self.state, &self.state.drive);
        let slip = state.v_m_per_s - drive.base_velocity_m_per_s;
        Powers {
            work_w: support_n(&self.structure, state) * drive.base_velocity_m_per_s + drive.force_n * state.v_m_per_s,
            structure_w: self.structure.damping_n_s_per_m * slip * slip,
            contacts: self.contacts.energy,
        }
    }

    /// Makes a step. `on_impact` is called for every impact of a sphere on a wall across the motion.
    pub fn step(&mut self, on_impact: &mut impl FnMut(WallImpact)) {
        let step_s = self.contacts.step_s;
        let spheres = &mut self.spheres;
        self.old.0.copy_from_slice(&spheres.accelerations);
        self.old.1.copy_from_slice(&spheres.spin_accelerations);
        let old_acceleration = self.acceleration;
        let moved = spheres.centres_m.iter_mut().zip(&mut spheres.velocities).zip(&spheres.accelerations);
        for ((centre, velocity), acceleration) in moved {
            *centre = plus_times(centre, step_s, &plus_times(velocity, 0.5 * step_s, acceleration));
            *velocity = plus_times(velocity, step_s, acceleration);
        }
        for (spin, acceleration) in spheres.spins.iter_mut().zip(&spheres.spin_accelerations) {
            *spin = plus_times(spin, step_s, acceleration);
        }
        self.steps += 1;
        self.state.t_s = self.steps as f64 * step_s;
        self.state.x_m += step_s * (self.state.v_m_per_s + 0.5 * step_s * old_acceleration);
        self.state.v_m_per_s += step_s * old_acceleration;
        self.act(on_impact);
        // The velocities so far were predictions.
        let correct = |values: &mut [Vector], new: &[Vector], old: &[Vector]| {
            for ((value, new), old) in values.iter_mut().zip(new).zip(old) {
                *value = plus_times(&plus_times(value, 0.5 * step_s, new), -0.5 * step_s, old);
            }
        };
        correct(&mut self.spheres.velocities, &self.spheres.accelerations, &self.old.0);
        correct(&mut self.spheres.spins, &self.spheres.spin_accelerations, &self.old.1);
        self.state.v_m_per_s += 0.5 * step_s * (self.acceleration - old_acceleration);
        self.book();
        self.measure();
    }

    /// Adds the works of the step, by the trapezoidal rule.
    fn book(&mut self) {
        let (old, new) = (self.powers, self.powers());
        let half_s = 0.5 * self.contacts.step_s;
        self.work_j += half_s * (old.work_w + new.work_w);
        self.lost_in_structure_j += half_s * (old.structure_w + new.structure_w);
        self.into_contacts_j[0] += half_s * (old.contacts.normal_w + new.contacts.normal_w);
        self.into_contacts_j[1] += half_s * (old.contacts.tangential_w + new.contacts.tangential_w);
        self.powers = new;
    }

    fn measure(&mut self) {
        let count = self.spheres.centres_m.len() as f64;
        let (mut centre, mut velocity, mut speed) = (0.0, 0.0, 0.0);
        for (place, moving) in self.spheres.centres_m.iter().zip(&self.spheres.velocities) {
            centre += place[0];
            velocity += moving[0];
            speed += length(&plus(moving, &[-self.state.v_m_per_s, 0.0, 0.0]));
        }
        self.state.spheres_m = centre / count;
        self.state.spheres_m_per_s = velocity / count;
        self.state.mean_speed_m_per_s = speed / count;
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Length of a step, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.contacts.step_s
    }

    /// Centres of the spheres, m: along the motion in the fixed frame, across it from the middle of the box, upwards from its floor.
    #[must_use]
    pub fn centres_m(&self) -> &[[f64; 3]] {
        &self.spheres.centres_m
    }

    /// Velocities of the spheres in the fixed frame, m/s.
    #[must_use]
    pub fn velocities_m_per_s(&self) -> &[[f64; 3]] {
        &self.spheres.velocities
    }

    /// Largest overlap of two surfaces so far, m: it should be a small share of the diameter.
    #[must_use]
    pub fn largest_overlap_m(&self) -> f64 {
        self.contacts.largest_overlap_m
    }

    /// Angular velocities of the spheres, rad/s; empty without friction.
    #[must_use]
    pub fn spins_rad_per_s(&self) -> &[[f64; 3]] {
        &self.spheres.spins
    }

    /// Collisions between spheres so far.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.contacts.collisions
    }

    /// Lost in contacts along and across the lines of centres since the start, J.
    #[must_use]
    pub fn lost_in_contacts_j(&self) -> [f64; 2] {
        let stored_j = [self.contacts.energy.normal_j, self.contacts.energy.tangential_j];
        [0, 1].map(|place| self.into_contacts_j[place] - (stored_j[place] - self.stored_j[place]))
    }

    /// Momentum of structure and spheres along the motion, N·s.
    #[must_use]
    pub fn momentum_n_s(&self) -> f64 {
        let spheres: f64 = self.spheres.velocities.iter().map(|velocity| velocity[0]).sum();
        self.structure.mass_kg * self.state.v_m_per_s + self.contacts.sphere_kg * spheres
    }

    /// Force of base and excitation on the structure as the steps take it, N.
    #[must_use]
    pub fn outer_force_n(&self) -> f64 {
        self.outer_n
    }

    /// The energy book.
    #[must_use]
    pub fn energies(&self) -> Energies {
        let (state, contacts) = (&self.state, &self.contacts);
        let stretch_m = state.x_m - state.drive.base_m;
        let moving: f64 = self.spheres.velocities.iter().map(|v| dot(v, v)).sum();
        let spinning: f64 = self.spheres.spins.iter().map(|spin| dot(spin, spin)).sum();
        let inertia_over_mass_m2 = 0.4 * contacts.radius_m * contacts.radius_m;
        let height_m: f64 = self.spheres.centres_m.iter().map(|centre| centre[2]).sum();
        let [lost_in_impacts_j, lost_in_friction_j] = self.lost_in_contacts_j();
        Energies {
            structure_kinetic_j: 0.5 * self.structure.mass_kg * state.v_m_per_s * state.v_m_per_s,
            spring_j: 0.5 * self.structure.stiffness_n_per_m * stretch_m * stretch_m,
            spheres_kinetic_j: 0.5 * contacts.sphere_kg * (moving + inertia_over_mass_m2 * spinning),
            weight_j: contacts.sphere_kg * contacts.gravity_m_per_s2 * height_m,
            contacts_j: contacts.energy.normal_j + contacts.energy.tangential_j,
            lost_in_impacts_j,
            lost_in_friction_j,
            lost_in_structure_j: self.lost_in_structure_j,
            work_j: self.work_j,
        }
    }
}

/// Force of spring and damper on the structure, N.
fn support_n(structure: &Structure, state: &State) -> f64 {
    structure.stiffness_n_per_m * (state.drive.base_m - state.x_m)
        + structure.damping_n_s_per_m * (state.drive.base_velocity_m_per_s - state.v_m_per_s)
}
