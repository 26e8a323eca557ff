//! A case: set-up, excitation, initial state and run, and what follows from them.

use std::f64::consts::TAU;
use std::path::Path;

use arrow_schema::Metadata;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Hertz, Initial, SetUp, Structure, Tmd};
use damprig_particles::Damper;

use super::multi_degree::MultiDegree;
use super::read_case;
use super::set_values::SetValues;
use crate::failure::Failure;
use crate::input::Source;
use crate::motion_record::Record;
use crate::run_folder::schema::self_description::of_case;
use crate::setup::{self, StatedContact, contacts_of};

/// Usual rows per period of a time history.
const ROWS_PER_PERIOD: f64 = 200.0;

/// A validated case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name, as figures show it.
    pub name: String,
    /// Structure and dampers.
    pub set_up: SetUp,
    /// The contacts of hard walls at the negative and the positive side, where they are stated.
    pub contacts: [Option<StatedContact>; 2],
    /// Spheres in a box, in place of the dampers of the set-up.
    pub many_particles: Option<Damper>,
    /// Excitation in closed form; [`Excitation::Fixed`] with a record.
    pub excitation: Excitation,
    /// Recorded base motion.
    pub record: Option<Record>,
    /// Initial state.
    pub initial: Initial,
    /// Duration and requested output.
    pub run: RunSpec,
    /// A structure of several degrees of freedom with its dampers. The set-up is then the lowest mode at the observed place with the dampers that are
    /// there: what tables and figures name.
    pub multi_degree: Option<MultiDegree>,
}

/// The `run` table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSpec {
    /// Length of the run, s; greater than 0.
    pub duration_s: f64,
    /// Times at which the state is output, s, rising, within the run.
    pub sample_times_s: Vec<f64>,
    /// Length of a cycle as given, s; [`Case::cycle_s`] has the default.
    pub cycle_s: Option<f64>,
    /// First cycle that counts as steady.
    pub steady_from_cycle: Option<u64>,
}

impl Case {
    /// Reads a file.
    ///
    /// # Errors
    /// Lists all problems of the file: file, line, key, value, allowed values, likely fix.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Ok(Self::read_with_warnings(path)?.0)
    }

    /// The case for motions whose impacts take no time: walls with Hertz contact as hard ones ([`SetUp::without_hertz`]), whose
    /// force is that of the contact.
    #[must_use]
    pub fn without_hertz(&self) -> Self {
        Self {
            set_up: self.set_up.without_hertz(),
            contacts: self.set_up.particle.map_or(self.contacts, |particle| contacts_of(&particle, self.contacts)),
            multi_degree: self.multi_degree.clone().map(MultiDegree::without_hertz),
            ..self.clone()
        }
    }

    /// What acts in place of walls with Hertz contact in a case without them ([`Case::without_hertz`]); `None` if it had none.
    #[must_use]
    pub fn hertz_as_hard(&self) -> Option<String> {
        let replaced = |contact| match contact {
            Some(StatedContact::HertzWall(law)) => Some(law),
            _ => None,
        };
        let several = self.multi_degree.iter().flat_map(|several| several.contacts.concat());
        setup::hertz_as_hard(self.contacts.into_iter().chain(several).filter_map(replaced))
    }

    /// Reads a file; also the warnings of unusual values, each with file, line, key, value and usual range.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn read_with_warnings(path: &Path) -> Result<(Self, Vec<String>), Failure> {
        Self::read_changed(path, &SetValues::default())
    }

    /// Reads a file with some of its values set from outside; also the warnings of unusual values.
    ///
    /// # Errors
    /// As [`Case::read`]; of a value from outside the message names its origin.
    pub fn read_changed(path: &Path, values: &SetValues) -> Result<(Self, Vec<String>), Failure> {
        let source = Source::read(path)?;
        let case = Self::parse_changed(&source, &default_name(path), values)?;
        Ok((case, source.warnings()))
    }

    /// Parses a text; `name` is the default name.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn parse(source: &Source, name: &str) -> Result<Self, Failure> {
        Self::parse_changed(source, name, &SetValues::default())
    }

    /// Parses a text with some of its values set from outside.
    ///
    /// # Errors
    /// As [`Case::read_changed`].
    pub fn parse_changed(source: &Source, name: &str, values: &SetValues) -> Result<Self, Failure> {
        let case = read_case::read(source, name, values);
        source.verdict()?;
        // A reader that returns `None` has reported why.
        case.ok_or_else(|| Failure::Input(format!("{name}: the case could not be read")))
    }

    /// The structure's natural period, s.
    #[must_use]
    pub fn natural_period_s(&self) -> f64 {
        TAU / self.set_up.structure.angular_frequency_rad_per_s()
    }

    /// The mass of the particle, or of the tuned mass without one, kg, and the structure that ratios refer to: on a structure with several places the mass of
    /// all of them, and the structure at the place of the first.
    #[must_use]
    pub fn damper_mass(&self) -> Option<(f64, Structure)> {
        if let Some(several) = &self.multi_degree {
            return several.damper_mass();
        }
        let mass_kg = self.set_up.particle.map(|p| p.mass_kg).or(self.set_up.tmd.map(|t| t.mass_kg))?;
        Some((mass_kg, self.set_up.structure))
    }

    /// The case with a tuned mass, which starts with the structure, or nothing in place of its dampers.
    #[must_use]
    pub fn with_dampers(mut self, tmd: Option<Tmd>) -> Self {
        self.set_up.particle = None;
        self.set_up.friction_damper = None;
        self.set_up.tmd = tmd;
        (self.initial.y_m, self.initial.u_m_per_s) = (self.initial.x_m, self.initial.v_m_per_s);
        self.multi_degree = self.multi_degree.map(|several| several.with_dampers(tmd));
        self
    }

    /// The same with its particles at this share of the clearance from the middle of the cavity, −1 to 1.
    #[must_use]
    pub fn started_at(&self, share: f64) -> Self {
        let mut case = self.clone();
        if let Some(particle) = &case.set_up.particle {
            case.initial.y_m = case.initial.x_m + (particle.cavity.offset_m + share * particle.clearance_m);
        }
        case.multi_degree = case.multi_degree.map(|several| several.started_at(share));
        case
    }

    /// The natural or the drive period, whichever is shorter, s; of a pulse that of the sine that it is a part of.
    pub(super) fn shortest_period_s(&self) -> f64 {
        self.natural_period_s().min(TAU / self.excitation.angular_frequency_rad_per_s())
    }

    /// The reference length of displacement ratios and its symbol: Z of a sine or a pulse, P/k of a harmonic force, x0 of a free
    /// vibration. `None` for a record, a pulse of force or a structure at rest.
    #[must_use]
    pub fn reference_m(&self) -> Option<(f64, &'static str)> {
        let reference = match self.excitation {
            Excitation::Sine { amplitude_m, .. }
            | Excitation::HalfSine { amplitude_m, .. }
            | Excitation::Versine { amplitude_m, .. } => (amplitude_m.abs(), "Z"),
            Excitation::ForceSine { amplitude_n, .. } => {
                (amplitude_n.abs() / self.set_up.structure.stiffness_n_per_m, "(P/k)")
            }
            Excitation::Fixed if self.record.is_none() => (self.initial.x_m.abs(), "x0"),
            _ => return None,
        };
        (reference.0 > 0.0).then_some(reference)
    }

    /// What the Parquet files of its motion say of it.
    #[must_use]
    pub fn description(&self) -> Metadata {
        of_case(&self.name, &self.set_up, self.reference_m())
    }

    /// Usual rows per second of a time history: 200 per drive or natural period, whichever is shorter; with a record at least its
    /// sample rate.
    #[must_use]
    pub fn usual_rate_hz(&self) -> f64 {
        match &self.record {
            Some(record) => (1.0 / record.step_s).max(ROWS_PER_PERIOD / self.natural_period_s()),
            None => ROWS_PER_PERIOD / self.cycle_s().min(self.natural_period_s()),
        }
    }

    /// Whether it has an impact damper of one particle.
    #[must_use]
    pub fn has_particle(&self) -> bool {
        let several = self.multi_degree.as_ref();
        several.map_or(self.set_up.particle.is_some(), |several| !several.set_up.impact_dampers.is_empty())
    }

    /// Whether a wall is soft.
    #[must_use]
    pub fn has_soft_walls(&self) -> bool {
        let several = self.multi_degree.iter().flat_map(|several| &several.set_up.impact_dampers);
        self.set_up.has_soft_walls() || several.flat_map(|damper| damper.particle.walls()).any(|wall| wall.is_soft())
    }

    /// Whether contacts with a wall take time and are listed: a Hertz wall.
    #[must_use]
    pub fn has_hertz_walls(&self) -> bool {
        let several = self.multi_degree.as_ref();
        several.map_or_else(|| self.set_up.has_hertz_walls(), |several| several.set_up.has_hertz_walls())
    }

    /// The laws of its Hertz walls, each once.
    #[must_use]
    pub fn hertz_laws(&self) -> Vec<Hertz> {
        let several = self.multi_degree.iter().flat_map(|several| &several.set_up.impact_dampers);
        let particles = several.map(|damper| damper.particle).chain(self.set_up.particle);
        let mut laws = Vec::new();
        for law in particles.flat_map(|particle| particle.walls()).filter_map(|wall| wall.hertz()) {
            if !laws.contains(&law) {
                laws.push(law);
            }
        }
        laws
    }

    /// Whether a wall is piezoelectric.
    #[must_use]
    pub fn harvests(&self) -> bool {
        let several = self.multi_degree.iter().flat_map(|several| &several.set_up.impact_dampers);
        several.flat_map(|damper| damper.piezoelectric).flatten().next().is_some()
    }

    /// Whether a particle or spheres may hit walls of the structure.
    #[must_use]
    pub fn has_impacts(&self) -> bool {
        self.has_particle() || self.many_particles.is_some()
    }

    /// Length of a cycle, s: as given, else the drive period, else the natural period.
    #[must_use]
    pub fn cycle_s(&self) -> f64 {
        self.run.cycle_s.or(self.drive_period_s()).unwrap_or_else(|| self.natural_period_s())
    }

    /// Whether a sine of the base or of a force drives it, with which a motion may repeat.
    #[must_use]
    pub fn is_under_a_sine(&self) -> bool {
        self.record.is_none() && self.drive_period_s().is_some()
    }

    /// The period of a sine, s.
    #[must_use]
    pub fn drive_period_s(&self) -> Option<f64> {
        match self.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => Some(TAU / angular_frequency_rad_per_s),
            _ => None,
        }
    }
}

/// The name of a case without one of its own: that of its file.
#[must_use]
pub fn default_name(path: &Path) -> String {
    path.file_stem().map_or_else(|| "case".into(), |stem| stem.to_string_lossy().to_string())
}
