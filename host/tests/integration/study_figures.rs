//! The figures and the page of a study, and curves of a continuation over its map.

use crate::study::{CASE, done, folder, run};

#[test]
fn a_study_draws_a_map_curves_or_points_and_a_page_that_needs_no_network() {
    let range =
        |key: &str, from: &str, to: &str| format!("[[axis]]\nkey = \"{key}\"\nfrom = {from}\nto = {to}\ncount = 8\n");
    let top = "case = \"case.toml\"\nmetrics = [\"x_over_z\", \"cycle_spread\"]\n";
    let (clearance, restitution) =
        (range("particle.clearance_ratio", "5", "20"), range("particle.wall.coefficient", "0.2", "0.9"));
    let ensemble = "[ensemble]\nstarts = 3\n";
    let picture = |study: &str| {
        let folder = folder(study);
        let _ = done(&folder);
        let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
        let page = read("study.html");
        assert!(page.contains("default-src 'none'") && !page.contains("src=\"http"), "the page loads something");
        assert_eq!(page.matches("<figure").count(), 2);
        assert!(folder.path().join("out/x_over_z.png").is_file());
        read("x_over_z.svg")
    };
    let map = picture(&format!("{top}{clearance}{restitution}"));
    assert!(map.contains("hatch-0") && map.contains("smallest: ") && map.contains("d/Z"));
    let few = "[[axis]]\nkey = \"particle.wall.coefficient\"\nvalues = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]\n";
    let curves = picture(&format!("{top}{clearance}{few}"));
    assert!(!curves.contains("hatch-0") && curves.contains(">e = 0.3</text>"), "a curve for each of seven values");
    let starts = "[[axis]]\nkey = \"particle.start\"\nwords = [\"centre\", \"at_positive_wall\"]\n";
    let slice = picture(&format!("{top}{clearance}{few}{starts}"));
    assert!(
        slice.contains(">e = 0.3</text>") && slice.contains(": start = "),
        "of fourteen the seven through the best"
    );
    let one = picture(&format!("{top}{clearance}{ensemble}"));
    assert!(one.contains("<polygon") && one.contains("worst over the starts"));
    let drawn = format!("{top}{}[sampling]\nmethod = \"sobol\"\ncount = 20\n", clearance.replace("count = 8\n", ""));
    let points = picture(&drawn);
    // The dots, and the mark of the best one.
    assert_eq!(points.matches("<circle").count(), 21);
}

/// A continuation in two parameters of the case.
const CURVES: &str = "case = \"case.toml\"\nparameter = \"particle.clearance_ratio\"\nfrom = 3\nto = 20\nrestarts = 0\n\
                      [second]\nparameter = \"particle.wall.coefficient\"\nfrom = 0.2\nto = 0.9\n";

const OVER: &str = "[[overlay]]\ncontinuation = \"curves.toml\"\n";

fn axis(key: &str, from: &str, to: &str) -> String {
    format!("[[axis]]\nkey = \"{key}\"\nfrom = {from}\nto = {to}\ncount = 8\n")
}

#[test]
fn a_map_has_the_curves_of_its_overlays_with_either_axis_across() {
    let (clearance, restitution) =
        (axis("particle.clearance_ratio", "5", "20"), axis("particle.wall.coefficient", "0.2", "0.9"));
    let top = "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n";
    let first_point = |axes: [&str; 2]| {
        let folder = folder(&format!("{top}{}{}{OVER}", axes[0], axes[1]));
        std::fs::write(folder.path().join("curves.toml"), CURVES).unwrap();
        let _ = done(&folder);
        let map = std::fs::read_to_string(folder.path().join("out/x_over_z.svg")).unwrap();
        assert!(map.contains(">grazing</text>") && map.contains(">Neimark-Sacker</text>"), "labels");
        let points = map.split("url(#frame)").nth(1).and_then(|rest| rest.split("points=\"").nth(1)).expect("a curve");
        let points = points.split([' ', '"']).next().unwrap();
        let (x, y) = points.split_once(',').expect("a point");
        (x.parse::<f64>().unwrap(), y.parse::<f64>().unwrap())
    };
    // Shares of the axes' lengths: exchanged with the axes.
    let share = |(x, y): (f64, f64)| ((x - 92.0) / 708.0, (540.0 - y) / 496.0);
    let (across, up) = share(first_point([&clearance, &restitution]));
    let swapped = share(first_point([&restitution, &clearance]));
    assert!((across - swapped.1).abs() < 1e-3 && (up - swapped.0).abs() < 1e-3, "{across} {up} {swapped:?}");
}

#[test]
fn an_overlay_that_does_not_belong_over_the_map_is_refused() {
    let (clearance, restitution) =
        (axis("particle.clearance_ratio", "5", "20"), axis("particle.wall.coefficient", "0.2", "0.9"));
    let mass = axis("particle.mass_ratio", "0.05", "0.2");
    let top = "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n";
    let one = CURVES.split("[second]").next().unwrap();
    let other = CURVES.replace("case.toml", "other.toml");
    for (axes, curves, words) in [
        ([&clearance, &mass], CURVES, ["particle.mass_ratio is not one of them", "write particle.clearance_ratio and"]),
        ([&clearance, &restitution], one, ["a continuation in two parameters", "add a table [second]"]),
        ([&clearance, &restitution], &other, ["must be of the study's case", "other.toml"]),
        ([&clearance, &String::new()], CURVES, ["needs a map", "two axes of at least 8 numbers"]),
        ([&clearance, &restitution], "case = 3", ["study.toml", "curves.toml"]),
    ] {
        let folder = folder(&format!("{top}{}{}{OVER}", axes[0], axes[1]));
        std::fs::write(folder.path().join("curves.toml"), curves).unwrap();
        std::fs::write(folder.path().join("other.toml"), CASE.replace("1.6", "1.7")).unwrap();
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(words.iter().all(|word| told.contains(word)), "{words:?}\n{told}");
        assert!(!folder.path().join("out").exists());
    }
}
