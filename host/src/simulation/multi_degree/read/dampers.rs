//! Reads the dampers of a structure, each at its place.

use damprig_core::model::Wall;
use damprig_structures::{FrictionJoint, ImpactDamper, SetUp, TunedMass};

use super::refuse_place;
use crate::input::{Problem, Section};
use crate::setup::{self, BaseAmplitude, Damper, SetUpSpec, friction_damper_keys, particle_keys, set_up_keys};
use crate::structure::{Places, at_place};

/// A damper's table with its places.
pub struct Mounted<'a> {
    table: Section<'a>,
    damper: Damper,
    place: usize,
    other: Option<usize>,
}

/// The dampers' tables with their places; `None` after a problem has been reported.
pub fn read_places<'a>(root: &Section<'a>, places: &mut Places) -> Option<Vec<Mounted<'a>>> {
    let mut mounted = Vec::new();
    let mut is_sound = true;
    for (quantity, damper) in [
        (&set_up_keys::PARTICLE, Damper::Particle),
        (&set_up_keys::FRICTION_DAMPER, Damper::Friction),
        (&set_up_keys::TMD, Damper::Tmd),
    ] {
        for table in root.tables_of(quantity) {
            if !table.is_given(&particle_keys::PLACE) {
                let keys = particle_keys::PLACE.keys;
                let name = if matches!(places, Places::OnBeam { .. }) { keys[1].name } else { keys[0].name };
                root.source().report(Problem {
                    title: format!("`{}` is missing", table.full(name)),
                    span: table.span(),
                    allowed: "the structure has several places: say where the damper is mounted".into(),
                    help: None,
                });
            }
            let place = places.named(&table, &particle_keys::PLACE);
            let other = match damper {
                Damper::Friction if table.is_given(&friction_damper_keys::OTHER_PLACE) => {
                    Some(setup::other_place(&table, places, place))
                }
                _ => None,
            };
            match (place, other) {
                (Some(place), None) => mounted.push(Mounted { table, damper, place, other: None }),
                (Some(place), Some(Some(other))) => mounted.push(Mounted { table, damper, place, other: Some(other) }),
                _ => is_sound = false,
            }
        }
    }
    is_sound.then_some(mounted)
}

/// A set-up whose dampers are being read, with y − x of each particle at the start.
pub struct Dampers {
    pub set_up: SetUp,
    pub starts_m: Vec<f64>,
}

impl Dampers {
    /// Reads a damper and mounts it; `None` after a problem has been reported.
    pub fn add(&mut self, mounted: Mounted, base: BaseAmplitude, places: &Places) -> Option<()> {
        let Mounted { table: s, damper, place, other } = mounted;
        let Some(structure) = at_place(&self.set_up.structure, place) else {
            refuse_place(&s, &places.names()[place]);
            return None;
        };
        // Of a force, P/k with the k at the damper's place.
        let base = match base {
            BaseAmplitude::Force(force_n) => BaseAmplitude::Is(force_n / structure.stiffness_n_per_m),
            other => other,
        };
        let z_m = if let BaseAmplitude::Is(z_m) = base { z_m } else { 0.0 };
        let spec = setup::read_damper(&s, damper, structure, base)?;
        if spec.is_start_unknown() {
            let help = "take one of the walls, or \"centre\"";
            s.reject("start", "\"unknown\" is for campaigns", Some(help.into()));
            return None;
        }
        let read = spec.at(z_m);
        if let Some(particle) = read.particle {
            if let Some(why) = left_out(&spec, &particle.walls()) {
                s.reject("wall", why, None);
                return None;
            }
            self.set_up.impact_dampers.push(ImpactDamper { place, particle });
            self.starts_m.push(spec.particle_start_m(z_m));
        }
        // Without a force there is no damper.
        if let Some(damper) = read.friction_damper.filter(|damper| damper.force_n > 0.0) {
            self.set_up.friction_dampers.push(FrictionJoint { place, other, damper });
        }
        self.set_up.tuned_masses.extend(read.tmd.map(|tmd| TunedMass { place, tmd }));
        Some(())
    }
}

/// Why Hertz walls are refused.
pub const HERTZ_LEFT_OUT: &str =
    "Hertz contact is not available with several places, or with a force beside a moving base; state the restitution";

/// Why the contact of a hard wall is refused.
pub const CONTACT_LEFT_OUT: &str = "the force of a hard wall is not available with several places, or with a force beside a moving base; leave its contact out";

/// What of walls a structure of several degrees of freedom does not follow.
fn left_out(spec: &SetUpSpec, walls: &[Wall; 2]) -> Option<&'static str> {
    if walls.iter().any(|wall| wall.hertz().is_some()) {
        return Some(HERTZ_LEFT_OUT);
    }
    let is_stated = spec.contacts().iter().any(Option::is_some);
    is_stated.then_some(CONTACT_LEFT_OUT)
}
