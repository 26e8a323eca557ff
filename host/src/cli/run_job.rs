//! Runs a checked campaign for `damprig run` and completes the run folder.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use super::arguments::Rig;
use super::monitor::{PageArgs, handles, open_terminal, where_to_stop};
use super::outcome::{Failure, Outcome};
use super::run_progress::{Display, Log, RunProgress};
use crate::campaign::Campaign;
use crate::client::link::Address;
use crate::client::session::Session;
use crate::host_time;
use crate::monitor::run::{MonitoredRun, RunFacts};
use crate::monitor::terminal::{TerminalView, TerminalWatcher};
use crate::monitor::{Asked, Handles, Monitor, Permissions};
use crate::prediction::Predicted;
use crate::report::compared::predicted_and_measured;
use crate::report::figures::campaign::{self as figures, PlottedPoint};
use crate::report::figures::peak_motion::draw as draw_motions;
use crate::report::page::page;
use crate::report::terminal;
use crate::run_folder::RunFolder;
use crate::run_folder::checksum::{self, FileRecord};
use crate::run_folder::journal::{Begin, Ended, Entry, Journal};
use crate::run_folder::schema::acting_settings::acting_settings;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::{Durations, Ending, Manifest, SetUpRecord};
use crate::run_folder::write::writer::{Layout, Writer};
use crate::run_folder::write::{OutputFolder, Recorder};
use crate::runner::{Reconnect, Run, RunError, Selection, Tally, Watcher, device_record};

/// Journal entry for the start or resumption of a run.
pub(super) fn begin_entry(
    campaign: &Campaign,
    session: &Session,
    selection: &Selection,
    records: Vec<FileRecord>,
    now: &jiff::Zoned,
) -> Begin {
    Begin {
        records,
        at: now.to_string(),
        damprig: crate::VERSION_LINE.to_string(),
        device: device_record(session),
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        campaign: campaign.source.text().to_string(),
    }
}

/// Largest predicted |x| of each set-up in use, m.
fn largest_predicted(predicted: &Predicted) -> BTreeMap<usize, f64> {
    let swings = predicted.swings.iter().map(|p| (p.set_up, p.swing.max_x_m));
    let mut all = BTreeMap::new();
    for (set_up, x_m) in swings.chain(predicted.expected.iter().map(|e| (e.set_up, e.outlook.x_peak_m))) {
        let most: &mut f64 = all.entry(set_up).or_default();
        *most = most.max(x_m);
    }
    all
}

/// The live views of a run: the page with the actions of its viewers, the terminal's, or both.
pub(super) struct LiveViews {
    monitor: Monitor,
    actions: Receiver<Asked>,
    terminal: Option<(TerminalView, TerminalWatcher)>,
}

impl LiveViews {
    /// Starts the views that are wanted; none if none is. `stop` ends the run.
    ///
    /// # Errors
    /// The page's address or the terminal cannot be used.
    pub(super) fn start(
        page: Option<&PageArgs>,
        terminal: bool,
        mount_without_asking: bool,
        rig: &Address,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<Self>, Failure> {
        let handles = Handles { stop: Some(Arc::clone(stop)), ..handles(rig) };
        let mut monitor = match page {
            Some(page) => page.start(rig, where_to_stop(), handles)?,
            None if terminal => {
                let permissions = Permissions { where_to_stop: where_to_stop(), ..Permissions::default() };
                Monitor::start(None, permissions, handles).map_err(Failure::failed)?
            }
            None => return Ok(None),
        };
        let terminal = terminal.then(|| open_terminal(&monitor, stop, true, mount_without_asking)).transpose()?;
        let actions = monitor.take_actions().ok_or_else(|| Failure::failed("the monitor has no queue of actions"))?;
        Ok(Some(Self { monitor, actions, terminal }))
    }
}

/// A checked campaign, ready to run.
pub(super) struct Job<'a> {
    /// Value of `--rig`, searched again when a lost link is opened.
    pub given_rig: Option<&'a Rig>,
    pub timeout: Duration,
    /// How long to try to reconnect; zero for never.
    pub reconnect_within: Duration,
    pub mount_without_asking: bool,
    /// No progress is shown.
    pub is_quiet: bool,
    pub rig: Address,
    pub campaign: &'a Campaign,
    pub predicted: &'a Predicted,
    pub folder: OutputFolder,
    /// The live views, if any are wanted.
    pub live: Option<LiveViews>,
    /// The log file.
    pub log: Option<Log>,
    /// State of a resumed run.
    pub taken: JournalState,
}

impl Job<'_> {
    /// Runs the campaign, then writes manifest, figures and report page.
    pub(super) fn run(
        mut self,
        session: &mut Session,
        selection: Selection,
        begin: Begin,
        journal: Journal,
        stop: &AtomicBool,
    ) -> Outcome {
        let device = &begin.device;
        let has_terminal_view = self.live.as_ref().is_some_and(|views| views.terminal.is_some());
        // The view names the rig itself, and is garbled by other output.
        if !has_terminal_view {
            say!("Rig {}: {} (firmware {}), tick {} Hz", device.link, device.board, device.firmware, device.tick_hz);
        }
        let mut manifest = self.manifest(&begin);
        let layout = Layout {
            signals: begin.signals.clone(),
            every_ticks: begin.every_ticks,
            tick_hz: device.tick_hz,
            order: self.campaign.in_order(),
        };
        let waits_for_room = session.is_granted();
        let mut writer =
            Writer::new(self.folder.path(), journal, layout, self.taken.clone()).map_err(Failure::failed)?;
        writer.note(&Entry::Begin(Box::new(begin))).map_err(Failure::failed)?;
        manifest.note(writer.state(), writer.rows());
        self.folder.write_manifest(&manifest).map_err(Failure::failed)?;
        let taken = writer.state().clone();

        let wall = Instant::now();
        let display = Display {
            is_hidden: self.is_quiet || has_terminal_view,
            log: self.log.take(),
            mount_without_asking: self.mount_without_asking,
        };
        let mut progress = RunProgress::new(self.campaign, session, taken.points(), display);
        let mut recorder = Recorder::start(writer, waits_for_room);
        let (mut tally, result) = match self.live.take() {
            None => {
                let run = Run::new(self.campaign, session, &mut recorder, &mut progress, stop, selection, taken);
                run.with_reconnect(self.reconnect()).carry_out()
            }
            Some(LiveViews { monitor, actions, terminal }) => {
                let facts = RunFacts {
                    campaign: self.campaign,
                    session,
                    predicted: self.predicted,
                    folder: self.folder.path().display().to_string(),
                    taken: &taken,
                };
                let (view, mut keys) = terminal.unzip();
                let own: &mut dyn Watcher = match &mut keys {
                    Some(keys) => keys,
                    None => &mut progress,
                };
                let mut watched = MonitoredRun::new(&facts, monitor.feed(), actions, own);
                let run = Run::new(self.campaign, session, &mut recorder, &mut watched, stop, selection, taken.clone());
                let ended = run.with_reconnect(self.reconnect()).carry_out();
                watched.ended(&ended.1);
                monitor.end();
                view.into_iter().for_each(TerminalView::close);
                ended
            }
        };
        progress.end();
        let accepted = recorder.accepted_rows();
        let (writer, stored) = recorder.finish();
        let Some(mut writer) = writer else {
            return Err(Failure::failed("the recorder thread has stopped; the run is incomplete"));
        };
        let closed = stored.and(writer.close());
        let unwritten = writer.unwritten_rows(accepted);
        tally.counters.dropped_rows_host += unwritten;
        tally.counters.lost_rows += unwritten;
        self.end(writer, manifest, tally, result.and(closed.map_err(RunError::from)), wall.elapsed())
    }

    fn reconnect(&self) -> Option<Reconnect<'_>> {
        let (within, timeout) = (self.reconnect_within, self.timeout);
        let open = Box::new(move || {
            // A board that was plugged in again may have another port.
            let found = self.given_rig.filter(|rig| **rig == Rig::Auto).and_then(|rig| rig.find().ok());
            Session::open(found.as_ref().unwrap_or(&self.rig), timeout)
        });
        (!within.is_zero()).then_some(Reconnect { within, open })
    }

    fn manifest(&self, begin: &Begin) -> Manifest {
        let record = |(set_up, x_m): (&usize, &f64)| {
            let own = self.predicted.responses.iter().filter(|response| response.set_up == *set_up);
            let in_dwells = own.filter_map(|response| response.dwell_max_x_m).fold(f64::NAN, f64::max);
            SetUpRecord::new(&self.campaign.set_ups[*set_up], *x_m, in_dwells)
        };
        let started = self.taken.begun.first().map_or(&begin.at, |first| &first.at);
        let mut manifest =
            Manifest::begin(self.campaign, largest_predicted(self.predicted).iter().map(record).collect(), started);
        manifest.device = Some(begin.device.clone());
        manifest.acting_settings = acting_settings(self.campaign, begin.device.settings.as_ref());
        manifest.signals = begin.signals.clone();
        manifest
    }

    /// Joins the samples, draws the figures, writes page and manifest, and prints the results.
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
            at: host_time::now().to_string(),
            reason: reason.clone(),
            counters: tally.counters,
            controller: tally.controller,
            wall_s: wall.as_secs_f64(),
        };
        let ended = Entry::Ended(ended);
        let noted = writer.note(&ended);
        let mut taken = writer.state().clone();
        if noted.is_err() {
            // Keep the ending in memory although the journal could not be written.
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
            let points: Vec<PlottedPoint> = rows.iter().map(PlottedPoint::from).collect();
            figures::response(self.campaign, &points, None).and_then(|picture| picture.write(path, "figure"))
        } else {
            Ok(())
        };
        let drawn = drawn.and_then(|()| match figures::transients(self.campaign, path, taken.transients())? {
            Some(picture) => picture.write(path, "transients"),
            None => Ok(()),
        });
        let with_samples = RunFolder::with_manifest(path, manifest.clone());
        let drawn = drawn.and_then(|()| match draw_motions(self.campaign, &with_samples, &taken)? {
            Some(picture) => picture.write(path, "motions"),
            None => Ok(()),
        });
        let page_written = self.folder.write_page(&page(&RunFolder::with_manifest(path, manifest.clone())).html);
        let sums = checksum::of_folder(path);
        manifest.files = sums.clone().unwrap_or_default();
        let written = noted.and(page_written).and(self.folder.write_manifest(&manifest)).and(sums.map(|_| ()));
        if has_sines {
            say!("{}", terminal::campaign::results(self.campaign, &self.predicted.responses, &rows));
        }
        terminal::transients::results(taken.transients()).iter().for_each(|table| say!("{table}"));
        predicted_and_measured(self.campaign).iter().for_each(|note| say!("{note}"));
        say!("{}", terminal::campaign::summary(&manifest));
        super::output::print_always(&format!("Run folder: {}", path.display()));
        if let Err(error) = &result {
            let (taken, planned) = (manifest.points_taken, manifest.points_planned);
            let shown = path.display();
            let kept = format!(
                "\n  {taken} of {planned} points are kept in {shown}; continue with `damprig run --resume {shown}`"
            );
            return Err(failure(error, &kept));
        }
        written.map_err(Failure::failed)?;
        drawn.map_err(Failure::failed)
    }
}

/// The failure of a run, with a note on the recorded data.
fn failure(error: &RunError, kept: &str) -> Failure {
    let message = format!("{error}{kept}");
    match error {
        RunError::Refused(_) => Failure::Input(message),
        RunError::Interrupted => Failure::Interrupted(message),
        _ => Failure::Failed(message),
    }
}
