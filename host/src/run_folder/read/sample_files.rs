//! Finds and reads the files that hold samples: joined, closed parts, and the part that was open when the program ended.

use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::RecordBatch;

use super::open_part::salvage;
use super::parquet_file::read;
use crate::failure::Failure;
use crate::input::regular;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::samples::{
    JOINED, PARTS, open_part_name, open_part_number, open_sums_number, part_name, part_number,
};

/// Numbers and files of the closed parts, in order.
#[must_use]
pub fn closed_parts(folder: &Path) -> Vec<(u32, PathBuf)> {
    numbered(&folder.join(PARTS), |path| part_number(path.file_name()?.to_str()?))
}

/// Numbers and files of the parts that are open, or were when the program was killed.
#[must_use]
pub fn open_parts(folder: &Path) -> Vec<(u32, PathBuf)> {
    numbered(folder, |path| open_part_number(path.file_name()?.to_str()?))
}

/// Numbers and files of the checksums of open parts.
#[must_use]
pub fn open_sums(folder: &Path) -> Vec<(u32, PathBuf)> {
    numbered(folder, |path| open_sums_number(path.file_name()?.to_str()?))
}

/// Names of open parts with rows that are gone: their checksums are there, and they are not closed.
#[must_use]
pub fn lost_open_parts(folder: &Path, journal: &JournalState) -> Vec<String> {
    let is_known = |part: u32| journal.is_sealed(part) || journal.set_aside.iter().any(|aside| aside.part == part);
    // The first line is of the head, the others are of rows.
    let has_rows = |sums: &Path| regular::read(sums).is_ok_and(|sums| sums.iter().filter(|b| **b == b'\n').count() > 1);
    let names = open_sums(folder).into_iter().map(|(part, sums)| (part, sums, open_part_name(part)));
    let lost = names.filter(|(part, sums, name)| !is_known(*part) && !folder.join(name).exists() && has_rows(sums));
    lost.map(|(.., name)| name).collect()
}

fn numbered(folder: &Path, number: impl Fn(&Path) -> Option<u32>) -> Vec<(u32, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut parts: Vec<(u32, PathBuf)> = entries.filter_map(|path| Some((number(&path)?, path))).collect();
    parts.sort();
    parts
}

/// The files that hold samples, in order.
#[must_use]
pub fn sample_files(folder: &Path) -> Vec<PathBuf> {
    let whole = folder.join(JOINED);
    if whole.exists() {
        return vec![whole];
    }
    let closed = closed_parts(folder);
    // An open part that is still there beside its closed one has no other rows.
    let mut open = open_parts(folder);
    open.retain(|(number, _)| !closed.iter().any(|(other, _)| other == number));
    let mut all: Vec<(u32, PathBuf)> = closed.into_iter().chain(open).collect();
    all.sort();
    all.into_iter().map(|(_, path)| path).collect()
}

/// Whether a file of samples was still open when the program ended.
#[must_use]
pub fn is_open_part(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "arrows")
}

/// The closed part that an open part becomes.
fn closed_of(open: &Path) -> Option<PathBuf> {
    Some(open.parent()?.join(part_name(open_part_number(open.file_name()?.to_str()?)?)))
}

type BatchIterator = Box<dyn Iterator<Item = Result<RecordBatch, Failure>>>;

/// Batches of one of [`sample_files`]; of an open part, up to the last whole one.
///
/// # Errors
/// As [`read`].
pub fn read_samples(path: &Path) -> Result<BatchIterator, Failure> {
    if is_open_part(path) {
        let salvaged = match salvage(path) {
            Ok(salvaged) => salvaged,
            // A program that is recording has closed it since it was listed.
            Err(error) => {
                return match closed_of(path).filter(|closed| !path.exists() && closed.exists()) {
                    Some(closed) => Ok(Box::new(read(&closed)?)),
                    None => Err(Failure::storage(error)),
                };
            }
        };
        return Ok(Box::new(salvaged.batches.into_iter().map(Ok)));
    }
    Ok(Box::new(read(path)?))
}
