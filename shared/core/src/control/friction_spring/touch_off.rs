//! Touch-off: approaches until the force rises, takes settled readings further up and fits the spring's line.

use super::config::nearest;
use super::line::{POINTS, fit};
use super::{FrictionSpring, Mean, SpringEvent, SpringState, Target, ZeroReading};
use crate::control::fault::SpringFaultCause;

/// Consecutive ticks above the touch force that count as a touch, so that a spike does not.
const TOUCH_TICKS: u8 = 3;

/// A touch-off in progress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TouchOff {
    phase: TouchOffPhase,
    /// (position above `from`, m; force, N)
    points: [(f32, f32); POINTS],
    taken: usize,
    /// Position of the first point, steps.
    from: i32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum TouchOffPhase {
    /// Moving away from the structure, in case the block touches it.
    Retreat,
    /// Averaging the reading without contact.
    Bias(Mean),
    /// Approaching; the force has been above the touch force for this many ticks.
    Approach(u8),
    /// Stopping.
    Stop,
    Climb(i32),
    Settle(u32),
    Read(Mean),
}

impl TouchOff {
    pub(super) fn new() -> Self {
        Self { phase: TouchOffPhase::Retreat, points: [(0.0, 0.0); POINTS], taken: 0, from: 0 }
    }

    /// The reading without contact is known.
    pub(super) fn has_bias(&self) -> bool {
        !matches!(self.phase, TouchOffPhase::Retreat | TouchOffPhase::Bias(_))
    }
}

impl FrictionSpring {
    /// One tick of a touch-off; `reading_n` is the force as read.
    pub(super) fn touch_off(&mut self, mut now: TouchOff, reading_n: f32) -> (i8, Option<SpringEvent>) {
        let force_n = reading_n - self.bias_n;
        let mut steps = 0;
        match &mut now.phase {
            TouchOffPhase::Retreat => {
                steps = self.ramp.tick(&self.scaled.fast, Some(self.scaled.back_off));
                if self.ramp.is_at(self.scaled.back_off) {
                    now.phase = TouchOffPhase::Bias(Mean::default());
                }
            }
            TouchOffPhase::Bias(mean) => {
                if let Some(bias_n) = mean.push(reading_n, self.scaled.average + self.scaled.settle) {
                    self.bias_n = bias_n;
                    now.phase = TouchOffPhase::Approach(0);
                }
            }
            TouchOffPhase::Approach(ticks) => {
                *ticks = if force_n >= self.config.touch_force_n { *ticks + 1 } else { 0 };
                if *ticks >= TOUCH_TICKS {
                    now.phase = TouchOffPhase::Stop;
                } else if self.ramp.is_at(self.scaled.travel) {
                    let travel_m = self.config.travel_m;
                    return (0, Some(self.trip(SpringFaultCause::NoTouch, travel_m, travel_m)));
                } else {
                    steps = self.go(self.scaled.travel, self.scaled.search);
                }
            }
            TouchOffPhase::Stop => {
                steps = self.ramp.tick(&self.scaled.search, None);
                if self.ramp.is_still() {
                    self.ramp.halt();
                    now.from = self.ramp.steps();
                    now.phase = TouchOffPhase::Settle(self.scaled.settle);
                }
            }
            TouchOffPhase::Climb(position) => {
                steps = self.go(*position, self.scaled.search);
                if self.ramp.is_at(*position) {
                    now.phase = TouchOffPhase::Settle(self.scaled.settle);
                }
            }
            TouchOffPhase::Settle(left) if *left > 1 => *left -= 1,
            TouchOffPhase::Settle(_) => now.phase = TouchOffPhase::Read(Mean::default()),
            TouchOffPhase::Read(mean) => {
                if let Some(force_n) = mean.push(force_n, self.scaled.average) {
                    let above_m = self.position_m(self.ramp.steps() - now.from);
                    now.points[now.taken] = (above_m, force_n);
                    now.taken += 1;
                    if now.taken == POINTS {
                        return (0, Some(self.end_touch_off(&now)));
                    }
                    let span_m = self.config.touch_span_n / self.config.stiffness_n_per_m;
                    let rise = span_m / self.config.step_m * now.taken as f32 / (POINTS - 1) as f32;
                    let next = now.from + nearest(rise).max(now.taken as i32);
                    if next > self.scaled.travel {
                        let event =
                            self.trip(SpringFaultCause::LimitReached, self.position_m(next), self.config.travel_m);
                        return (0, Some(event));
                    }
                    now.phase = TouchOffPhase::Climb(next);
                }
            }
        }
        self.state = SpringState::TouchOff(now);
        (steps, None)
    }

    fn end_touch_off(&mut self, done: &TouchOff) -> SpringEvent {
        let configured = self.config.stiffness_n_per_m;
        let line = match fit(&done.points) {
            Some(line) if line.slope >= 0.5 * configured && line.slope <= 2.0 * configured => line,
            other => {
                let value = other.map_or(0.0, |line| line.slope);
                return self.trip(SpringFaultCause::SpringImplausible, value, configured);
            }
        };
        let zero = ZeroReading {
            zero_m: self.position_m(done.from) + line.zero,
            zero_error_m: line.zero_error,
            stiffness_n_per_m: line.slope,
        };
        // The spring then waits at the zero reading.
        self.begin(zero, Target::Deflection { deflection_m: 0.0 }, self.config.steps(zero.zero_m), false);
        SpringEvent::Touched(zero)
    }
}
