//! The terminal view: the numbers, alarms and small curves of the page, for a terminal over ssh. It is a viewer like any other,
//! with the keys of the terminal that owns the run.

use std::collections::VecDeque;
use std::io;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{EnterAlternateScreen, enable_raw_mode};
use ratatui::{DefaultTerminal, Terminal};
use tokio::sync::broadcast::Receiver as Frames;
use tokio::sync::broadcast::error::TryRecvError;
use tokio::sync::oneshot;

use super::control::Player;
use super::feed::{Feed, Update};
use super::message::{Activity, Level, LogLine, News, SharedFrame, Snapshot, ViewerUpdate};
use super::screen;
use crate::campaign::{CampaignSetUp, Experiment};
use crate::report::describe;
use crate::runner::{RestAnswer, RestFinding, RunAction, RunError, Watcher};

/// Time from picture to picture.
const DRAW_EVERY: Duration = Duration::from_millis(100);

/// Longest wait for the terminal to be restored.
const FAREWELL: Duration = Duration::from_secs(1);

/// Values of x, X/Z and forces, lines of the log, and points that are kept for the picture.
const MAX_VALUES: usize = 400;
const MAX_LOG: usize = 50;
const MAX_POINTS: usize = 2000;

/// Age from which numbers are shown as old, s.
const OLD_S: f64 = 1.0;

/// What the picture is drawn from.
#[derive(Debug)]
pub(super) struct ViewPicture {
    pub(super) snapshot: Box<Snapshot>,
    pub(super) x_m: VecDeque<f32>,
    pub(super) x_over_z_lock_in: VecDeque<f32>,
    pub(super) spring_n: VecDeque<f32>,
    pub(super) residual_m: VecDeque<f32>,
    /// Measured points of the present set-up and experiment: frequency (Hz), X/Z.
    pub(super) points: VecDeque<(String, f64, f64)>,
    pub(super) log: VecDeque<LogLine>,
    /// A question to the person at the terminal, answered with Enter or g.
    pub(super) question: Option<String>,
    /// Whether the terminal owns a run.
    pub(super) owns_run: bool,
    /// When the state was told.
    told_at: Instant,
}

impl ViewPicture {
    fn new(snapshot: Box<Snapshot>, owns_run: bool) -> Self {
        let mut picture = Self {
            x_m: VecDeque::new(),
            x_over_z_lock_in: VecDeque::new(),
            spring_n: VecDeque::new(),
            residual_m: VecDeque::new(),
            points: VecDeque::new(),
            log: VecDeque::new(),
            question: None,
            owns_run,
            snapshot,
            told_at: Instant::now(),
        };
        let news = picture.snapshot.news.clone();
        picture.add(&news);
        picture
    }

    fn take(&mut self, frame: &ViewerUpdate) {
        if frame.restart {
            for list in [&mut self.x_m, &mut self.x_over_z_lock_in, &mut self.spring_n, &mut self.residual_m] {
                list.clear();
            }
        }
        (self.snapshot.state, self.told_at) = (frame.state.clone(), Instant::now());
        self.add(&frame.news);
    }

    /// Age of the newest sample, s, when it is so old that the numbers are no longer those of the rig.
    pub(super) fn old_s(&self) -> Option<f64> {
        let state = &self.snapshot.state;
        let since_s = if state.replay.is_some() { 0.0 } else { self.told_at.elapsed().as_secs_f64() };
        state.age_s.map(|age_s| age_s + since_s).filter(|age_s| *age_s > OLD_S)
    }

    fn add(&mut self, news: &News) {
        let column = |rows: &super::message::TimeRows, name: &str| {
            let values = rows.values.get(name).map_or(&[][..], Vec::as_slice);
            values.iter().flatten().copied().collect::<Vec<f32>>()
        };
        keep(&mut self.x_m, column(&news.rows, "x"), 4 * MAX_VALUES);
        keep(&mut self.x_over_z_lock_in, column(&news.slow, "x_over_z_lock_in"), MAX_VALUES);
        keep(&mut self.spring_n, column(&news.slow, "spring_force_n"), MAX_VALUES);
        keep(&mut self.residual_m, column(&news.slow, "twin_residual_m"), MAX_VALUES);
        let points = news.points.iter().filter_map(|p| Some((p.set_up.clone(), p.frequency_hz, p.x_over_z?)));
        keep(&mut self.points, points, MAX_POINTS);
        keep(&mut self.log, news.log.iter().cloned(), MAX_LOG);
    }
}

fn keep<T>(list: &mut VecDeque<T>, new: impl IntoIterator<Item = T>, most: usize) {
    list.extend(new);
    let surplus = list.len().saturating_sub(most);
    list.drain(..surplus);
}

/// What the view and the run share.
#[derive(Debug, Default)]
struct ViewState {
    question: Mutex<Option<String>>,
    ends: AtomicBool,
}

/// The view, drawn by a thread of its own.
#[derive(Debug)]
pub struct TerminalView {
    shared: Arc<ViewState>,
    /// Gets a message, or loses its sender, when the view's thread has ended.
    ended: Receiver<()>,
    stop: Arc<AtomicBool>,
    feed: Feed,
}

/// The terminal as the watcher of a run: asks whether set-ups are mounted, and passes keys on.
#[derive(Debug)]
pub struct TerminalWatcher {
    shared: Arc<ViewState>,
    stop: Arc<AtomicBool>,
    feed: Feed,
    actions: Receiver<RunAction>,
    answers: Receiver<AnswerKey>,
    mount_without_asking: bool,
}

/// A key that answers a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AnswerKey {
    Enter,
    GoOn,
}

/// What the keys lead to.
struct KeyTargets {
    stop: Arc<AtomicBool>,
    player: Player,
    actions: Sender<RunAction>,
    answers: Sender<AnswerKey>,
}

impl TerminalView {
    /// Opens the view. `stop` ends the run or the monitor; with `owns_run` the keys act on a run.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub fn open(
        feed: &Feed,
        stop: &Arc<AtomicBool>,
        player: Player,
        owns_run: bool,
        mount_without_asking: bool,
    ) -> io::Result<(Self, TerminalWatcher)> {
        let shared = Arc::new(ViewState::default());
        let (actions, asked) = channel();
        let (answers, answered) = channel();
        let keys = KeyTargets { stop: Arc::clone(stop), player, actions, answers };
        let (theirs, own_feed) = (Arc::clone(&shared), feed.clone());
        let terminal = take_terminal()?;
        let (ends, ended) = channel();
        std::thread::Builder::new().name("terminal view".into()).spawn(move || {
            // A terminal that has gone needs no picture, and the run goes on without it.
            // Dropped, the terminal would print that it has gone, and panic because nothing can be printed.
            let mut terminal = ManuallyDrop::new(terminal);
            let _ = show(&mut terminal, &own_feed, &theirs, &keys, owns_run);
            let _ = terminal.show_cursor();
            let _ = ratatui::try_restore();
            let _ = ends.send(());
        })?;
        let view = Self { shared: Arc::clone(&shared), ended, stop: Arc::clone(stop), feed: feed.clone() };
        let watcher = TerminalWatcher {
            shared,
            stop: Arc::clone(&view.stop),
            feed: view.feed.clone(),
            actions: asked,
            answers: answered,
            mount_without_asking,
        };
        Ok((view, watcher))
    }

    /// Closes the view and restores the terminal.
    pub fn close(self) {
        drop(self);
    }

    fn end(&self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        // Reading keys from a terminal that was closed never returns: the run does not wait for it.
        let _ = self.ended.recv_timeout(FAREWELL);
    }
}

impl Drop for TerminalView {
    fn drop(&mut self) {
        self.end();
    }
}

/// Opens the terminal for pictures. A panic restores it first; a terminal that has gone is left alone, where ratatui's own
/// initialisation would print to it and so abort the program.
fn take_terminal() -> io::Result<DefaultTerminal> {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let _ = ratatui::try_restore();
        report(panic);
    }));
    enable_raw_mode()?;
    execute!(io::stdout(), EnterAlternateScreen)?;
    Terminal::new(CrosstermBackend::new(io::stdout()))
}

/// Draws until the view ends.
fn show(
    terminal: &mut DefaultTerminal,
    feed: &Feed,
    shared: &ViewState,
    keys: &KeyTargets,
    owns_run: bool,
) -> io::Result<()> {
    let Some((snapshot, mut frames)) = join(feed) else { return Ok(()) };
    let mut picture = ViewPicture::new(snapshot, owns_run);
    loop {
        // The last frame is drawn even if the view ends at once.
        let ends = shared.ends.load(Ordering::Relaxed);
        loop {
            match frames.try_recv() {
                Ok(frame) => picture.take(frame.frame()),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Lagged(_) | TryRecvError::Closed) => {
                    let Some((snapshot, new)) = join(feed) else { break };
                    (picture, frames) = (ViewPicture::new(snapshot, owns_run), new);
                }
            }
        }
        picture.question.clone_from(&shared.question.lock().unwrap_or_else(PoisonError::into_inner));
        terminal.draw(|frame| screen::draw(frame, &picture))?;
        if ends {
            return Ok(());
        }
        if event::poll(DRAW_EVERY)?
            && let Event::Key(key) = event::read()?
            && key.kind != KeyEventKind::Release
        {
            press(key, keys, &picture);
        }
    }
}

fn join(feed: &Feed) -> Option<(Box<Snapshot>, Frames<Arc<SharedFrame>>)> {
    let (viewer, joined) = oneshot::channel();
    feed.send(Update::Join(viewer));
    joined.blocking_recv().ok()
}

fn press(key: KeyEvent, keys: &KeyTargets, picture: &ViewPicture) {
    let control_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    let is_held = picture.snapshot.state.activity == Activity::Held;
    let is_paused = picture.snapshot.state.activity == Activity::Paused;
    let replay = picture.snapshot.state.replay;
    match key.code {
        // As without the view: the second one ends the program at once.
        _ if control_c && keys.stop.swap(true, Ordering::Relaxed) => {
            let _ = ratatui::try_restore();
            std::process::exit(130);
        }
        _ if control_c => {}
        KeyCode::Char('s') if picture.owns_run => keys.stop.store(true, Ordering::Relaxed),
        KeyCode::Char('q') if !picture.owns_run => keys.stop.store(true, Ordering::Relaxed),
        KeyCode::Char('p') if replay.is_some() => keys.player.pause(!replay.is_some_and(|replay| replay.paused)),
        KeyCode::Char('p') if picture.owns_run => {
            let _ = keys.actions.send(if is_paused { RunAction::Resume } else { RunAction::Pause });
        }
        KeyCode::Char('h') if picture.owns_run => {
            let _ = keys.actions.send(RunAction::Hold(!is_held));
        }
        KeyCode::Enter if picture.question.is_some() => {
            let _ = keys.answers.send(AnswerKey::Enter);
        }
        KeyCode::Char('g') if picture.question.is_some() => {
            let _ = keys.answers.send(AnswerKey::GoOn);
        }
        _ => {}
    }
}

impl TerminalWatcher {
    fn ask(&self, question: Option<String>) {
        *self.shared.question.lock().unwrap_or_else(PoisonError::into_inner) = question;
    }

    /// Asks a person to do something, and waits until it is confirmed.
    fn confirm(&self, request: &str) -> Result<bool, RunError> {
        if self.mount_without_asking {
            return Ok(false);
        }
        while self.answer_to(format!("{request} Press Enter when ready."))? != AnswerKey::Enter {}
        Ok(true)
    }

    /// Asks a question and waits for its answer.
    fn answer_to(&self, question: String) -> Result<AnswerKey, RunError> {
        while self.answers.try_recv().is_ok() {}
        self.ask(Some(question));
        let answer = loop {
            if let Ok(answer) = self.answers.recv_timeout(DRAW_EVERY) {
                break Ok(answer);
            }
            if self.stop.load(Ordering::Relaxed) {
                break Err(RunError::Interrupted);
            }
        };
        self.ask(None);
        answer
    }
}

impl Watcher for TerminalWatcher {
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<bool, RunError> {
        if simulated { Ok(false) } else { self.confirm(&describe::mounting(set_up)) }
    }

    fn instruct(&mut self, experiment: &Experiment, instruction: &str) -> Result<bool, RunError> {
        self.confirm(&describe::instruction(experiment, instruction))
    }

    fn not_at_rest(&mut self, finding: &RestFinding) -> Result<RestAnswer, RunError> {
        if self.mount_without_asking {
            self.feed.log(Level::Warning, "The run goes on although the rig is not at rest (--yes).");
            return Ok(RestAnswer::GoOn);
        }
        // The line may be longer than the terminal is wide: the keys come first. Its `s` stops every run.
        let keys = "Enter measures again, g goes on anyway, s stops.";
        Ok(match self.answer_to(format!("{keys} {}", finding.question_in_line()))? {
            AnswerKey::Enter => RestAnswer::Again,
            AnswerKey::GoOn => RestAnswer::GoOn,
        })
    }

    fn progress(&mut self, _: f64) {}

    fn point(&mut self, _: &crate::run_folder::ResultRow) {}

    fn link(&mut self, _: &str) {}

    fn action(&mut self) -> Option<RunAction> {
        self.actions.try_recv().ok()
    }

    fn answer(&mut self, result: Result<&str, &str>) {
        let (level, text) = match result {
            Ok(text) => (Level::Action, text),
            Err(text) => (Level::Warning, text),
        };
        self.feed.log(level, super::words::sentence(text));
    }
}
