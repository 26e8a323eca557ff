//! Set-ups of the core with one degree of freedom, as structures of one mode.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, SetUp as One};
use damprig_structures::{Body, FrictionJoint, ImpactDamper, SetUp, State, TunedMass, base_at_start};

/// The same set-up; a force drives its only place.
pub fn set_up(one: &One, excitation: &Excitation) -> SetUp {
    let joint = |damper| FrictionJoint { place: 0, other: None, damper };
    SetUp {
        impact_dampers: one.particle.map(|particle| ImpactDamper { place: 0, particle }).into_iter().collect(),
        friction_dampers: one.friction_damper.map(joint).into_iter().collect(),
        tuned_masses: one.tmd.map(|tmd| TunedMass { place: 0, tmd }).into_iter().collect(),
        gravity_m_per_s2: one.gravity_m_per_s2,
        driven_place: (!excitation.moves_base()).then_some(0),
        ..SetUp::bare(one.structure)
    }
}

/// The same state at t = 0.
pub fn state(one: &One, initial: &Initial, excitation: &Excitation) -> State {
    let at_rest = set_up(one, excitation).at_rest(base_at_start(excitation));
    let root = one.structure.mass_kg.sqrt();
    let body = Body { y_m: initial.y_m, u_m_per_s: initial.u_m_per_s };
    State {
        modal: vec![at_rest.modal[0] + root * initial.x_m],
        modal_rate: vec![at_rest.modal_rate[0] + root * initial.v_m_per_s],
        particles: one.particle.map(|_| body).into_iter().collect(),
        tuned_masses: one.tmd.map(|_| body).into_iter().collect(),
    }
}
