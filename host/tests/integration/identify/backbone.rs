//! Damping ratio and frequency over the amplitude: against closed forms, and against a real beam.

use damprig::identify::Sensors;
use damprig::identify::backbone::{Backbone, Row};
use damprig::identify::decay::{DecayModel, identify};

use super::nonlinear::{LINEAR, Noise, Oscillator};
use super::{Claim, seeds};
use crate::common::{damprig, field, folder_with};

const NOISE_M: f64 = 30e-6;
const USUAL: DecayModel = DecayModel { coulomb: true, sensors: Sensors::EXACT };

fn backbone(t_s: &[f64], x_m: &[f64]) -> Backbone {
    identify(t_s, x_m, USUAL).unwrap().backbone.expect("windows")
}

/// The intervals include the curvature of ζ(a) and of what windows leave, so that they cover the truth in 95 % or more.
#[test]
fn intervals_over_the_amplitude_cover_the_closed_forms() {
    let oscillators = [
        ("viscous", LINEAR, 12.0),
        ("air", Oscillator { air_per_m: 2.0, ..LINEAR }, 15.0),
        ("strong air", Oscillator { air_per_m: 5.0, damping_ratio: 0.03, ..LINEAR }, 6.0),
        ("friction", Oscillator { coulomb_m: 2e-4, ..LINEAR }, 12.0),
        ("stiffening", Oscillator { cubic_per_m2: 10.0, damping_ratio: 0.01, ..LINEAR }, 12.0),
        ("softening", Oscillator { cubic_per_m2: -10.0, damping_ratio: 0.01, air_per_m: 1.0, ..LINEAR }, 12.0),
    ];
    for (name, oscillator, seconds) in oscillators {
        let (t_s, exact_m) = oscillator.release(seconds);
        let (mut damping, mut frequency) = (Claim::default(), Claim::default());
        let mut fewest = usize::MAX;
        for seed in 1..=seeds() {
            let found = backbone(&t_s, &Noise::new(seed).added(&exact_m, NOISE_M));
            fewest = fewest.min(found.windows.len());
            for window in &found.windows {
                damping.note(&window.damping_ratio, oscillator.damping_ratio_at(window.amplitude_m));
                frequency.note(&window.natural_frequency_hz, oscillator.frequency_hz_at(window.amplitude_m));
            }
        }
        println!(
            "{name}: at least {fewest} windows; ζ RMS {:.1e}, covered {:.3}; fn RMS {:.1e} Hz, covered {:.3}",
            damping.rms(),
            damping.coverage(),
            frequency.rms(),
            frequency.coverage()
        );
        assert!(fewest >= 3, "{name}: {fewest}");
        // One in a thousand at a true coverage of 95 %; the windows of a record share the estimate of their noise.
        for (what, claim) in [("ζ", damping), ("fn", frequency)] {
            let least = 0.95 - 3.1 * (0.95 * 0.05 / claim.errors.len() as f64).sqrt();
            assert!(claim.coverage() >= least, "{name}, {what}: {:.3} of {}", claim.coverage(), claim.errors.len());
        }
    }
}

/// Without noise the windows show ζ(a) to its curvature, and the amplitudes span those of the record.
#[test]
fn windows_without_noise_follow_the_closed_form_over_the_whole_record() {
    let oscillator = Oscillator { air_per_m: 2.0, ..LINEAR };
    let (t_s, x_m) = oscillator.release(15.0);
    let windows = backbone(&t_s, &x_m).windows;
    for window in &windows {
        let truth = oscillator.damping_ratio_at(window.amplitude_m);
        assert!((window.damping_ratio.value / truth - 1.0).abs() < 5e-3, "{window:?}: {truth}");
    }
    assert!(windows[0].amplitude_m > 0.75 * 0.035 && windows.last().unwrap().amplitude_m < 0.1 * 0.035);
}

/// Mean of a window's value over a time as a least-squares fit weighs it: by K(t) = ∫ (s − s̄)·a².
fn weighted(rows: &[Row], from_s: f64, to_s: f64, of: fn(&Row) -> f64) -> f64 {
    let middle = |row: &Row| 0.5 * (row.from_s + row.to_s);
    let at = |t_s: f64, of: &dyn Fn(&Row) -> f64| {
        let after = rows.partition_point(|row| middle(row) < t_s).clamp(1, rows.len() - 1);
        let (a, b) = (&rows[after - 1], &rows[after]);
        of(a) + (t_s - middle(a)) / (middle(b) - middle(a)) * (of(b) - of(a))
    };
    let times: Vec<f64> = (0..1000).map(|n| from_s + (f64::from(n) + 0.5) * (to_s - from_s) / 1000.0).collect();
    let squares: Vec<f64> = times.iter().map(|t| at(*t, &|row| row.amplitude_m.ln()).exp().powi(2)).collect();
    let centre = times.iter().zip(&squares).map(|(t, w)| t * w).sum::<f64>() / squares.iter().sum::<f64>();
    let (mut kernel, mut all, mut sum) = (0.0, 0.0, 0.0);
    for (t, square) in times.iter().zip(&squares) {
        kernel += (centre - t) * square;
        all += kernel;
        sum += kernel * at(*t, &of);
    }
    sum / all
}

/// Published for the beam: fits of a viscous motion to two parts of the record, rounded to the digits below. Their times count from 0.5 s before the
/// first row of the file.
#[test]
fn the_damping_over_amplitude_of_a_real_beam_passes_through_its_published_values() {
    let Some(file) = field("beam/decay-aluminium.csv") else { return };
    let folder = folder_with("");
    let output = damprig(&folder).args(["identify", "decay", "--json"]).arg(&file).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    let rows: Vec<Row> = answer["over_amplitude"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| Row {
            from_s: number(row, "from_s"),
            to_s: number(row, "to_s"),
            amplitude_m: number(row, "amplitude_m"),
            damping_ratio: number(row, "damping_ratio"),
            damping_ratio_standard_uncertainty: number(row, "damping_ratio_standard_uncertainty"),
            damping_ratio_interval_95: [0.0; 2],
            natural_frequency_hz: number(row, "natural_frequency_hz"),
            natural_frequency_standard_uncertainty_hz: number(row, "natural_frequency_standard_uncertainty_hz"),
            natural_frequency_interval_95_hz: [0.0; 2],
        })
        .collect();
    const BEFORE_S: f64 = 0.5;
    for (from_s, to_s, zeta, hertz) in [(1.0, 3.0, 0.0071, 6.857), (1.0, 6.0, 0.0064, 6.866)] {
        let of = |of| weighted(&rows, from_s - BEFORE_S, to_s - BEFORE_S, of);
        let (own_zeta, own_hertz) = (of(|row| row.damping_ratio), of(|row| row.natural_frequency_hz));
        println!("{from_s} s to {to_s} s: ζ {own_zeta:.5} for {zeta}, fn {own_hertz:.4} Hz for {hertz} Hz");
        // Half of the last digit, and two standard uncertainties of a window.
        assert!((own_zeta - zeta).abs() < 0.5e-4 + 4e-5, "{own_zeta}");
        assert!((own_hertz - hertz).abs() < 0.5e-3 + 3e-4, "{own_hertz}");
    }
    // Both methods count a friction that is not there as none, and the first line names what does not fit.
    let misfits = answer["lack_of_fit"].to_string();
    assert!(misfits.contains("the damping ratio rises with the amplitude"), "{misfits}");
    assert!(misfits.contains("the frequency falls with the amplitude"), "{misfits}");
    for estimate in answer["estimates"].as_array().unwrap() {
        assert!(!estimate["quantity"].as_str().unwrap().contains("friction over"), "{estimate}");
        let [low, high] = [0, 1].map(|end| number_at(estimate, end));
        let of = |row: &Row| if estimate["unit"] == "Hz" { row.natural_frequency_hz } else { row.damping_ratio };
        // The intervals cover what every window shows; 1 % is more than the noise of a window.
        assert!(rows.iter().all(|row| low < of(row) * 1.01 && of(row) < high * 1.01), "{estimate}");
    }
    let text = damprig(&folder).args(["identify", "decay"]).arg(&file).output().unwrap().stdout;
    assert!(text.starts_with(b"Lack of fit: the damping ratio rises"), "{}", String::from_utf8_lossy(&text));
}

fn number_at(estimate: &serde_json::Value, end: usize) -> f64 {
    estimate["interval_95"][end].as_f64().unwrap()
}
