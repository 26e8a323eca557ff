//! X/Z of the last cycles, for people: its median, which single cycles do not disturb, and how far it has moved.

use std::collections::VecDeque;

/// Cycles of the drive that count.
const CYCLES: f64 = 5.0;

/// Relative change of the drive frequency that is another point, not a resonance that is followed.
pub(super) const OTHER_POINT: f64 = 1e-3;

/// Fewest values in these cycles from which their spread is told: a rig that runs faster tells one in several cycles.
const MIN_VALUES: usize = 3;

/// The ratios of the last cycles, each as often as it was told.
#[derive(Debug, Default)]
pub(super) struct RunningRatio {
    recent: VecDeque<(f64, f32)>,
    drive_hz: f32,
    /// Time from which the last whole cycle is one of the present point, s.
    from_s: f64,
    is_full: bool,
}

impl RunningRatio {
    /// Takes the ratio of the last whole cycle at a time, s, and the drive frequency, Hz.
    pub(super) fn push(&mut self, t_s: f64, drive_hz: f32, ratio: f32) {
        if self.recent.back().is_some_and(|(last_s, _)| t_s < *last_s) {
            self.clear();
        }
        if self.drive_hz > 0.0 && (f64::from(drive_hz / self.drive_hz) - 1.0).abs() > OTHER_POINT {
            // The drive goes on at once; up to two cycles later a whole one has ended at the new frequency.
            *self = Self { from_s: t_s + 2.0 / f64::from(drive_hz), ..Self::default() };
        }
        self.drive_hz = drive_hz;
        if t_s < self.from_s {
            return;
        }
        self.recent.push_back((t_s, ratio));
        let from_s = t_s - CYCLES / f64::from(drive_hz);
        while self.recent.len() > 1 && self.recent[0].0 < from_s {
            self.recent.pop_front();
            self.is_full = true;
        }
    }

    /// Forgets them: there is no drive.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Their median.
    pub(super) fn median(&self) -> Option<f32> {
        let ratios = self.sorted();
        ratios.get(ratios.len() / 2).copied()
    }

    /// The largest less the smallest, over the median; none before all these cycles have passed.
    pub(super) fn spread(&self) -> Option<f32> {
        let ratios = self.sorted();
        let median = self.median().filter(|median| self.is_full && *median > 0.0 && ratios.len() >= MIN_VALUES)?;
        Some((ratios.last()? - ratios.first()?) / median)
    }

    fn sorted(&self) -> Vec<f32> {
        let mut ratios: Vec<f32> = self.recent.iter().map(|(_, ratio)| *ratio).collect();
        ratios.sort_by(f32::total_cmp);
        ratios
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_that_spikes_is_not_seen_and_five_cycles_tell_the_spread() {
        let mut ratio = RunningRatio::default();
        // Ten values a second, a cycle of 0.4 s: the cycle at 3.2 s is a spike.
        for i in 0..60u8 {
            let t_s = 0.1 * f64::from(i);
            ratio.push(t_s, 2.5, if (32..36).contains(&i) { 400.0 } else { 4.0 + 0.01 * f32::from(i / 4 % 2) });
            assert!((ratio.median().unwrap() - 4.0).abs() < 0.02, "{i}");
            assert_eq!(ratio.spread().is_some(), i > 20, "{i}");
        }
        assert!((ratio.spread().unwrap() - 0.0025).abs() < 1e-4);
        ratio.clear();
        assert_eq!((ratio.median(), ratio.spread()), (None, None));
    }

    #[test]
    fn points_are_not_mixed_and_a_followed_resonance_is_one() {
        let mut ratio = RunningRatio::default();
        (0..50u8).for_each(|i| ratio.push(0.1 * f64::from(i), 2.5 + 1e-4 * f32::from(i), 24.0));
        assert_eq!(ratio.median(), Some(24.0));
        // The first two cycles at 2 Hz may hold some of 2.5 Hz.
        for i in 50..100u8 {
            ratio.push(0.1 * f64::from(i), 2.0, if i < 60 { 20.0 } else { 3.0 });
            assert_eq!(ratio.median(), (i >= 60).then_some(3.0), "{i}");
        }
    }

    #[test]
    fn a_rig_that_skips_cycles_has_a_value_but_no_spread() {
        let mut ratio = RunningRatio::default();
        (0..20u8).for_each(|i| ratio.push(f64::from(i) * 10.0, 2.5, 4.0));
        assert_eq!((ratio.median(), ratio.spread()), (Some(4.0), None));
    }
}
