//! Whether a point's amplitude ratio X/Z can be trusted: how far it may be from its limit.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// When a point counts as steady, and how long a measurement may wait for that.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SteadyLimits {
    /// Largest relative deviation of X/Z from its limit, uncertainty included.
    pub tolerance: f32,
    /// Largest relative RMS scatter of the cycle maxima about their trend, over the second half of the dwell and beyond
    /// the sensor's noise, of a motion that repeats.
    pub scatter: f32,
    /// A point that is neither steady nor stationary is measured again, in another dwell, until all its dwells take this
    /// long (to a cycle), s; 0 for one dwell only.
    pub longest_dwell_s: f32,
}

impl Default for SteadyLimits {
    fn default() -> Self {
        Self { tolerance: 1e-2, scatter: 1e-2, longest_dwell_s: 0.0 }
    }
}

/// What a dwell shows of the motion's steadiness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Steadiness {
    /// X/Z may still be further from its limit than allowed.
    #[default]
    NotSteady,
    /// The motion does not repeat from cycle to cycle, but its mean does not drift: X/Z is known within its interval. A
    /// motion with a period of several cycles is stationary too, if its maxima differ.
    Stationary,
    /// X/Z is within the tolerance of its limit, and the motion repeats.
    Steady,
}

impl Steadiness {
    /// X/Z is known: steady or stationary.
    #[must_use]
    pub fn is_settled(self) -> bool {
        self != Self::NotSteady
    }
}

/// What a dwell's amplitudes and cycle maxima say about their limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// Relative deviation of X/Z from its extrapolated limit.
    pub(super) deviation: f32,
    /// Its uncertainty (95 %).
    pub(super) uncertainty: f32,
    /// The fit of x has a limit, and its exponential decays.
    pub(super) converges: bool,
    /// RMS of the amplitudes of x that the fit leaves unexplained, over their RMS about the mean; 0 to 1.
    pub(super) unexplained: f32,
    /// Relative RMS scatter of the cycle maxima about their trend, over the second half of the dwell.
    pub(super) scatter: f32,
    /// Relative RMS of the scatter that the sensor's noise causes.
    pub(super) noise: f32,
    /// Half-width of the 95 % interval of the mean cycle maximum, relative.
    pub(super) interval: f32,
    /// The mean cycle maxima of the two halves of the dwell differ.
    pub(super) drifts: bool,
}

/// Share of the motion's changes that no decaying exponential explains, from which on they count as irregular.
pub(super) const IRREGULAR: f32 = 0.5;

impl Evidence {
    /// The verdict under `limits`.
    ///
    /// `simulator/tests/integration/steadiness/drawn.rs` draws set-ups with all dampers and counts the wrong verdicts: at most
    /// 0.5 % of the points called steady are further than 1 % from their limit.
    pub(super) fn verdict(&self, limits: &SteadyLimits) -> Steadiness {
        let is_near = self.deviation.abs() + self.uncertainty <= limits.tolerance && self.converges;
        let repeats = self.scatter * self.scatter <= limits.scatter * limits.scatter + self.noise * self.noise;
        if is_near && repeats {
            return Steadiness::Steady;
        }
        let is_irregular = self.unexplained >= IRREGULAR;
        if is_irregular && !self.drifts && self.deviation.abs() <= limits.tolerance.max(self.interval) {
            return Steadiness::Stationary;
        }
        Steadiness::NotSteady
    }
}
