//! The shape of one impact: a fixed buffer of force samples from before its trigger until after its end.

use super::impacts::HISTORY;

/// Samples in a snippet, of which the first [`HISTORY`] are from before the trigger.
pub const SNIPPET: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Off,
    Armed,
    Filling,
    Full,
}

/// Records once when armed, and keeps what it has until it is armed again.
#[derive(Clone, Debug)]
pub struct Snippet {
    samples: [f32; SNIPPET],
    filled: usize,
    wall: usize,
    phase: Phase,
}

impl Snippet {
    pub(super) fn new() -> Self {
        Self { samples: [0.0; SNIPPET], filled: 0, wall: 0, phase: Phase::Off }
    }

    pub(super) fn arm(&mut self) {
        self.phase = Phase::Armed;
        self.filled = 0;
    }

    /// Force as read, N, oldest first, and the side (+1 or −1); `None` until it is full.
    #[must_use]
    pub fn samples(&self) -> Option<(&[f32; SNIPPET], i8)> {
        (self.phase == Phase::Full).then_some((&self.samples, if self.wall == 0 { -1 } else { 1 }))
    }

    /// It takes every sample of this wall.
    #[inline]
    pub(super) fn is_filling(&self, wall: usize) -> bool {
        self.phase == Phase::Filling && self.wall == wall
    }

    /// A pulse has begun; `history` is the ring of the samples before, `at` its oldest.
    pub(super) fn trigger(&mut self, wall: usize, history: &[f32; HISTORY], at: usize) {
        if self.phase != Phase::Armed {
            return;
        }
        self.phase = Phase::Filling;
        self.wall = wall;
        let (newer, older) = history.split_at(at.min(HISTORY));
        self.samples[..older.len()].copy_from_slice(older);
        self.samples[older.len()..HISTORY].copy_from_slice(newer);
        self.filled = HISTORY;
    }

    #[inline]
    pub(super) fn push(&mut self, wall: usize, reading: f32) {
        if !self.is_filling(wall) {
            return;
        }
        if let Some(sample) = self.samples.get_mut(self.filled) {
            *sample = reading;
            self.filled += 1;
        }
        if self.filled == SNIPPET {
            self.phase = Phase::Full;
        }
    }
}
