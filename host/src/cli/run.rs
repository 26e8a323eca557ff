//! `damprig run`: a campaign, from the file to the figure.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args as ClapArgs;
use damprig_core::settings::Settings;
use damprig_protocol::{ClockSource, PlantKind};

use super::devices::Rig;
use super::progress::Progress;
use super::{Failure, Outcome};
use crate::campaign::Campaign;
use crate::client::link::Address;
use crate::client::session::Session;
use crate::prediction::transient::Expected;
use crate::prediction::{self, Prediction};
use crate::report::figures::campaign::{Shown, response};
use crate::report::page::page;
use crate::report::terminal::{campaign as report, transients as transient_report};
use crate::run_folder::RunFolder;
use crate::run_folder::checksum;
use crate::run_folder::journal::{self, Begin, Ended, Entry, Journal};
use crate::run_folder::read::folder::find;
use crate::run_folder::schema::acting_settings::acting_settings;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::{Durations, Ending, Manifest, SetUpRecord};
use crate::run_folder::write::writer::{Layout, Writer};
use crate::run_folder::write::{OutputFolder, Recorder};
use crate::runner::resume::EarlierRun;
use crate::runner::{Reconnect, Run, RunError, Selection, Tally, device_record};

/// Runs every set-up of the campaign through its experiments and records what the rig reports.
///
/// Before anything moves the campaign is checked, its limits are compared with the board's, which it may only tighten, and
/// every set-up is simulated to see that it stays within them.
#[derive(Debug, ClapArgs)]
#[command(override_usage = USAGE, after_help = AFTER_HELP)]
pub struct Args {
    /// Campaign file (TOML); host/campaigns/hybrid.toml shows what can be said
    #[arg(value_name = "CAMPAIGN.toml", required_unless_present = "resume")]
    campaign: Option<PathBuf>,

    /// The rig: virtual, virtual:f32 (the board's precision), virtual:BOARD.toml or virtual:f32,BOARD.toml (a board with the
    /// settings of a file, as `damprig settings export` writes it), tcp:HOST:PORT, serial:PATH, or auto for the only board that
    /// is plugged in
    /// [default: virtual; with --resume the rig that the run was begun on]
    #[arg(long, value_name = "RIG")]
    rig: Option<Rig>,

    /// Folder for this run, new or empty [default: runs/<date>-<campaign>-<short id>]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,

    /// Go on with the run in this folder: points that are taken are kept, the interrupted one is repeated from its
    /// beginning. A sweep that carries its motion over begins anew
    #[arg(long, value_name = "DIR", conflicts_with_all = ["campaign", "dry_run"])]
    resume: Option<PathBuf>,

    /// Check the campaign and predict the displacements, then stop. Its limits and its drive are compared with those of the
    /// virtual board, or, for another rig, with those as delivered: no other rig is connected to
    #[arg(long)]
    dry_run: bool,

    /// Do not wait for a person to mount each set-up (a rig with a real structure only)
    #[arg(long)]
    yes: bool,

    /// Seconds of silence after which the device counts as gone
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    timeout: f64,

    /// Seconds for which a link that is lost in mid-run is sought again; 0 to give up at once
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds_or_none)]
    reconnect_s: f64,
}

const USAGE: &str = "damprig run [OPTIONS] <CAMPAIGN.toml>\n       damprig run [OPTIONS] --resume <DIR>";

const AFTER_HELP: &str = "\
Examples:
  damprig run host/campaigns/hybrid.toml
  damprig run my.toml --dry-run
  damprig run my.toml --rig serial:/dev/ttyACM0 --out results/foam-1
  damprig run host/campaigns/short.toml --rig tcp:127.0.0.1:4000
  damprig run --resume results/foam-1

The run folder holds campaign.toml, manifest.json, journal.jsonl, results.parquet, samples.parquet, figure.svg,
figure.png and report.html; of records, pulses and free vibrations transients.parquet, transients.svg and transients.png;
samples.parts/ in the place of samples.parquet until the run is complete.

Exit codes:
  0    every point was taken
  1    the run is incomplete: the rig, the link or the disk failed; what was taken is in the run folder, and --resume goes on
  2    the command line or the campaign is wrong; nothing has moved
  130  interrupted (Ctrl-C, or asked to terminate); the rig was stopped, what was taken is in the run folder";

pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=86_400.0).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0.1 to 86400".into()),
    }
}

fn seconds_or_none(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=864_000.0).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0 to 864000".into()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, a failed or an interrupted run.
pub fn run(args: &Args) -> Outcome {
    match (&args.resume, &args.campaign) {
        (Some(folder), _) => resume(args, folder),
        (None, Some(campaign)) => begin(args, campaign),
        (None, None) => Err(Failure::Input("give a campaign, or --resume with the folder of a run".into())),
    }
}

fn begin(args: &Args, file: &Path) -> Outcome {
    let mut campaign = Campaign::read(file).map_err(input)?;
    campaign.check_simulable().map_err(input)?;
    let virtual_rig = Rig::At(Address::VIRTUAL);
    let rig = args.rig.as_ref().unwrap_or(&virtual_rig);
    // A dry run connects to the virtual rig alone, which is in this process.
    let is_asked = !args.dry_run || matches!(rig, Rig::At(Address::Virtual { .. }));
    let connected = if is_asked {
        let address = rig.find()?;
        let session = open(&address, args)?;
        put_on_board(&mut campaign, &session)?;
        Some((address, session))
    } else {
        campaign.on_board(&Settings::default(), false).map_err(input)?;
        None
    };
    let predictions = prediction::predict(&campaign).map_err(input)?;
    let expected = prediction::transient::predict(&campaign).map_err(input)?;
    say!("Campaign {} ({})", campaign.name, file.display());
    if !predictions.is_empty() {
        say!("{}", report::plan(&campaign, &predictions));
    }
    transient_report::plan(&campaign, &expected).iter().for_each(|plan| say!("{plan}"));
    check(&campaign, &predictions, &expected)?;
    let settings = connected.as_ref().map_or(Settings::default(), |(_, session)| session.settings);
    check_drive(&campaign, &expected, &settings)?;
    let Some((rig, mut session)) = connected.filter(|_| !args.dry_run) else {
        say!("All set-ups stay within ±{} mm. Nothing was moved.", campaign.rig.structure_limit_m() * 1e3);
        if !is_asked {
            say!(
                "Limits were compared with a board's as delivered; this board's own are compared when the campaign is run."
            );
        }
        return Ok(());
    };
    let stop = Arc::new(AtomicBool::new(false));
    super::watch_for_ctrl_c(&stop)?;
    let selection = Selection::of(&campaign, &session).map_err(|e| failure(&e, ""))?;
    let now = jiff::Zoned::now();
    let folder = match &args.out {
        Some(path) => OutputFolder::create_at(path),
        None => OutputFolder::create_dated(Path::new("."), &campaign.name, &now),
    }
    .map_err(failed)?;
    let journal = folder.claim().map_err(failed)?;
    folder.write_campaign(campaign.source.text()).map_err(failed)?;
    folder.keep_records(&campaign).map_err(failed)?;
    let begin = beginning(&campaign, &session, &selection, &now);
    let job = Job {
        args,
        rig,
        campaign: &campaign,
        farthest_m: farthest(&predictions, &expected),
        folder,
        taken: JournalState::default(),
    };
    job.carry_out(&mut session, selection, begin, journal, &stop)
}

fn resume(args: &Args, wanted: &Path) -> Outcome {
    let path = find(wanted).map_err(input)?;
    // From here on nobody else changes what is read.
    let held = match Journal::existing(&path) {
        Err(error) if journal::is_being_written(&path) == Some(true) => return Err(failed(error)),
        held => held,
    };
    let mut earlier = EarlierRun::read(&path).map_err(input)?;
    say!("Resuming {} (campaign {})", path.display(), earlier.campaign.name);
    for warning in &earlier.warnings {
        say!("WRONG  {warning}");
    }
    let is_over = RunFolder::open(&path).is_ok_and(|run| run.manifest().is_complete());
    if is_over && earlier.is_complete() {
        say!("The run is complete: all {} points are taken. Nothing was done.", earlier.campaign.points());
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
    let mut session = open(&rig, args)?;
    put_on_board(&mut earlier.campaign, &session)?;
    let campaign = &earlier.campaign;
    let predictions = prediction::predict(campaign).map_err(input)?;
    let expected = prediction::transient::predict(campaign).map_err(input)?;
    check(campaign, &predictions, &expected)?;
    let stop = Arc::new(AtomicBool::new(false));
    super::watch_for_ctrl_c(&stop)?;
    check_drive(campaign, &expected, &session.settings)?;
    let selection = Selection::of(campaign, &session).map_err(|e| failure(&e, ""))?;
    let begin = beginning(campaign, &session, &selection, &jiff::Zoned::now());
    let different = earlier.differences(&begin);
    if !different.is_empty() {
        let list = different.join("\n  ");
        let message = "use the rig that it was begun on (--rig), or run the campaign anew; nothing was moved";
        return Err(Failure::Input(format!("{} was begun in another way:\n  {list}\n  {message}", path.display())));
    }
    for changed in earlier.changed_limits(&begin) {
        warn!("note: a limit of the board has changed: {changed}");
    }
    let folder = OutputFolder::existing(&path);
    let journal = held.and_then(|held| held.map_or_else(|| Journal::open(&path), Ok)).map_err(failed)?;
    let job = Job {
        args,
        rig,
        campaign,
        farthest_m: farthest(&predictions, &expected),
        folder,
        taken: earlier.journal.clone(),
    };
    job.carry_out(&mut session, selection, begin, journal, &stop)
}

/// Compares the campaign's limits with those of the board that answers, and completes it by the board's settings.
fn put_on_board(campaign: &mut Campaign, session: &Session) -> Result<(), Failure> {
    let is_simulated = session.description.plant != PlantKind::Real;
    campaign.on_board(&session.settings, is_simulated).map_err(input)
}

/// Refuses what would leave limits or stroke.
fn check(campaign: &Campaign, predictions: &[Prediction], expected: &[Expected]) -> Result<(), Failure> {
    prediction::check(campaign, predictions).map_err(input)?;
    prediction::transient::check(campaign, expected).map_err(input)
}

/// Refuses what the rig's drive cannot deliver.
fn check_drive(campaign: &Campaign, expected: &[Expected], settings: &Settings) -> Result<(), Failure> {
    let drive_m = f64::from(settings.calibration.drive.range().amplitude_m());
    prediction::drive::check(campaign, expected, drive_m).map_err(input)
}

fn open(rig: &Address, args: &Args) -> Result<Session, Failure> {
    let session = Session::open(rig, Duration::from_secs_f64(args.timeout)).map_err(failed)?;
    if let Some(crash) = session.description.last_crash {
        warn!(
            "note: the board began anew after a crash: {crash}\n  addr2line -f -e IMAGE with these addresses tells the lines"
        );
    }
    if session.description.clock_source == ClockSource::InternalOscillator {
        warn!("note: the board's crystal did not start: its ticks, and every frequency, are off by up to 1 %");
    }
    Ok(session)
}

fn input(error: impl std::fmt::Display) -> Failure {
    Failure::Input(error.to_string())
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::Failed(error.to_string())
}

/// How the run begins, or goes on, now.
fn beginning(campaign: &Campaign, session: &Session, selection: &Selection, now: &jiff::Zoned) -> Begin {
    Begin {
        at: now.to_string(),
        damprig: crate::VERSION_LINE.to_string(),
        device: device_record(session),
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        campaign: campaign.source.text().to_string(),
    }
}

/// The largest |x| that is predicted of each set-up that is used, m.
fn farthest(predictions: &[Prediction], expected: &[Expected]) -> BTreeMap<usize, f64> {
    let swings = predictions.iter().map(|p| (p.set_up, p.swing.max_x_m));
    let mut all = BTreeMap::new();
    for (set_up, x_m) in swings.chain(expected.iter().map(|e| (e.set_up, e.outlook.x_peak_m))) {
        let most: &mut f64 = all.entry(set_up).or_default();
        *most = most.max(x_m);
    }
    all
}

/// A run with everything checked.
struct Job<'a> {
    args: &'a Args,
    rig: Address,
    campaign: &'a Campaign,
    /// Set-ups that are used, with the largest |x| that is predicted of each, m.
    farthest_m: BTreeMap<usize, f64>,
    folder: OutputFolder,
    /// What an earlier run of the program has taken.
    taken: JournalState,
}

impl Job<'_> {
    fn carry_out(
        &self,
        session: &mut Session,
        selection: Selection,
        begin: Begin,
        journal: Journal,
        stop: &AtomicBool,
    ) -> Outcome {
        let device = &begin.device;
        say!("Rig {}: {} (firmware {}), tick {} Hz", device.link, device.board, device.firmware, device.tick_hz);
        let mut manifest = self.manifest(&begin);
        let layout = Layout {
            signals: begin.signals.clone(),
            every_ticks: begin.every_ticks,
            tick_hz: device.tick_hz,
            order: self.campaign.in_order(),
        };
        let waits_for_room = session.is_granted();
        let mut writer = Writer::new(self.folder.path(), journal, layout, self.taken.clone()).map_err(failed)?;
        writer.note(&Entry::Begin(Box::new(begin))).map_err(failed)?;
        manifest.note(writer.state(), writer.rows());
        self.folder.write_manifest(&manifest).map_err(failed)?;
        let taken = writer.state().clone();

        let wall = Instant::now();
        let mut progress = Progress::new(self.campaign, self.args.yes);
        let mut recorder = Recorder::start(writer, waits_for_room);
        let run = Run::new(self.campaign, session, &mut recorder, &mut progress, stop, selection, taken);
        let (mut tally, result) = run.with_reconnect(self.reconnect()).carry_out();
        progress.end();
        let accepted = recorder.accepted_rows();
        let (writer, stored) = recorder.finish();
        let Some(mut writer) = writer else {
            return Err(failed("the recorder's thread has died; the run is incomplete"));
        };
        let closed = stored.and(writer.close());
        let unwritten = writer.unwritten_rows(accepted);
        tally.counters.dropped_rows_host += unwritten;
        tally.counters.lost_rows += unwritten;
        self.end(writer, manifest, tally, result.and(closed.map_err(RunError::from)), wall.elapsed())
    }

    fn reconnect(&self) -> Option<Reconnect<'_>> {
        let within = Duration::from_secs_f64(self.args.reconnect_s);
        let timeout = Duration::from_secs_f64(self.args.timeout);
        let open = Box::new(move || {
            // A board that was plugged in again may have another name.
            let found = self.args.rig.as_ref().filter(|rig| **rig == Rig::Auto).and_then(|rig| rig.find().ok());
            Session::open(found.as_ref().unwrap_or(&self.rig), timeout)
        });
        (!within.is_zero()).then_some(Reconnect { within, open })
    }

    fn manifest(&self, begin: &Begin) -> Manifest {
        let record = |(set_up, x_m): (&usize, &f64)| SetUpRecord::new(&self.campaign.set_ups[*set_up], *x_m);
        let started = self.taken.begun.first().map_or(&begin.at, |first| &first.at);
        let mut manifest = Manifest::begin(self.campaign, self.farthest_m.iter().map(record).collect(), started);
        manifest.device = Some(begin.device.clone());
        manifest.acting_settings = acting_settings(self.campaign, begin.device.settings.as_ref());
        manifest.signals = begin.signals.clone();
        manifest
    }

    /// Joins the samples, says what came of it, draws the figure and writes the page.
    fn end(
        &self,
        mut writer: Writer,
        mut manifest: Manifest,
        tally: Tally,
        result: Result<(), RunError>,
        wall: Duration,
    ) -> Outcome {
        let result = result.and_then(|()| Ok(writer.join()?));
        let reason = result.as_ref().err().map(ToString::to_string);
        let ended = Ended {
            at: jiff::Zoned::now().to_string(),
            reason: reason.clone(),
            counters: tally.counters,
            controller: tally.controller,
            wall_s: wall.as_secs_f64(),
        };
        let ended = Entry::Ended(ended);
        let noted = writer.note(&ended);
        let mut taken = writer.state().clone();
        if noted.is_err() {
            // What the journal has no room for is told all the same.
            taken.add(&ended);
        }
        let rows = writer.results();
        manifest.clock = Durations { rig_s: tally.rig_s, wall_s: taken.wall_s() };
        manifest.counters = taken.losses();
        manifest.note(&taken, writer.rows());
        manifest.ending = reason.map_or(Ending::Complete, |reason| Ending::Incomplete { reason });
        let path = self.folder.path();
        let has_sines = self.campaign.experiments.iter().any(|e| e.stepped_sine().is_some());
        let drawn = if has_sines {
            let shown: Vec<Shown> = rows.iter().map(Shown::from).collect();
            response(self.campaign, &shown).and_then(|picture| picture.write(path, "figure"))
        } else {
            Ok(())
        };
        let drawn = drawn.and_then(|()| match transient_report::figure(self.campaign, path, taken.transients())? {
            Some(picture) => picture.write(path, "transients"),
            None => Ok(()),
        });
        let told = self.folder.write_page(&page(&RunFolder::with_manifest(path, manifest.clone())).html);
        let sums = checksum::of_folder(path);
        manifest.files = sums.clone().unwrap_or_default();
        let written = noted.and(told).and(self.folder.write_manifest(&manifest)).and(sums.map(|_| ()));
        if has_sines {
            say!("{}", report::results(self.campaign, &rows));
        }
        transient_report::results(taken.transients()).iter().for_each(|table| say!("{table}"));
        say!("{}", report::summary(&manifest));
        say!("Run folder: {}", path.display());
        if let Err(error) = &result {
            let (taken, planned) = (manifest.points_taken, manifest.points_planned);
            let shown = path.display();
            let kept =
                format!("\n  {taken} of {planned} points are kept in {shown}; `damprig run --resume {shown}` goes on");
            return Err(failure(error, &kept));
        }
        written.map_err(failed)?;
        drawn.map_err(failed)
    }
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
