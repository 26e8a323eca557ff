//! Observers of the sampled integrator: receive the flights, impacts and contacts between two samples.

use super::Flight;
use crate::integrator::modes::{Mode, Sign};
use crate::integrator::polynomial::Polynomial;

/// An impact on a hard wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledImpact<S> {
    /// Time in steps from the start of the step.
    pub at: S,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// |y′ − x′| just before; greater than 0.
    pub approach: S,
    /// Momentum given to the structure divided by its mass: the change of x′.
    pub kick: S,
}

/// Receives the events and flights between the samples. Every method is optional.
pub trait SampledObserver<S> {
    /// The next flight is in `mode`.
    fn mode(&mut self, mode: Mode) {
        let _ = mode;
    }

    /// `flight` is valid from `start` for `length`, both in steps.
    fn flight(&mut self, start: S, length: S, flight: &Flight<S>) {
        let _ = (start, length, flight);
    }

    /// The force of the soft wall of `side` on the particle during the last flight, from `start` for `length`, per structure mass in
    /// lengths per step²: positive pushes inwards.
    fn wall_force(&mut self, start: S, length: S, side: Sign, force: &Polynomial<S>) {
        let _ = (start, length, side, force);
    }

    /// The particle hit a wall at a non-zero speed. A particle that starts from rest to press on a soft wall makes no
    /// impact.
    fn impact(&mut self, impact: &SampledImpact<S>) {
        let _ = impact;
    }

    /// Accumulating impacts ended at `at` (steps from the start of the step) with the particle at rest on the hard wall
    /// of `side`. The last reported impact includes the remaining ones.
    fn accumulation(&mut self, at: S, side: Sign) {
        let _ = (at, side);
    }

    /// The particle starts to press on the soft wall of `side` at `at` (steps from the start of the step).
    fn contact_start(&mut self, at: S, side: Sign) {
        let _ = (at, side);
    }

    /// The soft wall of `side` released the particle at `at` (steps from the start of the step) with the speed
    /// `separation`.
    fn contact_end(&mut self, at: S, side: Sign, separation: S) {
        let _ = (at, side, separation);
    }
}

impl<S> SampledObserver<S> for () {}
