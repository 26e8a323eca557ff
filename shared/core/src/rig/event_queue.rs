//! The events of a tick, until the caller takes them.
//!
//! Bounded: an event that finds no room is dropped and counted. Impacts leave room for the few others that a tick can have,
//! so that a wall sensor that chatters cannot push out a fault or a result.

use super::Event;
use crate::measure::impacts::ImpactRecord;
use heapless::Deque;

/// Most impacts in the queue.
pub const MOST_IMPACTS: usize = 8;

/// Most events in the queue: the impacts, and one each of the spring, a fault, a result and the experiment's end.
pub const MOST_EVENTS: usize = MOST_IMPACTS + 4;

/// Events in the order in which they happened.
#[derive(Clone, Debug, Default)]
pub(super) struct EventQueue {
    events: Deque<Event, MOST_EVENTS>,
    lost: u32,
}

impl EventQueue {
    /// Adds an event.
    pub fn push(&mut self, event: Event) {
        if self.events.push_back(event).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Adds an impact. They come first in a tick.
    pub fn push_impact(&mut self, record: &ImpactRecord) {
        if self.events.len() < MOST_IMPACTS {
            self.push(Event::Impact(*record));
        } else {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// The events that wait.
    pub fn iter(&self) -> impl Iterator<Item = &Event> {
        self.events.iter()
    }

    /// Takes the oldest event.
    pub fn pop(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Events that found no room, since power-on.
    pub fn lost(&self) -> u32 {
        self.lost
    }
}
