//! `damprig simulate`: a case, from the file to the figures.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args as ClapArgs;

use super::{Failure, Outcome};
use crate::simulation::{Case, simulate};

/// Simulates a case exactly: every impact, stick and slip at its instant.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// Case file (TOML or JSON)
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// Print the whole answer as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file or an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let case = Case::read(&args.case).map_err(|e| Failure::Input(e.to_string()))?;
    let stop = AtomicBool::new(false);
    let answer = simulate(&case, &mut (), &stop).map_err(|e| Failure::Input(e.to_string()))?;
    if args.json {
        println!("{}", serde_json::to_string(&answer).map_err(|e| Failure::Failed(e.to_string()))?);
    }
    Ok(())
}
