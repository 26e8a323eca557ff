//! The `damprig` command as a user has it, and the tables of the run folders that it writes.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Output};

use arrow_array::RecordBatch;
use escargot::{CargoBuild, CargoRun};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::support::images::project;

/// The command, built if need be. With the optimisation that the tests themselves have.
///
/// # Panics
/// It does not build.
#[must_use]
pub fn damprig() -> Command {
    built().command()
}

/// The built command, for a test that runs it more than once.
///
/// # Panics
/// It does not build.
#[must_use]
pub fn built() -> CargoRun {
    let build = CargoBuild::new().manifest_path(project().join("Cargo.toml")).package("damprig").bin("damprig");
    let build = if cfg!(debug_assertions) { build } else { build.release() };
    build.run().expect("the command builds")
}

/// What a finished command printed, and how it ended, for a message.
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
