//! What has arrived of one experiment, and what has not.
//!
//! Events overtake telemetry on the line (they go first), so a row's point is told by its tick, and an
//! experiment is over only when the rows up to its last tick are there too.

use damprig_core::control::stepped_sine::FADE_S;
use damprig_core::rig::TICK_HZ;
use damprig_protocol::Telemetry;

/// Waits for rows that are still under way when the experiment has finished. A row that was lost on the line
/// does not come, however long one waits.
const MOST_QUIET_TURNS: u32 = 10;

/// Ticks from the last point to the word that the experiment is over, besides the experiment's own ramp; without one
/// the drive fades out in a fifth of that.
const OVERDUE_TICKS: u32 = (5.0 * FADE_S * TICK_HZ) as u32;

/// The state of one experiment's arrivals.
#[derive(Clone, Debug)]
pub(super) struct Track {
    every_ticks: u16,
    /// Last tick of each point taken, by index.
    done: Vec<Option<u32>>,
    lost: Vec<u16>,
    end_tick: Option<u32>,
    latest_tick: u32,
    latest_row: Option<u32>,
    /// Rows are of this experiment: a real board sends telemetry before the start too.
    fresh: bool,
    stale_tick: Option<u32>,
    next_seq: Option<u32>,
    missing_messages: u64,
    quiet_turns: u32,
    overdue_ticks: u32,
}

impl Track {
    pub(super) fn new(points: usize, every_ticks: u16, is_granted: bool) -> Self {
        Self {
            every_ticks,
            done: vec![None; points],
            lost: Vec::new(),
            end_tick: None,
            latest_tick: 0,
            latest_row: None,
            fresh: is_granted,
            stale_tick: None,
            next_seq: None,
            missing_messages: 0,
            quiet_turns: 0,
            overdue_ticks: OVERDUE_TICKS,
        }
    }

    /// For an experiment whose drive fades out over `ramp_s`.
    pub(super) fn with_ramp(mut self, ramp_s: f64) -> Self {
        self.overdue_ticks = OVERDUE_TICKS.saturating_add((ramp_s * f64::from(TICK_HZ)) as u32);
        self
    }

    /// The rows of a message that belong to this experiment, each with its tick.
    pub(super) fn rows<'m>(&mut self, message: &'m Telemetry) -> Vec<(u32, &'m [f32])> {
        let signals = usize::from(message.width);
        let count = message.values.len() / signals.max(1);
        if !self.fresh {
            // Message numbers and ticks restart with the experiment.
            self.fresh = message.seq == 0 || self.stale_tick.is_some_and(|stale| message.first_tick < stale);
            if !self.fresh {
                self.stale_tick = Some(message.first_tick);
                return Vec::new();
            }
        }
        self.missing_messages += u64::from(message.seq.saturating_sub(self.next_seq.unwrap_or(0)));
        self.next_seq = Some(message.seq.wrapping_add(1));
        self.quiet_turns = 0;
        let tick = |i: usize| message.first_tick + i as u32 * u32::from(message.every_ticks);
        let all = (0..count).map(|i| (tick(i), &message.values[i * signals..(i + 1) * signals]));
        let own: Vec<_> = all.filter(|(tick, _)| self.end_tick.is_none_or(|end| *tick <= end)).collect();
        if count > 0 {
            self.latest_row = Some(tick(count - 1));
        }
        if let Some((tick, _)) = own.last() {
            self.latest_tick = self.latest_tick.max(*tick);
        }
        own
    }

    /// Place in the frequency list of the point that a tick belongs to.
    pub(super) fn point_of(&self, tick: u32) -> usize {
        self.done.iter().rposition(|end| end.is_some_and(|end| end < tick)).map_or(0, |last| last + 1)
    }

    /// A result is there; whether it is a new one.
    pub(super) fn point_done(&mut self, index: u16, tick: u32) -> bool {
        self.latest_tick = self.latest_tick.max(tick);
        match self.done.get_mut(usize::from(index)) {
            Some(slot) => slot.replace(tick).is_none(),
            None => false,
        }
    }

    /// A result will not come any more.
    pub(super) fn point_lost(&mut self, index: u16) {
        self.lost.push(index);
    }

    /// Results that will not come any more.
    pub(super) fn lost(&self) -> usize {
        self.lost.len()
    }

    /// Whether the experiment's end has been heard of.
    pub(super) fn has_finished(&self) -> bool {
        self.end_tick.is_some()
    }

    pub(super) fn finished(&mut self, tick: u32) {
        self.end_tick = Some(tick);
        self.latest_tick = self.latest_tick.max(tick);
        self.quiet_turns = 0;
    }

    /// All points are there, and much more time has passed than the drive needs to fade out: the experiment is
    /// over, and the word about it was lost.
    pub(super) fn is_overdue(&self) -> bool {
        let last = self.done.last().copied().flatten();
        self.end_tick.is_none() && last.is_some_and(|last| self.latest_tick > last.saturating_add(self.overdue_ticks))
    }

    /// Nothing came for a moment.
    pub(super) fn quiet(&mut self) {
        self.quiet_turns += 1;
    }

    /// The experiment has finished and its rows are there, or will not come any more.
    pub(super) fn is_complete(&self) -> bool {
        let Some(end) = self.end_tick else { return false };
        let every = u32::from(self.every_ticks);
        if every == 0 || self.quiet_turns > MOST_QUIET_TURNS {
            return true;
        }
        self.latest_row.is_some_and(|row| row >= end - end % every)
    }

    /// The latest tick heard of.
    pub(super) fn latest_tick(&self) -> u32 {
        self.latest_tick
    }

    /// Telemetry messages missing by their numbers.
    pub(super) fn missing_messages(&self) -> u64 {
        self.missing_messages
    }

    /// Points before `until` whose result has not arrived and may still be asked for.
    pub(super) fn missing_points(&self, until: u16) -> Vec<u16> {
        let missing = |i: &u16| self.done.get(usize::from(*i)) == Some(&None) && !self.lost.contains(i);
        (0..until).filter(missing).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(seq: u32, first_tick: u32, rows: usize) -> Telemetry {
        Telemetry { seq, first_tick, every_ticks: 10, width: 2, values: (0..2 * rows).map(|i| i as f32).collect() }
    }

    #[test]
    fn a_row_that_an_event_overtook_still_belongs_to_its_point() {
        let mut track = Track::new(2, 10, true);
        track.point_done(0, 105);
        let late = message(0, 90, 3);
        let points: Vec<_> = track.rows(&late).into_iter().map(|(tick, _)| (tick, track.point_of(tick))).collect();
        assert_eq!(points, [(90, 0), (100, 0), (110, 1)]);
    }

    #[test]
    fn an_experiment_ends_when_its_last_row_is_there() {
        let mut track = Track::new(1, 10, true);
        track.point_done(0, 100);
        track.finished(125);
        assert!(!track.is_complete());
        track.rows(&message(0, 110, 2));
        assert!(track.is_complete());
    }

    #[test]
    fn a_last_row_that_was_lost_is_not_waited_for_for_ever() {
        let mut track = Track::new(1, 10, true);
        track.finished(125);
        (0..=MOST_QUIET_TURNS).for_each(|_| track.quiet());
        assert!(track.is_complete());
        assert_eq!(track.missing_points(1), [0]);
    }

    #[test]
    fn a_result_that_comes_twice_counts_once_and_a_lost_one_is_not_asked_for_again() {
        let mut track = Track::new(3, 10, true);
        assert!(track.point_done(1, 50));
        assert!(!track.point_done(1, 50));
        track.point_lost(0);
        assert_eq!((track.missing_points(3), track.lost()), (vec![2], 1));
    }

    #[test]
    fn a_gap_in_the_numbers_is_counted() {
        let mut track = Track::new(1, 10, true);
        track.rows(&message(0, 0, 2));
        track.rows(&message(3, 60, 2));
        assert_eq!(track.missing_messages(), 2);
    }

    #[test]
    fn rows_from_before_the_start_of_a_real_rig_are_passed_over() {
        let mut track = Track::new(1, 10, false);
        assert!(track.rows(&message(7, 50_000, 2)).is_empty());
        assert_eq!(track.rows(&message(0, 0, 2)).len(), 2);
        // Even when the very first message is lost.
        let mut track = Track::new(1, 10, false);
        assert!(track.rows(&message(7, 50_000, 2)).is_empty());
        assert_eq!(track.rows(&message(1, 20, 2)).len(), 2);
        assert_eq!(track.missing_messages(), 1);
    }
}
