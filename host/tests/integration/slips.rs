//! Everyday mishaps: a closed pipe, a full disk, a wrong file. Each ends with a message that says what to do, and with the rig
//! stopped.

use std::io::Read;
use std::process::{Command as Program, Stdio};

use crate::common::{PATIENCE, damprig, folder_with, manifest, short};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// A campaign with one experiment on a bare structure.
fn with(experiment: &str) -> TempDir {
    folder_with(&format!(
        "name = \"t\"\nstructure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n[rig]\nsensor_noise_rms_m = 5e-6\n[[set_up]]\nname = \"bare\"\nlabel = \"Bare\"\nbase_amplitude_m = 0.003\n[[experiment]]\nname = \"e\"\n{experiment}\n[telemetry]\nrate_hz = 200\nsignals = [\"x\"]\n"
    ))
}

/// The messages of a refused dry run.
fn refused(experiment: &str, record: &[u8]) -> String {
    let folder = with(experiment);
    std::fs::write(folder.path().join("r.csv"), record).unwrap();
    let output = damprig(&folder).args(["run", "test.toml", "--dry-run"]).timeout(PATIENCE).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{experiment}: {said}");
    said
}

#[cfg(unix)]
#[test]
fn a_run_continues_when_its_output_pipe_is_closed() {
    let folder = folder_with(&short());
    let mut run = Program::new(assert_cmd::cargo::cargo_bin("damprig"))
        .args(["run", "test.toml", "--out", "out"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Like `| head -c 1`: reads one character, then closes the pipe.
    run.stdout.take().unwrap().read_exact(&mut [0]).unwrap();
    drop(run.stderr.take());
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_eq!(manifest(&folder.path().join("out"))["status"], "complete");
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_no_partial_settings_file() {
    let folder = folder_with("");
    let binary = assert_cmd::cargo::cargo_bin("damprig");
    let command = format!("ulimit -f 1; exec {} settings export rig.toml", binary.display());
    // Shell blocks have 512 or 1024 bytes; the file is larger.
    let output = Program::new("sh").args(["-c", &command]).current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot write rig.toml: File too large"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "test.toml alone");
}

#[test]
fn importing_settings_of_another_board_gives_a_note() {
    let folder = folder_with("");
    damprig(&folder).args(["settings", "export", "rig.toml"]).assert().success();
    let path = folder.path().join("rig.toml");
    damprig(&folder)
        .args(["settings", "import", "rig.toml"])
        .assert()
        .success()
        .stderr(contains("is from the board").not());
    let other = std::fs::read_to_string(&path).unwrap().replace("Settings of virtual,", "Settings of nucleo-g474re,");
    std::fs::write(&path, other).unwrap();
    damprig(&folder)
        .args(["settings", "import", "rig.toml"])
        .assert()
        .success()
        .stderr(contains("note: rig.toml is from the board nucleo-g474re, this is virtual"));
}

#[test]
fn empty_or_duplicate_settings_are_refused() {
    let folder = folder_with("");
    std::fs::write(folder.path().join("empty.toml"), "# later\n").unwrap();
    let cases: [(&[&str], &str); 3] = [
        (&["import", "empty.toml"], "the file sets nothing"),
        (&["set", "=3"], "write KEY=VALUE"),
        (&["set", "spring.step_m=4e-6", "spring.step_m=5e-6"], "`spring.step_m` is given twice"),
    ];
    for (arguments, words) in cases {
        damprig(&folder).arg("settings").args(arguments).assert().code(2).stderr(contains(words));
    }
}

#[test]
fn a_table_that_a_format_cannot_hold_is_refused_and_no_empty_file_is_written() {
    let folder = with("kind = \"impulse\"\nshape = \"versine\"\namplitude_m = 0.004\nduration_s = 0.2");
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    damprig(&folder)
        .args(["runs", "export", "out", "--format", "uff", "--what", "transients"])
        .assert()
        .code(2)
        .stderr(contains("--format uff --what transients").and(contains("use csv, mat or h5")));
    assert!(!folder.path().join("out-transients.uff").exists());
}

#[test]
fn an_invalid_record_is_refused_with_what_it_lacks() {
    let spec = "kind = \"playback\"\nfile = \"r.csv\"\nquantity = \"displacement\"\nunit = \"mm\"";
    let step = |s: &str| format!("{spec}\ntime_step_s = {s}");
    let cases: [(&str, &[u8], &str); 9] = [
        ("0.01", b"", "it holds no row of numbers"),
        ("0.01", b"z_mm\n", "it holds no row of numbers"),
        ("0.01", b"1\n", "1 samples; a motion has at least 2"),
        ("0.01", b"\x7fELF\x00\x01", "this is a binary file of an unknown kind"),
        ("0.01", b"0\nNaN\n0\n", "line 2, column 1: \"NaN\" is not allowed"),
        ("0.01", b"z\ty\n0,5\t1\n", "there are 2 columns"),
        ("1e-12", b"0\n1\n0\n", "the base would have no time to move"),
        ("1e9", b"0\n1\n0\n", "has a sample each 1.000e9 s"),
        ("0", b"0\n1\n0\n", "must be greater than 0"),
    ];
    for (step_s, record, words) in cases {
        let said = refused(&step(step_s), record);
        assert!(said.contains(words), "{words:?} is not in: {said}");
    }
    let said = refused(spec, b"t;z\n0,0;0,1\n1,0;0,5\n");
    assert!(said.contains("write the decimals after a point: 0.0"), "{said}");
    let said = refused(spec, b"t,z\n0,0\n1,0,5\n2,0\n");
    assert!(said.contains("line 3: 3 columns where the first row has 2"), "{said}");
    let long: String = (0..30_000).map(|n| format!("{}\n", n % 2)).collect();
    let said = refused(&step("0.007"), long.as_bytes());
    assert!(said.contains("gives 30000 samples in 209.99 s") && said.contains("write sample_rate_hz = 97"), "{said}");
}

#[test]
fn column_names_are_escaped_on_the_terminal() {
    let record = format!("a\x1b[2J,b,{}\n0,1,2\n", "c".repeat(5000));
    let said = refused(
        "kind = \"playback\"\nfile = \"r.csv\"\nquantity = \"displacement\"\nunit = \"mm\"\ntime_step_s = 0.1",
        record.as_bytes(),
    );
    assert!(!said.contains('\x1b') && said.len() < 1000, "{said}");
}

#[test]
fn an_unknown_kind_is_refused_with_the_likely_one() {
    let said = refused("kind = \"free_vibrations\"\nstart_m = 0.03\nmeasure_s = 5", b"");
    assert!(said.contains("did you mean \"free_vibration\"?"), "{said}");
    assert!(!said.contains("is missing") && !said.contains("unknown key"), "{said}");
}

#[test]
fn a_pulse_of_years_is_refused_at_its_duration() {
    let said = refused("kind = \"impulse\"\nshape = \"versine\"\namplitude_m = 0.01\nduration_s = 1e9", b"");
    assert!(said.contains("`experiment[1].duration_s` = 1e9") && said.contains("at most 204790"), "{said}");
}

#[test]
fn a_free_vibration_below_the_noise_or_a_tick_is_refused() {
    let said = refused("kind = \"free_vibration\"\nstart_m = 1e-4\nmeasure_s = 5", b"");
    assert!(said.contains("a hundred times sensor_noise_rms_m"), "{said}");
    let said = refused("kind = \"free_vibration\"\nstart_m = 0.03\nmeasure_s = 1e-4", b"");
    assert!(said.contains("`experiment[1].measure_s` = 1e-4") && said.contains("a tick or more"), "{said}");
}
