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
    let found = Continuation::read(&shipped()).expect("valid").follow().expect("periodic");
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
        Ok(continuation) => continuation.follow().expect_err("refused").to_string(),
    }
}

#[test]
fn a_wrong_file_is_refused_with_key_value_and_fix() {
    for (from, to, parts) in [
        ("clearance_ratio", "clearence_ratio", ["`parameter`", "did you mean \"particle.clearance_ratio\""]),
        ("particle.clearance_ratio", "tmd.mass_kg", ["has no such parameter", "particle.wall.coefficient"]),
        ("from = 3.0", "from = 40.0", ["the range from 40 to 30 is empty", "swap them"]),
        ("from = 3.0", "from = -3.0", ["`from` = -3.0 is not allowed", "must be greater than 0"]),
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
