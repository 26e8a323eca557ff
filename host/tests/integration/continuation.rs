//! `damprig continue`: the shipped file, and what is refused.

use std::path::{Path, PathBuf};

use arrow_array::RecordBatch;
use damprig::continuation::Continuation;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, read_parquet};

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("continuations/clearance.toml")
}

#[test]
fn the_shipped_continuation_finds_the_range_in_which_the_two_impact_motion_is_stable() {
    let found = Continuation::read(&shipped()).expect("valid").follow(&|_| true).expect("periodic");
    let branch = &found.branches[0];
    let at = |kind: &str| {
        let points: Vec<f64> =
            branch.special_points.iter().filter(|point| point.kind == kind).map(|point| point.parameter).collect();
        assert_eq!(points.len(), 1, "{kind}: {points:?}");
        points[0]
    };
    let (low, high) = (at("symmetry breaking"), at("Neimark-Sacker"));
    assert!(branch.orbits.len() > 100);
    for orbit in &branch.orbits {
        assert_eq!(orbit.is_stable, (low..high).contains(&orbit.parameter), "{orbit:?} {low} {high}");
    }
    // Two mirrored orbits leave where the symmetry breaks.
    assert!(found.branches.iter().any(|other| other.origin.ends_with("of branch 1")), "{:?}", found.branches.len());
}

#[test]
fn the_range_of_a_branch_is_that_of_its_orbits_and_what_no_branch_covers_is_told() {
    let found = Continuation::read(&shipped()).expect("valid").follow(&|_| true).expect("periodic");
    let (mut covered, mut told) = (Vec::new(), found.not_covered.clone());
    for branch in &found.branches {
        let [low, high] = branch.range().expect("orbits");
        assert!(branch.orbits.iter().all(|orbit| (low..=high).contains(&orbit.parameter)));
        covered.push([low, high]);
    }
    // Both together are the range of the file, but for a thousandth of it.
    let text = std::fs::read_to_string(shipped()).expect("shipped");
    let number = |key: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(key)).expect("the key");
        line.split('=')
            .nth(1)
            .and_then(|value| value.split('#').next())
            .expect("a value")
            .trim()
            .parse()
            .expect("a number")
    };
    let (from, to) = (number("from"), number("to"));
    told.extend(covered);
    told.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut up_to = from;
    for [low, high] in told {
        assert!(low <= up_to + 1.001e-3 * (to - from), "{low} after {up_to}");
        up_to = up_to.max(high);
    }
    assert!(up_to >= to - 1.001e-3 * (to - from), "{up_to}");
}

/// The message about the shipped file with a replacement.
fn refusal(from: &str, to: &str) -> String {
    let text = std::fs::read_to_string(shipped()).expect("shipped");
    assert!(text.contains(from), "{from}");
    let folder = tempfile::tempdir().expect("a folder");
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    let text = text.replace("../cases", &cases.display().to_string()).replace(from, to);
    let file = folder.path().join("changed.toml");
    std::fs::write(&file, text).expect("written");
    match Continuation::read(&file) {
        Err(refusal) => refusal.to_string(),
        Ok(continuation) => continuation.follow(&|_| true).expect_err("refused").to_string(),
    }
}

/// A continuation of a frame of one storey, which is the shipped impact damper, with lines after those that it needs.
fn frame(range: &str, more: &str) -> Result<Continuation, damprig::failure::Failure> {
    let folder = tempfile::tempdir().expect("a folder");
    let case = "storey = [{ mass_kg = 1.6, stiffness_n_per_m = 394.78417604357434, damping_n_s_per_m = 0.19100882 }]\n\
                base = { kind = \"sine\", amplitude_m = 0.001, frequency_hz = 2.5 }\nrun = { duration_s = 40 }\n\
                particle = { place = \"floor 1\", mass_kg = 0.16, clearance_m = 0.01, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
    std::fs::write(folder.path().join("case.toml"), case).expect("written");
    let file = folder.path().join("continuation.toml");
    std::fs::write(&file, format!("case = \"case.toml\"\n{range}\n{more}")).expect("written");
    Continuation::read(&file)
}

#[test]
fn a_frame_of_one_storey_has_the_special_points_of_one_degree_of_freedom() {
    let special_points = |found: &damprig::continuation::FoundBranches| -> Vec<(&'static str, f64)> {
        let all = found.branches.iter().flat_map(|branch| &branch.special_points);
        all.filter(|point| !point.is_grazing()).map(|point| (point.kind, point.parameter)).collect()
    };
    let range = "parameter = \"particle.clearance_m\"\nfrom = 0.004\nto = 0.02\nrestarts = 0";
    let found = frame(range, "").expect("valid").follow(&|_| true).expect("periodic");
    let folder = tempfile::tempdir().expect("a folder");
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_n_s_per_m = 0.19100882 }\n\
                base = { kind = \"sine\", amplitude_m = 0.001, frequency_hz = 2.5 }\nrun = { duration_s = 40 }\n\
                particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
    std::fs::write(folder.path().join("case.toml"), case).expect("written");
    let file = folder.path().join("continuation.toml");
    std::fs::write(&file, format!("case = \"case.toml\"\n{range}")).expect("written");
    let one_degree = Continuation::read(&file).expect("valid").follow(&|_| true).expect("periodic");
    let (own, other) = (special_points(&found), special_points(&one_degree));
    assert!(other.len() >= 2, "{other:?}");
    for (kind, parameter) in other {
        let is_near = |(own, at): &&(&str, f64)| *own == kind && (at / parameter - 1.0).abs() < 1e-8;
        assert!(own.iter().any(|point| is_near(&point)), "{kind} at {parameter}: {own:?}");
    }
    let at = |value: f64, orbits: &[damprig::continuation::FoundOrbit]| {
        let off = |orbit: &damprig::continuation::FoundOrbit| (orbit.parameter - value).abs();
        orbits.iter().min_by(|a, b| off(a).total_cmp(&off(b))).cloned().expect("orbits")
    };
    let start = |found: &damprig::continuation::FoundBranches| at(0.01, &found.branches[0].orbits);
    let (own, other) = (start(&found), start(&one_degree));
    assert_eq!((own.impacts, own.is_stable), (other.impacts, other.is_stable));
    for (own, other) in [
        (own.max_abs_x_m, other.max_abs_x_m),
        (own.mean_cycle_max_m, other.mean_cycle_max_m),
        (own.max_abs_y_minus_x_m, other.max_abs_y_minus_x_m),
        (own.fastest_impact_m_per_s, other.fastest_impact_m_per_s),
    ] {
        assert!((own / other - 1.0).abs() < 1e-7, "{own} {other}");
    }
}

#[test]
fn what_a_structure_with_places_cannot_be_followed_over_is_refused_with_line_and_fix() {
    for (range, more, parts) in [
        (
            "parameter = \"particle.clearence_m\"\nfrom = 0.004\nto = 0.02",
            "",
            ["no such number", "did you mean \"particle.clearance_m\""],
        ),
        ("parameter = \"particle.clearance_m\"\nfrom = -0.004\nto = 0.02", "", ["must not contain 0", "from = -0.004"]),
        ("parameter = \"storey.1.mass_kg\"\nfrom = 1\nto = 1e40", "", ["storey.1.mass_kg = 1", "is refused"]),
        (
            "parameter = \"particle.clearance_m\"\nfrom = 0.004\nto = 0.02",
            "[second]\nparameter = \"particle.mass_kg\"\nfrom = 0.1\nto = 0.2",
            ["damprig has no curves in two parameters of a structure", "leave out [second]"],
        ),
    ] {
        let message = frame(range, more).expect_err(range).to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
}

#[test]
fn a_wrong_file_is_refused_with_key_value_and_fix() {
    for (from, to, parts) in [
        ("clearance_ratio", "clearence_ratio", ["`parameter`", "did you mean \"particle.clearance_ratio\""]),
        ("particle.clearance_ratio", "tmd.mass_kg", ["has no such parameter", "particle.wall.coefficient"]),
        ("from = 3.0", "from = 40.0", ["the range from 40 to 30 is empty", "swap them"]),
        ("from = 3.0", "from = -3.0", ["from -3 to 30 is not allowed", "must be greater than 0"]),
        ("to = 30.0", "to = 30.0\nstart_at = 2", ["`start_at` = 2", "from 3 to 30"]),
        ("spid.toml", "hybrid.toml", ["must be a sine", "frequency_hz"]),
        ("to = 30.0", "to = 4.6\nstart_at = 4.3", ["no periodic orbit", "give another `start_at`"]),
    ] {
        let message = refusal(from, to);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
}

/// The shipped two-parameter file with its case beside it, in a folder.
fn curves_in(folder: &TempDir) {
    let host = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(host.join("cases/spid.toml"), folder.path().join("spid.toml")).expect("copied");
    let text = std::fs::read_to_string(host.join("continuations/grazing-curve.toml")).expect("shipped");
    std::fs::write(folder.path().join("curves.toml"), text.replace("../cases/", "")).expect("written");
}

#[test]
fn a_folder_gets_orbits_and_curves_with_their_units_and_figures() {
    let folder = TempDir::new().expect("a folder");
    curves_in(&folder);
    damprig(&folder).args(["continue", "curves.toml", "--out", "all", "--plot-curves", "own.svg"]).assert().success();
    let file = |name: &str| folder.path().join("all").join(name);
    let batches = read_parquet(file("curves.parquet"));
    let schema = batches[0].schema();
    let field = schema.field_with_name("particle_clearance_ratio").expect("a column");
    assert_eq!(
        (field.metadata()["unit"].as_str(), field.metadata()["key"].as_str()),
        ("1", "particle.clearance_ratio")
    );
    let rows: usize = batches.iter().map(RecordBatch::num_rows).sum();
    let text = std::fs::read_to_string(file("curves.csv")).expect("written");
    assert_eq!(text.lines().count(), rows + 1);
    for kind in ["grazing", "symmetry breaking", "Neimark-Sacker"] {
        assert!(text.contains(kind), "{kind}");
        assert!(std::fs::read_to_string(file("curves.svg")).expect("drawn").contains(&format!(">{kind}</text>")));
    }
    for name in ["orbits.parquet", "orbits.csv", "branches.svg", "branches.png", "curves.png"] {
        assert!(file(name).is_file(), "{name}");
    }
    // The folder is not written to twice, and one parameter has no curves.
    let again = damprig(&folder).args(["continue", "curves.toml", "--out", "all"]).assert().code(2);
    again.stderr(contains("is not empty"));
    let text = std::fs::read_to_string(folder.path().join("curves.toml")).expect("written");
    let (one, _) = text.split_once("[second]").expect("a second parameter");
    std::fs::write(folder.path().join("one.toml"), one).expect("written");
    let refused = damprig(&folder).args(["continue", "one.toml", "--plot-curves", "no.svg"]).assert().code(2);
    refused.stderr(contains("add a table [second]"));
}
