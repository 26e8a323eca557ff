//! `damprig simulate` refuses to overwrite its inputs, to misread a unit, to ignore an option, and to run without
//! end.

use std::process::Output;

use crate::common::{damprig, folder};
use serde_json::Value;
use tempfile::TempDir;

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const RECORD: &str = "base = { kind = \"record\", file = \"shake.csv\", quantity = \"acceleration\", unit = \"g\" }\n";
const SHAKE: &str = "t,a\n0.0,0.1\n0.1,0.2\n0.2,-0.1\n";
const PARTICLE: &str =
    "particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";

fn simulate(folder: &TempDir, arguments: &[&str]) -> Output {
    damprig(folder).arg("simulate").args(arguments).output().unwrap()
}

/// The command must be refused with all of `words` and change no file.
fn refused(files: &[(&str, &str)], arguments: &[&str], words: &[&str]) {
    let folder = folder(files);
    let output = simulate(&folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}\n{told}");
    for word in words {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
    for (name, text) in files {
        assert_eq!(&std::fs::read_to_string(folder.path().join(name)).unwrap(), text, "{name} was changed");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), files.len(), "a file was left behind");
}

#[test]
fn an_output_never_overwrites_an_input_or_another_output() {
    let case = format!("{STRUCTURE}{RECORD}{PARTICLE}");
    let with_run = format!("{case}run = {{ duration_s = 1 }}\n");
    let impacts = with_run.replace("shake.csv", "motion.impacts.csv");
    let record = ("shake.csv", SHAKE);
    let of_the_record = ["--out", "shake.csv", "the record of the case"];
    refused(&[("case.toml", &with_run), record], &["case.toml", "--out", "shake.csv"], &of_the_record);
    refused(&[("case.csv", &with_run), record], &["case.csv", "--out", "./case.csv"], &["the case file"]);
    let of_impacts = ["the table of impacts of --out", "motion.impacts.csv", "the record of the case"];
    refused(
        &[("case.toml", &impacts), ("motion.impacts.csv", SHAKE)],
        &["case.toml", "--out", "motion.csv"],
        &of_impacts,
    );
    refused(&[("case.svg", &with_run), record], &["case.svg", "--plot", "case.svg"], &["--plot", "the case file"]);
}

#[cfg(unix)]
#[test]
fn a_link_to_the_record_counts_as_the_record() {
    let case = format!("{STRUCTURE}{RECORD}run = {{ duration_s = 1 }}\n");
    let folder = folder(&[("case.toml", &case), ("shake.csv", SHAKE)]);
    std::os::unix::fs::symlink("shake.csv", folder.path().join("link.csv")).unwrap();
    let output = simulate(&folder, &["case.toml", "--out", "link.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(folder.path().join("shake.csv")).unwrap(), SHAKE);
}

/// An AT2 file whose third line is `words` and whose values are in that unit.
fn at2(words: &str, values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| format!("{v:.15e}")).collect();
    format!("PEER STRONG MOTION\nNowhere\n{words}\nNPTS= {}, DT= .0500 SEC\n{}\n", values.len(), values.join("\n"))
}

fn largest_m(words: &str, per_g: f64) -> f64 {
    let values = [0.01, -0.02, 0.3, 0.15, -0.4].map(|g| g * per_g);
    let case = format!("{STRUCTURE}run = {{ duration_s = 1 }}\nbase = {{ kind = \"record\", file = \"shake.at2\" }}\n");
    let folder = folder(&[("case.toml", &case), ("shake.at2", &at2(words, &values))]);
    let output = simulate(&folder, &["case.toml", "--json"]);
    assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    answer["summary"]["max_abs_x_minus_z_m"].as_f64().unwrap()
}

#[test]
fn the_unit_in_an_at2_header_is_the_unit_of_its_values() {
    let in_g = largest_m("ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz", 1.0);
    for (unit, per_g) in [("M/S2", 9.80665), ("cm/s/s", 980.665), ("CM/SEC**2", 980.665), ("GAL", 980.665)] {
        let off = largest_m(&format!("ACCELERATION TIME SERIES IN UNITS OF {unit}"), per_g) / in_g - 1.0;
        assert!(off.abs() < 1e-12, "{unit}: {off:e}");
    }
}

#[test]
fn an_at2_file_of_velocities_or_of_an_unknown_unit_is_refused() {
    let case = format!("{STRUCTURE}run = {{ duration_s = 1 }}\nbase = {{ kind = \"record\", file = \"shake.at2\" }}\n");
    let told = |words: &str, expected: &[&str]| {
        refused(&[("case.toml", &case), ("shake.at2", &at2(words, &[1.0, 2.0]))], &["case.toml"], expected);
    };
    told("VELOCITY TIME SERIES IN UNITS OF CM/S", &["line 3", "VELOCITY", "must be an ACCELERATION series"]);
    told("DISPLACEMENT TIME HISTORY IN UNITS OF CM", &["line 3", "DISPLACEMENT"]);
    told("ACCELERATION TIME SERIES IN UNITS OF CM/S", &["line 3", "\"CM/S\" is not allowed", "CM/S2"]);
}

#[test]
fn wrong_samples_of_the_base_are_refused_and_a_long_list_is_not_printed_whole() {
    let long = format!("[{}]", vec!["0.001"; 20_000].join(", "));
    let both = format!("displacement_m = {long}, acceleration_m_per_s2 = {long}, time_step_s = 0.001");
    for (keys, words) in [
        ("displacement_m = [0.001], time_step_s = 0.1", "has 1 samples: a motion has at least 2"),
        ("displacement_m = [0, nan], time_step_s = 0.1", "must be a finite number"),
        ("displacement_m = [0, 1]", "`base.time_step_s` is missing"),
        ("time_step_s = 0.1", "`base.displacement_m` is missing"),
        ("displacement_m = [0, 1], time_step_s = 0", "must be greater than 0"),
        (&both, "is given too, and says the same quantity"),
    ] {
        let case = format!("{STRUCTURE}base = {{ kind = \"samples\", {keys} }}\nrun = {{ duration_s = 1 }}\n");
        let folder = folder(&[("case.toml", &case)]);
        let output = simulate(&folder, &["case.toml"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(words), "no {words:?} in:\n{told}");
        assert!(told.len() < 3_000, "{} characters", told.len());
    }
}

#[test]
fn steady_cycles_that_the_run_does_not_have_are_refused() {
    let told = |run: &str, expected: &[&str]| {
        refused(&[("case.toml", &format!("{STRUCTURE}run = {run}\n"))], &["case.toml"], expected);
    };
    let without = ["`run.steady_from_cycle` = 2 is not allowed", "give `cycle_s`"];
    told("{ duration_s = 4, steady_from_cycle = 2 }", &without);
    let beyond = ["`run.steady_from_cycle` = 10 is not allowed", "the run has 10"];
    told("{ duration_s = 4, cycle_s = 0.4, steady_from_cycle = 10 }", &beyond);
    let sine = "base = { kind = \"sine\", amplitude_m = 1e-3, frequency_hz = 2.5 }\n";
    let case = format!("{STRUCTURE}{sine}run = {{ duration_s = 4, steady_from_cycle = 10 }}\n");
    refused(&[("case.toml", &case)], &["case.toml"], &beyond);
    let case = format!("{STRUCTURE}run = {{ duration_s = 4, cycle_s = 0.4, steady_from_cycle = 9 }}\n");
    assert!(simulate(&folder(&[("case.toml", &case)]), &["case.toml"]).status.success(), "the last cycle is one");
}

#[test]
fn a_json_list_is_reported_as_json() {
    let told = |text: &str, expected: &[&str]| refused(&[("case.json", text)], &["case.json"], expected);
    told("[{\"structure\": {}}]", &["this JSON is not an object", "in its own file"]);
    told(" [ ]", &["this JSON is not an object"]);
}

#[test]
fn values_outside_the_range_of_their_unit_are_refused() {
    let run = "run = { duration_s = 1 }\n";
    let told = |case: &str, expected: &[&str]| refused(&[("case.toml", case)], &["case.toml"], expected);
    let force = ["`friction_damper.force_n` = 1e300 is not allowed", "at most 1e12 N in magnitude"];
    told(&format!("{STRUCTURE}{run}friction_damper = {{ force_n = 1e300 }}\n"), &force);
    let base = ["`base.amplitude_m` = 1e100 is not allowed", "at most 1e6 m"];
    told(
        &format!("{STRUCTURE}{run}base = {{ kind = \"sine\", amplitude_m = 1e100, frequency_hz = 2 }}\n{PARTICLE}"),
        &base,
    );
    let friction = ["`particle.friction_coefficient` = 1e308 is not allowed", "at most 1e2 in magnitude"];
    let particle = PARTICLE.replace("clearance_m", "friction_coefficient = 1e308, clearance_m");
    told(&format!("{STRUCTURE}{run}{particle}"), &friction);
    let mass = ["`structure.mass_kg` = 1e-300 is not allowed", "at least 1e-12 kg"];
    told(&format!("{}{run}", STRUCTURE.replace("1.6", "1e-300")), &mass);
    let cycle = ["`run.cycle_s` = 1e-10 is not allowed", "a millionth of the period"];
    told(&format!("{STRUCTURE}run = {{ duration_s = 1, cycle_s = 1e-10 }}\n"), &cycle);
}

/// 1e308 g has no number in m/s², and the square of 1e200 m none either. The limits are those of a key in these units.
#[test]
fn a_value_of_a_record_that_is_too_large_in_si_units_is_refused_with_its_place() {
    let told = |words: &str, file: (&str, &str), expected: &[&str]| {
        let base = format!("base = {{ kind = \"record\", file = \"{}\"{words} }}\n", file.0);
        let case = format!("{STRUCTURE}run = {{ duration_s = 1 }}\n{base}");
        refused(&[("case.toml", &case), file], &["case.toml"], expected);
    };
    let acceleration = |unit: &str| format!(", quantity = \"acceleration\", unit = \"{unit}\"");
    let displacement = |unit: &str| format!(", quantity = \"displacement\", unit = \"{unit}\"");
    let csv = |value: &str| format!("t_s,value\n0,0\n0.01,{value}\n0.02,0\n");
    let place = |value: &str| format!("shake.csv: line 3, column 2: \"{value}\"");
    let file = csv("1e308");
    told(
        &acceleration("g"),
        ("shake.csv", &file),
        &[&place("1e308"), "g is not allowed", "at most 1e6 m/s² in magnitude"],
    );
    let file = csv("-1e200");
    told(
        &displacement("m"),
        ("shake.csv", &file),
        &[&place("-1e200"), "m is not allowed", "at most 1e6 m in magnitude"],
    );
    let file = csv("1.1e9");
    told(&displacement("mm"), ("shake.csv", &file), &[&place("1.1e9"), "mm is not allowed", "is the unit right?"]);
    let file = csv("0.5");
    let scaled = format!("{}, scale = 1e300", displacement("mm"));
    told(&scaled, ("shake.csv", &file), &[&place("0.5"), "mm times scale = 1", "at most 1e6 m"]);
    let far = "t_s,value\n0,0\n1e300,1\n2e300,0\n";
    told(&displacement("mm"), ("shake.csv", far), &["a time step of 1e300 s is not allowed", "at most 1e12 s"]);
    let peer = at2("ACCELERATION TIME SERIES IN UNITS OF G", &[0.1, 1e308]);
    told("", ("shake.at2", &peer), &["line 6, column 1", "g is not allowed", "at most 1e6 m/s²"]);
}

/// The largest allowed values give finite results.
#[test]
fn a_record_at_its_bounds_gives_finite_results() {
    for (quantity, unit, most) in [("acceleration", "cm/s2", "1e8"), ("displacement", "mm", "1e9")] {
        let keys = format!("quantity = \"{quantity}\", unit = \"{unit}\"");
        let base = format!("base = {{ kind = \"record\", file = \"shake.csv\", {keys} }}\n");
        let case = format!("{STRUCTURE}run = {{ duration_s = 1 }}\n{base}{PARTICLE}");
        let shake = format!("t_s,value\n0,0\n0.01,{most}\n0.02,-{most}\n0.03,0\n");
        let output = simulate(&folder(&[("case.toml", &case), ("shake.csv", &shake)]), &["case.toml", "--json"]);
        assert!(output.status.success(), "{unit}: {}", String::from_utf8_lossy(&output.stderr));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        for name in ["rms_x_m", "max_abs_x_m", "max_abs_x_minus_z_m"] {
            assert!(answer["summary"][name].as_f64().is_some_and(f64::is_finite), "{unit}: {answer}");
        }
    }
}

/// All values at the ends of their ranges.
#[test]
fn runs_with_values_at_the_bounds_end_with_finite_results() {
    for more in [
        "friction_damper = { force_n = 1e12 }\nbase = { kind = \"sine\", amplitude_m = 1e6, frequency_hz = 2.3 }\n",
        "initial = { x_m = 1e6 }\nfriction_damper = { force_n = 1e-300 }\n",
        "particle = { mass_ratio = 1e-9, clearance_m = 1e6, friction_coefficient = 100, \
         wall = { kind = \"restitution\", coefficient = 0.5 } }\ninitial = { v_m_per_s = 1e6 }\n",
    ] {
        let case = format!("{STRUCTURE}{more}run = {{ duration_s = 0.5 }}\n");
        let output = simulate(&folder(&[("case.toml", &case)]), &["case.toml", "--json"]);
        assert!(output.status.success(), "{more}\n{}", String::from_utf8_lossy(&output.stderr));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(answer["summary"]["max_abs_x_m"].as_f64().is_some_and(f64::is_finite), "{answer}");
    }
}

/// A case with so many impacts that simulated time hardly advances.
const FLOOD: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
     particle = { mass_ratio = 0.1, clearance_m = 1e-12, wall = { kind = \"restitution\", coefficient = 1 } }\n\
     initial = { x_m = 0.01, y_m = 0.01, v_m_per_s = 0, u_m_per_s = 1 }\n\
     run = { duration_s = 40 }\n";

#[cfg(unix)]
#[test]
fn a_run_with_very_many_impacts_warns_and_obeys_ctrl_c() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let folder = folder(&[("case.toml", FLOOD)]);
    let mut process = Command::new(assert_cmd::cargo::cargo_bin("damprig"))
        .current_dir(folder.path())
        .args(["simulate", "case.toml", "--json"])
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
    assert!(Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap().success());
    let output = process.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(answer["stopped_at_s"].as_f64().is_some_and(|t_s| t_s < 40.0), "{answer}");
}

#[test]
fn the_estimated_cost_includes_short_arcs_after_a_pulse() {
    use damprig::input::Source;
    use damprig::simulation::{Case, cost};

    let case = |duration_s: &str| {
        let base = format!("base = {{ kind = \"half_sine\", amplitude_m = 0.003, duration_s = {duration_s} }}\n");
        let text = format!("{STRUCTURE}{base}run = {{ duration_s = 1000 }}\n");
        cost::estimate(&Case::parse(&Source::new("case.toml", text), "case").unwrap()).unwrap()
    };
    let short = case("1e-6");
    assert!(short.arcs > 1e8, "{short:?}");
    assert!(case("1").arcs < 1e6);
}
