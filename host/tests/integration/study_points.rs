//! Points of a study that are no grid: drawn, or from a file.

use std::path::Path;

use crate::common::damprig;
use crate::study::{column, done, folder, run, simulated};
use arrow_array::cast::AsArray;

#[test]
fn drawn_points_lie_in_their_ranges_and_words_are_values_too() {
    let folder = folder(
        "case = \"case.toml\"\nmetrics = [\"max_abs_x_m\"]\n[sampling]\nmethod = \"sobol\"\ncount = 8\n\
         [[axis]]\nkey = \"particle.clearance_ratio\"\nfrom = 5\nto = 20\nscale = \"log\"\n\
         [[axis]]\nkey = \"particle.start\"\nwords = [\"centre\", \"at_positive_wall\"]\n",
    );
    let table = done(&folder);
    assert_eq!(table.num_rows(), 16);
    let clearance = column(&table, "particle.clearance_ratio");
    assert!(clearance.iter().all(|d| (5.0..=20.0).contains(d)) && clearance[0] == 5.0);
    assert!((clearance[2] - 10.0).abs() < 1e-12, "the second point of the sequence is the middle, of the logarithm");
    let starts = table.column_by_name("particle.start").unwrap().as_string::<i32>();
    assert_eq!([starts.value(0), starts.value(1)], ["centre", "at_positive_wall"]);
}

const FROM_OUTSIDE: &str = "case = \"case.toml\"\nmetrics = [\"max_abs_x_m\"]\npoints = \"design.csv\"\n";

#[test]
fn points_from_outside_are_rows_in_their_order_times_the_grid_of_the_axes() {
    let band = "[[axis]]\nkey = \"base.frequency_hz\"\nvalues = [2.4, 2.5]\nreduce = \"grid_maximum\"\n";
    let starts = "[[axis]]\nkey = \"particle.start\"\nwords = [\"centre\", \"at_positive_wall\"]\n";
    let folder = folder(&format!("{FROM_OUTSIDE}{band}{starts}"));
    let design = "particle.wall.coefficient,particle.clearance_ratio\n0.7,9\n0.123456789012345678,12\n0.7,9.5\n";
    std::fs::write(folder.path().join("design.csv"), design).unwrap();
    let table = done(&folder);
    assert_eq!(column(&table, "particle.clearance_ratio"), [9.0, 9.0, 12.0, 12.0, 9.5, 9.5]);
    assert_eq!(column(&table, "particle.wall.coefficient")[2], 0.123_456_789_012_345_68);
    let largest = column(&table, "max_abs_x_m");
    let set = |clearance: f64, hz: f64| {
        let set = [
            format!("particle.clearance_ratio={clearance:?}"),
            format!("base.frequency_hz={hz}"),
            "particle.wall.coefficient=0.7".into(),
            "particle.start=centre".into(),
        ];
        simulated(&folder, &set)["summary"]["max_abs_x_m"].as_f64().unwrap()
    };
    for (row, clearance) in [(0, 9.0), (4, 9.5)] {
        let single = set(clearance, 2.4).max(set(clearance, 2.5));
        assert!((largest[row] / single - 1.0).abs() < 1e-9, "{row}: {} {single}", largest[row]);
    }
    let picture = std::fs::read_to_string(folder.path().join("out/max_abs_x_m.svg")).unwrap();
    assert_eq!(picture.matches("<circle").count(), 7, "six dots and the mark of the best");
    // Other points are another study.
    std::fs::write(folder.path().join("design.csv"), design.replace("9.5", "9.6")).unwrap();
    let told = run(&folder, "2", &["--out", "out"]);
    assert_eq!(told.status.code(), Some(2), "{}", String::from_utf8_lossy(&told.stderr));
    assert!(String::from_utf8_lossy(&told.stderr).contains("a file that the study or the case names has changed"));
}

#[test]
fn points_are_checked_as_they_are_and_not_as_the_corners_of_their_box() {
    // The start must lie within the clearance: the least clearance with the furthest start would not.
    let folder = folder(&FROM_OUTSIDE.replace("points", "record = { cycles = 5 }\npoints"));
    let design = "particle.clearance_m,particle.start_m\n0.01,0.009\n0.002,0.001\n";
    std::fs::write(folder.path().join("design.csv"), design).unwrap();
    assert_eq!(done(&folder).num_rows(), 2);
}

#[test]
fn the_same_study_called_from_another_folder_goes_on() {
    let folder = folder(&FROM_OUTSIDE.replace("case.toml", "../case.toml"));
    let studies = folder.path().join("studies");
    std::fs::create_dir(&studies).unwrap();
    std::fs::write(studies.join("design.csv"), "particle.clearance_m\n0.02\n").unwrap();
    std::fs::rename(folder.path().join("study.toml"), studies.join("study.toml")).unwrap();
    let out = folder.path().join("out");
    let from = |of: &Path, study: &str| {
        let mut command = damprig(&folder);
        command.current_dir(of).args(["study", "run", study, "--out"]).arg(&out);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    from(folder.path(), "studies/study.toml");
    from(&studies, "study.toml");
}

#[test]
fn wrong_points_from_outside_are_refused_with_file_line_key_and_value() {
    let sampling = "sampling = { method = \"sobol\", count = 3 }\n";
    let axis = "[[axis]]\nkey = \"particle.clearance_m\"\nvalues = [0.01]\n";
    for (more, design, words) in [
        ("", None, &["study.toml:3", "points", "design.csv", "cannot be read"][..]),
        ("", Some("particle.clearance_m\n0.01\nabc\n"), &["line 3", "particle.clearance_m", "\"abc\""]),
        ("", Some("0.01\n0.02\n"), &["first line", "keys"]),
        ("", Some("particle.clearence_m\n0.01\n"), &["clearence_m", "clearance_m"]),
        ("", Some("particle.clearance_m\n0.01\n-0.02\n"), &["particle.clearance_m", "-0.02", "study.toml:3"]),
        (sampling, Some("particle.clearance_m\n0.01\n"), &["sampling", "points"]),
        (axis, Some("particle.clearance_m\n0.01\n"), &["two axes have this key"]),
    ] {
        let folder = folder(&format!("{FROM_OUTSIDE}{more}"));
        if let Some(design) = design {
            std::fs::write(folder.path().join("design.csv"), design).unwrap();
        }
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{design:?}\n{told}");
        for word in words {
            assert!(told.contains(word), "no {word:?} in:\n{told}");
        }
    }
}
