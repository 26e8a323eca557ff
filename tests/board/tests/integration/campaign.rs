//! Stepped-sine campaign through the `damprig` command, on the emulated board and on the virtual rig.

use std::f64::consts::TAU;
use std::fs;
use std::sync::OnceLock;

use damprig_board::{Config, Output, Time};
use damprig_simulator::plant::InjectedFault;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Outcome, Served, bare, image, journal, number, run_campaign, said};

/// A structure alone on a shaker, the base in closed loop: a linear system.
const CAMPAIGN: &str = r#"
name = "sine"

[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038

[rig]
sensor_noise_rms_m = 5e-6
displacement_limit_m = 0.078

[rig.shaker]

[[set_up]]
name = "bare"
label = "Bare structure"
base_amplitude_m = 0.003

[[experiment]]
name = "sine"
kind = "stepped_sine"
frequencies_hz = [2.1]
start = "from_rest"
drive = "closed_loop"
closed_loop = { gain_per_s = 20, tolerance = 0.01, wait_s = 20, drive_limit_m = 0.0043 }
ramp_s = 1.0
settle_s = 2.0
dwell_s = 5.0

[telemetry]
rate_hz = 50
signals = ["x", "z", "drive"]
"#;

/// Frequency of the sine, Hz, its base amplitude, m, and the number of samples in its ten measured cycles.
const FREQUENCY_HZ: f64 = 2.1;
const BASE_M: f64 = 0.003;
const SAMPLES: f64 = 10_000.0 * 10.0 / FREQUENCY_HZ;

/// Drive code for zero voltage.
const MIDDLE: u16 = 2_048;

struct Both {
    virtual_rig: Value,
    board: Value,
    manifest: Value,
    outcome: Outcome,
}

/// The campaign on both rigs, run once.
fn both() -> Option<&'static Both> {
    static BOTH: OnceLock<Option<Both>> = OnceLock::new();
    BOTH.get_or_init(|| {
        let image = image()?;
        let folder = TempDir::new().unwrap();
        let result = |rig: &str, name: &str| {
            let folder = folder.path().join(name);
            let output = run_campaign(CAMPAIGN, rig, &folder);
            assert!(output.status.success(), "--rig {rig}: {}", said(&output));
            let results = journal(&folder, "result");
            assert_eq!(results.len(), 1, "--rig {rig}: {results:?}");
            results[0].clone()
        };
        let virtual_rig = result("virtual", "virtual");
        let served = Served::new(image, Config::new(bare()), |_| {});
        let board = result(&served.rig, "board");
        let manifest = fs::read_to_string(folder.path().join("board/manifest.json")).unwrap();
        let manifest = serde_json::from_str(&manifest).unwrap();
        Some(Both { virtual_rig, board, manifest, outcome: served.off() })
    })
    .as_ref()
}

/// The amplitudes agree except for these differences between the sensors and loops of the two rigs:
/// - Noise: that of a conversion on the board is 16 times the variance of a sample's 5 µm plus 1/12 of the square of its
///   step, 39 µm; 16 conversions are added up. The virtual rig has its own 10 µm steps. An amplitude over N samples has an
///   error of √(2/N) times the noise.
/// - The drive reaches the board's base up to 0.15 ms later (the tick's execution time, the integrator's grid), so the loop
///   lags the virtual rig's by 2πK·0.15 ms while the drive rises, when its error is that of the rise: Z/(K · 1 s). The
///   resulting motion is still present in the structure.
/// - The loop corrects the output's steps of 2.4 µm; the residue over ten cycles is below a tenth of a step.
#[test]
fn a_stepped_sine_gives_the_virtual_rigs_amplitudes_within_the_sensors_noise() {
    let Some(both) = both() else { return };
    let step_m: f64 = 0.16 / 4_096.0;
    let board_rms_m = ((16.0 * 5e-6_f64.powi(2) + step_m.powi(2) / 12.0) / 16.0).sqrt();
    let virtual_rms_m = (5e-6_f64.powi(2) + 10e-6_f64.powi(2) / 12.0).sqrt();
    let noise_m = 4.0 * board_rms_m.hypot(virtual_rms_m) * (2.0 / SAMPLES).sqrt();
    let gain_per_s = 20.0;
    let loop_part = TAU * gain_per_s * 0.15e-3 * (1.0 / gain_per_s) * 0.1;
    let drive_m = 0.1 * 0.01 / 4_095.0;
    for key in ["z_amplitude_m", "x_amplitude_m"] {
        let (there, here) = (number(&both.virtual_rig, key), number(&both.board, key));
        let tolerance_m = noise_m + loop_part * there + drive_m;
        println!("{key}: {here:.9} on the board, {there:.9} on the virtual rig, tolerance {tolerance_m:.2e}");
        assert!((here - there).abs() < tolerance_m, "{key}: {here} and {there}, tolerance {tolerance_m:e}");
    }
    assert!((number(&both.board, "z_amplitude_m") / BASE_M - 1.0).abs() < 0.01);
}

/// The board converts z after the 16 conversions of x (60 cycles of 42.5 MHz each); the virtual rig converts both at
/// once.
#[test]
fn the_phase_differs_by_the_delay_between_the_channels_conversions() {
    let Some(both) = both() else { return };
    let turn_s = 16.0 * 60.0 / 42.5e6;
    let difference = number(&both.board, "phase_rad") - number(&both.virtual_rig, "phase_rad");
    let expected = -TAU * FREQUENCY_HZ * turn_s;
    println!("phase: {difference:.2e} rad, expected {expected:.2e}");
    // Noise of z as above, four times its standard error, plus the remaining effect of the loop on the structure.
    let tolerance = 4.0 * 9e-6 * (2.0 / SAMPLES).sqrt() / BASE_M + 1e-4;
    assert!((difference - expected).abs() < tolerance, "{difference} rad, expected {expected}, tolerance {tolerance}");
}

#[test]
fn nothing_is_lost_on_the_way() {
    let Some(both) = both() else { return };
    println!("{:.2} times real time", both.outcome.speed);
    assert_eq!(both.outcome.bytes_lost, 0);
    assert_eq!(both.manifest["status"], "complete");
    for key in ["overruns", "rows_dropped", "replies_dropped", "requests_dropped", "bad_frames"] {
        assert_eq!(both.manifest["controller"][key], 0, "{key}");
    }
}

/// The changes of drive and relay in a trace.
fn drive_and_relay(trace: &[(Time, Output)]) -> Vec<(Time, Output)> {
    let is_one = |output: &Output| matches!(output, Output::Drive(_) | Output::Relay(_));
    trace.iter().filter(|(_, output)| is_one(output)).copied().collect()
}

#[test]
fn the_relay_closes_after_the_output_has_been_at_zero_drive_for_a_tick() {
    let Some(both) = both() else { return };
    let changes = drive_and_relay(&both.outcome.trace);
    let closings: Vec<usize> = (0..changes.len()).filter(|&n| changes[n].1 == Output::Relay(true)).collect();
    assert_eq!(closings.len(), 1, "the relay closes once");
    for n in closings {
        let ((before, output), (at, _)) = (changes[n - 1], changes[n]);
        assert_eq!(output, Output::Drive(Some(MIDDLE)));
        assert!(at - before >= Time::from_ms(1), "the output had been constant for {} µs", (at - before).us());
        let (after, _) = changes[n + 1];
        assert!(after - at >= Time::from_us(900), "the output changes {} µs later", (after - at).us());
    }
}

#[test]
fn the_drive_changes_once_per_tick_during_a_sine() {
    let Some(both) = both() else { return };
    let changes = drive_and_relay(&both.outcome.trace);
    let closed = changes.iter().position(|(_, output)| *output == Output::Relay(true)).unwrap();
    let opened = changes.iter().position(|(_, output)| *output == Output::Relay(false)).unwrap();
    let times: Vec<f64> = changes[closed + 1..opened].iter().map(|(at, _)| at.us()).collect();
    // Successive values may be equal. Changes are whole ticks apart, within the variation of a tick's execution time.
    let worst = times.windows(2).map(|pair| (pair[1] - pair[0]) % 1_000.0).map(|off| off.min(1_000.0 - off));
    let worst = worst.fold(0.0, f64::max);
    println!("{} changes of the drive, off their tick by at most {worst:.1} µs", times.len());
    assert!(times.len() > 5_000 && worst < 100.0, "{} changes, {worst} µs", times.len());
}

#[test]
fn the_emergency_stop_opens_the_relay_before_the_output_returns_to_zero_drive() {
    let Some(image) = image() else { return };
    // The switch is pressed two seconds after the relay has closed, while the drive swings.
    let mut pressed = None;
    let served = Served::new(image, Config::new(bare()), move |board| {
        let closed = board.chip().trace().iter().rev().find(|(_, output)| *output == Output::Relay(true));
        if pressed.is_none()
            && let Some((closed, _)) = closed
            && board.now() - *closed > Time::from_ms(2_000)
        {
            pressed = Some(board.now());
            board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
            board.chip_mut().mark("emergency stop");
        }
    });
    let folder = TempDir::new().unwrap();
    let output = run_campaign(CAMPAIGN, &served.rig, &folder.path().join("run"));
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("emergency stop"), "{}", said(&output));
    let outcome = served.off();
    let at = outcome.trace.iter().find(|(_, output)| *output == Output::Mark("emergency stop")).unwrap().0;
    let after: Vec<_> = drive_and_relay(&outcome.trace).into_iter().filter(|(time, _)| *time > at).collect();
    let opened = after.iter().position(|(_, output)| *output == Output::Relay(false)).unwrap();
    // A running tick may have read the switch's old level; its block of samples ends within a millisecond.
    assert!(after[opened].0 - at < Time::from_ms(2), "{} µs", (after[opened].0 - at).us());
    assert_eq!(after[opened + 1].1, Output::Drive(Some(MIDDLE)));
    assert!(after[opened + 1].0 - after[opened].0 < Time::from_us(100));
    assert_eq!(after.len(), opened + 2, "{after:?}");
    assert!(!outcome.trace.contains(&(at, Output::Step(true))));
}
