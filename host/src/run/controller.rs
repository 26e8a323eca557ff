//! What of a board's counters belongs to this run: they go on counting from one run to the next, and begin anew with
//! the board.

use damprig_protocol::Counters;

use crate::recording::controller::Controller;

/// Readings of a board's counters, added up over its starts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Readings {
    /// Of the starts of the board before the present one.
    earlier: Option<Controller>,
    /// The first reading since the run or the board began, and the latest.
    present: Option<(Counters, Counters)>,
}

impl Readings {
    /// A reading. Every count of a board that runs on only rises: one that has fallen says that it was reset meanwhile.
    pub(super) fn take(&mut self, now: Counters) {
        match &mut self.present {
            None => {
                let first = if self.earlier.is_some() { Counters::default() } else { now };
                self.present = Some((first, now));
            }
            Some((_, latest)) if counts(latest).into_iter().zip(counts(&now)).all(|(before, now)| now >= before) => {
                *latest = now;
            }
            Some(_) => {
                self.board_began_anew();
                self.present = Some((Counters::default(), now));
            }
        }
    }

    /// The board was reset: it counts from 0.
    pub(super) fn board_began_anew(&mut self) {
        self.earlier = self.sum();
        self.present = None;
    }

    /// What happened in the run so far; none before the first reading.
    pub(super) fn sum(&self) -> Option<Controller> {
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
    use super::*;

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
        readings.board_began_anew();
        assert_eq!(sum(&readings), Some(2));
        // What it counted before it was asked again is of this run too.
        readings.take(bad(1));
        readings.take(bad(4));
        assert_eq!(sum(&readings), Some(6));
    }

    #[test]
    fn a_count_that_has_fallen_tells_of_a_reset_that_nobody_saw() {
        let mut readings = Readings::default();
        [5, 9, 3].into_iter().for_each(|count| readings.take(bad(count)));
        assert_eq!(sum(&readings), Some(7));
    }

    #[test]
    fn a_reset_before_the_first_reading_changes_nothing() {
        let mut readings = Readings::default();
        readings.board_began_anew();
        readings.take(bad(5));
        assert_eq!(sum(&readings), Some(0));
    }
}
