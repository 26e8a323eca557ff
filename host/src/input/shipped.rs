//! Example files compiled into the command, so that `damprig run hybrid` needs no copy of the project.
//!
//! Their paths begin with `damprig:` (`damprig:campaigns/hybrid.toml`), and [`super::regular`] reads such a path from here. A file that
//! an example names relative to itself is an example too.

use std::path::{Component, Path, PathBuf};

/// First part of an example's path.
pub const ROOT: &str = "damprig:";

macro_rules! files {
    ($($path:literal),* $(,)?) => { &[$(($path, include_str!(concat!("../../", $path)))),*] };
}

/// The examples: path below `host/`, and text. A test compares the list with the folders.
pub static FILES: &[(&str, &str)] = files![
    "campaigns/bring-up.toml",
    "campaigns/closed-loop.toml",
    "campaigns/dampers.toml",
    "campaigns/force.toml",
    "campaigns/frame-rig.toml",
    "campaigns/hidden-branch.toml",
    "campaigns/resonance.toml",
    "campaigns/hybrid.toml",
    "campaigns/noise.toml",
    "campaigns/records/synthetic.csv",
    "campaigns/short.toml",
    "campaigns/source-document.toml",
    "campaigns/transients.toml",
    "campaigns/tuned.toml",
    "cases/boring-bar.toml",
    "cases/frame.toml",
    "cases/friction-damper.toml",
    "cases/hertz-wall.toml",
    "cases/hybrid.toml",
    "cases/many-particles.toml",
    "cases/modal-test.toml",
    "cases/record.toml",
    "cases/shake.csv",
    "cases/soft-wall.toml",
    "cases/spid.toml",
    "cases/tmd.toml",
    "continuations/clearance.toml",
    "continuations/frame.toml",
    "continuations/grazing-curve.toml",
    "optimisations/cases/hybrid.toml",
    "optimisations/boring-bar.toml",
    "optimisations/hybrid-band.toml",
    "optimisations/spid-band.toml",
    "optimisations/worst-start.toml",
    "studies/clearance-and-restitution.toml",
    "studies/many-particles.toml",
    "studies/sensitivity.toml",
    "studies/single-particle.toml",
];

/// The text of the example at a path that begins with [`ROOT`]; `None` for any other path, and where there is no example.
#[must_use]
pub fn text(path: &Path) -> Option<&'static str> {
    let below = path.strip_prefix(ROOT).ok()?;
    let wanted = plain(below);
    FILES.iter().find(|(path, _)| Path::new(path) == wanted).map(|(_, text)| *text)
}

/// A path without `.` and `..`, as far as the names before them go.
#[must_use]
pub fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_example_file_of_the_project_is_compiled_in() {
        let host = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut there = BTreeSet::new();
        let mut folders: Vec<PathBuf> =
            ["campaigns", "cases", "continuations", "optimisations", "studies"].iter().map(|f| host.join(f)).collect();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "toml" || extension == "csv") {
                    there.insert(path.strip_prefix(host).unwrap().to_str().unwrap().replace('\\', "/"));
                }
            }
        }
        let listed: BTreeSet<String> = FILES.iter().map(|(path, _)| (*path).to_string()).collect();
        assert_eq!(listed, there);
    }

    #[test]
    fn a_named_file_is_found_relative_to_the_example() {
        let study = Path::new(ROOT).join("studies/many-particles.toml");
        let case = study.parent().unwrap().join("../cases/many-particles.toml");
        assert!(text(&study).unwrap().contains("../cases/many-particles.toml"));
        assert!(text(&case).unwrap().contains("[many_particles]"));
        for other in
            ["damprig:cases/other.toml", "cases/spid.toml", "damprig:../Cargo.toml", "/damprig:/cases/spid.toml"]
        {
            assert_eq!(text(Path::new(other)), None, "{other}");
        }
    }
}
