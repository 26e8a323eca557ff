//! Free decays of other programs' files: accelerations, velocities, other units and dialects.

use std::f64::consts::TAU;

use serde_json::Value;

use crate::common::{damprig, folder_with};

const FREQUENCY_HZ: f64 = 6.5;
const ZETA: f64 = 0.008;
const AMPLITUDE_M: f64 = 2e-3;

/// Displacement, velocity and acceleration of a viscous decay (closed form).
fn motion(t_s: f64) -> [f64; 3] {
    let omega = TAU * FREQUENCY_HZ;
    let (decay, damped) = (ZETA * omega, omega * (1.0 - ZETA * ZETA).sqrt());
    let (sine, cosine) = (damped * t_s).sin_cos();
    let envelope = AMPLITUDE_M * (-decay * t_s).exp();
    let x = envelope * cosine;
    let v = envelope * (-decay * cosine - damped * sine);
    [x, v, -2.0 * decay * v - omega * omega * x]
}

/// A table of the decay: `order` 0, 1 or 2, its values times `per_si`, with a small noise of the signal's own size.
fn table(header: &str, order: usize, per_si: f64, time: impl Fn(usize) -> f64) -> String {
    let mut rng = fastrand::Rng::with_seed(5);
    let noise = 1e-4 * AMPLITUDE_M * (TAU * FREQUENCY_HZ).powi(order as i32);
    let row = |n: usize| {
        let t_s = time(n);
        let value = motion(t_s)[order] + noise * (rng.f64() - 0.5);
        format!("{t_s:.6},{:.9e}\n", value * per_si)
    };
    format!("{header}\n{}", (0..4000).map(row).collect::<String>())
}

fn even(n: usize) -> f64 {
    n as f64 * 0.002
}

#[test]
fn accelerations_and_velocities_give_frequency_damping_and_the_displacements_amplitude() {
    let folder = folder_with("");
    for (file, text) in [
        ("x.csv", table("t_s,x_mm", 0, 1e3, even)),
        ("v.csv", table("Time (s),Velocity (mm/s)", 1, 1e3, even)),
        ("a.csv", table("t_s,a_g", 2, 1.0 / 9.80665, even)),
        ("german.csv", table("t_s,a_m_per_s2", 2, 1.0, even).replace(',', ";").replace('.', ",")),
        ("jitter.csv", table("t_s,a_m_per_s2", 2, 1.0, |n| even(n) + 4e-4 * (0.7 * n as f64).sin())),
    ] {
        std::fs::write(folder.path().join(file), text).unwrap();
        let output = damprig(&folder).args(["identify", "decay", file, "--viscous", "--json"]).output().unwrap();
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        let estimates = json["estimates"].as_array().unwrap();
        let find = |key: &str| {
            let one = estimates.iter().find(|one| one["key"] == key);
            one.unwrap_or_else(|| panic!("{file}: no {key}: {estimates:?}"))
        };
        for (name, truth) in [("structure.natural_frequency_hz", FREQUENCY_HZ), ("structure.damping_ratio", ZETA)] {
            let one = find(name);
            let (value, u) = (one["value"].as_f64().unwrap(), one["standard_uncertainty"].as_f64().unwrap());
            assert!((value - truth).abs() < 4.0 * u && u < 2e-3 * truth, "{file}: {name} {value} ± {u}, truth {truth}");
        }
        assert!(json["lack_of_fit"].as_array().is_none_or(Vec::is_empty), "{file}: {}", json["lack_of_fit"]);
        // The amplitude of a window is that of the displacement in its middle.
        let row = &json["over_amplitude"][0];
        let middle_s = 0.5 * (row["from_s"].as_f64().unwrap() + row["to_s"].as_f64().unwrap());
        let truth_m = AMPLITUDE_M * (-ZETA * TAU * FREQUENCY_HZ * middle_s).exp();
        let amplitude_m = row["amplitude_m"].as_f64().unwrap();
        assert!((amplitude_m / truth_m - 1.0).abs() < 0.01, "{file}: {amplitude_m} m, truth {truth_m} m");
    }
}

#[test]
fn a_signal_that_is_no_motion_is_refused_with_the_way_out() {
    let folder = folder_with("");
    for (text, which, why) in [
        ("t_s,u_mV", "", "is a voltage: a decay is a displacement, velocity or acceleration"),
        ("t_s,signal", "", "the unit of \"signal\" is not known"),
        ("t_s,a_g", "#b", "there is no signal \"b\""),
    ] {
        std::fs::write(folder.path().join("bad.csv"), table(text, 2, 1.0, even)).unwrap();
        let output = damprig(&folder).args(["identify", "decay", &format!("bad.csv{which}")]).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).to_string();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(why), "{error}");
    }
}
