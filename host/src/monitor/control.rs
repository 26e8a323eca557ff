//! Actions of viewers on their way to the source: checked for the token, queued, and answered.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::access::Token;
use super::action::{Action, Injection, Request};
use super::feed::Feed;
use super::message::{Answer, Level};
use crate::report::numbers::significant;

/// Actions that wait for the source.
const MOST_ACTIONS: usize = 8;

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
    actions: SyncSender<Asked>,
    feed: Feed,
    where_to_stop: String,
    wrong_token_at: Mutex<Option<Instant>>,
}

impl Control {
    /// The desk, and the queue of the source. Without a token viewers can only watch.
    pub(super) fn new(
        token: Option<Token>,
        handles: Handles,
        feed: Feed,
        where_to_stop: String,
    ) -> (Self, Receiver<Asked>) {
        let (actions, queue) = sync_channel(MOST_ACTIONS);
        (Self { token, handles, actions, feed, where_to_stop, wrong_token_at: Mutex::default() }, queue)
    }

    /// Carries out a viewer's message.
    pub(super) async fn answer(&self, text: &str) -> Answer {
        let request: Request = match serde_json::from_str(text) {
            Ok(request) => request,
            Err(error) => return Answer { id: 0, ok: false, text: format!("the message is no action: {error}") },
        };
        let id = request.id;
        match self.act(request).await {
            Ok(text) => Answer { id, ok: true, text },
            Err(text) => Answer { id, ok: false, text },
        }
    }

    /// Tells the source what was done already, so that it is noted; nobody waits for an answer.
    fn tell(&self, action: Action) {
        let (answer, _) = oneshot::channel();
        let _ = self.actions.try_send(Asked { action, answer });
    }

    /// Logs a wrong token, once a minute at most: anybody can send one.
    fn warn_of_wrong_token(&self) {
        let mut last = self.wrong_token_at.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|at| at.elapsed() > WARN_EVERY) {
            *last = Some(Instant::now());
            self.feed.log(Level::Warning, "A viewer tried to act with a wrong token.");
        }
    }

    async fn act(&self, request: Request) -> Result<String, String> {
        // Moving a replay moves no rig.
        if matches!(request.action, Action::Replay { .. }) && !self.handles.can_replay {
            return Err("nothing is replayed here".into());
        }
        if !matches!(request.action, Action::Replay { .. }) {
            let Some(token) = &self.token else {
                return Err(format!("this monitor is view only. {}", self.where_to_stop));
            };
            if request.token.is_empty() {
                return Err("this needs the token: open the address that damprig printed at its start".into());
            }
            if !token.is(&request.token) {
                self.warn_of_wrong_token();
                return Err("wrong token: open the address that damprig printed at its start".into());
            }
            if let Some(what) = in_words(&request.action) {
                self.feed.log(Level::Action, what);
            }
        }
        match (&request.action, &self.handles) {
            (Action::Stop, Handles { stop: Some(stop), .. }) => {
                // It is noted first: the run may end at once.
                self.tell(request.action);
                stop.store(true, Ordering::Relaxed);
                return Ok("The run stops; what was measured is kept.".into());
            }
            (Action::Inject { fault: Injection::Cable { on } }, Handles { cable: Some(cable), .. }) => {
                cable(*on);
                let done = if *on { "The cable is pulled." } else { "The cable is plugged in." };
                self.tell(request.action);
                return Ok(done.into());
            }
            _ => {}
        }
        let (answer, answered) = oneshot::channel();
        match self.actions.try_send(Asked { action: request.action, answer }) {
            Ok(()) => {}
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
