//! Noise as a base motion: played, kept in the run folder, the same for the same seed, and simulated in a case.

use predicates::str::contains;

use crate::common::{damprig, folder_with, manifest, read_parquet};

const CAMPAIGN: &str = r#"name = "noise"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.5
damping_ratio = 0.02
[[set_up]]
name = "bare"
base_amplitude_m = 0.001
[[experiment]]
name = "noise"
kind = "playback"
target_peak_m = 0.002
noise = { seed = 7, from_hz = 0.5, to_hz = 10, duration_s = 8, envelope = { rise_s = 1, fall_s = 1 } }
[telemetry]
rate_hz = 1000
signals = ["x", "z", "drive"]
"#;

/// The rows of a kept record: times and displacements.
fn kept(run: &std::path::Path) -> Vec<(f64, f64)> {
    let text = std::fs::read_to_string(run.join("records/1-noise.csv")).unwrap();
    assert!(text.starts_with("t_s,z_m\n"));
    let pair = |line: &str| {
        let (t, z) = line.split_once(',').unwrap();
        (t.parse().unwrap(), z.parse().unwrap())
    };
    text.lines().skip(1).map(pair).collect()
}

#[test]
fn the_base_follows_the_noise_that_the_run_folder_keeps() {
    let folder = folder_with(CAMPAIGN);
    damprig(&folder)
        .args(["run", "test.toml", "--out", "run"])
        .assert()
        .success()
        .stdout(contains("noise from 0.5 Hz to 10 Hz, seed 7"));
    let run = folder.path().join("run");
    let rows = kept(&run);
    assert_eq!(rows.len(), 8001);
    let peak = rows.iter().fold(0.0f64, |most, row| most.max(row.1.abs()));
    assert!((peak - 0.002).abs() < 1e-15);
    assert_eq!((rows[0].1, rows[8000].1), (0.0, 0.0));
    // Played at the tick rate: the drive is the record, in counts of a 32 767th of the peak.
    let folder_of_run = damprig::run_folder::RunFolder::open(&run).unwrap();
    let drive: Vec<f64> = folder_of_run
        .samples()
        .flat_map(|batch| damprig::table::values::numbers(&batch.unwrap(), "drive_m").unwrap())
        .collect();
    let begins = drive.iter().position(|z| *z != 0.0).unwrap();
    let first = rows.iter().position(|row| (row.1 / 0.002 * 32767.0).abs() > 0.5).unwrap();
    let worst = (0..7000).map(|n| (drive[begins + n] - rows[first + n].1).abs()).fold(0.0, f64::max);
    assert!(worst < 0.002 / 32767.0, "{worst:.2e} m");
    damprig(&folder).args(["runs", "verify", "run"]).assert().success();
    // Another run of the same seed has the same bits, another seed has others.
    damprig(&folder).args(["run", "test.toml", "--out", "again"]).assert().success();
    assert_eq!(kept(&folder.path().join("again")), rows);
    let of = |run: &str| manifest(&folder.path().join(run))["files"].clone();
    let file = |run: &str, name: &str| of(run).as_array().unwrap().iter().find(|f| f["name"] == name).cloned().unwrap();
    let record = "records/1-noise.csv";
    assert_eq!(file("run", record)["sha256"], file("again", record)["sha256"]);
    // The file of a table names its run.
    let columns = |run: &str| -> Vec<_> {
        let table = read_parquet(folder.path().join(run).join("transients.parquet"));
        table.iter().flat_map(|batch| batch.columns().to_vec()).collect()
    };
    assert_eq!(format!("{:?}", columns("run")), format!("{:?}", columns("again")));
    std::fs::write(folder.path().join("other.toml"), CAMPAIGN.replace("seed = 7", "seed = 8")).unwrap();
    damprig(&folder).args(["run", "other.toml", "--out", "other"]).assert().success();
    assert_ne!(kept(&folder.path().join("other")), rows);
    // A kept record that was changed is told.
    let path = run.join("records/1-noise.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen(",0\n", ",1\n", 1)).unwrap();
    damprig(&folder).args(["runs", "verify", "run"]).assert().failure().stdout(contains("1-noise.csv"));
}

#[test]
fn a_case_on_noise_has_the_motion_of_the_campaign() {
    let case = |keys: &str| {
        let text = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.02 }}\nrun = {{ duration_s = 9 }}\n[base]\nkind = \
             \"record\"\n{keys}\n"
        );
        damprig::simulation::Case::parse(&damprig::input::Source::new("case.toml", &text), "case")
    };
    let noise =
        "noise = { seed = 7, from_hz = 0.5, to_hz = 10, duration_s = 8, envelope = { rise_s = 1, fall_s = 1 } }";
    let case_record = case(&format!("{noise}\ntarget_peak_m = 0.002")).unwrap().record.unwrap();
    let campaign = damprig::campaign::Campaign::parse(damprig::input::Source::new("test.toml", CAMPAIGN)).unwrap();
    assert_eq!(case_record.samples, campaign.experiments[0].playback().unwrap().samples_m);
    assert!(case(noise).unwrap_err().to_string().contains("target_peak_m"));
    let file = "file = \"a.csv\"\ntarget_peak_m = 0.002";
    assert!(case(file).unwrap_err().to_string().contains("goes with `noise`, which is not given"));
}

#[test]
fn keys_of_a_noise_that_cannot_be_are_refused_with_the_fix() {
    let refused = |from: &str, to: &str, says: &[&str]| {
        let text = CAMPAIGN.replace(from, to);
        assert_ne!(text, CAMPAIGN, "{from:?} is not in the campaign");
        let message = damprig::campaign::Campaign::parse(damprig::input::Source::new("test.toml", &text))
            .unwrap_err()
            .to_string();
        for part in says {
            assert!(message.contains(part), "{part:?} is not in:\n{message}");
        }
    };
    refused("to_hz = 10", "to_hz = 0.4", &["experiment[1].noise.to_hz", "greater than from_hz = 0.5"]);
    refused("to_hz = 10", "to_hz = 200", &["at most 100"]);
    refused("duration_s = 8", "duration_s = 600", &["duration_s", "holds 20480", "write at most duration_s = 204"]);
    refused("duration_s = 8", "duration_s = 0.1", &["rise_s and fall_s are 2 s together"]);
    refused("to_hz = 10", "to_hz = 1.2", &["the band has 6 frequencies", "at least 10"]);
    refused("target_peak_m = 0.002\n", "", &["target_peak_m"]);
    refused("target_peak_m = 0.002", "target_peak_m = 0.002\nfile = \"a.csv\"", &["file", "noise"]);
    refused("target_peak_m = 0.002", "target_peak_m = 0.002\nbaseline = \"linear\"", &["baseline", "noise"]);
    refused("target_peak_m = 0.002", "target_peak_m = 0.002\nsample_rate_hz = 50", &["from 100 to 1000"]);
    refused("seed = 7", "sed = 7", &["unknown key", "seed"]);
    refused("rise_s = 1, ", "", &["rise_s"]);
}
