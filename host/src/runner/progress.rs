//! Progress of one segment: which points, rows and messages have arrived, and when the segment is over.
//!
//! The device sends events before telemetry, so events overtake rows. A row's point follows from its tick, and a segment
//! is over only when the rows up to its last tick have arrived.

use std::ops::Range;

use damprig_core::control::stepped_sine::FADE_S;
use damprig_core::io::TICK_HZ;
use damprig_protocol::{MAX_VALUES, Telemetry};

use super::reorder_buffer::ReorderBuffer;

/// Receive turns to wait for rows after the experiment has finished: half a second, and the time in which a board fills a
/// message.
fn most_quiet_turns(every_ticks: u16) -> u32 {
    const TURNS_PER_S: u32 = 20;
    // Two signals make the longest message.
    let message_ticks = u32::from(every_ticks) * (MAX_VALUES / 2) as u32;
    TURNS_PER_S / 2 + (message_ticks * TURNS_PER_S / TICK_HZ as u32).min(10 * TURNS_PER_S)
}

/// Quiet turns after which a missing message is given up.
const QUIET_TURNS_FOR_LATE: u32 = 3;

/// Ticks from the last point after which the end of the experiment is overdue, besides the experiment's own ramp: five times
/// the fade of a drive without a ramp.
const OVERDUE_TICKS: u32 = (5.0 * FADE_S * TICK_HZ) as u32;

/// Messages, rows and points that have arrived of one segment.
#[derive(Clone, Debug)]
pub(super) struct SegmentProgress {
    every_ticks: u16,
    /// Its points, by their places in the experiment's frequency list.
    points: Range<usize>,
    /// Last tick of each point taken, in their order.
    done: Vec<Option<u32>>,
    lost: Vec<u16>,
    end_tick: Option<u32>,
    latest_tick: u32,
    latest_row: Option<u32>,
    /// Rows are of this segment: a board with its own clock sends telemetry before the start too.
    fresh: bool,
    stale_tick: Option<u32>,
    reorder: ReorderBuffer,
    quiet_turns: u32,
    overdue_ticks: u32,
}

impl SegmentProgress {
    pub(super) fn new(points: Range<usize>, every_ticks: u16, is_granted: bool) -> Self {
        Self {
            every_ticks,
            done: vec![None; points.len()],
            points,
            lost: Vec::new(),
            end_tick: None,
            latest_tick: 0,
            latest_row: None,
            fresh: is_granted,
            stale_tick: None,
            reorder: ReorderBuffer::default(),
            quiet_turns: 0,
            overdue_ticks: OVERDUE_TICKS,
        }
    }

    /// Sets the ramp time over which the experiment's drive fades out, s.
    pub(super) fn with_ramp(mut self, ramp_s: f64) -> Self {
        self.overdue_ticks = OVERDUE_TICKS.saturating_add((ramp_s * f64::from(TICK_HZ)) as u32);
        self
    }

    /// Adds a message; returns the messages of this segment that are next in order.
    pub(super) fn arrived(&mut self, message: Telemetry) -> Vec<Telemetry> {
        if !self.fresh {
            // Message numbers and ticks restart with the experiment.
            self.fresh = message.seq == 0 || self.stale_tick.is_some_and(|stale| message.first_tick < stale);
            if !self.fresh {
                self.stale_tick = Some(message.first_tick);
                return Vec::new();
            }
        }
        self.quiet_turns = 0;
        self.reorder.push(message)
    }

    /// Returns the messages held for a missing one, after some quiet turns.
    pub(super) fn held(&mut self) -> Vec<Telemetry> {
        if self.is_quiet() { self.reorder.flush() } else { Vec::new() }
    }

    /// The rows of the next message in order, each with its tick, up to the segment's end.
    pub(super) fn rows<'m>(&mut self, message: &'m Telemetry) -> Vec<(u32, &'m [f32])> {
        let rows = message.values.chunks_exact(usize::from(message.width).max(1)).enumerate();
        let tick = |i: usize| message.first_tick.saturating_add(i as u32 * u32::from(message.every_ticks));
        let own: Vec<_> = rows
            .map(|(i, values)| (tick(i), values))
            .inspect(|(tick, _)| self.latest_row = Some(*tick))
            .filter(|(tick, _)| self.end_tick.is_none_or(|end| *tick <= end))
            .collect();
        if let Some((tick, _)) = own.last() {
            self.latest_tick = self.latest_tick.max(*tick);
        }
        own
    }

    /// Place in the frequency list of the point that a tick belongs to; the last one's after its end.
    pub(super) fn point_of(&self, tick: u32) -> usize {
        let over = self.done.iter().rposition(|end| end.is_some_and(|end| end < tick)).map_or(0, |last| last + 1);
        (self.points.start + over).min(self.points.end - 1)
    }

    /// Stores the last tick of a point; returns whether the point is new.
    pub(super) fn point_done(&mut self, index: u16, tick: u32) -> bool {
        self.latest_tick = self.latest_tick.max(tick);
        let slot = self.slot(index).and_then(|slot| self.done.get_mut(slot));
        slot.is_some_and(|slot| slot.replace(tick).is_none())
    }

    fn slot(&self, index: u16) -> Option<usize> {
        usize::from(index).checked_sub(self.points.start).filter(|slot| *slot < self.done.len())
    }

    /// Notes that the device no longer has the result of a point.
    pub(super) fn point_lost(&mut self, index: u16) {
        self.lost.push(index);
    }

    /// Whether the device has reported the end.
    pub(super) fn has_finished(&self) -> bool {
        self.end_tick.is_some()
    }

    /// Whether a tick is after the end that the device has reported.
    pub(super) fn is_after_end(&self, tick: u32) -> bool {
        self.end_tick.is_some_and(|end| tick > end)
    }

    /// Stores the last tick of the segment; returns whether this is new.
    pub(super) fn finished(&mut self, tick: u32) -> bool {
        if self.end_tick.is_some() {
            return false;
        }
        self.end_tick = Some(tick);
        self.latest_tick = self.latest_tick.max(tick);
        self.quiet_turns = 0;
        true
    }

    /// Whether the end was probably lost: all points have arrived, and much more time has passed than the drive needs to
    /// fade out.
    pub(super) fn is_overdue(&self) -> bool {
        let last = self.done.last().copied().flatten();
        self.end_tick.is_none() && last.is_some_and(|last| self.latest_tick > last.saturating_add(self.overdue_ticks))
    }

    /// Counts a receive turn in which nothing arrived.
    pub(super) fn quiet(&mut self) {
        self.quiet_turns += 1;
    }

    /// Whether a missing message is given up.
    pub(super) fn is_quiet(&self) -> bool {
        self.quiet_turns >= QUIET_TURNS_FOR_LATE
    }

    /// Whether the device has finished, and its rows have arrived or are given up.
    pub(super) fn is_complete(&self) -> bool {
        let Some(end) = self.end_tick else { return false };
        let every = u32::from(self.every_ticks);
        if every == 0 || self.quiet_turns > most_quiet_turns(self.every_ticks) {
            return true;
        }
        self.latest_row.is_some_and(|row| row >= end - end % every)
    }

    /// Place in the frequency list after the last point.
    pub(super) fn end_index(&self) -> usize {
        self.points.end
    }

    /// The latest tick in any message.
    pub(super) fn latest_tick(&self) -> u32 {
        self.latest_tick
    }

    /// Telemetry messages missing by their numbers.
    pub(super) fn missing_messages(&self) -> u64 {
        self.reorder.missing()
    }

    /// Points before `until` whose result has not arrived and can be requested.
    pub(super) fn missing_points(&self, until: u16) -> Vec<u16> {
        let is_open = |i: &u16| self.slot(*i).is_some_and(|slot| self.done[slot].is_none()) && !self.lost.contains(i);
        (0..until).filter(is_open).collect()
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
        let mut progress = SegmentProgress::new(0..2, 10, true);
        progress.point_done(0, 105);
        let late = message(0, 90, 3);
        let points: Vec<_> =
            progress.rows(&late).into_iter().map(|(tick, _)| (tick, progress.point_of(tick))).collect();
        assert_eq!(points, [(90, 0), (100, 0), (110, 1)]);
    }

    #[test]
    fn a_segment_ends_when_its_last_row_has_arrived() {
        let mut progress = SegmentProgress::new(0..1, 10, true);
        progress.point_done(0, 100);
        progress.finished(125);
        assert!(!progress.is_complete());
        progress.rows(&message(0, 110, 2));
        assert!(progress.is_complete());
    }

    #[test]
    fn a_lost_last_row_is_given_up() {
        let mut progress = SegmentProgress::new(0..1, 10, true);
        progress.finished(125);
        (0..=most_quiet_turns(10)).for_each(|_| progress.quiet());
        assert!(progress.is_complete());
        assert_eq!(progress.missing_points(1), [0]);
    }

    #[test]
    fn a_repeated_result_counts_once_and_a_lost_one_is_not_requested_again() {
        let mut progress = SegmentProgress::new(0..3, 10, true);
        assert!(progress.point_done(1, 50));
        assert!(!progress.point_done(1, 50));
        progress.point_lost(0);
        assert_eq!(progress.missing_points(3), [2]);
    }

    #[test]
    fn a_segment_that_starts_in_the_middle_of_the_list_has_only_its_own_points() {
        let mut progress = SegmentProgress::new(4..6, 10, true);
        assert_eq!((progress.point_of(0), progress.missing_points(6)), (4, vec![4, 5]));
        assert!(!progress.point_done(3, 50), "that was another start");
        assert!(progress.point_done(4, 100));
        assert_eq!((progress.point_of(110), progress.missing_points(6)), (5, vec![5]));
        assert!(progress.point_done(5, 200));
        assert_eq!(progress.point_of(210), 5);
    }

    #[test]
    fn a_gap_in_the_numbers_is_counted_after_quiet_turns() {
        let mut progress = SegmentProgress::new(0..1, 10, true);
        assert_eq!(progress.arrived(message(0, 0, 2)).len(), 1);
        assert!(progress.arrived(message(3, 60, 2)).is_empty());
        (0..QUIET_TURNS_FOR_LATE).for_each(|_| progress.quiet());
        assert_eq!(progress.held().len(), 1);
        assert_eq!(progress.missing_messages(), 2);
    }

    #[test]
    fn rows_from_before_the_start_of_a_real_rig_are_ignored() {
        let mut progress = SegmentProgress::new(0..1, 10, false);
        assert!(progress.arrived(message(7, 50_000, 2)).is_empty());
        assert_eq!(progress.arrived(message(0, 0, 2)).len(), 1);
        // The very first message may be lost too.
        let mut progress = SegmentProgress::new(0..1, 10, false);
        assert!(progress.arrived(message(7, 50_000, 2)).is_empty());
        assert!(progress.arrived(message(1, 20, 2)).is_empty());
        (0..QUIET_TURNS_FOR_LATE).for_each(|_| progress.quiet());
        assert_eq!(progress.held().len(), 1);
        assert_eq!(progress.missing_messages(), 1);
    }
}
