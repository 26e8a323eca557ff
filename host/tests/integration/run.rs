//! `damprig run` from the campaign file to the run folder, and the folders of runs that end early.

use crate::common::{
    Fate, Served, damprig, folder_with, is_point, manifest, read_parquet, result_rows, rows, sample_rows, short,
};
use damprig_core::measure::impacts::ImpactRecord;
use damprig_protocol::{Event, FromDevice, Request, ToDevice};
use predicates::prelude::*;
use predicates::str::contains;

/// Points of the short campaign.
const POINTS: usize = 6;

#[test]
fn a_campaign_gives_a_complete_run_folder_that_reads_back() {
    let folder = folder_with(&short());
    let run = folder.path().join("out");
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success().stdout(contains("6 of 6 points"));
    assert_eq!(std::fs::read_to_string(run.join("campaign.toml")).unwrap(), short());
    assert_eq!(rows(run.join("results.parquet")), POINTS);
    let manifest = manifest(&run);
    assert_eq!(manifest["status"], "complete");
    assert_eq!(manifest["signals"][0]["unit"], "m");
    // Each point is driven for 5 s at 100 Hz, after a rest.
    let samples = rows(run.join("samples.parquet"));
    assert!(samples >= POINTS * 500, "{samples} rows");
    assert_eq!(manifest["sample_rows"], samples);
    assert!(!run.join("samples.parts").exists());
    let schema = read_parquet(run.join("results.parquet"))[0].schema();
    assert_eq!(schema.field_with_name("rms_x_m").unwrap().metadata()["unit"], "m");
    let svg = std::fs::read_to_string(run.join("figure.svg")).unwrap();
    assert!(svg.contains("Vibration amplitude ratio X/Z") && svg.contains("Hybrid"));
    assert!(std::fs::read(run.join("figure.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_run_folder_is_made_below_runs_when_none_is_given() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml"]).assert().success();
    let runs: Vec<_> = std::fs::read_dir(folder.path().join("runs")).unwrap().flatten().collect();
    assert_eq!(runs.len(), 1);
    assert!(runs[0].file_name().to_string_lossy().contains("-short-"));
}

#[test]
fn the_link_does_not_change_a_bit() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "direct"]).assert().success();
    let board = Served::start(|_| Fate::Pass);
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "tcp"]).assert().success();
    for file in ["results.parquet", "samples.parquet"] {
        let read = |run: &str| read_parquet(folder.path().join(run).join(file));
        assert_eq!(read("direct"), read("tcp"), "{file}");
    }
}

#[test]
fn a_folder_in_use_is_refused_before_anything_moves() {
    let folder = folder_with(&short());
    std::fs::create_dir(folder.path().join("out")).unwrap();
    std::fs::write(folder.path().join("out/earlier.txt"), "data").unwrap();
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().code(2);
    answer.stderr(contains("cannot use the folder out: it is not empty; give --out a new folder"));
    // Before the campaign is read or predicted, and in a dry run.
    for run in [&["run", "absent.toml"][..], &["run", "test.toml", "--dry-run"]] {
        damprig(&folder)
            .args(run)
            .args(["--out", "out"])
            .assert()
            .code(2)
            .stdout("")
            .stderr(contains("it is not empty"));
    }
    let file = damprig(&folder).args(["run", "test.toml", "--out", "test.toml/run"]).assert().code(1);
    file.stderr(contains("test.toml/run").and(contains("Not a directory")));
}

#[test]
fn a_port_without_a_listener_is_reported_at_once() {
    let folder = folder_with(&short());
    // A port that has just been released.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let rig = format!("tcp:127.0.0.1:{port}");
    let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().code(1);
    answer.stderr(
        contains(format!("cannot reach the rig at {rig}")).and(contains("is the rig (or the emulator) running")),
    );
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_link_that_breaks_during_the_run_keeps_the_points_taken() {
    let folder = folder_with(&short());
    let mut points = 0;
    let board = Served::start(move |message| {
        points += usize::from(is_point(message));
        // The cable is disconnected while the third result is on its way.
        if points == 3 { Fate::Close } else { Fate::Pass }
    });
    let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "out", "--reconnect-s", "0"];
    let answer = damprig(&folder).args(arguments).assert().code(1);
    answer.stderr(contains(format!("the link to {} broke", board.rig)).and(contains("2 of 6 points are kept in out")));
    let run = folder.path().join("out");
    assert_eq!(rows(run.join("results.parquet")), 2);
    assert!(sample_rows(&run) >= 2 * 500);
    assert_eq!(manifest(&run)["status"], "incomplete");
    assert!(run.join("figure.png").exists());
}

#[test]
fn a_silent_device_ends_the_run_and_is_told_to_stop() {
    let folder = folder_with(&short());
    let mut points = 0;
    let board = Served::start(move |message| {
        points += usize::from(is_point(message));
        if points == 2 { Fate::Mute } else { Fate::Pass }
    });
    let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "out", "--timeout", "0.5", "--reconnect-s", "0"];
    let answer = damprig(&folder).args(arguments).assert().code(1);
    answer.stderr(contains(format!("the device at {} stopped answering: nothing for 0.5 s", board.rig)));
    assert_eq!(rows(folder.path().join("out/results.parquet")), 1);
    let stops = |m: &ToDevice| matches!(m, ToDevice::Request(r) if r.request == Request::Stop);
    assert!(board.received().iter().any(stops), "the rig was left driving");
}

#[test]
fn another_protocol_version_is_refused_with_both_sides_named() {
    let folder = folder_with(&short());
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let rig = format!("tcp:{}", listener.local_addr().unwrap());
    let stranger = std::thread::spawn(move || {
        use std::io::{Read, Write};
        let (mut stream, _) = listener.accept().unwrap();
        let mut reader = damprig_protocol::frame::Reader::default();
        let mut byte = [0];
        while stream.read_exact(&mut byte).is_ok() {
            if let Some(Ok(ToDevice::Request(request))) = reader.push(byte[0]) {
                let identity = damprig_protocol::Identity {
                    protocol: 77,
                    schema: [0xab; 8],
                    firmware: "9.9.9".parse().unwrap(),
                    board: "elsewhere".parse().unwrap(),
                };
                let answer = Ok(damprig_protocol::Reply::Identity(identity));
                let mut frame = [0; damprig_protocol::frame::LONGEST];
                let reply = FromDevice::Reply { seq: request.seq, answer };
                let length = damprig_protocol::frame::encode(&reply, &mut frame).unwrap();
                stream.write_all(&frame[..length]).unwrap();
            }
        }
    });
    let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig]).assert().code(1);
    answer.stderr(
        contains("has another protocol: device version 77 (schema abababababababab, firmware 9.9.9 on elsewhere)")
            .and(contains(format!("this program version {}", damprig_protocol::VERSION))),
    );
    stranger.join().unwrap();
}

#[test]
fn damaged_frames_are_counted_and_change_no_result() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "clean"]).assert().success();
    let (mut messages, mut events) = (0, 0);
    let board = Served::start(move |message| {
        messages += 1;
        let hit = match message {
            // Three points and the end of the experiment, on two set-ups: every second event is lost.
            FromDevice::Event { .. } => {
                events += 1;
                events % 2 == 0
            }
            FromDevice::Telemetry(_) => messages % 5 == 0,
            _ => false,
        };
        if hit { Fate::Corrupt } else { Fate::Pass }
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "noisy"]).assert().success();
    let read = |run: &str| read_parquet(folder.path().join(run).join("results.parquet"));
    assert_eq!(read("clean"), read("noisy"));
    let counters = &manifest(&folder.path().join("noisy"))["counters"];
    assert!(counters["bad_frames_host"].as_u64().unwrap() > 6, "{counters}");
    assert!(counters["missing_records"].as_u64().unwrap() > 0, "{counters}");
}

/// A limit on the file size makes the disk "full" for the process.
#[cfg(unix)]
#[test]
fn a_full_disk_is_reported_and_the_parts_stay_readable() {
    let folder = folder_with(&short());
    let binary = assert_cmd::cargo::cargo_bin("damprig");
    // 40 blocks of 512 bytes: room for the samples of a point, not of all points in one file.
    let script = "trap '' XFSZ; ulimit -f 40; exec \"$0\" run test.toml --out out";
    let shell = std::process::Command::new("sh").args(["-c", script]).arg(binary).current_dir(folder.path()).output();
    let output = shell.unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{words}");
    assert!(words.contains("cannot write") && words.contains("File too large"), "{words}");
    let parts: Vec<_> = std::fs::read_dir(folder.path().join("out/samples.parts")).unwrap().flatten().collect();
    assert!(!parts.is_empty());
    assert!(parts.into_iter().map(|p| rows(p.path())).sum::<usize>() > 500);
    assert!(rows(folder.path().join("out/results.parquet")) >= 1);
}

/// Runs the short campaign against a board that sends `signal` to the program when it sends its second result and the run folder
/// contains the first.
#[cfg(unix)]
fn signalled(signal: &'static str) -> (tempfile::TempDir, std::process::Output, Served) {
    use std::sync::mpsc;
    let folder = folder_with(&short());
    let (tell, pid) = mpsc::channel::<u32>();
    let mut points = 0;
    let run = folder.path().join("out");
    let board = Served::start(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == 2 {
            while result_rows(&run) == 0 {
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            let pid = pid.recv().unwrap().to_string();
            assert!(std::process::Command::new("kill").args([signal, &pid]).status().unwrap().success());
        }
        Fate::Pass
    });
    let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"))
        .args(["run", "test.toml", "--rig", &board.rig, "--out", "out"])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    tell.send(child.id()).unwrap();
    let output = child.wait_with_output().unwrap();
    (folder, output, board)
}

#[cfg(unix)]
#[test]
fn ctrl_c_and_sigterm_stop_the_rig_and_keep_the_measured_points() {
    for signal in ["-INT", "-TERM"] {
        let (folder, output, board) = signalled(signal);
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{signal}: {words}");
        assert!(words.contains("interrupted"), "{signal}: {words}");
        assert!(board.was_left_standing(), "{signal}");
        let run = folder.path().join("out");
        assert_eq!(manifest(&run)["reason"], "interrupted");
        assert!(rows(run.join("results.parquet")) >= 1);
        assert!(sample_rows(&run) > 0);
    }
}

#[cfg(unix)]
#[test]
fn a_killed_run_leaves_its_points_readable_and_its_status_running() {
    let (folder, _, _) = signalled("-KILL");
    let run = folder.path().join("out");
    assert_eq!(manifest(&run)["status"], "running");
    assert!(result_rows(&run) >= 1);
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(contains("killed while it was running"));
}

/// A friction damper whose spring the rig homes, touches off and sets itself has the same effect as one with that
/// constant force, alone and together with a particle.
#[test]
fn a_campaign_sets_its_spring_by_itself() {
    let campaign = r#"
name = "tuned"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038
[[set_up]]
name = "tuned"
base_amplitude_m = 0.0015
friction_damper = { spring = { friction_ratio = 0.9 } }
[[set_up]]
name = "constant"
base_amplitude_m = 0.0015
friction_damper = { friction_ratio = 0.9 }
[[set_up]]
name = "hybrid"
base_amplitude_m = 0.0015
particle = { mass_ratio = 0.1, clearance_ratio = 5, wall = { kind = "restitution", coefficient = 0.47 } }
friction_damper = { spring = { normal_force_n = 1.2 } }
[[experiment]]
kind = "stepped_sine"
frequencies_hz = [2.5]
start = "from_rest"
settle_s = 10.0
dwell_s = 20.0
[telemetry]
rate_hz = 100
signals = ["x", "spring_force", "impacts", "twin_residual", "twin_alarm"]
"#;
    let folder = folder_with(campaign);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success().stdout(contains("3 of 3 points"));
    let results = read_parquet(folder.path().join("out/results.parquet"));
    let x = results[0].column_by_name("rms_x_m").unwrap();
    let x = arrow_array::cast::AsArray::as_primitive::<arrow_array::types::Float32Type>(x);
    println!("x RMS: tuned {} m, constant {} m", x.value(0), x.value(1));
    // The spring's force is within its dead band of 0.02 N of 1.78 N: 1.1 % of the friction.
    assert!((x.value(0) / x.value(1) - 1.0).abs() < 0.02, "{} {}", x.value(0), x.value(1));
    let samples = read_parquet(folder.path().join("out/samples.parquet"));
    let column = |name: &str| -> Vec<f32> {
        let of = |batch: &arrow_array::RecordBatch| {
            let column = batch.column_by_name(name).unwrap();
            arrow_array::cast::AsArray::as_primitive::<arrow_array::types::Float32Type>(column).values().to_vec()
        };
        samples.iter().flat_map(of).collect()
    };
    let force = column("spring_force_n");
    // γF k Z/μe = 0.9 · 394.78 · 0.0015/0.3, then nothing, then 1.2 N; the sensor's noise of a tick's mean is 3 mN.
    for (place, expected) in [(force.len() / 4, 1.7765), (force.len() / 2, 0.0), (force.len() * 7 / 8, 1.2)] {
        assert!((force[place] - expected).abs() < 0.04, "{} N at {place} of {}", force[place], force.len());
    }
    assert!(column("impacts").last().is_some_and(|impacts| *impacts > 20.0));
    assert!(column("twin_residual_m").iter().skip(100).all(|residual| *residual < 1e-2));
}

#[test]
fn every_measured_impact_is_a_row_and_the_sides_alternate() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let path = folder.path().join("out/impacts.parquet");
    let table = &read_parquet(path)[0];
    let numbers = |name| damprig::table::values::numbers(table, name).unwrap();
    let (side, t_s, peak_n, impulse_n_s) = (numbers("side"), numbers("t_s"), numbers("peak_n"), numbers("impulse_n_s"));
    // Three points of 5 s near 2.5 Hz with about two impacts a cycle.
    assert!(side.len() > 40, "{} impacts", side.len());
    assert!(side.iter().all(|s| s.abs() == 1.0));
    let turns = side.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(turns * 10 > side.len() * 7, "{turns} changes of side in {} impacts", side.len());
    assert!(t_s.windows(2).all(|pair| pair[1] > pair[0]), "one segment, in the order of time");
    assert!(peak_n.iter().chain(&impulse_n_s).all(|value| *value > 0.0));
    assert_eq!(table.schema().field_with_name("impulse_n_s").unwrap().metadata()["unit"], "N·s");
}

#[test]
fn every_shipped_campaign_is_valid() {
    let campaigns = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns");
    let files = std::fs::read_dir(campaigns).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    assert!(files.len() > 4, "{files:?}");
    let folder = folder_with("");
    for file in files {
        damprig(&folder).arg("run").arg(&file).arg("--dry-run").assert().success();
    }
}

#[test]
fn a_quiet_run_prints_only_its_folder_and_logs_the_rest() {
    let folder = folder_with(&short());
    let said =
        damprig(&folder).args(["run", "test.toml", "--out", "out", "--quiet", "--log", "log.txt"]).assert().success();
    assert_eq!(String::from_utf8_lossy(&said.get_output().stdout), "Run folder: out\n");
    assert!(said.get_output().stderr.is_empty());
    let log = std::fs::read_to_string(folder.path().join("log.txt")).unwrap();
    assert_eq!(log.matches("experiment sweep starts").count(), 2, "{log}");
    assert!(log.contains("point 6 of 6: set-up hybrid, 2.6 Hz: X/Z (cycle maxima) "), "{log}");
    // A log is continued.
    damprig(&folder).args(["run", "test.toml", "--out", "again", "--quiet", "--log", "log.txt"]).assert().success();
    assert_eq!(std::fs::read_to_string(folder.path().join("log.txt")).unwrap().matches("point 6 of 6").count(), 2);
}

#[test]
fn a_log_that_cannot_be_written_is_refused_before_the_run_and_does_not_end_it_later() {
    let folder = folder_with(&short());
    let refused = ["run", "test.toml", "--out", "out", "--log", "nowhere/log.txt"];
    damprig(&folder)
        .args(refused)
        .assert()
        .code(2)
        .stderr(predicates::str::contains("--log nowhere/log.txt: cannot write"));
    assert!(!folder.path().join("out").exists());
    let full = ["run", "test.toml", "--out", "out", "--log", "/dev/full"];
    damprig(&folder).args(full).assert().success().stderr(predicates::str::contains("--log /dev/full: cannot write"));
}

#[test]
fn an_impact_after_the_end_of_an_experiment_is_not_recorded() {
    let folder = folder_with(&short());
    let board = Served::start(|message| match message {
        FromDevice::Event { seq, tick, event: Event::Finished { .. } } => {
            let late = ImpactRecord {
                tick: tick + 1,
                centre_ticks: 0.0,
                side: 1,
                peak_n: 40.0,
                impulse_n_s: 0.05,
                contact_s: 2e-3,
                clipped: false,
                held: false,
            };
            Fate::Also(vec![FromDevice::Event { seq: seq.wrapping_add(1), tick: tick + 1, event: Event::Impact(late) }])
        }
        _ => Fate::Pass,
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "out"]).assert().success();
    let impacts = rows(folder.path().join("out/impacts.parquet"));
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "undisturbed"]).assert().success();
    assert_eq!(impacts, rows(folder.path().join("undisturbed/impacts.parquet")));
}

#[test]
fn every_place_says_which_amplitude_ratio_it_shows() {
    const NAMES: [&str; 2] = ["(cycle maxima)", "(lock-in)"];
    let folder = folder_with(&short());
    let ran = damprig(&folder).args(["run", "test.toml", "--out", "out", "--log", "log.txt"]).assert().success();
    let run = folder.path().join("out");
    let file = |name: &str| std::fs::read_to_string(run.join(name)).unwrap();
    let batch = &read_parquet(run.join("results.parquet"))[0];
    let number = |name: &str| damprig::table::values::numbers(batch, name).unwrap();
    let of = |ratio: &str, amplitude: &str| {
        let pairs = number(amplitude).into_iter().zip(number("z_amplitude_m")).map(|(x, z)| x / z);
        assert_eq!(number(ratio), pairs.collect::<Vec<_>>(), "{ratio}");
    };
    of("x_over_z", "mean_cycle_max_m");
    of("x_over_z_lock_in", "x_amplitude_m");
    for (column, name) in ["x_over_z", "x_over_z_lock_in"].into_iter().zip(NAMES) {
        let schema = batch.schema();
        assert!(schema.field_with_name(column).unwrap().metadata()["description"].contains(name), "{column}");
    }
    let shown = |args: &[&str]| {
        let output = damprig(&folder).args(args).assert().success().get_output().stdout.clone();
        String::from_utf8(output).unwrap()
    };
    let printed = String::from_utf8_lossy(&ran.get_output().stdout).into_owned();
    shown(&["runs", "export", "out", "--format", "uff", "--what", "results", "--out", "run.uff"]);
    let uff = std::fs::read_to_string(folder.path().join("run.uff")).unwrap();
    for (place, text, names) in [
        ("the figure", file("figure.svg"), &NAMES[..1]),
        (
            "the page",
            file("report.html")
                .replace("<small>cycle maxima</small>", NAMES[0])
                .replace("<small>lock-in</small>", NAMES[1]),
            &NAMES[..],
        ),
        ("the terminal", printed, &NAMES[..]),
        ("the log", std::fs::read_to_string(folder.path().join("log.txt")).unwrap(), &NAMES[..]),
        ("`runs show`", shown(&["runs", "show", "out"]), &NAMES[..]),
        ("the UFF export", uff, &NAMES[1..]),
    ] {
        for name in names {
            assert!(text.contains(name), "{place} does not say {name}: {text}");
        }
    }
}
