//! Contact time, pulse factor and stiffness of hard walls, against the contacts of the virtual rig and against drawn pulses.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

use damprig::identify::Estimate;
use damprig::identify::contact::{MeasuredPulse, of_pulses, of_records};
use damprig::identify::table::NumberTable;
use damprig_core::io::{WALL_SUBSAMPLES, WallCounts};
use damprig_core::measure::impacts::ImpactMeter;
use damprig_core::model::{Cavity, Particle, Release, SetUp, Structure, Wall};
use damprig_simulator::plant::walls::{WallSensors, Walls};
use fastrand::Rng;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;

use super::many_seeds;
use crate::common::{damprig, folder_with};

const CAMPAIGN: &str = r#"name = "spid"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.5
damping_ratio = 0.0038
[[set_up]]
name = "spid"
base_amplitude_m = 0.0015
particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = "restitution", coefficient = 0.47 } }
[[experiment]]
name = "resonance"
kind = "stepped_sine"
frequencies_hz = [2.45, 2.5]
start = "from_rest"
dwell_s = 16
"#;

/// Contacts of the virtual rig are half-sines of 2 ms, sampled at 50 kHz with 0.2 N of noise.
#[test]
fn the_contacts_of_the_virtual_rig_are_found_within_their_uncertainty() {
    let folder = folder_with(CAMPAIGN);
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let output = damprig(&folder).args(["identify", "contact", "run", "--json"]).output().unwrap();
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let estimates = found["estimates"].as_array().unwrap();
    println!("{estimates:#?}");
    let named = |name: &str| {
        let is_it = |estimate: &&Value| estimate["quantity"] == name;
        let estimate = estimates.iter().find(is_it).unwrap_or_else(|| panic!("no {name} in {estimates:?}"));
        let ends = [0, 1].map(|n| estimate["interval_95"][n].as_f64().unwrap());
        (estimate["value"].as_f64().unwrap(), ends)
    };
    for name in ["contact time", "contact time at the negative side", "contact time at the positive side"] {
        let (time_s, ends) = named(name);
        assert!(ends[0] < 2e-3 && 2e-3 < ends[1] && ends[1] - ends[0] < 0.02 * time_s, "{name}: {time_s} {ends:?}");
    }
    let truth = 0.16 * 1.6 / 1.76 * (PI / 2e-3_f64).powi(2);
    let (_, ends) = named("stiffness of a spring contact, positive side");
    assert!(ends[0] < truth && truth < ends[1], "{truth} is not in {ends:?}");
    // The file of one wall holds the contact of all pulses, beside what was identified before.
    damprig(&folder).args(["identify", "contact", "run", "--out", "identified.toml"]).assert().success();
    let file = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap();
    let values: toml::Table = file.parse().unwrap();
    let time_s = values["particle"]["wall"]["contact_time_s"].as_float().unwrap();
    assert!((time_s - named("contact time").0).abs() < 1e-15, "{file}");
    // A case takes it with the coefficient, and has a wall force.
    std::fs::write(
        folder.path().join("identified.toml"),
        file.replace("[particle.wall]", "[particle.wall]\ncoefficient = 0.47"),
    )
    .unwrap();
    let case = "set_up_file = \"identified.toml\"\nstructure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
                particle = { mass_ratio = 0.1, clearance_m = 0.015 }\nbase = { kind = \"sine\", amplitude_m = 1.5e-3, frequency_hz = 2.5 }\n\
                run = { duration_s = 8 }\n";
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    damprig(&folder).args(["simulate", "case.toml"]).assert().success().stdout(contains("wall force"));
}

fn named<'a>(estimates: &'a [Estimate], name: &str) -> &'a Estimate {
    estimates.iter().find(|estimate| estimate.quantity == name).unwrap_or_else(|| panic!("no {name} in {estimates:?}"))
}

/// The pulses that the board finds in the simulated rig's half-sines of 2 ms with this peak: 50 kHz, noise of 0.2 N.
fn measured(seed: u64, peak_n: f32, count: u32) -> Vec<MeasuredPulse> {
    let sensors = WallSensors::default();
    let mut walls = Walls::new(&sensors, seed).unwrap();
    let (mut meter, mut rng) = (ImpactMeter::default(), Rng::with_seed(seed));
    let mut found = Vec::new();
    for tick in 0..100 + 20 * count {
        if tick >= 100 && tick % 20 == 0 {
            walls.hit(rng.f32(), 1, peak_n * sensors.contact_s / std::f32::consts::FRAC_PI_2);
        }
        let block: [WallCounts; WALL_SUBSAMPLES] = walls.read(None);
        meter.push(tick, &block, |impact| {
            let (peak_n, impulse_n_s) = (f64::from(impact.peak_n), f64::from(impact.impulse_n_s));
            found.push(MeasuredPulse { is_positive: impact.side > 0, peak_n, impulse_n_s });
        });
    }
    found
}

/// Noise raises the peaks that the board measures, which shortens the contacts. Peaks of less than 20 N lose their feet below the threshold
/// of 2.5 N besides.
#[test]
fn the_interval_of_a_runs_contacts_covers_the_truth_from_weak_impacts_to_strong_ones() {
    let wall = set_up(Wall::Restitution { coefficient: 0.5 }, None);
    for peak_n in [20.0, 40.0, 80.0, 160.0] {
        let (mut covered, mut sum) = (0, 0.0);
        for seed in 1..=many_seeds() {
            let pulses = measured(seed, peak_n, 20);
            assert_eq!(pulses.len(), 20, "{peak_n} N");
            let found = of_pulses(&pulses, &wall).unwrap().estimates;
            let time = named(&found, "contact time");
            covered += u64::from((time.interval_95[0]..=time.interval_95[1]).contains(&2e-3));
            sum += time.value / 2e-3 - 1.0;
        }
        let share = covered as f64 / many_seeds() as f64;
        println!("{peak_n} N: {:+.3} % on average, covered {share:.3}", 100.0 * sum / many_seeds() as f64);
        assert!(share >= least_share(many_seeds()), "{peak_n} N: {share}");
    }
}

/// Three standard deviations below a share of 95 %.
fn least_share(seeds: u64) -> f64 {
    0.95 - 3.0 * (0.95 * 0.05 / seeds as f64).sqrt()
}

/// A force record with pulses of a shape, whose phases and peaks are drawn, and 0.2 N of noise.
fn record(seed: u64, rate_hz: f64, time_s: f64, shape: impl Fn(f64) -> f64) -> NumberTable {
    let mut rng = Rng::with_seed(seed);
    let mut text = "t_s,force_n\n".to_string();
    for pulse in 0..10 {
        let (at, peak) = (0.005 + rng.f64() / rate_hz, 40.0 + 60.0 * rng.f64());
        for n in 0..(0.0256 * rate_hz) as u32 {
            let t = f64::from(n) / rate_hz;
            let since = (t - at) / time_s;
            let noise = (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
            let force = if (0.0..1.0).contains(&since) { peak * shape(since) } else { 0.0 };
            writeln!(text, "{:.6},{:.4}", t + f64::from(pulse) * 0.0256, force + 0.2 * noise + 1.5).unwrap();
        }
    }
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("pulses.csv");
    std::fs::write(&path, text).unwrap();
    NumberTable::read(&path).unwrap()
}

#[test]
fn duration_and_factor_of_half_sines_follow_from_a_force_record() {
    for (rate_hz, seeds) in [(10e3, many_seeds()), (100e3, many_seeds() / 4)] {
        let (mut worst, mut covered) = ([0.0f64; 2], [0, 0]);
        for seed in 1..=seeds {
            let table = record(seed, rate_hz, 2e-3, |since| (PI * since).sin());
            let found = of_records(&[table], Some(0.145)).unwrap().estimates;
            for (n, (name, truth)) in [("contact time", 2e-3), ("pulse factor", FRAC_PI_2)].into_iter().enumerate() {
                let estimate = named(&found, name);
                worst[n] = worst[n].max((estimate.value / truth - 1.0).abs());
                covered[n] += u64::from((estimate.interval_95[0]..=estimate.interval_95[1]).contains(&truth));
            }
            let stiffness = named(&found, "stiffness of a spring contact").value;
            let time_s = named(&found, "contact time").value;
            assert!((stiffness / (0.145 * (PI / time_s).powi(2)) - 1.0).abs() < 1e-12);
        }
        let shares = covered.map(|covered| covered as f64 / seeds as f64);
        println!("{rate_hz} Hz: largest errors {worst:?}, covered {shares:?}");
        // Ten fits, each of 20 samples of some 70 N with 0.2 N of noise: 0.1 % of τ at most. The kinks are 0.2 % of J.
        assert!(worst[0] < 2e-3 && worst[1] < 6e-3, "{worst:?}");
        let least = least_share(seeds);
        assert!(shares[0] >= least && shares[1] >= least, "{shares:?}");
    }
}

/// Whatever the shape, peak = factor·J/τ: the force of a case with both keys is that of the record.
#[test]
fn the_factor_of_another_shape_gives_the_peak_of_its_impulse() {
    // sin² has the impulse τ/2 per peak.
    let table = record(1, 10e3, 3e-3, |since| (PI * since).sin().powi(2));
    let found = of_records(&[table], None).unwrap().estimates;
    let per_impulse = named(&found, "pulse factor").value / named(&found, "contact time").value;
    assert!((per_impulse / (2.0 / 3e-3) - 1.0).abs() < 5e-3, "{per_impulse}");
    assert!((named(&found, "pulse factor").value - FRAC_PI_2).abs() > 0.02);
}

fn set_up(wall: Wall, positive_wall: Option<Wall>) -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.01,
        friction_coefficient: 0.0,
        wall,
        cavity: Cavity { positive_wall, ..Cavity::default() },
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

#[test]
fn two_walls_have_their_own_contacts_and_hertz_stiffnesses() {
    let (soft, stiff) = (Wall::Restitution { coefficient: 0.4 }, Wall::Restitution { coefficient: 0.7 });
    let (k, reduced_kg) = (3e7_f64, 0.16 * 1.6 / 1.76);
    // Pulses with the peaks of elastic spheres.
    let pulse = |is_positive: bool, v: f64| MeasuredPulse {
        is_positive,
        peak_n: k * (5.0 * reduced_kg * v * v / (4.0 * k)).powf(0.6),
        impulse_n_s: reduced_kg * v * (1.0 + if is_positive { 0.7 } else { 0.4 }),
    };
    let pulses: Vec<MeasuredPulse> =
        (1..=10).flat_map(|n| [false, true].map(|side| pulse(side, 0.1 * f64::from(n)))).collect();
    let identified = of_pulses(&pulses, &set_up(soft, Some(stiff))).unwrap();
    let keys: Vec<&str> = identified.estimates.iter().filter_map(|estimate| estimate.key).collect();
    assert_eq!(keys, ["particle.wall.contact_time_s", "particle.positive_wall.contact_time_s"]);
    for name in ["Hertz stiffness, negative side", "Hertz stiffness, positive side"] {
        let found = named(&identified.estimates, name);
        assert!((found.value / k - 1.0).abs() < 1e-9, "{found:?}");
    }
}

#[test]
fn sources_without_contacts_are_refused_with_what_to_do() {
    let pad = Wall::Voigt { stiffness_n_per_m: 3e3, damping_n_s_per_m: 1.0, release: Release::ZeroForce };
    let pulse = MeasuredPulse { is_positive: true, peak_n: 50.0, impulse_n_s: 0.06 };
    let hard = Wall::Restitution { coefficient: 0.5 };
    let refused = |pulses: &[MeasuredPulse], set_up: &SetUp, words: &str| {
        let why = of_pulses(pulses, set_up).expect_err("it is refused").to_string();
        assert!(why.contains(words), "no {words:?} in {why}");
    };
    refused(&[pulse; 3], &set_up(pad, None), "hard walls");
    refused(&[pulse; 3], &SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)), "hard walls");
    refused(&[pulse], &set_up(hard, None), "0 whole pulses on the negative side and 1 on the positive one; at least 2");
    let folder = TempDir::new().unwrap();
    let flat: String = (0..50).fold("t_s,force_n\n".into(), |text, n| format!("{text}{:.4},0\n", f64::from(n) * 1e-4));
    std::fs::write(folder.path().join("flat.csv"), flat).unwrap();
    let identify = |arguments: &[&str]| damprig(&folder).args(["identify", "contact"]).args(arguments).assert().code(2);
    identify(&["flat.csv"]).stderr(contains("flat.csv").and(contains("no whole pulse")));
    identify(&["flat.csv", "--set-up", "a"]).stderr(contains("is for a run"));
    identify(&["nothing.csv"]).stderr(contains("nothing.csv"));
}
