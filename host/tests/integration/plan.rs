//! `[plan]`, repeats, instructions and the order of a campaign.

use crate::common::{damprig, folder_with, manifest, read_parquet, short};
use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::table::values::{numbers, texts};
use predicates::str::contains;

/// The short campaign with a plan, before its first table.
fn planned(plan: &str) -> String {
    short().replacen("[structure]", &format!("[plan]\n{plan}\n[structure]"), 1)
}

fn read(text: &str) -> Campaign {
    Campaign::parse(Source::new("test.toml", text)).unwrap()
}

#[test]
fn what_is_stated_about_a_run_is_in_manifest_and_page() {
    let folder = folder_with(&planned("operator = \"A. Engineer\"\nspecimen = \"foam <3>\"\nnotes = \"door open\""));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    let plan = &manifest(&run)["plan"];
    assert_eq!((&plan["operator"], &plan["specimen"]), (&"A. Engineer".into(), &"foam <3>".into()), "{plan}");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("operator: A. Engineer") && page.contains("specimen: foam &lt;3&gt;"));
    damprig(&folder).args(["runs", "export", "out", "--format", "mat"]).assert().success();
}

#[test]
fn an_experiment_that_is_repeated_has_results_of_its_own_each_time() {
    let text = short().replace("name = \"sweep\"", "name = \"sweep\"\nrepeats = 3\nset_ups = [\"bare\"]");
    let folder = folder_with(&text);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let rows = &read_parquet(folder.path().join("out/results.parquet"))[0];
    let names = texts(rows, "experiment").unwrap();
    let expected: Vec<String> = (1..=3).flat_map(|n| vec![format!("sweep {n} of 3"); 3]).collect();
    assert_eq!(names, expected);
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("<h3>Repeats</h3>"));
    // The noise goes on from point to point, so that repeats differ, by far less than their values.
    let ratios = numbers(rows, "x_over_z").unwrap();
    for n in 0..3 {
        let (first, second) = (ratios[n], ratios[n + 3]);
        assert!(first != second && (first / second - 1.0).abs() < 1e-3, "{first} {second}");
    }
}

#[test]
fn a_random_order_mounts_and_measures_everything_once_and_repeats_itself() {
    let text = planned("order = \"random\"\norder_seed = 4");
    let (first, second) = (read(&text), read(&text));
    assert_eq!(first.run_order, second.run_order);
    let frequencies = |campaign: &Campaign| campaign.experiments[0].frequencies_hz().to_vec();
    assert_eq!(frequencies(&first), frequencies(&second));
    let written = frequencies(&read(&short()));
    let orders: Vec<Vec<f64>> =
        (0..20).map(|seed| frequencies(&read(&planned(&format!("order = \"random\"\norder_seed = {seed}"))))).collect();
    for order in &orders {
        let mut sorted = order.clone();
        sorted.sort_by(f64::total_cmp);
        assert_eq!(sorted, written);
    }
    assert!(orders.iter().any(|order| *order != written));
    // A sweep that carries its motion over keeps its order.
    let carried = text.replace("from_rest", "carry_over");
    assert_eq!(frequencies(&read(&carried)), written);
}

#[test]
fn a_run_in_random_order_that_was_interrupted_has_the_points_of_an_undisturbed_one() {
    let text = planned("order = \"random\"\norder_seed = 2");
    let whole = folder_with(&text);
    damprig(&whole).args(["run", "test.toml", "--out", "out"]).assert().success();
    let (folder, _) = crate::common::cut_off(&text);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let points = |folder: &tempfile::TempDir| {
        let rows = &read_parquet(folder.path().join("out/results.parquet"))[0];
        let columns = (
            texts(rows, "set_up").unwrap(),
            numbers(rows, "frequency_hz").unwrap(),
            numbers(rows, "point_index").unwrap(),
        );
        columns.0.into_iter().zip(columns.1).zip(columns.2).collect::<Vec<_>>()
    };
    assert_eq!(points(&folder), points(&whole));
    assert_eq!(points(&whole).len(), 6);
}

#[test]
fn the_dry_run_says_what_is_to_be_done_in_which_order() {
    let text = planned("order = \"random\"")
        .replace("name = \"hybrid\"", "name = \"hybrid\"\ninstruction = \"Turn the block to the marked side\"")
        .replace("name = \"sweep\"", "name = \"sweep\"\ninstruction = \"Put the particle at the wall\"");
    let folder = folder_with(&text);
    damprig(&folder)
        .args(["run", "test.toml", "--dry-run"])
        .assert()
        .success()
        .stdout(contains("Order of work:"))
        .stdout(contains("Turn the block to the marked side."))
        .stdout(contains("Experiment \"sweep\": Put the particle at the wall."));
}

#[test]
fn points_across_the_half_power_bandwidth_are_added_to_a_grid() {
    let grid = "frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.5, resonance_points = 5 }";
    let text = |grid: &str| {
        let list = short();
        let line = list.lines().find(|line| line.starts_with("frequencies_hz")).unwrap().to_string();
        list.replace(&line, grid)
    };
    let campaign = read(&text(grid));
    let frequencies = campaign.experiments[0].frequencies_hz();
    // fn = 2.5 Hz, ζ = 0.0038: 2.4905 to 2.5095 Hz, its middle one is in the grid already.
    assert_eq!(frequencies, [2.0, 2.4905, 2.49525, 2.5, 2.50475, 2.5095, 3.0]);
    let down = read(&text(
        &grid.replace("from_hz = 2.0, to_hz = 3.0, step_hz = 0.5", "from_hz = 3.0, to_hz = 2.0, step_hz = -0.5"),
    ));
    assert!(down.experiments[0].frequencies_hz().iter().rev().eq(frequencies));
}

#[test]
fn a_particle_that_starts_anywhere_is_predicted_for_several_starts() {
    let release =
        "[[experiment]]\nname = \"release\"\nrepeats = 2\nkind = \"free_vibration\"\nstart_m = 0.03\nmeasure_s = 2\n";
    let text = |start: &str| {
        let short =
            short().replace("coefficient = 0.47 } }", &format!("coefficient = 0.47 }}, start = \"{start}\" }}"));
        format!(
            "{}{release}[telemetry]{}",
            short.split("[[experiment]]").next().unwrap(),
            short.split("[telemetry]").nth(1).unwrap()
        )
    };
    let folder = folder_with(&text("unknown"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    let rows = &read_parquet(run.join("transients.parquet"))[0];
    let rms = numbers(rows, "rms_x_m").unwrap();
    // In order: the bare structure twice, the hybrid twice. The particle's start differs from repeat to repeat.
    assert!((rms[0] / rms[1] - 1.0).abs() < 1e-4, "{rms:?}");
    assert!((rms[2] / rms[3] - 1.0).abs() > 1e-3, "{rms:?}");
    assert!(std::fs::read_to_string(run.join("report.html")).unwrap().contains("unknown"));
    // The largest |x| over the starts is at least that of a start at the centre.
    let peak = |start: &str| {
        let campaign = read(&text(start));
        damprig::prediction::transient::predict(&campaign)
            .unwrap()
            .iter()
            .flat_map(|e| e.outlook.wall_force_n)
            .fold(0.0, f64::max)
    };
    assert!(peak("unknown") >= peak("centre") && peak("unknown") >= peak("at_positive_wall"));
}

#[test]
fn what_a_plan_cannot_be_is_refused_by_name() {
    for (text, said) in [
        (planned("order = \"randomly\""), "plan.order"),
        (planned("order_seed = 3"), "order_seed"),
        (planned("operater = \"A\""), "operater"),
        (short().replace("name = \"sweep\"", "name = \"sweep\"\nrepeats = 0"), "repeats"),
        (short().replace("name = \"sweep\"", "name = \"sweep\"\nrepeats = 1.5"), "repeats"),
        (
            short()
                + "\n[[experiment]]\nname = \"sweep 1 of 2\"\nkind = \"free_vibration\"\nstart_m = 0.01\nmeasure_s = 1\n\n[[experiment]]\nname = \"sweep\"\nrepeats = 2\nkind = \"free_vibration\"\nstart_m = 0.01\nmeasure_s = 1\n",
            "name",
        ),
    ] {
        let folder = folder_with(&text);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
}
