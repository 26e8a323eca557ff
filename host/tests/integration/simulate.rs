//! `damprig simulate`: shipped cases, time histories, figures, interruption.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use crate::common::{damprig, read_parquet};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;

/// A case of forty cycles with impacts; `run` is its last table.
fn spid(run: &str) -> String {
    format!(
        "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
         base = {{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }}\n\
         particle = {{ mass_ratio = 0.1, clearance_m = 0.03, wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\n\
         run = {run}\n"
    )
}

fn folder(case: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    folder
}

/// The result of the case in the folder.
fn answer(folder: &TempDir, more: &[&str]) -> Value {
    let output = damprig(folder).args(["simulate", "case.toml", "--json"]).args(more).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut cases: Vec<PathBuf> = files.filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    cases.sort();
    cases
}

/// The columns of a CSV file by name.
fn csv_columns(path: &Path) -> Vec<(String, Vec<String>)> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let mut columns: Vec<(String, Vec<String>)> =
        reader.headers().unwrap().iter().map(|name| (name.to_string(), Vec::new())).collect();
    for record in reader.records() {
        for (column, field) in columns.iter_mut().zip(record.expect("a whole row").iter()) {
            column.1.push(field.to_string());
        }
    }
    columns
}

#[test]
fn every_shipped_case_has_a_summary_a_figure_and_a_time_history() {
    let cases = shipped();
    assert!(cases.len() >= 6, "{cases:?}");
    for case in cases {
        let folder = TempDir::new().unwrap();
        let output = damprig(&folder)
            .arg("simulate")
            .arg(&case)
            .args(["--out", "motion.parquet", "--plot", "motion.svg"])
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}: {}", case.display(), String::from_utf8_lossy(&output.stderr));
        for word in ["structure  ", "largest |x|", "RMS of x", "motion.parquet", "motion.svg"] {
            assert!(told.contains(word), "no {word:?} for {}:\n{told}", case.display());
        }
        let svg = std::fs::read_to_string(folder.path().join("motion.svg")).unwrap();
        assert!(svg.contains("structure") && svg.contains("Time (s)"));
        assert!(crate::common::rows(folder.path().join("motion.parquet")) > 1000);
    }
}

#[test]
fn a_time_history_has_the_values_of_the_result_and_every_impact() {
    let folder = folder(&spid("{ duration_s = 16, sample_times_s = [0, 3.7, 9.99, 16] }"));
    let answer = answer(&folder, &["--out", "motion.csv", "--rate", "100"]);
    let columns = csv_columns(&folder.path().join("motion.csv"));
    let names: Vec<&str> = columns.iter().map(|c| c.0.as_str()).collect();
    assert_eq!(names, ["t_s", "x_m", "v_m_per_s", "y_m", "u_m_per_s", "z_m", "structure", "particle"]);
    assert_eq!(columns[0].1.len(), 1601, "both ends of 16 s at 100 Hz");
    for (key, column) in [("x_m", 1), ("v_m_per_s", 2), ("y_m", 3), ("u_m_per_s", 4)] {
        for (value, row) in numbers(&answer[key]).into_iter().zip([0, 370, 999, 1600]) {
            let found: f64 = columns[column].1[row].parse().unwrap();
            assert!((found - value).abs() <= 1e-12 * value.abs().max(1e-3), "{key} in row {row}: {found} {value}");
        }
    }
    let impacts = csv_columns(&folder.path().join("motion.impacts.csv"));
    let times = answer["impacts"].as_array().unwrap();
    assert!(times.len() > 20);
    assert_eq!(impacts[0].1.len(), times.len());
    for (impact, (t, side)) in times.iter().zip(impacts[0].1.iter().zip(&impacts[1].1)) {
        // The JSON reader may round the last digit differently.
        let (told, written): (f64, f64) = (impact["t_s"].as_f64().unwrap(), t.parse().unwrap());
        assert!((told / written - 1.0).abs() < 1e-15, "{told} {written}");
        assert_eq!(impact["side"].as_i64(), side.parse().ok());
    }
    assert!(!folder.path().join("motion.csv.tmp").exists());
}

#[test]
fn parquet_and_csv_time_histories_are_equal_and_parquet_has_units() {
    let folder = folder(&spid("{ duration_s = 200 }"));
    for file in ["motion.csv", "motion.parquet"] {
        answer(&folder, &["--out", file, "--rate", "500"]);
    }
    let columns = csv_columns(&folder.path().join("motion.csv"));
    let batches = read_parquet(folder.path().join("motion.parquet"));
    let schema = batches[0].schema();
    for (name, unit) in [("t_s", "s"), ("x_m", "m"), ("v_m_per_s", "m/s"), ("z_m", "m")] {
        assert_eq!(schema.field_with_name(name).unwrap().metadata().get("unit").map(String::as_str), Some(unit));
    }
    let x: Vec<f64> =
        batches.iter().flat_map(|b| b.column(1).as_primitive::<Float64Type>().values().to_vec()).collect();
    assert_eq!(x.len(), 100_001, "several chunks");
    assert!(x.iter().zip(&columns[1].1).all(|(x, text)| text.parse() == Ok(*x)));
    assert!(crate::common::rows(folder.path().join("motion.impacts.parquet")) > 900);
}

#[test]
fn writing_a_time_history_does_not_change_the_motion() {
    let folder = folder(&spid("{ duration_s = 40, sample_times_s = [40] }"));
    let plain = answer(&folder, &[]);
    let with = answer(&folder, &["--out", "motion.parquet", "--plot", "motion.png"]);
    assert_eq!(plain, with);
}

#[test]
fn an_unsupported_extension_is_refused_with_the_supported_ones() {
    let folder = folder(&spid("{ duration_s = 1 }"));
    for (flag, file, words) in
        [("--out", "motion.xls", [".xls", ".parquet", ".mat"]), ("--plot", "motion.pdf", [".pdf", ".svg", ".png"])]
    {
        let output = damprig(&folder).args(["simulate", "case.toml", flag, file]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(words.iter().chain([&flag]).all(|word| told.contains(word)), "{told}");
        assert!(!folder.path().join(file).exists());
    }
}

#[test]
fn an_unwritable_time_history_is_reported_before_the_run() {
    let folder = folder(&spid("{ duration_s = 1e9 }"));
    let output = damprig(&folder).args(["simulate", "case.toml", "--out", "nowhere/motion.csv"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nowhere/motion.csv"));
}

#[test]
fn an_empty_time_window_is_refused() {
    let folder = folder(&spid("{ duration_s = 4 }"));
    let args = ["simulate", "case.toml", "--plot", "p.svg", "--plot-from", "5"];
    let output = damprig(&folder).args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--plot-from 5"), "{output:?}");
}

#[test]
fn the_extension_selects_the_figure_format() {
    let folder = folder(&spid("{ duration_s = 4 }"));
    for (file, magic) in [("p.png", &b"\x89PNG"[..]), ("p.svg", &b"<svg"[..])] {
        damprig(&folder).args(["simulate", "case.toml", "--plot", file]).assert().success();
        assert!(std::fs::read(folder.path().join(file)).unwrap().starts_with(magic), "{file}");
    }
}

/// The places over time that an animation gives its elements, in their order: right and down, points.
fn moved(svg: &str) -> Vec<Vec<[f64; 2]>> {
    let place = |text: &str| {
        let (x, y) = text.split_once(' ').expect("two numbers");
        [x, y].map(|number| number.parse().expect("a number"))
    };
    let values = svg.split("<animateTransform").skip(1).map(|rest| rest.split("values=\"").nth(1).expect("values"));
    values.map(|values| values.split('"').next().unwrap_or_default().split(';').map(place).collect()).collect()
}

#[test]
fn an_animation_moves_the_places_as_the_time_history_has_them_and_keeps_particles_in_their_cavities() {
    let folder = TempDir::new().unwrap();
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    for (name, elements, lines) in [("frame", 6, 6), ("boring-bar", 5, 1), ("spid", 4, 0), ("tmd", 3, 0)] {
        let (case, file) = (cases.join(format!("{name}.toml")), folder.path().join(format!("{name}.svg")));
        let mut command = damprig(&folder);
        let command = command.arg("simulate").arg(&case).args(["--set", "run.duration_s=4", "--animate"]).arg(&file);
        command.arg("--json").assert().success();
        let svg = std::fs::read_to_string(&file).unwrap();
        damprig::report::plot::png_of(&svg, 1.0, None).expect("well-formed");
        let all = moved(&svg);
        assert_eq!((all.len(), svg.matches("<animate ").count()), (elements, lines), "{name}");
        assert!(all.iter().all(|places| places.len() == all[0].len() && places.len() > 100), "{name}");
        let largest = all[..all.len() - 1].iter().flatten().flatten().map(|of| of.abs()).fold(0.0, f64::max);
        assert!((largest - 90.0).abs() < 0.06, "{name}: {largest}");
        if name != "tmd" {
            // Half a cavity less a particle's radius; two roundings.
            for (cavity, particle) in all[elements - 2].iter().zip(&all[elements - 1]) {
                let off = (particle[0] - cavity[0]).hypot(particle[1] - cavity[1]);
                assert!(off < 23.2, "{name}: {off}");
            }
        }
    }
    // The structure's frames are the rows of a time history of the same instants.
    let (svg, csv) = (folder.path().join("s.svg"), folder.path().join("s.csv"));
    let mut command = damprig(&folder);
    command.arg("simulate").arg(cases.join("spid.toml")).args(["--set", "run.duration_s=4", "--rate", "100"]);
    command.arg("--animate").arg(&svg).arg("--out").arg(&csv).assert().success();
    let columns = csv_columns(&csv);
    let column = |name: &str| -> Vec<f64> {
        let (_, cells) = columns.iter().find(|(head, _)| head == name).expect("a column");
        cells.iter().map(|cell| cell.parse().expect("a number")).collect()
    };
    let (times, x) = (column("t_s"), column("x_m"));
    let places = &moved(&std::fs::read_to_string(&svg).unwrap())[1];
    let kept: Vec<f64> = times.iter().zip(&x).filter(|(t_s, _)| **t_s > 4.0 - 2.4 - 1e-9).map(|(_, x)| *x).collect();
    let largest = kept.iter().map(|x| x.abs()).fold(0.0, f64::max);
    for (n, [right, _]) in places.iter().enumerate() {
        assert!((right / 90.0 - kept[n] / largest).abs() < 2e-3, "{n}: {right} {}", kept[n]);
    }
}

#[test]
fn a_stiff_wall_gives_a_warning_with_its_cost() {
    let case = spid("{ duration_s = 0.5 }").replace(
        "{ kind = \"restitution\", coefficient = 0.5 }",
        "{ kind = \"voigt\", stiffness_n_per_m = 1e10, damping_n_s_per_m = 0, release = \"zero_force\" }",
    );
    let folder = folder(&case);
    let output = damprig(&folder).args(["simulate", "case.toml"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("warning: the wall is stiff") && told.contains("arcs"), "{told}");
}

/// Starts an endless run, interrupts it after its warning about the computing time, and returns its standard output.
fn interrupted(folder: &TempDir, out: &str) -> Value {
    let mut process = Process::new(assert_cmd::cargo::cargo_bin("damprig"))
        .current_dir(folder.path())
        .args(["simulate", "case.toml", "--json", "--rate", "5", "--out", out])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut told = BufReader::new(process.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("Ctrl-C stops the run") {
        line.clear();
        assert!(told.read_line(&mut line).unwrap() > 0, "it ended before it warned");
    }
    let pid = process.id().to_string();
    assert!(Process::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let output = process.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let mut rest = String::new();
    while told.read_line(&mut rest).unwrap() > 0 {}
    assert!(rest.contains("interrupted at"), "{rest}");
    serde_json::from_slice(&output.stdout).expect("the answer up to the interruption")
}

#[test]
fn existing_files_are_replaced_only_by_force() {
    let folder = folder(&spid("{ duration_s = 1.2 }"));
    let at = |name: &str| folder.path().join(name);
    let outputs = ["motion.csv", "motion.impacts.csv", "motion.accumulations.csv", "motion.svg"];
    let arguments = ["simulate", "case.toml", "--out", "motion.csv", "--plot", "motion.svg"];
    for name in outputs {
        std::fs::write(at(name), "mine").unwrap();
        let answer = damprig(&folder).args(arguments).assert().code(2);
        answer.stderr(contains(format!("cannot write {name}: it exists")).and(contains("--force")));
        let others = outputs.iter().filter(|other| **other != name && at(other).exists());
        assert_eq!((std::fs::read(at(name)).unwrap(), others.count()), (b"mine".to_vec(), 0), "{name}");
        std::fs::remove_file(at(name)).unwrap();
    }
    outputs.iter().for_each(|name| std::fs::write(at(name), "mine").unwrap());
    damprig(&folder).args(arguments).arg("--force").assert().success();
    assert!(outputs.iter().all(|name| std::fs::read(at(name)).unwrap() != b"mine"));
    let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), outputs.len() + 1, "{names:?}");
}

#[test]
fn an_interrupted_run_keeps_its_time_history_impacts_and_summary() {
    let folder = folder(&spid("{ duration_s = 1e9 }"));
    let answer = interrupted(&folder, "motion.csv");
    let stopped_at_s = answer["stopped_at_s"].as_f64().expect("the time of the interruption");
    assert_eq!(answer["summary"]["simulated_s"].as_f64(), Some(stopped_at_s));
    assert!(answer["summary"]["impact_count"].as_u64() > Some(10));
    let times = csv_columns(&folder.path().join("motion.csv")).remove(0).1;
    let last: f64 = times.last().unwrap().parse().unwrap();
    assert!(last <= stopped_at_s && last > stopped_at_s - 0.21, "{last} of {stopped_at_s}");
    let impacts = csv_columns(&folder.path().join("motion.impacts.csv")).remove(0).1;
    assert_eq!(Some(impacts.len() as u64), answer["summary"]["impact_count"].as_u64());
    assert!(!folder.path().join("motion.csv.tmp").exists());
}

#[test]
fn an_interrupted_parquet_history_is_readable() {
    let folder = folder(&spid("{ duration_s = 1e9 }"));
    let answer = interrupted(&folder, "motion.parquet");
    let rows = crate::common::rows(folder.path().join("motion.parquet"));
    let expected = answer["stopped_at_s"].as_f64().unwrap() * 5.0;
    assert!((rows as f64 - expected).abs() <= 1.0, "{rows} rows in {expected}");
}

#[test]
fn a_mat_file_has_the_numbers_of_the_parquet_file() {
    let folder = folder(&spid("{ duration_s = 40 }"));
    for name in ["motion.parquet", "motion.mat"] {
        damprig(&folder).args(["simulate", "case.toml", "--out", name]).assert().success();
    }
    for (table, file) in [("motion", "motion"), ("impacts", "motion.impacts")] {
        let batches = read_parquet(folder.path().join(format!("{file}.parquet")));
        let path = folder.path().join(format!("{file}.mat"));
        let mut mat = matrw::load_matfile(path.to_str().unwrap()).unwrap();
        let Some(matrw::MatVariable::Structure(mut fields)) = mat.take(table) else { panic!("no {table}") };
        for name in ["t_s", "x_m", "side"].iter().filter(|name| batches[0].column_by_name(name).is_some()) {
            let Some(matrw::MatVariable::NumericArray(read)) = fields.take(name) else { panic!("no {name}") };
            let expected: Vec<f64> =
                batches.iter().flat_map(|b| damprig::table::values::numbers(b, name).unwrap()).collect();
            assert_eq!(read.real_to_vec::<f64>().unwrap(), expected, "{table}.{name}");
        }
    }
}

#[test]
fn an_output_that_is_a_folder_is_refused_before_the_simulation() {
    let folder = folder(&spid("{ duration_s = 1.2 }"));
    std::fs::create_dir(folder.path().join("motion.csv")).unwrap();
    for force in [&[][..], &["--force"]] {
        let said = contains("--out: cannot write motion.csv: it is a folder").and(contains("nothing was written"));
        let arguments = ["simulate", "case.toml", "--out", "motion.csv"];
        damprig(&folder).args(arguments).args(force).assert().code(2).stdout("").stderr(said);
    }
}

#[test]
fn steady_cycles_under_a_sine_are_periods_of_the_drive_where_no_length_is_given() {
    let folder = folder(&spid("{ duration_s = 16, steady_from_cycle = 30 }"));
    let summary = answer(&folder, &[])["summary"].clone();
    assert!(summary["steady_mean_cycle_max_abs_x_m"].as_f64().is_some_and(|mean_m| mean_m > 0.0), "{summary}");
    let at = |frequency: &str| answer(&folder, &["--set", frequency, "--set", "run.cycle_s=0.5"])["summary"].clone();
    let of_period = answer(&folder, &["--set", "base.frequency_hz=2"])["summary"].clone();
    assert_eq!(of_period, at("base.frequency_hz=2"));
    assert_ne!(of_period, at("base.frequency_hz=2.5"));
}

/// The particle starts at a wall so stiff that its contacts flood the first moments; the whole run takes a fifth of a second.
#[test]
fn a_run_whose_first_moments_are_slow_is_not_said_to_take_long() {
    let wall = "{ kind = \"voigt\", stiffness_n_per_m = 1e11, damping_n_s_per_m = 10, release = \"zero_force\" }";
    let start = "clearance_m = 0.03, start = \"at_positive_wall\", friction_coefficient = 0.05";
    let case = spid("{ duration_s = 40 }").replace("{ kind = \"restitution\", coefficient = 0.5 }", wall);
    let folder = folder(&case.replace("clearance_m = 0.03", start));
    let start = std::time::Instant::now();
    let output = damprig(&folder).args(["simulate", "case.toml"]).output().unwrap();
    let took_s = start.elapsed().as_secs_f64();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && told.contains("the wall is stiff"), "{told}");
    // A busy machine may be slow enough for a warning. Judged by its first moments, the run would take hundreds of times as long as it does.
    if let Some((_, said)) = told.split_once("may take about ") {
        let (number, rest) = said.split_once(' ').unwrap();
        assert!(rest.starts_with("s ") && number.parse::<f64>().unwrap() < 40.0 * took_s, "{took_s} s: {told}");
    }
}
