//! The shape of one impact: a fixed buffer of force samples from before its trigger until after its end.

use super::pulse::{Pair, Ring};

/// Samples in a snippet, of which the first [`HISTORY`](super::pulse::HISTORY) are from before the trigger.
pub const SNIPPET: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Off,
    Armed,
    /// From this sample of the present block on.
    Triggered(usize),
    Filling,
    Full,
}

/// Records once when armed, and keeps what it has until it is armed again.
#[derive(Clone, Debug)]
pub struct Snippet {
    samples: [u16; SNIPPET],
    filled: usize,
    wall: usize,
    phase: Phase,
}

impl Snippet {
    pub(super) fn new() -> Self {
        Self { samples: [0; SNIPPET], filled: 0, wall: 0, phase: Phase::Off }
    }

    pub(super) fn arm(&mut self) {
        self.phase = Phase::Armed;
        self.filled = 0;
    }

    /// It waits for an impact, or for the end of one.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        !matches!(self.phase, Phase::Off | Phase::Full)
    }

    /// Readings in counts, oldest first, and the side (+1 or −1); `None` until it is full.
    #[must_use]
    pub fn samples(&self) -> Option<(&[u16; SNIPPET], i8)> {
        (self.phase == Phase::Full).then_some((&self.samples, if self.wall == 0 { -1 } else { 1 }))
    }

    /// A pulse has begun with sample `at` of a block of `length`, the newest in the ring.
    pub(super) fn trigger(&mut self, wall: usize, at: usize, length: usize, ring: &Ring) {
        if self.phase != Phase::Armed {
            return;
        }
        self.phase = Phase::Triggered(at);
        self.wall = wall;
        self.filled = 0;
        for part in ring.before(length - at) {
            self.take(part);
        }
    }

    /// As many of the wall's readings as there is room for.
    fn take(&mut self, pairs: &[Pair]) {
        let wall = self.wall;
        let room = &mut self.samples[self.filled..];
        for (sample, pair) in room.iter_mut().zip(pairs) {
            *sample = pair.of(wall);
        }
        self.filled += pairs.len().min(room.len());
    }

    /// The block is over: what of it belongs to the snippet is kept.
    pub(super) fn push(&mut self, block: &[Pair]) {
        let from = match self.phase {
            Phase::Triggered(from) => from,
            Phase::Filling => 0,
            _ => return,
        };
        self.phase = Phase::Filling;
        self.take(&block[from..]);
        if self.filled == SNIPPET {
            self.phase = Phase::Full;
        }
    }
}
