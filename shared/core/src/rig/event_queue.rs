//! Bounded queue of a tick's events, until the caller takes them.
//!
//! An event that finds no room is dropped and counted. Impacts leave room for the few other events of a tick, so that a
//! chattering wall sensor cannot displace a fault or a result.

use super::Event;
use crate::measure::impacts::ImpactRecord;
use heapless::Deque;

/// Most impacts in the queue.
pub const MAX_IMPACTS: usize = 8;

/// Most events in the queue: the impacts, and one each of spring event, fault, result and end of experiment.
pub const MAX_EVENTS: usize = MAX_IMPACTS + 4;

/// The events in the order of their occurrence.
#[derive(Clone, Debug, Default)]
pub(super) struct EventQueue {
    events: Deque<Event, MAX_EVENTS>,
    lost: u32,
}

impl EventQueue {
    /// Adds an event.
    pub fn push(&mut self, event: Event) {
        if self.events.push_back(event).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Adds an impact. Impacts come first in a tick.
    pub fn push_impact(&mut self, record: &ImpactRecord) {
        if self.events.len() < MAX_IMPACTS {
            self.push(Event::Impact(*record));
        } else {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// The events in the queue.
    pub fn iter(&self) -> impl Iterator<Item = &Event> {
        self.events.iter()
    }

    /// Takes the oldest event.
    pub fn pop(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Events dropped since power-on because the queue was full.
    pub fn lost(&self) -> u32 {
        self.lost
    }
}
