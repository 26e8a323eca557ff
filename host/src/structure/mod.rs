//! A structure with several places as files describe it: storeys, a beam, modes or matrices.

mod keys;
mod matrix_file;
mod places;
mod read;

use damprig_core::model::Structure;
use damprig_structures::{Modes, Support};

use crate::input::Section;
use crate::input::key::KeyedQuantity;

pub(crate) use keys::description;
pub use keys::{PLANT, TABLES};
pub use places::Places;
pub use read::{Described, check_participation, read_structure};

/// Where the places of a beam are.
#[derive(Clone, Debug, PartialEq)]
pub struct OnBeam {
    /// How it is held.
    pub support: Support,
    /// Its length, m.
    pub length_m: f64,
    /// Of each place, from the first support, m.
    pub positions_m: Vec<f64>,
}

/// The keys that describe such a structure, one of which a case has in place of `structure`.
pub const DESCRIPTIONS: [&KeyedQuantity; 4] =
    [&description::STOREYS, &description::BEAM, &description::MODES, &description::MATRICES];

/// The key of the description of such a structure, if the case has one.
pub fn description_of(root: &Section) -> Option<&'static str> {
    DESCRIPTIONS.iter().find(|description| root.is_given(description)).map(|description| description.name())
}

/// The lowest mode that moves a place, as the structure of one degree of freedom that it is there: M = 1/φ², k = ω²M, c = 2ζωM.
#[must_use]
pub fn at_place(modes: &Modes, place: usize) -> Option<Structure> {
    let moves = modes.modes.iter().filter(|mode| mode.shape[place] != 0.0);
    let lowest = moves.min_by(|a, b| a.angular_frequency_rad_per_s.total_cmp(&b.angular_frequency_rad_per_s))?;
    let (phi, omega) = (lowest.shape[place], lowest.angular_frequency_rad_per_s);
    let mass_kg = 1.0 / (phi * phi);
    Some(Structure {
        mass_kg,
        stiffness_n_per_m: omega * omega * mass_kg,
        damping_n_s_per_m: 2.0 * lowest.damping_ratio * omega * mass_kg,
    })
}
