//! Detection of NaN samples and frozen sensors. Rails are detected by [`super::rails`].

use crate::io::Reading;

/// Defect of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// A sample is not a number.
    NotANumber,
    /// Every sample has been identical for longer than is possible while the measured part moves.
    Frozen,
}

/// Checks one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Watch {
    last: f32,
    same_ticks: u32,
}

impl Watch {
    /// Takes one tick's reading. A sensor counts as frozen after `frozen_ticks` ticks of identical samples; with 0
    /// never.
    pub fn push(&mut self, reading: &Reading, frozen_ticks: u32) -> Option<Defect> {
        if reading.peak_m.is_nan() {
            return Some(Defect::NotANumber);
        }
        let same = reading.still_at.is_some_and(|at| at == self.last);
        self.same_ticks = if same { self.same_ticks.saturating_add(1) } else { 0 };
        if let Some(at) = reading.still_at {
            self.last = at;
        }
        (frozen_ticks > 0 && self.same_ticks >= frozen_ticks).then_some(Defect::Frozen)
    }

    /// Resets the time of identical samples: the measured part may be at rest.
    pub fn forgive(&mut self) {
        self.same_ticks = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: [f32; 10] = [0.2; 10];

    /// A block of [`STILL`] whose last sample is `at`.
    fn ending(at: f32) -> Reading {
        let mut block = STILL;
        block[9] = at;
        Reading::of(&block)
    }

    #[test]
    fn a_stale_reading_is_frozen_and_then_recovers() {
        let mut watch = Watch::default();
        let still = Reading::of(&STILL);
        assert_eq!(watch.push(&ending(0.1), 3), None);
        assert_eq!(watch.push(&still, 3), None, "the first block of it");
        assert_eq!(watch.push(&still, 3), None);
        assert_eq!(watch.push(&still, 3), None);
        assert_eq!(watch.push(&still, 3), Some(Defect::Frozen));
        assert_eq!(watch.push(&ending(0.3), 3), None);
    }

    #[test]
    fn steps_between_still_blocks_are_movement() {
        let mut watch = Watch::default();
        for n in 0..100u8 {
            assert_eq!(watch.push(&Reading::of(&[f32::from(n % 2) * 0.1; 10]), 2), None);
        }
    }

    #[test]
    fn a_nan_sample_is_a_defect_at_once() {
        let mut watch = Watch::default();
        assert_eq!(watch.push(&ending(f32::NAN), 0), Some(Defect::NotANumber));
        assert_eq!(watch.push(&ending(0.1), 0), None);
    }
}
