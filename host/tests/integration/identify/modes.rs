//! Modes and shapes from frequency responses at several places, through the command.

use std::f64::consts::TAU;

use crate::common::{damprig, field, folder, refused, simulated};
use damprig_fourier::Complex;
use damprig_structures::{Damping, Modes};

/// A structure of three masses with modes at 93, 214 and 307 Hz.
fn structure() -> Modes {
    let mass = [1.2, 0.0, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 0.7];
    let stiffness = [3e6, -1.2e6, 0.0, -1.2e6, 2e6, -8e5, 0.0, -8e5, 8e5];
    let damping = Damping::Rayleigh { mass_per_s: 0.8, stiffness_s: 2e-5 };
    Modes::from_matrices(&mass, &stiffness, &damping, &[1.0; 3]).unwrap()
}

/// A table of accelerances at the masses 3, 1 and 2 for a force at 3, up to `to_hz`, with noise.
fn responses(to_hz: f64) -> String {
    let structure = structure();
    let mut random = fastrand::Rng::with_seed(7);
    let mut text =
        "f_hz,tip_real_m/s2/N,tip_imag_m/s2/N,low_real_m/s2/N,low_imag_m/s2/N,middle_real_m/s2/N,middle_imag_m/s2/N\n"
            .to_string();
    let mut hz = 40.0;
    while hz < to_hz {
        text += &format!("{hz}");
        for place in [2, 0, 1] {
            let omega = TAU * hz;
            let of_mode = |mode: &damprig_structures::Mode| {
                let natural = mode.angular_frequency_rad_per_s;
                let pole = Complex::new(natural * natural - omega * omega, 2.0 * mode.damping_ratio * natural * omega);
                Complex::from(-omega * omega * mode.shape[2] * mode.shape[place]) / pole
            };
            let h: Complex<f64> = structure.modes.iter().map(of_mode).sum();
            let mut noise = || 0.005 * (random.f64() + random.f64() + random.f64() - 1.5);
            text += &format!(",{},{}", h.re + noise(), h.im + noise());
        }
        text += "\n";
        hz += 0.2;
    }
    text
}

const PLACES: [&str; 5] = ["identify", "modes", "tip=h.csv#1", "low=h.csv#2", "middle=h.csv#3"];

#[test]
fn frequencies_damping_ratios_and_shapes_are_within_their_intervals() {
    let folder = folder(&[("h.csv", &responses(350.0))]);
    let said = damprig(&folder).args(PLACES).arg("--json").assert().success();
    let found: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
    let modes = found["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 3, "{found}");
    let (mut inside, mut all) = (0, 0);
    let mut check = |value: &serde_json::Value, truth: f64| {
        let of = |key: &str| value[key].as_f64().unwrap();
        let (own, u) = (of("value"), of("standard_uncertainty"));
        assert!(u < 0.05 * truth.abs() && (own - truth).abs() < 4.0 * u, "{value} {truth}");
        let ends = |n: usize| value["interval_95"][n].as_f64().unwrap();
        inside += u32::from(ends(0) <= truth && truth <= ends(1));
        all += 1;
    };
    for (mode, exact) in modes.iter().zip(structure().modes) {
        check(&mode["natural_frequency_hz"], exact.angular_frequency_rad_per_s / TAU);
        check(&mode["damping_ratio"], exact.damping_ratio);
        for (n, place) in [2, 0, 1].into_iter().enumerate() {
            check(&mode["shape_per_root_kg"][n], exact.shape[place] * exact.shape[2].signum());
        }
    }
    // 15 values; two outside of 95 % intervals are usual.
    assert!(inside + 2 >= all, "{inside} of {all}");
}

/// Modes outside of the band act on what is in it: intervals say so, and the case that is written has the modes.
#[test]
fn a_band_with_two_of_three_modes_gives_a_case_that_runs() {
    let folder = folder(&[("h.csv", &responses(260.0))]);
    let said = damprig(&folder).args(PLACES).args(["--plot", "modes.svg", "--out", "part.toml"]).assert().success();
    let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    assert!(printed.contains("damprig simulate part.toml") && printed.contains("force at tip"), "{printed}");
    let picture = std::fs::read_to_string(folder.path().join("modes.svg")).unwrap();
    assert!(picture.contains("middle") && picture.contains("Modes at"), "the picture names the places");
    let answer = simulated(&std::fs::read_to_string(folder.path().join("part.toml")).unwrap(), &[]);
    assert_eq!(answer["places"].as_array().unwrap().len(), 3);
}

#[test]
fn what_cannot_be_is_refused_with_what_to_do() {
    let table = responses(350.0);
    let upside_down = "tip=-h.csv#1";
    let cases: &[(&[&str], &[&str])] = &[
        (&["tip=h.csv#1", "--driven", "foot"], &["--driven foot", "they are tip"]),
        (&["tip=h.csv#1", "tip=h.csv#2"], &["two places", "\"tip\""]),
        (&["h.csv"], &["PLACE=FILE"]),
        (&["tip=h.csv#9"], &["no signal \"9\""]),
        (&[upside_down], &["which must be greater than 0", "PLACE=-FILE"]),
        (&["tip=h.csv#1", "--near-hz", "93,150"], &["150", "astray"]),
        (&["tip=h.csv#1", "--near-hz", "93,5000"], &["--near-hz 5000", "within the lines"]),
        (&["tip=h.csv#1", "--near-hz", "93", "--from-hz", "92", "--to-hz", "94"], &["lines in the band"]),
    ];
    for (arguments, words) in cases {
        refused(&[("h.csv", &table)], &[&["identify", "modes"][..], arguments].concat(), words);
    }
}

/// An analyser's file of a cantilever: a force transducer against the motion, a peak that its lines do not resolve.
#[test]
fn two_modes_of_an_analysers_file() {
    let Some(file) = field("beam/case1.mat") else { return };
    let folder = folder(&[]);
    let place = format!("tip=-{}#Hf_chan_2", file.display());
    let arguments =
        ["identify", "modes", &place, "--frequencies-hz", "Freq_domain", "--unit", "g/N", "--near-hz", "34,212"];
    let said =
        damprig(&folder).args(arguments).args(["--from-hz", "20", "--to-hz", "380", "--json"]).assert().success();
    let found: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
    let hz = |n: usize| found["modes"][n]["natural_frequency_hz"]["value"].as_f64().unwrap();
    // A slender cantilever has them 6.267 apart, before its accelerometer.
    assert!((hz(1) / hz(0) / 6.267 - 1.0).abs() < 0.02, "{} {}", hz(0), hz(1));
    assert!(found["remarks"].to_string().contains("lines wide"), "{found}");
    // Without a hint one peak is one mode: what bends beside it, at 162 Hz, is none that anyone would see.
    let arguments =
        ["identify", "modes", &place, "--frequencies-hz", "Freq_domain", "--unit", "g/N", "--from-hz", "150"];
    let said = damprig(&folder).args(arguments).args(["--to-hz", "300", "--json"]).assert().success();
    let found: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
    assert_eq!(found["modes"].as_array().map(Vec::len), Some(1), "{found}");
}
