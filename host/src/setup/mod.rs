//! Parses a set-up, in a case as in a campaign: the same keys give the same model.
//!
//! [`TABLES`] declares the keys; this module combines them. The model checks which values are physical
//! ([`damprig_core::model`]); the base motion is not part of a set-up.

mod contact;
mod keys;
pub mod set_up_file;
mod spec;
mod walls;

use damprig_core::integrator::sampled::Sampled;
use damprig_core::model::{Cavity, SetUp, Structure, Tmd, Tuning};
use toml::de::DeTable;

use crate::input::Section;
use crate::input::key::{Key, KeyedQuantity, ValueKind};
use crate::input::section::Given;
use crate::structure::Places;
use keys::{friction_damper, particle, set_up, spring, structure, tmd};
use spec::{FrictionSpec, ParticleSpec, Relative, StartPlace};
use walls::read_wall;

pub use contact::{StatedContact, contacts_of, hertz_as_hard};
pub use keys::ALL_TABLES as TABLES;
pub(crate) use keys::set_up::BASE_AMPLITUDE;
pub(crate) use keys::{
    PARTS, SET_UP_FILE, friction_damper as friction_damper_keys, particle as particle_keys, set_up as set_up_keys,
};
pub use set_up_file::{IDENTIFIED, Identified, SetUpFile};
pub use spec::{SetUpSpec, SpringSpec, SpringTarget};

/// The base amplitude Z that ratios refer to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseAmplitude {
    /// Z, m; greater than 0.
    Is(f64),
    /// A force drives the structure: its amplitude P, N; greater than 0. Z is P/k.
    Force(f64),
    /// There is none, and why.
    Absent(&'static str),
    /// It could not be read.
    Unread,
}

/// Keys at the top of a file, for all its set-ups, completed by those of its set-up file.
#[derive(Clone, Debug, Default)]
pub struct SharedKeys<'a> {
    tables: Vec<(&'static str, DeTable<'a>)>,
    gravity_m_per_s2: Option<f64>,
}

impl<'a> SharedKeys<'a> {
    /// The tables at the top of a file, to be inherited from key by key, and its gravity.
    #[must_use]
    pub fn of(root: &Section<'a>, file: Option<&DeTable<'a>>) -> Self {
        Self { gravity_m_per_s2: root.scalar(&set_up::GRAVITY), ..Self::completed(|name| root.raw_table(name), file) }
    }

    /// Of a case, whose own top is its set-up: the tables of its set-up file.
    #[must_use]
    pub fn of_file(file: Option<&DeTable<'a>>) -> Self {
        Self::completed(|_| None, file)
    }

    fn completed(own: impl Fn(&'static str) -> Option<&'a DeTable<'a>>, file: Option<&DeTable<'a>>) -> Self {
        let table = |name: &'static str| {
            let own = own(name);
            match file.and_then(|file| file.get(name)?.get_ref().as_table()) {
                Some(file) => Some(set_up_file::completed(name, own, file)),
                None => own.cloned(),
            }
        };
        let tables = PARTS.iter().map(KeyedQuantity::name).filter_map(|name| Some((name, table(name)?))).collect();
        Self { tables, gravity_m_per_s2: None }
    }

    fn table(&self, quantity: &KeyedQuantity) -> Option<&DeTable<'a>> {
        self.tables.iter().find(|(name, _)| *name == quantity.name()).map(|(_, table)| table)
    }
}

/// Where the dampers of a set-up are on a structure with several places: numbers of the places that it names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DamperPlaces {
    /// Of the impact damper.
    pub particle: Option<usize>,
    /// Of the friction damper.
    pub friction_damper: Option<usize>,
    /// Of the friction damper's other end; `None`: the base.
    pub other_end: Option<usize>,
    /// Of the tuned mass.
    pub tmd: Option<usize>,
}

/// A structure with several places that carries the dampers of a set-up.
pub struct Carrier<'p> {
    /// Its places.
    pub places: &'p mut Places,
    /// Its structure of one degree of freedom, for a set-up that states none.
    pub structure: Structure,
    /// The places of the dampers, as they are read.
    pub at: DamperPlaces,
}

/// Reads the set-up that `section` describes, a case or a `[[set_up]]` of a campaign, without finishing the section;
/// `None` after a problem has been reported.
///
/// `sample_s` is the sample interval of a recorded base motion, s: a structure too fast for it is refused. Without a `carrier` no damper has a
/// place.
pub fn read<'a>(
    section: &Section<'a>,
    shared: &'a SharedKeys<'a>,
    base: BaseAmplitude,
    sample_s: Option<f64>,
    mut carrier: Option<&mut Carrier>,
) -> Option<SetUpSpec> {
    let is_stated = section.is_given(&set_up::STRUCTURE) || shared.table(&set_up::STRUCTURE).is_some();
    let structure = match (shared.table(&set_up::STRUCTURE), &carrier) {
        (_, Some(carrier)) if !is_stated => Some(carrier.structure),
        (Some(table), _) if !section.is_given(&set_up::STRUCTURE) => {
            section.inherited_table("structure", Some(table)).and_then(|s| read_structure(&s, sample_s))
        }
        (table, _) => section.table_of(&set_up::STRUCTURE, table).and_then(|s| read_structure(&s, sample_s)),
    };
    let of = structure.as_ref();
    let is_force_driven = matches!(base, BaseAmplitude::Force(_));
    let base = match (base, of) {
        (BaseAmplitude::Force(force_n), Some(structure)) => BaseAmplitude::Is(force_n / structure.stiffness_n_per_m),
        (BaseAmplitude::Force(_), None) => BaseAmplitude::Unread,
        _ => base,
    };
    let particle = part(section, shared, &set_up::PARTICLE, |s| {
        let place = damper_place(s, &mut carrier)?;
        carrier.iter_mut().for_each(|carrier| carrier.at.particle = place);
        read_particle(s, of, base)
    });
    let friction = part(section, shared, &set_up::FRICTION_DAMPER, |s| {
        let place = damper_place(s, &mut carrier)?;
        match &mut carrier {
            None => refuse_place(s, &friction_damper::OTHER_PLACE),
            Some(carrier) => {
                carrier.at.friction_damper = place;
                if s.is_given(&friction_damper::OTHER_PLACE) {
                    carrier.at.other_end = Some(other_place(s, carrier.places, place)?);
                }
            }
        }
        read_friction(s, base)
    });
    let tmd = part(section, shared, &set_up::TMD, |s| {
        let place = damper_place(s, &mut carrier)?;
        carrier.iter_mut().for_each(|carrier| carrier.at.tmd = place);
        read_tmd(s, of)
    });
    let gravity = section.scalar(&set_up::GRAVITY);
    let gravity = shared.gravity_m_per_s2.filter(|_| !section.is_given(&set_up::GRAVITY)).or(gravity);
    Some(SetUpSpec {
        structure: structure?,
        particle: particle?,
        friction: friction?,
        tmd: tmd?,
        gravity_m_per_s2: gravity?,
        is_force_driven,
    })
}

/// A table that may be left out: `Some(None)` then, `None` after a problem.
fn part<'a, T>(
    section: &Section<'a>,
    shared: &'a SharedKeys<'a>,
    quantity: &KeyedQuantity,
    read: impl FnOnce(&Section<'a>) -> Option<T>,
) -> Option<Option<T>> {
    match section.table_of(quantity, shared.table(quantity)) {
        Some(table) => read(&table).map(Some),
        None => (!section.is_given(quantity)).then_some(None),
    }
}

/// The place of a damper: `Some(None)` if it names none, `None` after a problem has been reported.
fn damper_place(s: &Section, carrier: &mut Option<&mut Carrier>) -> Option<Option<usize>> {
    match carrier {
        Some(carrier) if s.is_given(&particle::PLACE) => carrier.places.named(s, &particle::PLACE).map(Some),
        Some(_) => Some(None),
        None => {
            refuse_place(s, &particle::PLACE);
            Some(None)
        }
    }
}

/// The place of a friction damper's other end; `None` after a problem has been reported.
pub(crate) fn other_place(s: &Section, places: &mut Places, place: Option<usize>) -> Option<usize> {
    let other = places.named(s, &friction_damper::OTHER_PLACE)?;
    if place == Some(other) {
        let key = s.written(&friction_damper::OTHER_PLACE)?.name;
        s.reject(key, "must be another place than that of the damper", Some("leave it out for the base".into()));
        return None;
    }
    Some(other)
}

/// Refuses a place where the structure has only one.
pub(crate) fn refuse_place(s: &Section, quantity: &KeyedQuantity) {
    if let Some(key) = s.written(quantity) {
        let allowed = "is for a structure with several places: `storey`, `beam`, `mode` or `matrices` in a case, `plant` in a campaign";
        s.reject(key.name, allowed, Some("leave it out".into()));
    }
}

/// A damper of a structure with several places.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Damper {
    /// An impact damper.
    Particle,
    /// A friction damper.
    Friction,
    /// A tuned mass damper.
    Tmd,
}

/// Reads a damper at a place of a structure with several; `None` after a problem has been reported. `at_place` is the structure that its ratios
/// refer to: a mode at its place.
pub(crate) fn read_damper(s: &Section, damper: Damper, at_place: Structure, base: BaseAmplitude) -> Option<SetUpSpec> {
    let bare = SetUpSpec {
        structure: at_place,
        particle: None,
        friction: None,
        tmd: None,
        gravity_m_per_s2: 0.0,
        is_force_driven: false,
    };
    let of = Some(&at_place);
    Some(match damper {
        Damper::Particle => SetUpSpec { particle: Some(read_particle(s, of, base)?), ..bare },
        Damper::Friction => SetUpSpec { friction: Some(read_friction(s, base)?), ..bare },
        Damper::Tmd => SetUpSpec { tmd: Some(read_tmd(s, of)?), ..bare },
    })
}

fn read_structure(s: &Section, sample_s: Option<f64>) -> Option<Structure> {
    let mass = s.scalar(&structure::MASS);
    let stiffness = s.one_of(&structure::STIFFNESS);
    let damping = s.one_of(&structure::DAMPING);
    s.finish();
    let (mass_kg, (spelling, stiffness), damping) = (mass?, stiffness?, damping?);
    let damping_key = structure::DAMPING.keys[damping.0].name;
    let stiffness_n_per_m = match spelling {
        0 => Structure::from_modal(mass_kg, stiffness, 0.0).stiffness_n_per_m,
        _ => stiffness,
    };
    let damping_n_s_per_m = damping_of(damping, mass_kg, stiffness_n_per_m);
    let read = Structure { mass_kg, stiffness_n_per_m, damping_n_s_per_m };
    let natural_hz = read.angular_frequency_rad_per_s() / std::f64::consts::TAU;
    s.warn_if_it_means(&structure::STIFFNESS, "natural_frequency_hz", natural_hz);
    s.warn_if_it_means(&structure::DAMPING, "damping_ratio", read.damping_ratio());
    let fits = sample_s.map_or(Ok(0), |sample_s| Sampled::<f64>::steps_per_sample(&SetUp::bare(read), sample_s));
    if let Err(invalid) = fits {
        let is_stiffness = invalid.parameter == "structure.stiffness_n_per_m";
        let key = if is_stiffness { structure::STIFFNESS.keys[spelling].name } else { damping_key };
        s.reject(key, format!("must be {}", invalid.allowed), None);
        return None;
    }
    Some(read)
}

/// c, N·s/m, from a damping ratio (0) or stated (1).
fn damping_of((spelling, damping): (usize, f64), mass_kg: f64, stiffness_n_per_m: f64) -> f64 {
    if spelling == 0 { 2.0 * damping * (stiffness_n_per_m * mass_kg).sqrt() } else { damping }
}

/// A mass in kg (0) or as a share of the structure's (1).
fn mass_of((spelling, mass): (usize, f64), structure: Option<&Structure>) -> Option<f64> {
    if spelling == 0 { Some(mass) } else { Some(mass * structure?.mass_kg) }
}

/// A length or a force, which the second of its keys states relative to the base amplitude.
fn relative(s: &Section, quantity: &KeyedQuantity, base: BaseAmplitude) -> Option<Relative> {
    match s.one_of(quantity)? {
        (0, value) => Some(Relative::Absolute(value)),
        (_, ratio) => refers(s, quantity, 1, base).then_some(Relative::Ratio(ratio)),
    }
}

/// Whether there can be a base amplitude for the quantity's key at `place`, which is relative to one.
fn refers(s: &Section, quantity: &KeyedQuantity, place: usize, base: BaseAmplitude) -> bool {
    if let BaseAmplitude::Absent(why) = base {
        let is_absolute = |key: &&Key| matches!(key.kind, ValueKind::Number(_)) && !key.name.ends_with("_ratio");
        let absolute = quantity.keys.iter().find(is_absolute).map_or("", |key| key.name);
        let help = format!("write `{absolute}`, or give Z as `base_amplitude_m` at the top of the case");
        s.reject(quantity.keys[place].name, format!("is relative to Z, and {why}"), Some(help));
    }
    !matches!(base, BaseAmplitude::Absent(_))
}

fn read_particle(s: &Section, structure: Option<&Structure>, base: BaseAmplitude) -> Option<ParticleSpec> {
    let mass = s.one_of(&particle::MASS).and_then(|mass| mass_of(mass, structure));
    let clearance = relative(s, &particle::CLEARANCE, base);
    let friction = s.scalar(&particle::FRICTION);
    let wall = s.table_of(&particle::WALL, None).and_then(|wall| read_wall(&wall, structure, mass));
    let positive_wall = match s.table_of(&particle::POSITIVE_WALL, None) {
        Some(wall) => read_wall(&wall, structure, mass).map(Some),
        None => (!s.is_given(&particle::POSITIVE_WALL)).then_some(None),
    };
    let (offset_m, inclination_deg) = (s.scalar(&particle::OFFSET), s.scalar(&particle::INCLINATION));
    let place = match s.given(&particle::START) {
        Some((_, Given::Word(word))) => {
            Some([0.0, -1.0, 1.0].get(word).map_or(StartPlace::Unknown, |share| StartPlace::Share(*share)))
        }
        Some((_, Given::Number(start))) => Some(StartPlace::Metres(start)),
        _ => None,
    };
    let room = match (clearance, base) {
        (Some(Relative::Ratio(ratio)), BaseAmplitude::Is(z)) => Some(ratio * z),
        (Some(Relative::Absolute(clearance)), _) => Some(clearance),
        _ => None,
    };
    if let (Some(StartPlace::Metres(start)), Some(room), Some(offset_m)) = (place, room, offset_m)
        && (start - offset_m).abs() > room
    {
        let (low, high) = (offset_m - room, offset_m + room);
        let allowed = match offset_m {
            0.0 => format!("must be within the clearance, −{room} to {room}"),
            _ => format!("must be between the walls, {low} to {high}"),
        };
        s.reject("start_m", allowed, None);
    }
    if let (Some(mass), Some(structure)) = (mass, structure) {
        s.warn_if_it_means(&particle::MASS, "mass_ratio", mass / structure.mass_kg);
    }
    if let (Some(Relative::Absolute(clearance)), BaseAmplitude::Is(z)) = (clearance, base) {
        s.warn_if_it_means(&particle::CLEARANCE, "clearance_ratio", clearance / z);
    }
    s.finish();
    let ((wall, contact), positive_wall) = (wall?, positive_wall?);
    Some(ParticleSpec {
        mass_kg: mass?,
        clearance: clearance?,
        friction_coefficient: friction?,
        wall,
        cavity: Cavity {
            positive_wall: positive_wall.map(|(wall, _)| wall),
            offset_m: offset_m?,
            inclination_deg: inclination_deg?,
        },
        contacts: [contact, positive_wall.map_or(contact, |(_, contact)| contact)],
        place: place?,
        is_placed: s.is_given(&particle::START) && place != Some(StartPlace::Unknown),
    })
}

fn read_friction(s: &Section, base: BaseAmplitude) -> Option<FrictionSpec> {
    let friction = match s.given(&friction_damper::FORCE) {
        Some((_, Given::Table(spring))) => read_spring(&spring, base).map(FrictionSpec::Tuned),
        Some((1, Given::Number(force))) => Some(FrictionSpec::Constant(Relative::Absolute(force))),
        Some((place, Given::Number(ratio))) if refers(s, &friction_damper::FORCE, place, base) => {
            Some(FrictionSpec::Constant(Relative::Ratio(ratio)))
        }
        _ => None,
    };
    s.finish();
    friction
}

fn read_spring(s: &Section, base: BaseAmplitude) -> Option<SpringSpec> {
    let target = match s.one_of(&spring::TARGET) {
        Some((0, ratio)) if refers(s, &spring::TARGET, 0, base) => Some(SpringTarget::FrictionRatio(ratio)),
        Some((1, force)) => Some(SpringTarget::NormalForce(force)),
        Some((2, deflection)) => Some(SpringTarget::Deflection(deflection)),
        _ => None,
    };
    let states = [&spring::FRICTION, &spring::STIFFNESS].map(|quantity| s.written(quantity).is_some());
    let friction = s.scalar(&spring::FRICTION);
    let stiffness = s.scalar(&spring::STIFFNESS);
    s.finish();
    Some(SpringSpec { target: target?, friction_coefficient: friction?, stiffness_n_per_m: stiffness?, states })
}

/// Tuned by a rule, by ratios, or stated.
fn read_tmd(s: &Section, structure: Option<&Structure>) -> Option<Tmd> {
    let mass = s.one_of(&tmd::MASS).and_then(|mass| mass_of(mass, structure));
    let spring = s.given(&tmd::SPRING);
    let dashpot = s.one_of(&tmd::DASHPOT);
    s.finish();
    let (mass_kg, structure) = (mass?, structure?);
    let stiffness_n_per_m = match spring? {
        (_, Given::Word(word)) => {
            let tuned = Tmd::tuned(structure, mass_kg, Tuning::ALL[word]);
            if !(tuned.stiffness_n_per_m > 0.0 && tuned.damping_n_s_per_m.is_finite()) {
                s.reject("tuning", "the rule has a spring for mass ratios less than 2 only", None);
                return None;
            }
            return Some(tuned);
        }
        (1, Given::Number(stiffness)) => stiffness,
        (_, Given::Number(ratio)) => mass_kg * (ratio * structure.angular_frequency_rad_per_s()).powi(2),
        _ => return None,
    };
    let damping_n_s_per_m = damping_of(dashpot?, mass_kg, stiffness_n_per_m);
    Some(Tmd { mass_kg, stiffness_n_per_m, damping_n_s_per_m })
}
