//! How much of a quantity's change the sequence of events bears.

use nalgebra::DVector;

use super::NoDerivatives;
use super::follow::Follower;
use super::record::StateInterval;
use super::setting::{Known, Sloped};
use crate::contacts::{Contacts, Event, Slide};

/// A guard below this share of its terms is zero.
const ZERO: f64 = 1e-9;

/// Changes of the times of two events are the same within this share of them.
const ROUNDING: f64 = 1e-11;

impl Follower<'_> {
    /// By how much a guard, a duration or a force may change before an event is lost or gained, to first order, with its changes.
    pub(super) fn margin(&mut self, value: f64, slopes: &DVector<f64>) {
        self.margins.push(Sloped { value: value.abs(), slopes: slopes.clone() });
    }

    /// Of each quantity the relative change within which the sequence of events stays.
    pub(super) fn holds_within(&self) -> Vec<f64> {
        let within = |p: usize| {
            let changes = self.margins.iter().filter(|margin| margin.slopes[p] != 0.0);
            changes.map(|margin| margin.value / margin.slopes[p].abs()).fold(f64::INFINITY, f64::min)
        };
        (0..self.others.len()).map(within).collect()
    }

    /// The same of what is zero at the start: any change ends it that is more than rounding of its terms, whose size is given.
    pub(super) fn margin_of_zero(&mut self, slopes: &DVector<f64>, size: f64) {
        let slopes = slopes.map(|slope| if slope.abs() <= ZERO * size { 0.0 } else { slope });
        self.margin(0.0, &slopes);
    }

    /// Where an interval begins with bodies that friction holds: by how much it does.
    pub(super) fn margins_of_held(&mut self, known: &Known) {
        for (which, event) in known.equations.events.iter().enumerate() {
            if matches!(event, Event::Breaks(..)) {
                let guard = known.guard(which, &self.w, &self.s);
                self.margin(guard.value, &guard.slopes);
            }
        }
    }

    /// An event and the one before it change places.
    pub(super) fn margin_of_order(&mut self) {
        if let Some(last) = self.last_event.replace(self.time.clone()) {
            // Two events of one cause stay at one instant.
            let size = self.time.value.max(self.time.slopes.amax());
            let apart = &self.time.slopes - last.slopes;
            let apart = apart.map(|apart| if apart.abs() <= ROUNDING * size { 0.0 } else { apart });
            self.margin(self.time.value - last.value, &apart);
        }
    }

    /// Where a joint stops and is not held: what the force is beyond what friction holds.
    pub(super) fn margin_of_stop(
        &mut self,
        event: Event,
        interval: &StateInterval,
        after: Option<&Contacts>,
    ) -> Result<(), NoDerivatives> {
        let Event::Stops(joint) = event else { return Ok(()) };
        if after.is_none_or(|after| after.slides[joint] == Slide::Stuck) {
            return Ok(());
        }
        let mut held = interval.contacts.clone();
        held.slides[joint] = Slide::Stuck;
        let known = self.known(&held)?;
        let breaks = known.equations.events.iter().enumerate();
        let breaks = breaks.filter(|(_, event)| matches!(event, Event::Breaks(own, _) if *own == joint));
        let guards = breaks.map(|(which, _)| known.guard(which, &self.w, &self.s));
        if let Some(beyond) = guards.min_by(|a, b| a.value.total_cmp(&b.value)) {
            self.margin(beyond.value, &beyond.slopes);
        }
        Ok(())
    }

    /// The size of the terms of a row in a motion of this size.
    pub(super) fn size_of_row(&self, row: &DVector<f64>) -> f64 {
        let (bodies, [size_m, size_m_per_s]) = (self.bodies(), self.sizes);
        let size = |i: usize| match i {
            _ if i < bodies => size_m / self.size_of(i),
            _ if i < 2 * bodies => size_m_per_s / self.size_of(i),
            _ => self.w[i].abs(),
        };
        row.iter().enumerate().map(|(i, row)| row.abs() * size(i)).sum()
    }

    /// Whether a guard is zero but for rounding.
    pub(super) fn is_zero(&self, known: &Known, which: usize) -> bool {
        let row = known.equations.guards.row(which).transpose();
        row.dot(&self.w).abs() <= ZERO * self.size_of_row(&row)
    }

    /// The lowest natural frequency of the structure.
    pub(super) fn lowest_rad_per_s(&self) -> f64 {
        let modes = self.nominal.case.set_up().structure.modes.iter();
        modes.map(|mode| mode.angular_frequency_rad_per_s).fold(f64::INFINITY, f64::min)
    }

    /// Root of the mass of a body, by the place of its displacement or velocity in w.
    pub(super) fn size_of(&self, place: usize) -> f64 {
        self.nominal.mount.bodies.mass[place % self.bodies()].sqrt()
    }
}
