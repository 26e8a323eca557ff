//! Samples of x and of the forces of soft walls within a tick, while the motion is integrated.

use damprig_core::integrator::modes::Sign;
use damprig_core::integrator::polynomial::{self, Polynomial};
use damprig_core::integrator::sampled::{Flight, SampledImpact, SampledObserver};
use damprig_core::io::{SUBSAMPLES, WALL_SUBSAMPLES};
use damprig_core::scalar::Scalar;
use heapless::Vec;

/// Impacts of one tick that the force sensors see. A chatter may have more, each weaker than the last.
const MAX_IMPACTS: usize = 8;

/// Evaluates x on the flights at the sub-sample instants.
pub(super) struct Sampler<S> {
    pub x: [S; SUBSAMPLES],
    pub taken: usize,
    pub step: S,
    pub steps: S,
    pub impacts: u32,
    pub hits: Vec<SampledImpact<S>, MAX_IMPACTS>,
    /// Forces of soft walls; `None` for hard walls.
    pub pressed: Option<Pressed<S>>,
}

/// Force of the soft walls at −d and +d at the instants of the wall sensors' samples.
pub(super) struct Pressed<S> {
    pub forces: [[S; 2]; WALL_SUBSAMPLES],
    /// Instants that the motion has passed.
    pub taken: usize,
}

impl<S: Scalar> SampledObserver<S> for Sampler<S> {
    fn flight(&mut self, start: S, length: S, flight: &Flight<S>) {
        let tenth = S::ONE / S::from_u8(SUBSAMPLES as u8);
        while self.taken < SUBSAMPLES {
            let instant = S::from_u8(self.taken as u8 + 1) * tenth * self.steps - self.step;
            let since = instant - start;
            if since > length {
                return;
            }
            self.x[self.taken] = flight.x[0] + polynomial::increment(&flight.x, since);
            self.taken += 1;
        }
    }

    fn wall_force(&mut self, start: S, length: S, side: Sign, force: &Polynomial<S>) {
        let Some(pressed) = &mut self.pressed else { return };
        let part = self.steps / S::from_u8(WALL_SUBSAMPLES as u8);
        while pressed.taken < WALL_SUBSAMPLES {
            let since = S::from_u8(pressed.taken as u8 + 1) * part - self.step - start;
            if since > length {
                return;
            }
            if since > S::ZERO {
                pressed.forces[pressed.taken][usize::from(side > 0)] = force[0] + polynomial::increment(force, since);
            }
            pressed.taken += 1;
        }
    }

    fn impact(&mut self, impact: &SampledImpact<S>) {
        self.impacts += 1;
        // A soft wall gives its impulse by a force, and no kick.
        if self.pressed.is_some() && impact.kick == S::ZERO {
            return;
        }
        let _ = self.hits.push(SampledImpact { at: self.step + impact.at, ..*impact });
    }
}
