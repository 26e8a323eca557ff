//! No file of `damprig simulate` may take the place of another: what a run reads is not overwritten by what it writes.
//!
//! Files are compared by where they are, not by how they are spelt: `a/../case.csv` and a link to it are `case.csv`.

use std::path::{Path, PathBuf};

use super::Failure;
use crate::simulation::Case;
use crate::simulation::time_history::TablePath;

/// Refuses outputs that are the case, its record, or one another.
///
/// # Errors
/// Names both roles and the file.
pub fn check(path: &Path, case: &Case, out: Option<&TablePath>, plot: Option<&Path>) -> Result<(), Failure> {
    let record = case.record.as_ref().map(|record| ("the record that the case plays", record.file.clone()));
    let read = [Some(("the case itself", path.to_path_buf())), record];
    let history = out.map(|out| ("--out", out.path().to_path_buf()));
    let impacts = out.map(|out| ("the table of impacts of --out", out.impacts().path().to_path_buf()));
    let accumulations =
        out.map(|out| ("the table of accumulations of --out", out.accumulations().path().to_path_buf()));
    let picture = plot.map(|plot| ("--plot", plot.to_path_buf()));
    let mut taken: Vec<(&str, PathBuf)> = read.into_iter().flatten().collect();
    for (role, file) in [history, impacts, accumulations, picture].into_iter().flatten() {
        let place = place(&file);
        if let Some((other, _)) = taken.iter().find(|(_, other)| self::place(other) == place) {
            return Err(Failure::Input(format!(
                "{role} would write {}, which is {other}\n  give another file name; nothing was written",
                file.display()
            )));
        }
        taken.push((role, file));
    }
    Ok(())
}

/// Where a file is, or would be: without links and detours as far as it exists.
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
