//! Events along an orbit: where a Poincaré section can lie between them, and which walls are hit in which order.

use damprig_core::integrator::exact::{Accumulation, ContactEnd, Impact, Observer};
use damprig_core::integrator::modes::{Contact, Mode, Sign};

/// Event times along an orbit.
#[derive(Default)]
pub(super) struct EventTimes {
    /// Time of each event, s, and whether the particle rests on a wall after it.
    events: Vec<(f64, bool)>,
    rests: bool,
}

impl EventTimes {
    fn take(&mut self, time_s: f64) {
        self.events.push((time_s, self.rests));
    }

    /// Candidate sections of an orbit of `whole_s`, s: the middles of the longest intervals without an event, then their
    /// quarters; none while the particle rests on a wall.
    pub(super) fn sections(&self, whole_s: f64) -> Vec<f64> {
        let mut stretches: Vec<(f64, f64)> = self
            .events
            .iter()
            .enumerate()
            .filter(|(_, (_, rests))| !rests)
            .map(|(n, (from_s, _))| {
                let to_s = self.events.get(n + 1).map_or(whole_s + self.events[0].0, |next| next.0);
                (*from_s, to_s - from_s)
            })
            .collect();
        if self.events.is_empty() && !self.rests {
            stretches.push((0.0, whole_s));
        }
        stretches.sort_by(|a, b| b.1.total_cmp(&a.1));
        let at = |share: f64| stretches.iter().map(move |(from_s, length_s)| (from_s + share * length_s) % whole_s);
        at(0.5).take(3).chain(at(0.25)).chain(at(0.75)).collect()
    }
}

impl Observer for EventTimes {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.take(impact.time_s);
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        self.take(end.time_s);
    }

    fn mode(&mut self, time_s: f64, mode: Mode) {
        self.rests = matches!(mode.contact, Contact::Held(side) if side != 0);
        // The initial mode is not an event.
        if time_s > 0.0 {
            self.take(time_s);
        }
    }
}

/// Sequence of walls hit. An accumulation is one entry, however many impacts it has.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ImpactSequence(Vec<Sign>);

impl Observer for ImpactSequence {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.0.push(impact.side);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        while self.0.last() == Some(&accumulation.side) {
            self.0.pop();
        }
        self.0.push(2 * accumulation.side);
    }
}
