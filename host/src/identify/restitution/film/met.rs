//! Two flights of a film that meet: when, how fast, and for how long they touch the floor.

use nalgebra::DVector;

use super::FilmScale;
use super::bounces::Bounces;
use super::floor::crossing;
use super::frames::meeting;

/// Two flights that meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    /// The flight before; the next one is after.
    pub pair: usize,
    /// Last step of the flight before, first one of the flight after.
    pub ends: [f64; 2],
    /// The steps of the frames next to these, towards the impact.
    pub inner: [f64; 2],
    /// Whether frames between them belong to neither.
    pub has_contact: bool,
    /// Standard uncertainty of the beginning and the end of the contact, in steps.
    pub unknown: [f64; 2],
}

/// What an impact is like.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImpactValues {
    pub at: f64,
    /// End of the flight before, beginning of the flight after.
    pub ends: [f64; 2],
    /// Speeds per step.
    pub before: f64,
    pub after: f64,
    pub e: f64,
    /// m/s.
    pub speed: f64,
}

impl Met {
    /// Ranges of the beginning and of the end of a contact that frames show, where the flights meet at `at`.
    pub fn contact(&self, at: f64) -> [[f64; 2]; 2] {
        let [last, first] = self.ends;
        [[last, self.inner[0].min(at.max(last))], [self.inner[1].max(at.min(first)), first]]
    }

    /// The end of the flight before, where the flights meet, and the beginning of the flight after.
    pub fn moments(&self, bounces: &Bounces, parameters: &DVector<f64>) -> Option<(f64, f64, f64)> {
        let [a, b] = [self.pair, self.pair + 1].map(|n| bounces.flight(n, parameters));
        let at = meeting(&a, &b, 0.5 * (self.ends[0] + self.ends[1]));
        let near = (self.ends[0] - 2.0..=self.ends[1] + 2.0).contains(&at);
        if !near {
            return None;
        }
        if let Some(floor) = &bounces.floor {
            let level = floor.level(&bounces.fit, parameters);
            return Some((crossing(&a, level, at), at, crossing(&b, level, at)));
        }
        if !self.has_contact {
            return Some((at, at, at));
        }
        let [before, after] = self.contact(at).map(|[from, to]| 0.5 * (from + to));
        Some((before, at, after))
    }

    pub fn values(&self, bounces: &Bounces, parameters: &DVector<f64>, scale: &FilmScale) -> ImpactValues {
        let (from, at, to) = self.moments(bounces, parameters).unwrap_or((f64::NAN, f64::NAN, f64::NAN));
        let [a, b] = [self.pair, self.pair + 1].map(|n| bounces.flight(n, parameters));
        let (before, after) = (a.velocity(from), -b.velocity(to));
        let per_step = scale.per_step(bounces.acceleration(self.pair, parameters));
        ImpactValues { at, ends: [from, to], before, after, e: after / before, speed: before * per_step }
    }
}
