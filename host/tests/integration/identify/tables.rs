//! Restitution, friction, walls and frequency responses from seeded tables, against the truth that made them.

use std::fmt::Write;

use damprig::identify::restitution::{Restitution, RestitutionOptions};
use damprig::identify::table::NumberTable;
use damprig::identify::wall::Pad;
use damprig::identify::{Estimate, Sensors, friction, response, response_file, restitution, wall};
use fastrand::Rng;
use tempfile::TempDir;

use super::many_seeds;
use crate::common::{damprig, is_full};

/// Normal noise of unit variance.
fn normal(rng: &mut Rng) -> f64 {
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}

fn table(text: &str) -> NumberTable {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("table.csv");
    std::fs::write(&path, text).unwrap();
    NumberTable::read(&path).unwrap()
}

/// Restitution of a drop test.
fn restitution_of(text: &str, options: &RestitutionOptions) -> Restitution {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drops.csv");
    std::fs::write(&path, text).unwrap();
    restitution::identify(&[path], options).unwrap()
}

/// One coefficient for all impacts.
fn constant(text: &str) -> Estimate {
    let estimates = restitution_of(text, &RestitutionOptions::default()).identified.estimates;
    estimates.into_iter().find(|estimate| estimate.quantity == "coefficient of restitution").unwrap()
}

/// Largest error over the seeds, and the share of intervals that cover the truth.
fn over_seeds(truth: f64, mut estimate: impl FnMut(&mut Rng) -> Estimate) -> (f64, f64) {
    let (mut worst, mut covered) = (0.0f64, 0);
    let seeds = many_seeds();
    for seed in 1..=seeds {
        let found = estimate(&mut Rng::with_seed(seed));
        worst = worst.max((found.value - truth).abs());
        covered += u32::from((found.interval_95[0]..=found.interval_95[1]).contains(&truth));
    }
    (worst, f64::from(covered) / seeds as f64)
}

#[track_caller]
fn assert_claim(what: &str, (worst, covered): (f64, f64), allowed: f64) {
    println!("{what}: largest error {worst:.2e}, covered {covered:.3}");
    assert!(worst < allowed, "{what}: error {worst:.2e}, allowed {allowed:.2e}");
    let allowed = if is_full() { 0.93..=0.97 } else { 0.90..=0.995 };
    assert!(allowed.contains(&covered), "{what}: the intervals cover {:.1} %", 100.0 * covered);
}

/// Ten drops of six impacts, timed to 0.2 ms: e within 0.01.
#[test]
fn restitution_from_impact_times_is_within_a_hundredth() {
    for truth in [0.47, 0.82] {
        let claim = over_seeds(truth, |rng| {
            let mut text = "drop,t_s\n".to_string();
            for drop in 1..=10 {
                let (mut t, mut flight) = (0.3, 0.4);
                for _ in 0..6 {
                    writeln!(text, "{drop},{:.7}", t + 2e-4 * normal(rng)).unwrap();
                    t += flight;
                    flight *= truth;
                }
            }
            constant(&text)
        });
        assert_claim(&format!("e = {truth} from times"), claim, 0.01);
    }
}

/// Ten drops from 0.5 m, heights read to 2 mm.
#[test]
fn restitution_from_heights_is_within_a_hundredth() {
    let truth = 0.6f64;
    let claim = over_seeds(truth, |rng| {
        let mut text = "drop_height_m,rebound_height_m\n".to_string();
        for _ in 0..10 {
            writeln!(text, "0.5,{:.5}", 0.5 * truth * truth + 2e-3 * normal(rng)).unwrap();
        }
        constant(&text)
    });
    assert_claim("e from heights", claim, 0.01);
}

/// Half-sine impacts of 2 ms on a force sensor with 0.2 % of 500 N as noise, sampled at 50 kHz.
#[test]
fn contact_time_and_restitution_follow_from_force_records() {
    let (truth, mass, approach) = (0.5, 0.16, 1.0);
    let impulse = mass * approach * (1.0 + truth);
    let length = 2e-3;
    let peak = impulse * std::f64::consts::PI / (2.0 * length);
    let mut rng = Rng::with_seed(1);
    let mut text = "t_s,force_n\n".to_string();
    for n in 0..25_000 {
        let t = f64::from(n) / 50e3;
        let since = t % 0.1 - 0.05;
        let force =
            if (0.0..length).contains(&since) { peak * (std::f64::consts::PI * since / length).sin() } else { 0.0 };
        writeln!(text, "{t:.6},{:.4}", force + normal(&mut rng)).unwrap();
    }
    let body = restitution::Approach { mass_kg: mass, velocity_m_per_s: approach };
    let options = RestitutionOptions { approach: Some(body), ..RestitutionOptions::default() };
    let found = restitution_of(&text, &options).identified.estimates;
    assert!((found[0].value - truth).abs() < 0.02, "{found:?}");
    // Five half-sines of 100 samples with noise of 0.5 % of the peak: 0.1 % of the duration.
    assert!((found[1].value / length - 1.0).abs() < 3e-3, "{found:?}");
}

/// Ten slides of 0.5 m, timed to 3 ms, on a slope that is set to 0.05°.
#[test]
fn internal_friction_from_inclines_is_within_five_thousandths() {
    for truth in [0.08, 0.18, 0.25] {
        let claim = over_seeds(truth, |rng| {
            let mut text = "angle_deg,distance_m,duration_s\n".to_string();
            for n in 0..10 {
                let angle = 18.0 + f64::from(n % 3) * 2.0f64;
                let theta = (angle + 0.05 * normal(rng)).to_radians();
                let a = 9.81 * (theta.sin() - truth * theta.cos());
                writeln!(text, "{angle},0.5,{:.5}", (2.0 * 0.5 / a).sqrt() + 0.003 * normal(rng)).unwrap();
            }
            friction::identify(&table(&text), 9.81).unwrap().remove(0)
        });
        assert_claim(&format!("μi = {truth} from slides"), claim, 0.005);
        let claim = over_seeds(truth, |rng| {
            let mut text = "angle_deg\n".to_string();
            for _ in 0..10 {
                writeln!(text, "{:.3}", truth.atan().to_degrees() + 0.2 * normal(rng)).unwrap();
            }
            friction::identify(&table(&text), 9.81).unwrap().remove(0)
        });
        assert_claim(&format!("μi = {truth} from the angle of sliding"), claim, 0.005);
    }
}

#[test]
fn the_friction_force_of_a_spring_is_a_line_over_its_deflection() {
    let slope = over_seeds(240.0, |rng| {
        let mut text = "deflection_mm,force_n\n".to_string();
        for n in 0..12 {
            let deflection = f64::from(n) * 0.5;
            writeln!(text, "{deflection},{:.5}", 0.05 + 0.24 * deflection + 0.01 * normal(rng)).unwrap();
        }
        friction::identify(&table(&text), 9.81).unwrap().remove(0)
    });
    assert_claim("friction force per deflection, N/m", slope, 240.0 * 0.05);
}

/// E' of the source document's PU foam over a decade of frequencies, 2 % scatter.
#[test]
fn soft_wall_constants_follow_from_dma_tables() {
    let (stiffness, loss, shape) = (1024.9, 0.224, 0.02);
    let text = |rng: &mut Rng| {
        let mut text = "frequency_hz,storage_modulus_kpa,loss_factor\n".to_string();
        for n in 0..20 {
            let f = 10f64.powf(0.5 + f64::from(n) / 19.0);
            let modulus = stiffness / shape * (f / 10.0).powf(0.1) * (1.0 + 0.02 * normal(rng));
            writeln!(text, "{f:.4},{:.6},{:.6}", modulus * 1e-3, loss * (1.0 + 0.02 * normal(rng))).unwrap();
        }
        text
    };
    let pad = Pad { shape_factor_m: Some(shape), frequency_hz: Some(10.0) };
    let found = |place: usize| move |rng: &mut Rng| wall::identify(&table(&text(rng)), pad).unwrap().remove(place);
    assert_claim("k1, N/m", over_seeds(stiffness, found(0)), 0.03 * stiffness);
    assert_claim("η", over_seeds(loss, found(1)), 0.03 * loss);
}

/// 21 points over the resonance with 0.5 % noise of amplitude and phase, on sensors of x and z whose scales are off, that of x less at
/// large amplitudes.
#[test]
fn a_frequency_response_gives_frequency_and_damping() {
    let (natural, zeta) = (2.5f64, 0.0038f64);
    let text = |rng: &mut Rng, with_phase: bool| {
        let mut text = format!("frequency_hz,x_mm,z_mm{}\n", if with_phase { ",phase_deg" } else { "" });
        let [of_x, of_z] = [0; 2].map(|_| Sensors::ASSUMED.scale * normal(rng));
        for n in -10..=10 {
            let f = natural + 0.01 * f64::from(n);
            let (r, d) = (f / natural, 2.0 * zeta * f / natural);
            let ratio = ((1.0 + d * d) / ((1.0 - r * r).powi(2) + d * d)).sqrt();
            let phase = d.atan() - d.atan2(1.0 - r * r);
            let scale = 1.0 + of_x * (1.0 - (2.0 * zeta * ratio).powi(2));
            let x_mm = 0.05 * ratio * scale * (1.0 + 0.005 * normal(rng));
            write!(text, "{f},{x_mm:.9},{:.9}", 0.05 * (1.0 + of_z)).unwrap();
            if with_phase {
                write!(text, ",{:.7}", (phase + 0.005 * normal(rng)).to_degrees()).unwrap();
            }
            text.push('\n');
        }
        text
    };
    for with_phase in [true, false] {
        let found = |place: usize| {
            move |rng: &mut Rng| {
                let read = response_file::points(&table(&text(rng, with_phase))).unwrap();
                response::identify(&read.points, read.driven_by, &read.sensors).unwrap().remove(place)
            }
        };
        let name = if with_phase { "with phase" } else { "amplitudes alone" };
        assert_claim(&format!("fn, {name}"), over_seeds(natural, found(0)), 1e-3);
        assert_claim(&format!("ζ, {name}"), over_seeds(zeta, found(1)), 0.02 * zeta);
    }
}

#[test]
fn tables_of_no_test_and_impossible_values_are_refused_with_the_fix() {
    let folder = TempDir::new().unwrap();
    let refused = |what: &str, text: &str, says: &[&str]| {
        std::fs::write(folder.path().join("table.csv"), text).unwrap();
        let output =
            damprig(&folder).args(["identify", what, "table.csv"]).assert().code(2).get_output().stderr.clone();
        let message = String::from_utf8(output).unwrap();
        for part in says {
            assert!(message.contains(part), "{part:?} is not in:\n{message}");
        }
    };
    refused("restitution", "a_m,b_m\n1,2\n", &["not the columns of a drop test", "drop_height_m,rebound_height_m"]);
    refused("restitution", "drop_height_m,rebound_height_m\n0.5,0.6\n0.5,0.7\n", &["is not possible", "swapped"]);
    refused("restitution", "drop_height_m,rebound_height_m\n0.5,0.2\n", &["at least two drops"]);
    refused("restitution", "drop_height_m,rebound_height_m\n500,200\n", &["not probable", "drop_height_mm"]);
    refused("restitution", "drop,t_s\n1,0.1\n1,0.5\n2,0.1\n2,0.4\n", &["a drop with 2 impacts"]);
    refused("friction", "angle_deg\n5\n", &["at least two rows"]);
    refused("friction", "angle_rad\n20\n21\n", &["not probable", "angle_deg"]);
    refused("friction", "angle_deg,distance_m,duration_s\n10,0.5,0.2\n10,0.5,0.2\n", &["without friction", "at rest"]);
    refused("friction", "deflection_m,force_n\n0.01,1\n0.01,1.1\n0.01,1.2\n", &["different deflections"]);
    refused("wall", "storage_modulus_pa\n1e5\n", &["there is no loss"]);
    refused("wall", "stiffness_n_per_m,loss_factor\n1e4,0.2\n-1,0.2\n", &["line 3", "greater than 0"]);
    refused("response", "frequency_hz,x_m,z_m\n1,0.001,0.001\n", &["too few", "about the resonance"]);
    let far: String = (1..8).map(|n| format!("{},0.0011,0.001\n", f64::from(n) * 0.05)).collect();
    refused("response", &format!("frequency_hz,x_m,z_m\n{far}"), &["there is no resonance", "sweep over"]);
}

#[test]
fn identified_walls_are_set_up_keys_of_their_kind() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("drops.csv", "drop_height_m,rebound_height_m\n0.5,0.112\n0.5,0.108\n0.5,0.110\n");
    write("dma.csv", "stiffness_n_per_m,loss_factor\n1000,0.2\n1020,0.21\n1010,0.2\n");
    write("incline.csv", "angle_deg\n10.1\n10.3\n10.2\n");
    let identify = |arguments: &[&str]| {
        damprig(&folder).arg("identify").args(arguments).args(["--out", "identified.toml"]).assert().success();
    };
    identify(&["restitution", "drops.csv"]);
    identify(&["friction", "incline.csv", "--update"]);
    let particle = || {
        let case = "set_up_file = \"identified.toml\"\nstructure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = \
                    0.0038 }\nparticle = { mass_ratio = 0.1, clearance_m = 0.01 }\nbase = { kind = \"sine\", amplitude_m = \
                    1e-3, frequency_hz = 2 }\nrun = { duration_s = 1 }\n";
        write("case.toml", case);
        damprig::simulation::Case::read(&folder.path().join("case.toml")).unwrap().set_up.particle.unwrap()
    };
    let hard = particle();
    assert!((hard.friction_coefficient - 10.2f64.to_radians().tan()).abs() < 1e-3);
    let damprig_core::model::Wall::Restitution { coefficient } = hard.wall else { panic!("{hard:?}") };
    assert!((coefficient - 0.22f64.sqrt()).abs() < 0.003);
    // A wall of another kind replaces it, and keeps the friction.
    identify(&["wall", "dma.csv", "--update"]);
    let soft = particle();
    assert!(matches!(soft.wall, damprig_core::model::Wall::Voigt { stiffness_n_per_m, .. }
        if (stiffness_n_per_m - 1010.0).abs() < 1.0));
    assert_eq!(soft.friction_coefficient, hard.friction_coefficient);
}
