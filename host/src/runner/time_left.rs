//! Estimates how long a run still takes: the one estimate that page, terminal view and terminal show.
//!
//! It is a range of wall time. Each point that is missing takes what the campaign expects of it times a ratio of wall time to
//! expected rig time: at least the smallest and at most the largest ratio of the points measured so far. While there are
//! few of them, bounds from the campaign help: no wait at the low end, longest dwells and the structure's decay from its limit
//! before each point at the high end, or a multiple of the slowest point if that is less. Time in which the run waits for a person is not counted.

use std::fmt;
use std::time::{Duration, Instant};

use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::run_folder::schema::journal_state::JournalState;

/// Time from estimate to estimate.
const EVERY: Duration = Duration::from_millis(500);

/// Points after which their ratios are used alone.
const ENOUGH: u32 = 3;

/// How much slower than the slowest point so far a point may be: while there are few, and while no experiment has been measured to
/// its end.
const SLOWER_THAN_FEW: f64 = 3.0;
const SLOWER: f64 = 1.5;

/// Time for messages, settings and what the campaign does not state, as a share of the rest.
const OVERHEAD: f64 = 1.25;

/// What a run still takes, as a range of wall time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLeft {
    /// The shortest time, s.
    pub low_s: f64,
    /// The longest time, s.
    pub high_s: f64,
}

impl fmt::Display for TimeLeft {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let step_s = match self.high_s {
            high if high < 60.0 => 5.0,
            high if high < 600.0 => 30.0,
            high if high < 7200.0 => 300.0,
            _ => 1800.0,
        };
        let low_s = (self.low_s / step_s).floor() * step_s;
        let high_s = ((self.high_s / step_s).ceil() * step_s).max(step_s);
        if low_s < step_s {
            return write!(f, "up to {} left", shown(high_s));
        }
        if low_s == high_s {
            return write!(f, "about {} left", shown(high_s));
        }
        write!(f, "{} to {} left", shown(low_s), shown(high_s))
    }
}

/// Whole hours, minutes and seconds.
fn shown(time_s: f64) -> String {
    let time_s = time_s.min(1e9) as u64;
    let (hours, minutes, seconds) = (time_s / 3600, time_s / 60 % 60, time_s % 60);
    let part = |count: u64, unit: &str| (count > 0).then(|| format!("{count} {unit}"));
    let parts = [part(hours, "h"), part(minutes, "min"), part(seconds, "s")];
    parts.into_iter().flatten().collect::<Vec<String>>().join(" ")
}

/// Rig time that the missing points take, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Missing {
    /// As [`Campaign::expected_s`] has it.
    expected_s: f64,
    /// With the longest dwells and waits for rest.
    longest_s: f64,
}

/// Estimates the time left while a run goes on.
#[derive(Debug)]
pub(super) struct Estimate {
    /// Wall seconds for each second of rig time; none of a rig whose time the host grants.
    pace: Option<f64>,
    began: Instant,
    /// Time in which the run stood, and when it began to stand.
    stood: Duration,
    stands: Option<Instant>,
    /// When the last point was measured.
    point_at: Duration,
    /// Least and largest ratio of the points so far, and their number.
    ratios: (f64, f64),
    points: u32,
    /// Whether an experiment was measured to its end.
    has_whole: bool,
    told: Option<Instant>,
}

impl Estimate {
    /// Of a run that begins; `speed` is the rig seconds per second of a rig with its own clock.
    pub(super) fn new(speed: Option<f64>) -> Self {
        Self {
            pace: speed.filter(|speed| *speed > 0.0).map(f64::recip),
            began: Instant::now(),
            stood: Duration::ZERO,
            stands: None,
            point_at: Duration::ZERO,
            ratios: (f64::INFINITY, 0.0),
            points: 0,
            has_whole: false,
            told: None,
        }
    }

    /// Time in which the run did not stand.
    fn active(&self) -> Duration {
        let stands = self.stands.map_or(Duration::ZERO, |since| since.elapsed());
        self.began.elapsed().saturating_sub(self.stood + stands)
    }

    /// The run waits for a person or for the link from now on.
    pub(super) fn stand(&mut self) {
        self.stands.get_or_insert_with(Instant::now);
    }

    /// The run goes on.
    pub(super) fn go_on(&mut self) {
        self.stood += self.stands.take().map_or(Duration::ZERO, |since| since.elapsed());
    }

    /// A point was measured, of which the campaign expects this much rig time.
    pub(super) fn point(&mut self, expected_s: f64) {
        let active = self.active();
        if expected_s > 0.0 {
            let ratio = active.saturating_sub(self.point_at).as_secs_f64() / expected_s;
            self.ratios = (self.ratios.0.min(ratio), self.ratios.1.max(ratio));
            self.points += 1;
        }
        self.point_at = active;
    }

    /// An experiment was measured to its end.
    pub(super) fn is_whole(&mut self) {
        self.has_whole = true;
    }

    /// The estimate, when it is time for a new one.
    pub(super) fn next(&mut self, campaign: &Campaign, journal: &JournalState) -> Option<TimeLeft> {
        if self.told.is_some_and(|told| told.elapsed() < EVERY) {
            return None;
        }
        self.told = Some(Instant::now());
        self.left(missing(campaign, journal))
    }

    fn left(&self, Missing { expected_s, longest_s }: Missing) -> Option<TimeLeft> {
        let pace = self.pace.unwrap_or(self.ratios.0);
        if !pace.is_finite() || expected_s <= 0.0 {
            return None;
        }
        let bound_s = longest_s * pace * OVERHEAD;
        let low_s = expected_s * if self.points < ENOUGH { pace } else { self.ratios.0 };
        let slowest_s = expected_s * self.ratios.1;
        let high_s = match (self.points, self.has_whole) {
            (0, _) => bound_s,
            (points, _) if points < ENOUGH => (SLOWER_THAN_FEW * slowest_s).min(bound_s.max(slowest_s)),
            (_, false) => (SLOWER * slowest_s).min(bound_s.max(slowest_s)),
            (_, true) => slowest_s,
        };
        let since_s = self.active().saturating_sub(self.point_at).as_secs_f64();
        let low_s = (low_s - since_s).max(0.0);
        Some(TimeLeft { low_s, high_s: (high_s - since_s).max(low_s) })
    }
}

/// What the points take that a campaign's run has not measured.
fn missing(campaign: &Campaign, journal: &JournalState) -> Missing {
    let mut sum = Missing::default();
    for experiment in &campaign.experiments {
        for set_up in experiment.set_ups.iter().filter_map(|index| campaign.set_ups.get(*index)) {
            let known = journal.known(&set_up.name, experiment);
            let points = known.points();
            let left: usize =
                journal.missing(&set_up.name, &experiment.name, points).iter().map(ExactSizeIterator::len).sum();
            let share = left as f64 / points.max(1) as f64;
            sum.expected_s += share * known.expected_s();
            sum.longest_s += share * known.longest_s() + left as f64 * longest_rest_s(campaign, set_up, &known);
        }
    }
    sum
}

/// Decay of the structure from its limit to the level of rest, s.
fn longest_rest_s(campaign: &Campaign, set_up: &CampaignSetUp, experiment: &Experiment) -> f64 {
    let Some(level_m) = experiment.rest_level_m().filter(|_| !experiment.carries_over()) else { return 0.0 };
    let structure = set_up.model().structure;
    let rate_per_s = structure.damping_n_s_per_m / (2.0 * structure.mass_kg);
    let decay_s = (campaign.rig.structure_limit_m() / level_m).max(1.0).ln() / rate_per_s;
    if decay_s.is_finite() { decay_s } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(low_s: f64, high_s: f64) -> String {
        TimeLeft { low_s, high_s }.to_string()
    }

    #[test]
    fn a_range_is_rounded_outwards() {
        assert_eq!(text(12.0, 33.0), "10 s to 35 s left");
        assert_eq!(text(1.0, 33.0), "up to 35 s left");
        assert_eq!(text(130.0, 290.0), "2 min to 5 min left");
        assert_eq!(text(300.0, 300.0), "about 5 min left");
        assert_eq!(text(3700.0, 6900.0), "1 h to 1 h 55 min left");
        assert_eq!(text(0.0, 0.0), "up to 5 s left");
    }
}
