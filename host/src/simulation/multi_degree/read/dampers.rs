//! Reads the dampers of a structure, each at its place.

use damprig_core::model::Particle;
use damprig_structures::{FrictionJoint, ImpactDamper, SetUp, TunedMass};

use super::refuse_place;
use crate::input::{Problem, Section};
use crate::setup::{self, BaseAmplitude, Damper, StatedContact, friction_damper_keys, particle_keys, set_up_keys};
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
    let mut is_valid = true;
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
                _ => is_valid = false,
            }
        }
    }
    is_valid.then_some(mounted)
}

/// A set-up whose dampers are being read, with y − x of each particle at the start.
pub struct Dampers {
    pub set_up: SetUp,
    /// Contacts of the walls of each particle.
    pub contacts: Vec<[Option<StatedContact>; 2]>,
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
        let stated = spec.at(z_m);
        if let Some(particle) = stated.particle {
            let contacts = spec.contacts();
            self.contacts.push(contacts);
            self.set_up.impact_dampers.push(impact_damper(place, particle, contacts));
            self.starts_m.push(spec.particle_start_m(z_m));
        }
        // Without a force there is no damper.
        if let Some(damper) = stated.friction_damper.filter(|damper| damper.force_n > 0.0) {
            self.set_up.friction_dampers.push(FrictionJoint { place, other, damper });
        }
        self.set_up.tuned_masses.extend(stated.tmd.map(|tmd| TunedMass { place, tmd }));
        Some(())
    }
}

/// The damper with its piezoelectric walls, if it has any.
pub fn impact_damper(place: usize, particle: Particle, contacts: [Option<StatedContact>; 2]) -> ImpactDamper {
    let piezoelectric = contacts.map(|contact| contact.and_then(|contact| contact.piezoelectric()));
    ImpactDamper { place, particle, piezoelectric }
}
