//! Actions of viewers on their way to the source: checked for the token, queued, and answered. A stop is never queued.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::access::Token;
use super::action::{Action, Injection, Request};
use super::feed::Feed;
use super::message::{ActionAnswer, Level};
use crate::report::numbers::significant;

/// Actions that wait for the source.
const MAX_ACTIONS: usize = 8;

/// Time between two lines of the log about wrong tokens.
const WARN_EVERY: Duration = Duration::from_secs(60);

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// An action for the source, and where its answer goes.
#[derive(Debug)]
pub struct Asked {
    /// The action.
    pub action: Action,
    answer: oneshot::Sender<Result<String, String>>,
}

impl Asked {
    /// Answers: what was done, or why not.
    pub fn answer(self, result: Result<String, String>) {
        // A viewer that has left needs no answer.
        let _ = self.answer.send(result);
    }
}

/// The source's end of the actions.
#[derive(Debug)]
pub struct Actions {
    stop: Arc<AtomicBool>,
    queue: Receiver<Asked>,
}

impl Actions {
    /// The next action, a stop before all others: it was answered already, however often it was asked for.
    pub fn next(&self) -> Option<Asked> {
        if self.stop.swap(false, Ordering::Relaxed) {
            let (answer, _) = oneshot::channel();
            return Some(Asked { action: Action::Stop, answer });
        }
        self.queue.try_recv().ok()
    }
}

/// Plays and pauses a replay from the terminal.
#[derive(Clone, Debug)]
pub struct Player(SyncSender<Asked>);

impl Player {
    /// Pauses the replay, or lets it go on.
    pub(super) fn pause(&self, paused: bool) {
        let (answer, _) = oneshot::channel();
        let action = Action::Replay { speed: None, paused: Some(paused), to_s: None };
        // Keys that come faster than the replay takes them are lost.
        let _ = self.0.try_send(Asked { action, answer });
    }
}

/// What the source gives so that viewers can act: some actions do not wait for it.
#[derive(Default)]
pub struct Handles {
    /// Ends the run, as Ctrl-C does.
    pub stop: Option<Arc<AtomicBool>>,
    /// Pulls (true) or plugs in the cable of a simulated rig.
    pub cable: Option<Box<dyn Fn(bool) + Send + Sync>>,
    /// Viewers may move a replay.
    pub can_replay: bool,
}

impl fmt::Debug for Handles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Handles {{ stop: {}, cable: {} }}", self.stop.is_some(), self.cable.is_some())
    }
}

/// The desk at which viewers' actions are checked.
#[derive(Debug)]
pub(super) struct Control {
    token: Option<Token>,
    handles: Handles,
    stop: Arc<AtomicBool>,
    actions: SyncSender<Asked>,
    feed: Feed,
    where_to_stop: String,
    wrong_token_at: Mutex<Option<Instant>>,
}

impl Control {
    /// The desk, and the source's end. Without a token viewers can only watch.
    pub(super) fn new(token: Option<Token>, handles: Handles, feed: Feed, where_to_stop: String) -> (Self, Actions) {
        let (actions, queue) = sync_channel(MAX_ACTIONS);
        let stop = Arc::new(AtomicBool::new(false));
        let own = Actions { stop: Arc::clone(&stop), queue };
        (Self { token, handles, stop, actions, feed, where_to_stop, wrong_token_at: Mutex::default() }, own)
    }

    /// The terminal's access to a replay.
    pub(super) fn player(&self) -> Player {
        Player(self.actions.clone())
    }

    /// Whether `given` is the token.
    pub(super) fn is_token(&self, given: &str) -> bool {
        self.token.as_ref().is_some_and(|token| token.is(given))
    }

    /// Reads a viewer's message.
    ///
    /// # Errors
    /// It is malformed, or the viewer may not act.
    pub(super) fn read(&self, text: &str) -> Result<Request, RefusedMessage> {
        let refused = |id, text| RefusedMessage(ActionAnswer { id, ok: false, text });
        let request: Request =
            serde_json::from_str(text).map_err(|error| refused(0, format!("the message is no action: {error}")))?;
        self.permit(&request).map_err(|why| refused(request.id, why))?;
        Ok(request)
    }

    fn permit(&self, request: &Request) -> Result<(), String> {
        // Moving a replay moves no rig.
        if matches!(request.action, Action::Replay { .. }) {
            return if self.handles.can_replay { Ok(()) } else { Err("nothing is replayed here".into()) };
        }
        if self.token.is_none() {
            return Err(format!("this monitor is view only. {}", self.where_to_stop));
        }
        if request.token.is_empty() {
            return Err("this needs the token: open the address that damprig printed at its start".into());
        }
        if !self.is_token(&request.token) {
            self.warn_of_wrong_token();
            return Err("wrong token: open the address that damprig printed at its start".into());
        }
        Ok(())
    }

    /// Stops at once, ahead of everything that waits; as often as it is asked for.
    pub(super) fn stop(&self, id: u64) -> ActionAnswer {
        // It is noted first: the run may end at once.
        let is_known = self.stop.swap(true, Ordering::Relaxed);
        let (is_known, text) = match &self.handles.stop {
            Some(stop) => (stop.swap(true, Ordering::Relaxed), "The run stops; what was measured is kept."),
            None => (is_known, "The rig is told to stop before anything else."),
        };
        if !is_known {
            in_words(&Action::Stop).into_iter().for_each(|what| self.feed.log(Level::Action, what));
        }
        ActionAnswer { id, ok: true, text: text.into() }
    }

    /// Carries out an action that [`Control::read`] has permitted.
    pub(super) async fn act(&self, request: Request) -> ActionAnswer {
        let id = request.id;
        match self.carry_out(request.action).await {
            Ok(text) => ActionAnswer { id, ok: true, text },
            Err(text) => ActionAnswer { id, ok: false, text },
        }
    }

    /// Logs a wrong token, once a minute at most: anybody can send one.
    fn warn_of_wrong_token(&self) {
        let mut last = self.wrong_token_at.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|at| at.elapsed() > WARN_EVERY) {
            *last = Some(Instant::now());
            self.feed.log(Level::Warning, "A viewer tried to act with a wrong token.");
        }
    }

    async fn carry_out(&self, action: Action) -> Result<String, String> {
        let what = in_words(&action);
        if let (Action::Inject { fault: Injection::Cable { on } }, Some(cable)) = (&action, &self.handles.cable) {
            cable(*on);
            what.into_iter().for_each(|what| self.feed.log(Level::Action, what));
            let done = if *on { "The cable is pulled." } else { "The cable is plugged in." };
            // It is only noted; nobody waits for an answer.
            let (answer, _) = oneshot::channel();
            let _ = self.actions.try_send(Asked { action, answer });
            return Ok(done.into());
        }
        let (answer, answered) = oneshot::channel();
        match self.actions.try_send(Asked { action, answer }) {
            Ok(()) => what.into_iter().for_each(|what| self.feed.log(Level::Action, what)),
            Err(TrySendError::Full(_)) => return Err("earlier actions are still waiting; try again in a moment".into()),
            Err(TrySendError::Disconnected(_)) => return Err("nothing runs that could do this".into()),
        }
        match tokio::time::timeout(PATIENCE, answered).await {
            Ok(Ok(result)) => result,
            Ok(Err(_)) => Err("what was running has ended".into()),
            Err(_) => Err("the action waits: the rig is between two experiments".into()),
        }
    }
}

/// A message that is malformed, or from a viewer who may not act, and its answer.
pub(super) struct RefusedMessage(pub(super) ActionAnswer);

/// An action in words, for the log.
fn in_words(action: &Action) -> Option<String> {
    Some(match action {
        Action::Stop => "Stop was pressed on the page.".into(),
        Action::Pause => "Pause was pressed on the page.".into(),
        Action::Resume => "Resume was pressed on the page.".into(),
        Action::Hold => "Hold was pressed on the page.".into(),
        Action::Release => "Release was pressed on the page.".into(),
        Action::ClearFault => "Clear fault was pressed on the page.".into(),
        Action::SetSpring { force_n } => {
            format!("The page asks for a spring force of {} N.", significant(f64::from(*force_n), 3))
        }
        Action::Inject { fault } => match fault.in_words() {
            (what, Some(fault)) => format!("The page injects a fault: {what} is {fault}."),
            (what, None) => format!("The page ends an injected fault of {what}."),
        },
        Action::Replay { .. } => return None,
    })
}
