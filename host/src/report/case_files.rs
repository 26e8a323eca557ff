//! A simulated case as one JSON object, as `damprig simulate --json` prints it.

use damprig_core::model::{Particle, SetUp, Tmd};
use damprig_particles::{Damper, Elasticity};
use damprig_structures::{ImpactDamper, PiezoelectricWall};
use serde::Serialize;

use crate::report::describe;
use crate::simulation::analysis::Analysis;
use crate::simulation::multi_degree::MultiDegree;
use crate::simulation::{Case, SimulationResult};

/// The case as simulated.
#[derive(Debug, Serialize)]
pub struct CaseAsSimulated<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    set: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    set_up: Option<&'a SetUp>,
    #[serde(skip_serializing_if = "Option::is_none")]
    many_particles: Option<Spheres>,
    #[serde(skip_serializing_if = "Option::is_none")]
    multi_degree: Option<SeveralPlaces<'a>>,
    excitation: String,
    cycle_s: f64,
    duration_s: f64,
    /// The length that X is divided by in the text, and its symbol.
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<(f64, &'static str)>,
}

/// The spheres and their box as simulated.
#[derive(Debug, Serialize)]
struct Spheres {
    count: usize,
    diameter_m: f64,
    mass_kg: f64,
    restitution: f64,
    friction_coefficient: f64,
    #[serde(flatten)]
    elasticity: Elastic,
    length_m: f64,
    width_m: f64,
    height_m: f64,
    steps_per_contact: f64,
    seed: u64,
}

/// A structure with several places and its dampers, as simulated.
#[derive(Debug, Serialize)]
struct SeveralPlaces<'a> {
    kind: &'a str,
    places: &'a [String],
    observed_place: &'a str,
    modes: Vec<NaturalMode<'a>>,
    impact_dampers: Vec<Placed<'a, Cavity>>,
    friction_dampers: Vec<WrittenFriction<'a>>,
    tuned_masses: Vec<Placed<'a, Tmd>>,
}

#[derive(Debug, Serialize)]
struct NaturalMode<'a> {
    frequency_hz: f64,
    damping_ratio: f64,
    shape_per_root_kg: &'a [f64],
    participation_root_kg: f64,
}

/// A damper with its place.
#[derive(Debug, Serialize)]
struct Placed<'a, D> {
    place: &'a str,
    #[serde(flatten)]
    damper: D,
}

/// A particle with its walls; a piezoelectric one acts in place of that of the particle.
#[derive(Debug, Serialize)]
struct Cavity {
    #[serde(flatten)]
    particle: Particle,
    /// At the negative and the positive side.
    #[serde(skip_serializing_if = "Option::is_none")]
    piezoelectric_walls: Option<[Option<Harvesting>; 2]>,
}

#[derive(Debug, Serialize)]
struct Harvesting {
    stiffness_n_per_m: f64,
    coupling_n_per_v: f64,
    capacitance_f: f64,
    load_ohm: f64,
}

impl Cavity {
    fn of(damper: &ImpactDamper) -> Self {
        let wall = |wall: PiezoelectricWall| Harvesting {
            stiffness_n_per_m: wall.stiffness_n_per_m,
            coupling_n_per_v: wall.coupling_n_per_v,
            capacitance_f: wall.capacitance_f,
            load_ohm: wall.load_ohm,
        };
        let walls = damper.piezoelectric.map(|own| own.map(wall));
        Self { particle: damper.particle, piezoelectric_walls: walls.iter().any(Option::is_some).then_some(walls) }
    }
}

#[derive(Debug, Serialize)]
struct WrittenFriction<'a> {
    place: &'a str,
    /// The base without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    other_place: Option<&'a str>,
    force_n: f64,
}

impl<'a> SeveralPlaces<'a> {
    fn of(several: &'a MultiDegree) -> Self {
        let set_up = &several.set_up;
        let place = |number: usize| several.places[number].as_str();
        let mode = |mode: &'a damprig_structures::Mode| NaturalMode {
            frequency_hz: mode.angular_frequency_rad_per_s / std::f64::consts::TAU,
            damping_ratio: mode.damping_ratio,
            shape_per_root_kg: &mode.shape,
            participation_root_kg: mode.participation,
        };
        Self {
            kind: &several.kind,
            places: &several.places,
            observed_place: place(several.observed),
            modes: set_up.structure.modes.iter().map(mode).collect(),
            impact_dampers: set_up
                .impact_dampers
                .iter()
                .map(|of| Placed { place: place(of.place), damper: Cavity::of(of) })
                .collect(),
            friction_dampers: (set_up.friction_dampers.iter())
                .map(|of| WrittenFriction {
                    place: place(of.place),
                    other_place: of.other.map(place),
                    force_n: of.damper.force_n,
                })
                .collect(),
            tuned_masses: set_up
                .tuned_masses
                .iter()
                .map(|of| Placed { place: place(of.place), damper: of.tmd })
                .collect(),
        }
    }
}

/// The keys of [`Elasticity`].
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Elastic {
    Spring { stiffness_n_per_m: f64 },
    Hertz { youngs_modulus_pa: f64, poisson_ratio: f64 },
}

impl Elastic {
    fn of(elasticity: Elasticity) -> Self {
        match elasticity {
            Elasticity::Spring { stiffness_n_per_m } => Self::Spring { stiffness_n_per_m },
            Elasticity::Hertz { youngs_modulus_pa, poisson_ratio } => Self::Hertz { youngs_modulus_pa, poisson_ratio },
        }
    }
}

impl Spheres {
    fn of(damper: &Damper) -> Self {
        Self {
            count: damper.count,
            diameter_m: damper.diameter_m,
            mass_kg: damper.mass_kg,
            restitution: damper.restitution,
            friction_coefficient: damper.friction_coefficient,
            elasticity: Elastic::of(damper.elasticity),
            length_m: damper.cavity.length_m,
            width_m: damper.cavity.width_m,
            height_m: damper.cavity.height_m,
            steps_per_contact: damper.steps_per_contact,
            seed: damper.seed,
        }
    }
}

/// The result with its case, and what was asked for besides under keys of its own.
#[derive(Debug, Serialize)]
pub struct SimulationJson<'a> {
    /// The case.
    pub case: CaseAsSimulated<'a>,
    /// The result.
    #[serde(flatten)]
    pub result: &'a SimulationResult,
    /// The analysis of its steady state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub analysis: Option<Analysis>,
    /// Largest |x| of each whole cycle, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycle_max_m: Option<&'a [f64]>,
}

impl<'a> CaseAsSimulated<'a> {
    /// Of a case; `set`: the lines of the values that were set from outside.
    #[must_use]
    pub fn of(case: &'a Case, set: &'a str) -> Self {
        Self {
            name: &case.name,
            set,
            set_up: case.multi_degree.is_none().then_some(&case.set_up),
            many_particles: case.many_particles.as_ref().map(Spheres::of),
            multi_degree: case.multi_degree.as_ref().map(SeveralPlaces::of),
            excitation: describe::excitation(case),
            cycle_s: case.cycle_s(),
            duration_s: case.run.duration_s,
            reference: case.reference_m(),
        }
    }
}
