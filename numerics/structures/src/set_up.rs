//! A set-up: a linear structure and the dampers mounted on it, in SI units, as plain data.

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::exact::time::Time;
use damprig_core::io::{finite, not_negative, positive};
use damprig_core::model::{
    FrictionDamper, GRAVITY_M_PER_S2, Initial, Particle, SetUp as OneDegree, Structure, Tmd, Wall,
};

use crate::describe::{matrix, not_growing};
use crate::{Body, Refused, State};

/// A natural mode of the structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural angular frequency ω, rad/s; greater than 0.
    pub angular_frequency_rad_per_s: f64,
    /// Damping ratio ζ, 0 or greater.
    pub damping_ratio: f64,
    /// Displacement of each place in this mode, normalised to a modal mass of 1 kg, 1/√kg.
    pub shape: Vec<f64>,
    /// Participation Γ = φᵀ M ι of the mode in a motion of the base, √kg: q″ + 2ζω q′ + ω² q = −Γ z″.
    pub participation: f64,
}

/// A linear structure on a base with displacement z: its natural modes at the places where something acts or is observed.
///
/// With modal coordinates q the displacement of place p is x = Σ φ q + ι z.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// The modes, in any order.
    pub modes: Vec<Mode>,
    /// ι of each place: its displacement per displacement of the base when the structure moves as a rigid body; 1 where the place moves
    /// along with the base.
    pub influence: Vec<f64>,
    /// Damping that is not modal: the matrix C of `q″ + (2ζω + C) q′ + …` by rows, 1/s, symmetric; empty for modal damping.
    pub coupling_per_s: Vec<f64>,
}

impl From<Structure> for Modes {
    /// One mode and one place.
    fn from(structure: Structure) -> Self {
        let root = structure.mass_kg.sqrt();
        let mode = Mode {
            angular_frequency_rad_per_s: structure.angular_frequency_rad_per_s(),
            damping_ratio: structure.damping_ratio(),
            shape: vec![1.0 / root],
            participation: root,
        };
        Self { modes: vec![mode], influence: vec![1.0], coupling_per_s: Vec::new() }
    }
}

/// An impact damper at a place: a particle in a cavity that is fixed to the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactDamper {
    /// Number of the place.
    pub place: usize,
    /// The particle, its cavity and its walls.
    pub particle: Particle,
    /// Piezoelectric walls that stand in place of the particle's own, on the negative and the positive side.
    pub piezoelectric: [Option<PiezoelectricWall>; 2],
}

impl ImpactDamper {
    /// With the particle's own walls.
    #[must_use]
    pub const fn new(place: usize, particle: Particle) -> Self {
        Self { place, particle, piezoelectric: [None; 2] }
    }
}

/// A piezoelectric wall without mass, with a resistance across its electrodes.
///
/// At the penetration δ of the particle and the charge Q that has flown through the load, the voltage is V = (θδ − Q)/C, the load has R Q′ = V, and the
/// wall pushes with F = kδ + θV. It never pulls: a contact ends where F becomes zero. The surface that nothing touches stands at δ = θQ/(kC + θ²) and comes
/// back with the time constant R (C + θ²/k); there the next contact begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PiezoelectricWall {
    /// k at short circuit, N/m; greater than 0.
    pub stiffness_n_per_m: f64,
    /// C of the wall that is held, F; greater than 0.
    pub capacitance_f: f64,
    /// θ, N/V or C/m; 0 or greater.
    pub coupling_n_per_v: f64,
    /// R, Ω; greater than 0.
    pub load_ohm: f64,
}

impl PiezoelectricWall {
    fn validate(&self) -> Result<(), Refused> {
        positive("impact_dampers.piezoelectric.stiffness_n_per_m", self.stiffness_n_per_m)?;
        positive("impact_dampers.piezoelectric.capacitance_f", self.capacitance_f)?;
        not_negative("impact_dampers.piezoelectric.coupling_n_per_v", self.coupling_n_per_v)?;
        positive("impact_dampers.piezoelectric.load_ohm", self.load_ohm)?;
        Ok(())
    }
}

/// A friction damper between a place and the base, or between two places: a set-valued Coulomb force on their relative velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionJoint {
    /// Number of the place.
    pub place: usize,
    /// Number of the other place; `None`: the base.
    pub other: Option<usize>,
    /// The damper; its force is greater than 0.
    pub damper: FrictionDamper,
}

/// A tuned mass damper at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TunedMass {
    /// Number of the place.
    pub place: usize,
    /// Mass, spring and dashpot.
    pub tmd: Tmd,
}

/// A harmonic force P sin(Ωt + φ) at a place, beside a harmonic motion of the base whose Ω it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicForce {
    /// Number of the place.
    pub place: usize,
    /// P, N; 0 or greater.
    pub amplitude_n: f64,
    /// φ, rad.
    pub phase_rad: f64,
}

/// A structure and the dampers mounted on it.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUp {
    /// The structure.
    pub structure: Modes,
    /// Impact dampers.
    pub impact_dampers: Vec<ImpactDamper>,
    /// Friction dampers.
    pub friction_dampers: Vec<FrictionJoint>,
    /// Tuned mass dampers.
    pub tuned_masses: Vec<TunedMass>,
    /// g in the weight of the particles, m/s²; 0 or greater.
    pub gravity_m_per_s2: f64,
    /// The place at which the excitation's force acts; `None`: the excitation moves the base.
    pub driven_place: Option<usize>,
    /// A force beside the excitation, which is then a sine of the base.
    pub force_beside_base: Option<HarmonicForce>,
}

impl From<&OneDegree> for SetUp {
    /// The same set-up on a structure of one mode and one place, on a moving base.
    fn from(one: &OneDegree) -> Self {
        let joint = |damper| FrictionJoint { place: 0, other: None, damper };
        Self {
            impact_dampers: one.particle.map(|particle| ImpactDamper::new(0, particle)).into_iter().collect(),
            // Without a force there is no damper.
            friction_dampers: one.friction_damper.filter(|it| it.force_n > 0.0).map(joint).into_iter().collect(),
            tuned_masses: one.tmd.map(|tmd| TunedMass { place: 0, tmd }).into_iter().collect(),
            gravity_m_per_s2: one.gravity_m_per_s2,
            ..Self::bare(one.structure)
        }
    }
}

impl SetUp {
    /// The structure without dampers, on a moving base.
    #[must_use]
    pub fn bare(structure: impl Into<Modes>) -> Self {
        Self {
            structure: structure.into(),
            impact_dampers: Vec::new(),
            friction_dampers: Vec::new(),
            tuned_masses: Vec::new(),
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            driven_place: None,
            force_beside_base: None,
        }
    }

    /// Checks that every value is physical and every place exists.
    ///
    /// # Errors
    /// Names the first value outside its range.
    pub fn validate(&self) -> Result<(), Refused> {
        let Modes { modes, influence, coupling_per_s } = &self.structure;
        let places = influence.len();
        if modes.is_empty() {
            return Err(Refused::Count { what: "structure.modes", found: 0, expected: 1 });
        }
        for mode in modes {
            positive("structure.modes.angular_frequency_rad_per_s", mode.angular_frequency_rad_per_s)?;
            not_negative("structure.modes.damping_ratio", mode.damping_ratio)?;
            finite("structure.modes.participation", mode.participation)?;
            count("structure.modes.shape", mode.shape.len(), places)?;
            mode.shape.iter().try_for_each(|x| finite("structure.modes.shape", *x))?;
        }
        influence.iter().try_for_each(|x| finite("structure.influence", *x))?;
        if !coupling_per_s.is_empty() {
            let mut damping = matrix("structure.coupling_per_s", coupling_per_s, modes.len())?;
            for (i, mode) in modes.iter().enumerate() {
                damping[(i, i)] += 2.0 * mode.damping_ratio * mode.angular_frequency_rad_per_s;
            }
            not_growing(&damping)?;
        }
        not_negative("gravity_m_per_s2", self.gravity_m_per_s2)?;
        let exists = |what: &'static str, place: usize| {
            if place < places { Ok(()) } else { Err(Refused::Place { what, place, places }) }
        };
        for damper in &self.impact_dampers {
            exists("impact_dampers.place", damper.place)?;
            self.alone(Some(damper.particle), None).validate()?;
            damper.piezoelectric.iter().flatten().try_for_each(PiezoelectricWall::validate)?;
        }
        for tuned in &self.tuned_masses {
            exists("tuned_masses.place", tuned.place)?;
            self.alone(None, Some(tuned.tmd)).validate()?;
        }
        for joint in &self.friction_dampers {
            exists("friction_dampers.place", joint.place)?;
            positive("friction_dampers.force_n", joint.damper.force_n)?;
            if let Some(other) = joint.other {
                exists("friction_dampers.other", other)?;
                if other == joint.place {
                    return Err(Refused::SamePlace(other));
                }
            }
            let ends = |mode: &Mode| mode.shape[joint.place] - joint.other.map_or(0.0, |other| mode.shape[other]);
            if modes.iter().all(|mode| ends(mode) == 0.0) {
                return Err(Refused::NoMotion);
            }
        }
        if let Some(force) = self.force_beside_base {
            exists("force.place", force.place)?;
            not_negative("force.amplitude_n", force.amplitude_n)?;
            finite("force.phase_rad", force.phase_rad)?;
        }
        self.driven_place.map_or(Ok(()), |place| exists("force.place", place))
    }

    /// Checks a starting state against this set-up.
    ///
    /// # Errors
    /// A list of a wrong length, or a value that is not finite. [`crate::Motion::new`] also refuses a particle outside its cavity.
    pub fn validate_state(&self, state: &State) -> Result<(), Refused> {
        let modes = self.structure.modes.len();
        count("initial.modal", state.modal.len(), modes)?;
        count("initial.modal_rate", state.modal_rate.len(), modes)?;
        count("initial.particles", state.particles.len(), self.impact_dampers.len())?;
        count("initial.tuned_masses", state.tuned_masses.len(), self.tuned_masses.len())?;
        count("initial.charges_c", state.charges_c.len(), self.piezoelectric_walls().count())?;
        state.charges_c.iter().try_for_each(|charge| finite("initial.charges_c", *charge))?;
        state.modal.iter().try_for_each(|q| finite("initial.modal", *q))?;
        state.modal_rate.iter().try_for_each(|v| finite("initial.modal_rate", *v))?;
        for body in state.particles.iter().chain(&state.tuned_masses) {
            finite("initial.y_m", body.y_m)?;
            finite("initial.u_m_per_s", body.u_m_per_s)?;
        }
        Ok(())
    }

    /// The piezoelectric walls, in the order of [`State::charges_c`].
    pub(crate) fn piezoelectric_walls(&self) -> impl Iterator<Item = &PiezoelectricWall> {
        self.impact_dampers.iter().flat_map(|damper| damper.piezoelectric.iter().flatten())
    }

    /// The set-up for motions whose impacts take no time: its walls with Hertz contact as hard ones ([`Particle::without_hertz`]).
    #[must_use]
    pub fn without_hertz(mut self) -> Self {
        for damper in &mut self.impact_dampers {
            damper.particle = damper.particle.without_hertz();
        }
        self
    }

    /// Whether a particle has a wall with Hertz contact.
    #[must_use]
    pub fn has_hertz_walls(&self) -> bool {
        let is_hertz =
            |(wall, in_place): (Wall, Option<PiezoelectricWall>)| in_place.is_none() && wall.hertz().is_some();
        self.impact_dampers
            .iter()
            .any(|damper| damper.particle.walls().into_iter().zip(damper.piezoelectric).any(is_hertz))
    }

    /// One damper on a structure of its own, for the checks that a set-up of one degree of freedom has.
    fn alone(&self, particle: Option<Particle>, tmd: Option<Tmd>) -> OneDegree {
        let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: 1.0, damping_n_s_per_m: 0.0 };
        OneDegree { particle, tmd, gravity_m_per_s2: self.gravity_m_per_s2, ..OneDegree::bare(structure) }
    }

    /// Displacement of a place relative to the base, m, in the modal coordinates of `state`.
    #[must_use]
    pub fn displacement_m(&self, state: &State, place: usize) -> f64 {
        self.place(state, place, (0.0, 0.0)).y_m
    }

    /// Absolute displacement and velocity of a place in `state`, while the base has this displacement z, m, and velocity z′, m/s; both 0 where a
    /// force drives.
    #[must_use]
    pub fn place(&self, state: &State, place: usize, base: (f64, f64)) -> Body {
        let modes = &self.structure.modes;
        let sum =
            |coordinates: &[f64]| modes.iter().zip(coordinates).map(|(mode, q)| mode.shape[place] * q).sum::<f64>();
        let influence = self.structure.influence[place];
        Body { y_m: sum(&state.modal) + influence * base.0, u_m_per_s: sum(&state.modal_rate) + influence * base.1 }
    }

    /// Everything at rest and at 0 in the laboratory while the base is at z and has z′, m and m/s ([`base_at_start`] of an excitation); the particles in
    /// the middle of their cavities, the piezoelectric walls without charge.
    #[must_use]
    pub fn at_rest(&self, (z, rate): (f64, f64)) -> State {
        let modes = &self.structure.modes;
        let against = |base: f64| modes.iter().map(|mode| -mode.participation * base).collect();
        let middle = |damper: &ImpactDamper| Body { y_m: damper.particle.cavity.offset_m, u_m_per_s: 0.0 };
        State {
            modal: against(z),
            modal_rate: against(rate),
            particles: self.impact_dampers.iter().map(middle).collect(),
            tuned_masses: vec![Body::default(); self.tuned_masses.len()],
            charges_c: vec![0.0; self.piezoelectric_walls().count()],
        }
    }
}

impl State {
    /// The state of a set-up of one degree of freedom at t = 0, as one of [`SetUp::from`] that set-up under `excitation`.
    #[must_use]
    pub fn of_one_degree(one: &OneDegree, initial: &Initial, excitation: &Excitation) -> Self {
        Self::on_base(one, initial, base_at_start(excitation))
    }

    /// The same while the base is at z and has z′, m and m/s.
    #[must_use]
    pub fn on_base(one: &OneDegree, initial: &Initial, base: (f64, f64)) -> Self {
        let at_rest = SetUp::from(one).at_rest(base);
        let root = one.structure.mass_kg.sqrt();
        let body = Body { y_m: initial.y_m, u_m_per_s: initial.u_m_per_s };
        Self {
            modal: vec![at_rest.modal[0] + root * initial.x_m],
            modal_rate: vec![at_rest.modal_rate[0] + root * initial.v_m_per_s],
            particles: one.particle.map(|_| body).into_iter().collect(),
            tuned_masses: one.tmd.map(|_| body).into_iter().collect(),
            charges_c: Vec::new(),
        }
    }
}

/// z, m, and z′, m/s, of an excitation at t = 0; 0 where a force drives.
#[must_use]
pub fn base_at_start(excitation: &Excitation) -> (f64, f64) {
    let wave = excitation.wave(Time::default());
    let share = if excitation.moves_base() { 1.0 } else { 0.0 };
    (share * (wave.offset + wave.sine), share * excitation.angular_frequency_rad_per_s() * wave.cosine)
}

fn count(what: &'static str, found: usize, expected: usize) -> Result<(), Refused> {
    if found == expected { Ok(()) } else { Err(Refused::Count { what, found, expected }) }
}
