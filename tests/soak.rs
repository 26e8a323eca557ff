//! Long experiment without any loss: eight signals at 1 kHz and every impact, through the whole recorder.
//!
//! Takes 60 s of device time, or `DAMPRIG_SOAK_S` seconds (`tests/run --full`: an hour).

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Instant;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, UInt32Type, UInt64Type};
use damprig_tests::support::command::{damprig, table, told};
use damprig_tests::support::emulator::Emulator;
use damprig_tests::support::images::find;
use serde_json::Value;
use tempfile::TempDir;

/// Minimum dwell time at each frequency.
const DWELL_S: u32 = 20;

/// Maximum number of frequencies: below the capacity of a controller.
const MAX_POINTS: u32 = 90;

const TICK_HZ: u64 = 1000;

fn seconds() -> u32 {
    let Ok(text) = std::env::var("DAMPRIG_SOAK_S") else { return 60 };
    text.parse().unwrap_or_else(|_| panic!("DAMPRIG_SOAK_S={text}: must be a whole number of seconds"))
}

/// A campaign of this length with a hybrid damper: more frequencies first, then a longer dwell at each.
fn campaign(seconds: u32) -> String {
    let dwell_s = seconds.div_ceil(MAX_POINTS).max(DWELL_S);
    let points = seconds.div_ceil(dwell_s);
    let frequencies: Vec<String> =
        (0..points).map(|n| format!("{}", 2.2 + 0.6 * f64::from(n) / f64::from(points))).collect();
    format!(
        r#"
name = "soak"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.5
damping_ratio = 0.0038
[rig]
sensor_resolution_m = 10e-6
sensor_noise_rms_m = 5e-6
noise_seed = 7
[[set_up]]
name = "hybrid"
base_amplitude_m = 0.0015
particle = {{ mass_ratio = 0.1, clearance_ratio = 5, wall = {{ kind = "restitution", coefficient = 0.47 }} }}
friction_damper = {{ friction_ratio = 0.4 }}
[[experiment]]
name = "soak"
kind = "stepped_sine"
frequencies_hz = [{}]
start = "from_rest"
settle_s = 0.0
dwell_s = {dwell_s}
[telemetry]
rate_hz = {TICK_HZ}
signals = ["x", "z", "drive", "frequency", "x_peak", "impacts", "wall_low", "wall_high"]
"#,
        frequencies.join(", ")
    )
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The last tick of each start of the device, as reported by the device when it finished.
fn last_ticks(run: &Path) -> BTreeMap<u64, u64> {
    let journal = fs::read_to_string(run.join("journal.jsonl")).unwrap();
    let lines = journal.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let finished = lines.filter(|line| line["entry"] == "finished");
    finished.map(|line| (line["segment"].as_u64().unwrap(), line["end_tick"].as_u64().unwrap())).collect()
}

/// Runs the campaign on `rig` and accounts for every tick and every impact.
fn soak(what: &str, rig: &str) {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let seconds = seconds();
    let (file, run) = (folder.join("soak.toml"), folder.join("run"));

    let began = Instant::now();
    fs::write(&file, campaign(seconds)).unwrap();
    let output =
        damprig().arg("run").arg(&file).args(["--rig", rig, "--timeout", "120", "--out"]).arg(&run).output().unwrap();
    let wall_s = began.elapsed().as_secs_f64();
    assert!(output.status.success(), "--rig {rig}: {}", told(&output));
    let last_ticks = last_ticks(&run);
    let manifest = json(&run.join("manifest.json"));
    let counters = manifest["counters"].as_object().unwrap();
    let is_clean = counters.len() > 5 && counters.values().all(|count| *count == 0);
    assert!(is_clean && last_ticks.len() == 1, "{counters:?}, {last_ticks:?}: {}", told(&output));
    let (mut expected, mut counted) = (0, 0.0);
    for batch in table(&run.join("samples.parquet")) {
        let ticks = batch.column_by_name("tick").unwrap().as_primitive::<UInt64Type>();
        let gaps = batch.column_by_name("gap_before_ticks").unwrap().as_primitive::<UInt32Type>();
        assert!(gaps.values().iter().all(|gap| *gap == 0), "a gap");
        for tick in ticks.values() {
            assert_eq!(*tick, expected, "a tick is missing or repeated");
            expected += 1;
        }
        let count = batch.column_by_name("impacts").unwrap().as_primitive::<Float32Type>();
        counted = count.values().iter().copied().fold(counted, f32::max);
    }
    assert_eq!(expected, last_ticks[&0] + 1, "the last rows are missing");
    assert!(expected >= u64::from(seconds) * TICK_HZ, "{expected} ticks are too few");
    assert_eq!(manifest["sample_rows"], expected);
    let impacts = table(&run.join("impacts.parquet"));
    let impacts: u64 = impacts.iter().map(|batch| batch.num_rows() as u64).sum();
    assert_eq!(impacts as f32, counted, "the device's count of impacts differs from the impacts that it reported");
    let verified = damprig().args(["runs", "verify"]).arg(&run).output().unwrap();
    assert!(verified.status.success(), "{}", told(&verified));
    println!("{what}: {expected} ticks of 8 signals and {impacts} impacts, none lost, in {wall_s:.0} s");
}

#[test]
fn the_virtual_rig_loses_nothing() {
    soak("virtual rig", "virtual");
}

#[test]
fn the_emulated_board_loses_nothing_over_tcp() {
    let Some(image) = find("mps2-an386") else { return };
    let emulator = Emulator::start(&image);
    soak("emulated board", &emulator.address());
}
