//! `damprig continue`: follows periodic orbits of a case over a parameter.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::outcome::{Failure, Outcome};
use super::simulate::picture;
use crate::continuation::Continuation;
use crate::report::branch_table;
use crate::report::exports::atomic_file::{EXISTS, OutFile};
use crate::report::figures::branches;
use crate::report::terminal;

/// Follows periodic orbits of a case over a parameter, stable or not, and locates folds, period doublings, Neimark-Sacker points and
/// grazings.
///
/// docs/CONTINUE.md describes the file, the method, its errors and limits.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Continuation file (TOML); host/continuations has examples
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Print the complete result as one JSON object
    #[arg(long)]
    json: bool,

    /// Write the orbits to FILE (.csv or .parquet)
    #[arg(long, value_name = "FILE", value_parser = branch_table::path)]
    out: Option<PathBuf>,

    /// Draw the largest |x| over the parameter to FILE (.svg or .png)
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Replace existing files of --out and --plot
    #[arg(long)]
    force: bool,
}

const AFTER_HELP: &str = "\
Examples:
  damprig continue host/continuations/clearance.toml
  damprig continue host/continuations/clearance.toml --plot branches.svg --out branches.csv
  damprig continue host/continuations/clearance.toml --json

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or a file is wrong, or there is no periodic orbit to start from; nothing was written";

/// Runs the subcommand.
///
/// # Errors
/// Bad input, no orbit to start from, an unwritable file.
pub fn run(args: &Args) -> Outcome {
    let continuation = Continuation::read(&args.file).map_err(Failure::input)?;
    let outputs = [("--out", &args.out), ("--plot", &args.plot)];
    for (role, file) in outputs {
        if let Some(file) = file
            && !args.force
            && file.symlink_metadata().is_ok()
        {
            let message = format!("{role}: cannot write {}: {EXISTS}\n  nothing was written", file.display());
            return Err(Failure::Input(message));
        }
        let same = |input: &PathBuf| file.as_ref().is_some_and(|f| f.canonicalize().ok() == input.canonicalize().ok());
        if file.as_ref().is_some_and(|f| f.exists()) && (same(&args.file) || same(&continuation.case_file)) {
            return Err(Failure::Input(format!(
                "{role} would overwrite an input file\n  give another file name; nothing was written"
            )));
        }
    }
    let found = continuation.follow().map_err(Failure::input)?;
    if args.json {
        say!("{}", serde_json::to_string(&found).map_err(Failure::failed)?);
    } else {
        say!("{}", terminal::continuation::text(&found));
    }
    if let Some(path) = &args.out {
        let rows = branch_table::write(&found, &OutFile { path: path.clone(), force: args.force });
        let rows = rows.map_err(Failure::failed)?;
        if !args.json {
            say!("Table: {} ({rows} orbits)", path.display());
        }
    }
    if let Some(path) = &args.plot {
        branches::draw(&found).and_then(|picture| picture.save(path)).map_err(Failure::failed)?;
        if !args.json {
            say!("Figure: {}", path.display());
        }
    }
    Ok(())
}
