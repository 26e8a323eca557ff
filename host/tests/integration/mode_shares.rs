//! The parts of the modes in a motion.

use std::f64::consts::{SQRT_2, TAU};

use serde_json::Value;

use crate::common::simulated;

const FRAME: &str = "\
initial = { x_m = 0.001, mode = 2 }
run = { duration_s = 20 }
[[storey]]
mass_kg = 100
stiffness_n_per_m = 5e4
[[storey]]
mass_kg = 80
stiffness_n_per_m = 4e4
";

const MODES: &str = "\
places = [\"tip\"]
force = { kind = \"sine\", amplitude_n = 12, frequency_hz = 30 }
run = { duration_s = 3 }
";

fn number(answer: &Value, path: &str) -> f64 {
    answer.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} of {answer}"))
}

#[test]
fn under_a_steady_sine_the_parts_of_the_modes_are_those_of_their_equations() {
    // After 2.3 s nothing is left of the free vibrations: exp(−ζωt) = 5e-17 of the slower one.
    let (ratio, turning, force_n) = (0.2, TAU * 30.0, 12.0);
    let modes = [(41.0, 0.6), (13.0, 1.1)];
    let tables = modes.map(|(frequency_hz, shape)| {
        format!("[[mode]]\nfrequency_hz = {frequency_hz}\ndamping_ratio = {ratio}\nshape_per_root_kg = [{shape}]\n")
    });
    let answer = simulated(&format!("{MODES}{}", tables.concat()), &[]);
    // q″ + 2ζω q′ + ω² q = φ P sin Ωt, and the mean of 2(q′² + ω²q²) is (Ω² + ω²) times the square of the amplitude.
    let [second, first] = modes.map(|(frequency_hz, shape)| {
        let omega = TAU * frequency_hz;
        let amplitude = shape * force_n / (omega * omega - turning * turning).hypot(2.0 * ratio * omega * turning);
        (frequency_hz, shape * amplitude / SQRT_2, (turning * turning + omega * omega) * amplitude * amplitude)
    });
    let whole = first.2 + second.2;
    for (n, (frequency_hz, rms_x_m, energy)) in [first, second].into_iter().enumerate() {
        for (key, expected) in [("frequency_hz", frequency_hz), ("rms_x_m", rms_x_m), ("energy_share", energy / whole)]
        {
            let found = number(&answer, &format!("/mode_shares/{n}/{key}"));
            assert!((found / expected - 1.0).abs() < 1e-10, "{key} of mode {n}: {found}, not {expected}");
        }
    }
}

#[test]
fn a_frame_that_starts_in_its_second_mode_vibrates_in_this_mode_alone() {
    let answer = simulated(FRAME, &[]);
    assert!(number(&answer, "/mode_shares/0/energy_share") < 1e-20, "{answer}");
    assert!(number(&answer, "/mode_shares/1/energy_share") > 1.0 - 1e-12, "{answer}");
}
