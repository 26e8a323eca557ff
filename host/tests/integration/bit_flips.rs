//! One bit of one file of a run folder is flipped: `damprig runs verify` finds it, in a complete run and in one that was killed.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};

use damprig::run_folder::read::verify::{Finding, verify};

use crate::common::{damprig, is_full};
use crate::kills;

/// Number of flipped bits: 30, or 300 in the full tests.
fn flips() -> usize {
    if is_full() { 300 } else { 30 }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_dir() { all.extend(files(&entry.path())) } else { all.push(entry.path()) }
    }
    all.sort();
    all
}

fn wrong(run: &Path) -> Vec<String> {
    let found = verify(run).unwrap_or_else(|error| vec![Finding::Wrong(error.to_string())]);
    found.into_iter().filter_map(|one| if let Finding::Wrong(text) = one { Some(text) } else { None }).collect()
}

/// Changes the files in turn, one at a time, and puts each back: a bit is flipped, the end is cut off, a byte is appended, or the file is
/// removed.
fn each_is_found(run: &Path, count: usize, random: &mut fastrand::Rng) {
    let files = files(run);
    let sound = wrong(run);
    for n in 0..count {
        let path = &files[n % files.len()];
        let own = std::fs::read(path).unwrap();
        if own.is_empty() {
            continue;
        }
        let (at, bit) = (random.usize(..own.len()), random.u8(..8));
        let mut changed = own.clone();
        let what = match n / files.len() % 4 {
            0 => {
                changed[at] ^= 1 << bit;
                format!("bit {bit} of byte {at} of {}", own.len())
            }
            1 => {
                changed.truncate(at);
                format!("{at} of {} bytes", own.len())
            }
            2 => {
                changed.push(*random.choice(b"\n0x\0").unwrap());
                format!("{:?} at the end", char::from(changed[own.len()]))
            }
            _ => "removed".to_string(),
        };
        if what == "removed" {
            std::fs::remove_file(path).unwrap();
        } else {
            std::fs::write(path, &changed).unwrap();
        }
        let found = wrong(run);
        assert!(found != sound, "{}: {what} is not found", path.display());
        std::fs::write(path, own).unwrap();
    }
    assert_eq!(wrong(run), sound);
    println!("{}: {count} changes of {} files, all found", run.display(), files.len());
}

#[test]
fn each_flipped_bit_of_a_run_folder_is_found() {
    let folder = kills::folder();
    let mut random = fastrand::Rng::with_seed(20_261_125);
    damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let whole = folder.path().join("whole");
    assert_eq!(wrong(&whole), Vec::<String>::new());
    each_is_found(&whole, flips() / 2, &mut random);
    if let Some(library) = crate::file_faults::preload() {
        assert!(kills::killed(&folder, &library, "result", 7, None));
        each_is_found(&folder.path().join("out"), flips() - flips() / 2, &mut random);
    }
}
