//! `damprig compare`: compares a run with simulations of its set-ups.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use clap::Args;

use super::arguments::{ForceArg, JsonArg, positive};
use super::ctrl_c::CtrlC;
use super::progress::bar;
use crate::campaign::Campaign;
use crate::compare::{CompareOptions, Comparison, compare};
use crate::failure::{Failure, Outcome};
use crate::report::exports::comparison::write_csv;
use crate::report::figures::force_surface;
use crate::report::force_surface::ForceSurface;
use crate::report::page::comparison::{Sheets, comparison_page};
use crate::report::terminal;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy::{self, new_campaign};
use crate::run_folder::read::folder::find;
use crate::storage::create_folder;
use crate::storage::out_file::{to_failure, write_new};

/// Compares a run with simulations of its set-ups, with uncertainties and normalised errors.
///
/// Each point is simulated over the same ticks, on the run's own measured base motion and on the ideal one. For the measured one the run
/// needs z at every tick: in [telemetry] rate_hz = 1000, with "x" and "z" in signals. docs/COMPARE.md describes the method.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct CompareArgs {
    /// Run folder, its name, or the short id at the end of the name
    #[arg(value_name = "RUN")]
    run: PathBuf,

    /// Write comparison.html, comparison.csv and comparison.json to this folder
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    json: JsonArg,

    /// Simulate the set-ups of this campaign instead of the run's own of the same names, for example with identified parameters
    #[arg(long, value_name = "CAMPAIGN")]
    set_ups: Option<PathBuf>,

    /// Relative standard uncertainty of the scales of both displacement sensors, from their calibration [default: from the
    /// simulated sensors; 0.15 % of a real rig]
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    scale_uncertainty: Option<f64>,

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig compare runs/20261121-041624-hybrid-k3x9
  damprig compare k3x9 --out k3x9-compared
  damprig compare k3x9 --set-ups identified-campaign.toml --json

A difference is a result: the exit code is 0 whether or not measured and predicted agree.

Exit codes:
  0    success
  1    a part of the run cannot be read (the rest is compared), or a file could not be written
  2    the command line or the campaign is wrong, or there is no such run; nothing was written
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); nothing was written";

/// How often progress is told without a terminal.
const TELL_EVERY: Duration = Duration::from_secs(10);

/// Names of the files of `--out`.
const FILES: [&str; 3] = ["comparison.html", "comparison.csv", "comparison.json"];

/// Runs the subcommand.
///
/// # Errors
/// No such run, a damaged run, a wrong campaign, an unwritable file, an interruption.
pub fn run(args: &CompareArgs) -> Outcome {
    let path = find(&args.run)?;
    if let Some(out) = &args.out {
        check_target(out, args.force)?;
    }
    let set_ups = args.set_ups.as_ref().map(|file| new_campaign(file)).transpose()?;
    let run = RunFolder::open(&path)?;
    let comparison = compared(&run, set_ups, args.scale_uncertainty)?;
    args.json.print(&comparison)?;
    say!("Run {} ({}), set-ups of {}", comparison.run, comparison.state, comparison.set_ups_from);
    say!("{}", terminal::comparison::text(&comparison));
    let sheets = sheets(&run, &comparison)?;
    sheets.iter().flat_map(|sheets| &sheets.folds).for_each(|line| say!("{line}"));
    if let Some(out) = &args.out {
        write(&comparison, sheets, out, args.force)?;
        say!("Page, table and JSON: {}", out.display());
    }
    if comparison.unreadable.is_empty() {
        return Ok(());
    }
    let missing = comparison.unreadable.join("\n  not compared: ");
    Err(Failure::Failed(format!("a part of the run cannot be read; the rest is compared\n  not compared: {missing}")))
}

/// Rejects a folder with files of an earlier comparison, unless they are to be replaced.
fn check_target(out: &Path, force: ForceArg) -> Outcome {
    if out.exists() && !out.is_dir() {
        return Err(Failure::Input(format!("--out: {} is a file; give a folder", out.display())));
    }
    FILES.iter().try_for_each(|name| force.check(&out.join(name)))
}

/// Compares with a progress bar.
fn compared(
    run: &RunFolder,
    set_ups_from: Option<Campaign>,
    scale_uncertainty: Option<f64>,
) -> Result<Comparison, Failure> {
    let ctrl_c = CtrlC::watch()?;
    let done = AtomicUsize::new(0);
    let options = CompareOptions { scale_uncertainty, done: &done, stop: ctrl_c.flag() };
    let points = run.manifest().points_taken as u64;
    let bar = bar(points);
    bar.set_message("simulating");
    let mut told = Instant::now();
    let comparison = std::thread::scope(|scope| {
        let work = scope.spawn(|| compare(run, set_ups_from, &options));
        while !work.is_finished() {
            let so_far = done.load(Ordering::Relaxed) as u64;
            if so_far > bar.position() {
                bar.set_position(so_far);
            }
            if bar.is_hidden() && told.elapsed() > TELL_EVERY {
                told = Instant::now();
                let left_s = bar.eta().as_secs();
                let left = if so_far > 0 { format!(", about {left_s} s left") } else { String::new() };
                warn!("{so_far} of {points} points are compared{left}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        work.join()
    });
    bar.finish_and_clear();
    comparison.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// The sheets of the run before the motions of its model; none without a response that was kept.
fn sheets(run: &RunFolder, comparison: &Comparison) -> Result<Option<Sheets>, Failure> {
    if comparison.continued.is_empty() {
        return Ok(None);
    }
    let campaign = campaign_copy::campaign(run.path())?;
    let surfaces = ForceSurface::of(&campaign, &run.result_rows()?);
    Ok((!surfaces.is_empty()).then(|| Sheets {
        picture: force_surface::draw(&campaign, &surfaces, &comparison.continued),
        folds: force_surface::folds_compared(&campaign, &surfaces, &comparison.continued),
    }))
}

fn write(comparison: &Comparison, sheets: Option<Sheets>, out: &Path, force: ForceArg) -> Outcome {
    create_folder(out)?;
    let page = comparison_page(comparison, sheets);
    let mut table = Vec::new();
    write_csv(comparison, &mut table).map_err(Failure::failed)?;
    let json = serde_json::to_vec_pretty(comparison)?;
    for (name, bytes) in FILES.iter().zip([page.as_bytes(), &table, &json]) {
        let file = force.file(&out.join(name));
        let failed = to_failure(&file.path);
        write_new(&file, |to| to.write_all(bytes).map_err(|error| failed(&error)))?;
    }
    Ok(())
}
