//! The parameters of a set-up's model as named numbers, as exports and the metadata of Parquet files have them.

use std::f64::consts::TAU;

use damprig_core::model::{Dissipation, SetUp, Wall};

/// A parameter of a set-up: its name with the unit, and its value; `None` where the set-up does not have it.
pub type Parameter = (&'static str, fn(&SetUp) -> Option<f64>);

/// The parameters of a set-up's model.
pub const PARAMETERS: &[Parameter] = &[
    ("mass_kg", |s| Some(s.structure.mass_kg)),
    ("stiffness_n_per_m", |s| Some(s.structure.stiffness_n_per_m)),
    ("damping_n_s_per_m", |s| Some(s.structure.damping_n_s_per_m)),
    ("natural_frequency_hz", |s| Some(s.structure.angular_frequency_rad_per_s() / TAU)),
    ("damping_ratio", |s| Some(s.structure.damping_ratio())),
    ("gravity_m_per_s2", |s| Some(s.gravity_m_per_s2)),
    ("particle_mass_kg", |s| s.particle.map(|p| p.mass_kg)),
    ("clearance_m", |s| s.particle.map(|p| p.clearance_m)),
    ("internal_friction", |s| s.particle.map(|p| p.friction_coefficient)),
    ("restitution", |s| Some(s.particle?.wall.restitution()?.coefficient)),
    ("wall_stiffness_n_per_m", |s| Some(s.particle?.wall.spring_and_dashpot()?.0)),
    ("wall_damping_n_s_per_m", |s| Some(s.particle?.wall.spring_and_dashpot()?.1)),
    ("friction_force_n", |s| s.friction_damper.map(|d| d.force_n)),
    ("tuned_mass_kg", |s| s.tmd.map(|t| t.mass_kg)),
    ("tuned_stiffness_n_per_m", |s| s.tmd.map(|t| t.stiffness_n_per_m)),
    ("tuned_damping_n_s_per_m", |s| s.tmd.map(|t| t.damping_n_s_per_m)),
    ("mass_ratio", |s| Some(s.particle.map(|p| p.mass_kg).or(s.tmd.map(|t| t.mass_kg))? / s.structure.mass_kg)),
];

/// Parameters that few set-ups have: an export has them where one of its set-ups does.
pub const RARE_PARAMETERS: &[Parameter] = &[
    ("restitution_reference_speed_m_per_s", |s| Some(s.particle?.wall.falling()?.reference_speed_m_per_s)),
    ("restitution_exponent", |s| Some(s.particle?.wall.falling()?.exponent)),
    ("restitution_maximum", |s| Some(s.particle?.wall.falling()?.maximum)),
    ("positive_restitution", |s| Some(positive(s)?.restitution()?.coefficient)),
    ("positive_restitution_reference_speed_m_per_s", |s| Some(positive(s)?.falling()?.reference_speed_m_per_s)),
    ("positive_restitution_exponent", |s| Some(positive(s)?.falling()?.exponent)),
    ("positive_restitution_maximum", |s| Some(positive(s)?.falling()?.maximum)),
    ("restitution_speed_1_m_per_s", |s| point(s.particle?.wall, 0, 0)),
    ("restitution_at_speed_1", |s| point(s.particle?.wall, 0, 1)),
    ("restitution_speed_2_m_per_s", |s| point(s.particle?.wall, 1, 0)),
    ("restitution_at_speed_2", |s| point(s.particle?.wall, 1, 1)),
    ("restitution_speed_3_m_per_s", |s| point(s.particle?.wall, 2, 0)),
    ("restitution_at_speed_3", |s| point(s.particle?.wall, 2, 1)),
    ("restitution_speed_4_m_per_s", |s| point(s.particle?.wall, 3, 0)),
    ("restitution_at_speed_4", |s| point(s.particle?.wall, 3, 1)),
    ("restitution_speed_5_m_per_s", |s| point(s.particle?.wall, 4, 0)),
    ("restitution_at_speed_5", |s| point(s.particle?.wall, 4, 1)),
    ("restitution_speed_6_m_per_s", |s| point(s.particle?.wall, 5, 0)),
    ("restitution_at_speed_6", |s| point(s.particle?.wall, 5, 1)),
    ("positive_restitution_speed_1_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 0, 0)),
    ("positive_restitution_at_speed_1", |s| point(s.particle?.cavity.positive_wall?, 0, 1)),
    ("positive_restitution_speed_2_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 1, 0)),
    ("positive_restitution_at_speed_2", |s| point(s.particle?.cavity.positive_wall?, 1, 1)),
    ("positive_restitution_speed_3_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 2, 0)),
    ("positive_restitution_at_speed_3", |s| point(s.particle?.cavity.positive_wall?, 2, 1)),
    ("positive_restitution_speed_4_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 3, 0)),
    ("positive_restitution_at_speed_4", |s| point(s.particle?.cavity.positive_wall?, 3, 1)),
    ("positive_restitution_speed_5_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 4, 0)),
    ("positive_restitution_at_speed_5", |s| point(s.particle?.cavity.positive_wall?, 4, 1)),
    ("positive_restitution_speed_6_m_per_s", |s| point(s.particle?.cavity.positive_wall?, 5, 0)),
    ("positive_restitution_at_speed_6", |s| point(s.particle?.cavity.positive_wall?, 5, 1)),
    ("positive_wall_stiffness_n_per_m", |s| Some(positive(s)?.spring_and_dashpot()?.0)),
    ("positive_wall_damping_n_s_per_m", |s| Some(positive(s)?.spring_and_dashpot()?.1)),
    ("wall_stiffness_n_per_m15", |s| Some(s.particle?.wall.hertz()?.stiffness_n_per_m15)),
    ("wall_hunt_crossley_s_per_m", |s| hunt_crossley(s.particle?.wall)),
    ("wall_lankarani_nikravesh_coefficient", |s| lankarani_nikravesh(s.particle?.wall)),
    ("positive_wall_stiffness_n_per_m15", |s| Some(positive(s)?.hertz()?.stiffness_n_per_m15)),
    ("positive_wall_hunt_crossley_s_per_m", |s| hunt_crossley(positive(s)?)),
    ("positive_wall_lankarani_nikravesh_coefficient", |s| lankarani_nikravesh(positive(s)?)),
    ("cavity_offset_m", |s| s.particle.map(|p| p.cavity.offset_m).filter(|offset_m| *offset_m != 0.0)),
    ("inclination_deg", |s| s.particle.map(|p| p.cavity.inclination_deg).filter(|degrees| *degrees != 0.0)),
];

/// A point's speed, m/s, or e, of a wall with a table of e over the speed.
fn point(wall: Wall, n: usize, column: usize) -> Option<f64> {
    wall.table()?.points().get(n).map(|point| point[column])
}

/// The wall at the positive side, where it differs.
fn positive(set_up: &SetUp) -> Option<Wall> {
    set_up.particle?.cavity.positive_wall
}

fn hunt_crossley(wall: Wall) -> Option<f64> {
    match wall.hertz()?.dissipation {
        Dissipation::HuntCrossley { coefficient_s_per_m } => Some(coefficient_s_per_m),
        Dissipation::LankaraniNikravesh { .. } => None,
    }
}

fn lankarani_nikravesh(wall: Wall) -> Option<f64> {
    match wall.hertz()?.dissipation {
        Dissipation::LankaraniNikravesh { coefficient } => Some(coefficient),
        Dissipation::HuntCrossley { .. } => None,
    }
}

/// The parameters that a set-up has, by name.
#[must_use]
pub fn parameters(set_up: &SetUp) -> serde_json::Map<String, serde_json::Value> {
    let all = PARAMETERS.iter().chain(RARE_PARAMETERS);
    all.filter_map(|(name, value)| Some((name.to_string(), value(set_up)?.into()))).collect()
}
