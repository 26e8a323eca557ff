//! The manual's tutorials and how-to pages: the files of each page are written, and its commands run in order, on the virtual rig.
//!
//! A block of code whose first line is `# NAME` is a file, a block marked `sh` is run, one marked `sh,long` with DAMPRIG_FULL only.
//! The shipped files of `host` are there. Links and the search field are tested by `tests/manual.rs`.
#![cfg(unix)]

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::common::{blocks, is_full, python};

/// The pages of a folder of docs.
fn pages(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(folder);
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|ending| ending == "md")).collect();
    pages.sort();
    pages
}

/// The folders of commands: the built command's, that of the tests' Python, and those of the system.
fn path() -> String {
    let command = assert_cmd::cargo::cargo_bin("damprig");
    let own = [Some(command), python()].into_iter().flatten();
    let own = own.filter_map(|file| file.parent().map(|folder| folder.display().to_string()));
    let system = std::env::var("PATH").unwrap_or_default();
    own.chain([system]).collect::<Vec<_>>().join(":")
}

/// A script as it is run here: what asks for a board gets the virtual rig, a calibration a rehearsal.
fn without_board(script: &str) -> String {
    let line = |line: &str| {
        let rehearsed = line.starts_with("damprig calibrate");
        line.replace("--rig auto", if rehearsed { "--rehearse 1" } else { "--rig virtual" })
    };
    script.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Runs a page in a folder of its own; the number of its scripts, or what failed.
fn run(page: &Path) -> Result<usize, String> {
    let text = std::fs::read_to_string(page).unwrap();
    let folder = TempDir::new().unwrap();
    symlink(env!("CARGO_MANIFEST_DIR"), folder.path().join("host")).unwrap();
    for file in ["toml", "python", "csv"].into_iter().flat_map(|language| blocks(&text, language)) {
        let name = file.lines().next().and_then(|line| line.strip_prefix("# ")).filter(|name| !name.contains(' '));
        if let Some(name) = name {
            std::fs::write(folder.path().join(name), file).unwrap();
        }
    }
    let mut scripts = blocks(&text, "sh");
    if is_full() {
        scripts.extend(blocks(&text, "sh,long"));
    }
    for script in &scripts {
        let mut bash = Command::new("bash");
        bash.args(["-e", "-o", "pipefail", "-c", &without_board(script)])
            .current_dir(folder.path())
            .env("PATH", path());
        let output = bash.output().unwrap();
        if !output.status.success() {
            let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            return Err(format!("{}:\n{script}\n{}\n{out}\n{err}", page.display(), output.status));
        }
    }
    Ok(scripts.len())
}

/// Runs the pages of a folder, two at a time; the number of scripts.
fn run_all(folder: &str) -> usize {
    let pages = pages(folder);
    let next = std::sync::atomic::AtomicUsize::new(0);
    let worker = || {
        let mine = std::iter::from_fn(|| pages.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)));
        mine.map(|page| run(page)).collect::<Vec<_>>()
    };
    let results = std::thread::scope(|scope| {
        let workers = [scope.spawn(worker), scope.spawn(worker)];
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect::<Vec<_>>()
    });
    results.into_iter().map(|result| result.unwrap_or_else(|what| panic!("{what}"))).sum()
}

#[test]
fn every_command_of_the_how_to_pages_works() {
    assert!(run_all("how-to") > 12);
}

#[test]
fn every_command_of_the_tutorials_works() {
    assert!(run_all("tutorial") > 4);
}
