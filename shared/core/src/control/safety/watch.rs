//! Whether a sensor can be believed: numbers, within its range, and not the same number for ever.

/// What is wrong with a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// A sample is not a number.
    NotANumber,
    /// A sample is at or beyond the range: a broken cable reads a rail.
    OutOfRange,
    /// Every sample has been the same for longer than a moving thing can stand.
    Frozen,
}

/// Watches one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Watch {
    last: f32,
    same_ticks: u32,
}

impl Watch {
    /// Takes one tick's block. `frozen_ticks` of identical samples make a frozen sensor; 0 never.
    pub fn push(&mut self, block: &[f32], range: f32, frozen_ticks: u32) -> Option<Defect> {
        let mut moved = false;
        let mut beyond = false;
        for &sample in block {
            if sample.is_nan() {
                return Some(Defect::NotANumber);
            }
            moved |= sample != self.last;
            beyond |= sample >= range || sample <= -range;
            self.last = sample;
        }
        self.same_ticks = if moved { 0 } else { self.same_ticks.saturating_add(1) };
        if beyond {
            return Some(Defect::OutOfRange);
        }
        (frozen_ticks > 0 && self.same_ticks >= frozen_ticks).then_some(Defect::Frozen)
    }

    /// Forgets how long the samples have been the same: the thing was allowed to stand.
    pub fn forgive(&mut self) {
        self.same_ticks = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stale_reading_is_frozen_and_then_recovers() {
        let mut watch = Watch::default();
        assert_eq!(watch.push(&[0.1, 0.2], 1.0, 3), None);
        assert_eq!(watch.push(&[0.2, 0.2], 1.0, 3), None);
        assert_eq!(watch.push(&[0.2, 0.2], 1.0, 3), None);
        assert_eq!(watch.push(&[0.2, 0.2], 1.0, 3), Some(Defect::Frozen));
        assert_eq!(watch.push(&[0.2, 0.3], 1.0, 3), None);
    }

    #[test]
    fn rails_and_no_numbers_are_told_apart() {
        let mut watch = Watch::default();
        assert_eq!(watch.push(&[0.1, -1.0], 1.0, 0), Some(Defect::OutOfRange));
        assert_eq!(watch.push(&[f32::INFINITY], 1.0, 0), Some(Defect::OutOfRange));
        assert_eq!(watch.push(&[0.1, f32::NAN], 1.0, 0), Some(Defect::NotANumber));
        assert_eq!(watch.push(&[0.1, 0.1], 1.0, 0), None);
    }
}
