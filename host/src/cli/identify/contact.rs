//! `damprig identify contact`: contact time, pulse factor and stiffness of a hard wall.

use std::path::PathBuf;

use clap::Args;

use super::super::arguments::positive;
use super::{ChoiceArgs, OutArgs, finish};
use crate::failure::{Failure, Outcome};
use crate::identify::table::NumberTable;
use crate::identify::{Identification, contact};
use crate::run_folder::read::folder::find;

/// Contact time of a hard wall, from the pulses of a run or from force records; stiffness, and of records the pulse factor.
///
/// Columns of a force record: t_s and force_n, from before the pulse until after it. A file may have several pulses; several files are
/// taken together.
#[derive(Debug, Args)]
pub(super) struct ContactArgs {
    /// Run folder, or CSV files
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<PathBuf>,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// Of force records: mM/(M + m) of particle and structure, for the stiffness
    #[arg(long, value_name = "KG", value_parser = positive)]
    reduced_mass_kg: Option<f64>,

    #[command(flatten)]
    out: OutArgs,
}

/// Identifies from the sources, prints the results and writes the file.
///
/// # Errors
/// Sources from which nothing can be identified, an unwritable file.
pub(super) fn run(args: &ContactArgs) -> Outcome {
    args.out.check(&args.sources, &[])?;
    finish(&args.out, identify(args)?)
}

fn identify(args: &ContactArgs) -> Result<Identification, Failure> {
    let refused = |option: &str, what: &str| {
        Err(Failure::Input(format!(
            "{option} is for {what}, and {} is none\n  leave it out",
            args.sources[0].display()
        )))
    };
    if args.sources.iter().all(|source| source.is_file()) {
        if args.choice.set_up.is_some() || args.choice.experiment.is_some() {
            return refused("--set-up or --experiment", "a run");
        }
        let tables: Result<Vec<NumberTable>, Failure> =
            args.sources.iter().map(|source| NumberTable::read(source)).collect();
        return contact::of_records(&tables?, args.reduced_mass_kg);
    }
    if args.reduced_mass_kg.is_some() {
        return refused("--reduced-mass-kg", "force records");
    }
    let [source] = &args.sources[..] else {
        let text = "a run is identified by itself\n  give several sources only where all are CSV files that exist";
        return Err(Failure::Input(text.into()));
    };
    let path = find(source)?;
    contact::of_run(&path, &args.choice.choice())
}
