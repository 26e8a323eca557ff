//! Sound pressure levels of WAV and CSV files, as a person evaluates them, and files that cannot be used.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use hound::{SampleFormat, WavSpec, WavWriter};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::damprig;

const RATE_HZ: u32 = 48_000;

fn spec(channels: u16, bits_per_sample: u16, sample_format: SampleFormat) -> WavSpec {
    WavSpec { channels, sample_rate: RATE_HZ, bits_per_sample, sample_format }
}

/// Writes seconds of a signal, a share of full scale, to every channel.
fn write(path: &Path, spec: WavSpec, seconds: u32, signal: impl Fn(f64) -> f64) {
    let mut writer = WavWriter::create(path, spec).unwrap();
    for n in 0..seconds * RATE_HZ {
        let value = signal(f64::from(n) / f64::from(RATE_HZ));
        for _ in 0..spec.channels {
            match spec.sample_format {
                SampleFormat::Float => writer.write_sample(value as f32).unwrap(),
                SampleFormat::Int => {
                    let full = 2f64.powi(i32::from(spec.bits_per_sample) - 1);
                    writer.write_sample((value * full).round().clamp(-full, full - 1.0) as i32).unwrap();
                }
            }
        }
    }
    writer.finalize().unwrap();
}

fn tone(rms: f64, frequency_hz: f64) -> impl Fn(f64) -> f64 {
    move |t| 2f64.sqrt() * rms * (TAU * frequency_hz * t).sin()
}

fn answer(folder: &TempDir, more: &[&str]) -> Value {
    let output = damprig(folder).args(["identify", "sound"]).args(more).arg("--json").output().unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn level(answer: &Value, quantity: &str) -> f64 {
    let all = answer["estimates"].as_array().unwrap();
    let found = all.iter().find(|estimate| estimate["quantity"] == quantity);
    found.unwrap_or_else(|| panic!("no {quantity:?} in {answer}"))["value"].as_f64().unwrap()
}

/// A calibrator of 94 dB at 0.05 of full scale; the machine is 6.02 dB louder, at 1 kHz.
#[test]
fn a_recording_is_calibrated_by_a_tone_in_every_sample_format() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    let formats = [
        spec(1, 16, SampleFormat::Int),
        spec(1, 24, SampleFormat::Int),
        spec(1, 32, SampleFormat::Int),
        spec(1, 32, SampleFormat::Float),
    ];
    for format in formats {
        write(&file("tone.wav"), format, 3, tone(0.05, 1000.0));
        write(&file("machine.wav"), format, 5, tone(0.1, 1000.0));
        for weighting in ["A", "C", "Z"] {
            let arguments = ["machine.wav", "--calibration", "tone.wav", "--weighting", weighting];
            let found = answer(&folder, &arguments);
            let expected = 94.0 + 20.0 * 2f64.log10();
            // 16 bit round a sine of 0.05 to 3e-4 of its power at most: 1e-3 dB.
            let leq = level(&found, &format!("equivalent level L{weighting}eq"));
            assert!((leq - expected).abs() < 5e-3, "{format:?} {weighting}: {leq}");
            let slow = level(&found, &format!("largest level L{weighting}Smax"));
            // After 5 s the average has reached 1 − e⁻⁵: −0.03 dB.
            assert!((slow - expected - 10.0 * (1.0 - (-5f64).exp()).log10()).abs() < 0.01, "{slow}");
        }
    }
}

#[test]
fn the_weighting_of_low_tones_is_that_of_the_standard() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("hum.wav"), spec(1, 24, SampleFormat::Int), 10, tone(0.1, 100.0));
    let of = |weighting: &str| {
        let found = answer(&folder, &["hum.wav", "--pascal-per-unit", "10", "--weighting", weighting]);
        level(&found, &format!("equivalent level L{weighting}eq"))
    };
    // 1 Pa at 100 Hz: A −19.1 dB, C −0.3 dB, rounded to 0.1 dB.
    assert!((of("Z") - 93.979).abs() < 0.01);
    assert!((of("A") - 93.979 + 19.1).abs() < 0.06, "{}", of("A"));
    assert!((of("C") - 93.979 + 0.3).abs() < 0.06, "{}", of("C"));
}

/// Noise with a seed at two levels: the source is the energetic difference, or bounded.
#[test]
fn the_background_is_subtracted_or_bounds_the_source() {
    let folder = TempDir::new().unwrap();
    let noise = |name: &str, scale: f64, seed: u64| {
        let random = std::cell::RefCell::new(fastrand::Rng::with_seed(seed));
        write(&folder.path().join(name), spec(1, 24, SampleFormat::Int), 10, |_| {
            scale * (random.borrow_mut().f64() - 0.5)
        });
    };
    noise("both.wav", 0.1, 11);
    noise("quiet.wav", 0.1 / 10f64.sqrt(), 977);
    noise("near.wav", 0.08, 31);
    let found =
        answer(&folder, &["both.wav", "--pascal-per-unit", "1", "--background", "quiet.wav", "--weighting", "Z"]);
    let (both, quiet) =
        (level(&found, "equivalent level LZeq"), level(&found, "equivalent level LZeq of the background"));
    // Uniform noise of ±0.05 has the mean square 0.1²/12.
    assert!((both - 10.0 * (0.01f64 / 12.0 / 4e-10).log10()).abs() < 0.05, "{both}");
    assert!((both - quiet - 10.0).abs() < 0.1);
    let source = level(&found, "equivalent level LZeq without the background");
    assert!((source - both + 0.458).abs() < 0.02, "{source} of {both}");
    let near = answer(&folder, &["both.wav", "--pascal-per-unit", "1", "--background", "near.wav", "--weighting", "Z"]);
    let quantities = near["estimates"].to_string();
    assert!(!quantities.contains("without the background"), "{quantities}");
    assert!(near["remarks"].to_string().contains("at most"), "{near}");
}

#[test]
fn a_table_in_pascal_needs_no_calibration() {
    let folder = TempDir::new().unwrap();
    let mut text = "t_s,sound_pa\n".to_string();
    for n in 0..40_000 {
        let t = f64::from(n) / 10_000.0;
        writeln!(text, "{t:.4},{:.6}", tone(1.0, 1000.0)(t + 1e-5)).unwrap();
    }
    std::fs::write(folder.path().join("sound.csv"), text).unwrap();
    let found = answer(&folder, &["sound.csv"]);
    assert!((level(&found, "equivalent level LAeq") - 93.98).abs() < 0.01, "{found}");
}

#[test]
fn files_that_cannot_be_evaluated_are_refused_with_what_to_do() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    let refused = |more: &[&str], says: &[&str]| {
        let output = damprig(&folder).args(["identify", "sound"]).args(more).assert().code(2).get_output().clone();
        let message = String::from_utf8(output.stderr).unwrap();
        for part in says {
            assert!(message.contains(part), "{part:?} is not in:\n{message}");
        }
    };
    let mono = spec(1, 16, SampleFormat::Int);
    write(&file("good.wav"), mono, 2, tone(0.1, 1000.0));
    refused(&["good.wav"], &["calibration is not known", "--calibration FILE", "--pascal-per-unit"]);
    refused(&["none.wav", "--pascal-per-unit", "1"], &["cannot read none.wav"]);
    refused(&["good.wav", "--pascal-per-unit", "1", "--window-s", "60"], &["a window of 60 s does not fit", "2.000 s"]);
    refused(
        &["good.wav", "--pascal-per-unit", "1", "--channel", "2"],
        &["there is no signal \"2\"", "good.wav#1: channel 1"],
    );
    refused(&["good.wav", "--pascal-per-unit", "1", "--out", "a.toml"], &["none of the results is a key"]);
    write(&file("loud.wav"), mono, 2, |t| (3.0 * tone(0.5, 100.0)(t)).clamp(-1.0, 1.0));
    refused(&["loud.wav", "--pascal-per-unit", "1"], &["it is clipped", "lower gain"]);
    write(&file("stereo.wav"), spec(2, 16, SampleFormat::Int), 2, tone(0.1, 1000.0));
    refused(&["stereo.wav", "--pascal-per-unit", "1"], &["it has 2 signals: which one?", "stereo.wav#2: channel 2"]);
    damprig(&folder)
        .args(["identify", "sound", "stereo.wav", "--pascal-per-unit", "1", "--channel", "2"])
        .assert()
        .success();
    write(&file("hum.wav"), mono, 2, tone(0.1, 50.0));
    refused(&["good.wav", "--calibration", "hum.wav"], &["hum.wav", "is not that of a calibrator", "mains hum"]);
    let random = std::cell::RefCell::new(fastrand::Rng::with_seed(1));
    write(&file("noise.wav"), mono, 2, |_| 0.1 * (random.borrow_mut().f64() - 0.5));
    refused(&["good.wav", "--calibration", "noise.wav"], &["noise.wav", "no calibration tone"]);
    write(&file("silent.wav"), mono, 2, |_| 0.0);
    refused(&["silent.wav", "--pascal-per-unit", "1"], &["it is silent"]);
    let mut broken = std::fs::read(file("good.wav")).unwrap();
    // Format tag 6, A-law.
    broken[20] = 6;
    std::fs::write(file("alaw.wav"), &broken).unwrap();
    refused(&["alaw.wav", "--pascal-per-unit", "1"], &["not a WAV file of a known kind", "PCM of 16"]);
    let cut = std::fs::read(file("good.wav")).unwrap();
    std::fs::write(file("cut.wav"), &cut[..cut.len() / 2 + 1]).unwrap();
    refused(&["cut.wav", "--pascal-per-unit", "1"], &["damaged"]);
    std::fs::write(file("text.wav"), "t_s,sound_v\n").unwrap();
    refused(&["text.wav", "--pascal-per-unit", "1"], &["there is no row of numbers", "WAV"]);
    std::fs::write(file("slow.csv"), "t_s,sound_v\n0,1\n0.001,2\n0.002,1\n").unwrap();
    refused(&["slow.csv", "--pascal-per-unit", "1"], &["1000 samples per second are too few", "at least 8000"]);
}
