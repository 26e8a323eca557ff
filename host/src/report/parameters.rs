//! Every parameter of a set-up and what follows from it, for the dry run and the report page.

use damprig_core::model::{Release, SetUp, Wall};

use super::describe;
use super::numbers::significant;
use crate::campaign::{CampaignSetUp, SpringTarget};

/// A parameter's value in a set-up, as text; `None` where the set-up does not have it.
type ParameterValue = fn(&CampaignSetUp, &SetUp) -> Option<String>;

fn number(value: f64) -> String {
    significant(value, 5)
}

fn voigt(wall: Wall) -> Option<(f64, f64, Release)> {
    let (stiffness_n_per_m, damping_n_s_per_m) = wall.spring_and_dashpot()?;
    Some((stiffness_n_per_m, damping_n_s_per_m, wall.release()?))
}

/// Every parameter with its unit. Those that no set-up has are left out of the table.
const PARAMETERS: &[(&str, ParameterValue)] = &[
    ("damper", |s, _| s.has_unmodelled_damper.then(|| "unmodelled".into())),
    ("Z, base amplitude (mm)", |s, m| (!m.is_force_driven).then(|| number(s.base_amplitude_m * 1e3))),
    ("P, force amplitude (N)", |s, _| s.force_amplitude_n().map(number)),
    ("Z = P/k, static deflection (mm)", |s, m| m.is_force_driven.then(|| number(s.base_amplitude_m * 1e3))),
    ("M, mass (kg)", |_, m| Some(number(m.structure.mass_kg))),
    ("fn, natural frequency (Hz)", |s, _| Some(number(s.natural_frequency_hz()))),
    ("k, stiffness (N/m)", |_, m| Some(number(m.structure.stiffness_n_per_m))),
    ("ζ, damping ratio", |_, m| Some(number(m.structure.damping_ratio()))),
    ("c, damping (N·s/m)", |_, m| Some(number(m.structure.damping_n_s_per_m))),
    ("time constant 2M/c (s)", |_, m| {
        let c = m.structure.damping_n_s_per_m;
        Some(if c > 0.0 { number(2.0 * m.structure.mass_kg / c) } else { "none".into() })
    }),
    ("m, particle's mass (kg)", |_, m| m.particle.map(|p| number(p.mass_kg))),
    ("m/M, mass ratio", |_, m| m.particle.map(|p| number(p.mass_kg / m.structure.mass_kg))),
    ("d, clearance (mm)", |_, m| m.particle.map(|p| number(p.clearance_m * 1e3))),
    ("d/Z, clearance ratio", |s, _| s.clearance_ratio().map(number)),
    ("y − x at the start (mm)", |s, m| {
        let known = |_| if s.spec.is_start_unknown() { "unknown".into() } else { number(s.particle_start_m() * 1e3) };
        m.particle.map(known)
    }),
    ("μi, internal friction", |_, m| m.particle.map(|p| number(p.friction_coefficient))),
    ("g, gravity (m/s²)", |_, m| {
        m.particle
            .filter(|p| p.friction_coefficient > 0.0 || p.cavity.inclination_deg != 0.0)
            .map(|_| number(m.gravity_m_per_s2))
    }),
    ("walls as stated", |s, _| {
        let particle = s.stated_particle()?;
        particle.walls().iter().any(|wall| wall.hertz().is_some()).then(|| describe::walls(&particle))
    }),
    ("e, restitution", |_, m| Some(number(m.particle?.wall.restitution()?.coefficient))),
    ("reference speed of e (m/s)", |_, m| Some(number(m.particle?.wall.falling()?.reference_speed_m_per_s))),
    ("exponent of e over speed", |_, m| Some(number(m.particle?.wall.falling()?.exponent))),
    ("largest e", |_, m| Some(number(m.particle?.wall.falling()?.maximum))),
    ("e over speed", |_, m| m.particle?.wall.table().map(|table| describe::wall(&Wall::TableRestitution(table)))),
    ("k1, wall's stiffness (N/m)", |_, m| Some(number(voigt(m.particle?.wall)?.0))),
    ("c1, wall's damping (N·s/m)", |_, m| Some(number(voigt(m.particle?.wall)?.1))),
    ("contact ends at", |_, m| {
        Some(match voigt(m.particle?.wall)?.2 {
            Release::ZeroPenetration => "zero penetration".into(),
            Release::ZeroForce => "zero force".into(),
        })
    }),
    ("wall at the positive side", |_, m| Some(describe::wall(&m.particle?.cavity.positive_wall?))),
    ("offset of the cavity (mm)", |_, m| {
        m.particle.filter(|p| p.cavity.offset_m != 0.0).map(|p| number(p.cavity.offset_m * 1e3))
    }),
    ("inclination (°)", |_, m| {
        m.particle.filter(|p| p.cavity.inclination_deg != 0.0).map(|p| number(p.cavity.inclination_deg))
    }),
    ("F, friction force (N)", |_, m| m.friction_damper.map(|d| number(d.force_n))),
    ("γF = F/(kZ)", |s, _| s.friction_ratio().map(number)),
    ("spring is kept at", |s, _| {
        Some(match s.spring()?.target {
            SpringTarget::FrictionRatio(ratio) => format!("γF = {}", number(ratio)),
            SpringTarget::NormalForce(force) => format!("{} N", number(force)),
            SpringTarget::Deflection(deflection) => format!("{} mm", number(deflection * 1e3)),
        })
    }),
    ("F_N, normal force (N)", |s, m| {
        Some(number(s.spring()?.normal_force_n(m.structure.stiffness_n_per_m, s.base_amplitude_m)))
    }),
    ("μe, block on base", |s, _| Some(number(s.spring()?.friction_coefficient))),
    ("k_s, spring (N/m)", |s, _| Some(number(s.spring()?.stiffness_n_per_m))),
    ("tuned mass (kg)", |_, m| m.tmd.map(|t| number(t.mass_kg))),
    ("tuned mass ratio", |_, m| m.tmd.map(|t| number(t.mass_kg / m.structure.mass_kg))),
    ("k1 of the tuned mass (N/m)", |_, m| m.tmd.map(|t| number(t.stiffness_n_per_m))),
    ("c1 of the tuned mass (N·s/m)", |_, m| m.tmd.map(|t| number(t.damping_n_s_per_m))),
];

/// A parameter of several set-ups: its name with the unit, and its values as text; `None` where a set-up does not have it.
pub struct ParameterRow {
    /// Name and unit.
    pub name: &'static str,
    /// A value for each set-up.
    pub values: Vec<Option<String>>,
}

/// The parameters that at least one of the set-ups has.
#[must_use]
pub fn rows(set_ups: &[CampaignSetUp]) -> Vec<ParameterRow> {
    let rows = PARAMETERS.iter().map(|(name, value)| {
        let values = set_ups.iter().map(|set_up| value(set_up, &set_up.model())).collect();
        ParameterRow { name, values }
    });
    rows.filter(|row| row.values.iter().any(Option::is_some)).collect()
}
