//! Campaigns of every other kind through the `damprig` command, on the emulated board and on the virtual rig: a hybrid damper
//! whose spring the rig tunes, a record, a pulse, and a free vibration.

use std::f64::consts::PI;

use damprig_board::{Board, Config, Output, Time};
use damprig_core::model::{Cavity, Particle, Release, SetUp, Structure, Tmd, Wall};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, PlantConfig, Shaker};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Outcome, Served, image, journal, number, project, run_campaign, said};

/// The structure of these campaigns: damped, so that it comes to rest soon.
const STRUCTURE: &str = r#"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.05

[rig]
sensor_noise_rms_m = 5e-6
"#;

/// A pulse of the base that begins when the structure moves less than [`REST_LEVEL_M`].
const PULSE: &str = r#"
[[experiment]]
name = "pulse"
kind = "impulse"
shape = "versine"
amplitude_m = 0.004
duration_s = 0.2
rest_level_m = 5e-5
tail_s = 2
"#;

/// RMS noise of a sample of x or z: of 16 conversions with 16 times the variance of 5 µm, rounded to 39 µm; and on the virtual
/// rig with its steps of 10 µm.
const BOARD_NOISE_M: f64 = 5.8e-6;
const VIRTUAL_NOISE_M: f64 = 5.8e-6;

/// The largest of some ten thousand samples is up to five times their noise too large, on either rig; a difference of two
/// sensors √2 times as much.
const PEAK_NOISE_M: f64 = 5.0 * 1.5 * BOARD_NOISE_M;

/// The pulse begins when the structure moves less than this; a virtual rig's is at rest.
const REST_LEVEL_M: f64 = 5e-5;

/// Asserts that a number of two entries is the same within a tolerance.
fn close(key: &str, there: &Value, here: &Value, tolerance: f64) {
    let (there, here) = (number(there, key), number(here, key));
    println!("{key}: {here:.9} on the board, {there:.9} on the virtual rig, tolerance {tolerance:.2e}");
    assert!((here - there).abs() <= tolerance, "{key}: {here} and {there}, tolerance {tolerance:e}");
}

fn structure() -> Structure {
    Structure::from_modal(1.6, 2.5, 0.05)
}

fn plant() -> PlantConfig {
    PlantConfig::ideal(SetUp::bare(structure()))
}

/// Runs a campaign on both rigs. Returns the entries of a kind in both journals, the board's second, and what the board did.
fn both(
    text: &str,
    kind: &str,
    config: Config,
    each_step: impl FnMut(&mut Board) + Send + 'static,
) -> Option<([Vec<Value>; 2], Outcome)> {
    let image = image()?;
    let folder = TempDir::new().unwrap();
    let result = |rig: &str, name: &str| {
        let folder = folder.path().join(name);
        let output = run_campaign(text, rig, &folder);
        assert!(output.status.success(), "--rig {rig}: {}", said(&output));
        journal(&folder, kind)
    };
    let virtual_rig = result("virtual", "virtual");
    let served = Served::new(image, config, each_step);
    let board = result(&served.rig, "board");
    assert_eq!(virtual_rig.len(), board.len());
    let outcome = served.off();
    println!("{:.2} times real time", outcome.speed);
    assert_eq!(outcome.bytes_lost, 0);
    Some(([virtual_rig, board], outcome))
}

#[test]
fn a_record_and_a_pulse_move_the_virtual_rigs_structure_alike() {
    let record = project().join("host/campaigns/records/synthetic.csv").canonicalize().unwrap();
    let text = format!(
        r#"
name = "transients"
{STRUCTURE}
[[set_up]]
name = "bare"
label = "Bare structure"
base_amplitude_m = 0.003

[[experiment]]
name = "record"
kind = "playback"
file = "{}"
quantity = "acceleration"
unit = "g"
target_peak_m = 0.003
tail_s = 1

{PULSE}
[telemetry]
rate_hz = 200
signals = ["x", "z", "drive"]
"#,
        record.display()
    );
    let Some(([virtual_rig, board], _)) = both(&text, "transient", Config::new(plant()), |_| {}) else { return };
    assert_eq!(board.len(), 2);
    for ((there, here), residue_m) in virtual_rig.iter().zip(&board).zip([0.0, REST_LEVEL_M]) {
        for key in ["max_abs_x_m", "max_abs_z_m", "max_abs_x_minus_z_m"] {
            close(key, there, here, PEAK_NOISE_M + residue_m);
        }
        for key in ["rms_x_m", "rms_z_m", "rms_x_minus_z_m"] {
            close(key, there, here, 4.0 * BOARD_NOISE_M.hypot(VIRTUAL_NOISE_M) / 10_000f64.sqrt() + residue_m);
        }
        // The output's steps of 2.4 µm, and the noise of a tick's ten samples.
        let base_error_m = (2.4e-6 / 12f64.sqrt()).hypot(BOARD_NOISE_M / 10f64.sqrt());
        close("base_error_rms_m", &serde_json::json!({ "base_error_rms_m": base_error_m }), here, 0.3 * base_error_m);
        assert!(number(here, "base_delay_s") < 2e-3);
    }
}

#[test]
fn a_free_vibration_decays_as_the_virtual_rigs() {
    let text = format!(
        r#"
name = "release"
{STRUCTURE}
[[set_up]]
name = "bare"
label = "Bare structure"
base_amplitude_m = 0.003

[[experiment]]
name = "release"
kind = "free_vibration"
start_m = 0.035
measure_s = 4
cycles = 6

[telemetry]
rate_hz = 200
signals = ["x", "z"]
"#
    );
    // A hand pulls the structure while the relay is closed, and releases it 1.2 s later.
    let hand = |board: &mut Board| {
        let closed = board.chip().trace().iter().find(|(_, output)| *output == Output::Relay(true));
        if let Some((at, _)) = closed {
            let since = board.now() - *at;
            let held = since > Time::from_ms(100) && since < Time::from_ms(1_300);
            board.chip_mut().hold(held.then_some(0.035));
        }
    };
    let Some(([virtual_rig, board], _)) = both(&text, "transient", Config::new(plant()), hand) else { return };
    let ([there], [here]) = (&virtual_rig[..], &board[..]) else { panic!("{board:?}") };
    let (turning, x0_m) = (2.0 * PI * 2.5, 0.035);
    // The virtual rig's structure is put back to its start in every tick and moves in between.
    close("start_m", there, here, turning.powi(2) * x0_m * 1e-6 / 2.0 + 4.0 * BOARD_NOISE_M / 250f64.sqrt());
    close("end_m", there, here, PEAK_NOISE_M);
    close("log_decrement", there, here, PEAK_NOISE_M / number(there, "end_m") / 6.0);
    // Either end of the six cycles is found to a tick.
    close("frequency_hz", there, here, 2.5 * 2e-3 / 2.4);
    // The measurement of 4 s begins up to a tick earlier or later, near x0.
    close("rms_x_m", there, here, x0_m.powi(2) * 1e-3 / 4.0 / (2.0 * number(there, "rms_x_m")));
}

/// Pulses of the step output while the motor is on: those towards the structure less those away from it, and all of them.
fn pulses(trace: &[(Time, Output)]) -> (i32, u32) {
    let (mut towards, mut is_off, mut moved, mut all) = (false, true, 0, 0);
    for (_, output) in trace {
        match output {
            Output::Direction(level) => towards = *level,
            Output::MotorOff(off) => is_off = *off,
            Output::Step(true) if !is_off => {
                moved += if towards { 1 } else { -1 };
                all += 1;
            }
            _ => {}
        }
    }
    (moved, all)
}

/// Both rigs home their spring, touch off, press with the force for γF = 0.2 and adjust it to the measured Z. Either finds the
/// zero of its spring to 20 µm (firmware/README.md, bring-up step 10), so γF = μe k_s δ/(k Z) differs by up to √2 · 0.0054.
/// Between γF = 0.2 and 0.25 the virtual rig's results change by 11.4 mm (x), 0.48 mm (z) and 0.64 rad per unit of γF.
#[test]
fn a_hybrid_damper_whose_spring_the_rig_tunes_gives_the_virtual_rigs_response() {
    let rig = STRUCTURE.to_owned() + "[rig.shaker]\n";
    let text = format!(
        r#"
name = "tuned"
{rig}
[[set_up]]
name = "hybrid"
label = "Hybrid (SPID + FD)"
base_amplitude_m = 0.0015
particle = {{ mass_ratio = 0.1, clearance_ratio = 2.0, wall = {{ kind = "restitution", coefficient = 0.47 }} }}
friction_damper = {{ spring = {{ friction_ratio = 0.2 }} }}

[[experiment]]
name = "resonance"
kind = "stepped_sine"
frequencies_hz = [2.4]
start = "carry_over"
settle_s = 5.0
dwell_s = 5.0

[telemetry]
rate_hz = 100
signals = ["x", "z", "spring_force", "impacts_in_cycle", "twin_residual"]
"#
    );
    let structure = structure();
    let particle = Particle {
        mass_kg: 0.1 * structure.mass_kg,
        clearance_m: 2.0 * 0.0015,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.47 },
        cavity: Cavity::default(),
    };
    let spring = SpringPlant::default();
    let plant = PlantConfig {
        set_up: SetUp { particle: Some(particle), ..SetUp::bare(structure) },
        base: Base::Shaker(Shaker::default()),
        walls: Some(WallSensors::default()),
        spring: Some(spring),
        ..plant()
    };
    let Some(([virtual_rig, board], outcome)) = both(&text, "result", Config::new(plant), |_| {}) else { return };
    let ([there], [here]) = (&virtual_rig[..], &board[..]) else { panic!("{board:?}") };
    let zero_m = 20e-6;
    let force_share = f64::from(spring.friction_coefficient * spring.stiffness_n_per_m) * zero_m;
    let ratio = 2f64.sqrt() * force_share / (structure.stiffness_n_per_m * 0.0015);
    close("x_amplitude_m", there, here, 11.4e-3 * ratio);
    close("z_amplitude_m", there, here, 0.48e-3 * ratio);
    // The board converts z 22.6 µs after x.
    close("phase_rad", there, here, 0.64 * ratio + 2.0 * PI * 2.4 * 22.6e-6);

    // Every pulse moved the seat, and the controller knows where it is: it counts from the edge of the switch.
    let (moved, all) = pulses(&outcome.trace);
    let steps = outcome.seat_steps.unwrap();
    assert_eq!(steps, (spring.start_m / spring.step_m) as i32 + moved);
    assert!(all > 2_000, "{all} pulses");
    let position_m = outcome.status.spring.position_m;
    println!(
        "{all} pulses, the seat at step {steps}, the controller's position {:.1} steps",
        position_m / spring.step_m
    );
    assert!((position_m - steps as f32 * spring.step_m).abs() <= 1.5 * spring.step_m, "{position_m} m, step {steps}");
}

/// A pulse that excites a tuned mass, and a particle between soft walls. The board counts the contacts by the force of the walls.
#[test]
fn a_pulse_moves_soft_walls_and_a_tuned_mass_as_on_the_virtual_rig() {
    let bare = SetUp::bare(structure());
    let rubber = Wall::Voigt { stiffness_n_per_m: 43_436.0, damping_n_s_per_m: 13.0, release: Release::ZeroForce };
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.001,
        friction_coefficient: 0.0,
        wall: rubber,
        cavity: Cavity::default(),
    };
    let tmd = Tmd { mass_kg: 0.16, stiffness_n_per_m: 32.6, damping_n_s_per_m: 0.84 };
    let soft = "particle = { mass_kg = 0.16, clearance_m = 0.001, wall = { kind = \"voigt\", stiffness_n_per_m = 43436, \
                damping_n_s_per_m = 13, release = \"zero_force\" } }";
    let tuned = "tmd = { mass_kg = 0.16, stiffness_n_per_m = 32.6, damping_n_s_per_m = 0.84 }";
    let with_particle = PlantConfig {
        set_up: SetUp { particle: Some(particle), ..bare },
        walls: Some(WallSensors::default()),
        ..plant()
    };
    let with_tmd = PlantConfig { set_up: SetUp { tmd: Some(tmd), ..bare }, ..plant() };
    for (damper, plant) in [(soft, with_particle), (tuned, with_tmd)] {
        let text = format!(
            r#"
name = "dampers"
{STRUCTURE}
[[set_up]]
name = "damped"
base_amplitude_m = 0.0015
{damper}

{PULSE}
[telemetry]
rate_hz = 100
"#
        );
        let Some(([virtual_rig, board], _)) = both(&text, "transient", Config::new(plant), |_| {}) else { return };
        let ([there], [here]) = (&virtual_rig[..], &board[..]) else { panic!("{board:?}") };
        close("max_abs_x_m", there, here, PEAK_NOISE_M + REST_LEVEL_M);
        close("rms_x_m", there, here, 4.0 * BOARD_NOISE_M.hypot(VIRTUAL_NOISE_M) / 10_000f64.sqrt() + REST_LEVEL_M);
        // A contact whose force is near the threshold may be counted on one of the rigs.
        close("impacts", there, here, 1.0);
        assert_eq!(number(here, "impacts") > 3.0, damper == soft);
    }
}
