//! The tables of a case that describe what is mounted: structure, particle and walls, friction damper, tuned mass.
//!
//! Formulas are the model's ([`damprig_core::model`]); here are the keys, and which of them say the same quantity.

use std::f64::consts::TAU;

use damprig_core::model::{DampingLaw, FrictionDamper, Material, Particle, Release, Structure, Tmd, Tuning, Wall};

use crate::input::{Number, Section};

/// `structure`.
pub(super) fn structure(s: &Section) -> Option<Structure> {
    let mass = s.required("mass_kg", "M, kg", Section::positive);
    let stiffness = s.either(["stiffness_n_per_m", "natural_frequency_hz"], Section::positive);
    let damping = s.either(["damping_n_s_per_m", "damping_ratio"], Section::not_negative);
    s.finish();
    let mass_kg = mass?.value;
    let stiffness_n_per_m = match stiffness? {
        (0, stiffness) => stiffness.value,
        (_, frequency) => mass_kg * (TAU * frequency.value).powi(2),
    };
    let damping_n_s_per_m = match damping? {
        (0, damping) => damping.value,
        (_, ratio) => 2.0 * ratio.value * (stiffness_n_per_m * mass_kg).sqrt(),
    };
    Some(Structure { mass_kg, stiffness_n_per_m, damping_n_s_per_m })
}

/// `particle`; the structure is needed for what is relative to it.
pub(super) fn particle(s: &Section, structure: Option<Structure>) -> Option<Particle> {
    let mass = s.either(["mass_kg", "mass_ratio"], Section::positive);
    let mass_kg = mass.and_then(|mass| absolute(mass, structure));
    let clearance = s.required("clearance_m", "d, half the free travel, m", Section::positive);
    let friction = s.not_negative("friction_coefficient").map_or(0.0, |n| n.value);
    let what = "what the particle meets, e.g. {kind = \"restitution\", coefficient = 0.5}";
    let wall = s.required("wall", what, |s, k| s.table(k, None).map(|w| wall(&w, structure, mass_kg)));
    s.finish();
    Some(Particle { mass_kg: mass_kg?, clearance_m: clearance?.value, friction_coefficient: friction, wall: wall?? })
}

/// A mass given in kg (0) or as a share of the structure's.
fn absolute((which, mass): (usize, Number), structure: Option<Structure>) -> Option<f64> {
    if which == 0 { Some(mass.value) } else { Some(mass.value * structure?.mass_kg) }
}

fn wall(s: &Section, structure: Option<Structure>, particle_mass_kg: Option<f64>) -> Option<Wall> {
    let kind = s.required("kind", "\"restitution\" or \"voigt\"", |s, k| s.choice(k, &["restitution", "voigt"]));
    let wall = match kind? {
        0 => {
            let from_0_to_1 = |s: &Section, k| s.number_if(k, |e| (0.0..=1.0).contains(&e), "from 0 to 1");
            let coefficient = s.required("coefficient", "e, from 0 to 1", from_0_to_1);
            coefficient.map(|e| Wall::Restitution { coefficient: e.value })
        }
        _ => voigt(s, structure, particle_mass_kg),
    };
    s.finish();
    wall
}

/// A soft wall: k1 as it is, by its material's name, or from storage modulus and shape factor; c1 as it is, or from the
/// loss factor by one of the laws.
fn voigt(s: &Section, structure: Option<Structure>, particle_mass_kg: Option<f64>) -> Option<Wall> {
    let names: Vec<&'static str> = Material::ALL.iter().map(|m| m.name()).collect();
    let material = s.choice("material", &names).map(|index| Material::ALL[index]);
    let modulus = s.positive("storage_modulus_pa");
    let shape = s.positive("shape_factor_m");
    let stiffness = s.positive("stiffness_n_per_m");
    let given = [material.is_some(), modulus.is_some() || shape.is_some(), stiffness.is_some()];
    let k1 = match given {
        [true, false, false] => material.map(Material::stiffness_n_per_m),
        [false, true, false] => {
            let pair = modulus.as_ref().zip(shape.as_ref()).map(|(modulus, shape)| shape.value * modulus.value);
            if pair.is_none() {
                let lacking = if modulus.is_none() { "storage_modulus_pa" } else { "shape_factor_m" };
                s.lack(lacking, "k1 = shape factor × storage modulus needs both");
            }
            pair
        }
        [false, false, true] => stiffness.as_ref().map(|n| n.value),
        [false, false, false] => {
            let what = "k1, N/m; or give `material`, or `storage_modulus_pa` and `shape_factor_m`";
            if !s.has_own("material") && !s.has_own("storage_modulus_pa") && !s.has_own("shape_factor_m") {
                s.required("stiffness_n_per_m", what, Section::positive);
            }
            None
        }
        _ => {
            let second = stiffness.as_ref().or(modulus.as_ref()).or(shape.as_ref());
            let key = if stiffness.is_some() {
                "stiffness_n_per_m"
            } else if modulus.is_some() {
                "storage_modulus_pa"
            } else {
                "shape_factor_m"
            };
            if let Some(n) = second {
                let help =
                    Some("leave out all but one of `material`, `stiffness_n_per_m`, `storage_modulus_pa`".into());
                s.refuse(key, &n.span, "another key says the stiffness too", help);
            }
            None
        }
    };
    let damping = s.not_negative("damping_n_s_per_m");
    let loss = s.not_negative("loss_factor");
    let laws: Vec<&'static str> = DampingLaw::ALL.iter().map(|l| l.name()).collect();
    let law = s.choice("law", &laws).map(|index| DampingLaw::ALL[index]);
    if let (Some(_), Some(_)) = (&damping, law) {
        let span = s.text("law").map_or(s.span(), |t| t.span);
        let help = Some("leave out `law`, or give `loss_factor` in the place of `damping_n_s_per_m`".into());
        s.refuse("law", &span, "it tells c1 from a loss factor, and `damping_n_s_per_m` is given", help);
    }
    let eta = loss.as_ref().map(|n| n.value).or(material.map(Material::loss_factor));
    let c1 = match (&damping, &loss) {
        (Some(_), Some(loss)) => {
            let help = Some("leave out `damping_n_s_per_m` or `loss_factor`".into());
            s.refuse("loss_factor", &loss.span, "`damping_n_s_per_m` is given too, and says the same quantity", help);
            None
        }
        (Some(damping), None) => Some(damping.value),
        (None, _) => match (eta, k1, structure, particle_mass_kg) {
            (Some(eta), Some(k1), Some(structure), Some(mass_kg)) => {
                Some(law.unwrap_or_default().damping_n_s_per_m(k1, eta, &structure, mass_kg))
            }
            (None, ..) => {
                s.required("damping_n_s_per_m", "c1, N·s/m; or give `loss_factor`", Section::not_negative);
                None
            }
            _ => None,
        },
    };
    let releases = ["zero_penetration", "zero_force"];
    let release = s.required("release", "\"zero_penetration\" or \"zero_force\"", |s, k| s.choice(k, &releases));
    let release = if release? == 0 { Release::ZeroPenetration } else { Release::ZeroForce };
    Some(Wall::Voigt { stiffness_n_per_m: k1?, damping_n_s_per_m: c1?, release })
}

/// `friction_damper`.
pub(super) fn friction_damper(s: &Section) -> Option<FrictionDamper> {
    let force = s.required("force_n", "F, N", Section::not_negative);
    s.finish();
    Some(FrictionDamper { force_n: force?.value })
}

/// `tmd`: tuned by a rule, by ratios, or as it is.
pub(super) fn tmd(s: &Section, structure: Option<Structure>) -> Option<Tmd> {
    let mass = s.either(["mass_kg", "mass_ratio"], Section::positive);
    let mass_kg = mass.and_then(|mass| absolute(mass, structure));
    let tunings: Vec<&'static str> = Tuning::ALL.iter().map(|t| t.name()).collect();
    let tuning = s.choice("tuning", &tunings).map(|index| Tuning::ALL[index]);
    let tmd = if let Some(tuning) = tuning {
        for key in ["stiffness_n_per_m", "frequency_ratio", "damping_n_s_per_m", "damping_ratio"] {
            if let Some(n) = s.number(key) {
                let help = Some(format!("leave out `tuning` or `{key}`"));
                s.refuse(key, &n.span, "`tuning` is given too, and says it", help);
            }
        }
        let tuned = structure.zip(mass_kg).map(|(structure, mass_kg)| Tmd::tuned(&structure, mass_kg, tuning));
        if tuned.is_some_and(|tmd| !(tmd.stiffness_n_per_m > 0.0 && tmd.damping_n_s_per_m.is_finite())) {
            let span = s.text("tuning").map_or(s.span(), |t| t.span);
            s.refuse("tuning", &span, "the rule has a spring for mass ratios less than 2 only", None);
            return None;
        }
        tuned
    } else if s.has_own("tuning") {
        None
    } else {
        let stiffness = s.either(["stiffness_n_per_m", "frequency_ratio"], Section::positive);
        let damping = s.either(["damping_n_s_per_m", "damping_ratio"], Section::not_negative);
        match (structure, mass_kg, stiffness, damping) {
            (Some(structure), Some(mass_kg), Some((which, stiffness)), Some((how, damping))) => {
                let omega = structure.angular_frequency_rad_per_s();
                let stiffness_n_per_m =
                    if which == 0 { stiffness.value } else { mass_kg * (stiffness.value * omega).powi(2) };
                let critical = 2.0 * (stiffness_n_per_m * mass_kg).sqrt();
                let damping_n_s_per_m = if how == 0 { damping.value } else { damping.value * critical };
                Some(Tmd { mass_kg, stiffness_n_per_m, damping_n_s_per_m })
            }
            _ => None,
        }
    };
    s.finish();
    tmd
}
