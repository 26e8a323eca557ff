//! Cases with a structure of several degrees of freedom: places where dampers are mounted, a force acts and the motion is observed.

pub mod driver;
pub mod measure;
mod piece;
pub mod read;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, SetUp as OneDegree, Structure, Tmd};
use damprig_structures::{Body, FrictionJoint, SetUp, State, TunedMass, base_at_start};

use crate::setup::{StatedContact, contacts_of};
use crate::structure::{OnBeam, at_place, description};

/// A structure of several degrees of freedom with its dampers, as simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct MultiDegree {
    /// The key that describes it.
    pub key: &'static str,
    /// What the structure is, in a few words.
    pub kind: String,
    /// Structure and dampers.
    pub set_up: SetUp,
    /// Contacts of the walls of each impact damper: what turns the impulse of a hard one into a force.
    pub contacts: Vec<[Option<StatedContact>; 2]>,
    /// Names of the places, in the order of the structure's.
    pub places: Vec<String>,
    /// Where they are on a beam; `None` of another structure.
    pub on_beam: Option<OnBeam>,
    /// Number of the place whose displacement is x.
    pub observed: usize,
    /// State at the start.
    pub start: State,
    /// Displacement and velocity of each place at the start, m and m/s.
    pub place_starts: Vec<Body>,
}

impl MultiDegree {
    /// Whether it is a frame: its places are floors, from below.
    #[must_use]
    pub fn is_frame(&self) -> bool {
        self.key == description::STOREYS.name()
    }

    /// What tables and figures of one degree of freedom show beside the observed place: the first damper of each kind that is there.
    #[must_use]
    pub fn shown(&self) -> Shown {
        let set_up = &self.set_up;
        let particle = set_up.impact_dampers.iter().position(|damper| damper.place == self.observed);
        let tuned_mass = set_up.tuned_masses.iter().position(|damper| damper.place == self.observed);
        let to_base = |joint: &FrictionJoint| joint.place == self.observed && joint.other.is_none();
        Shown {
            particle,
            tuned_mass: tuned_mass.filter(|_| particle.is_none()),
            friction_damper: set_up.friction_dampers.iter().position(to_base),
        }
    }

    /// The second mass that is shown, in a state.
    #[must_use]
    pub fn second_mass(&self, state: &State) -> Option<Body> {
        let Shown { particle, tuned_mass, .. } = self.shown();
        particle.map(|n| state.particles[n]).or(tuned_mass.map(|n| state.tuned_masses[n]))
    }

    /// What is shown, as a set-up of one degree of freedom: `structure` is the lowest mode at the observed place.
    #[must_use]
    pub fn as_one_degree(&self, structure: Structure) -> OneDegree {
        let (set_up, shown) = (&self.set_up, self.shown());
        OneDegree {
            particle: shown.particle.map(|n| set_up.impact_dampers[n].particle),
            friction_damper: shown.friction_damper.map(|n| set_up.friction_dampers[n].damper),
            tmd: shown.tuned_mass.map(|n| set_up.tuned_masses[n].tmd),
            gravity_m_per_s2: set_up.gravity_m_per_s2,
            ..OneDegree::bare(structure)
        }
    }

    /// Its start.
    #[must_use]
    pub fn initial(&self) -> Initial {
        let Body { y_m: x_m, u_m_per_s: v_m_per_s } = self.place_starts[self.observed];
        let Body { y_m, u_m_per_s } = self.second_mass(&self.start).unwrap_or(self.place_starts[self.observed]);
        Initial { x_m, v_m_per_s, y_m, u_m_per_s }
    }

    /// A radian of the fastest mode, s: steps are hardly shorter but for events.
    #[must_use]
    pub fn shortest_s(&self) -> f64 {
        let modes = self.set_up.structure.modes.iter();
        1.0 / modes.map(|mode| mode.angular_frequency_rad_per_s).fold(0.0, f64::max)
    }

    /// The same for motions whose impacts take no time: walls with Hertz contact as hard ones, whose force is that of the contact.
    #[must_use]
    pub fn without_hertz(mut self) -> Self {
        for (damper, contacts) in self.set_up.impact_dampers.iter().zip(&mut self.contacts) {
            *contacts = contacts_of(&damper.particle, *contacts);
        }
        self.set_up = self.set_up.without_hertz();
        self
    }

    /// The mass of all particles and tuned masses, kg, and the structure at the place of the first; `None` without one.
    #[must_use]
    pub fn damper_mass(&self) -> Option<(f64, Structure)> {
        let particles = self.set_up.impact_dampers.iter().map(|damper| (damper.place, damper.particle.mass_kg));
        let tuned = self.set_up.tuned_masses.iter().map(|damper| (damper.place, damper.tmd.mass_kg));
        let masses: Vec<(usize, f64)> = particles.chain(tuned).collect();
        let (place, _) = masses.first()?;
        Some((masses.iter().map(|(_, mass_kg)| mass_kg).sum(), at_place(&self.set_up.structure, *place)?))
    }

    /// The same with a tuned mass at the place of the first damper, which starts with it, or nothing in place of the dampers.
    #[must_use]
    pub fn with_dampers(mut self, tmd: Option<Tmd>) -> Self {
        let impact = self.set_up.impact_dampers.first().map(|damper| damper.place);
        let place = impact.or(self.set_up.tuned_masses.first().map(|damper| damper.place)).unwrap_or(self.observed);
        self.set_up.impact_dampers.clear();
        self.contacts.clear();
        self.set_up.friction_dampers.clear();
        self.set_up.tuned_masses = tmd.map(|tmd| TunedMass { place, tmd }).into_iter().collect();
        self.start.particles.clear();
        self.start.charges_c.clear();
        self.start.tuned_masses = tmd.map(|_| self.place_starts[place]).into_iter().collect();
        self
    }

    /// A state at t = 0 whose particles that have no room in their cavities between hard walls are put at their walls.
    #[must_use]
    pub fn inside(&self, mut state: State, excitation: &Excitation) -> State {
        let base = base_at_start(excitation);
        let places: Vec<f64> = (0..self.places.len()).map(|place| self.set_up.place(&state, place, base).y_m).collect();
        for (damper, body) in self.set_up.impact_dampers.iter().zip(&mut state.particles) {
            if !damper.particle.walls().iter().any(|wall| wall.is_soft()) {
                let ([low_m, high_m], x_m) = (damper.particle.ends_m(), places[damper.place]);
                body.y_m = body.y_m.clamp(x_m + low_m, x_m + high_m);
            }
        }
        state
    }

    /// The same with each particle at this share of its clearance from the middle of its cavity, −1 to 1.
    #[must_use]
    pub fn started_at(mut self, share: f64) -> Self {
        for (damper, body) in self.set_up.impact_dampers.iter().zip(&mut self.start.particles) {
            let particle = &damper.particle;
            body.y_m = self.place_starts[damper.place].y_m + particle.cavity.offset_m + share * particle.clearance_m;
        }
        self
    }
}

/// Numbers of the dampers that tables and figures show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Of the impact damper.
    pub particle: Option<usize>,
    /// Of the tuned mass damper, if no particle is shown.
    pub tuned_mass: Option<usize>,
    /// Of the friction damper, between the observed place and the base.
    pub friction_damper: Option<usize>,
}
