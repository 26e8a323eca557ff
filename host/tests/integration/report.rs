//! The report page (`report.html`, `damprig runs report`) of complete, interrupted and damaged runs, and of runs with hostile
//! names.

use std::path::Path;
use std::process::Command;

use crate::common::{Fate, Served, assert_self_contained, cut_off, damprig, folder_with, manifest, short};
use damprig_core::io::Sensor;
use damprig_protocol::{Event, FromDevice};
use predicates::prelude::*;
use predicates::str::contains;

fn page(run: &Path) -> String {
    std::fs::read_to_string(run.join("report.html")).unwrap()
}

#[test]
fn the_page_of_a_complete_run_is_self_contained_and_reproducible() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    let page = page(&run);
    let said =
        ["6 of 6 points", "Hybrid (SPID + FD)", "e = 0.47", "<svg", "Phase of x relative to z", "x_m (m)", "complete"];
    said.iter().for_each(|words| assert!(page.contains(words), "{words}"));
    assert_self_contained(&page);
    damprig(&folder).args(["runs", "verify", "out"]).assert().success().stdout(contains("10 of 10 files"));
    damprig(&folder).args(["runs", "report", "out"]).assert().success().stdout(contains("Report: out.html"));
    assert_eq!(std::fs::read_to_string(folder.path().join("out.html")).unwrap(), page);
    damprig(&folder).args(["runs", "report", "out"]).assert().code(2).stderr(contains("out.html: it exists"));
    let elsewhere = ["runs", "report", "out", "--out", "nowhere/page.html"];
    damprig(&folder).args(elsewhere).assert().code(1).stderr(contains("there is no folder nowhere"));
}

#[test]
fn the_page_of_an_interrupted_run_says_why_and_is_complete_after_resuming() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let broken = page(&run);
    for words in ["incomplete", "the link to", "3 of 6 points", "Ended early", "interrupted"] {
        assert!(broken.contains(words), "{words}");
    }
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let whole = page(&run);
    assert!(whole.contains("6 of 6 points") && whole.contains("resumed 1 times"));
    // The earlier interruption stays on the page.
    assert!(whole.contains("Ended early"));
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn two_experiments_on_one_set_up_have_a_row_and_a_curve_each() {
    let second = "\n[[experiment]]\nname = \"slowly\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.45, 2.55]\n\
                  start = \"from_rest\"\nsettle_s = 2.0\ndwell_s = 4.0\nset_ups = [\"bare\"]\n";
    let folder = folder_with(&(short() + second));
    let said = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let said = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    // Each row has the points of its experiment alone.
    let table = said.lines().filter(|line| line.starts_with('│'));
    let rows: Vec<&str> = table.filter(|line| line.contains("sweep") || line.contains("slowly")).collect();
    assert_eq!(rows.len(), 3, "{said}");
    assert!(rows[0].contains("bare") && rows[1].contains("slowly") && rows[2].contains("hybrid"), "{said}");
    let page = page(&folder.path().join("out"));
    assert!(page.contains("Bare structure: sweep") && page.contains("Bare structure: slowly"));
    assert!(!page.contains("Hybrid (SPID + FD): sweep"));
}

#[test]
fn the_page_begins_with_what_the_damper_makes_of_the_peak() {
    let folder = folder_with(&short());
    let told = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let told = String::from_utf8_lossy(&told.get_output().stdout).into_owned();
    let peak = |set_up: &str| -> f64 {
        let line = told.lines().find(|line| line.contains(&format!("] {set_up}: "))).expect(set_up);
        let number = line.split("peak X/Z (cycle maxima) ").nth(1).and_then(|rest| rest.split(' ').next());
        number.unwrap().parse().unwrap()
    };
    let less = 100.0 * (1.0 - peak("hybrid") / peak("bare"));
    let page = page(&folder.path().join("out"));
    let line = page.split("<p class=\"headline\">").nth(1).unwrap().split("</p>").next().unwrap();
    assert!(line.starts_with("Peak X/Z, sweep: Bare structure "), "{line}");
    // Three points do not resolve a peak, and the line says so.
    assert!(line.contains(" → Hybrid (SPID + FD) ") && line.matches("not resolved").count() == 2, "{line}");
    assert!(line.ends_with(&format!(", −{less:.0} %")), "{line}: {less} %");
}

/// Numbers of the curves of a figure that the page's script shows: abscissa, value, and the ends of the bar or band.
fn drawn_points(figure: &str) -> Vec<Vec<Vec<f64>>> {
    let lists = figure.split("data-points=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    lists.map(|list| serde_json::from_str(list).unwrap()).collect()
}

#[test]
fn the_points_of_a_figure_have_bars_of_their_recorded_intervals() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let figure = std::fs::read_to_string(folder.path().join("out/figure.svg")).unwrap();
    let journal = std::fs::read_to_string(folder.path().join("out/journal.jsonl")).unwrap();
    let lines = journal.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let results: Vec<_> = lines.filter(|line| line["entry"] == "result").collect();
    let drawn: Vec<Vec<f64>> = drawn_points(&figure).concat();
    assert_eq!((results.len(), drawn.len()), (6, 6));
    let number = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    for row in &results {
        let value = number(row, "mean_cycle_max_m") / number(row, "z_amplitude_m");
        let half_width = number(row, "interval") * value;
        // The figure has six digits.
        let is_own = |p: &&Vec<f64>| p[0] == number(row, "frequency_hz") && (p[1] / value - 1.0).abs() < 1e-5;
        let point = drawn.iter().find(is_own).unwrap_or_else(|| panic!("{row}"));
        assert!(half_width > 0.0 && (point[3] - value - half_width).abs() < 1e-5 * value, "{row}: {point:?}");
        assert!((value - half_width - point[2]).abs() < 1e-5 * value, "{row}: {point:?}");
    }
    // A bar has two ends.
    assert_eq!(figure.matches("M-4 0H4\"").count(), 2 * results.len());
    assert!(figure.contains("95 % interval of the mean over cycles"));
}

#[test]
fn repeats_are_points_within_a_band_around_their_mean_and_have_one_headline() {
    let folder = folder_with(&short().replace("\ndwell_s", "\nrepeats = 3\ndwell_s"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let figure = std::fs::read_to_string(folder.path().join("out/figure.svg")).unwrap();
    for point in drawn_points(&figure).concat() {
        assert!(point[2] < point[1] && point[1] < point[3], "{point:?}");
    }
    let (band, dot) = (" opacity=\"0.2\" points=", "<circle r=\"2.2\"");
    assert_eq!((figure.matches(band).count(), figure.matches(dot).count()), (2, 2 * 3 * 3));
    assert!(figure.contains("repeats, their mean and range") && !figure.contains("95 % interval"));
    let page = page(&folder.path().join("out"));
    assert_eq!(page.matches("<p class=\"headline\">Peak X/Z, sweep: ").count(), 1);
    assert_eq!(page.matches("class=\"headline\"").count(), 1);
}

#[test]
fn several_runs_have_one_page_with_all_curves_in_one_figure() {
    let folder = folder_with(&short());
    for name in ["first", "second"] {
        damprig(&folder).args(["run", "test.toml", "--out", name]).assert().success();
    }
    damprig(&folder).args(["runs", "report", "first", "second"]).assert().success().stdout(contains("runs.html"));
    let page = std::fs::read_to_string(folder.path().join("runs.html")).unwrap();
    for words in ["2 runs", "first: Bare structure", "second: Hybrid (SPID + FD)"] {
        assert!(page.contains(words), "{words}");
    }
    assert_eq!(page.matches("6 of 6 points;").count(), 2);
    damprig(&folder).args(["runs", "report", "first", "third"]).assert().code(2).stderr(contains("third"));
}

#[test]
fn a_set_up_has_its_colour_in_every_figure_and_a_further_run_of_it_is_dashed() {
    let release = "\n[[experiment]]\nname = \"release\"\nkind = \"free_vibration\"\nset_ups = [\"hybrid\"]\nstart_m = 0.02\nmeasure_s = 2\n";
    let folder = folder_with(&(short() + release));
    for name in ["first", "second"] {
        damprig(&folder).args(["run", "test.toml", "--out", name]).assert().success();
    }
    damprig(&folder).args(["runs", "report", "first", "second"]).assert().success();
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let (black, orange) = ("stroke=\"#000000\"", "stroke=\"#E69F00\"");
    // The second set-up of the campaign, alone in this figure.
    let transients = text("first/transients.svg");
    assert!(transients.contains(orange) && !transients.contains(black));
    let page = text("runs.html");
    for (label, colour) in [("Bare structure", black), ("Hybrid (SPID + FD)", orange)] {
        for (run, is_dashed) in [("first", false), ("second", true)] {
            let curve = page.split(&format!("data-label=\"{run}: {label}\"")).nth(1).expect("a curve");
            let line = curve.split("<polyline ").nth(1).and_then(|rest| rest.split('>').next()).expect("a line");
            assert!(line.contains(colour) && line.contains("dasharray=\"6 4\"") == is_dashed, "{run} {label}: {line}");
        }
    }
    // The sketches, in the run's own page.
    let first = text("first/report.html");
    let sketches = first.split("class=\"sketches\"").nth(1).expect("sketches");
    assert!(sketches.contains("fill=\"#E69F00\"") && !sketches.contains("fill=\"#0072B2\""));
}

#[test]
fn the_curves_of_many_runs_have_a_figure_for_each_set_up() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "run-0"]).assert().success();
    let names: Vec<String> = (0..7).map(|n| format!("run-{n}")).collect();
    for name in &names[1..] {
        let copied = Command::new("cp").args(["-r", "run-0", name]).current_dir(folder.path()).status().unwrap();
        assert!(copied.success());
    }
    damprig(&folder).args(["runs", "report"]).args(&names).assert().success();
    let page = std::fs::read_to_string(folder.path().join("runs.html")).unwrap();
    // 7 runs with 2 curves each.
    assert!(page.contains("<h3>bare</h3>") && page.contains("<h3>hybrid</h3>"));
    assert_eq!(page.matches("over frequency of all runs").count(), 2);
}

#[test]
fn long_notes_are_folded_below_the_results() {
    let notes = "A word about it.\\n".repeat(100);
    let plan = format!("\n[plan]\noperator = \"A. B.\"\nnotes = \"{notes}\"\n");
    let folder = folder_with(&(short() + &plan));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let page = page(&folder.path().join("out"));
    let place = |words: &str| page.find(words).unwrap_or_else(|| panic!("{words}"));
    assert!(place("operator: A. B.") < place("Results") && place("characters, below the results") < place("Results"));
    assert!(place("A word about it.") > place("Results") && place("<details") < place("A word about it."));
}

#[test]
fn the_report_of_a_run_under_way_can_be_repeated() {
    let folder = folder_with(&short());
    let mut run = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    run.current_dir(folder.path()).args([
        "run",
        "test.toml",
        "--out",
        "out",
        "--rig",
        "virtual:realtime",
        "--speed",
        "5",
    ]);
    let mut run = run.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    let journal = folder.path().join("out/journal.jsonl");
    let begun = std::time::Instant::now();
    while !std::fs::read_to_string(&journal).is_ok_and(|text| text.contains("\"entry\":\"result\"")) {
        assert!(begun.elapsed() < std::time::Duration::from_secs(60));
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    damprig(&folder).args(["runs", "report", "out"]).assert().success();
    assert!(std::fs::read_to_string(folder.path().join("out.html")).unwrap().contains("still running"));
    damprig(&folder).args(["runs", "report", "out", "--force"]).assert().success();
    assert!(run.wait().unwrap().success());
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn lost_samples_are_reported_with_their_place() {
    let folder = folder_with(&short());
    let mut telemetry = 0;
    let board = Served::start(move |message| {
        let is_telemetry = matches!(message, FromDevice::Telemetry(_));
        telemetry += usize::from(is_telemetry);
        if is_telemetry && telemetry == 20 { Fate::Corrupt } else { Fate::Pass }
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "out"]).assert().success();
    let page = page(&folder.path().join("out"));
    let manifest = manifest(&folder.path().join("out"));
    let lost = manifest["counters"]["lost_rows"].as_u64().unwrap();
    assert!(lost > 0);
    assert!(page.contains(&format!("{lost} rows of samples are missing")) && page.contains("<h3>Gaps</h3>"));
    assert!(page.contains(&format!("<td>{lost}</td>")), "one gap of {lost} rows");
}

/// A board whose x sensor has the wrong sign and is clipped.
#[test]
fn a_sensor_of_wrong_sign_and_a_clipped_sensor_are_reported() {
    let folder = folder_with(&short());
    let board = Served::start(move |message| {
        let FromDevice::Event { seq, tick, event: Event::Point(mut point) } = *message else { return Fate::Pass };
        point.phase_rad += std::f32::consts::PI;
        point.clipped.insert(Sensor::X);
        Fate::Replace(Box::new(FromDevice::Event { seq, tick, event: Event::Point(point) }))
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "out"]).assert().success();
    let turned = page(&folder.path().join("out"));
    for words in ["x leads z at", "a sensor was clipped at the end of its range at 6 points: x"] {
        assert!(turned.contains(words), "{words}");
    }
    damprig(&folder).args(["run", "test.toml", "--out", "sound"]).assert().success();
    let sound = page(&folder.path().join("sound"));
    assert!(!sound.contains("x leads z") && !sound.contains("end of its range"));
}

#[test]
fn markup_in_a_name_is_escaped() {
    let label = "<script>alert(1)</script> & </svg>";
    let folder = folder_with(&short().replace("Bare structure", label));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let page = page(&folder.path().join("out"));
    assert!(page.matches("<script").count() == 1 && !page.contains("<script>") && !page.contains("& </svg>"));
    // In the tables and in both figures.
    assert!(page.matches("&lt;script&gt;alert(1)&lt;/script&gt; &amp; &lt;/svg&gt;").count() >= 4);
}

#[test]
fn the_page_names_unreadable_files_and_shows_the_rest() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let text = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    let damaged = text.replacen("\"entry\":\"segment\"", "\"entry\":\"sgment\"", 1);
    std::fs::write(run.join("journal.jsonl"), damaged).unwrap();
    std::fs::write(run.join("campaign.toml"), "name = ").unwrap();
    let answer = damprig(&folder).args(["runs", "report", "out", "--out", "page.html"]).assert().code(1);
    answer.stderr(contains("journal.jsonl: line 2").and(contains("campaign.toml")));
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("journal.jsonl: line 2") && page.contains("campaign.toml"));
    assert!(page.contains("<td class=\"word\">bare</td>"), "the points are in the journal's other lines");
    std::fs::remove_file(run.join("manifest.json")).unwrap();
    let answer = damprig(&folder).args(["runs", "report", "out", "--out", "none.html"]).assert().code(1);
    answer.stderr(contains("cannot read the manifest"));
    assert!(!folder.path().join("none.html").exists());
}
