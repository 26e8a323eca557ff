//! Bounded lists for viewers: what new ones get whole, and what the others have not been sent yet.

use std::collections::VecDeque;

/// A bounded list of which the newest entries have not been sent yet.
#[derive(Debug)]
pub(super) struct Unsent<T> {
    all: VecDeque<T>,
    most: usize,
    new: usize,
}

impl<T: Clone> Unsent<T> {
    /// A list of at most so many entries.
    pub(super) fn new(most: usize) -> Self {
        Self { all: VecDeque::new(), most, new: 0 }
    }

    /// Adds an entry; a full list loses its oldest.
    pub(super) fn push(&mut self, value: T) {
        if self.all.len() == self.most {
            self.all.pop_front();
        }
        self.all.push_back(value);
        self.new = (self.new + 1).min(self.all.len());
    }

    /// Removes the entry at a place.
    pub(super) fn remove(&mut self, at: usize) {
        let is_new = at >= self.all.len() - self.new;
        self.all.remove(at);
        self.new -= usize::from(is_new);
    }

    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.all.clear();
        self.new = 0;
    }

    /// The entries that have not been sent, which count as sent from now on.
    pub(super) fn take_new(&mut self) -> Vec<T> {
        let new = self.all.iter().skip(self.all.len() - self.new).cloned().collect();
        self.new = 0;
        new
    }

    /// The entries, oldest first.
    pub(super) fn iter(&self) -> impl Iterator<Item = &T> {
        self.all.iter()
    }

    /// Copies of all entries, oldest first.
    pub(super) fn everything(&self) -> Vec<T> {
        self.iter().cloned().collect()
    }
}
