//! Set-ups of the core with one degree of freedom, as structures of one mode.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::SetUp as One;
use damprig_structures::SetUp;

/// The same set-up; a force drives its only place.
pub fn set_up(one: &One, excitation: &Excitation) -> SetUp {
    SetUp { driven_place: (!excitation.moves_base()).then_some(0), ..SetUp::from(one) }
}
