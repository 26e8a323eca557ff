//! Signals of which the user states what the file does not: unit, and sensitivity of the sensor. Strong-motion records in the COSMOS format.

use std::f64::consts::TAU;

use crate::common::{damprig, folder_with};
use damprig::signal_file::unit::UnitKind;
use damprig::signal_file::{Signal, SignalAxis, parse};
use serde_json::Value;
use tempfile::TempDir;

/// 6 s of a decay of 8 Hz and ζ = 0.01, at 500 Hz: t in s and a value, in the text of a table.
fn decay(head: &str, scale: f64) -> String {
    let value = |n: u32| {
        let t = f64::from(n) / 500.0;
        (t, scale * (-0.01 * TAU * 8.0 * t).exp() * (TAU * 8.0 * (1.0f64 - 1e-4).sqrt() * t).cos())
    };
    let rows: String = (0..3000).map(value).map(|(t, v)| format!("{t:.4},{v:.9}\n")).collect();
    format!("{head}\n{rows}")
}

fn run(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = damprig(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_decay_in_millivolts_with_a_sensitivity_is_that_of_the_same_acceleration() {
    let folder = folder_with("");
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("g.csv", decay("t_s,a_g", 0.4));
    write("mv.csv", decay("t_s,ch1_mV", 0.4 * 102.0));
    write("bare.csv", decay("t_s,ch1", 0.4 * 102.0));
    let estimates = |arguments: &[&str]| {
        let (code, json, error) = run(&folder, &[&["identify", "decay"], arguments, &["--json"]].concat());
        assert_eq!(code, Some(0), "{arguments:?}: {error}");
        let json: Value = serde_json::from_str(&json).unwrap();
        json["estimates"].as_array().unwrap().iter().map(|one| one["value"].as_f64().unwrap()).collect::<Vec<f64>>()
    };
    let expected = estimates(&["g.csv"]);
    for arguments in [
        &["mv.csv", "--sensitivity", "102 mV/g"][..],
        &["bare.csv", "--unit", "mV", "--sensitivity", "102 mV/g"],
        &["bare.csv", "--unit", "mV", "--sensitivity", "0.102 V/g"],
    ] {
        let found = estimates(arguments);
        // Frequency and damping ratio, which the nine decimals of the tables give to 1e-8.
        for (a, b) in found.iter().zip(&expected).take(2) {
            assert!((a / b - 1.0).abs() < 1e-7, "{arguments:?}: {found:?} {expected:?}");
        }
    }
    for (arguments, words) in [
        (&["mv.csv"][..], "is a voltage"),
        (&["bare.csv"], "state it with --unit"),
        (&["bare.csv", "--unit", "parsec"], "must be a unit such as"),
        (&["bare.csv", "--unit", "mV"], "--sensitivity"),
        (&["mv.csv", "--sensitivity", "0 mV/g"], "greater than 0"),
        (&["mv.csv", "--sensitivity", "102"], "\"100 mV/g\""),
        (&["mv.csv", "--sensitivity", "22 mV/N"], "is a force"),
        (&["g.csv", "--sensitivity", "102 mV/g"], "leave out the sensitivity"),
        (&["g.csv", "--unit", "m/s2"], "leave out the unit"),
    ] {
        let (code, _, error) = run(&folder, &[&["identify", "decay"], arguments].concat());
        assert_eq!(code, Some(2), "{arguments:?}");
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
}

fn wav(folder: &TempDir, name: &str, count: u32, rate_hz: u32, sample: impl Fn(f64) -> f64) {
    let format = hound::WavSpec {
        channels: 1,
        sample_rate: rate_hz,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(folder.path().join(name), format).unwrap();
    for n in 0..count {
        writer.write_sample(sample(f64::from(n) / f64::from(rate_hz)) as f32).unwrap();
    }
    writer.finalize().unwrap();
}

#[test]
fn a_calibrators_tone_gives_the_unit_of_a_recording() {
    let folder = folder_with("");
    // A calibrator of 10 m/s² RMS at 159.2 Hz gives 0.05 of full scale.
    wav(&folder, "tone.wav", 12_000, 4000, |t| 0.05 * 2f64.sqrt() * (TAU * 159.2 * t).sin());
    wav(&folder, "hum.wav", 12_000, 4000, |t| 0.05 * (TAU * 2.0 * t).sin());
    wav(&folder, "sine.wav", 8000, 4000, |t| 0.02 * (TAU * t).sin());
    std::fs::write(folder.path().join("g.csv"), "t_s,a_g\n0,1\n0.01,2\n0.02,1\n0.03,0\n0.04,1\n0.05,1\n").unwrap();
    let spectrum = ["spectrum", "sine.wav", "--periods", "1", "--json", "--calibration"];
    let (code, json, error) = run(&folder, &[&spectrum[..], &["tone.wav", "--calibration-rms", "10 m/s2"]].concat());
    assert_eq!(code, Some(0), "{error}");
    let json: Value = serde_json::from_str(&json).unwrap();
    // 0.02 of full scale; the window's leakage at the ends of the tone is less than 1e-4.
    assert!((json["peak_m_per_s2"].as_f64().unwrap() / 4.0 - 1.0).abs() < 1e-4, "{json}");
    for (arguments, words) in [
        (&["hum.wav", "--calibration-rms", "10 m/s2"][..], "2.0 Hz is not that of a calibrator"),
        (&["sine.wav", "--calibration-rms", "10"], "write it with its unit"),
        (&["tone.wav", "--calibration-rms", "0 g"], "write it with its unit"),
        (&["g.csv", "--calibration-rms", "10 m/s2"], "calibrates nothing"),
        (&["absent.wav", "--calibration-rms", "10 m/s2"], "absent.wav"),
        (&["tone.wav"], "--calibration-rms"),
        (&["tone.wav", "--calibration-rms", "10 m/s2", "--unit", "g"], "cannot be used with"),
        (&["tone.wav", "--calibration-rms", "94 Pa"], "is a pressure"),
    ] {
        let (code, _, error) = run(&folder, &[&spectrum[..], arguments].concat());
        assert_eq!(code, Some(2), "{arguments:?}");
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
    let of_g = ["spectrum", "g.csv", "--calibration", "tone.wav", "--calibration-rms", "10 m/s2"];
    let (_, _, error) = run(&folder, &of_g);
    assert!(error.contains("record both on the same channel"), "{error}");
}

#[test]
fn a_file_of_damprig_itself_is_named_with_its_command() {
    let folder = folder_with(&crate::common::short());
    let (code, said, error) = run(&folder, &["inspect", "test.toml"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("Campaign of damprig") && said.contains("damprig run"), "{said}");
    let (_, said, _) = run(&folder, &["inspect", "."]);
    assert!(said.contains("a folder; name a file in it"), "{said}");
}

#[test]
fn a_record_in_millivolts_with_a_sensitivity_is_the_record_in_its_unit() {
    let folder = folder_with("");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("g.csv", "t_s,a_g\n0,0.1\n0.01,0.2\n0.02,-0.1\n0.03,-0.05\n0.04,0\n");
    write("mv.csv", "t_s,ch1_mV\n0,50\n0.01,100\n0.02,-50\n0.03,-25\n0.04,0\n");
    write("bare.csv", "t_s,ch1\n0,50\n0.01,100\n0.02,-50\n0.03,-25\n0.04,0\n");
    let summary = |record: &str| {
        let text = format!(
            "structure = {{ mass_kg = 4, natural_frequency_hz = 5, damping_ratio = 0.02 }}\nbase = {{ kind = \"record\", {record} }}\nrun = {{ duration_s = 1 }}\n"
        );
        write("case.toml", &text);
        let (code, json, error) = run(&folder, &["simulate", "case.toml", "--json"]);
        if code == Some(0) { Ok(serde_json::from_str::<Value>(&json).unwrap()["summary"].clone()) } else { Err(error) }
    };
    let peak = |summary: &Value| summary["max_abs_x_minus_z_m"].as_f64().or(summary["x_minus_z_max_m"].as_f64());
    let expected = summary("file = \"g.csv\"").unwrap();
    assert!(peak(&expected).is_some(), "{expected}");
    for record in [
        "file = \"mv.csv\", sensitivity = \"500 mV/g\"",
        "file = \"bare.csv\", unit = \"mV\", sensitivity = \"0.5 V/g\"",
    ] {
        let found = summary(record).unwrap();
        let (found, expected) = (peak(&found).unwrap(), peak(&expected).unwrap());
        assert!((found / expected - 1.0).abs() < 1e-12, "{record}: {found} {expected}");
    }
    for (record, words) in [
        ("file = \"mv.csv\"", "sensitivity = \"100 mV/g\""),
        ("file = \"bare.csv\", unit = \"mV\"", "sensitivity = \"100 mV/g\""),
        ("file = \"mv.csv\", sensitivity = \"0 mV/g\"", "greater than 0"),
        ("file = \"mv.csv\", sensitivity = \"22 mV/N\"", "is a force"),
    ] {
        let error = summary(record).unwrap_err();
        assert!(error.contains(words), "{record}: {error}");
    }
}

/// A channel of a COSMOS V2 file with 24 accelerations and velocities of exact decimals.
fn cosmos(channel: u32, step_ms: f64, recorder_step_s: f64) -> String {
    let mut real = [-999.0; 65];
    (real[33], real[61]) = (recorder_step_s, step_ms);
    let rows = |values: &[f64], per_row: usize, width: usize, decimals: usize| -> String {
        let row = |row: &[f64]| row.iter().map(|v| format!("{v:width$.decimals$}")).collect::<String>() + "\n";
        values.chunks(per_row).map(row).collect()
    };
    let values: Vec<f64> = (0..24).map(|n| -1000.0 - f64::from(n * channel) / 8.0).collect();
    format!(
        "Corrected acceleration    (Format v01.20 with 13 text lines)\nRecord of an earthquake\n\
         Sta Chan   {channel}: 90 Deg (Rcrdr Chan  1) Location:Ground\n  \
         10 Integer-header values follow on   1 lines, Format= (10I8)\n{}  \
         65 Real-header values follow on  13 lines, Format= (5F15.6)\n{}   1 Comment line(s) follow, each starting with a \"|\":\n|\n      \
         24 acceleration pts, approx    0 secs, units=cm/sec2(04),Format=(8F9.3)\n{}End-of-data for Chan  {channel} acceleration\n      \
         24 velocity     pts, approx    0 secs, units=cm/sec (05),Format=(8F10.3)\n{}End-of-data for Chan  {channel} velocity\n",
        rows(&[0.0; 10], 10, 8, 0),
        rows(&real, 5, 15, 6),
        rows(&values, 8, 9, 3),
        rows(&values, 8, 10, 3),
    )
}

#[test]
fn a_cosmos_file_gives_each_quantity_of_each_channel_with_its_own_time_step() {
    let contents = parse(cosmos(1, 5.0, 0.01).as_bytes()).unwrap();
    let [acceleration, velocity]: [Signal; 2] = contents.signals.try_into().unwrap();
    assert_eq!((acceleration.name.as_str(), acceleration.kind()), ("acceleration", Some(UnitKind::Acceleration)));
    assert_eq!((velocity.name.as_str(), velocity.unit.unwrap().si), ("velocity", 0.01));
    // Nine characters for each value leave no blank between them.
    assert_eq!(acceleration.values[..3], [-1000.0, -1000.125, -1000.25]);
    assert_eq!(acceleration.axis, SignalAxis::Time { start_s: 0.0, step_s: 0.005 });
    let of_recorder = parse(cosmos(1, -999.0, 0.01).as_bytes()).unwrap();
    assert_eq!(of_recorder.signals[0].axis, SignalAxis::Time { start_s: 0.0, step_s: 0.01 });
    let both = parse((cosmos(1, 5.0, 0.01) + &cosmos(2, 10.0, 0.01)).as_bytes()).unwrap();
    let names: Vec<&str> = both.signals.iter().map(|signal| signal.name.as_str()).collect();
    let expected = ["acceleration channel 1", "velocity channel 1", "acceleration channel 2", "velocity channel 2"];
    assert_eq!(names, expected);
    assert_eq!(both.signals[2].axis, SignalAxis::Time { start_s: 0.0, step_s: 0.01 });
}

#[test]
fn a_damaged_cosmos_file_is_refused_with_the_line() {
    let whole = cosmos(1, 5.0, 0.01);
    for (text, words) in [
        (whole[..whole.find("-1002.000").unwrap()].to_string(), "line 22: 24 values are announced, 16 follow"),
        (whole[..whole.find("   24 acc").unwrap()].to_string(), "no values follow the header"),
        (cosmos(1, -999.0, -999.0), "line 22: the time step of the values is missing"),
        (whole.replacen("-1000.125", "-1000.l25", 1), "line 23, column 10: \"-1000.l25\" is not a finite number"),
        (whole.replacen("24 acceleration", "1 acceleration", 1), "line 22: 1 values are too few"),
    ] {
        let error = parse(text.as_bytes()).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
    // Counts have no physical unit.
    let counts = parse(whole.replace("units=cm/sec2(04)", "units=counts (50)").as_bytes()).unwrap();
    assert_eq!(counts.signals[0].unit, None);
    assert!(counts.signals[0].remark.as_ref().unwrap().contains("counts"), "{:?}", counts.signals[0].remark);
}

#[test]
fn a_record_whose_times_jitter_is_resampled_with_a_stated_error() {
    let folder = folder_with("");
    // A sine of 1 Hz at 100 Hz whose times jitter by up to 2 ms; the same at 3 Hz and 10 Hz is too coarse.
    let write = |name: &str, frequency_hz: f64, rate_hz: f64, gap: bool| {
        let mut random = fastrand::Rng::with_seed(20_261_125);
        let rows: String = (0..400)
            .filter(|n| !gap || !(150..160).contains(n))
            .map(|n| {
                let t = (f64::from(n) + 0.2 * random.f64()) / rate_hz;
                format!("{t:.6},{:.9}\n", (TAU * frequency_hz * t).sin())
            })
            .collect();
        std::fs::write(folder.path().join(name), format!("t_s,a_m_per_s2\n{rows}")).unwrap();
    };
    write("jitter.csv", 1.0, 100.0, false);
    write("coarse.csv", 3.0, 10.0, false);
    write("gap.csv", 1.0, 100.0, true);
    let (code, said, error) = run(&folder, &["spectrum", "jitter.csv", "--damping", "0.05", "--periods", "1"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("its times jitter: resampled by cubics"), "{said}");
    let (_, json, _) = run(&folder, &["spectrum", "jitter.csv", "--periods", "1", "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    // Four periods of resonance from rest: 1/(2ζω²)·(1 − exp(−8πζ)), to 1 % for the phase of the damped motion.
    let expected = (1.0 - (-4.0 * TAU * 0.05f64).exp()) / (0.1 * TAU * TAU);
    let found = json["spectra"][0]["sd_m"].as_f64().unwrap();
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    for (file, words) in [
        ("coarse.csv", "line 12: a step of"),
        ("coarse.csv#1", "at most 1 % are allowed"),
        ("gap.csv", "line 12: a step of"),
        ("gap.csv#a", "gaps, the first of"),
    ] {
        let (code, _, error) = run(&folder, &["spectrum", file]);
        assert_eq!(code, Some(2), "{file}");
        assert!(error.contains(words), "{file}: {error}");
    }
}
