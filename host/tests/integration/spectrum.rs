//! `damprig spectrum`: closed forms, and the published values of two agencies.

use std::f64::consts::{PI, TAU};

use damprig::input::Files;
use damprig::motion_record::{Record, RecordOrigin, RecordQuantity, Spec, read};
use damprig::spectrum::{PeakMethod, SpectrumPoint, periods, spectra};

use crate::common::{damprig, field, folder_with};

fn record(step_s: f64, samples: Vec<f64>) -> Record {
    Record { origin: RecordOrigin::Samples, quantity: RecordQuantity::Acceleration, step_s, samples, resampling: None }
}

fn one(record: &Record, zeta: f64, period_s: f64, method: PeakMethod) -> SpectrumPoint {
    spectra(record, &[zeta], &[period_s], method).unwrap()[0]
}

/// A constant acceleration from rest: u overshoots −a/ω² by e^(−πζ/√(1−ζ²)). The peak is between the samples. It lasts until the damped oscillations
/// have decayed, so that its end adds nothing.
#[test]
fn a_step_of_the_ground_gives_the_overshoot_of_the_closed_form() {
    let step = record(0.07, vec![2.0; 2000]);
    for (zeta, period_s) in [(0.0, 0.5), (0.05, 0.5), (0.2, 0.11), (0.05, 0.03)] {
        let omega = TAU / period_s;
        let found = one(&step, zeta, period_s, PeakMethod::Exact);
        let root = (1.0 - zeta * zeta).sqrt();
        let overshoot = 1.0 + (-PI * zeta / root).exp();
        let sd_m = 2.0 / (omega * omega) * overshoot;
        // Without damping the free oscillation after the record adds to the step: up to twice the overshoot.
        assert!(found.sd_m >= sd_m * (1.0 - 1e-12) && found.sd_m <= 2.0 * sd_m, "{zeta}, {period_s}: {found:?}");
        if zeta > 0.0 {
            assert!((found.sd_m / sd_m - 1.0).abs() < 1e-11, "{zeta}, {period_s}: {} for {sd_m}", found.sd_m);
            // v is largest where v′ = 0: e^(−ζ·acos(ζ)/√(1−ζ²))·a/ω.
            let sv = 2.0 / omega * (-zeta * zeta.acos() / root).exp();
            assert!((found.sv_m_per_s / sv - 1.0).abs() < 1e-11, "{zeta}, {period_s}: {} for {sv}", found.sv_m_per_s);
        }
        assert!((found.psa_m_per_s2 / (omega * omega * found.sd_m) - 1.0).abs() < 1e-12);
        assert!((found.psv_m_per_s / (omega * found.sd_m) - 1.0).abs() < 1e-12);
        assert!(one(&step, zeta, period_s, PeakMethod::AtSamples).sd_m <= found.sd_m);
    }
}

/// Very stiff oscillators follow the ground, very soft ones stay where they are.
#[test]
fn the_ends_of_the_spectrum_are_the_ground_s_own_peaks() {
    // One cycle of 1 m/s² at 1 Hz; z = (2πt − sin 2πt)/4π² ends at 1/2π m.
    let sine = record(1e-3, (0..=1000).map(|n| (TAU * f64::from(n) * 1e-3).sin()).collect());
    let stiff = one(&sine, 0.05, 1e-3, PeakMethod::Exact);
    assert!((stiff.sa_m_per_s2 - 1.0).abs() < 1e-4, "{stiff:?}");
    let soft = one(&sine, 0.0, 1e4, PeakMethod::AtSamples);
    assert!((soft.sd_m * TAU - 1.0).abs() < 1e-4, "{soft:?}");
    assert!((soft.sv_m_per_s - 1.0 / PI).abs() < 1e-4, "{soft:?}");
}

/// Without damping the true acceleration is the pseudo one.
#[test]
fn without_damping_true_and_pseudo_acceleration_are_the_same() {
    let mut random = fastrand::Rng::with_seed(7);
    let noise = record(0.01, (0..2000).map(|_| random.f64() - 0.5).collect());
    for point in spectra(&noise, &[0.0], &periods(0.004, 8.0, 60), PeakMethod::Exact).unwrap() {
        assert!((point.sa_m_per_s2 / point.psa_m_per_s2 - 1.0).abs() < 1e-9, "{point:?}");
    }
}

/// The search between the samples finds what a fine sampling of the same motion finds, and never less.
#[test]
fn maxima_between_samples_are_those_of_a_fine_sampling() {
    let mut random = fastrand::Rng::with_seed(3);
    let coarse: Vec<f64> = (0..300).map(|_| random.f64() - 0.5).collect();
    let fine: Vec<f64> = (0..299 * 200)
        .map(|n| {
            let (at, share) = (n / 200, f64::from(n as u32 % 200) / 200.0);
            coarse[at] + share * (coarse[at + 1] - coarse[at])
        })
        .chain([coarse[299]])
        .collect();
    for (zeta, period_s) in [(0.0, 0.015), (0.05, 0.013), (0.05, 0.1), (0.2, 1.0)] {
        let between = one(&record(0.02, coarse.clone()), zeta, period_s, PeakMethod::Exact);
        let sampled = one(&record(1e-4, fine.clone()), zeta, period_s, PeakMethod::AtSamples);
        let after_too = one(&record(1e-4, fine.clone()), zeta, period_s, PeakMethod::Exact);
        // A maximum is missed by up to (ω·h)²/8 of it: 3e-4 at the shortest period.
        let missed = (TAU / period_s * 1e-4).powi(2) / 8.0;
        for (a, b, c) in [
            (between.sd_m, sampled.sd_m, after_too.sd_m),
            (between.sv_m_per_s, sampled.sv_m_per_s, after_too.sv_m_per_s),
            (between.sa_m_per_s2, sampled.sa_m_per_s2, after_too.sa_m_per_s2),
        ] {
            assert!(a >= b * (1.0 - 1e-9), "{zeta}, {period_s}: {a} for {b}");
            assert!((a / c - 1.0).abs() < missed + 1e-9, "{zeta}, {period_s}: {a} for {c}");
        }
    }
}

/// Published values of a folder, each with ours by the agency's method and exactly: relative deviations.
fn deviations(folder: &str, method: PeakMethod) -> Option<Vec<(String, f64, f64)>> {
    let published = std::fs::read_to_string(field(&format!("{folder}/published-sd.csv"))?).unwrap();
    let mut all = Vec::new();
    let mut records = std::collections::HashMap::new();
    for line in published.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let record = records.entry(fields[0].to_string()).or_insert_with(|| {
            // The columns are acceleration_m_per_s2 and acceleration_g.
            let spec = Spec { quantity: Some(RecordQuantity::Acceleration), ..Spec::default() };
            read(&field(&format!("{folder}/{}.csv", fields[0])).unwrap(), &spec, &Files::default()).unwrap()
        });
        let [period_s, zeta, published_m] = [1, 2, 3].map(|place| fields[place].parse::<f64>().unwrap());
        let deviation = |method| one(record, zeta, period_s, method).sd_m / published_m - 1.0;
        all.push((line.to_string(), deviation(method), deviation(PeakMethod::Exact)));
    }
    Some(all)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// California's agency takes the maxima at the samples of its records.
#[test]
fn the_values_of_the_california_program_are_met_at_the_samples() {
    let Some(all) = deviations("csmip", PeakMethod::AtSamples) else { return };
    println!(
        "{} values: at samples within {:.2} %, exactly within {:.2} %",
        all.len(),
        100.0 * largest(all.iter().map(|value| value.1)),
        100.0 * largest(all.iter().map(|value| value.2))
    );
    for (line, at_samples, _) in &all {
        assert!(at_samples.abs() < 0.01, "{line}: {:.2} %", 100.0 * at_samples);
    }
    assert_eq!(all.len(), 120);
}

/// The FEMA P-695 values are those of Newmark's average acceleration in steps of half a sample, within the digits of the published ones; their error is
/// 10 % at 0.1 s and a step of 0.02 s.
#[test]
fn the_fema_values_are_those_of_newmark_s_average_acceleration_in_half_steps() {
    let Some(all) = deviations("fema", PeakMethod::Newmark) else { return };
    println!(
        "{} values: by Newmark within {:.2} %, exactly within {:.2} %",
        all.len(),
        100.0 * largest(all.iter().map(|value| value.1)),
        100.0 * largest(all.iter().map(|value| value.2))
    );
    for (line, by_newmark, _) in &all {
        assert!(by_newmark.abs() < 1e-3, "{line}: {:.3} %", 100.0 * by_newmark);
    }
    assert_eq!(all.len(), 564);
}

/// The agency's file and its copy as CSV, which has fewer digits, have the same spectrum.
#[test]
fn a_v2_file_gives_the_spectrum_of_its_accelerations() {
    let (Some(v2), Some(csv)) = (field("csmip/CHAN14.V2"), field("csmip/melo79-ch14-up.csv")) else { return };
    let folder = folder_with("");
    let sd = |file: &std::path::Path| -> Vec<f64> {
        let output =
            damprig(&folder).arg("spectrum").arg(file).args(["--json", "--periods", "0.1,1"]).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        answer["spectra"].as_array().unwrap().iter().map(|point| point["sd_m"].as_f64().unwrap()).collect()
    };
    for (a, b) in sd(&v2).iter().zip(sd(&csv)) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} for {b}");
    }
}

#[test]
fn the_command_writes_table_and_figure_and_refuses_what_it_cannot_use() {
    let folder = folder_with("");
    let rows: String = (0..200).map(|n| format!("{},{}\n", 0.01 * f64::from(n), (0.3 * f64::from(n)).sin())).collect();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("quake.csv", format!("t_s,acceleration_m_per_s2\n{rows}"));
    write("named.csv", format!("t_s,acceleration\n{rows}"));
    write("cut.V2", "\n    9 POINTS OF ACCEL DATA EQUALLY SPACED AT .01 SEC. (UNITS: CM/SEC/SEC)\n     1.000\n".into());
    let run = |arguments: &[&str]| damprig(&folder).arg("spectrum").args(arguments).output().unwrap();
    let files = ["quake.csv", "--damping", "0,0.05", "--out", "s.csv", "--plot", "s.svg"];
    let output = run(&files);
    assert!(output.status.success(), "{output:?}");
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(text("s.csv").starts_with("damping_ratio,period_s,sd_m,sv_m_per_s,sa_m_per_s2,psv_m_per_s,psa_m_per_s2"));
    assert_eq!(text("s.csv").lines().count(), 1 + 2 * 200);
    // Two ratios: displacement, and velocity and acceleration with their pseudo values.
    assert_eq!(text("s.svg").matches("stroke-width=\"1.8\"").count(), 2 * 5);
    assert!(run(&["named.csv", "--unit", "g", "--json", "--method", "newmark"]).status.success());
    for (arguments, words) in [
        (&files[..], "s.csv: it exists"),
        (&["named.csv"], "--unit"),
        (&["named.csv", "--unit", "inch"], "must be a unit such as m/s2, g"),
        (&["absent.csv"], "absent.csv"),
        (&["cut.V2"], "line 2: 9 values are announced, 1 follow"),
        (&["quake.csv", "--damping", "1"], "from 0 to below 1"),
        (&["quake.csv", "--periods", "2:1:9"], "must be less than"),
        (&["quake.csv", "--periods", "0"], "greater than 0"),
        (&["quake.csv", "--out", "s.xls"], ".csv or .parquet"),
    ] {
        let output = run(arguments);
        let error = String::from_utf8_lossy(&output.stderr).to_string();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
}
