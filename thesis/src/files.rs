//! The files that ship with the program: items, published values, and the studies, cases, continuations and campaigns behind them.
//!
//! They are written out so that a user can run, copy and change each of them alone.

use std::path::{Path, PathBuf};

use include_dir::{Dir, File, include_dir};

use damprig::failure::Failure;
use damprig::run_folder::own_files;
use damprig::storage::create_folder;

static FILES: Dir = include_dir!("$CARGO_MANIFEST_DIR/files");

/// Name of the folder beside the results that the files are written to.
pub const FOLDER: &str = "files";

fn all() -> Vec<&'static File<'static>> {
    fn add(dir: &'static Dir<'static>, files: &mut Vec<&'static File<'static>>) {
        files.extend(dir.files());
        dir.dirs().for_each(|dir| add(dir, files));
    }
    let mut files = Vec::new();
    add(&FILES, &mut files);
    files
}

/// Writes the files out beside the results, unless they are there, and answers with their folder.
///
/// # Errors
/// A file there that differs: it may be a user's own. A file that cannot be written.
pub fn write_out(out: &Path) -> Result<PathBuf, Failure> {
    let folder = out.join(FOLDER);
    for file in all() {
        let path = folder.join(file.path());
        match std::fs::read(&path) {
            Ok(there) if there == file.contents() => {}
            Ok(_) => {
                return Err(Failure::Input(format!(
                    "{} is not the file of this version of damprig\n  compute with the files there: --files {}; or move it away; nothing was changed",
                    path.display(),
                    folder.display()
                )));
            }
            Err(_) => {
                let parent = path.parent().unwrap_or(&folder);
                create_folder(parent)?;
                own_files::replace(&path, file.contents())?;
            }
        }
    }
    Ok(folder)
}
