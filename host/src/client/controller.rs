//! The controller's counters in a run: its ticks, its queues, its side of the link.
//!
//! A board counts from its start; [`Readings`] subtracts what it had counted before the run, and adds up over resets. Rows
//! missing from the samples, whatever lost them, are counted by the run folder's losses.

use damprig_protocol::Counters;
use serde::{Deserialize, Serialize};

/// Counts are of the run alone; maxima are since the board started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Controller {
    /// Late ticks: blocks of samples that were overwritten before a tick had read them.
    pub overruns: u64,
    /// Rows of samples dropped because the transmit queue was full.
    pub rows_dropped: u64,
    /// Replies and events dropped because the transmit queue was full; the host requests them again.
    pub replies_dropped: u64,
    /// Requests dropped because the receive queue was full; the host repeats them.
    pub requests_dropped: u64,
    /// Frames rejected by the board: too long, not decodable, or with a wrong checksum.
    pub bad_frames: u64,
    /// Longest tick, µs; 0 on a simulated board, as are the next two.
    pub longest_tick_us: u16,
    /// Largest deviation of a tick's start from its schedule, µs.
    pub largest_jitter_us: u16,
    /// Longest time for which interrupts were masked, 0.1 µs.
    pub longest_masked_tenths_us: u16,
    /// Most rows of samples in the transmit queue at once.
    pub most_rows_waiting: u8,
    /// Most replies and events in the transmit queue at once.
    pub most_replies_waiting: u8,
}

impl Controller {
    /// The difference of two readings of a board that was not reset in between.
    #[must_use]
    pub fn between(before: &Counters, after: &Counters) -> Self {
        let more = |of: fn(&Counters) -> u32| u64::from(of(after).saturating_sub(of(before)));
        let timing = after.timing;
        Self {
            overruns: more(|c| c.timing.overruns),
            rows_dropped: more(|c| c.rows_dropped),
            replies_dropped: more(|c| c.replies_dropped),
            requests_dropped: more(|c| c.requests_dropped),
            bad_frames: more(|c| c.bad_frames),
            longest_tick_us: timing.longest_tick_us,
            largest_jitter_us: timing.largest_jitter_us,
            longest_masked_tenths_us: timing.longest_masked_tenths_us,
            most_rows_waiting: after.most_rows_waiting,
            most_replies_waiting: after.most_replies_waiting,
        }
    }

    /// Adds two parts of a run: counts add up, of maxima the larger is kept.
    #[must_use]
    pub fn and(self, more: Self) -> Self {
        Self {
            overruns: self.overruns.saturating_add(more.overruns),
            rows_dropped: self.rows_dropped.saturating_add(more.rows_dropped),
            replies_dropped: self.replies_dropped.saturating_add(more.replies_dropped),
            requests_dropped: self.requests_dropped.saturating_add(more.requests_dropped),
            bad_frames: self.bad_frames.saturating_add(more.bad_frames),
            longest_tick_us: self.longest_tick_us.max(more.longest_tick_us),
            largest_jitter_us: self.largest_jitter_us.max(more.largest_jitter_us),
            longest_masked_tenths_us: self.longest_masked_tenths_us.max(more.longest_masked_tenths_us),
            most_rows_waiting: self.most_rows_waiting.max(more.most_rows_waiting),
            most_replies_waiting: self.most_replies_waiting.max(more.most_replies_waiting),
        }
    }

    /// Longest time for which interrupts were masked, µs.
    #[must_use]
    pub fn longest_masked_us(&self) -> f64 {
        f64::from(self.longest_masked_tenths_us) / 10.0
    }

    /// The counts that are not 0, in words.
    #[must_use]
    pub fn complaints(&self) -> Vec<String> {
        let counted = [
            (self.overruns, "ticks of the board came too late: blocks of samples were overwritten unread"),
            (self.rows_dropped, "rows of samples were dropped: the board's queue was full"),
            (self.replies_dropped, "replies and events were dropped: the board's queue was full"),
            (self.requests_dropped, "requests were dropped: the board's queue was full"),
            (self.bad_frames, "frames were damaged when they reached the board"),
        ];
        counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect()
    }

    /// Maxima of ticks, interrupts and queues on one line.
    #[must_use]
    pub fn line(&self) -> String {
        let (tick, jitter, masked) = (self.longest_tick_us, self.largest_jitter_us, self.longest_masked_us());
        let ticks = if tick > 0 {
            format!("longest tick {tick} µs, jitter {jitter} µs, interrupts masked for {masked:.1} µs at most; ")
        } else {
            // A simulated board's ticks take no time.
            String::new()
        };
        format!("{ticks}at most {} rows and {} replies waiting", self.most_rows_waiting, self.most_replies_waiting)
    }
}

/// Readings of a board's counters, added up over its resets.
#[derive(Clone, Copy, Debug, Default)]
pub struct Readings {
    /// Before the latest reset.
    earlier: Option<Controller>,
    /// The first reading since the run started or the board was reset, and the latest.
    present: Option<(Counters, Counters)>,
}

impl Readings {
    /// Adds a reading. Counts only rise until the board is reset, so a fallen one means that it was reset.
    pub fn take(&mut self, now: Counters) {
        match &mut self.present {
            None => {
                let first = if self.earlier.is_some() { Counters::default() } else { now };
                self.present = Some((first, now));
            }
            Some((_, latest)) if counts(latest).into_iter().zip(counts(&now)).all(|(before, now)| now >= before) => {
                *latest = now;
            }
            Some(_) => {
                self.board_was_reset();
                self.present = Some((Counters::default(), now));
            }
        }
    }

    /// The board was reset and counts from 0.
    pub fn board_was_reset(&mut self) {
        self.earlier = self.sum();
        self.present = None;
    }

    /// The counters of the run so far; none before the first reading.
    #[must_use]
    pub fn sum(&self) -> Option<Controller> {
        let present = self.present.map(|(first, latest)| Controller::between(&first, &latest));
        match (self.earlier, present) {
            (Some(earlier), Some(present)) => Some(earlier.and(present)),
            (one, other) => one.or(other),
        }
    }
}

fn counts(c: &Counters) -> [u32; 5] {
    [c.bad_frames, c.requests_dropped, c.replies_dropped, c.rows_dropped, c.timing.overruns]
}

#[cfg(test)]
mod tests {
    use damprig_protocol::Timing;

    use super::*;

    fn counters(bad_frames: u32, overruns: u32, longest_tick_us: u16) -> Counters {
        let timing = Timing { overruns, longest_tick_us, ..Timing::default() };
        Counters { bad_frames, timing, ..Counters::default() }
    }

    #[test]
    fn counts_from_before_the_run_are_subtracted() {
        let run = Controller::between(&counters(7, 3, 40), &counters(9, 3, 55));
        assert_eq!(run, Controller { bad_frames: 2, longest_tick_us: 55, ..Controller::default() });
        assert_eq!(run.complaints(), ["2 frames were damaged when they reached the board"]);
    }

    #[test]
    fn parts_of_a_run_add_their_counts_and_keep_the_larger_maximum() {
        let (one, other) = (counters(1, 2, 80), counters(4, 0, 30));
        let nothing = Counters::default();
        let sum = Controller::between(&nothing, &one).and(Controller::between(&nothing, &other));
        assert_eq!((sum.bad_frames, sum.overruns, sum.longest_tick_us), (5, 2, 80));
    }

    #[test]
    fn a_board_without_counts_gives_no_complaints() {
        assert!(
            Controller { longest_tick_us: 900, most_rows_waiting: 12, ..Controller::default() }.complaints().is_empty()
        );
    }

    fn bad(bad_frames: u32) -> Counters {
        Counters { bad_frames, ..Counters::default() }
    }

    fn sum(readings: &Readings) -> Option<u64> {
        readings.sum().map(|c| c.bad_frames)
    }

    #[test]
    fn counts_begin_with_the_first_reading_and_go_on_over_a_reset() {
        let mut readings = Readings::default();
        assert_eq!(sum(&readings), None);
        readings.take(bad(10));
        assert_eq!(sum(&readings), Some(0));
        readings.take(bad(12));
        readings.board_was_reset();
        assert_eq!(sum(&readings), Some(2));
        // Counts between the reset and the next reading belong to the run.
        readings.take(bad(1));
        readings.take(bad(4));
        assert_eq!(sum(&readings), Some(6));
    }

    #[test]
    fn a_count_that_has_fallen_means_a_reset() {
        let mut readings = Readings::default();
        [5, 9, 3].into_iter().for_each(|count| readings.take(bad(count)));
        assert_eq!(sum(&readings), Some(7));
    }

    #[test]
    fn a_reset_before_the_first_reading_changes_nothing() {
        let mut readings = Readings::default();
        readings.board_was_reset();
        readings.take(bad(5));
        assert_eq!(sum(&readings), Some(0));
    }
}
