//! Impacts on their way to the journal: held for a moment, so that many go into it together, and each once.

use std::time::{Duration, Instant};

use damprig_core::measure::impacts::ImpactRecord;

/// Impacts are held for this time, or up to this number.
const HOLD: Duration = Duration::from_millis(250);
const MAX_HELD: usize = 256;

/// A copy of an impact is searched for among this many latest ones.
const COPIES_AMONG: usize = 16;

/// The latest impacts of a segment.
pub(super) struct HeldImpacts {
    /// The first `noted` of them are in the journal.
    latest: Vec<ImpactRecord>,
    noted: usize,
    noted_at: Instant,
}

impl HeldImpacts {
    pub(super) fn new() -> Self {
        Self { latest: Vec::new(), noted: 0, noted_at: Instant::now() }
    }

    /// Adds an impact; `false` if it is known, because a message may arrive twice.
    pub(super) fn add(&mut self, impact: ImpactRecord) -> bool {
        let is_new = !self.latest.iter().rev().take(COPIES_AMONG).any(|known| *known == impact);
        if is_new {
            self.latest.push(impact);
        }
        is_new
    }

    /// Whether new ones have been held long enough.
    pub(super) fn are_due(&self) -> bool {
        self.noted_at.elapsed() > HOLD
    }

    /// Whether as many are held as may be.
    pub(super) fn are_many(&self) -> bool {
        self.latest.len() - self.noted >= MAX_HELD
    }

    /// Those that are not in the journal yet; they count as noted from now on. `None` if there are none.
    pub(super) fn take_new(&mut self) -> Option<Vec<ImpactRecord>> {
        let new = self.latest[self.noted..].to_vec();
        self.latest.drain(..self.latest.len().saturating_sub(COPIES_AMONG));
        self.noted = self.latest.len();
        self.noted_at = Instant::now();
        (!new.is_empty()).then_some(new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn impact(tick: u32) -> ImpactRecord {
        let (centre_ticks, peak_n, impulse_n_s, contact_s) = (-2.0, 5.0, 0.01, 0.004);
        ImpactRecord { tick, centre_ticks, side: 1, peak_n, impulse_n_s, contact_s, clipped: false, held: false }
    }

    #[test]
    fn each_impact_is_taken_once_even_if_it_arrives_again_after_it_was_noted() {
        let mut held = HeldImpacts::new();
        assert!(held.add(impact(1)) && held.add(impact(2)) && !held.add(impact(1)));
        assert_eq!(held.take_new().map(|new| new.len()), Some(2));
        assert!(!held.add(impact(2)) && held.add(impact(3)));
        assert_eq!(held.take_new(), Some(vec![impact(3)]));
        assert_eq!(held.take_new(), None);
    }

    #[test]
    fn many_impacts_are_due_before_their_time() {
        let mut held = HeldImpacts::new();
        (0..MAX_HELD as u32).for_each(|tick| {
            held.add(impact(tick));
        });
        assert!(held.are_many());
        assert_eq!(held.take_new().map(|new| new.len()), Some(MAX_HELD));
        assert!(!held.are_many());
    }
}
