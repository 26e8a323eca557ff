//! `damprig runs export`: contents of the files, read with users' software, and failed or partial exports.
//!
//! The scripts of `tests/python` read them with scipy, pandas, h5py, PyTables and pyuff. `DAMPRIG_PYTHON` names the Python with these
//! packages (`required`: that of `tests/toolchain.sh`, and a failure without it); otherwise the test says that it was skipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Fate, Served, cut_off, damprig, folder_with, is_full, python, read_parquet, short};
use arrow_array::{BooleanArray, RecordBatch};
use arrow_select::filter::filter_record_batch;
use damprig_protocol::FromDevice;
use matrw::MatVariable;
use parquet::arrow::ArrowWriter;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

fn with_run() -> (TempDir, PathBuf) {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    (folder, run)
}

fn export(folder: &TempDir, rest: &[&str]) -> assert_cmd::assert::Assert {
    damprig(folder).args(["runs", "export", "out", "--format"]).args(rest).assert()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Exports everything and compares it with the Parquet files.
fn readers_agree(folder: &TempDir, run: &Path) {
    let files = ["samples.csv", "results.csv", "impacts.csv", "run.mat", "run.h5", "run.uff"];
    for (file, format, what) in [
        (files[0], "csv", Some("samples")),
        (files[1], "csv", Some("results")),
        (files[2], "csv", Some("impacts")),
        (files[3], "mat", None),
        (files[4], "h5", None),
        (files[5], "uff", None),
    ] {
        let _ = std::fs::remove_file(folder.path().join(file));
        let table = what.map_or(vec![], |what| vec!["--what", what]);
        export(folder, &[&[format, "--out", file][..], &table].concat()).success();
    }
    script(folder, "check_exports.py", &[&[run.to_str().unwrap()], &files[..]].concat());
}

/// Runs a script of tests/python, if there is a Python for it.
fn script(folder: &TempDir, name: &str, arguments: &[&str]) {
    let Some(python) = python() else {
        println!(
            "left out: no Python with the packages of tests/python (tests/run makes one; DAMPRIG_PYTHON names one)"
        );
        return;
    };
    let script = root().canonicalize().unwrap().join("tests/python").join(name);
    let checked = Command::new(python).current_dir(folder.path()).arg(script).args(arguments).output();
    let checked = checked.expect("Python starts");
    let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(checked.status.success(), "{}{}", said(&checked.stdout), said(&checked.stderr));
    println!("{}", said(&checked.stdout));
}

/// Removes rows from the samples, as a lossy link does.
fn lose(run: &Path, is_kept: impl Fn(usize) -> bool) {
    let path = run.join("samples.parquet");
    let batches = read_parquet(path.clone());
    let mut writer = ArrowWriter::try_new(std::fs::File::create(&path).unwrap(), batches[0].schema(), None).unwrap();
    let mut row = 0;
    for batch in batches {
        let kept: BooleanArray = (row..row + batch.num_rows()).map(|i| Some(is_kept(i))).collect();
        row += batch.num_rows();
        writer.write(&filter_record_batch(&batch, &kept).unwrap()).unwrap();
    }
    writer.close().unwrap();
}

#[test]
fn users_software_reads_the_recorded_values() {
    let (folder, run) = with_run();
    readers_agree(&folder, &run);
    // Rows lost: the first one, and two gaps in one point with a single row between them.
    lose(&run, |row| row != 0 && !(100..140).contains(&row) && row != 141);
    readers_agree(&folder, &run);
}

/// Lengths around those of a chunk (32 768 rows), of a dimension of two bytes in HDF5, and of a row group of Parquet; some of them, all with DAMPRIG_FULL.
#[test]
fn exports_of_every_length_are_read_by_two_readers() {
    let (folder, run) = with_run();
    let whole = arrow_select::concat::concat_batches(
        &read_parquet(run.join("samples.parquet"))[0].schema(),
        &read_parquet(run.join("samples.parquet")),
    )
    .unwrap();
    let mut list = String::new();
    let few = [1, 32_768, 32_769, 65_536];
    let more = [32_767, 65_535, 65_537, 131_073, (1 << 20) + 1];
    for rows in few.into_iter().chain(more.into_iter().filter(|_| is_full())) {
        let copy = folder.path().join(format!("run-{rows}"));
        std::fs::create_dir(&copy).unwrap();
        for name in ["manifest.json", "results.parquet", "campaign.toml", "journal.jsonl"] {
            std::fs::copy(run.join(name), copy.join(name)).unwrap();
        }
        let file = std::fs::File::create(copy.join("samples.parquet")).unwrap();
        let mut writer = ArrowWriter::try_new(file, whole.schema(), None).unwrap();
        let mut left: usize = rows;
        while left > 0 {
            // The length of the run has no divisor in common with that of a chunk.
            let part = whole.slice(0, left.min(whole.num_rows() - 1 - whole.num_rows() % 2));
            writer.write(&part).unwrap();
            left -= part.num_rows();
        }
        writer.close().unwrap();
        for format in ["h5", "mat"] {
            let arguments =
                ["runs", "export", copy.to_str().unwrap(), "--format", format, "--what", "samples", "--out"];
            damprig(&folder).args(arguments).arg(format!("{rows}.{format}")).assert().success();
        }
        list += &format!("run-{rows}\t{rows}.h5\t{rows}.mat\n");
    }
    std::fs::write(folder.path().join("list"), list).unwrap();
    script(&folder, "check_lengths.py", &["list"]);
}

/// Of a complete run, of one whose samples are in parts, and of one that was resumed.
#[test]
fn every_table_and_figure_of_a_run_says_by_itself_what_it_is() {
    let (folder, _) = with_run();
    script(&folder, "check_descriptions.py", &["out"]);
    let (folder, _) = cut_off(&short());
    assert!(folder.path().join("out/samples.parts/000001.parquet").exists());
    script(&folder, "check_descriptions.py", &["out"]);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    script(&folder, "check_descriptions.py", &["out"]);
}

/// The start of a run of an earlier version has the name of its zone behind it.
#[test]
fn the_start_of_a_run_of_an_earlier_version_is_exported_without_its_zone() {
    let (folder, run) = with_run();
    let mut manifest = crate::common::manifest(&run);
    let earlier = "2026-07-03T09:04:26.123456789+02:00[Europe/Berlin]";
    manifest["started"] = earlier.into();
    manifest.as_object_mut().unwrap().remove("manifest_sha256");
    std::fs::write(run.join("manifest.json"), manifest.to_string()).unwrap();
    for format in ["h5", "mat"] {
        let file = format!("run.{format}");
        export(&folder, &[format, "--out", &file]).success();
        let bytes = std::fs::read(folder.path().join(&file)).unwrap();
        let has = |text: &str| bytes.windows(text.len()).any(|part| part == text.as_bytes());
        assert!(has("2026-07-03T09:04:26.123456789+02:00") && !has("Europe/Berlin"), "{file}");
    }
    export(&folder, &["uff", "--what", "results", "--out", "run.uff"]).success();
    let uff = std::fs::read_to_string(folder.path().join("run.uff")).unwrap();
    assert!(uff.contains("03-Jul-26 09:04:26"), "the local time of the run");
    damprig(&folder).args(["runs", "report", "out", "--out", "page.html"]).assert().success();
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("started 2026-07-03 09:04:26 +02:00"));
}

#[test]
fn the_parameters_of_every_damper_are_those_of_the_manifest() {
    let text = std::fs::read_to_string(root().join("host/campaigns/dampers.toml")).unwrap();
    let short = text.replace("[2.3, 2.5, 2.7]", "[2.5]").replace("measure_s = 8.0", "measure_s = 2.0");
    let folder = folder_with(&short);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    readers_agree(&folder, &run);
}

/// Names with one and several letters outside ASCII, in every place where a run has names.
#[test]
fn names_of_other_alphabets_arrive_in_the_users_software() {
    let text = short()
        .replacen("[structure]", "[plan]\noperator = \"Müller\"\nspecimen = \"µ\"\n\n[structure]", 1)
        .replace("name = \"hybrid\"", "name = \"Körnerdämpfer\"")
        .replace("label = \"Bare structure\"", "label = \"裸结构, Δ\"")
        .replace("name = \"sweep\"", "name = \"größer\"");
    let folder = folder_with(&text);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    assert_eq!(crate::common::manifest(&run)["plan"]["operator"], "Müller");
    readers_agree(&folder, &run);
    export(&folder, &["mat", "--out", "bytes.mat"]).success();
    let bytes = std::fs::read(folder.path().join("bytes.mat")).unwrap();
    let utf_16: Vec<u8> = "Körnerdämpfer".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(bytes.windows(utf_16.len()).any(|part| part == utf_16), "the set-up's name is in the file as UTF-16");
    assert!(!bytes.windows(3).any(|part| part == b"\\u{"), "nothing is escaped");
}

#[test]
fn a_history_never_spans_a_gap() {
    let (folder, run) = with_run();
    let count = |file: &str| {
        export(&folder, &["uff", "--what", "samples", "--out", file]).success();
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(text.lines().all(|line| line.len() <= 80), "no line is longer than 80 columns");
        text.lines().filter(|line| line.trim_end() == "    58").count()
    };
    assert_eq!(count("whole.uff"), 2 * 6, "two signals at six points");
    lose(&run, |row| row != 100);
    assert_eq!(count("gap.uff"), 2 * 7);
}

/// Of a campaign without transients, and of a run that ended before its first sample.
#[test]
fn a_table_without_rows_has_its_columns() {
    let has = |folder: &TempDir, table: &str, first_columns: &str, column: &str| {
        for format in ["csv", "mat", "h5"] {
            let file = format!("{table}.{format}");
            let answer = export(folder, &[format, "--what", table, "--out", &file]).success();
            answer.stdout(contains(format!("0 rows of {table}")));
            let bytes = std::fs::read(folder.path().join(&file)).unwrap();
            match format {
                "csv" => {
                    let text = String::from_utf8(bytes).unwrap();
                    assert!(text.starts_with(first_columns) && text.lines().count() == 1, "{file}: {text:?}");
                }
                "h5" => {
                    let read = hdf5_pure::File::from_bytes(bytes).unwrap();
                    let read = read.dataset(&format!("{table}/{column}")).unwrap();
                    assert_eq!(read.shape().unwrap(), [0], "{file}");
                }
                _ => {
                    let mut read = matrw::load_matfile(folder.path().join(&file).to_str().unwrap()).unwrap();
                    let Some(MatVariable::Structure(mut read)) = read.take(table) else { panic!("{file}: no struct") };
                    assert!(read.take(column).is_some(), "{file}");
                }
            }
        }
    };
    let (folder, _) = with_run();
    has(&folder, "transients", "set_up,experiment,", "max_abs_x_m");
    let folder = folder_with(&short());
    let rig =
        Served::start(|message| if matches!(message, FromDevice::Telemetry(_)) { Fate::Close } else { Fate::Pass }).rig;
    damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out", "--reconnect-s", "0"]).assert().code(1);
    has(&folder, "samples", "set_up,experiment,segment [1],", "x_m");
}

#[test]
fn an_unknown_format_is_refused_with_the_known_ones() {
    let (folder, _) = with_run();
    export(&folder, &["matlab"]).code(2).stderr(contains("csv, mat, h5, uff").and(contains("--format")));
}

#[test]
fn an_unwritable_path_is_named_and_no_file_is_left() {
    let (folder, _) = with_run();
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    for format in ["csv", "mat", "h5", "uff"] {
        export(&folder, &[format, "--out", "nowhere/run.x"]).code(1).stderr(contains("there is no folder nowhere"));
        export(&folder, &[format, "--out", "test.toml"]).code(2).stderr(contains("cannot write test.toml: it exists"));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before);
    assert_eq!(std::fs::read_to_string(folder.path().join("test.toml")).unwrap(), short());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_no_partial_export() {
    let (folder, _) = with_run();
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    for format in ["csv", "mat", "h5", "uff"] {
        // Writes beyond a file-size limit fail as on a full disk.
        let damprig = assert_cmd::cargo::cargo_bin("damprig");
        let line = format!(
            "trap '' XFSZ; ulimit -f 8; exec '{}' runs export out --format {format} --out full.x",
            damprig.display()
        );
        let done = Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(1), "{format}: {said}");
        assert!(said.contains("cannot write full.x"), "{format}: {said}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before, "{format}: no file is left");
    }
}

#[test]
fn an_export_of_a_damaged_run_names_the_missing_parts() {
    let (folder, run) = with_run();
    let path = run.join("samples.parquet");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    for format in ["mat", "h5", "uff"] {
        let file = format!("part.{format}");
        let answer = export(&folder, &[format, "--out", &file]).code(1);
        answer.stdout(contains("rows of")).stderr(contains("not in the file").and(contains("cut off or damaged")));
        assert!(folder.path().join(file).exists());
    }
    export(&folder, &["csv", "--out", "part.csv"]).code(1).stderr(contains("nothing was exported"));
    assert!(!folder.path().join("part.csv").exists());
}

#[test]
fn a_run_that_is_still_recording_is_exported_as_far_as_it_is() {
    let many = "frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.01 }";
    let folder = folder_with(&short().replace("frequencies_hz = [2.4, 2.5, 2.6]", many));
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    let run = command.args(["run", "test.toml", "--out", "out"]).current_dir(folder.path());
    let mut run = run.stdout(std::process::Stdio::null()).spawn().unwrap();
    let mut live = 0;
    let has_samples = || folder.path().join("out/samples.parts/000001.parquet").exists();
    while run.try_wait().unwrap().is_none() {
        if !has_samples() {
            std::thread::yield_now();
            continue;
        }
        for format in ["csv", "mat", "h5", "uff"] {
            let arguments = ["runs", "export", "out", "--format", format, "--out", "live", "--force"];
            let output = damprig(&folder).args(arguments).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
            let is_told =
                said.contains("export it again") || said.contains("cannot be read") || said.contains("still running");
            assert!(output.status.success() || is_told, "{said}");
            live += usize::from(output.status.success() && said.contains("still running"));
        }
    }
    assert!(live > 0, "no export met the run while it was recording");
    assert!(run.wait().unwrap().success());
}

#[test]
fn only_the_chosen_rows_are_exported() {
    let (folder, run) = with_run();
    let is_bare = |batch: &RecordBatch| {
        let names = damprig::table::values::texts(batch, "set_up").unwrap();
        names.iter().filter(|n| *n == "bare").count()
    };
    let expected: usize = read_parquet(run.join("samples.parquet")).iter().map(is_bare).sum();
    let rest = ["uff", "--what", "samples", "--set-up", "bare", "--out", "bare.uff"];
    export(&folder, &rest).success().stdout(contains(format!("{expected} rows of samples")));
    let text = std::fs::read_to_string(folder.path().join("bare.uff")).unwrap();
    assert!(text.contains("bare, sweep, 2.4 Hz") && !text.contains("hybrid, sweep"));
}
