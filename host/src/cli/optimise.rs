//! `damprig optimise`: looks for the values of a case's keys at which a metric is best.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::arguments::{ForceArg, JsonArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::progress::StudyBar;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::optimise::evaluate::Evaluated;
use crate::optimise::run::{self, Reached};
use crate::optimise::{Optimisation, table};
use crate::report::numbers::{about, duration, significant};
use crate::report::{documents, optimum_files};

/// Looks for the values of a case's keys at which a metric is best over a band, and says how sure they are.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct OptimiseArgs {
    /// Optimisation file (TOML), or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "FILE")]
    file: PathBuf,

    #[command(flatten)]
    json: JsonArg,

    /// Write the page, the answer (JSON), all evaluated points and the neighbourhood of the optimum (Parquet) to a new folder
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,

    /// Print variables, points, simulations and estimated time, and search nothing
    #[arg(long)]
    dry_run: bool,
}

const AFTER_HELP: &str = "\
Examples:
  damprig optimise spid-band
  damprig optimise hybrid-band --out optimum
  damprig optimise boring-bar --out boring-bar      # tolerances, uncertain restitution, other dampers
  damprig optimise my-optimisation.toml --json

The values of the answer can be made: steps, listed values, or digits that the tolerances leave (by default 0.1 % of the value). With a
stated tolerance or an uncertain key the objective counts over all of them, by default the worst. The answer does not depend on the number of threads. Ctrl-C ends the search, or what follows it; the best point so far is kept.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line, the file or its case is wrong, or no point keeps the constraints
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the best point so far is kept";

/// Runs the subcommand.
///
/// # Errors
/// Bad input, constraints that no point keeps, an unwritable file, an interrupted search.
pub fn run(args: &OptimiseArgs) -> Outcome {
    let file = examples::find(FileKind::Optimisation, &args.file)?;
    let optimisation = Optimisation::read(&file)?;
    if let Some(folder) = args.out.as_ref().filter(|_| !args.force.is_given()) {
        table::check_folder(folder)?;
    }
    let cores = rayon::current_num_threads();
    let estimate_s = run::estimate_s(&optimisation)? / cores as f64;
    let scope = format!("{}; {} on {cores} cores", documents::optimum::scope(&optimisation), about(estimate_s));
    if args.dry_run {
        say!("{scope}");
        return Ok(());
    }
    if !args.json.is_given() {
        say!("{scope}");
    }
    let ctrl_c = CtrlC::watch()?;
    let (start, bar) = (Instant::now(), StudyBar::new(&optimisation.name, run::about(&optimisation)));
    let report = |reached: Reached| {
        let objective =
            |best: &Evaluated| format!("{} {}", optimisation.objective.name(), significant(best.objective, 5));
        bar.set_length(reached.about);
        bar.reach(reached.simulations, reached.best.map(objective).as_deref());
        !ctrl_c.is_pressed()
    };
    let (found, answer) = run::run(&optimisation, &report)?;
    bar.end();
    args.json.print(&answer)?;
    say!("{}", documents::optimum::answer(&optimisation, &answer));
    let took = duration(start.elapsed().as_secs_f64());
    say!("\n{} points, {} simulations in {took}", answer.evaluations, answer.simulations);
    if let Some(folder) = &args.out {
        table::write(&optimisation, &found, &answer, folder)?;
        optimum_files::write(&optimisation, &answer, &scope, folder)?;
        say!("Page:  {}", folder.join(optimum_files::PAGE).display());
    }
    if answer.is_stopped && !found.is_stopped {
        let message = "stopped after the search: the optimum is above; what is around it, its front, or an alternative is not complete";
        return Err(Failure::Interrupted(message.into()));
    }
    if answer.is_stopped {
        let (done, all) = (answer.evaluations, optimisation.evaluations);
        return Err(Failure::Interrupted(format!("stopped after {done} of {all} points; the best so far is above")));
    }
    if !answer.is_feasible {
        return Err(Failure::Input(documents::optimum::unkept(&optimisation, &answer, &file)));
    }
    Ok(())
}
