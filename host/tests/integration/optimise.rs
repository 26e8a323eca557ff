//! `damprig optimise`: the optimum against a closed form and against dense studies, whatever the threads; refusals.

use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, Instant};

use crate::common::{damprig, is_full};
use crate::study::{column, table};
use damprig::input::Source;
use damprig::optimise::evaluate::{Care, Evaluated};
use damprig::optimise::search::{self, SearchProgress};
use damprig::optimise::{Optimisation, Optimum, evaluate};
use damprig::study::band::Effort;
use serde_json::Value;
use tempfile::TempDir;

pub const CASE: &str = "\
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }
particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = \"restitution\", coefficient = 0.5 } }
run = { duration_s = 8 }
";

const TOP: &str = "case = \"case.toml\"\nobjective = \"max_x_over_z\"\nevaluations = 200\n";

const CLEARANCE: &str = "[[variable]]\nkey = \"particle.clearance_ratio\"\nfrom = 5\nto = 20\n";

const RESTITUTION: &str = "[[variable]]\nkey = \"particle.wall.coefficient\"\nfrom = 0.2\nto = 0.8\n";

const BAND: &str = "[[axis]]\nkey = \"base.frequency_hz\"\nfrom = 2.3\nto = 2.7\ncount = 5\nreduce = \"maximum\"\n";

pub fn folder(case: &str, file: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    std::fs::write(folder.path().join("file.toml"), file).unwrap();
    folder
}

fn run(folder: &TempDir, threads: &str, more: &[&str]) -> Output {
    let mut command = damprig(folder);
    command.env("RAYON_NUM_THREADS", threads).args(["optimise", "file.toml"]).args(more);
    command.output().unwrap()
}

fn answer(folder: &TempDir) -> Value {
    let output = run(folder, "2", &["--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn variable(answer: &Value, place: usize) -> f64 {
    answer["variables"][place]["value"].as_f64().unwrap()
}

pub fn read(folder: &TempDir) -> Optimisation {
    Optimisation::read(&folder.path().join("file.toml")).expect("it is valid")
}

/// |x| k/P of an undamped structure with a tuned mass under P sin Ωt, r = Ω/ωn (Den Hartog).
fn magnification(mass_ratio: f64, gamma: f64, zeta: f64, r: f64) -> f64 {
    let damping = 2.0 * zeta * gamma * r;
    let own = gamma * gamma - r * r;
    let real = own * (1.0 - r * r) - mass_ratio * gamma * gamma * r * r;
    let imaginary = damping * (1.0 - r * r - mass_ratio * r * r);
    ((own * own + damping * damping) / (real * real + imaginary * imaginary)).sqrt()
}

#[test]
fn a_tuned_mass_is_tuned_as_its_closed_form_says() {
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }\n\
                tmd = { mass_ratio = 0.1, frequency_ratio = 0.9, damping_ratio = 0.2 }\n\
                force = { kind = \"sine\", amplitude_n = 1.2, frequency_ratio = 1 }\nrun = { duration_s = 8 }\n";
    let file = "case = \"case.toml\"\nobjective = \"x_over_z\"\nevaluations = 150\n\
                [record]\ncycles = 2\nsettle_cycles = 60\n\
                [[variable]]\nkey = \"tmd.frequency_ratio\"\nfrom = 0.8\nto = 1\n\
                [[variable]]\nkey = \"tmd.damping_ratio\"\nfrom = 0.1\nto = 0.3\n\
                [[axis]]\nkey = \"force.frequency_ratio\"\nfrom = 0.7\nto = 1.2\ncount = 26\nreduce = \"maximum\"\n";
    let found = answer(&folder(case, file));
    let peak = |gamma: f64, zeta: f64| {
        (0..=2500).map(|n| magnification(0.1, gamma, zeta, 0.7 + 0.0002 * f64::from(n))).fold(0.0, f64::max)
    };
    let (gamma, zeta) = (variable(&found, 0), variable(&found, 1));
    let objective = found["objective"].as_f64().unwrap();
    // After 60 cycles the slower mode, whose damping ratio is above 0.04, has e^(−2π·60·0.04) = 3e-7 of its transient left.
    assert!((objective / peak(gamma, zeta) - 1.0).abs() < 1e-5, "{objective} at {gamma}, {zeta}");
    let grid = (0..=50).flat_map(|a| (0..=50).map(move |b| (0.88 + 0.001 * f64::from(a), 0.15 + 0.002 * f64::from(b))));
    let least = grid.map(|(gamma, zeta)| peak(gamma, zeta)).fold(f64::MAX, f64::min);
    // The values are rounded, and the worst within 0.1 % of them counts.
    assert!(objective < 1.003 * least, "{objective} against {least}");
    // The reference is the same damper after Den Hartog.
    let (mass_ratio, tmd) = (0.1, &found["references"]["tmd"]);
    let tuned = peak(1.0 / (1.0 + mass_ratio), (3.0 * mass_ratio / (8.0 * (1.0 + mass_ratio))).sqrt());
    assert_eq!(tmd["tuning"], "den_hartog");
    assert!((tmd["objective"].as_f64().unwrap() / tuned - 1.0).abs() < 1e-5, "{tmd} against {tuned}");
}

#[test]
fn the_optimum_is_a_simulation_that_anyone_can_repeat() {
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{RESTITUTION}{BAND}"));
    let found = answer(&folder);
    let set = [
        format!("particle.clearance_ratio={:?}", variable(&found, 0)),
        format!("particle.wall.coefficient={:?}", variable(&found, 1)),
        format!("base.frequency_hz={:?}", found["band"][0]["value"].as_f64().unwrap()),
    ];
    let mut command = damprig(&folder);
    command.args(["simulate", "case.toml", "--json"]);
    for value in &set {
        command.args(["--set", value]);
    }
    let result: Value = serde_json::from_slice(&command.output().unwrap().stdout).expect("JSON");
    let largest_m = result["summary"]["max_abs_x_m"].as_f64().unwrap();
    assert_eq!(found["objective"].as_f64().unwrap(), largest_m / 0.003);
    // The case's own start, the centre, is among the starts.
    let starts = &found["starts"];
    let [min, max] = ["min", "max"].map(|key| starts[key].as_f64().unwrap());
    assert!((min..=max).contains(&found["objective"].as_f64().unwrap()), "{starts}");
}

#[test]
fn small_changes_are_those_of_a_study_that_searches_the_band_as_the_optimum() {
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{BAND}"));
    let found = answer(&folder);
    let change = &found["sensitivity"][0];
    assert_eq!(change["here"], found["objective"]);
    let (at, step) = (variable(&found, 0), change["step"].as_f64().unwrap());
    let study = format!(
        "case = \"case.toml\"\nmetrics = [\"max_x_over_z\"]\n{}[[axis]]\nkey = \"particle.clearance_ratio\"\nvalues = [{:?}, {:?}]\n",
        BAND.replace("\"maximum\"", "\"scan_maximum\""),
        at - step,
        at + step
    );
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "study", "--quiet"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let scanned = column(&table(&folder.path().join("study/table.parquet")), "max_x_over_z");
    let all: Vec<f64> = ["below", "above"].map(|side| change[side].as_f64().unwrap()).into();
    assert_eq!(all, scanned);
    // A change that is better is told.
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(change["better"].is_null(), least >= found["objective"].as_f64().unwrap());
}

#[test]
fn the_answer_is_the_same_for_one_thread_and_two() {
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{RESTITUTION}{BAND}"));
    for threads in ["1", "2"] {
        let output = run(&folder, threads, &["--out", threads]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for file in ["answer.json", "evaluations.parquet", "neighbourhood.parquet"] {
        let bytes = |threads: &str| std::fs::read(folder.path().join(threads).join(file)).unwrap();
        assert!(bytes("1") == bytes("2"), "{file}");
    }
    let output = run(&folder, "2", &["--out", "1"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && told.contains("not empty"), "{told}");
}

/// What the values at these shares of the variables' ranges give.
fn at(optimisation: &Optimisation, shares: &[f64]) -> Evaluated {
    let values = evaluate::values(optimisation, shares);
    evaluate::at_values(optimisation, values, Care::of(Effort::Peaks), &|_| true).expect("it is valid")
}

/// The least objective of the study of the same ranges, with so many values of each variable.
fn least_of_dense_search(optimisation: &Optimisation, count: usize) -> f64 {
    let variables = optimisation.variables.len();
    let points = count.pow(variables as u32);
    let at = |point: usize| {
        let shares: Vec<f64> = (0..variables)
            .map(|variable| (point / count.pow(variable as u32) % count) as f64 / (count - 1) as f64)
            .collect();
        at(optimisation, &shares).objective
    };
    (0..points).map(at).fold(f64::MAX, f64::min)
}

/// The jumps of the objective are narrower than any search is dense, so the claim is on the value, not on the place.
#[test]
fn the_optimum_is_within_half_a_percent_of_a_dense_search() {
    let is_full = is_full();
    let (variables, count, evaluations) =
        if is_full { (format!("{CLEARANCE}{RESTITUTION}"), 100, 4_000) } else { (CLEARANCE.to_string(), 600, 400) };
    let top = TOP.replace("300", &evaluations.to_string());
    let folder = folder(CASE, &format!("{top}{variables}{BAND}"));
    let optimisation = read(&folder);
    let found = search::run(&optimisation, &|_| true).expect("it is valid");
    let (best, least) = (found.points[found.best].1.objective, least_of_dense_search(&optimisation, count));
    assert!(best < 1.005 * least, "{best} against {least} of the dense search");
}

#[test]
fn a_constraint_is_kept_at_every_point_of_the_band_and_costs_what_it_costs() {
    // The range that keeps the constraint is narrow.
    let top = TOP.replace("200", "300");
    let free = answer(&folder(CASE, &format!("{top}{CLEARANCE}{BAND}")));
    let constraint = "[[constraint]]\nmetric = \"impacts_per_cycle\"\nat_most = 1.96\n";
    let folder = folder(CASE, &format!("{top}{CLEARANCE}{BAND}{constraint}"));
    let bound = answer(&folder);
    // Values are rounded and judged by their tolerances, which moves either by less than a percent.
    assert!(bound["objective"].as_f64() >= free["objective"].as_f64().map(|free| 0.99 * free));
    for frequency in ["2.3", "2.4", "2.433", "2.47", "2.5", "2.53", "2.6", "2.666", "2.7"] {
        let set =
            [format!("particle.clearance_ratio={:?}", variable(&bound, 0)), format!("base.frequency_hz={frequency}")];
        let mut command = damprig(&folder);
        command.args(["simulate", "case.toml", "--json", "--set", &set[0], "--set", &set[1]]);
        let result: Value = serde_json::from_slice(&command.output().unwrap().stdout).expect("JSON");
        let cycles = 8.0 * frequency.parse::<f64>().unwrap();
        assert!(result["summary"]["impact_count"].as_f64().unwrap() / cycles <= 1.96 * (1.0 + 1e-12), "{frequency} Hz");
    }
}

#[test]
fn the_force_of_a_hard_wall_is_a_constraint() {
    let case = CASE.replace("coefficient = 0.5 }", "coefficient = 0.5, contact_time_s = 0.002 }");
    let force_n = |bound: &str| {
        let folder = folder(&case, &format!("{TOP}{CLEARANCE}{bound}"));
        let best = answer(&folder);
        let mut command = damprig(&folder);
        let set = format!("particle.clearance_ratio={:?}", variable(&best, 0));
        command.args(["simulate", "case.toml", "--json", "--set", &set]);
        let result: Value = serde_json::from_slice(&command.output().unwrap().stdout).expect("JSON");
        (
            result["summary"]["peak_contact_force_n"].as_f64().expect("a force"),
            best["objective"].as_f64().expect("a ratio"),
        )
    };
    let (free_n, free) = force_n("");
    let limit_n = 0.96 * free_n;
    let (bound_n, bound) =
        force_n(&format!("[[constraint]]\nmetric = \"peak_contact_force_n\"\nat_most = {limit_n}\n"));
    assert!(bound_n <= limit_n && bound >= free, "{bound_n} N of {limit_n} N, {bound} after {free}");
}

#[test]
fn constraints_that_no_point_keeps_are_refused_with_the_least_violation() {
    let constraint = "[[constraint]]\nmetric = \"impacts_per_cycle\"\nat_least = 100\n";
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{BAND}{constraint}"));
    let output = run(&folder, "2", &["--json"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    for word in ["file.toml", "no point keeps", "impacts_per_cycle", "at least 100", "beyond it by", "loosen"] {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["is_feasible"], false);
    assert_eq!(found["constraints"][0]["is_kept"], false);
}

#[test]
fn the_worst_start_counts_unless_another_value_is_wanted() {
    let file = |over: &str| format!("{TOP}{CLEARANCE}[ensemble]\nstarts = 5\n{over}");
    let objective = |over: &str| {
        let folder = folder(CASE, &file(over));
        at(&read(&folder), &[0.3]).objective
    };
    let optimisation = folder(CASE, &file(""));
    let optimisation = read(&optimisation);
    let value = at(&optimisation, &[0.3]).values;
    let mut starts =
        evaluate::from_starts(&optimisation, &value, &[-1.0, -0.5, 0.0, 0.5, 1.0], Effort::Peaks, &|_| true)
            .expect("sound");
    starts.sort_by(f64::total_cmp);
    assert!(starts[0] < starts[4], "the starts differ");
    assert_eq!(objective(""), starts[4]);
    assert_eq!(objective("over = \"median\"\n"), starts[2]);
    assert_eq!(objective("over = \"mean\"\n"), starts.iter().sum::<f64>() / 5.0);
    let q95 = objective("over = \"q95\"\n");
    assert!((q95 / (starts[3] + 0.8 * (starts[4] - starts[3])) - 1.0).abs() < 1e-15, "{q95} of {starts:?}");
}

#[test]
fn a_search_that_is_stopped_keeps_its_best_point() {
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{RESTITUTION}{BAND}"));
    let found = search::run(&read(&folder), &|progress: &SearchProgress| progress.done < 40).expect("it has points");
    assert!(found.is_stopped && (40..80).contains(&found.points.len()), "{}", found.points.len());
    let best = found.points[found.best].1.objective;
    assert!(found.points.iter().all(|(_, point)| point.objective >= best));
}

#[test]
fn a_wrong_file_is_refused_with_what_is_wrong_and_what_to_do() {
    let cases: &[(String, &[&str])] = &[
        (TOP.into(), &["`variable` is missing"]),
        (
            format!("{TOP}[[variable]]\nkey = \"particle.clearence_m\"\nfrom = 0.01\nto = 0.02\n"),
            &["unknown key", "particle.clearence_m", "clearance_m"],
        ),
        (
            format!("{TOP}[[variable]]\nkey = \"particle.clearance_m\"\nfrom = 0.02\nto = 0.01\n"),
            &["file.toml:7", "greater than `from` = 0.02", "exchange"],
        ),
        (
            format!("{TOP}[[variable]]\nkey = \"particle.wall.coefficient\"\nfrom = 0.5\nto = 1.5\n"),
            &["file.toml:7:6", "`particle.wall.coefficient` = 1.5", "from 0 to 1"],
        ),
        (format!("{TOP}{CLEARANCE}{CLEARANCE}"), &["particle.clearance_ratio", "varied twice"]),
        (format!("{TOP}{CLEARANCE}{}", BAND.replace("reduce = \"maximum\"\n", "")), &["no `reduce`", "worst case"]),
        (format!("{TOP}{CLEARANCE}{}", BAND.replace("count = 5\n", "")), &["number of values", "give `count`"]),
        (
            format!("{TOP}{CLEARANCE}[[constraint]]\nmetric = \"peak_contact_force_n\"\nat_most = 20\n"),
            &["file.toml:9", "peak_contact_force_n", "hard wall", "contact_time_s", "voigt"],
        ),
        (format!("{TOP}{CLEARANCE}[[constraint]]\nmetric = \"rms_x_m\"\n"), &["at_most"]),
        (TOP.replace("max_x_over_z", "max_x_over_y") + CLEARANCE, &["max_x_over_y", "max_x_over_z"]),
        (TOP.replace("case.toml", "cas.toml") + CLEARANCE, &["cas.toml", "did you mean", "case.toml"]),
    ];
    for (file, words) in cases {
        let folder = folder(CASE, file);
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{file}\n{told}");
        for word in *words {
            assert!(told.contains(word), "no {word:?} in:\n{told}");
        }
        assert!(!folder.path().join("out").exists(), "{file}");
    }
}

#[test]
fn an_answer_is_replaced_only_by_force() {
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}"));
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    for file in ["answer.json", "neighbourhood.parquet"] {
        std::fs::write(out.join(file), "of another answer").unwrap();
    }
    let refused = run(&folder, "2", &["--out", "out"]);
    assert!(
        refused.status.code() == Some(2)
            && String::from_utf8_lossy(&refused.stderr).contains("--out: out is not empty")
    );
    let replaced = run(&folder, "2", &["--out", "out", "--force"]);
    assert!(replaced.status.success(), "{}", String::from_utf8_lossy(&replaced.stderr));
    serde_json::from_slice::<serde_json::Value>(&std::fs::read(out.join("answer.json")).unwrap()).unwrap();
    assert!(std::fs::read(out.join("neighbourhood.parquet")).is_ok_and(|bytes| bytes.starts_with(b"PAR1")));
}

#[test]
fn shipped_optimisations_are_sound() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("optimisations");
    let files: Vec<PathBuf> = std::fs::read_dir(shipped).unwrap().flatten().map(|entry| entry.path()).collect();
    let files: Vec<&PathBuf> = files.iter().filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    assert!(files.len() >= 3);
    for file in files {
        let optimisation = Optimisation::read(file).unwrap_or_else(|refusal| panic!("{refusal}"));
        assert!(optimisation.simulations_per_point() > 10, "it is judged over a band or from several starts");
    }
}

/// The printed optimum: the value, and `--set` for each variable and for the place in the band.
fn printed(told: &str) -> (f64, Vec<String>) {
    let (_, value) = told.split_once("est max_x_over_z: ").expect("a headline");
    let value = value.split_whitespace().next().and_then(|value| value.parse().ok()).expect("a number");
    let lines = told.lines().skip_while(|line| !line.contains("est max_x_over_z: ")).skip(1);
    let set = |line: &str| {
        let mut words = line.trim_start().trim_start_matches("there, ").split_whitespace();
        Some(format!("{}={}", words.next()?, words.next()?))
    };
    (value, lines.take_while(|line| line.starts_with("  ")).filter_map(set).collect())
}

fn simulated_x_over_z(folder: &TempDir, set: &[String]) -> f64 {
    let mut command = damprig(folder);
    command.args(["simulate", "case.toml", "--json"]).args(set.iter().flat_map(|set| ["--set", set]));
    let result: Value = serde_json::from_slice(&command.output().unwrap().stdout).expect("JSON");
    result["summary"]["max_abs_x_m"].as_f64().unwrap() / 0.003
}

/// Frequency, restitution and duration of cases in which the search's best clearance lies on a ridge: its first six digits give a value that
/// differs by 1.7 % and 0.2 %, and 0.1 % more or less by up to 13 %.
const ON_A_RIDGE: [(&str, &str, &str); 2] = [("2.48", "0.9", "100"), ("2.42", "0.95", "100")];

#[test]
fn the_printed_values_give_the_printed_optimum_and_keep_it_within_their_tolerance() {
    for (frequency_hz, restitution, duration_s) in ON_A_RIDGE {
        let case = CASE
            .replace("frequency_hz = 2.5 }", &format!("frequency_hz = {frequency_hz} }}"))
            .replace("coefficient = 0.5", &format!("coefficient = {restitution}"))
            .replace("duration_s = 8", &format!("duration_s = {duration_s}"));
        let file = format!("{TOP}[[variable]]\nkey = \"particle.clearance_m\"\nfrom = 0.01\nto = 0.05\n")
            .replace("300", "1000");
        let folder = folder(&case, &file);
        let output = run(&folder, "2", &[]);
        let told = String::from_utf8_lossy(&output.stdout);
        let (value, set) = printed(&told);
        let typed = simulated_x_over_z(&folder, &set);
        // Six digits are printed.
        assert!((typed / value - 1.0).abs() < 1e-5, "{typed} with {set:?} typed in\n{told}");
        let (key, at) = set[0].split_once('=').expect("a value");
        assert!(at.trim_start_matches(['0', '.']).len() <= 4, "four digits can be set: {at}");
        let (_, worst) = told.split_once("(up to ").expect("what the tolerances make of it");
        let worst: f64 = worst.split_whitespace().next().and_then(|worst| worst.parse().ok()).expect("a number");
        let at: f64 = at.parse().unwrap();
        for change in [-1e-3 * at, 1e-3 * at] {
            let there = simulated_x_over_z(&folder, &[format!("{key}={}", at + change)]);
            assert!(there < worst * (1.0 + 1e-4), "{there} at {at} + {change}\n{told}");
        }
    }
}

/// The shipped band with 1601 frequencies in place of 21. The scan has as many and looks around its peaks, so it can miss a little only.
#[test]
fn the_peak_over_the_shipped_band_is_that_of_a_grid_of_1601_frequencies() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("optimisations/spid-band.toml");
    let optimisation = Optimisation::read(&shipped).expect("it is valid");
    let text = std::fs::read_to_string(&shipped).unwrap().replace("count = 21", "count = 1601");
    let dense = Optimisation::parse(&Source::new("dense.toml", text.as_str()), &shipped, None).expect("it is valid");
    let values = if is_full() {
        let found = search::run(&optimisation, &|_| true).expect("it is valid");
        let answer = Optimum::of(&optimisation, &found, &|_| true).expect("it is valid");
        vec![answer.variables.iter().map(|variable| variable.value).collect()]
    } else {
        vec![vec![10.2312, 0.137067], vec![15.0, 0.5]]
    };
    for values in values {
        let of = |optimisation: &Optimisation, effort: Effort| {
            let found = evaluate::at_values(optimisation, values.clone(), Care::of(effort), &|_| true);
            found.expect("it is valid").objective
        };
        let (peak, all) = (of(&optimisation, Effort::Scan), of(&dense, Effort::Grid));
        assert!(peak > 0.99 * all, "{peak} against {all} of 1601 frequencies at {values:?}");
        assert!(of(&optimisation, Effort::Peaks) >= of(&optimisation, Effort::Grid));
    }
}

#[test]
fn a_dry_run_of_hours_of_simulation_takes_seconds() {
    let band = BAND.replace("to = 2.7", "to = 1e5");
    let folder = folder(CASE, &format!("{TOP}{CLEARANCE}{band}[record]\nduration_s = 1e5\n"));
    let start = Instant::now();
    let output = run(&folder, "2", &["--dry-run"]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && told.contains("200 points of 5 simulations"), "{told}");
    // Some beginnings of 0.05 s, on a machine that does other things too.
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn a_tolerance_says_how_closely_the_optimum_is_stated() {
    let file = format!("{TOP}{}tolerance = 0.3\n", CLEARANCE);
    let found = answer(&folder(CASE, &file));
    let value = variable(&found, 0);
    assert!((10.0 * value - (10.0 * value).round()).abs() < 1e-9, "{value} has one decimal");
    assert_eq!(found["variables"][0]["tolerance"], 0.3);
    for (text, words) in
        [("tolerance = 30", ["file.toml:8", "below the range, 15"]), ("tolerance = 0", ["file.toml:8", "tolerance"])]
    {
        let output = run(&folder(CASE, &format!("{TOP}{CLEARANCE}{text}\n")), "2", &[]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && words.iter().all(|word| told.contains(word)), "{told}");
    }
}

/// The number before these words.
fn number_before(told: &str, words: &str) -> u64 {
    let (before, _) = told.split_once(words).unwrap_or_else(|| panic!("no {words:?} in:\n{told}"));
    before.split_whitespace().next_back().and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{told}"))
}

#[test]
fn a_dry_run_counts_the_simulations_of_the_search_and_of_what_follows_it() {
    let record = "[record]\nduration_s = 2\n";
    let constraint = "[[constraint]]\nmetric = \"impacts_per_cycle\"\nat_most = 1.96\n";
    let starts = "[ensemble]\nstarts = 2\n";
    for more in [CLEARANCE.into(), format!("{CLEARANCE}{RESTITUTION}"), format!("{CLEARANCE}{constraint}{starts}")] {
        let folder = folder(CASE, &format!("{}{more}{BAND}{record}", TOP.replace("200", "100")));
        let most =
            number_before(&String::from_utf8_lossy(&run(&folder, "2", &["--dry-run"]).stdout), " simulations in all");
        let found = answer(&folder);
        let (points, done) = (found["evaluations"].as_u64().unwrap(), found["simulations"].as_u64().unwrap());
        assert!(points <= 100, "{points} points of a search of 100");
        // 8 settings with their neighbours are the least that follows.
        assert!((points * 5 + 8 * 5..=most).contains(&done), "{done} simulations of {most} at most\n{more}");
        assert!(done > most / 30, "{done} simulations of {most} at most\n{more}");
    }
}
