//! Checks that no output file of `damprig simulate` overwrites an input, another output or, without `--force`, any other file.
//!
//! Files are compared by their resolved paths: `a/../case.csv` and a link to it are `case.csv`.

use std::path::{Path, PathBuf};

use super::arguments::ForceArg;
use crate::failure::Failure;
use crate::simulation::Case;
use crate::simulation::time_history::TablePath;

/// Rejects outputs that are the case, its record, or one another; unless `force`, also files that exist.
///
/// # Errors
/// Names both files and their roles.
pub fn check(
    path: &Path,
    case: &Case,
    out: Option<&TablePath>,
    pictures: [(&'static str, Option<&Path>); 2],
    force: ForceArg,
) -> Result<(), Failure> {
    // The tables beside --out are written for a case with walls only.
    let has_walls = case.has_impacts();
    let record =
        case.record.as_ref().and_then(|record| Some(("the record of the case", record.origin.file()?.to_path_buf())));
    let read = [Some(("the case file", path.to_path_buf())), record];
    let history = out.map(|out| ("--out", out.path().to_path_buf()));
    let beside = out.filter(|_| has_walls);
    let impacts = beside.map(|out| ("the table of impacts of --out", out.impacts().path().to_path_buf()));
    let contacts = out.filter(|_| case.has_hertz_walls());
    let contacts = contacts.map(|out| ("the table of contacts of --out", out.contacts().path().to_path_buf()));
    let accumulations =
        beside.map(|out| ("the table of accumulations of --out", out.accumulations().path().to_path_buf()));
    let pictures = pictures.into_iter().filter_map(|(role, file)| Some((role, file?.to_path_buf())));
    let mut taken: Vec<(&str, PathBuf)> = read.into_iter().flatten().collect();
    let files = [history, impacts, contacts, accumulations].into_iter().flatten().chain(pictures);
    for (role, file) in files {
        let place = place(&file);
        if let Some((other, _)) = taken.iter().find(|(_, other)| self::place(other) == place) {
            return Err(Failure::Input(format!(
                "{role} would overwrite {}, which is {other}\n  give another file name; nothing was written",
                file.display()
            )));
        }
        if file.is_dir() {
            return Err(Failure::Input(format!(
                "{role}: cannot write {}: it is a folder\n  give the name of a file in it; nothing was written",
                file.display()
            )));
        }
        force.check(&file)?;
        taken.push((role, file));
    }
    Ok(())
}

/// The resolved path of a file that may not exist yet.
fn place(file: &Path) -> PathBuf {
    if let Ok(place) = file.canonicalize() {
        return place;
    }
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (folder.canonicalize(), file.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => file.to_path_buf(),
    }
}
