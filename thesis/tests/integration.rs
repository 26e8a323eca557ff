//! `damprig-thesis`: items from their files to the page, with gaps, other readings, resumption and refusals.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use damprig::study::Study;
use damprig::study::data_set::DataSet;
use damprig::study::store::Store;
use damprig::study::table::StudyTable;
use serde_json::Value;
use tempfile::TempDir;

const ITEMS: &str = r#"
[[item]]
name = "table-9-1"
title = "Peaks of a small grid"
kind = "computed"
reading = "eight seconds from rest"

[[item.part]]
name = "main"
title = "As read"
study = "studies/main.toml"

[[item.part]]
name = "stiff"
title = "With a larger restitution"
other_reading = true
study = "studies/stiff.toml"

[[item]]
name = "fig-9-2"
title = "Two motions"
kind = "computed"
reading = "from rest"

[[item.part]]
name = "histories"
title = "Motions over each other"
cases = ["cases/case.toml", "cases/bare.toml"]

[[item.part]]
name = "sampled"
title = "Sampled cycles"
bifurcation = { case = "cases/case.toml", axis = "particle.wall.coefficient=0.3:0.5:3", settle_cycles = 5, cycles = 4, section = 0.4 }

[[item]]
name = "fig-9-3"
title = "A photograph"
kind = "measured_only"
reason = "a photograph"
"#;

const PUBLISHED: &str = r#"
[[value]]
item = "table-9-1"
label = "Numerical, d/Z = 9"
origin = "computed"
source = "Table 9-1"
value = 20
quantity = "x_over_z"
at = { "particle.clearance_ratio" = 9 }

[[value]]
item = "table-9-1"
label = "Experimental, d/Z = 9"
origin = "measured"
source = "Table 9-1"
quantity = "x_over_z"
at = { "particle.clearance_ratio" = 9 }

[[value]]
item = "fig-9-2"
label = "Spring"
origin = "computed"
source = "section 9.2"
value = 394.8
quantity = "case.set_up.structure.stiffness_n_per_m"
at = { case = "bare" }
part = "histories"

[[value]]
item = "fig-9-3"
label = "Height"
origin = "measured"
source = "section 9.3"
value = 1.5

[[curve]]
item = "table-9-1"
label = "Peak over d/Z"
origin = "computed"
source = "figure 9-1"
part = "main"
quantity = "x_over_z"
over = "particle.clearance_ratio"
"#;

const BARE: &str = "\
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }
run = { duration_s = 8 }
";

const PARTICLE: &str =
    "particle = { mass_ratio = 0.1, clearance_ratio = 9, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";

const STUDY: &str = "\
case = \"../cases/case.toml\"
metrics = [\"x_over_z\"]
points_per_part = 1
[[axis]]
key = \"particle.clearance_ratio\"
values = [9, 10, 12]
[[axis]]
key = \"base.frequency_hz\"
values = [2.4, 2.5]
reduce = \"maximum\"
";

/// A folder `files` with a catalogue of three items.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let files = folder.path().join("files");
    for inner in ["studies", "cases"] {
        std::fs::create_dir_all(files.join(inner)).unwrap();
    }
    let write = |name: &str, text: &str| std::fs::write(files.join(name), text).unwrap();
    write("items.toml", ITEMS);
    write("published.toml", PUBLISHED);
    write("cases/bare.toml", BARE);
    write("cases/case.toml", &format!("{BARE}{PARTICLE}"));
    write("studies/main.toml", STUDY);
    write("studies/stiff.toml", &format!("{STUDY}[[axis]]\nkey = \"particle.wall.coefficient\"\nvalues = [0.8]\n"));
    folder
}

/// The command, started in its own folder.
fn command(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("damprig-thesis").unwrap();
    command.current_dir(folder.path());
    command
}

fn thesis(folder: &TempDir, arguments: &[&str]) -> Output {
    command(folder).args(["--files", "files", "--out", "out"]).args(arguments).output().unwrap()
}

fn done(folder: &TempDir, arguments: &[&str]) -> String {
    let output = thesis(folder, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(folder: &TempDir, arguments: &[&str]) -> String {
    let output = thesis(folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{told}");
    told
}

fn text(folder: &TempDir, name: &str) -> String {
    std::fs::read_to_string(folder.path().join("out").join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn the_shipped_items_are_listed_with_kind_and_reason_and_nothing_is_written() {
    let folder = TempDir::new().unwrap();
    let output = command(&folder).arg("--list").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let list = String::from_utf8(output.stdout).unwrap();
    assert!(list.contains("table-3-4") && list.contains("computed"), "{list}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn an_unknown_item_is_answered_with_near_names() {
    let told = refused(&folder(), &["table-9-11"]);
    assert!(told.contains("no item \"table-9-11\"") && told.contains("table-9-1"), "{told}");
}

#[test]
fn an_item_goes_from_its_files_to_json_and_page_with_its_other_reading() {
    let folder = folder();
    let json: Value = serde_json::from_str(&done(&folder, &["table-9-1", "--json"])).unwrap();
    let item = &json["items"][0];
    assert_eq!((&item["name"], &item["reading"]), (&"table-9-1".into(), &"eight seconds from rest".into()));
    let value = &item["values"][0];
    let computed = value["computed"]["value"].as_f64().unwrap();
    // The study itself has the same number.
    let study = Study::read(&folder.path().join("files/studies/main.toml")).unwrap();
    let data_set = DataSet::open(&study, Store::at(&folder.path().join("alone")).unwrap()).unwrap();
    damprig::study::run::run(&study, &data_set, &|_| true).unwrap();
    let alone = read_table(&data_set.join(&study, |_, _| ()).unwrap());
    assert_eq!(alone.column("x_over_z").unwrap()[0].to_bits(), computed.to_bits());
    let stiff = value["other_readings"]["stiff"]["value"].as_f64().unwrap();
    assert!(stiff.is_finite() && stiff != computed);
    let page = text(&folder, "thesis.html");
    for words in ["Table 9-1", "eight seconds from rest", "With a larger restitution", "<svg", "Not computed yet"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());
    assert!(text(&folder, "thesis.md").contains("| Numerical, d/Z = 9 | Table 9-1 | computed | 20 |"));
}

#[test]
fn cases_and_bifurcations_have_their_figures_and_numbers() {
    let folder = folder();
    done(&folder, &["fig-9-2"]);
    for file in
        ["histories/histories.svg", "histories/cycle-maxima.png", "histories/case.parquet", "sampled/section.svg"]
    {
        assert!(folder.path().join("out/fig-9-2").join(file).is_file(), "{file}");
    }
    // k = M (2π f)²
    let stiffness = 1.6 * (2.0 * std::f64::consts::PI * 2.5_f64).powi(2);
    let results = damprig_thesis::Results::at(folder.path().join("out"));
    let json = results.case_json("fig-9-2", "histories", "bare").unwrap();
    let there = json["case"]["set_up"]["structure"]["stiffness_n_per_m"].as_f64().unwrap();
    assert!((there / stiffness - 1.0).abs() < 1e-12);
    let case = results.case("fig-9-2", "histories", "bare").unwrap();
    assert_eq!(case.cycle_max_m.len(), 20);
    assert!(case.cycle_max_m.iter().all(|max_m| *max_m <= case.summary.max_abs_x_m * (1.0 + 1e-12)));
    assert_eq!(results.bifurcation("fig-9-2", "sampled").unwrap().rows(), 2 * 3 * 4);
}

#[test]
fn a_gap_is_a_dash_until_a_users_file_fills_it() {
    let folder = folder();
    done(&folder, &["table-9-1", "--quick"]);
    assert!(!folder.path().join("out/table-9-1/stiff").exists(), "--quick leaves the other reading out");
    assert!(text(&folder, "thesis.md").contains("| Experimental, d/Z = 9 | Table 9-1 | measured | — |"));
    let own = "[[value]]\nitem = \"table-9-1\"\nlabel = \"Experimental, d/Z = 9\"\nvalue = 21.5\n";
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    done(&folder, &["table-9-1", "--quick", "--published", "own.toml"]);
    assert!(text(&folder, "thesis.md").contains("| Experimental, d/Z = 9 | Table 9-1 | measured | 21.5 |"));
    let csv = text(&folder, "published.csv");
    let row = csv.lines().find(|line| line.contains("Experimental")).unwrap();
    assert!(row.contains(",21.5,true,"), "{row}");
    let height = csv.lines().find(|line| line.contains("Height")).unwrap();
    assert!(height.contains(",1.5,false,") && height.contains("not computed"), "{height}");
}

/// Points at d/Z = 9, 10 and 12, and one between two of them.
#[test]
fn a_users_points_of_a_curve_are_drawn_over_it_and_compared_with_it() {
    let folder = folder();
    done(&folder, &["table-9-1", "--quick"]);
    assert!(text(&folder, "thesis.md").contains("| Peak over d/Z | figure 9-1 | computed | — | — |"));
    let plain = text(&folder, "table-9-1/main/x_over_z.svg");
    let own = "[[curve]]\nitem = \"table-9-1\"\nlabel = \"Peak over d/Z\"\nabscissae = [12, 9, 11, 13]\nvalues = [8, 20, 9, 1]\n";
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    done(&folder, &["table-9-1", "--quick", "--published", "own.toml"]);
    let csv = text(&folder, "published_curves.csv");
    let points: Vec<(f64, f64, Option<f64>)> = csv
        .lines()
        .skip(1)
        .map(|line| line.rsplitn(4, ',').collect::<Vec<&str>>())
        .map(|cells| (cells[2].parse().unwrap(), cells[1].parse().unwrap(), cells[0].parse().ok()))
        .collect();
    let results = damprig_thesis::Results::at(folder.path().join("out"));
    let computed = results.study("table-9-1", "main").unwrap().column("x_over_z").unwrap();
    let half = 0.5 * (computed[1] + computed[2]);
    let expected =
        [(9.0, 20.0, Some(computed[0])), (11.0, 9.0, Some(half)), (12.0, 8.0, Some(computed[2])), (13.0, 1.0, None)];
    assert_eq!(points, expected);
    let drawn = text(&folder, "table-9-1/main/published.svg");
    assert!(drawn.contains("published, computed") && !plain.contains("published"));
    assert!(text(&folder, "thesis.html").contains("table-9-1/main/published.svg"));
    let uneven = own.replace("[8, 20, 9, 1]", "[8, 20]");
    std::fs::write(folder.path().join("own.toml"), uneven).unwrap();
    let told = refused(&folder, &["--published", "own.toml"]);
    assert!(told.contains("own.toml:5") && told.contains("as long as"), "{told}");
    // A curve that the document prints, as an equation is one.
    let shipped = format!("{PUBLISHED}abscissae = [9, 12]\nvalues = [20, 8]\n");
    std::fs::write(folder.path().join("files/published.toml"), shipped).unwrap();
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    let told = refused(&folder, &["--published", "own.toml"]);
    assert!(told.contains("own.toml:4") && told.contains("other points"), "{told}");
}

#[test]
fn two_runs_do_not_compute_into_one_folder() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("out")).unwrap();
    let lock = std::fs::File::create(folder.path().join("out/.lock")).unwrap();
    lock.try_lock().unwrap();
    let output = thesis(&folder, &["table-9-1"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("another damprig-thesis"));
}

#[test]
fn a_published_value_for_nothing_is_refused_with_file_and_line() {
    let folder = folder();
    let told = |text: &str| {
        std::fs::write(folder.path().join("own.toml"), text).unwrap();
        refused(&folder, &["--published", "own.toml"])
    };
    let unknown = told("[[value]]\nitem = \"table-9-7\"\nlabel = \"Height\"\nvalue = 1\n");
    assert!(unknown.contains("own.toml:2") && unknown.contains("did you mean \"table-9-1\""), "{unknown}");
    let label = told("[[value]]\nitem = \"table-9-1\"\nlabel = \"Experimental, d/Z = 8\"\nvalue = 1\n");
    assert!(label.contains("own.toml:3") && label.contains("Experimental, d/Z = 9"), "{label}");
    let printed = told("[[value]]\nitem = \"table-9-1\"\nlabel = \"Numerical, d/Z = 9\"\nvalue = 21\n");
    assert!(printed.contains("own.toml:4") && printed.contains("prints 20"), "{printed}");
    assert!(!folder.path().join("out").exists(), "nothing was computed");
}

#[test]
fn what_is_complete_is_not_computed_again_and_what_was_removed_is() {
    let folder = folder();
    done(&folder, &["table-9-1"]);
    let part = |name: &str| folder.path().join("out/table-9-1").join(name);
    let first = |name: &str| std::fs::metadata(part(name)).unwrap().modified().unwrap();
    let kept = first("stiff/part.json");
    let table = std::fs::read(part("main/table.parquet")).unwrap();
    // A part of the study is lost, and the table with it.
    std::fs::remove_file(part("main/parts/00000001.parquet")).unwrap();
    std::fs::remove_file(part("main/table.parquet")).unwrap();
    let other = first("main/parts/00000000.parquet");
    let told = done(&folder, &["table-9-1"]);
    assert!(told.contains("1 of 2 parts"), "{told}");
    assert_eq!(std::fs::read(part("main/table.parquet")).unwrap(), table);
    assert_eq!((first("stiff/part.json"), first("main/parts/00000000.parquet")), (kept, other));
    // A damaged table is written again.
    std::fs::write(part("main/table.parquet"), &table[..table.len() / 2]).unwrap();
    assert!(done(&folder, &["table-9-1"]).contains("1 of 2 parts"));
    assert_eq!(std::fs::read(part("main/table.parquet")).unwrap(), table);
    // A changed file is another part.
    let study = folder.path().join("files/studies/main.toml");
    let changed = std::fs::read_to_string(&study).unwrap().replace("[9, 10, 12]", "[9, 11]");
    std::fs::write(&study, changed).unwrap();
    assert!(done(&folder, &["table-9-1"]).contains("1 of 2 parts"));
    assert_eq!(read_table(&part("main/table.parquet")).rows(), 2);
}

fn read_table(path: &Path) -> StudyTable {
    StudyTable::read("table", std::fs::read(path).unwrap().into()).unwrap()
}

#[test]
fn a_wrong_catalogue_is_refused_with_file_and_line() {
    let folder = folder();
    let items = folder.path().join("files/items.toml");
    std::fs::write(&items, ITEMS.replace("studies/main.toml", "studies/mian.toml")).unwrap();
    let told = refused(&folder, &[]);
    assert!(told.contains("items.toml:11") && told.contains("no such file"), "{told}");
}

#[test]
fn own_files_in_the_folder_of_the_results_are_kept() {
    let folder = TempDir::new().unwrap();
    let own = folder.path().join("out/files/studies");
    std::fs::create_dir_all(&own).unwrap();
    std::fs::write(own.join("table-3-4.toml"), "mine").unwrap();
    let output = command(&folder).args(["table-3-4", "--out", "out"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(told.contains("table-3-4.toml") && told.contains("--files"), "{told}");
    assert_eq!(std::fs::read_to_string(own.join("table-3-4.toml")).unwrap(), "mine");
}

/// The rows of docs/EXIT_CODES.md that have a command of this program.
#[test]
fn every_command_ends_with_the_exit_code_of_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/EXIT_CODES.md");
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, _, command, code, _] = cells[..] else { return None };
        let arguments = command.strip_prefix("`damprig-thesis ")?.strip_suffix('`')?;
        Some((arguments.split(' ').map(String::from).collect(), code.parse().ok()?))
    };
    let rows: Vec<(Vec<String>, i32)> = text.lines().filter_map(row).collect();
    assert!(rows.len() >= 3, "{rows:?}");
    for (arguments, code) in rows {
        let output = command(&TempDir::new().unwrap()).args(&arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
}
