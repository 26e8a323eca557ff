//! Replays a run that is over, at any speed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use arrow_array::RecordBatch;

use super::reader::Reader;
use crate::failure::Failure;
use crate::monitor::action::Action;
use crate::monitor::control::{Actions, Asked};
use crate::monitor::feed::{Update, Watched};
use crate::monitor::message::{Activity, Level, ReplayState};
use crate::run_folder::journal;
use crate::run_folder::read::sample_files::sample_files;

/// Time from one part of a replay to the next.
const STEP: Duration = Duration::from_millis(40);

/// Rig time shown before the present when a replay is moved, s.
const BEFORE_S: f64 = 20.0;

/// Longest run that is replayed: ten years.
const LONGEST_S: f64 = 3.2e8;

/// Slowest and fastest replay, rig seconds per second.
pub const REPLAY_SPEEDS: (f64, f64) = (0.01, 1000.0);

/// Replays a folder that no longer changes, until `stop`.
pub(super) fn replay(
    reader: &mut Reader,
    watched: &Watched,
    speed: f64,
    actions: &Actions,
    stop: &AtomicBool,
) -> Result<(), Failure> {
    warn_of_missing(reader);
    // A manifest may state anything.
    let rig_s = reader.run.manifest().clock.rig_s;
    let end_s = if rig_s.is_finite() { rig_s.clamp(0.0, LONGEST_S) } else { 0.0 };
    reader.start_over()?;
    let mut batches = reader.run.samples();
    let mut batch: Option<RecordBatch> = batches.next().transpose()?;
    let first_s = batch.as_ref().map_or(Ok(0.0), |first| reader.first_s(first))?.clamp(0.0, end_s);
    let mut state = ReplayState { t_s: first_s, end_s, speed, paused: true };
    let mut then = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        let mut moved = None;
        while let Some(asked) = actions.next() {
            moved = control(&mut state, asked).or(moved);
        }
        if let Some(to_s) = moved {
            state.t_s = to_s;
            reader.feed.send(Update::Watch(Box::new(watched.clone())));
            reader.start_over()?;
            (batches, batch) = (reader.run.samples(), None);
        }
        let now = Instant::now();
        if !state.paused {
            state.t_s = (state.t_s + state.speed * (now - then).as_secs_f64()).min(state.end_s);
        }
        then = now;
        // Rows long before the present are passed over.
        let from_s = state.t_s - BEFORE_S.max(2.0 * state.speed);
        while let Some(present) = batch.take().map(Ok).or_else(|| batches.next()) {
            batch = reader.tell_between(&present?, from_s, state.t_s)?;
            if batch.is_some() {
                break;
            }
        }
        let is_over = state.t_s >= state.end_s;
        reader.tell_due(is_over);
        reader.feed.send(Update::Activity(Activity::Replay, headline(reader, &state, is_over)));
        reader.feed.send(Update::Progress(state.t_s));
        reader.feed.send(Update::Replay(state));
        std::thread::sleep(STEP);
    }
    Ok(())
}

fn warn_of_missing(reader: &Reader) {
    let path = reader.run.path();
    if sample_files(path).is_empty() {
        reader.feed.log(Level::Warning, "The folder has no samples that can be read: only results are shown.");
    }
    if !journal::is_in(path) {
        reader.feed.log(Level::Warning, "journal.jsonl is missing: results, impacts and events are not shown.");
    }
}

fn headline(reader: &Reader, state: &ReplayState, is_over: bool) -> String {
    let what = reader
        .present()
        .map_or(String::new(), |(set_up, experiment)| format!(": set-up {set_up}, experiment {experiment}"));
    match (is_over, state.paused) {
        (true, _) => format!("At its end. State of the run: {}.", reader.run.manifest().ending_text()),
        (false, true) => format!("Paused{what}"),
        (false, false) => format!("Plays{what}"),
    }
}

/// Changes the replay; returns the time to move to.
fn control(state: &mut ReplayState, asked: Asked) -> Option<f64> {
    let Action::Replay { speed, paused, to_s } = asked.action else {
        asked.answer(Err("this is the replay of a run that is over".into()));
        return None;
    };
    let (slowest, fastest) = REPLAY_SPEEDS;
    if speed.is_some_and(|speed| !(slowest..=fastest).contains(&speed)) {
        asked.answer(Err(format!("the speed must be from {slowest} to {fastest}")));
        return None;
    }
    if to_s.is_some_and(|to_s| !to_s.is_finite()) {
        asked.answer(Err("the time must be a number".into()));
        return None;
    }
    state.speed = speed.unwrap_or(state.speed);
    state.paused = paused.unwrap_or(state.paused);
    asked.answer(Ok("Done.".into()));
    to_s.map(|to_s| to_s.clamp(0.0, state.end_s))
}
