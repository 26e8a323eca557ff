//! Joins the closed parts of a complete run into `samples.parquet`, and removes them afterwards.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use arrow_schema::SchemaRef;

use super::parquet_file::{Durability, write_whole};
use crate::failure::Failure;
use crate::run_folder::checksum::{self, FileRecord};
use crate::run_folder::file_name::FileName;
use crate::run_folder::journal::{Joined, Sealed};
use crate::run_folder::read::parquet_file::read;
use crate::run_folder::schema::samples::{JOINED, PARTS};

/// The parts joined a second time, to compare with an existing file.
const AGAIN: &str = "samples.again.parquet";

/// Joins the parts that the journal lists into `samples.parquet`. The parts stay. A part that has changed since it was
/// closed, or is missing, is left out: only its own rows are lost.
///
/// # Errors
/// When the file cannot be written, or another file with other content has its name.
pub fn join(folder: &Path, schema: &SchemaRef, sealed: &[Sealed]) -> Result<Joined, Failure> {
    let is_intact = |s: &&Sealed| {
        let is_same = checksum::of_file(folder, &s.file.name).is_ok_and(|now| now == s.file);
        is_same && read(&folder.join(&s.file.name)).is_ok_and(|mut batches| batches.all(|batch| batch.is_ok()))
    };
    let (mut intact, left): (Vec<&Sealed>, Vec<&Sealed>) = sealed.iter().partition(is_intact);
    intact.sort_by_key(|s| s.part);
    let mut joined = Joined { left: left.iter().map(|s| s.part).collect(), ..Joined::default() };
    let batches = intact.iter().flat_map(|s| -> Box<dyn Iterator<Item = _>> {
        match read(&folder.join(&s.file.name)) {
            Ok(batches) => Box::new(batches),
            Err(error) => Box::new(std::iter::once(Err(error))),
        }
    });
    let counted = batches.inspect(|batch| joined.rows += batch.as_ref().map_or(0, |b| b.num_rows() as u64));
    let path = folder.join(JOINED);
    if !path.exists() {
        write_whole(&path, schema, counted, Durability::Disk)?;
        joined.file = record_of(folder, JOINED);
        return Ok(joined);
    }
    // The program was killed between writing this file and its line in the journal, or the file is not of this run.
    let again = folder.join(AGAIN);
    write_whole(&again, schema, counted, Durability::Program)?;
    let (there, own) = (record_of(folder, JOINED), record_of(folder, AGAIN));
    fs::remove_file(&again).map_err(|e| Failure::cannot("remove", &again, e))?;
    if there.is_some() && there.as_ref().map(|f| &f.sha256) == own.as_ref().map(|f| &f.sha256) {
        joined.file = there;
        return Ok(joined);
    }
    let message =
        format!("a file of this name exists and differs from the joined {PARTS}; move it elsewhere and resume");
    Err(Failure::cannot("write", &path, message))
}

fn record_of(folder: &Path, name: &str) -> Option<FileRecord> {
    FileName::new(name).ok().and_then(|name| checksum::of_file(folder, &name).ok())
}

/// Removes the parts that are joined, once the journal says so. Other files beside them stay.
///
/// # Errors
/// When they cannot be removed.
pub fn remove_parts<'a>(folder: &Path, joined: impl Iterator<Item = &'a Sealed>) -> Result<(), Failure> {
    for part in joined {
        let path = folder.join(&part.file.name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(Failure::cannot("remove", &path, error));
            }
            _ => {}
        }
    }
    let path = folder.join(PARTS);
    match fs::remove_dir(&path) {
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty) => {
            Err(Failure::cannot("remove", &path, error))
        }
        _ => Ok(()),
    }
}
