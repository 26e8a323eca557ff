//! Frequency responses of files: every form gives the same mode, an analyser's file gives what its values say, and bad files are refused.

use std::f64::consts::TAU;
use std::fmt::Write;

use damprig::signal_file::read;
use damprig_fourier::Complex;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{damprig, field};

const NATURAL_HZ: f64 = 12.5;
const ZETA: f64 = 0.01;
const MASS_KG: f64 = 4.0;

/// Accelerance of a mass on a spring, (m/s²)/N, closed form.
fn accelerance(hz: f64) -> Complex<f64> {
    let (natural, omega) = (TAU * NATURAL_HZ, TAU * hz);
    Complex::from(-omega * omega / MASS_KG)
        / Complex::new(natural * natural - omega * omega, 2.0 * ZETA * natural * omega)
}

fn frequencies() -> impl Iterator<Item = f64> {
    (0..160).map(|n| 8.0 + 0.0625 * f64::from(n))
}

/// A table with these columns after the frequencies.
fn table<const COLUMNS: usize>(header: &str, row: impl Fn(f64, Complex<f64>) -> [f64; COLUMNS]) -> String {
    let mut text = format!("{header}\n");
    for hz in frequencies() {
        let values: Vec<String> = row(hz, accelerance(hz)).iter().map(|value| format!("{value:.12e}")).collect();
        writeln!(text, "{hz},{}", values.join(",")).unwrap();
    }
    text
}

/// A dataset 58 of function type `function`, complex double precision at even frequencies.
fn dataset_58(function: u32, motion: &str, force: &str, values: impl Iterator<Item = Complex<f64>>) -> String {
    let axis = |kind: u32, label: &str, unit: &str| format!("{kind:>10}    0    0    0 {label:<20} {unit:<20}\n");
    let mut text = format!(
        "    -1\n    58\nbeam\nNONE\nNONE\nNONE\nNONE\n{function:>5}         0    0         0 NONE               1   1 NONE               1   1\n         6\
         {:>10}         1  8.00000E+00  6.25000E-02  0.00000E+00\n",
        160
    );
    text +=
        &(axis(18, "Frequency", "Hz") + &axis(12, "H", motion) + &axis(13, "Force", force) + &axis(0, "NONE", "NONE"));
    for value in values {
        writeln!(text, "{:>20.11e}{:>20.11e}", value.re, value.im).unwrap();
    }
    text + "    -1\n"
}

fn answer(folder: &TempDir, arguments: &[&str]) -> Value {
    let output = damprig(folder).args(["identify", "response"]).args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn value(answer: &Value, quantity: &str) -> f64 {
    let one = answer["estimates"].as_array().unwrap().iter().find(|one| one["quantity"] == quantity);
    one.unwrap_or_else(|| panic!("no {quantity}: {answer}"))["value"].as_f64().unwrap()
}

#[test]
fn every_form_of_a_frequency_response_gives_the_same_mode() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let receptance = |hz: f64, h: Complex<f64>| -h / (TAU * hz).powi(2);
    let mobility = |hz: f64, h: Complex<f64>| h / Complex::new(0.0, TAU * hz);
    write("parts.csv", &table("frequency_hz,h_real_m_per_s2_per_n,h_imag_m_per_s2_per_n", |_, h| [h.re, h.im]));
    write("g.csv", &table("Frequency (Hz),Re(H) (g/N),Im(H) (g/N)", |_, h| [h.re / 9.80665, h.im / 9.80665]));
    write(
        "phase.csv",
        &table("f_hz,h_mm_per_n,phase_deg,coherence", |hz, h| {
            let own = receptance(hz, h);
            [1e3 * own.norm(), own.arg().to_degrees(), 1.0]
        }),
    );
    write(
        "mobility.csv",
        &table("f_hz,y_re_m_per_s_per_n,y_im_m_per_s_per_n", |hz, h| [mobility(hz, h).re, mobility(hz, h).im]),
    );
    write(
        "stiffness.csv",
        &table("f_hz,k_re_n_per_m,k_im_n_per_m", |hz, h| {
            let own = receptance(hz, h).inv();
            [own.re, own.im]
        }),
    );
    write("unknown.csv", &table("f_hz,h_re,h_im", |_, h| [h.re, h.im]));
    write("analyser.uff", &dataset_58(4, "m/s^2", "N", frequencies().map(accelerance)));
    let mut hdf5 = hdf5_pure::FileBuilder::new();
    let values: Vec<(f64, f64)> = frequencies().map(|hz| (accelerance(hz).re, accelerance(hz).im)).collect();
    hdf5.create_dataset("h_m_per_s2_per_n").with_complex64_data(&values);
    hdf5.create_dataset("f_hz").with_f64_data(&frequencies().collect::<Vec<f64>>());
    hdf5.write(folder.path().join("analyser.h5")).unwrap();
    let all: [&[&str]; 8] = [
        &["parts.csv"],
        &["g.csv"],
        &["phase.csv"],
        &["mobility.csv"],
        &["stiffness.csv"],
        &["unknown.csv", "--unit", "m/s2/N"],
        &["analyser.uff"],
        &["analyser.h5"],
    ];
    for arguments in all {
        let found = answer(&folder, &[arguments, &["--drive-point"]].concat());
        for (quantity, truth) in [
            ("natural frequency", NATURAL_HZ),
            ("damping ratio", ZETA),
            ("modal constant", 1.0 / MASS_KG),
            ("modal mass at the drive point", MASS_KG),
            ("modal stiffness at the drive point", MASS_KG * (TAU * NATURAL_HZ).powi(2)),
        ] {
            assert!((value(&found, quantity) / truth - 1.0).abs() < 1e-6, "{arguments:?}, {quantity}: {found}");
        }
        assert_eq!(found["estimates"][0]["key"], "structure.natural_frequency_hz");
        assert!(found["estimates"].as_array().unwrap().iter().all(|one| one["key"] != "structure.mass_kg"), "{found}");
    }
    // Without --drive-point there is no mass.
    let found = answer(&folder, &["parts.csv"]);
    assert!(!found.to_string().contains("modal mass at"), "{found}");
}

/// An absolute transmissibility of a mass on a spring: X/Z = (1 + 2ζrj)/(1 − r² + 2ζrj), with the participation 1.
#[test]
fn a_transmissibility_gives_its_mode_and_the_participation() {
    let folder = TempDir::new().unwrap();
    let text = table("f_hz,t_re,t_im", |hz, _| {
        let r = hz / NATURAL_HZ;
        let own = Complex::new(1.0, 2.0 * ZETA * r) / Complex::new(1.0 - r * r, 2.0 * ZETA * r);
        [own.re, own.im]
    });
    std::fs::write(folder.path().join("t.csv"), text).unwrap();
    let found = answer(&folder, &["t.csv", "--unit", "g/g"]);
    for (quantity, truth) in [("natural frequency", NATURAL_HZ), ("damping ratio", ZETA), ("modal participation", 1.0)]
    {
        assert!((value(&found, quantity) / truth - 1.0).abs() < 1e-6, "{quantity}: {found}");
    }
    damprig(&folder)
        .args(["identify", "response", "t.csv", "--unit", "g/g", "--drive-point"])
        .assert()
        .code(2)
        .stderr(predicates::str::contains("a transmissibility has no modal mass"));
}

/// A displacement under a random force that is constant between samples; exact steps of the closed form.
#[test]
fn force_and_motion_over_time_give_h1_and_its_mode() {
    let folder = TempDir::new().unwrap();
    let (natural, zeta, mass, step_s) = (TAU * 20.0, 0.02, 2.0, 2e-3);
    let damped = natural * f64::sqrt(1.0 - zeta * zeta);
    let decay = f64::exp(-zeta * natural * step_s);
    let (sine, cosine) = (damped * step_s).sin_cos();
    let mut random = fastrand::Rng::with_seed(77);
    let (mut x, mut v) = (0.0, 0.0);
    let mut text = "t_s,force_N,x_um,a_unknown\n".to_string();
    for n in 0..60_000 {
        let force = (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let noise = 2e-8 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        writeln!(text, "{:.3},{force:.6},{:.6},{:.6}", f64::from(n) * step_s, 1e6 * (x + noise), 1e6 * x).unwrap();
        // About the place at which the spring balances the force.
        let rest = force / (mass * natural * natural);
        let off = x - rest;
        let turned = (v + zeta * natural * off) / damped;
        let next = decay * (off * cosine + turned * sine);
        v = decay
            * ((turned * damped - zeta * natural * off) * cosine - (off * damped + turned * zeta * natural) * sine);
        x = rest + next;
    }
    std::fs::write(folder.path().join("force.csv"), &text).unwrap();
    let found = answer(&folder, &["force.csv#x", "--drive", "force", "--drive-point", "--plot", "h1.svg"]);
    for (place, truth) in [(0, 20.0), (1, zeta)] {
        let one = &found["estimates"][place];
        let ends: Vec<f64> = one["interval_95"].as_array().unwrap().iter().map(|end| end.as_f64().unwrap()).collect();
        assert!(ends[0] < truth && truth < ends[1], "{one}");
        assert!((ends[1] - ends[0]) < 0.2 * truth * if place == 0 { 0.02 } else { 1.0 }, "{one}");
    }
    let own = value(&found, "modal mass at the drive point");
    assert!((own / mass - 1.0).abs() < 0.05, "{own}");
    let remarks = found["remarks"].to_string();
    assert!(remarks.contains("Welch") && remarks.contains("the receptance is fitted"), "{remarks}");
    let picture = std::fs::read_to_string(folder.path().join("h1.svg")).unwrap();
    for words in ["|H| m/N", "Phase", "Residual / u", "Coherence", "Frequency (Hz)", "fitted mode"] {
        assert!(picture.contains(words), "{words}");
    }
    let refused = |arguments: &[&str], says: &[&str]| check_refused(&folder, arguments, says);
    refused(
        &["force.csv#a_unknown", "--drive", "force"],
        &["does not state the unit of \"a_unknown per force\"", "--unit"],
    );
    refused(
        &["force.csv#x", "--drive", "strength"],
        &["--drive strength", "there is no signal \"strength\"", "force.csv#1: force"],
    );
    refused(
        &["force.csv#x", "--drive", "force", "--unit", "m/N"],
        &["the file states the unit", "leave out --unit m/N"],
    );
    refused(
        &["force.csv#x", "--drive", "force", "--coherence", "x"],
        &["--coherence is for a stored frequency response"],
    );
    refused(&["force.csv#x"], &["\"x\" is over time", "--drive"]);
    let short: String = text.lines().take(2500).map(|line| format!("{line}\n")).collect();
    std::fs::write(folder.path().join("short.csv"), short).unwrap();
    refused(&["short.csv#x", "--drive", "force"], &["the lines of H1 are 1.5", "Hz wide", "record longer"]);
}

fn check_refused(folder: &TempDir, arguments: &[&str], says: &[&str]) {
    let output = damprig(folder).args(["identify", "response"]).args(arguments).assert().code(2).get_output().clone();
    let message = String::from_utf8(output.stderr).unwrap();
    for part in says {
        assert!(message.contains(part), "{arguments:?}: {part:?} is not in:\n{message}");
    }
}

#[test]
fn a_bad_frequency_response_is_refused_with_file_signal_and_option() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let refused = |arguments: &[&str], says: &[&str]| check_refused(&folder, arguments, says);
    let good = table("f_hz,h_re_m_per_n,h_im_m_per_n,coherence,early", |_, h| [h.re, h.im, 0.9, 0.0]);
    write("good.csv", &good);
    write("none.csv", &table("f_hz,h_re,h_im", |_, h| [h.re, h.im]));
    refused(&["none.csv"], &["none.csv", "does not state the unit of \"h\"", "--unit", "m/s2/N"]);
    refused(&["none.csv", "--unit", "furlong/N"], &["--unit furlong/N", "allowed are m/N"]);
    refused(&["none.csv", "--unit", "V/N"], &["is voltage per force", "allowed are"]);
    refused(&["good.csv", "--unit", "m/N"], &["the file states the unit \"m_per_n\" of \"h\"", "leave out --unit"]);
    refused(
        &["good.csv", "--frequencies-hz", "early"],
        &["the file states the frequencies", "leave out --frequencies-hz early"],
    );
    refused(&["good.csv", "--coherence", "coh"], &["--coherence coh", "there is no signal \"coh\"", "coherence"]);
    refused(&["good.csv", "--coherence", "h"], &["--coherence h", "is complex", "a real number from 0 to 1"]);
    refused(&["good.csv", "--coherence", "early"], &["--coherence early: no line has a coherence above 0"]);
    refused(&["good.csv", "--averages", "5"], &["--averages", "--coherence"]);
    refused(&["good.csv", "--coherence", "coherence", "--averages", "1"], &["--averages", "from 2"]);
    refused(&["good.csv#7"], &["there is no signal \"7\"", "good.csv#1: h"]);
    refused(&["good.csv#early"], &["\"early\" is real", "complex"]);
    refused(&["good.csv", "--from-hz", "14", "--to-hz", "13"], &["--from-hz 14 must be less than --to-hz 13"]);
    refused(
        &["good.csv", "--from-hz", "30"],
        &["0 lines from 30 Hz", "at least 8", "160 lines from 8 Hz to 17.9375 Hz"],
    );
    refused(&["good.csv", "--from-hz", "14"], &["there is no peak between 14 Hz and", "--from-hz"]);
    refused(&["good.csv", "--segment-s", "2"], &["--segment-s is for signals over time"]);
    refused(&["good.csv", "--linear-sensor"], &["--linear-sensor is for points"]);
    refused(&["good.csv", "--times-s", "early"], &["--drive"]);
    // The other sign of time: the fit knows no negative damping.
    write("conjugate.csv", &table("f_hz,h_re_m_per_s2_per_n,h_im_m_per_s2_per_n", |_, h| [h.re, -h.im]));
    refused(&["conjugate.csv"], &["not the response of a mode", "the right sign"]);
    let mut lines: Vec<&str> = good.lines().collect();
    lines.swap(40, 41);
    write("order.csv", &lines.join("\n"));
    refused(&["order.csv"], &["order.csv#h: frequency 41 is", "frequencies must rise"]);
    write("negative.csv", &good.replace("\n8,", "\n-8,"));
    refused(&["negative.csv"], &["negative.csv#h: frequency 1 is -8 Hz", "at least 0"]);
    write("nan.csv", &good.replacen("\n9,", "\n9,nan,0,0.9,0\n9.01,", 1));
    refused(&["nan.csv"], &["nan.csv: line", "\"nan\" is not a finite number"]);
    refused(&["nan.csv#h"], &["nan.csv: line", "\"nan\" is not a finite number"]);
    write("short.csv", "f_hz,c\n8,0.9\n9,0.9\n");
    refused(
        &["good.csv", "--coherence", "short.csv#c"],
        &["--coherence short.csv#c", "2 values from 8 Hz to 9 Hz", "160"],
    );
    write("real.csv", "f_hz,a_g\n1,2\n2,3\n");
    refused(&["real.csv#a"], &["\"a\" is real"]);
    write("cross.uff", &dataset_58(3, "m/s^2", "N", frequencies().map(accelerance)));
    refused(&["cross.uff#H"], &["the file calls \"H\" a cross spectrum"]);
    refused(&["cross.uff"], &["a cross spectrum"]);
    // A value that is no number is refused within the band only.
    let mut hdf5 = hdf5_pure::FileBuilder::new();
    let values: Vec<(f64, f64)> =
        frequencies().map(|hz| (if hz == 8.0 { f64::NAN } else { accelerance(hz).re }, accelerance(hz).im)).collect();
    hdf5.create_dataset("h_m_per_s2_per_n").with_complex64_data(&values);
    hdf5.create_dataset("f_hz").with_f64_data(&frequencies().collect::<Vec<f64>>());
    hdf5.write(folder.path().join("nan.h5")).unwrap();
    refused(&["nan.h5"], &["value 1 of \"h\", at 8 Hz", "finite number", "--from-hz"]);
    answer(&folder, &["nan.h5", "--from-hz", "9"]);
    // Options of a frequency response do not go with points.
    write("points.csv", "frequency_hz,x_m,z_m\n2,1e-3,1e-3\n");
    refused(&["points.csv", "--from-hz", "2"], &["--from-hz is for a complex frequency response", "leave it out"]);
}

/// Lines that no coherence allows are left out and named; --out refuses what does not fit.
#[test]
fn impossible_coherences_are_left_out_and_a_misfit_is_not_written() {
    let folder = TempDir::new().unwrap();
    let with_hum = |hum: f64| {
        let mut random = fastrand::Rng::with_seed(5);
        let mut n = 0;
        let rows: String = frequencies()
            .map(|hz| {
                n += 1;
                let mut noise = || 1e-3 * (random.f64() - 0.5);
                let own = accelerance(hz) + Complex::new(noise(), noise()) + if hz == 13.5 { hum } else { 0.0 };
                let coherence = if n == 10 {
                    1.2
                } else if n == 11 {
                    0.0
                } else {
                    0.999
                };
                format!("{hz},{},{},{coherence}\n", own.re, own.im)
            })
            .collect();
        format!("f_hz,h_re_m_per_s2_per_n,h_im_m_per_s2_per_n,coherence\n{rows}")
    };
    std::fs::write(folder.path().join("h.csv"), with_hum(0.0)).unwrap();
    let band = ["h.csv", "--coherence", "coherence", "--from-hz", "8", "--to-hz", "17"];
    let found = answer(&folder, &band);
    assert_eq!(found["lack_of_fit"], serde_json::json!([]), "{found}");
    assert!(found["remarks"].to_string().contains("2 lines are left out"), "{found}");
    std::fs::write(folder.path().join("h.csv"), with_hum(0.5)).unwrap();
    let found = answer(&folder, &band);
    assert!(found["lack_of_fit"][0].as_str().unwrap().contains("another mode or a disturbance at 13.5"), "{found}");
    let out = |more: &[&str]| {
        damprig(&folder).args(["identify", "response"]).args(band).args(["--out", "o.toml"]).args(more).assert()
    };
    out(&[]).code(2).stderr(predicates::str::contains("o.toml is not written: there is another mode"));
    assert!(!folder.path().join("o.toml").exists());
    out(&["--despite-misfit"]).success();
    let written: toml::Table = std::fs::read_to_string(folder.path().join("o.toml")).unwrap().parse().unwrap();
    assert!((written["structure"]["damping_ratio"].as_float().unwrap() / ZETA - 1.0).abs() < 0.05, "{written}");
    // --out does not replace the file that is read, however its signal is chosen.
    damprig(&folder)
        .args(["identify", "response", "h.csv#h", "--out", "h.csv", "--force"])
        .assert()
        .code(2)
        .stderr(predicates::str::contains("would overwrite"));
}

/// An analyser's file. Its H and coherence follow from its own spectra to single precision: H = Gxy/Gxx and γ² = |Gxy|²/(Gxx·Gyy), also where γ² is above 1, so
/// that cross and auto spectra are not of the same averages. They do not follow from its one block of time: that is one of several averages.
#[test]
fn an_analysers_h_and_coherence_are_those_of_its_spectra() {
    let Some(file) = field("beam/case1.mat") else { return };
    let contents = read(&file).unwrap();
    let named = |name: &str| contents.signals.iter().find(|signal| signal.name == name).unwrap();
    let complex = |name: &str| -> Vec<Complex<f64>> {
        let signal = named(name);
        signal.values.iter().zip(signal.imaginary.as_ref().unwrap()).map(|(re, im)| Complex::new(*re, *im)).collect()
    };
    let (h, cross) = (complex("Hf_chan_2"), complex("Hf_Cross_Spec_chan_2"));
    let (xx, yy) = (&named("MagSpec_chan_1").values, &named("MagSpec_chan_2").values);
    let coherence = &named("Hf_coh_chan_2").values;
    // Four values of single precision, 6e-8 each.
    for n in 0..h.len() {
        assert!((cross[n] / xx[n] / h[n] - 1.0).norm() < 2.4e-7, "H, line {n}");
        assert!((cross[n].norm_sqr() / (xx[n] * yy[n]) / coherence[n] - 1.0).abs() < 2.4e-7, "coherence, line {n}");
    }
    // The power spectral densities are the spectra over the spacing of the lines.
    for (density, of) in [("PSD_chan_1", xx), ("PSD_chan_2", yy)] {
        assert!(named(density).values.iter().zip(of).all(|(d, s)| (d * 0.3125 / s - 1.0).abs() < 2.4e-7), "{density}");
    }
    assert_eq!(coherence.iter().filter(|own| **own > 1.0).count(), 5);
}

/// Reference values: the same model fitted with scipy.optimize.least_squares 1.15, relative deviations, over 205 Hz to 219 Hz.
#[test]
fn the_mode_of_an_analysers_file_is_that_of_an_independent_fit() {
    let Some(file) = field("beam/case1.mat") else { return };
    let folder = TempDir::new().unwrap();
    let source = format!("{}#Hf_chan_2", file.display());
    let arguments = [&source, "--frequencies-hz", "Freq_domain", "--unit", "g/N"];
    let band = ["--from-hz", "205", "--to-hz", "219"];
    for coherence in [&[][..], &["--coherence", "Hf_coh_chan_2"]] {
        let found = answer(&folder, &[&arguments[..], &band, coherence].concat());
        // Relative and absolute weights differ by 0.012 Hz, 3e-7 and 0.4 %.
        for (quantity, reference, allowed) in [
            ("natural frequency", 212.080_608, 0.012),
            ("damping ratio", 8.649_77e-4, 5e-6),
            ("modal constant", 249.6717, 1.0),
        ] {
            let own = value(&found, quantity);
            assert!((own - reference).abs() < allowed, "{quantity}: {own}, not {reference}");
        }
        assert!(found["lack_of_fit"][0].as_str().unwrap().contains("the peak has not the shape"), "{found}");
        assert!(found["remarks"].to_string().contains("1.2 lines of 0.3125 Hz"), "{found}");
    }
    // Without a band: about the highest peak, and the lines with a coherence above 1 are named.
    let found = answer(&folder, &[&arguments[..], &["--coherence", "Hf_coh_chan_2"]].concat());
    assert!((value(&found, "natural frequency") - 212.08).abs() < 0.03, "{found}");
    assert!(found["remarks"].to_string().contains("4 lines are left out"), "{found}");
    // What the file does not state is asked for.
    let refused = |arguments: &[&str], says: &[&str]| check_refused(&folder, arguments, says);
    refused(&[&source], &["does not state the frequencies of \"Hf_chan_2\"", "--frequencies-hz"]);
    refused(&[&source, "--frequencies-hz", "Freq_domain"], &["does not state the unit", "--unit"]);
    refused(
        &[&source, "--frequencies-hz", "PSD_chan_1", "--unit", "g/N"],
        &["--frequencies-hz PSD_chan_1", "frequencies must rise"],
    );
    refused(
        &[&source, "--frequencies-hz", "Time_domain", "--unit", "g/N"],
        &["has 4096 real values, \"Hf_chan_2\" has 1601"],
    );
    refused(&[&file.display().to_string()], &["it has 16 signals: which one?", "#13: Hf_chan_2"]);
    let time = format!("{}#Time_chan_2", file.display());
    refused(&[&time, "--drive", "Time_chan_1", "--unit", "g/N"], &["--times-s SIGNAL"]);
}
