//! One-line descriptions of a set-up and of an excitation, for legends, titles and prompts.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, Dissipation, Particle, Wall};
use damprig_structures::PiezoelectricWall;

use super::numbers::{millimetres, significant, trimmed};
use crate::campaign::{CampaignSetUp, Experiment};
use crate::input::shown_in_line;
use crate::motion_record::{RecordOrigin, RecordQuantity};
use crate::simulation::Case;

/// The parameters in which set-ups and published results differ: `d/Z = 10, e = 0.47, γF = 0.6, Z = 1.5 mm`.
#[must_use]
pub fn set_up(set_up: &CampaignSetUp) -> String {
    let clearance = set_up.clearance_ratio().map(|r| format!("d/Z = {}", trimmed(r, 2)));
    let model = set_up.model();
    let wall = set_up.stated_particle().map(|particle| walls(&particle));
    let tuned = model.tmd.map(|tmd| {
        let own = (tmd.stiffness_n_per_m / tmd.mass_kg).sqrt();
        let gamma = own / model.structure.angular_frequency_rad_per_s();
        let zeta = tmd.damping_n_s_per_m / (2.0 * tmd.mass_kg * own);
        let ratio = tmd.mass_kg / model.structure.mass_kg;
        format!("m/M = {}, γ = {}, ζ1 = {}", trimmed(ratio, 3), trimmed(gamma, 4), trimmed(zeta, 4))
    });
    let friction = set_up.friction_ratio().map(|r| format!("γF = {}", trimmed(r, 2)));
    let unmodelled = set_up.has_unmodelled_damper.then(|| "damper without a model".into());
    let amplitude = Some(match set_up.force_amplitude_n() {
        Some(force_n) => format!("P = {} N, Z = P/k", significant(force_n, 3)),
        None => format!("Z = {} mm", trimmed(set_up.base_amplitude_m * 1e3, 3)),
    });
    [clearance, wall, tuned, friction, unmodelled, amplitude].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The walls of a particle, and how its cavity differs from a plain one: `e = 0.47`, `e = 0.47, at + e = 0.6, offset 1 mm, 30° up`.
#[must_use]
pub fn walls(particle: &Particle) -> String {
    walls_with(particle, [None; 2])
}

/// The same with piezoelectric walls at the negative and the positive side.
pub(super) fn walls_with(particle: &Particle, piezoelectric: [Option<PiezoelectricWall>; 2]) -> String {
    let Cavity { offset_m, inclination_deg, .. } = &particle.cavity;
    let texts = particle.walls().into_iter().zip(piezoelectric);
    let mut texts = texts.map(|(own, harvesting)| harvesting.map_or_else(|| wall(&own), harvesting_wall));
    let (mut text, positive) = (texts.next().unwrap_or_default(), texts.next().unwrap_or_default());
    if positive != text {
        text += &format!(", at + {positive}");
    }
    if *offset_m != 0.0 {
        text += &format!(", offset {}", millimetres(*offset_m));
    }
    if *inclination_deg != 0.0 {
        text += &format!(", {}° up", trimmed(*inclination_deg, 2));
    }
    text
}

fn harvesting_wall(wall: PiezoelectricWall) -> String {
    let PiezoelectricWall { stiffness_n_per_m, coupling_n_per_v, capacitance_f, load_ohm } = wall;
    let [stiffness, coupling, capacitance, load] =
        [stiffness_n_per_m, coupling_n_per_v, capacitance_f, load_ohm].map(|value| significant(value, 4));
    format!("piezoelectric with k = {stiffness} N/m, θ = {coupling} N/V, C = {capacitance} F, R = {load} Ω")
}

/// A wall: `e = 0.47`, `e = 0.6 (v/0.5 m/s)^−0.25, at most 0.9`,
/// `e = 0.9 at 0.1 m/s, 0.6 at 2 m/s`, `k1 = 4000 N/m, c1 = 14.6 N·s/m`.
pub(super) fn wall(wall: &Wall) -> String {
    match *wall {
        Wall::Restitution { coefficient } => format!("e = {}", significant(coefficient, 4)),
        Wall::SpeedRestitution(law) => format!(
            "e = {} (v/{} m/s)^−{}, at most {}",
            significant(law.coefficient, 4),
            significant(law.reference_speed_m_per_s, 4),
            significant(law.exponent, 4),
            significant(law.maximum, 4)
        ),
        Wall::TableRestitution(table) => {
            let point = |[speed, e]: &[f64; 2]| format!("{} at {} m/s", significant(*e, 4), significant(*speed, 4));
            format!("e = {}", table.points().iter().map(point).collect::<Vec<_>>().join(", "))
        }
        Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
            let (k1, c1) = (significant(stiffness_n_per_m, 5), significant(damping_n_s_per_m, 5));
            format!("k1 = {k1} N/m, c1 = {c1} N·s/m")
        }
        Wall::Hertz(law) => {
            let loss = match law.dissipation {
                Dissipation::HuntCrossley { coefficient_s_per_m } => {
                    format!("Hunt–Crossley α = {} s/m", significant(coefficient_s_per_m, 4))
                }
                Dissipation::LankaraniNikravesh { coefficient } => {
                    format!("Lankarani–Nikravesh e = {}", significant(coefficient, 4))
                }
            };
            format!("k = {} N/m^1.5, {loss}", significant(law.stiffness_n_per_m15, 5))
        }
    }
}

/// What a person must do before a set-up is measured: `Mount set-up "spid": d/Z = 10, … Put the particle at the wall.`
#[must_use]
pub fn mounting(set_up: &CampaignSetUp) -> String {
    let instruction = set_up.instruction.as_ref().map_or(String::new(), |text| format!(" {}", sentence(text)));
    shown_in_line(&format!("Mount set-up {:?}: {}.{instruction}", set_up.name, self::set_up(set_up))).into_owned()
}

/// What a person must do before an experiment.
#[must_use]
pub fn instruction(experiment: &Experiment, instruction: &str) -> String {
    shown_in_line(&format!("Experiment {:?}: {}", experiment.name, sentence(instruction))).into_owned()
}

/// With a full stop at its end.
fn sentence(text: &str) -> String {
    let text = text.trim();
    if text.ends_with(['.', '!', '?']) { text.to_string() } else { format!("{text}.") }
}

/// The excitation of a case: `base Z = 3 mm, 2.5 Hz (f/fn = 1)`.
#[must_use]
pub fn excitation(case: &Case) -> String {
    if let Some(record) = &case.record {
        let file = match &record.origin {
            RecordOrigin::File(file) => file.file_name().unwrap_or_default().to_string_lossy(),
            RecordOrigin::Noise => "noise".into(),
            RecordOrigin::Samples => "samples".into(),
        };
        let peak = match record.quantity {
            RecordQuantity::Acceleration => format!("acceleration, peak {} m/s²", significant(record.peak(), 4)),
            RecordQuantity::Displacement => format!("displacement, peak {}", millimetres(record.peak())),
        };
        let (duration_s, rate_hz) = (significant(record.duration_s(), 5), significant(1.0 / record.step_s, 5));
        return format!("{file}: {peak}, {duration_s} s at {rate_hz} Hz");
    }
    let hz = |omega: f64| significant(omega / TAU, 5);
    match case.excitation {
        Excitation::Fixed => format!("free vibration from x0 = {}", millimetres(case.initial.x_m)),
        Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
            let r = angular_frequency_rad_per_s / case.set_up.structure.angular_frequency_rad_per_s();
            let (z, f) = (millimetres(amplitude_m), hz(angular_frequency_rad_per_s));
            let beside = case.multi_degree.as_ref().and_then(|several| several.set_up.force_beside_base);
            let force = beside.map_or(String::new(), |force| {
                let (amplitude, phase) = (significant(force.amplitude_n, 4), significant(force.phase_rad, 4));
                format!(", force {amplitude} N (φ = {phase} rad)")
            });
            format!("base Z = {z}, {f} Hz (f/fn = {}){force}", significant(r, 4))
        }
        Excitation::HalfSine { amplitude_m, duration_s } => {
            format!("half-sine pulse of the base, Z = {}, {} s", millimetres(amplitude_m), significant(duration_s, 4))
        }
        Excitation::Versine { amplitude_m, duration_s } => {
            format!("versine pulse of the base, Z = {}, {} s", millimetres(amplitude_m), significant(duration_s, 4))
        }
        Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
            format!("force {} N at {} Hz", significant(amplitude_n, 4), hz(angular_frequency_rad_per_s))
        }
        Excitation::ForceHalfSine { amplitude_n, duration_s } => {
            format!("half-sine force, {} N, {} s", significant(amplitude_n, 4), significant(duration_s, 4))
        }
    }
}
