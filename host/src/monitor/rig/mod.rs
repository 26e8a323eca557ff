//! An idle rig as a source of the monitor: holds its link, shows what its controller measures, and carries out viewers' actions
//! (`watch`). A rig is shown in the same way for a while after its run.

mod watch;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::action::Action;
use super::control::Actions;
use super::feed::{Feed, Update};
use super::message::{Activity, Level, LinkState};
use super::run::AfterRun;
use super::words;
use crate::client::session::{Session, SessionError};
use watch::RigWatch;

/// What viewers are told who act on a run that is over.
const RUN_IS_OVER: &str = "The run is over.";

/// Pause before a lost link is opened again.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Time for which a rig is shown after its run. It is free for another program from then on.
const DECAY: Duration = Duration::from_secs(30);

/// Longest pause before Ctrl-C is checked again.
const TURN: Duration = Duration::from_millis(50);

/// Watches a rig until `stop` is set. A link that is lost later is opened again for as long as it takes.
///
/// # Errors
/// The rig cannot be reached at the start, or it is not one that this program can work with.
pub fn watch(
    open: &dyn Fn() -> Result<Session, SessionError>,
    feed: &Feed,
    actions: &Actions,
    stop: &AtomicBool,
) -> Result<(), SessionError> {
    let mut session = open()?;
    let mut link = LinkState { name: session.name().to_string(), ..LinkState::default() };
    loop {
        match RigWatch::new(&mut session, feed, actions, &mut link).and_then(|mut watch| watch.follow(stop, None)) {
            Ok(()) => return Ok(()),
            Err(error) => {
                session.close();
                link.interruptions += 1;
                link.state = "lost; trying to connect".into();
                let what = words::sentence(&error.to_string());
                feed.log(Level::Warning, what.clone());
                feed.send(Update::Activity(Activity::Lost, what));
                feed.send(Update::Link(link.clone()));
            }
        }
        match reopen(open, feed, actions, stop) {
            Some(opened) => session = opened,
            None => return Ok(()),
        }
        feed.log(Level::Info, "The link is back.");
    }
}

/// Shows the rig after its run: the decay of the structure, on the run's own time axis. Until `stop`, at most for 30 s, or
/// until the link is lost. Nothing is shown of a rig whose time the host grants: it stands.
pub fn watch_after_run(session: &mut Session, after: AfterRun, feed: &Feed, actions: &Actions, stop: &AtomicBool) {
    let mut link = after.link.clone();
    let until = Instant::now() + DECAY;
    if !session.is_granted() {
        let watched = RigWatch::after_run(session, after, feed, actions, &mut link);
        if let Err(error) = watched.and_then(|mut watch| watch.follow(stop, Some(until))) {
            feed.log(Level::Warning, words::sentence(&error.to_string()));
        }
        session.close();
        link.state = "closed: the run is over".into();
        feed.send(Update::Link(link));
    }
    while !stop.load(Ordering::Relaxed) {
        while let Some(asked) = actions.next() {
            asked.answer(Err(RUN_IS_OVER.into()));
        }
        std::thread::sleep(TURN);
    }
}

/// Opens the link again; none when `stop` is set.
fn reopen(
    open: &dyn Fn() -> Result<Session, SessionError>,
    feed: &Feed,
    actions: &Actions,
    stop: &AtomicBool,
) -> Option<Session> {
    loop {
        let again = Instant::now() + RETRY_AFTER;
        while Instant::now() < again {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            // The rig cannot be told anything.
            while let Some(asked) = actions.next() {
                if asked.action == Action::Stop {
                    let what = "The rig cannot be told to stop: the link is lost. It stops by itself when it has not heard \
                                from the host for safety.host_silent_s, and is told as soon as the link is back.";
                    feed.log(Level::Warning, what);
                }
                asked.answer(Err("The link to the rig is lost.".into()));
            }
            std::thread::sleep(TURN);
        }
        if let Ok(session) = open() {
            return Some(session);
        }
    }
}
