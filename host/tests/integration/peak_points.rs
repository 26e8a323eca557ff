//! Points around the measured peak of a grid (`peak_points`): where they are, that they are measured as listed points are, and that an
//! interrupted run measures the same.

use std::path::Path;

use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::prediction::CampaignPrediction;
use damprig::run_folder::journal;
use damprig::run_folder::schema::journal_entry::JournalEntry;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::table::values::{numbers, texts};
use damprig_protocol::{Event, FromDevice};
use predicates::prelude::*;
use predicates::str::contains;

use crate::common::{
    Fate, Served, cut_off_at, damprig, folder_with, manifest, older_run, read_parquet, short, with_sums,
};
use crate::resume::measured;

const GRID: &str = "{ from_hz = 2.4, to_hz = 2.6, step_hz = 0.05, peak_points = 4 }";

/// The points of the grid, and those around its peak, on each of the two set-ups.
const POINTS: [usize; 2] = [5, 4];

/// The short campaign with these frequencies.
fn with(frequencies: &str) -> String {
    short().replace("[2.4, 2.5, 2.6]", frequencies)
}

fn read(text: &str) -> Campaign {
    Campaign::parse(Source::new("test.toml", text.to_string())).unwrap()
}

fn state(run: &Path) -> JournalState {
    JournalState::of(&journal::read(run).unwrap().entries)
}

/// Frequency, X/Z and place in the list of the results of a set-up, in the order of the file.
fn results(run: &Path, set_up: &str) -> Vec<(f64, f64, usize)> {
    let rows = &read_parquet(run.join("results.parquet"))[0];
    let columns = ["frequency_hz", "x_over_z", "point_index"].map(|name| numbers(rows, name).unwrap());
    let own = texts(rows, "set_up").unwrap().into_iter().enumerate().filter(|(_, name)| name == set_up);
    own.map(|(row, _)| (columns[0][row], columns[1][row], columns[2][row] as usize)).collect()
}

fn frequencies(points: &[(f64, f64, usize)]) -> Vec<f64> {
    points.iter().map(|point| point.0).collect()
}

#[test]
fn points_between_the_neighbours_of_the_highest_one_are_part_of_each_curve() {
    let folder = folder_with(&with(GRID));
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let said = "set-up \"bare\", experiment \"sweep\": 4 further points from 2.45 to 2.55 Hz, around the highest X/Z (cycle maxima), at 2.5 Hz";
    answer.stdout(contains(said).and(contains("18 of 18 points")));
    let run = folder.path().join("out");
    for set_up in ["bare", "hybrid"] {
        let points = results(&run, set_up);
        assert_eq!(points.len(), POINTS[0] + POINTS[1]);
        assert!(points.is_sorted_by(|a, b| a.0 < b.0), "{points:?}");
        let (grid, around): (Vec<_>, Vec<_>) = points.iter().partition(|point| point.2 < POINTS[0]);
        assert_eq!(frequencies(&grid), [2.4, 2.45, 2.5, 2.55, 2.6]);
        let highest = (0..POINTS[0]).max_by(|a, b| grid[*a].1.total_cmp(&grid[*b].1)).unwrap();
        let (low, high) = (grid[highest.saturating_sub(1)].0, grid[(highest + 1).min(POINTS[0] - 1)].0);
        assert!(around.iter().all(|point| low < point.0 && point.0 < high), "{around:?}");
    }
    let manifest = manifest(&run);
    assert_eq!([&manifest["points_planned"], &manifest["points_taken"]], [18, 18]);
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("; 4 around the peak") && page.contains("4 further points from 2.45 to 2.55 Hz"));
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(contains("The run is complete: all 18 points are measured."));
    // One curve in the export, too: a record of dataset 58 for each set-up.
    let export = ["runs", "export", "out", "--format", "uff", "--what", "results", "--out", "run.uff"];
    damprig(&folder).args(export).assert().success();
    let text = std::fs::read_to_string(folder.path().join("run.uff")).unwrap();
    assert_eq!(text.lines().filter(|line| line.trim() == "58").count(), 2);
    // The comparison has the points by frequency.
    let output = damprig(&folder).args(["compare", "out", "--json"]).output().unwrap();
    let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for experiment in comparison["experiments"].as_array().unwrap() {
        let points = experiment["points"].as_array().unwrap();
        let frequencies: Vec<f64> = points.iter().map(|point| point["frequency_hz"].as_f64().unwrap()).collect();
        assert_eq!(frequencies.len(), 9);
        assert!(frequencies.is_sorted(), "{frequencies:?}");
    }
}

#[test]
fn a_peak_between_wide_steps_is_marked_wherever_it_is_shown() {
    let folder = folder_with(&with("[2.3, 2.4, 2.5, 2.6]"));
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let note =
        "Set-up \"bare\", experiment \"sweep\": the peak is not resolved: beside the highest X/Z (cycle maxima), ";
    answer.stdout(contains(note));
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(contains(note));
    let file = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let page = file("report.html");
    assert!(page.contains("the peak is not resolved: beside") && page.contains(">not resolved</td>"));
    let words = "peak not resolved or at a jump";
    assert!(file("figure.svg").contains(words));
    // With steps of a seventh of the half-power bandwidth there is nothing to mark.
    let strong = with("[2.44, 2.46, 2.48, 2.5, 2.52]").replace("0.0038", "0.05");
    std::fs::write(
        folder.path().join("test.toml"),
        strong.replace("experiment]]", "experiment]]\nset_ups = [\"bare\"]"),
    )
    .unwrap();
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "strong"]).assert().success();
    answer.stdout(contains("not resolved").not().and(contains("resolved")));
    assert!(!std::fs::read_to_string(folder.path().join("strong/figure.svg")).unwrap().contains(words));
}

#[test]
fn a_point_around_a_peak_is_measured_as_a_listed_one() {
    let folder = folder_with(&with(GRID));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    for set_up in ["bare", "hybrid"] {
        let mut as_run = results(&run, set_up);
        as_run.sort_by_key(|point| point.2);
        let list = format!("{:?}", frequencies(&as_run));
        let name = format!("{set_up}.toml");
        let listed = with(&list).replace("start = ", &format!("set_ups = [\"{set_up}\"]\nstart = "));
        std::fs::write(folder.path().join(&name), listed).unwrap();
        damprig(&folder).args(["run", &name, "--out", set_up]).assert().success();
        assert_eq!(as_run, results(&folder.path().join(set_up), set_up));
    }
}

/// A run that is interrupted in a grid, between a grid and the points around its peak, or among these.
#[test]
fn a_resumed_run_measures_the_same_points_around_the_peak() {
    // The fifth point is the last of a grid, the sixth to the ninth are around its peak.
    let random = "[plan]\norder = \"random\"\n\n[structure]";
    let cases: [(&str, &str, &[usize]); 3] = [
        ("from_rest", "[structure]", &[3, 6, 8, 17]),
        ("from_rest", random, &[8]),
        ("carry_over", "[structure]", &[6, 8, 14]),
    ];
    for (start, plan, points) in cases {
        let campaign = with(GRID).replace("from_rest", start).replace("[structure]", plan);
        let whole = folder_with(&campaign);
        damprig(&whole).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
        let expected = measured(&whole.path().join("out"));
        for point in points {
            let (folder, _) = cut_off_at(&campaign, *point);
            let run = folder.path().join("out");
            let before = state(&run).peaks;
            assert_eq!(before.len(), (point + 3) / 9, "the points around a peak are noted before the first of them");
            damprig(&folder).args(["run", "--resume", "out"]).assert().success().stdout(contains("18 of 18 points"));
            assert_eq!(measured(&run), expected, "{start}, {plan}, cut off at point {point}");
            assert!(state(&run).peaks.starts_with(&before));
            damprig(&folder).args(["runs", "verify", "out"]).assert().success();
        }
    }
}

#[test]
fn what_a_resumed_run_does_around_a_peak_is_said() {
    let (folder, _) = cut_off_at(&with(GRID), 8);
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer
        .stdout(contains("7 of 18 points are kept").and(contains("\"sweep\" continues at 2.516666667 Hz, from rest")));
    let (folder, _) = cut_off_at(&with(GRID).replace("from_rest", "carry_over"), 8);
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(contains("the sweep around its peak starts from its beginning"));
    let state = state(&folder.path().join("out"));
    let superseded: Vec<u32> = state.superseded().iter().map(|row| row.point_index).collect();
    assert_eq!(superseded, [5, 6], "the grid is kept");
    assert_eq!(manifest(&folder.path().join("out"))["points_taken"], 18);
}

#[test]
fn a_sweep_around_a_peak_keeps_the_direction_and_begins_from_rest() {
    // The noise of the sensors depends on a point's place in its list.
    let text = |frequencies: &str| {
        with(frequencies)
            .replace("from_rest", "carry_over")
            .replace("sensor_noise_rms_m = 5e-6", "sensor_noise_rms_m = 0")
    };
    let folder = folder_with(&text("{ from_hz = 2.6, to_hz = 2.4, step_hz = -0.05, peak_points = 4 }"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    for set_up in ["bare", "hybrid"] {
        let points = results(&run, set_up);
        assert!(points.is_sorted_by(|a, b| a.0 > b.0), "{points:?}");
        let mut around: Vec<_> = points.iter().filter(|point| point.2 >= POINTS[0]).copied().collect();
        around.sort_by_key(|point| point.2);
        assert!(around.is_sorted_by(|a, b| a.0 > b.0), "{around:?}");
        // A sweep of its own over these frequencies gives the same.
        std::fs::write(folder.path().join("own.toml"), text(&format!("{:?}", frequencies(&around)))).unwrap();
        damprig(&folder).args(["run", "own.toml", "--out", set_up]).assert().success();
        let own = results(&folder.path().join(set_up), set_up);
        let values = |points: &[(f64, f64, usize)]| points.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>();
        assert_eq!(values(&around), values(&own));
    }
    let export = ["runs", "export", "out", "--format", "uff", "--what", "results", "--out", "run.uff"];
    damprig(&folder).args(export).assert().success();
    let text = std::fs::read_to_string(folder.path().join("run.uff")).unwrap();
    assert_eq!(text.lines().filter(|line| line.trim() == "58").count(), 2);
}

#[test]
fn a_peak_at_an_end_of_the_grid_is_refined_inside_and_said() {
    let folder = folder_with(&with("{ from_hz = 2.2, to_hz = 2.4, step_hz = 0.1, peak_points = 3 }"));
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let said = "3 further points from 2.3 to 2.4 Hz, on the inner side of the highest X/Z (cycle maxima), at 2.4 Hz: that is the end of the grid";
    answer.stderr(contains(said));
    let run = folder.path().join("out");
    assert_eq!(frequencies(&results(&run, "bare")), [2.2, 2.3, 2.325, 2.35, 2.375, 2.4]);
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    let warnings = page.split("<h2>Warnings</h2>").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(warnings.contains("the peak may lie outside"), "{warnings}");
    let unresolved = "the peak is not resolved: ";
    assert!(warnings.contains(unresolved), "{warnings}");
    assert_eq!(page.matches(unresolved).count(), warnings.matches(unresolved).count(), "it is said once");
}

#[test]
fn a_grid_without_a_valid_point_has_no_points_around_a_peak_and_the_run_is_complete_without_them() {
    let folder = folder_with(&with(GRID));
    let mut points = 0;
    // The base of the first set-up does not move, as its sensor has it.
    let rig = Served::again_and_again(move |message| {
        let mut changed = message.clone();
        match &mut changed {
            FromDevice::Event { event: Event::Point(result), .. } if points < POINTS[0] => {
                points += 1;
                result.z_amplitude_m = 0.0;
                Fate::Replace(Box::new(changed))
            }
            _ => Fate::Pass,
        }
    });
    let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().success();
    let said = "note: set-up \"bare\", experiment \"sweep\": no point has a valid X/Z";
    answer.stderr(contains(said)).stdout(contains("14 of 14 points"));
    let run = folder.path().join("out");
    assert_eq!(results(&run, "bare").len(), POINTS[0]);
    assert_eq!(results(&run, "hybrid").len(), POINTS[0] + POINTS[1]);
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(contains("The run is complete: all 14 points are measured."));
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn the_dry_run_foresees_points_time_and_place() {
    let folder = folder_with(&with(GRID));
    let answer = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    let place = "Set-up \"bare\", experiment \"sweep\": 4 further points around the measured peak; predicted from 2.45 to 2.55 Hz (highest point of the grid at 2.5 Hz)";
    // 18 points of 0.7 s of rest, 1 s of settling and a dwell of 4 s.
    answer.stdout(contains("18 points, about 103 s of rig time").and(contains(place)));
    let campaign = read(&with(GRID));
    assert_eq!(campaign.points(), 18);
    let predicted = CampaignPrediction::of(&campaign).unwrap();
    let listed = read(&with("[2.4, 2.45, 2.5, 2.55, 2.6, 2.466666667, 2.483333333, 2.516666667, 2.533333333]"));
    let same = CampaignPrediction::of(&listed).unwrap();
    assert_eq!(
        predicted.responses[0].points, same.responses[0].points,
        "those around the predicted peak are predicted too"
    );
    assert_eq!(predicted.responses[0].dwell_max_x_m, same.responses[0].dwell_max_x_m);
    assert_eq!(predicted.swings[0].swing, same.swings[0].swing);
}

#[test]
fn each_repeat_in_random_order_has_points_around_its_own_peak() {
    let plan = "[plan]\norder = \"random\"\norder_seed = 2\n\n[structure]";
    let text = with(GRID).replace("name = \"sweep\"", "name = \"sweep\"\nrepeats = 2").replace("[structure]", plan);
    let folder = folder_with(&text);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success().stdout(contains("36 of 36 points"));
    let run = folder.path().join("out");
    let state = state(&run);
    assert_eq!(state.peaks.len(), 4);
    for (peak, repeat) in [("sweep 1 of 2", 1), ("sweep 2 of 2", 2)].map(|(n, r)| (state.peak("bare", n).unwrap(), r)) {
        let mut rising = peak.around.frequencies_hz.clone();
        rising.sort_by(f64::total_cmp);
        assert_eq!(rising, [2.466666667, 2.483333333, 2.516666667, 2.533333333], "repeat {repeat}");
    }
    let orders: Vec<_> = state.peaks.iter().map(|peak| &peak.around.frequencies_hz).collect();
    assert!(orders.iter().any(|order| !order.is_sorted()), "{orders:?}");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(
        page.split("<h3>Repeats</h3>").nth(1).unwrap().contains("2.4667"),
        "points that both repeats have are compared"
    );
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn peak_points_that_cannot_be_are_refused_by_name() {
    let list = with("[2.4, 2.5, 2.6]\npeak_points = 4");
    for (text, said) in [
        (list, "`experiment[1].peak_points` = 4 is not allowed"),
        (with(&GRID.replace("= 4", "= 1")), "frequencies_hz.peak_points` = 1"),
        (with(&GRID.replace("= 4", "= 2.5")), "a whole number from 2 to 40"),
        (with(&GRID.replace("= 4", "= 41")), "a whole number from 2 to 40"),
        (with(&GRID.replace("to_hz = 2.6", "to_hz = 2.4")), "needs a grid of at least two frequencies"),
        (with(&GRID.replace("peak_points", "peak_point")), "peak_points"),
    ] {
        let folder = folder_with(&text);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
    let folder = folder_with(&with("[2.4, 2.5, 2.6]\npeak_points = 4"));
    let answer = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
    answer.stderr(contains("belongs in the grid of frequencies_hz").and(contains("unknown key").not()));
}

#[test]
fn a_journal_with_points_that_a_grid_cannot_have_is_refused() {
    let (folder, _) = cut_off_at(&with(GRID), 8);
    let path = folder.path().join("out").join(journal::JOURNAL);
    let text = std::fs::read_to_string(&path).unwrap();
    let changed = text.replacen("\"frequencies_hz\":[2.466666667", "\"frequencies_hz\":[3.5", 1);
    assert_ne!(changed, text);
    std::fs::write(&path, with_sums(&changed)).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
    answer.stderr(contains("set-up \"bare\", experiment \"sweep\", points around its peak"));
    damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains("points around its peak"));
}

/// When the line of the points is lost, they follow from the results of the grid again.
#[test]
fn a_lost_line_of_points_around_a_peak_is_made_again() {
    let (folder, _) = cut_off_at(&with(GRID), 8);
    let run = folder.path().join("out");
    let noted = state(&run).peaks[0].around.clone();
    let path = run.join(journal::JOURNAL);
    let text = std::fs::read_to_string(&path).unwrap();
    let kept: Vec<&str> = text
        .lines()
        .filter(|line| !matches!(serde_json::from_str::<JournalEntry>(line), Ok(JournalEntry::PeakPoints(_))))
        .collect();
    std::fs::write(&path, kept.join("\n") + "\n").unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().success().stdout(contains("18 of 18 points"));
    assert_eq!(state(&run).peaks[0].around, noted);
}

/// A tuned mass damper whose two maxima are at 2.20 and 2.72 Hz. The lower one is 6 % higher; on the grid, of steps of 0.1 Hz from 2.05 Hz,
/// it is 2 % lower.
fn two_maxima() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/older_runs/killed_at_peak/campaign.toml");
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn where_a_second_maximum_may_be_higher_the_points_are_shared_and_its_peak_is_found() {
    let folder = folder_with(&two_maxima());
    let foreseen = "predicted from 2.65 to 2.85 Hz (highest point of the grid at 2.75 Hz) and from 2.05 to 2.25 Hz (second maximum at 2.15 Hz)";
    damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success().stdout(contains(foreseen));
    let said = "16 further points from 2.65 to 2.85 Hz, around the highest X/Z (cycle maxima), at 2.75 Hz, and from 2.05 to 2.25 Hz, around a second maximum at 2.15 Hz";
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    answer.stdout(
        contains(said).and(contains("27 of 27 points")).and(contains("resolved")).and(contains("not resolved").not()),
    );
    let run = folder.path().join("out");
    let points = results(&run, "tmd");
    assert!(points.is_sorted_by(|a, b| a.0 < b.0), "{points:?}");
    let highest = points.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    // From 2.19 to 2.21 Hz X/Z changes by 1 %: a step of 0.005 Hz is within 0.1 % of its maximum.
    let (head, tail) = two_maxima().split_once("frequencies_hz").map(|(a, b)| (a.to_string(), b.to_string())).unwrap();
    let (_, tail) = tail.split_once('\n').unwrap();
    let dense = format!("{head}frequencies_hz = {{ from_hz = 2.18, to_hz = 2.22, step_hz = 0.005 }}\n{tail}");
    std::fs::write(folder.path().join("dense.toml"), dense).unwrap();
    damprig(&folder).args(["run", "dense.toml", "--out", "dense"]).assert().success();
    let truth = results(&folder.path().join("dense"), "tmd").iter().map(|point| point.1).fold(0.0, f64::max);
    assert!((highest.1 / truth - 1.0).abs() < 0.01 && (highest.0 - 2.2).abs() < 0.02, "{highest:?}, {truth}");
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn a_run_that_is_resumed_between_two_maxima_measures_the_same_points() {
    // The eleven of the grid, then eight around each maximum.
    let whole = folder_with(&two_maxima());
    damprig(&whole).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
    let (folder, _) = cut_off_at(&two_maxima(), 20);
    let run = folder.path().join("out");
    let before = state(&run).peaks;
    assert_eq!(before[0].around.second.unwrap().frequency_hz, 2.15);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success().stdout(contains("27 of 27 points"));
    assert_eq!(measured(&run), measured(&whole.path().join("out")));
    assert_eq!(state(&run).peaks, before);
}

/// An earlier version, which measured all points around the highest one, was killed after two of them.
#[test]
fn an_older_run_goes_on_with_the_points_that_it_noted() {
    let folder = folder_with(&two_maxima());
    let run = older_run(&folder, "killed_at_peak");
    let before = state(&run).peaks;
    damprig(&folder).args(["runs", "verify", "killed_at_peak"]).assert().code(1).stdout(contains("damaged").not());
    // The device is described by the version that measures.
    damprig(&folder).args(["run", "test.toml", "--out", "now"]).assert().success();
    let path = run.join(journal::JOURNAL);
    let lines = std::fs::read_to_string(&path).unwrap();
    let (begin, rest) = lines.split_once('\n').unwrap();
    let mut begin: serde_json::Value = serde_json::from_str(begin).unwrap();
    begin["device"] = serde_json::to_value(&state(&folder.path().join("now")).begun[0].device).unwrap();
    std::fs::write(&path, with_sums(&format!("{begin}\n{rest}"))).unwrap();
    damprig(&folder).args(["run", "--resume", "killed_at_peak"]).assert().success().stdout(contains("27 of 27 points"));
    assert_eq!(state(&run).peaks, before);
    let points = results(&run, "tmd");
    let around: Vec<f64> = points.iter().filter(|point| point.2 >= 11).map(|point| point.0).collect();
    assert!(around.len() == 16 && around.iter().all(|f| 2.65 < *f && *f < 2.85), "{around:?}");
    damprig(&folder).args(["runs", "verify", "killed_at_peak"]).assert().success();
}
