//! Runs a checked campaign for `damprig run`, with its live views, and prints the results. [`crate::recorded_run`] records it.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::arguments::Rig;
use super::monitor::{PageArgs, handles, open_terminal, serve, where_to_stop};
use super::run_progress::{Display, LogFile, RunProgress};
use super::terminal_line::has_typed_line;
use crate::campaign::Campaign;
use crate::client::link::Address;
use crate::client::session::Session;
use crate::failure::{Failure, Outcome};
use crate::monitor::run::{MonitoredRun, RunFacts};
use crate::monitor::terminal::{TerminalView, TerminalWatcher};
use crate::monitor::{Actions, Handles, Monitor, Permissions, rig};
use crate::prediction::CampaignPrediction;
use crate::recorded_run::{EndedRun, RecordedRun, RunStart};
use crate::report::compared;
use crate::report::terminal;
use crate::run_folder::journal::{Begin, Journal, Withdrawn};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::write::OutputFolder;
use crate::runner::{Reconnect, Run, RunError, Selection, Tally, Watcher};

/// Time in which a viewer of a run that is over may come back, as after a reload.
const VIEWERS_RETURN: Duration = Duration::from_secs(3);

/// Longest time for which the page of a run that is over is served when no person is at a terminal.
const WITHOUT_PERSON: Duration = Duration::from_secs(60);

/// Time between two looks whether the viewers have left.
const TURN: Duration = Duration::from_millis(100);

/// The live views of a run: the page with the actions of its viewers, the terminal's, or both.
pub(super) struct LiveViews {
    monitor: Monitor,
    actions: Actions,
    terminal: Option<(TerminalView, TerminalWatcher)>,
}

impl LiveViews {
    /// Starts the views that are wanted; none if none is. The page is served once the run's files are open. `stop` ends the run.
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
            Some(page) => page.prepare(rig, where_to_stop(), handles)?,
            None if terminal => {
                let permissions = Permissions { where_to_stop: where_to_stop(), ..Permissions::default() };
                Monitor::start(None, permissions, handles)?
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
    /// The board may drive on settings other than the saved ones.
    pub accept_settings: bool,
    /// No progress is shown.
    pub is_quiet: bool,
    pub rig: Address,
    pub campaign: &'a Campaign,
    pub predicted: &'a CampaignPrediction,
    pub folder: OutputFolder,
    /// The live views, if any are wanted.
    pub live: Option<LiveViews>,
    /// The log file.
    pub log: Option<LogFile>,
    /// State of a resumed run.
    pub taken: JournalState,
    /// Results of a resumed run that do not count any more.
    pub withdrawn: Vec<Withdrawn>,
}

impl Job<'_> {
    /// Runs the campaign, then writes manifest, figures and report page.
    pub(super) fn run(
        mut self,
        session: &mut Session,
        selection: Selection,
        begin: Begin,
        journal: Journal,
        stop: &Arc<AtomicBool>,
    ) -> Outcome {
        let device = &begin.device;
        let has_terminal_view = self.live.as_ref().is_some_and(|views| views.terminal.is_some());
        // The view names the rig itself, and is garbled by other output.
        if !has_terminal_view {
            say!("Rig {}: {} (firmware {}), tick {} Hz", device.link, device.board, device.firmware, device.tick_hz);
        }
        let taken = std::mem::take(&mut self.taken);
        let withdrawn = std::mem::take(&mut self.withdrawn);
        let start = RunStart { begin, journal, taken, withdrawn, waits_for_room: session.is_granted() };
        let mut recorded = RecordedRun::begin(self.campaign, self.predicted, &self.folder, start)?;
        let taken = recorded.taken().clone();
        let display = Display {
            is_hidden: self.is_quiet || has_terminal_view,
            log: self.log.take(),
            stop: Arc::clone(stop),
            mount_without_asking: self.mount_without_asking,
        };
        let mut progress = RunProgress::new(self.campaign, session, &taken, display);
        let Some(LiveViews { mut monitor, actions, terminal }) = self.live.take() else {
            let recorder = &mut recorded.recorder;
            let run = Run::new(self.campaign, session, recorder, &mut progress, stop, selection, taken);
            let (tally, result) = run.with_reconnect(self.reconnect()).carry_out();
            progress.end();
            return self.conclude(recorded, tally, result);
        };
        serve(&mut monitor)?;
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
        let mut watched = MonitoredRun::new(&facts, monitor.feed(), &actions, own);
        let recorder = &mut recorded.recorder;
        let run = Run::new(self.campaign, session, recorder, &mut watched, stop, selection, taken.clone());
        let (tally, result) = run.with_reconnect(self.reconnect()).carry_out();
        let after = watched.ended(&result);
        let was_interrupted = stop.load(Ordering::Relaxed) && !after.was_stopped_by_viewer;
        let is_lost = matches!(result, Err(RunError::Session(_)));
        let (feed, ends) = (monitor.feed(), &AtomicBool::new(false));
        let outcome = std::thread::scope(|scope| {
            // The decay of the structure is shown while the files are completed.
            if monitor.viewers() > 0 && !was_interrupted && !is_lost {
                scope.spawn(move || rig::watch_after_run(session, after, &feed, &actions, ends));
            }
            view.into_iter().for_each(TerminalView::close);
            progress.end();
            let outcome = self.conclude(recorded, tally, result);
            if !was_interrupted {
                self.keep_page(&monitor, stop);
            }
            ends.store(true, Ordering::Relaxed);
            outcome
        });
        monitor.end();
        outcome
    }

    /// Completes the files of a run that has ended, and prints its results.
    fn conclude(&self, recorded: RecordedRun, tally: Tally, result: Result<(), RunError>) -> Outcome {
        let Some(ended) = recorded.end(tally, result) else {
            return Err(Failure::failed("the recorder thread has stopped; the run is incomplete"));
        };
        self.show(ended)
    }

    /// Serves the page of a run that has ended until its last viewer has left, Enter or Ctrl-C: a fault must be read by whoever
    /// looks at it. Nothing is waited for without viewers. Without a person at a terminal, or with --yes, a script may go on after
    /// this run: it waits for a limited time, whoever watches.
    fn keep_page(&self, monitor: &Monitor, stop: &AtomicBool) {
        if monitor.viewers() == 0 {
            return;
        }
        let has_person = std::io::stdin().is_terminal() && !self.mount_without_asking;
        let how = if has_person {
            "Enter or Ctrl-C ends it".into()
        } else {
            format!("at most {} s", WITHOUT_PERSON.as_secs())
        };
        warn!("The page stays until its last viewer has left ({how}).");
        let was_stopped = stop.load(Ordering::Relaxed);
        let (begun, mut seen, mut asked) = (Instant::now(), Instant::now(), monitor.files_asked());
        while seen.elapsed() < VIEWERS_RETURN && (was_stopped || !stop.load(Ordering::Relaxed)) {
            // A page that is loaded again on a slow machine takes its place late.
            let now_asked = monitor.files_asked();
            if monitor.viewers() > 0 || now_asked != asked {
                (seen, asked) = (Instant::now(), now_asked);
            }
            if has_typed_line(TURN) || !has_person && begun.elapsed() > WITHOUT_PERSON {
                return;
            }
        }
    }

    fn reconnect(&self) -> Option<Reconnect<'_>> {
        let (within, timeout) = (self.reconnect_within, self.timeout);
        let open = Box::new(move || {
            // A board that was plugged in again may have another port.
            let found = self.given_rig.filter(|rig| **rig == Rig::Auto).and_then(|rig| rig.find().ok());
            let mut session = Session::open(found.as_ref().unwrap_or(&self.rig), timeout)?;
            if self.accept_settings {
                session.accept_settings()?;
            }
            Ok(session)
        });
        (!within.is_zero()).then_some(Reconnect { within, open })
    }

    /// Prints the results.
    fn show(&self, ended: EndedRun) -> Outcome {
        let EndedRun { manifest, taken, rows, result, written, drawn } = ended;
        terminal::campaign::sheets(self.campaign, &rows).iter().for_each(|line| say!("{line}"));
        if self.campaign.experiments.iter().any(|e| e.base_driven().is_some()) {
            say!("{}", terminal::campaign::results(self.campaign, &self.predicted.responses, &rows));
            terminal::campaign::unresolved_peaks(self.campaign, &rows).iter().for_each(|line| say!("{line}"));
        }
        terminal::campaign::resonances(self.campaign, &rows, manifest.is_simulated())
            .iter()
            .for_each(|table| say!("{table}"));
        terminal::transients::results(taken.transients()).iter().for_each(|table| say!("{table}"));
        say!("{}", compared::IN_A_LINE);
        say!("{}", terminal::campaign::summary(&manifest));
        super::output::print_place(&format!("Run folder: {}", self.folder.path().display()));
        if let Err(error) = result {
            let (taken, planned) = (manifest.points_taken, manifest.points_planned);
            let shown = self.folder.path().display();
            let kept = format!(
                "\n  {taken} of {planned} points are kept in {shown}; continue with `damprig run --resume {shown}`"
            );
            return Err(Failure::from(error).with(|error| format!("{error}{kept}")));
        }
        written?;
        drawn
    }
}
