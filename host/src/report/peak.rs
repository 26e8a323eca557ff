//! Says whether the highest point of a measured response is its peak: the points beside it decide.
//!
//! The rise of a curve above the highest of its points (`RISE_BETWEEN_POINTS`: a quarter of the difference to the lower neighbour) must
//! be within the tolerance of X/Z. So with a tolerance of 1 % both neighbours of a resolved peak are at most 4 % lower.
//!
//! A damped structure's X/Z changes gradually: at a distance δ from its peak it is lower by 1 − 1/√(1 + (δ/ζf)²), with the structure's own ζ.
//! Where X/Z falls by more than twice that, and by more than a tenth, it jumps from one motion to another, as impact dampers do; more
//! points do not close a jump.

use crate::campaign::{Campaign, CampaignSetUp, Experiment, RISE_BETWEEN_POINTS};
use crate::report::numbers::{significant, trimmed};
use crate::run_folder::ResultRow;

/// Smallest relative fall of X/Z that counts as a jump.
const MIN_JUMP: f64 = 0.1;

/// Frequency (Hz) and X/Z (cycle maxima) of the results of an experiment on a set-up.
#[must_use]
pub fn points_of(rows: &[ResultRow], set_up: &str, experiment: &str) -> Vec<(f64, f64)> {
    let own = rows.iter().filter(|row| row.set_up == set_up && row.experiment == experiment);
    own.map(|row| (row.frequency_hz, row.x_over_z())).collect()
}

/// The highest point of a response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z (cycle maxima) there.
    pub x_over_z: f64,
    /// What the points beside it say.
    pub resolution: Resolution,
}

/// Whether the highest point is the peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// A smooth curve through it and its neighbours is higher by at most the tolerance.
    Resolved,
    /// X/Z falls steeply to a neighbour, the lower one.
    NotResolved {
        /// Frequency (Hz) and X/Z of the neighbour.
        beside: (f64, f64),
        /// The step, Hz, with which the neighbours of such a resonance are within the tolerance.
        resolving_step_hz: f64,
    },
    /// X/Z jumps to this neighbour, the lower one if it jumps on both sides: frequency (Hz) and X/Z.
    Jump((f64, f64)),
    /// It is the first or the last point: the peak may lie outside.
    AtEnd,
}

impl Peak {
    /// The highest of `points`, which are frequency (Hz) and X/Z in any order; `None` without a finite X/Z. ζ is that of the
    /// structure, the tolerance that of X/Z, both greater than 0 (ζ = 0: no fall counts as a jump).
    #[must_use]
    pub fn of(points: &[(f64, f64)], damping_ratio: f64, tolerance: f64) -> Option<Self> {
        let mut points: Vec<(f64, f64)> = points.iter().copied().filter(|(_, ratio)| ratio.is_finite()).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let highest = points.iter().map(|(_, ratio)| *ratio).reduce(f64::max)?;
        let place = points.iter().position(|(_, ratio)| *ratio == highest)?;
        let (frequency_hz, x_over_z) = points[place];
        let peak = |resolution| Some(Self { frequency_hz, x_over_z, resolution });
        if place == 0 || place + 1 == points.len() {
            return peak(Resolution::AtEnd);
        }
        let fall = |other: &(f64, f64)| 1.0 - other.1 / x_over_z;
        let mut steep: Vec<(f64, f64)> = vec![points[place - 1], points[place + 1]];
        steep.retain(|other| RISE_BETWEEN_POINTS * fall(other) > tolerance);
        steep.sort_by(|a, b| a.1.total_cmp(&b.1));
        let is_jump = |other: &(f64, f64)| {
            let bandwidths = (other.0 - frequency_hz) / (damping_ratio * frequency_hz);
            let gradual = 1.0 - 1.0 / libm::sqrt(1.0 + bandwidths * bandwidths);
            fall(other) > MIN_JUMP.max(2.0 * gradual)
        };
        match (steep.iter().find(|other| !is_jump(other)), steep.first()) {
            (Some(other), _) => {
                // X/Z of a resonance falls by 1 − 1/√(1 + (δ/w)²) at a distance δ.
                let squared = |fall: f64| 1.0 / ((1.0 - fall) * (1.0 - fall)) - 1.0;
                let least = squared(tolerance / RISE_BETWEEN_POINTS);
                let resolving_step_hz = (other.0 - frequency_hz).abs() * (least / squared(fall(other))).sqrt();
                peak(Resolution::NotResolved { beside: *other, resolving_step_hz })
            }
            (None, Some(other)) => peak(Resolution::Jump(*other)),
            (None, None) => peak(Resolution::Resolved),
        }
    }

    /// The peak of an experiment's points on a set-up; `None` without a finite X/Z, or if the experiment does not drive the base by a stepped sine.
    #[must_use]
    pub fn measured(set_up: &CampaignSetUp, experiment: &Experiment, points: &[(f64, f64)]) -> Option<Self> {
        let tolerance = f64::from(experiment.base_driven()?.steady.tolerance);
        Self::of(points, set_up.model().structure.damping_ratio(), tolerance)
    }

    /// The peaks of all stepped sines of a campaign that have points; `points_of` gives frequency (Hz) and X/Z of the points of a set-up and
    /// an experiment, by their names.
    pub fn all(
        campaign: &Campaign,
        points_of: impl Fn(&str, &str) -> Vec<(f64, f64)>,
    ) -> Vec<(&CampaignSetUp, &Experiment, Self)> {
        let sines = campaign.set_ups.iter().enumerate().flat_map(|(index, set_up)| {
            campaign.experiments.iter().filter(move |e| e.set_ups.contains(&index)).map(move |e| (set_up, e))
        });
        let peak =
            |set_up: &CampaignSetUp, e: &Experiment| Self::measured(set_up, e, &points_of(&set_up.name, &e.name));
        sines.filter_map(|(set_up, e)| Some((set_up, e, peak(set_up, e)?))).collect()
    }

    /// A line for each peak of a campaign that its results do not resolve.
    #[must_use]
    pub fn notes(campaign: &Campaign, rows: &[ResultRow]) -> Vec<String> {
        Self::notes_of(campaign, |set_up: &str, experiment: &str| points_of(rows, set_up, experiment))
    }

    /// A line for each peak that the points of a set-up and an experiment do not resolve; `points_of` as of [`Self::all`].
    pub fn notes_of(campaign: &Campaign, points_of: impl Fn(&str, &str) -> Vec<(f64, f64)>) -> Vec<String> {
        let line = |(set_up, experiment, peak): (&CampaignSetUp, &Experiment, Self)| {
            Some(format!("Set-up {:?}, experiment {:?}: {}.", set_up.name, experiment.name, peak.note()?))
        };
        Self::all(campaign, points_of).into_iter().filter_map(line).collect()
    }

    /// A line for each experiment (its repeats together) on a set-up without a damper and on others: its peak and the lowest of theirs. `points_of`
    /// as of [`Self::all`]; of an experiment with repeats, by the name of the first, their means.
    pub fn headlines(campaign: &Campaign, points_of: impl Fn(&str, &str) -> Vec<(f64, f64)>) -> Vec<String> {
        let peaks = Self::all(campaign, points_of);
        let is_bare = |set_up: &CampaignSetUp| set_up.spec.damper().is_none() && !set_up.has_unmodelled_damper;
        let line = |experiment: &Experiment| {
            let own = || peaks.iter().filter(|(_, its, _)| its.name == experiment.name);
            let (bare, _, without) = own().find(|(set_up, ..)| is_bare(set_up))?;
            let damped = own().filter(|(set_up, ..)| !is_bare(set_up));
            let (best, _, with) = damped.min_by(|a, b| a.2.x_over_z.total_cmp(&b.2.x_over_z))?;
            let change = format!("{:+.0}", 100.0 * (with.x_over_z / without.x_over_z - 1.0)).replace('-', "−");
            let shown = |set_up: &CampaignSetUp, peak: &Self| {
                let doubt = if peak.is_resolved() { String::new() } else { format!(" ({})", peak.verdict()) };
                format!("{} {}{doubt}", set_up.label, significant(peak.x_over_z, 3))
            };
            let (without, with) = (shown(bare, without), shown(best, with));
            Some(format!("Peak X/Z, {}: {without} → {with}, {change} %", experiment.series))
        };
        campaign.experiments.iter().filter(|e| e.repeat == 0).filter_map(line).collect()
    }

    /// Whether the peak is known to its tolerance.
    #[must_use]
    pub fn is_resolved(&self) -> bool {
        self.resolution == Resolution::Resolved
    }

    /// The verdict in a word or two, for a table.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        match self.resolution {
            Resolution::Resolved => "resolved",
            Resolution::NotResolved { .. } => "not resolved",
            Resolution::Jump(_) => "at a jump",
            Resolution::AtEnd => "not resolved (end)",
        }
    }

    /// What a reader must know of a peak that is not resolved, and what would resolve it.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let at =
            format!("the highest X/Z (cycle maxima), {:.2} at {} Hz", self.x_over_z, trimmed(self.frequency_hz, 4));
        match self.resolution {
            Resolution::Resolved => None,
            Resolution::NotResolved { beside: (beside_hz, ratio), resolving_step_hz } => Some(format!(
                "the peak is not resolved: beside {at}, it is {:.0} % lower at {} Hz; write more peak_points or a smaller step, about {} Hz",
                100.0 * (1.0 - ratio / self.x_over_z),
                trimmed(beside_hz, 4),
                significant(resolving_step_hz, 1)
            )),
            Resolution::Jump((beside_hz, ratio)) => Some(format!(
                "X/Z jumps beside its peak: from {at}, to {ratio:.2} at {} Hz; the motion changes between the two, where X/Z may be higher",
                trimmed(beside_hz, 4),
            )),
            Resolution::AtEnd => Some(format!(
                "the peak is not resolved: {at}, is at an end of the frequencies, and the peak may lie outside"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZETA: f64 = 0.004;

    /// X/Z of a resonance at 2.5 Hz with these steps, in damping ratios, `shift` of a step off the peak.
    fn resonance(step: f64, shift: f64) -> Vec<(f64, f64)> {
        let at = |n: i32| (f64::from(n) + shift) * step;
        (-3..=3).map(|n| (2.5 * (1.0 + ZETA * at(n)), 125.0 / (1.0 + at(n) * at(n)).sqrt())).collect()
    }

    fn verdict(points: &[(f64, f64)]) -> &'static str {
        Peak::of(points, ZETA, 0.01).unwrap().verdict()
    }

    #[test]
    fn a_resolved_peak_of_a_resonance_is_within_the_tolerance_of_the_true_one() {
        let mut resolved = 0;
        for step in 1..60 {
            for shift in 0..10 {
                let points = resonance(0.02 * f64::from(step), 0.05 * f64::from(shift));
                let peak = Peak::of(&points, ZETA, 0.01).unwrap();
                assert!(!matches!(peak.resolution, Resolution::Jump(_) | Resolution::AtEnd), "{peak:?}");
                assert_eq!(peak.note().is_none(), peak.is_resolved());
                if peak.is_resolved() {
                    resolved += 1;
                    assert!(peak.x_over_z > 0.99 * 125.0, "{peak:?}");
                }
            }
        }
        assert!(resolved > 50);
    }

    #[test]
    fn a_peak_between_wide_steps_is_not_resolved() {
        // Steps of 3.4 ζf, as 0.082 Hz where the half-power bandwidth 2ζf is 0.049 Hz: the highest point has 55 % of the peak.
        let points = resonance(3.4, 0.45);
        assert_eq!(verdict(&points), "not resolved");
        let note = Peak::of(&points, ZETA, 0.01).unwrap().note().unwrap();
        assert!(note.contains("% lower at") && note.contains("peak_points"), "{note}");
    }

    #[test]
    fn a_fall_that_no_resonance_has_is_a_jump_with_its_two_frequencies() {
        let points = [(2.400, 12.0), (2.402, 12.2), (2.404, 12.3), (2.406, 7.1), (2.408, 7.0)];
        assert_eq!(verdict(&points), "at a jump");
        let note = Peak::of(&points, ZETA, 0.01).unwrap().note().unwrap();
        assert!(note.contains("12.30 at 2.404 Hz, to 7.10 at 2.406 Hz"), "{note}");
        // The other side is not resolved.
        let points = [(2.390, 8.0), (2.404, 12.3), (2.406, 7.1)];
        assert_eq!(verdict(&points), "not resolved");
    }

    #[test]
    fn a_peak_at_an_end_is_not_resolved_and_no_valid_point_has_no_peak() {
        assert_eq!(verdict(&[(2.4, 3.0), (2.5, 2.9), (2.6, 2.0)]), "not resolved (end)");
        assert_eq!(verdict(&[(2.4, f64::NAN), (2.5, 2.9)]), "not resolved (end)");
        assert_eq!(Peak::of(&[(2.4, f64::NAN)], ZETA, 0.01), None);
        // The order of the run does not matter.
        assert_eq!(verdict(&[(2.5, 3.0), (2.4, 2.98), (2.6, 2.97)]), "resolved");
    }
}
