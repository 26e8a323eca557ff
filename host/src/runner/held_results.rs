//! Results on their way to the journal: each waits until the samples of its point are recorded. A device sends a result before the last
//! rows of its point, and a result without them is not kept.

use std::collections::VecDeque;

use crate::run_folder::ResultRow;
use crate::run_folder::journal::JournalEntry;
use crate::run_folder::schema::transients::TransientRow;

/// A result.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Measured {
    /// Of a point.
    Point(Box<ResultRow>),
    /// Of a record, a pulse or a free vibration.
    Transient(Box<TransientRow>),
}

impl Measured {
    /// The tick after its last.
    fn end_tick(&self) -> u64 {
        match self {
            Self::Point(row) => row.end_tick,
            Self::Transient(row) => row.end_tick,
        }
    }

    /// Its line of the journal.
    pub(super) fn into_entry(self) -> JournalEntry {
        match self {
            Self::Point(row) => JournalEntry::Result(row),
            Self::Transient(row) => JournalEntry::Transient(row),
        }
    }
}

/// The results of a segment whose samples are not all recorded.
pub(super) struct HeldResults {
    every_ticks: u64,
    held: VecDeque<Measured>,
    recorded_to: Option<u64>,
}

impl HeldResults {
    /// `every_ticks`: from row to row of the samples; 0 for none.
    pub(super) fn new(every_ticks: u16) -> Self {
        Self { every_ticks: every_ticks.into(), held: VecDeque::new(), recorded_to: None }
    }

    /// Adds a result; they come in the order of their points.
    pub(super) fn add(&mut self, measured: Measured) {
        self.held.push_back(measured);
    }

    /// Notes that the rows up to this tick are with the recorder.
    pub(super) fn recorded(&mut self, tick: u32) {
        self.recorded_to = self.recorded_to.max(Some(tick.into()));
    }

    /// Whether there are any.
    pub(super) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Takes the next result whose rows are recorded.
    pub(super) fn take_recorded(&mut self) -> Option<Measured> {
        let last = self.held.front()?.end_tick().saturating_sub(1);
        // The rows are at whole multiples of their spacing; 0 for none.
        let is_recorded =
            last.checked_rem(self.every_ticks).is_none_or(|past| self.recorded_to.is_some_and(|to| to >= last - past));
        if is_recorded { self.held.pop_front() } else { None }
    }

    /// Takes the next result: its rows were lost on the way.
    pub(super) fn take(&mut self) -> Option<Measured> {
        self.held.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ending_at(end_tick: u64) -> Measured {
        Measured::Point(Box::new(ResultRow { end_tick, ..ResultRow::default() }))
    }

    #[test]
    fn a_result_waits_for_the_last_row_of_its_point() {
        let mut held = HeldResults::new(10);
        held.add(ending_at(101));
        held.add(ending_at(200));
        held.recorded(90);
        assert_eq!(held.take_recorded(), None);
        held.recorded(100);
        assert_eq!(held.take_recorded(), Some(ending_at(101)));
        held.recorded(180);
        assert_eq!(held.take_recorded(), None);
        // The row at 190 was lost, and a later one has arrived.
        held.recorded(210);
        assert_eq!(held.take_recorded(), Some(ending_at(200)));
        assert!(held.is_empty());
    }

    #[test]
    fn without_samples_no_result_waits() {
        let mut held = HeldResults::new(0);
        held.add(ending_at(101));
        assert_eq!(held.take_recorded(), Some(ending_at(101)));
    }
}
