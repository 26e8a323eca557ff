//! The monitor's thread: takes the updates of the source and makes frames of them, about twenty a second, for all viewers alike.

use std::sync::Arc;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use tokio::sync::broadcast;

use super::feed::{Update, Updates};
use super::live::Live;
use super::message::SharedFrame;

/// Time from frame to frame while there is news.
const FRAME_EVERY: Duration = Duration::from_millis(50);

/// Longest time without a frame.
const FRAME_AT_LEAST: Duration = Duration::from_secs(1);

/// Frames that wait for a viewer; one that is further behind gets a new snapshot.
const FRAMES_WAITING: usize = 64;

/// Runs until [`Update::End`] or the end of all feeds.
pub(super) fn run(mut live: Live, updates: &Updates) {
    let (mut viewers, _) = broadcast::channel(FRAMES_WAITING);
    let mut sent = Instant::now();
    loop {
        let pause = if live.has_changed() { FRAME_EVERY } else { FRAME_AT_LEAST };
        match updates.queue.recv_timeout(pause.saturating_sub(sent.elapsed())) {
            Ok(update) => {
                updates.taken();
                match update {
                    Update::End => break,
                    Update::Join(viewer) => {
                        // What has not been sent yet goes to the others first: it is in the snapshot.
                        send(&mut live, &viewers, updates);
                        // A viewer that has left again needs nothing.
                        let _ = viewer.send((Box::new(live.snapshot()), viewers.subscribe()));
                    }
                    update => {
                        if live.take(update) {
                            // Viewers of the old channel join again.
                            viewers = broadcast::channel(FRAMES_WAITING).0;
                        }
                    }
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        let pause = if live.has_changed() { FRAME_EVERY } else { FRAME_AT_LEAST };
        if sent.elapsed() >= pause {
            sent = Instant::now();
            send(&mut live, &viewers, updates);
        }
    }
    send(&mut live, &viewers, updates);
}

fn send(live: &mut Live, viewers: &broadcast::Sender<Arc<SharedFrame>>, updates: &Updates) {
    live.count(viewers.receiver_count(), updates.skipped());
    // Without viewers nobody is told.
    let _ = viewers.send(Arc::new(SharedFrame::new(live.frame())));
}
