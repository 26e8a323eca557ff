//! x and z over time: fn and ζ against the truth of the virtual rig and of closed forms; H1, coherence, and refusals.

use std::f64::consts::TAU;
use std::fmt::Write;

use damprig::identify::time_response::{Motion, TimeResponse, Wanted, identify};
use damprig::motion_record::Noise;
use damprig_core::io::Actuators;
use damprig_core::model::{SetUp, Structure};
use damprig_simulator::plant::{DataSheet, Plant, PlantConfig, SensorModel};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use super::{Claim, few_seeds};
use crate::common::{damprig, is_full};

/// x and z of the virtual rig under noise of 2 mm, every fifth tick.
fn record(zeta: f64, seconds: f64, seed: u64, sensors: SensorModel, data_sheet: Option<DataSheet>) -> Motion {
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, zeta));
    let config = PlantConfig { sensors, data_sheet, ..PlantConfig::ideal(set_up) };
    let mut plant = Plant::<f64>::new(&config).unwrap();
    let noise = Noise { seed, from_hz: 0.5, to_hz: 10.0, duration_s: seconds, rise_s: 2.0, fall_s: 2.0 };
    let mut motion = Motion { taken_from: "the rig".into(), step_s: 5e-3, x_m: vec![], z_m: vec![] };
    for (tick, z) in noise.record(1000.0, 2e-3).samples.into_iter().enumerate() {
        let sensors = plant.tick(&Actuators { drive_m: z as f32, drive_enabled: true, ..Actuators::default() });
        if tick % 5 == 0 {
            motion.x_m.push(f64::from(sensors.readings.x.mean_m));
            motion.z_m.push(f64::from(sensors.readings.z.mean_m));
        }
    }
    motion
}

/// 16 bit over ±80 mm, 30 µm RMS per reading of 1 kHz.
fn ideal(seed: u64) -> (SensorModel, Option<DataSheet>) {
    let noise_rms_m = (30e-6 * 10f64.sqrt()) as f32;
    (SensorModel { range_m: [0.08; 2], resolution_m: 0.16 / 65536.0, noise_rms_m, seed }, None)
}

fn data_sheet(seed: u64) -> (SensorModel, Option<DataSheet>) {
    (SensorModel { seed, ..SensorModel::default() }, Some(DataSheet::default()))
}

/// A record is as long as a person waits: 3.5 time constants at ζ = 0.0038.
#[test]
fn a_minute_of_noise_gives_frequency_and_damping_with_intervals_that_cover_the_truth() {
    type Sensors = fn(u64) -> (SensorModel, Option<DataSheet>);
    let all: [(&str, Sensors); 2] = [("ideal", ideal), ("data sheet", data_sheet)];
    for (name, sensors) in all {
        for zeta in [0.0038, 0.02] {
            let (mut frequency, mut damping) = (Claim::default(), Claim::default());
            for seed in 1..=few_seeds() {
                let (model, sheet) = sensors(seed);
                let found = identify(&record(zeta, 60.0, seed, model, sheet), Wanted::default())
                    .unwrap_or_else(|error| panic!("{name}, ζ = {zeta}, seed {seed}: {error}"));
                frequency.note(&found.fitted.natural_frequency_hz, 2.5);
                damping.note(&found.fitted.damping_ratio, zeta);
                // Segments of 12 s do not resolve half-power widths of 0.019 Hz and 0.1 Hz.
                assert!(found.by_h1.is_err(), "{name}, ζ = {zeta}, seed {seed}");
            }
            println!(
                "{name}, ζ = {zeta}: fn RMS {:.2e} Hz, covered {:.3}; ζ RMS {:.2e} = {:.2} %, covered {:.3}",
                frequency.rms(),
                frequency.coverage(),
                damping.rms(),
                100.0 * damping.rms() / zeta,
                damping.coverage()
            );
            assert!(frequency.rms() < 1e-3 && damping.rms() < 0.02 * zeta, "{name}, ζ = {zeta}");
            frequency.assert_covers(&format!("{name}, ζ = {zeta}: fn"));
            damping.assert_covers(&format!("{name}, ζ = {zeta}: ζ"));
        }
    }
}

/// A record of less than 100 periods is shorter than five segments of 20 periods.
#[test]
fn a_record_of_few_periods_is_answered_without_h1() {
    for seconds in [20.0, 38.0] {
        let (model, sheet) = ideal(1);
        let found = identify(&record(0.02, seconds, 1, model, sheet), Wanted::default());
        let found = found.unwrap_or_else(|error| panic!("{seconds} s: {error}"));
        assert!(found.by_h1.is_err(), "{seconds} s");
    }
}

/// Segments of 24 s resolve a half-power width of 0.25 Hz: H1 gives the same by other means.
#[test]
fn h1_of_a_long_record_agrees_with_the_fit_over_time() {
    let (mut frequency, mut damping) = (Claim::default(), Claim::default());
    for seed in 1..=(if is_full() { 100 } else { 3 }) {
        let (model, sheet) = ideal(seed);
        let found = identify(&record(0.05, 240.0, seed, model, sheet), Wanted::default()).unwrap();
        let by_h1 = found.by_h1.as_ref().unwrap_or_else(|why| panic!("{why}"));
        for (claim, estimate, truth) in [(&mut frequency, &by_h1[0], 2.5), (&mut damping, &by_h1[1], 0.05)] {
            let [low, high] = estimate.interval_95;
            claim.covered += usize::from((low..=high).contains(&truth));
            claim.errors.push(estimate.value - truth);
        }
        let line = found.spectrum.nearest(2.5).unwrap();
        assert!(line.coherence > 0.9 && (line.magnitude() * 0.1 - 1.0).abs() < 0.1, "{line:?}");
    }
    println!(
        "H1, ζ = 0.05, 240 s: fn RMS {:.2e} Hz, covered {:.3}; ζ RMS {:.2e}, covered {:.3}",
        frequency.rms(),
        frequency.coverage(),
        damping.rms(),
        damping.coverage()
    );
    assert!(frequency.rms() < 0.01 && damping.rms() < 0.05 * 0.05);
    // The bias of the window is in the interval, so it may cover more often than it says.
    assert!(frequency.coverage() >= 0.9 && damping.coverage() >= 0.9);
}

/// A disturbance of the structure passes through it as the base's motion does: its noise is narrow at the resonance. The interval
/// is of that noise, not of white noise, which would be thirty times narrower.
#[test]
fn a_disturbance_of_the_structure_widens_the_interval() {
    let zeta = 0.0038;
    let mut damping = Claim::default();
    for seed in 1..=few_seeds() {
        let (model, sheet) = data_sheet(seed);
        let mut motion = record(zeta, 60.0, seed, model, sheet);
        // White force noise through the structure, one step of 5 ms after the other.
        let mut random = fastrand::Rng::with_seed(seed);
        let (omega, h) = (TAU * 2.5, motion.step_s);
        let damped = omega * (1.0f64 - zeta * zeta).sqrt();
        let (decay, turn) = ((-zeta * omega * h).exp(), damped * h);
        let (mut before, mut now) = (0.0, 0.0);
        for x in &mut motion.x_m {
            let pushed = 2e-7 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            (before, now) = (now, 2.0 * decay * turn.cos() * now - decay * decay * before + pushed);
            *x += now;
        }
        let found = identify(&motion, Wanted::default()).unwrap();
        assert!(found.fitted.noise_at_resonance > 0.5, "{:?}", found.fitted);
        assert!(found.remarks().iter().any(|remark| remark.contains("at the resonance")));
        damping.note(&found.fitted.damping_ratio, zeta);
    }
    println!("disturbed: ζ RMS {:.2e}, covered {:.3}", damping.rms(), damping.coverage());
    damping.assert_covers("disturbed: ζ");
}

/// Sines of the base and the steady motion of the structure in closed form, with this factor on x.
fn sines(zeta: f64, seconds: f64, bands: &[(f64, f64)], factor: f64) -> Vec<[f64; 3]> {
    let lines: Vec<f64> = bands
        .iter()
        .flat_map(|(from, to)| (0..40).map(move |n| from + (to - from) * (f64::from(n) + 0.5) / 40.0))
        .collect();
    (0..(seconds * 100.0) as u32)
        .map(|n| {
            let t = f64::from(n) * 0.01;
            let mut row = [t, 0.0, 0.0];
            for (place, f) in lines.iter().enumerate() {
                let phase = TAU * (f * t + (place * place) as f64 * 0.37);
                let (r, d) = (f / 2.5, 2.0 * zeta * f / 2.5);
                let square = (1.0 - r * r).powi(2) + d * d;
                let (re, im) = ((1.0 - r * r + d * d) / square, (d * (1.0 - r * r) - d) / square);
                row[1] += 1e-4 * factor * (re * phase.cos() - im * phase.sin());
                row[2] += 1e-4 * phase.cos();
            }
            row
        })
        .collect()
}

fn csv(rows: &[[f64; 3]]) -> String {
    let mut text = "t_s,x_m,z_m\n".to_string();
    for [t, x, z] in rows {
        writeln!(text, "{t:.3},{x:.9},{z:.9}").unwrap();
    }
    text
}

#[test]
fn a_table_of_a_motion_in_closed_form_gives_its_parameters_and_a_picture() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("motion.csv"), csv(&sines(0.01, 60.0, &[(0.5, 6.0)], 1.01))).unwrap();
    let output = damprig(&folder)
        .args(["identify", "response", "motion.csv", "--json", "--plot", "response.svg", "--out", "identified.toml"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // Cubics between samples of 10 ms miss (Ωh)³/50 of the base: 8e-5 at fn.
    for (place, truth, allowed) in [(0, 2.5, 1e-4), (1, 0.01, 1e-4)] {
        let value = answer["estimates"][place]["value"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < allowed * if place == 0 { 1.0 } else { 50.0 }, "{answer}");
    }
    assert!(answer["remarks"][0].as_str().unwrap().contains("the scale 1.01"), "{answer}");
    let picture = std::fs::read_to_string(folder.path().join("response.svg")).unwrap();
    for words in ["Coherence", "Phase", "Frequency (Hz)", "fitted structure"] {
        assert!(picture.contains(words), "{words}");
    }
    let again = ["identify", "response", "motion.csv", "--plot", "response.svg"];
    damprig(&folder).args(again).assert().code(2).stderr(contains("response.svg: it exists").and(contains("--force")));
    damprig(&folder).args(again).arg("--force").assert().success();
    let values: toml::Table = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap().parse().unwrap();
    assert!(values["structure"].get("damping_ratio").is_some());
}

#[test]
fn a_motion_without_a_response_is_refused_in_words_of_the_experiment() {
    let folder = TempDir::new().unwrap();
    let refused = |text: &str, more: &[&str], says: &[&str]| {
        std::fs::write(folder.path().join("motion.csv"), text).unwrap();
        let output = damprig(&folder)
            .args(["identify", "response", "motion.csv"])
            .args(more)
            .assert()
            .code(2)
            .get_output()
            .clone();
        let message = String::from_utf8(output.stderr).unwrap();
        for part in says {
            assert!(message.contains(part), "{part:?} is not in:\n{message}");
        }
    };
    let whole = sines(0.01, 60.0, &[(0.5, 6.0)], 1.0);
    let mut gap = whole.clone();
    gap.drain(2000..2050);
    refused(&csv(&gap), &[], &["a gap of 0.51", "a file of its own"]);
    let still: Vec<_> = whole.iter().map(|row| [row[0], row[1], 0.0]).collect();
    refused(&csv(&still), &[], &["z does not move", "was the drive on?"]);
    let mut random = fastrand::Rng::with_seed(1);
    let foreign: Vec<_> = whole.iter().map(|row| [row[0], 1e-3 * (random.f64() - 0.5), row[2]]).collect();
    refused(&csv(&foreign), &[], &["x does not follow z", "of different records"]);
    refused(
        &csv(&sines(0.01, 60.0, &[(4.0, 8.0)], 1.0)),
        &[],
        &["there is no resonance where the base moves", "excite a band"],
    );
    refused(&csv(&whole[..150]), &[], &["is too short", "record longer"]);
    refused(&csv(&whole), &["--segment-s", "100"], &["a segment of 100 s does not fit", "--segment-s"]);
    refused(&csv(&whole), &["--overlap", "1"], &["--overlap", "from 0 to 0.9"]);
    refused("frequency_hz,x_m,z_m\n2,1e-3,1e-3\n", &["--segment-s", "1"], &["--segment-s is for x and z over time"]);
    // Two masses: another resonance in x.
    let other = sines(0.01, 60.0, &[(0.5, 6.0)], 1.0).into_iter().zip(sines(0.01, 60.0, &[(0.5, 6.0)], 1.0));
    let two: Vec<_> =
        other.enumerate().map(|(n, (a, b))| [a[0], a[1] + b[1] * (n as f64 * 0.05).sin(), a[2]]).collect();
    refused(&csv(&two), &[], &["is not that of one mass", "is a damper mounted"]);
}

/// The shipped campaign, as a person would use it.
#[test]
fn the_shipped_campaign_of_noise_identifies_its_structure() {
    let folder = TempDir::new().unwrap();
    let campaign = concat!(env!("CARGO_MANIFEST_DIR"), "/campaigns/noise.toml");
    damprig(&folder).args(["run", campaign, "--out", "noise"]).assert().success();
    let output = damprig(&folder).args(["identify", "response", "noise", "--json"]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(answer["taken_from"].as_str().unwrap().contains("set-up \"bare\", experiment \"noise\""));
    for (place, truth) in [(0, 2.5), (1, 0.0038)] {
        let ends = &answer["estimates"][place]["interval_95"];
        let (low, high) = (ends[0].as_f64().unwrap(), ends[1].as_f64().unwrap());
        let middle = 0.5 * (low + high);
        assert!((middle - truth).abs() < 1.5 * (high - low) && high - low < 0.01 * truth, "{answer}");
    }
    // A run without what is needed.
    let release = "name = \"r\"\nstructure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.01 }\n[[set_up]]\nname = \"s\"\n\
                   base_amplitude_m = 1e-3\n[[experiment]]\nkind = \"free_vibration\"\nstart_m = 0.03\nmeasure_s = 2\n";
    std::fs::write(folder.path().join("release.toml"), release).unwrap();
    damprig(&folder).args(["run", "release.toml", "--out", "release"]).assert().success();
    damprig(&folder)
        .args(["identify", "response", "release"])
        .assert()
        .code(2)
        .stderr(contains("the run has no stepped sine or playback"));
}

/// The estimates of the fit over time are the keys; those of H1 are for comparison.
#[test]
fn only_the_fit_over_time_gives_keys() {
    let (model, sheet) = ideal(1);
    let found: TimeResponse = identify(&record(0.05, 240.0, 1, model, sheet), Wanted::default()).unwrap();
    let keys: Vec<_> = found.estimates().iter().map(|estimate| estimate.key).collect();
    let of_keys = [Some("structure.natural_frequency_hz"), Some("structure.damping_ratio"), None, None];
    assert_eq!(keys, of_keys);
}
