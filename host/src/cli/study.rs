//! `damprig study`: runs a study and keeps its table.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Subcommand};

use super::arguments::{JsonArg, QuietArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::progress::StudyBar;
use super::study_figures::say_result;
use super::study_work;
use super::{basins, bifurcation};
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::report::documents;
use crate::report::numbers::{about, duration, significant};
use crate::study::Study;
use crate::study::data_set::{DataSet, StudyManifest};
use crate::study::run::{self, StudyEnding, StudyProgress};
use crate::study::store::Store;

/// Runs studies: a case over many values of its keys.
#[derive(Debug, Args)]
pub struct StudyArgs {
    #[command(subcommand)]
    what: StudyCommand,
}

#[derive(Debug, Subcommand)]
enum StudyCommand {
    /// Run a study on all cores; goes on where an earlier run stopped
    Run(StudyRunArgs),
    /// Compute a share of a study as one of several workers
    Work(study_work::WorkArgs),
    /// Show how far the workers of a study are (exit code 1 if a part is wrong)
    Status(study_work::PlaceArgs),
    /// Read all files of a study and check them (exit code 1 if one is wrong or missing)
    Verify(study_work::PlaceArgs),
    /// Join the parts of a study to its table
    Merge(study_work::MergeArgs),
    /// Draw a bifurcation diagram: sweep a key of a case up and down
    Bifurcation(bifurcation::BifurcationArgs),
    /// Draw basins of attraction: which motion each start ends on
    Basins(basins::BasinsArgs),
}

/// Runs a study on all cores and writes its table; goes on where an earlier run stopped.
#[derive(Debug, Args)]
#[command(after_help = RUN_HELP)]
struct StudyRunArgs {
    /// Study file (TOML), or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "STUDY")]
    study: PathBuf,

    /// Folder of the results [default: studies/ and the name of the file]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Print points, simulations, cycles, parts and estimated time, and simulate nothing more
    #[arg(long, conflicts_with_all = ["quiet", "json"])]
    dry_run: bool,

    /// Start although the estimate is more than a day
    #[arg(long)]
    long: bool,

    #[command(flatten)]
    quiet: QuietArg,

    #[command(flatten)]
    json: JsonArg,
}

const RUN_HELP: &str = "\
Examples:
  damprig study run clearance-and-restitution
  damprig study run my-study.toml --dry-run
  damprig study run my-study.toml --out /data/my-study

The folder gets table.parquet, a row for each point, with units and the study in its metadata: pandas, polars and
DuckDB read it as it is. A study whose [sampling] is for sensitivity indices also gets sensitivity.parquet, and a table and
a figure of them. Ctrl-C stops after the points being computed, a second one at once; the same
command goes on.

Exit codes:
  0    success
  1    a file could not be written, or a part is damaged; the other parts are kept
  2    the command line, the study or its case is wrong
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the results so far are kept";

/// Estimated time above which a study starts only with --long, s.
const DAY_S: f64 = 86_400.0;

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &StudyArgs) -> Outcome {
    match &args.what {
        StudyCommand::Run(args) => run_study(args),
        StudyCommand::Work(args) => study_work::work(args),
        StudyCommand::Status(args) => study_work::status(args),
        StudyCommand::Verify(args) => study_work::verify(args),
        StudyCommand::Merge(args) => study_work::merge(args),
        StudyCommand::Bifurcation(args) => bifurcation::run(args),
        StudyCommand::Basins(args) => basins::run(args),
    }
}

fn run_study(args: &StudyRunArgs) -> Outcome {
    args.quiet.apply();
    let file = examples::find(FileKind::Study, &args.study)?;
    let study = Study::read(&file)?;
    let cores = rayon::current_num_threads();
    let estimate_s = run::estimate_s(&study)? / cores as f64;
    let scope = documents::study::scope(&study, run::cycles(&study));
    study.settling()?.iter().for_each(|text| warn!("warning: {text}"));
    if args.dry_run {
        say!("{scope}; parts: {}", StudyManifest::of(&study).parts());
        say!("{} on {cores} cores", about(estimate_s));
        return Ok(());
    }
    if estimate_s > DAY_S && !args.long {
        return Err(Failure::Input(format!(
            "{}: {scope}: about {} on {cores} cores\n  start it with --long, or make it smaller; nothing was written",
            args.study.display(),
            duration(estimate_s)
        )));
    }
    let place = place(&args.study, args.out.as_deref());
    let data_set = DataSet::open(&study, Store::at(&place)?)?;
    let ctrl_c = CtrlC::watch()?;
    if !args.json.is_given() {
        say!("{scope}; {} on {cores} cores", about(estimate_s));
    }
    let (start, bar) = (Instant::now(), StudyBar::new(&study.name, study.rows()));
    let report = |progress: &StudyProgress| {
        let best = progress.best.map(|(_, value)| format!("{} {}", study.objective.name(), significant(value, 5)));
        bar.reach(progress.done, best.as_deref());
        !ctrl_c.is_pressed()
    };
    let ending = run::run(&study, &data_set, &report);
    bar.end();
    let (ending, last) = ending.map_err(|error| kept(&data_set, error))?;
    if ending == StudyEnding::Stopped {
        return Err(Failure::Interrupted(format!(
            "stopped after {} of {} points; the same command goes on with them",
            last.done, last.rows
        )));
    }
    let table = data_set.join(&study, |_, _| ()).map_err(|error| kept(&data_set, error))?;
    say_result(&study, &data_set, &last, (&table, start), args.json)
}

/// A failure with what is there already, and how to go on.
pub(super) fn kept(data_set: &DataSet, error: Failure) -> Failure {
    let parts = data_set.parts().map_or(0, |parts| parts.len());
    if parts == 0 || !matches!(error, Failure::Disk(_)) {
        return error;
    }
    let (all, place) = (data_set.manifest().parts(), data_set.store().path(""));
    error.with(|error| {
        format!(
            "{error}\n  {parts} of {all} parts are kept in {}: when it can be written (a full disk: free space), the same command goes on \
             with them",
            place.display()
        )
    })
}

/// Where the results of a study are.
pub(super) fn place(study: &Path, out: Option<&Path>) -> PathBuf {
    let name = crate::simulation::case::default_name(study);
    out.map_or_else(|| PathBuf::from("studies").join(name), Path::to_path_buf)
}
