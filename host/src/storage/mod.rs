//! Writing whole files: a file gets its name when it is complete, so that a full disk or a kill leaves nothing under the name.

pub mod out_file;
pub mod whole_file;

use std::path::Path;

use crate::failure::Failure;

/// Creates a folder and those above it, unless they are there.
///
/// # Errors
/// Names the folder that cannot be created.
pub fn create_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| Failure::cannot("create", folder, error))
}
