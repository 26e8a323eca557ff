//! The mechanical system, its drive and its parameters; [`crate::equations`] has its equations of motion.
//!
//! y − x is measured from the middle of the cavity. Lengths are in units of a typical displacement, times in units of 1/Ω at the start, masses in units of M.

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::modes::Sign;
use damprig_core::io::{Invalid, require};
use damprig_core::model::{SetUp, Wall};

use crate::dual::{Dual, Real};
use crate::equations::Equations;
use crate::parameter::{Parameter, Ties, Values, WallValues};
use crate::wall_law::{Scales, WallLaw, of};

/// A set-up under a sine of the base or of a force.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    set_up: SetUp,
    excitation: Excitation,
    ties: Ties,
    /// Unit of time, s.
    pub(crate) time_s: f64,
    /// Unit of length, m.
    pub(crate) length_m: f64,
    pub(crate) has_particle: bool,
    pub(crate) has_tmd: bool,
}

impl System {
    /// A system at the values of `set_up` and `excitation`.
    ///
    /// # Errors
    /// Names a value that is not physical, or an excitation that is not a sine.
    pub fn new(set_up: &SetUp, excitation: &Excitation, ties: Ties) -> Result<Self, Invalid> {
        set_up.validate()?;
        set_up.validate_without_hertz()?;
        excitation.validate()?;
        let (amplitude_m, turning) = match *excitation {
            Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
                (amplitude_m, angular_frequency_rad_per_s)
            }
            Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
                (amplitude_n / set_up.structure.stiffness_n_per_m, angular_frequency_rad_per_s)
            }
            _ => (0.0, 0.0),
        };
        require(turning > 0.0, "base.kind", turning, "a sine of the base or of a force")?;
        require(amplitude_m > 0.0, "base.amplitude_m", amplitude_m, "greater than 0")?;
        Ok(Self {
            set_up: *set_up,
            excitation: *excitation,
            ties,
            time_s: 1.0 / turning,
            length_m: amplitude_m,
            has_particle: set_up.particle.is_some(),
            has_tmd: set_up.tmd.is_some(),
        })
    }

    pub(crate) fn set_up(&self) -> &SetUp {
        &self.set_up
    }

    /// y − x in the middle of the cavity, m.
    pub(crate) fn middle_m(&self) -> f64 {
        self.set_up.particle.map_or(0.0, |p| p.cavity.offset_m)
    }

    /// Whether the mirror image of a motion, half a period later, is a motion too.
    pub(crate) fn is_symmetric(&self) -> bool {
        self.set_up.particle.is_none_or(|p| p.is_symmetric())
    }

    /// Whether the wall of `side` is hard.
    pub(crate) fn is_hard(&self, side: Sign) -> bool {
        self.set_up.particle.is_some_and(|p| !p.walls()[of(side)].is_soft())
    }

    /// The wall at the negative side, or that at the positive side where it differs.
    fn wall(&self, side: Sign) -> Option<Wall> {
        let particle = self.set_up.particle?;
        if side > 0 { particle.cavity.positive_wall } else { Some(particle.wall) }
    }

    /// The part of g that presses the particle on its floor, m/s².
    fn level_gravity(&self) -> f64 {
        self.set_up.gravity_m_per_s2 * self.set_up.particle.map_or(1.0, |p| p.cavity.level())
    }

    /// Whether the system has this parameter.
    #[must_use]
    pub fn has(&self, parameter: Parameter) -> bool {
        let moves_base = self.excitation.moves_base();
        let has_damper = self.set_up.friction_damper.is_some();
        match parameter {
            Parameter::Frequency
            | Parameter::StructureDamping
            | Parameter::StructureDampingRatio
            | Parameter::NaturalFrequency
            | Parameter::StructureMass => true,
            Parameter::Gravity => self.has_particle && self.set_up.gravity_m_per_s2 > 0.0,
            Parameter::BaseAmplitude => moves_base,
            Parameter::ForceAmplitude => !moves_base,
            Parameter::Mass | Parameter::MassRatio => self.has_particle || self.has_tmd,
            Parameter::Clearance => self.has_particle,
            Parameter::InternalFriction => self.has_particle && self.level_gravity() > 0.0,
            Parameter::ClearanceRatio => self.has_particle && moves_base,
            Parameter::Restitution => self.wall(-1).is_some_and(|wall| wall.restitution().is_some()),
            Parameter::RestitutionExponent => self.wall(-1).is_some_and(|wall| wall.falling().is_some()),
            Parameter::PositiveRestitution => self.wall(1).is_some_and(|wall| wall.restitution().is_some()),
            Parameter::PositiveRestitutionExponent => self.wall(1).is_some_and(|wall| wall.falling().is_some()),
            Parameter::PositiveStiffness | Parameter::PositiveDamping => {
                self.wall(1).is_some_and(|wall| wall.spring_and_dashpot().is_some())
            }
            Parameter::LinkStiffness | Parameter::LinkDamping => {
                self.has_tmd || (self.has_particle && !self.is_hard(-1))
            }
            Parameter::DamperForce => has_damper,
            Parameter::DamperForceRatio => has_damper && moves_base,
            Parameter::LinkFrequencyRatio | Parameter::LinkDampingRatio => self.has_tmd,
        }
    }

    /// Number of components of the state: 2 for a structure alone, 4 with a second mass.
    #[must_use]
    pub fn size(&self) -> usize {
        if self.has_particle || self.has_tmd { 4 } else { 2 }
    }

    /// The value of a parameter in the set-up as given.
    #[must_use]
    pub fn value(&self, parameter: Parameter) -> f64 {
        let v = self.values::<f64>(&[]).tied();
        match parameter {
            Parameter::Frequency => v.turning / std::f64::consts::TAU,
            Parameter::BaseAmplitude => v.base_amplitude,
            Parameter::ForceAmplitude => v.force_amplitude,
            Parameter::StructureDamping => v.damping,
            Parameter::StructureDampingRatio => v.damping / (2.0 * libm::sqrt(v.stiffness * v.structure_mass)),
            Parameter::NaturalFrequency => libm::sqrt(v.stiffness / v.structure_mass) / std::f64::consts::TAU,
            Parameter::StructureMass => v.structure_mass,
            Parameter::Gravity => v.whole_gravity,
            Parameter::Mass => v.mass,
            Parameter::MassRatio => v.mass / v.structure_mass,
            Parameter::Clearance => v.clearance,
            Parameter::ClearanceRatio => v.clearance / v.base_amplitude,
            Parameter::InternalFriction => v.friction_acceleration / v.gravity,
            Parameter::Restitution => v.walls[0].restitution,
            Parameter::RestitutionExponent => v.walls[0].exponent,
            Parameter::LinkStiffness => v.walls[0].stiffness,
            Parameter::LinkDamping => v.walls[0].damping,
            Parameter::PositiveRestitution => v.walls[1].restitution,
            Parameter::PositiveRestitutionExponent => v.walls[1].exponent,
            Parameter::PositiveStiffness => v.walls[1].stiffness,
            Parameter::PositiveDamping => v.walls[1].damping,
            Parameter::DamperForce => v.damper_force,
            Parameter::DamperForceRatio => v.damper_force / (v.stiffness * v.base_amplitude),
            Parameter::LinkFrequencyRatio => {
                libm::sqrt(v.walls[0].stiffness / v.mass) / libm::sqrt(v.stiffness / v.structure_mass)
            }
            Parameter::LinkDampingRatio => {
                let link = &v.walls[0];
                link.damping / (2.0 * libm::sqrt(link.stiffness * v.mass))
            }
        }
    }

    /// The set-up and the drive at other values of parameters. The drive's phase is 0.
    #[must_use]
    pub fn at(&self, settings: &[(Parameter, f64)]) -> (SetUp, Excitation) {
        let v = self.values(settings).tied();
        let mut set_up = self.set_up;
        set_up.structure.mass_kg = v.structure_mass;
        set_up.structure.stiffness_n_per_m = v.stiffness;
        set_up.structure.damping_n_s_per_m = v.damping;
        set_up.gravity_m_per_s2 = v.whole_gravity;
        if let Some(particle) = &mut set_up.particle {
            particle.mass_kg = v.mass;
            particle.clearance_m = v.clearance;
            if v.gravity > 0.0 {
                particle.friction_coefficient = v.friction_acceleration / v.gravity;
            }
            let walls = [Some(&mut particle.wall), particle.cavity.positive_wall.as_mut()];
            for (wall, values) in walls.into_iter().zip(&v.walls).filter_map(|(wall, values)| Some((wall?, values))) {
                match wall {
                    Wall::Restitution { coefficient } => *coefficient = values.restitution,
                    Wall::SpeedRestitution(law) => {
                        (law.coefficient, law.exponent) = (values.restitution, values.exponent);
                    }
                    Wall::TableRestitution(_) => {}
                    Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
                        (*stiffness_n_per_m, *damping_n_s_per_m) = (values.stiffness, values.damping);
                    }
                    // Refused in `System::new`.
                    Wall::Hertz(_) => {}
                }
            }
        }
        if let Some(damper) = &mut set_up.friction_damper {
            damper.force_n = v.damper_force;
        }
        if let Some(tmd) = &mut set_up.tmd {
            let link = &v.walls[0];
            (tmd.mass_kg, tmd.stiffness_n_per_m, tmd.damping_n_s_per_m) = (v.mass, link.stiffness, link.damping);
        }
        let (angular_frequency_rad_per_s, phase_rad) = (v.turning, 0.0);
        let excitation = if self.excitation.moves_base() {
            Excitation::Sine { amplitude_m: v.base_amplitude, angular_frequency_rad_per_s, phase_rad }
        } else {
            Excitation::ForceSine { amplitude_n: v.force_amplitude, angular_frequency_rad_per_s, phase_rad }
        };
        (set_up, excitation)
    }

    fn values<T: Real>(&self, settings: &[(Parameter, T)]) -> Values<T> {
        let SetUp { structure, particle, friction_damper, tmd, .. } = &self.set_up;
        let (base_amplitude, force_amplitude, turning) = match self.excitation {
            Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
                (0.0, amplitude_n, angular_frequency_rad_per_s)
            }
            Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
                (amplitude_m, 0.0, angular_frequency_rad_per_s)
            }
            _ => (0.0, 0.0, 1.0),
        };
        let walls = [-1, 1].map(|side| {
            let wall = self.wall(side);
            let tmd = tmd.filter(|_| side < 0).map(|tmd| (tmd.stiffness_n_per_m, tmd.damping_n_s_per_m));
            let link = wall.and_then(|wall| wall.spring_and_dashpot()).or(tmd).unwrap_or_default();
            let law = wall.and_then(|wall| wall.restitution());
            WallValues {
                restitution: T::of(law.map_or(0.0, |law| law.coefficient)),
                exponent: T::of(law.map_or(0.0, |law| law.exponent)),
                stiffness: T::of(link.0),
                damping: T::of(link.1),
            }
        });
        let mass = particle.map(|p| p.mass_kg).or(tmd.map(|tmd| tmd.mass_kg)).unwrap_or(structure.mass_kg);
        let mut values = Values {
            structure_mass: T::of(structure.mass_kg),
            damping: T::of(structure.damping_n_s_per_m),
            stiffness: T::of(structure.stiffness_n_per_m),
            mass: T::of(mass),
            clearance: T::of(particle.map_or(0.0, |p| p.clearance_m)),
            friction_acceleration: T::of(self.set_up.internal_friction_m_per_s2()),
            walls,
            damper_force: T::of(friction_damper.map_or(0.0, |damper| damper.force_n)),
            base_amplitude: T::of(base_amplitude),
            force_amplitude: T::of(force_amplitude),
            turning: T::of(turning),
            whole_gravity: T::of(self.set_up.gravity_m_per_s2),
            gravity: T::of(self.level_gravity()),
            weight: T::of(self.set_up.weight_m_per_s2()),
            clearance_ratio: self.ties.clearance_ratio.map(T::of),
            damper_force_ratio: self.ties.damper_force_ratio.map(T::of),
            link_frequency_ratio: self.ties.link_frequency_ratio.map(T::of),
            link_damping_ratio: self.ties.link_damping_ratio.map(T::of),
        };
        for (parameter, value) in settings {
            values.set(*parameter, *value);
        }
        values
    }

    /// The equations of motion at the given parameters.
    pub(crate) fn equations<T: Real>(&self, settings: &[(Parameter, T)]) -> Equations<T> {
        let v = self.values(settings).tied();
        let (length, time) = (T::of(self.length_m), T::of(self.time_s));
        let per_mass = T::of(1.0) / v.structure_mass;
        let square = time * time;
        let force = per_mass * square / length;
        let scales = Scales { velocity_m_per_s: self.length_m / self.time_s, time, per_mass };
        let walls = self.set_up.particle.map_or([None; 2], |p| p.walls().map(Some));
        let mut walls = walls.map(|wall| WallLaw::of(wall.as_ref(), &scales));
        // The values at the first place are those of both walls where there is one.
        let is_one = self.set_up.particle.is_none_or(|p| p.cavity.positive_wall.is_none());
        let of_side = [0, if is_one { 0 } else { 1 }];
        for (wall, place) in walls.iter_mut().zip(of_side) {
            wall.set(&v.walls[place], &scales);
        }
        Equations {
            stiffness: v.stiffness * square * per_mass,
            damping: v.damping * time * per_mass,
            mass: v.mass * per_mass,
            clearance: v.clearance / length,
            friction_acceleration: v.friction_acceleration * square / length,
            weight: v.weight * square / length,
            walls,
            damper_force: v.damper_force * force,
            base_amplitude: v.base_amplitude / length,
            force_amplitude: v.force_amplitude * force,
            turning: v.turning * time,
            has_second_mass: self.has_particle || self.has_tmd,
            has_tmd: self.has_tmd,
        }
    }

    /// As [`System::equations`], with derivatives by the setting `along`.
    pub(crate) fn equations_along<T: Real>(&self, settings: &[(Parameter, T)], along: usize) -> Equations<Dual<T>> {
        let settings: Vec<(Parameter, Dual<T>)> = settings
            .iter()
            .enumerate()
            .map(|(n, (parameter, value))| {
                (*parameter, if n == along { Dual::variable(*value) } else { Dual::constant(*value) })
            })
            .collect();
        self.equations(&settings)
    }
}
