//! Recorder of one impact's shape: force samples from before its trigger until after its end.
//!
//! While armed, the recorder is a ring of the newest samples. After an impact it runs on until [`HISTORY`] samples from
//! before the trigger are left, and then stops. A tick in which an impact begins therefore costs no more than any other
//! tick.

use crate::io::WallCounts;

/// Samples in a snippet. The first [`HISTORY`] of them are from before the trigger.
pub const SNIPPET: usize = 256;

/// Samples from before the trigger.
pub const HISTORY: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SnippetPhase {
    Off,
    /// The history fills up before an impact can trigger: this many samples are missing.
    Gathering(usize),
    Armed,
    /// Triggered: this many samples are missing.
    Filling(usize),
    Full,
}

/// Records one impact when armed, and keeps it until it is armed again.
#[derive(Clone, Debug)]
pub struct Snippet {
    samples: [WallCounts; SNIPPET],
    /// Index of the oldest sample.
    at: usize,
    wall: usize,
    phase: SnippetPhase,
}

impl Snippet {
    pub(super) fn new() -> Self {
        Self { samples: [WallCounts::new(0, 0); SNIPPET], at: 0, wall: 0, phase: SnippetPhase::Off }
    }

    /// Arms the recorder. Impacts within the next [`HISTORY`] samples do not trigger it.
    pub(super) fn arm(&mut self) {
        self.phase = SnippetPhase::Gathering(HISTORY);
    }

    /// The recorder waits for an impact, or for the end of one.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        !matches!(self.phase, SnippetPhase::Off | SnippetPhase::Full)
    }

    /// Copies readings in counts, oldest first, from index `from` on, as many as are available and as fit into `to`.
    /// Returns the number copied and the side (+1 or −1); `None` until the snippet is full.
    pub fn copy(&self, from: usize, to: &mut [u16]) -> Option<(usize, i8)> {
        if self.phase != SnippetPhase::Full {
            return None;
        }
        let from = from.min(SNIPPET);
        let copied = to.len().min(SNIPPET - from);
        let (newer, older) = self.samples.split_at((self.at + from) % SNIPPET);
        let (first, rest) = to[..copied].split_at_mut(copied.min(older.len()));
        for (to, from) in [(first, older), (rest, newer)] {
            to.iter_mut().zip(from).for_each(|(to, pair)| *to = pair.of(self.wall));
        }
        Some((copied, if self.wall == 0 { -1 } else { 1 }))
    }

    /// Triggers the recorder: a pulse has begun with sample `at` of the present block.
    pub(super) fn trigger(&mut self, wall: usize, at: usize) {
        if self.phase == SnippetPhase::Armed {
            self.phase = SnippetPhase::Filling(at + SNIPPET - HISTORY);
            self.wall = wall;
        }
    }

    /// Takes the samples of a finished block.
    pub(super) fn push(&mut self, block: &[WallCounts]) {
        let (phase, length) = match self.phase {
            SnippetPhase::Off | SnippetPhase::Full => return,
            SnippetPhase::Armed => (SnippetPhase::Armed, block.len()),
            SnippetPhase::Gathering(left) if left > block.len() => {
                (SnippetPhase::Gathering(left - block.len()), block.len())
            }
            SnippetPhase::Gathering(_) => (SnippetPhase::Armed, block.len()),
            SnippetPhase::Filling(left) if left > block.len() => {
                (SnippetPhase::Filling(left - block.len()), block.len())
            }
            SnippetPhase::Filling(left) => (SnippetPhase::Full, left),
        };
        self.phase = phase;
        let (first, rest) = block[..length].split_at(length.min(SNIPPET - self.at));
        self.samples[self.at..self.at + first.len()].copy_from_slice(first);
        if !rest.is_empty() {
            self.samples[..rest.len()].copy_from_slice(rest);
        }
        self.at = (self.at + length) % SNIPPET;
    }
}
