//! `[plant]`: a structure with several places on the rig, for the virtual rig, the predictions and `damprig compare`. The board knows the
//! structure of one degree of freedom of a set-up.

use std::f64::consts::TAU;
use std::sync::Arc;

use damprig_core::model::Structure;
use damprig_motion::placed_motion::PlacedStructure;
use damprig_structures::Modes;

use super::keys::campaign;
use crate::input::key::KeyedQuantity;
use crate::input::{Problem, Section};
use crate::setup::DamperPlaces;
use crate::structure::{Described, Places, at_place, check_participation, description, read_structure};

/// The keys that describe it, one of which it has.
const DESCRIPTIONS: [&KeyedQuantity; 3] = [&description::STOREYS, &description::BEAM, &description::MODES];

/// The plant of a campaign, whose places are still being collected.
pub(super) struct Plant {
    described: Described,
    /// Its places.
    pub(super) places: Places,
    /// Number of the place whose displacement is x.
    pub(super) observed: usize,
    /// The lowest mode at that place: the structure of set-ups that state none.
    pub(super) structure: Structure,
}

/// What a set-up's dampers are mounted on.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUpPlant {
    /// The structure, with the places of the dampers.
    pub placed: Arc<PlacedStructure>,
    /// What it is, and where x and the dampers are, in words.
    pub in_words: String,
}

/// Reads the plant; `Some(None)` without one, `None` after a problem has been reported.
pub(super) fn read(root: &Section) -> Option<Option<Plant>> {
    let Some(s) = root.table_of(&campaign::PLANT, None) else {
        return (!root.is_given(&campaign::PLANT)).then_some(None);
    };
    if s.has_own(description::MATRICES.name()) {
        let help = "take its lowest modes as `[[plant.mode]]`";
        s.reject(description::MATRICES.name(), "is for cases: a run folder keeps no matrix files", Some(help.into()));
        return None;
    }
    let mut given =
        DESCRIPTIONS.iter().filter(|description| s.is_given(description)).map(|description| description.name());
    let Some(key) = given.next() else {
        s.finish();
        let names: Vec<&str> = DESCRIPTIONS.iter().map(|description| description.name()).collect();
        return report(&s, "`plant` describes no structure", format!("give one of `{}`", names.join("`, `")));
    };
    for other in given {
        s.reject(other, format!("`{key}` is given too, and a plant is one structure"), None);
    }
    let (described, mut places) = read_structure(&s, key)?;
    let observed = match s.is_given(&description::OBSERVED) {
        true => places.named(&s, &description::OBSERVED)?,
        false => places.usual(),
    };
    check_participation(&s, None)?;
    s.finish();
    match described.modes(&places) {
        Err(refused) => report(&s, "the plant cannot be simulated", refused.to_string()),
        Ok(modes) => match at_place(&modes, observed) {
            None => {
                let title = format!("no mode moves the place {:?}", places.names()[observed]);
                report(&s, &title, "the sensor of x is at a place that the modes move".into())
            }
            Some(structure) => Some(Some(Plant { described, places, observed, structure })),
        },
    }
}

fn report<T>(s: &Section, title: &str, allowed: String) -> Option<T> {
    s.source().report(Problem { title: title.into(), span: s.span(), allowed, help: None });
    None
}

impl Plant {
    /// The structure under the dampers of a set-up. All places have been collected.
    pub(super) fn under(&self, at: &DamperPlaces) -> Option<SetUpPlant> {
        let structure = self.described.modes(&self.places).ok()?;
        let names = self.places.names();
        let or_observed = |place: Option<usize>| place.unwrap_or(self.observed);
        let placed = PlacedStructure {
            structure,
            observed: self.observed,
            particle: or_observed(at.particle),
            friction_damper: (or_observed(at.friction_damper), at.other_end),
            tmd: or_observed(at.tmd),
        };
        let mut words = vec![format!("x at {}", names[self.observed])];
        for (what, place) in
            [("particle", at.particle), ("friction damper", at.friction_damper), ("tuned mass", at.tmd)]
        {
            words.extend(place.map(|place| format!("{what} at {}", names[place])));
        }
        words.extend(at.other_end.map(|place| format!("its other end at {}", names[place])));
        words.push(modes_in_words(&placed.structure));
        Some(SetUpPlant {
            placed: Arc::new(placed),
            in_words: format!("{} ({})", self.described.kind(), words.join(", ")),
        })
    }
}

fn modes_in_words(structure: &Modes) -> String {
    const LISTED: usize = 5;
    let mut modes_hz: Vec<f64> = structure.modes.iter().map(|mode| mode.angular_frequency_rad_per_s / TAU).collect();
    modes_hz.sort_by(f64::total_cmp);
    let lowest: Vec<String> = modes_hz.iter().take(LISTED).map(|hz| format!("{hz:.4}")).collect();
    let left = modes_hz.len().saturating_sub(LISTED);
    let more = if left == 0 { String::new() } else { format!(" and {left} more") };
    format!("modes at {} Hz{more}", lowest.join(", "))
}
