//! Reads a wall of a cavity: a hard one with its restitution and stated contact, a soft one (Voigt), one with Hertz contact, or a
//! piezoelectric one.

use std::f64::consts::PI;

use damprig_core::model::{
    DampingLaw, Dissipation, Hertz, Material, Release, Restitution, SPEED_TABLE_POINTS, SpeedTable, Structure, Wall,
};
use damprig_structures::PiezoelectricWall;

use super::contact::StatedContact;
use super::keys::{wall_hertz, wall_piezoelectric, wall_restitution, wall_voigt};
use crate::input::section::Given;
use crate::input::{Number, Section};

/// Largest θ²/(kC) of a piezoelectric wall.
const MAX_COUPLING: f64 = 100.0;

/// A wall, and its contact as far as it is stated.
pub(super) fn read_wall(
    s: &Section,
    structure: Option<&Structure>,
    particle_mass_kg: Option<f64>,
) -> Option<(Wall, Option<StatedContact>)> {
    let kinds = [wall_restitution::TABLE, wall_voigt::TABLE, wall_hertz::TABLE, wall_piezoelectric::TABLE];
    let wall = match s.variant(&kinds)? {
        0 => {
            let (wall, contact) = (read_hard(s), read_contact(s));
            wall.and_then(|wall| Some((wall, contact?)))
        }
        2 => read_hertz(s).map(|wall| (wall, None)),
        3 => read_piezoelectric(s, particle_mass_kg),
        _ => read_voigt(s, structure, particle_mass_kg).map(|wall| (wall, None)),
    };
    s.finish();
    wall
}

/// `Some(None)` if it is not stated, `None` after a problem.
fn read_contact(s: &Section) -> Option<Option<StatedContact>> {
    let factor = s.scalar(&wall_restitution::PULSE_FACTOR);
    Some(Some(match s.one_of(&wall_restitution::CONTACT) {
        Some((0, time_s)) => StatedContact::Pulse { time_s, factor: factor? },
        Some((_, stiffness_n_per_m15)) => StatedContact::Elastic(Hertz::elastic(stiffness_n_per_m15)),
        None => return (!s.is_given(&wall_restitution::CONTACT)).then_some(None),
    }))
}

fn read_hard(s: &Section) -> Option<Wall> {
    let given = s.given(&wall_restitution::COEFFICIENT);
    let speeds = s.numbers_of(&wall_restitution::SPEEDS);
    let exponent = s.scalar(&wall_restitution::EXPONENT);
    let reference_speed = s.scalar(&wall_restitution::REFERENCE_SPEED);
    let maximum = s.scalar(&wall_restitution::MAXIMUM);
    let coefficient = match given {
        Some((_, Given::Numbers(coefficients))) => return read_speed_table(s, &speeds?, &coefficients),
        Some((_, Given::Number(coefficient))) => Some(coefficient),
        _ => None,
    };
    if !s.is_given(&wall_restitution::EXPONENT) {
        return Some(Wall::Restitution { coefficient: coefficient? });
    }
    Some(Wall::SpeedRestitution(Restitution {
        coefficient: coefficient?,
        reference_speed_m_per_s: reference_speed?,
        exponent: exponent?,
        maximum: maximum?,
    }))
}

/// Refuses the first value with which the list up to it is no table.
fn read_speed_table(s: &Section, speeds: &[Number], coefficients: &[Number]) -> Option<Wall> {
    let count = speeds.len();
    if count != coefficients.len() || !(2..=SPEED_TABLE_POINTS).contains(&count) {
        let allowed = format!(
            "must be 2 to {SPEED_TABLE_POINTS} numbers, one for each of `speeds_m_per_s`; there are {} for {count} speeds",
            coefficients.len()
        );
        s.reject("coefficients", allowed, Some("write a speed for each coefficient".into()));
        return None;
    }
    let points: Vec<[f64; 2]> = speeds.iter().zip(coefficients).map(|(v, e)| [v.value, e.value]).collect();
    for n in 2..=count {
        let table = SpeedTable::new(&points[..n])?;
        let Err(invalid) = table.validate() else { continue };
        let is_speed = invalid.parameter.ends_with("speeds_m_per_s");
        let (name, list) = if is_speed { ("speeds_m_per_s", speeds) } else { ("coefficients", coefficients) };
        let number = list[..n].iter().rfind(|number| number.value == invalid.value)?;
        let [before, [speed, _]] = [points[n - 2], points[n - 1]];
        let least = SpeedTable::least_at(before, speed);
        let falls = !is_speed && invalid.value < least && least < 1.0;
        let help = falls.then(|| format!("write at least {:.4} at {speed} m/s", (least * 1e4).ceil() / 1e4));
        s.refuse(name, &number.span, format!("must be {}", invalid.allowed), help);
        return None;
    }
    SpeedTable::new(&points).map(Wall::TableRestitution)
}

/// k1 stated, by its material's name, or from storage modulus and shape factor; c1 stated, or from the loss factor by a law.
fn read_voigt(s: &Section, structure: Option<&Structure>, particle_mass_kg: Option<f64>) -> Option<Wall> {
    let shape = s.scalar(&wall_voigt::SHAPE);
    let (stiffness, material_loss) = match s.given(&wall_voigt::STIFFNESS) {
        Some((_, Given::Word(word))) => {
            let material = Material::ALL[word];
            (Some(material.stiffness_n_per_m()), Some(material.loss_factor()))
        }
        Some((1, Given::Number(stiffness))) => (Some(stiffness), None),
        Some((_, Given::Number(modulus))) => (shape.map(|shape| shape * modulus), None),
        _ => (None, None),
    };
    let damping = s.one_of(&wall_voigt::DAMPING).or(material_loss.map(|loss| (1, loss)));
    let law = s.word(&wall_voigt::LAW).map(|word| DampingLaw::ALL[word]);
    let release = s.word(&wall_voigt::RELEASE);
    let stiffness_n_per_m = stiffness?;
    let damping_n_s_per_m = match damping? {
        (0, damping) => damping,
        (_, loss) => law?.damping_n_s_per_m(stiffness_n_per_m, loss, structure?, particle_mass_kg?),
    };
    let release = if release? == 0 { Release::ZeroPenetration } else { Release::ZeroForce };
    Some(Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release })
}

/// With the soft wall that it is at short circuit, which it takes the place of.
fn read_piezoelectric(s: &Section, particle_mass_kg: Option<f64>) -> Option<(Wall, Option<StatedContact>)> {
    let stiffness = s.scalar(&wall_piezoelectric::STIFFNESS);
    let coupling = s.scalar(&wall_piezoelectric::COUPLING);
    let capacitance = s.scalar(&wall_piezoelectric::CAPACITANCE);
    let load = s.scalar(&wall_piezoelectric::LOAD);
    let wall = PiezoelectricWall {
        stiffness_n_per_m: stiffness?,
        coupling_n_per_v: coupling?,
        capacitance_f: capacitance?,
        load_ohm: load?,
    };
    let of_coupling = wall.coupling_n_per_v.powi(2) / (wall.stiffness_n_per_m * wall.capacitance_f);
    if of_coupling > MAX_COUPLING {
        let allowed = format!("means θ²/(kC) = {of_coupling:.3e}, which must be at most {MAX_COUPLING}");
        let help = "take θ, k and C of one wall: those of piezoelectric materials have θ²/(kC) from about 0.01 to 3";
        s.reject(wall_piezoelectric::COUPLING.name(), allowed, Some(help.into()));
        return None;
    }
    let open_n_per_m = wall.stiffness_n_per_m * (1.0 + of_coupling);
    let contact_s = PI * (particle_mass_kg? / open_n_per_m).sqrt();
    let [slowest_s, fastest_s] = [1e12, 1e-7].map(|share| share * contact_s);
    let circuit_s = wall.load_ohm * wall.capacitance_f;
    if !(fastest_s..=slowest_s).contains(&circuit_s) {
        let [circuit, contact] = [circuit_s, contact_s].map(|time_s| format!("{time_s:.3e} s"));
        let allowed =
            format!("means RC = {circuit}; it must be 1e-7 to 1e12 times the duration of a contact, {contact}");
        let (state, stiffness) =
            if circuit_s < fastest_s { ("short", wall.stiffness_n_per_m) } else { ("open", open_n_per_m) };
        let help = format!(
            "at {state} circuit it is a soft wall: write kind = \"voigt\", stiffness_n_per_m = {stiffness}, damping_n_s_per_m = 0, \
             release = \"zero_force\""
        );
        s.reject(wall_piezoelectric::LOAD.name(), allowed, Some(help));
        return None;
    }
    let shorted =
        Wall::Voigt { stiffness_n_per_m: wall.stiffness_n_per_m, damping_n_s_per_m: 0.0, release: Release::ZeroForce };
    Some((shorted, Some(StatedContact::Piezoelectric(wall))))
}

/// k stated, or from moduli, Poisson ratios and radius.
fn read_hertz(s: &Section) -> Option<Wall> {
    let stiffness = s.one_of(&wall_hertz::STIFFNESS);
    let poisson = s.scalar(&wall_hertz::POISSON);
    let radius = s.scalar(&wall_hertz::RADIUS);
    let particle_modulus = s.scalar(&wall_hertz::PARTICLE_MODULUS);
    let particle_poisson = s.scalar(&wall_hertz::PARTICLE_POISSON);
    let dissipation = s.one_of(&wall_hertz::DISSIPATION);
    let stiffness_n_per_m15 = match stiffness? {
        (0, stiffness) => stiffness,
        (_, modulus) => {
            let own = |quantity, value: Option<f64>, wall| if s.is_given(quantity) { value } else { Some(wall) };
            let moduli_pa = [modulus, own(&wall_hertz::PARTICLE_MODULUS, particle_modulus, modulus)?];
            let poisson = poisson?;
            let ratios = [poisson, own(&wall_hertz::PARTICLE_POISSON, particle_poisson, poisson)?];
            Hertz::stiffness_of_sphere_n_per_m15(moduli_pa, ratios, radius?)
        }
    };
    let dissipation = match dissipation? {
        (0, coefficient_s_per_m) => Dissipation::HuntCrossley { coefficient_s_per_m },
        (_, coefficient) => Dissipation::LankaraniNikravesh { coefficient },
    };
    Some(Wall::Hertz(Hertz { stiffness_n_per_m15, dissipation }))
}
