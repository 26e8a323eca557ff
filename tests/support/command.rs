//! The `damprig` command as users run it, and the tables of the run folders that it writes.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use arrow_array::RecordBatch;
use escargot::CargoBuild;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::support::images::project;

/// The command: the file that `DAMPRIG_COMMAND` names; otherwise built now with the optimisation level of the tests.
///
/// # Panics
/// The build fails.
#[must_use]
pub fn damprig() -> Command {
    static COMMAND: OnceLock<PathBuf> = OnceLock::new();
    Command::new(COMMAND.get_or_init(|| {
        if let Some(path) = std::env::var_os("DAMPRIG_COMMAND") {
            return path.into();
        }
        let build = CargoBuild::new().manifest_path(project().join("Cargo.toml")).package("damprig").bin("damprig");
        let build = if cfg!(debug_assertions) { build } else { build.release() };
        build.run().expect("the command builds").path().to_path_buf()
    }))
}

/// Exit status and output of a finished command, for a message.
#[must_use]
pub fn told(output: &Output) -> String {
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    format!("{}\n{out}\n{err}", output.status)
}

/// All rows of a Parquet file.
///
/// # Panics
/// The file is missing or damaged.
#[must_use]
pub fn table(path: &Path) -> Vec<RecordBatch> {
    let file = File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).and_then(|builder| builder.build());
    let reader = reader.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    reader.collect::<Result<_, _>>().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
