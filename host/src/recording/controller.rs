//! How the controller itself kept up in a run: its ticks, its queues, its side of the link.
//!
//! The board counts since its supply came on; what of that belongs to a run is found in [`crate::run`]. Rows that
//! are missing from the samples, whoever lost them, are the [`super::manifest::Counters`]'.

use damprig_protocol::Counters;
use serde::{Deserialize, Serialize};

/// Counts are of the run alone; the largest values are those since the board started, which the board keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Controller {
    /// Blocks of samples that were overwritten before a tick had read them: each is a tick that came too late.
    pub overruns: u64,
    /// Rows of samples that found no room in the queue to the line.
    pub rows_dropped: u64,
    /// Replies and events that found no room in the queue to the line; they were asked for again.
    pub replies_dropped: u64,
    /// Requests that found no room in the queue from the line; they were repeated.
    pub requests_dropped: u64,
    /// Frames that were too long, did not decode or failed their checksum.
    pub bad_frames: u64,
    /// Longest tick, µs; 0 on a simulated board, as are the next two.
    pub longest_tick_us: u16,
    /// Largest deviation of a tick's start from its place, µs.
    pub largest_jitter_us: u16,
    /// Longest time for which interrupts were masked, 0.1 µs.
    pub longest_masked_tenths_us: u16,
    /// Most rows of samples that waited for the line at once.
    pub most_rows_waiting: u8,
    /// Most replies and events that waited for the line at once.
    pub most_replies_waiting: u8,
}

impl Controller {
    /// What happened between two readings of a board that was not reset in between.
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

    /// Of two parts of a run: counts add up, of the largest values the larger is kept.
    #[must_use]
    pub fn and(self, more: Self) -> Self {
        Self {
            overruns: self.overruns + more.overruns,
            rows_dropped: self.rows_dropped + more.rows_dropped,
            replies_dropped: self.replies_dropped + more.replies_dropped,
            requests_dropped: self.requests_dropped + more.requests_dropped,
            bad_frames: self.bad_frames + more.bad_frames,
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

    /// What deserves a second look, in words; nothing when every count is 0.
    #[must_use]
    pub fn complaints(&self) -> Vec<String> {
        let counted = [
            (self.overruns, "ticks of the board came too late: blocks of samples were overwritten unread"),
            (self.rows_dropped, "rows of samples found no room in the board's queue"),
            (self.replies_dropped, "replies and events found no room in the board's queue"),
            (self.requests_dropped, "requests found no room in the board's queue"),
            (self.bad_frames, "frames came to the board broken"),
        ];
        counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect()
    }

    /// Ticks, interrupts and queues on one line, for the terminal.
    #[must_use]
    pub fn line(&self) -> String {
        let (tick, jitter, masked) = (self.longest_tick_us, self.largest_jitter_us, self.longest_masked_us());
        let ticks = if tick > 0 {
            format!("longest tick {tick} µs, jitter {jitter} µs, interrupts masked for {masked:.1} µs at most; ")
        } else {
            // A simulated board's take no time.
            String::new()
        };
        format!("{ticks}at most {} rows and {} replies waiting", self.most_rows_waiting, self.most_replies_waiting)
    }
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
    fn what_a_board_counted_before_the_run_is_not_the_runs() {
        let run = Controller::between(&counters(7, 3, 40), &counters(9, 3, 55));
        assert_eq!(run, Controller { bad_frames: 2, longest_tick_us: 55, ..Controller::default() });
        assert_eq!(run.complaints(), ["2 frames came to the board broken"]);
    }

    #[test]
    fn parts_of_a_run_add_their_counts_and_keep_the_larger_of_their_largest() {
        let (one, other) = (counters(1, 2, 80), counters(4, 0, 30));
        let nothing = Counters::default();
        let sum = Controller::between(&nothing, &one).and(Controller::between(&nothing, &other));
        assert_eq!((sum.bad_frames, sum.overruns, sum.longest_tick_us), (5, 2, 80));
    }

    #[test]
    fn a_board_that_kept_up_gives_nothing_to_complain_of() {
        assert!(
            Controller { longest_tick_us: 900, most_rows_waiting: 12, ..Controller::default() }.complaints().is_empty()
        );
    }
}
