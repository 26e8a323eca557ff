//! `damprig run`: checks a campaign, predicts its displacements, runs or resumes it. [`super::run_job`] does the run itself.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;
use damprig_protocol::ClockSource;

use super::arguments::{QuietArg, Rig, SpeedArg, seconds, seconds_or_zero};
use super::consent::ConsentArg;
use super::ctrl_c::CtrlC;
use super::examples;
use super::monitor::{PageArgs, check_terminal};
use super::output::is_quiet;
use super::run_job::{Job, LiveViews};
use super::run_progress::LogFile;
use crate::campaign::Campaign;
use crate::client::board_check;
use crate::client::link::Address;
use crate::client::session::Session;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::host_time;
use crate::prediction::{CampaignPrediction, settling};
use crate::recorded_run::begin_entry;
use crate::report::compared;
use crate::report::numbers::duration;
use crate::report::terminal;
use crate::run_folder::RunFolder;
use crate::run_folder::journal::{self, Journal};
use crate::run_folder::read::campaign_copy::new_campaign;
use crate::run_folder::read::folder::find;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::write::OutputFolder;
use crate::run_folder::write::output_folder::is_unused;
use crate::runner::rehearsal::accept;
use crate::runner::resume::EarlierRun;

/// Runs the experiments of a campaign on all its set-ups and records them in a run folder.
///
/// Before anything moves, the campaign is checked, its limits are compared with those of the board (a campaign may only tighten
/// them), and every set-up is simulated to check that it stays within the limits.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = AFTER_HELP)]
pub struct RunArgs {
    /// Campaign file (TOML), or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "CAMPAIGN.toml", required_unless_present = "resume")]
    campaign: Option<PathBuf>,

    /// Rig: auto (the only connected board), serial:PATH, tcp:HOST:PORT, virtual, virtual:f32 (the board's precision),
    /// virtual:BOARD.toml or virtual:f32,BOARD.toml (with settings from a file, as written by `damprig settings export`),
    /// virtual:realtime, virtual:realtime,f32, virtual:realtime,BOARD.toml (the same at the pace of the wall clock)
    /// [default: virtual; with --resume the rig of the run]
    #[arg(long, value_name = "RIG")]
    rig: Option<Rig>,

    #[command(flatten)]
    speed: SpeedArg,

    /// New or empty folder for this run [default: runs/<date>-<campaign>-<short id>]
    #[arg(long, value_name = "FOLDER", conflicts_with = "resume")]
    out: Option<PathBuf>,

    /// Resume the run in this folder. Measured points are kept and the interrupted point is repeated; a sweep with
    /// start = "carry_over" is repeated from its first frequency
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["campaign", "dry_run"])]
    resume: Option<PathBuf>,

    /// Check the campaign, print every parameter of its set-ups and predict the displacements, without running it. With --rig the settings of that rig are read
    /// and nothing is changed on it; without, the settings are those of a board as delivered
    #[arg(long, conflicts_with = "quiet")]
    dry_run: bool,

    /// Do not ask for confirmation that each set-up is mounted (real structures only); a rig that is not at rest then is told and
    /// noted, and the run goes on
    #[arg(long)]
    yes: bool,

    #[command(flatten)]
    consent: ConsentArg,

    /// Time without a message after which the link counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    timeout: f64,

    /// Show the run live on a page in the browser; its address is printed
    #[arg(long, conflicts_with = "dry_run")]
    monitor: bool,

    #[command(flatten)]
    page: PageArgs,

    /// Show the run live in this terminal: numbers, curves, alarms; s stops it
    #[arg(long, conflicts_with_all = ["dry_run", "quiet"])]
    tui: bool,

    #[command(flatten)]
    quiet: QuietArg,

    /// Append what happens in the run to this file, a line each with the time: starts, results, the link, the spring
    #[arg(long, value_name = "FILE", conflicts_with = "dry_run")]
    log: Option<PathBuf>,

    /// Time to try to reconnect to a link lost during a run; 0 to give up at once
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds_or_zero)]
    reconnect_s: f64,
}

const USAGE: &str = "damprig run [OPTIONS] <CAMPAIGN.toml>\n       damprig run [OPTIONS] --resume <FOLDER>";

const AFTER_HELP: &str = "\
Examples:
  damprig run hybrid
  damprig run my.toml --dry-run
  damprig run my.toml --rig serial:/dev/ttyACM0 --out results/foam-1
  damprig run short --rig tcp:127.0.0.1:4000
  damprig run short --rig virtual:realtime --speed 5
  damprig run --resume results/foam-1

The first line says which settings act: where they come from, and the board's limits. If saved
settings do not act (damaged, of another layout), nothing moves without --accept-settings.

The run folder has campaign.toml, manifest.json, journal.jsonl, results.parquet, samples.parquet,
figure.svg, figure.png and report.html; with a stepped sine whose x is recorded also motions.svg
and motions.png; with responses that are kept force-surface.svg and force-surface.png; with a tracked resonance resonance.csv,
resonance.svg and resonance.png; with playbacks, impulses or free vibrations also transients.parquet,
transients.svg and transients.png. Until the run is complete, samples.parts/
stands in for samples.parquet.

Exit codes:
  0    every point was measured
  1    the rig, the link or the disk failed; the run is incomplete, --resume continues it
  2    the command line or the campaign is wrong; nothing has moved
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the rig was stopped, --resume continues the run";

impl RunArgs {
    fn live_views(&self, rig: &Address, stop: &Arc<AtomicBool>) -> Result<Option<LiveViews>, Failure> {
        LiveViews::start(self.monitor.then_some(&self.page), self.tui, self.yes, rig, stop)
    }

    fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout)
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, a failed or an interrupted run.
pub fn run(args: &RunArgs) -> Outcome {
    if args.page.is_given() && !args.monitor {
        return Err(Failure::Input("--listen and --control are options of the live page: give --monitor too".into()));
    }
    check_terminal(args.tui)?;
    args.quiet.apply();
    match (&args.resume, &args.campaign) {
        (Some(folder), _) => resume(args, folder),
        (None, Some(campaign)) => begin(args, campaign),
        (None, None) => Err(Failure::Input("give a campaign, or --resume with a run folder".into())),
    }
}

fn begin(args: &RunArgs, file: &Path) -> Outcome {
    refuse_taken(args.out.as_deref())?;
    let file = &examples::find(FileKind::Campaign, file)?;
    let mut campaign = new_campaign(file)?;
    campaign.source.warnings().iter().for_each(|warning| warn!("warning: {warning}"));
    let rig = args.speed.apply(args.rig.as_ref().unwrap_or(&Rig::At(Address::VIRTUAL)).find()?)?;
    let mut session = open(&rig, args)?;
    let (selection, warnings) = accept(&mut campaign, &session)?;
    args.consent.check(&mut session, "this campaign is refused")?;
    let points = campaign.points();
    let (shortest, longest) = (duration(campaign.expected_s()), duration(campaign.longest_s()));
    let time = if shortest == longest { format!("about {shortest}") } else { format!("{shortest} to {longest}") };
    let plural = if points == 1 { "" } else { "s" };
    say!("Campaign {} ({}): {points} point{plural}, {time} of rig time", campaign.name, file.display());
    warnings.iter().for_each(|warning| warn!("warning: {warning}"));
    if args.dry_run {
        terminal::set_ups::parameters(&campaign).iter().for_each(|table| say!("{table}"));
        terminal::campaign::steps(&campaign).iter().for_each(|line| say!("{line}"));
    }
    terminal::campaign::what_moves(&campaign).iter().for_each(|line| say!("{line}"));
    let predicted = CampaignPrediction::of(&campaign)?;
    settling::advice(&campaign).iter().for_each(|line| say!("{line}"));
    let largest = predicted.largest();
    if !largest.is_empty() {
        say!("{}", terminal::campaign::plan(&campaign, &largest));
    }
    if args.dry_run {
        terminal::campaign::peak_points(&campaign, &predicted.responses).iter().for_each(|line| say!("{line}"));
        terminal::campaign::unresolved_predictions(&campaign, &predicted.responses)
            .iter()
            .for_each(|line| say!("{line}"));
    }
    terminal::transients::plan(&campaign, &predicted.expected).iter().for_each(|plan| say!("{plan}"));
    check(&campaign, &predicted, &session)?;
    if args.dry_run {
        say!("{}", compared::IN_A_LINE);
        let which =
            if campaign.set_ups.iter().all(|s| s.is_predicted) { "All set-ups" } else { "All set-ups with a model" };
        say!("{which} stay within ±{} mm. Nothing has moved.", campaign.rig.structure_limit_m() * 1e3);
        say!("{}", settings_line(args, &session));
        return Ok(());
    }
    let ctrl_c = CtrlC::watch()?;
    let log = args.log.as_deref().map(LogFile::open).transpose()?;
    let live = args.live_views(&rig, ctrl_c.flag())?;
    let now = host_time::now();
    let folder = match &args.out {
        Some(path) => OutputFolder::create_at(path),
        None => OutputFolder::create_dated(Path::new("."), &campaign.name, &now),
    }?;
    let journal = folder.keep_campaign(&campaign)?;
    let records = folder.records(&campaign)?;
    let begin = begin_entry(&campaign, &session, &selection, records, &now);
    let job = Job {
        given_rig: args.rig.as_ref(),
        timeout: args.timeout(),
        reconnect_within: Duration::from_secs_f64(args.reconnect_s),
        mount_without_asking: args.yes,
        accept_settings: args.consent.is_given(),
        is_quiet: is_quiet(),
        rig,
        campaign: &campaign,
        predicted: &predicted,
        folder,
        live,
        log,
        taken: JournalState::default(),
        withdrawn: Vec::new(),
    };
    job.run(&mut session, selection, begin, journal, ctrl_c.flag())
}

/// Rejects a target that is a file or a folder with something in it.
fn refuse_taken(out: Option<&Path>) -> Outcome {
    let Some(out) = out.filter(|out| out.symlink_metadata().is_ok()) else { return Ok(()) };
    let why = match is_unused(out) {
        Ok(true) => return Ok(()),
        Ok(false) => "it is not empty; give --out a new folder, or continue the run in it with --resume",
        Err(_) => "it is no folder that can be read; give --out a new folder",
    };
    Err(Failure::Input(format!("cannot use the folder {}: {why}", out.display())))
}

fn resume(args: &RunArgs, wanted: &Path) -> Outcome {
    let path = find(wanted)?;
    // Holding the journal keeps other processes from changing the run.
    let held = match Journal::existing(&path) {
        Err(error) if journal::is_being_written(&path) == Some(true) => return Err(Failure::failed(error)),
        held => held,
    };
    let mut earlier = EarlierRun::read(&path).map_err(Failure::input)?;
    say!("Resuming {} (campaign {})", path.display(), earlier.campaign.name);
    for warning in &earlier.warnings {
        say!("warning: {warning}");
    }
    let is_over = RunFolder::open(&path).is_ok_and(|run| run.manifest().is_complete());
    if is_over && earlier.is_complete() {
        say!("The run is complete: all {} points are measured. Nothing was done.", earlier.journal.points());
        return Ok(());
    }
    earlier.intentions().iter().for_each(|line| say!("- {line}"));
    let rig = match (&args.rig, earlier.journal.begun.first()) {
        (Some(rig), _) => rig.find()?,
        (None, Some(begin)) => {
            Rig::At(begin.device.link.parse().map_err(|e| Failure::Input(format!("--rig: {e}")))?).find()?
        }
        (None, None) => Address::VIRTUAL,
    };
    let rig = args.speed.apply(rig)?;
    let mut session = open(&rig, args)?;
    let (selection, warnings) = accept(&mut earlier.campaign, &session)?;
    args.consent.check(&mut session, "the run is not resumed")?;
    warnings.iter().for_each(|warning| warn!("warning: {warning}"));
    let campaign = &earlier.campaign;
    let predicted = CampaignPrediction::of(campaign)?;
    check(campaign, &predicted, &session)?;
    let ctrl_c = CtrlC::watch()?;
    let log = args.log.as_deref().map(LogFile::open).transpose()?;
    let live = args.live_views(&rig, ctrl_c.flag())?;
    let folder = OutputFolder::existing(&path);
    let records = folder.records(campaign)?;
    let begin = begin_entry(campaign, &session, &selection, records, &host_time::now());
    let different = earlier.differences(&begin);
    if !different.is_empty() {
        let list = different.join("\n  ");
        let message = "use the rig of the run (--rig), or run the campaign again; nothing has moved";
        return Err(Failure::Input(format!(
            "cannot resume {}: the configuration has changed:\n  {list}\n  {message}",
            path.display()
        )));
    }
    for changed in earlier.changed_limits(&begin) {
        warn!("note: a limit of the board has changed: {changed}");
    }
    let journal = held.and_then(|held| held.map_or_else(|| Journal::open(&path), Ok))?;
    let job = Job {
        given_rig: args.rig.as_ref(),
        timeout: args.timeout(),
        reconnect_within: Duration::from_secs_f64(args.reconnect_s),
        mount_without_asking: args.yes,
        accept_settings: args.consent.is_given(),
        is_quiet: is_quiet(),
        rig,
        campaign,
        predicted: &predicted,
        folder,
        live,
        log,
        taken: earlier.journal.clone(),
        withdrawn: earlier.withdrawn.clone(),
    };
    job.run(&mut session, selection, begin, journal, ctrl_c.flag())
}

/// Rejects predicted displacements beyond limits, stroke or drive, and predicted forces far beyond the limit.
fn check(campaign: &Campaign, predicted: &CampaignPrediction, session: &Session) -> Outcome {
    let drive_m = f64::from(session.settings.calibration.drive.range().amplitude_m());
    let warnings = predicted.check(campaign, drive_m)?;
    warnings.iter().for_each(|warning| warn!("warning: {warning}"));
    Ok(())
}

/// Says with whose settings a campaign was checked.
fn settings_line(args: &RunArgs, session: &Session) -> String {
    if args.rig.is_none() {
        return "Checked with the settings of a board as delivered. `--rig RIG` checks with those of a rig, \
                `--rig virtual:BOARD.toml` with exported ones."
            .into();
    }
    let (board, link) = (&session.identity.board, session.name());
    format!("Checked with the settings of {board} at {link} ({}).", session.settings_origin())
}

fn open(rig: &Address, args: &RunArgs) -> Result<Session, Failure> {
    let session = Session::open(rig, args.timeout())?;
    say!("{}", session.settings_line());
    if let Some(crash) = session.description.last_crash {
        warn!(
            "note: the board restarted after a crash: {crash}\n  `addr2line -f -e IMAGE` with these addresses gives the source lines"
        );
    }
    for warning in board_check::warnings(&session) {
        warn!("note: {warning}");
    }
    if session.description.clock_source == ClockSource::InternalOscillator {
        warn!("note: the board's crystal did not start: its tick rate and all frequencies are off by up to 1 %");
    }
    Ok(session)
}
