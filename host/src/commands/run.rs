//! `damprig run`: a campaign, from the file to the figure.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args as ClapArgs;

use super::progress::Progress;
use super::{Failure, Outcome, report};
use crate::campaign::Campaign;
use crate::link::Address;
use crate::prediction::{self, Prediction};
use crate::recording::manifest::{Clock, Ending, Manifest, SetUpRecord};
use crate::recording::{RunFolder, checksum};
use crate::run::{Run, RunError, Selection, device_record};
use crate::session::Session;

/// Runs every set-up of the campaign through its experiments and records what the rig reports.
///
/// Before anything moves the campaign is checked, and every set-up is simulated to see that it stays within
/// the sensors' range.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Campaign file (TOML); host/campaigns/hybrid.toml shows what can be said
    #[arg(value_name = "CAMPAIGN.toml")]
    campaign: PathBuf,

    /// The rig: virtual, virtual:f32 (the board's precision), tcp:HOST:PORT or serial:PATH
    #[arg(long, value_name = "RIG", default_value = "virtual")]
    rig: Address,

    /// Folder for this run, new or empty [default: runs/<date>-<campaign>-<short id>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Check the campaign and predict the displacements, then stop
    #[arg(long)]
    dry_run: bool,

    /// Do not wait for a person to mount each set-up (a rig with a real structure only)
    #[arg(long)]
    yes: bool,

    /// Seconds of silence after which the device counts as gone
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    timeout: f64,
}

const AFTER_HELP: &str = "\
Examples:
  damprig run host/campaigns/hybrid.toml
  damprig run my.toml --dry-run
  damprig run my.toml --rig serial:/dev/ttyACM0 --out results/foam-1
  damprig run host/campaigns/short.toml --rig tcp:127.0.0.1:4000

The run folder holds campaign.toml, manifest.json, results.parquet, samples.parquet, figure.svg and figure.png.

Exit codes:
  0    every point was taken
  1    the run is incomplete: the rig, the link or the disk failed; what was taken is in the run folder
  2    the command line or the campaign is wrong; nothing has moved
  130  interrupted (Ctrl-C); the rig was stopped, what was taken is in the run folder";

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=86_400.0).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0.1 to 86400".into()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, a failed or an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let campaign = Campaign::read(&args.campaign).map_err(input)?;
    let predictions = prediction::predict(&campaign).map_err(input)?;
    println!("Campaign {} ({})", campaign.name, args.campaign.display());
    println!("{}", report::plan(&campaign, &predictions));
    prediction::check(&campaign, &predictions).map_err(input)?;
    if args.dry_run {
        println!("All set-ups stay within ±{} mm. Nothing was moved.", campaign.rig.displacement_limit_m * 1e3);
        return Ok(());
    }
    let stop = Arc::new(AtomicBool::new(false));
    super::watch_for_ctrl_c(&stop)?;
    let timeout = Duration::from_secs_f64(args.timeout);
    let mut session = Session::open(&args.rig, timeout).map_err(|e| Failure::Failed(e.to_string()))?;
    carry_out(args, &campaign, &predictions, &mut session, &stop)
}

fn input(error: impl std::fmt::Display) -> Failure {
    Failure::Input(error.to_string())
}

fn carry_out(
    args: &Args,
    campaign: &Campaign,
    predictions: &[Prediction],
    session: &mut Session,
    stop: &AtomicBool,
) -> Outcome {
    let started = jiff::Zoned::now();
    let failed = |e: &dyn std::fmt::Display| Failure::Failed(e.to_string());
    let selection = Selection::of(campaign, session).map_err(|e| failure(&e, ""))?;
    let mut folder = match &args.out {
        Some(path) => RunFolder::create_at(path),
        None => RunFolder::create_dated(Path::new("."), &campaign.name, &started),
    }
    .map_err(|e| failed(&e))?;
    let records = predictions.iter().map(|p| SetUpRecord::new(&campaign.set_ups[p.set_up], p.swing.max_x_m)).collect();
    let mut manifest = Manifest::begin(campaign, records, &started);
    let device = device_record(session);
    println!("Rig {}: {} (firmware {}), tick {} Hz", device.link, device.board, device.firmware, device.tick_hz);
    manifest.device = Some(device);

    let wall = Instant::now();
    let mut progress = Progress::new(campaign, args.yes);
    manifest.signals = selection.signals.clone();
    let run = Run::new(campaign, session, &mut folder, &mut progress, stop, selection);
    let begun = run.begin(campaign.source.text(), &manifest);
    let (tally, result) = match begun {
        Ok(run) => run.carry_out(),
        Err(error) => (Default::default(), Err(error)),
    };
    progress.end();
    let clock = Clock { rig_s: tally.rig_s, wall_s: wall.elapsed().as_secs_f64() };
    manifest.clock = clock;
    manifest.counters = tally.counters;
    manifest.points_taken = folder.rows().len();
    manifest.sample_rows = folder.sample_rows();
    let closed = folder.close();
    let result = result.and(closed.map_err(RunError::from));
    manifest.ending = match &result {
        Ok(()) => Ending::Complete,
        Err(error) => Ending::Incomplete { reason: error.to_string() },
    };
    let drawn = report::figure(campaign, folder.rows()).and_then(|picture| picture.write(folder.path(), "figure"));
    let sums = checksum::of_folder(folder.path());
    manifest.files = sums.clone().unwrap_or_default();
    let written = folder.write_manifest(&manifest).and(sums.map(|_| ()));
    println!("{}", report::results(campaign, folder.rows()));
    println!("{}", report::summary(&manifest));
    println!("Run folder: {}", folder.path().display());
    if let Err(error) = &result {
        let kept = format!(
            "\n  {} of {} points are kept in {}",
            manifest.points_taken,
            manifest.points_planned,
            folder.path().display()
        );
        return Err(failure(error, &kept));
    }
    written.map_err(|e| failed(&e))?;
    drawn.map_err(|e| failed(&e))
}

/// A run's error with what is kept, under its exit code.
fn failure(error: &RunError, kept: &str) -> Failure {
    let message = format!("{error}{kept}");
    match error {
        RunError::Refused(_) => Failure::Input(message),
        RunError::Interrupted => Failure::Interrupted(message),
        _ => Failure::Failed(message),
    }
}
