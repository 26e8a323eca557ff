//! Matching of predicted with measured impacts, and the alarm when predicted impacts are missing.

use crate::io::{Invalid, TICK_HZ, not_negative, require};
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most impacts that wait for a partner, predicted and measured each.
const MAX_WAITING: usize = 8;

/// Settings of the matching.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct MatcherConfig {
    /// Largest time between a predicted and a measured impact on the same wall that are paired, s.
    pub window_s: f32,
    /// Time after its instant in which a predicted impact may still be reported by the measurement, s: longer than the
    /// longest contact. After that it counts as missing.
    pub wait_s: f32,
    /// Impulse below which a predicted impact need not be measured, N·s: its pulse may stay below the threshold.
    pub smallest_impulse_n_s: f32,
    /// Missing impacts that raise the alarm, counted on each wall since the last paired impact there.
    pub alarm_after: u8,
}

impl Default for MatcherConfig {
    /// A pulse of 2 ms and 0.02 N·s peaks at 16 N, six times the default threshold.
    fn default() -> Self {
        Self { window_s: 0.02, wait_s: 0.1, smallest_impulse_n_s: 0.02, alarm_after: 3 }
    }
}

impl MatcherConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let (window, wait) = (f64::from(self.window_s), f64::from(self.wait_s));
        require((1e-3..=1.0).contains(&self.window_s), "twin.matching.window_s", window, "from 1 ms to 1 s")?;
        require(
            self.wait_s >= self.window_s && self.wait_s <= 10.0,
            "twin.matching.wait_s",
            wait,
            "from twin.matching.window_s to 10 s",
        )?;
        not_negative("twin.matching.smallest_impulse_n_s", f64::from(self.smallest_impulse_n_s))?;
        require(self.alarm_after > 0, "twin.matching.alarm_after", f64::from(self.alarm_after), "at least 1")
    }
}

/// Counts since the last restart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MatcherCounts {
    /// Predicted impacts that are strong enough to be measured.
    pub predicted: u32,
    /// Measured impacts.
    pub detected: u32,
    /// Pairs of a predicted and a measured impact.
    pub paired: u32,
    /// Predicted impacts that are strong enough and were not measured.
    pub missing: u32,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    tick: u32,
    /// Ticks from the start of `tick`.
    at: f32,
    side: i8,
    impulse_n_s: f32,
    /// The impact is strong enough that it must be measured.
    strong: bool,
}

impl Waiting {
    /// Ticks from this impact to the given time.
    fn until(&self, tick: u32, at: f32) -> f32 {
        tick.wrapping_sub(self.tick).cast_signed() as f32 + at - self.at
    }
}

/// The predictions that were paired with one measured impact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Paired {
    /// Number of predictions. Several bounces of a chatter can share one pulse.
    pub count: u8,
    /// Sum of their impulses, N·s.
    pub impulse_n_s: f32,
    /// Time from the measured impact to the nearest prediction, ticks.
    pub late: f32,
}

impl Paired {
    fn take(&mut self, prediction: &Waiting) {
        self.count += 1;
        self.impulse_n_s += prediction.impulse_n_s;
    }
}

/// State of the matching.
#[derive(Clone, Debug)]
pub struct Matcher {
    window: f32,
    wait: f32,
    smallest_impulse_n_s: f32,
    alarm_after: u8,
    predicted: Vec<Waiting, MAX_WAITING>,
    detected: Vec<Waiting, MAX_WAITING>,
    /// Missing impacts since the last paired one, at the wall at −d and at +d: a dead sensor at one wall is told although the
    /// other measures.
    missing_in_a_row: [u8; 2],
    counts: MatcherCounts,
}

impl Matcher {
    /// A matcher with validated settings.
    #[must_use]
    pub fn new(config: &MatcherConfig) -> Self {
        Self {
            window: config.window_s * TICK_HZ,
            wait: config.wait_s * TICK_HZ,
            smallest_impulse_n_s: config.smallest_impulse_n_s,
            alarm_after: config.alarm_after,
            predicted: Vec::new(),
            detected: Vec::new(),
            missing_in_a_row: [0; 2],
            counts: MatcherCounts::default(),
        }
    }

    /// Resets the counts and drops all waiting impacts.
    pub fn restart(&mut self) {
        self.predicted.clear();
        self.detected.clear();
        self.missing_in_a_row = [0; 2];
        self.counts = MatcherCounts::default();
    }

    /// Counts since the restart.
    #[must_use]
    pub fn counts(&self) -> &MatcherCounts {
        &self.counts
    }

    /// The alarm is raised: this many predicted impacts were missing since the last paired one on their wall.
    #[must_use]
    pub fn alarm(&self) -> bool {
        let [low, high] = self.missing_in_a_row;
        low.saturating_add(high) >= self.alarm_after
    }

    /// Takes a predicted impact, `at` ticks from the start of `tick`.
    pub fn predict(&mut self, tick: u32, at: f32, side: i8, impulse_n_s: f32) {
        let strong = impulse_n_s >= self.smallest_impulse_n_s;
        self.counts.predicted = self.counts.predicted.wrapping_add(u32::from(strong));
        let prediction = Waiting { tick, at, side, impulse_n_s, strong };
        if take_nearest(&mut self.detected, &prediction, self.window).is_some() {
            self.pair(side);
        } else if !self.predicted.is_full() || strong && self.make_room() {
            let _ = self.predicted.push(prediction);
        }
    }

    /// Takes a measured impact, `at` ticks from the start of `tick`, with a pulse of `length` ticks. Pairs it with the
    /// nearest prediction, and with the predictions that fall into the same pulse.
    pub fn detect(&mut self, tick: u32, at: f32, side: i8, length: f32) -> Paired {
        self.counts.detected = self.counts.detected.wrapping_add(1);
        let detection = Waiting { tick, at, side, impulse_n_s: 0.0, strong: false };
        let mut paired = Paired::default();
        let Some(nearest) = take_nearest(&mut self.predicted, &detection, self.window) else {
            if self.detected.is_full() {
                self.detected.remove(0);
            }
            let _ = self.detected.push(detection);
            return paired;
        };
        self.pair(side);
        paired.take(&nearest);
        paired.late = detection.until(nearest.tick, nearest.at);
        self.predicted.retain(|waiting| {
            let same = waiting.side == side && libm::fabsf(nearest.until(waiting.tick, waiting.at)) <= length;
            if same {
                paired.take(waiting);
            }
            !same
        });
        paired
    }

    fn pair(&mut self, side: i8) {
        self.counts.paired = self.counts.paired.wrapping_add(1);
        self.missing_in_a_row[usize::from(side > 0)] = 0;
    }

    /// Drops the oldest prediction. It counts as missing if it was strong.
    fn make_room(&mut self) -> bool {
        let oldest = self.predicted.remove(0);
        self.miss(&oldest);
        true
    }

    fn miss(&mut self, prediction: &Waiting) {
        if prediction.strong {
            self.counts.missing = self.counts.missing.wrapping_add(1);
            let in_a_row = &mut self.missing_in_a_row[usize::from(prediction.side > 0)];
            *in_a_row = in_a_row.saturating_add(1);
        }
    }

    /// Drops the impacts that have waited too long at the start of `tick`.
    pub fn expire(&mut self, tick: u32) {
        let (window, wait) = (self.window, self.wait);
        self.detected.retain(|waiting| waiting.until(tick, 0.0) <= window + 2.0);
        while let Some(place) = self.predicted.iter().position(|waiting| waiting.until(tick, 0.0) > wait) {
            let late = self.predicted.remove(place);
            self.miss(&late);
        }
    }
}

/// Removes from `waiting` the nearest partner within the window and returns it.
fn take_nearest(waiting: &mut Vec<Waiting, MAX_WAITING>, partner: &Waiting, window: f32) -> Option<Waiting> {
    let mut nearest = None;
    let mut least = window;
    for (place, candidate) in waiting.iter().enumerate() {
        let apart = libm::fabsf(candidate.until(partner.tick, partner.at));
        if candidate.side == partner.side && apart <= least {
            (nearest, least) = (Some(place), apart);
        }
    }
    nearest.map(|place| waiting.remove(place))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matcher() -> Matcher {
        Matcher::new(&MatcherConfig::default())
    }

    #[test]
    fn impacts_pair_in_either_order_within_the_window_and_on_the_same_side() {
        let mut matcher = matcher();
        matcher.predict(100, 0.5, 1, 0.1);
        assert!(matcher.detect(105, 0.0, -1, 2.0).count == 0, "the other wall");
        assert!(matcher.detect(110, 0.0, 1, 2.0).count == 1);
        assert!(matcher.detect(111, 0.0, 1, 2.0).count == 0, "paired once only");
        assert!(matcher.detect(200, 0.0, 1, 2.0).count == 0);
        matcher.predict(205, -1.0, 1, 0.1);
        assert_eq!((matcher.counts().paired, matcher.counts().detected), (2, 4));
        matcher.predict(300, 0.0, 1, 0.1);
        assert!(matcher.detect(321, 0.0, 1, 2.0).count == 0, "beyond 20 ms");
    }

    #[test]
    fn missing_strong_impacts_raise_the_alarm_and_a_matched_one_clears_it() {
        let mut matcher = matcher();
        for n in 0..3 {
            matcher.predict(200 * n, 0.0, 1, 0.1);
            matcher.predict(200 * n + 1, 0.0, 1, 0.001);
            assert!(!matcher.alarm());
            (200 * n..200 * n + 200).for_each(|tick| matcher.expire(tick));
        }
        assert!(matcher.alarm() && matcher.counts().missing == 3, "weak ones need not come");
        matcher.predict(1000, 0.0, 1, 0.1);
        matcher.detect(1001, 0.0, 1, 2.0);
        assert!(!matcher.alarm());
    }

    #[test]
    fn impacts_missing_at_one_wall_raise_the_alarm_although_the_other_wall_measures() {
        let mut matcher = matcher();
        for n in 0..3 {
            assert!(!matcher.alarm());
            matcher.predict(400 * n, 0.0, 1, 0.1);
            matcher.predict(400 * n + 200, 0.0, -1, 0.1);
            matcher.detect(400 * n + 201, 0.0, -1, 2.0);
            (400 * n..400 * n + 400).for_each(|tick| matcher.expire(tick));
        }
        assert!(matcher.alarm());
        matcher.predict(1200, 0.0, 1, 0.1);
        matcher.detect(1201, 0.0, 1, 2.0);
        assert!(!matcher.alarm());
    }

    #[test]
    fn bounces_within_one_pulse_are_all_paired_with_it() {
        let mut matcher = matcher();
        for at in [0.0, 1.0, 1.5, 9.0] {
            matcher.predict(100, at, 1, 0.1);
        }
        let paired = matcher.detect(104, -4.0, 1, 3.0);
        assert!(paired.count == 3 && (paired.impulse_n_s - 0.3).abs() < 1e-6, "{paired:?}");
        (100..300).for_each(|tick| matcher.expire(tick));
        assert_eq!(matcher.counts().missing, 1);
    }

    #[test]
    fn tick_counters_may_wrap() {
        let mut matcher = matcher();
        matcher.predict(u32::MAX, 0.5, 1, 0.1);
        assert!(matcher.detect(3, 0.0, 1, 2.0).count == 1);
    }

    #[test]
    fn a_burst_of_predictions_is_bounded_and_the_lost_ones_count_as_missing() {
        let mut matcher = matcher();
        (0..20).for_each(|tick| matcher.predict(tick, 0.0, 1, 0.1));
        assert_eq!(matcher.counts().missing, 12);
    }
}
