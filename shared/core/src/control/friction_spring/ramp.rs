//! Ramp of the stepper motor: whole steps per tick towards a target, with limited rate and acceleration.
//!
//! Position and velocity are integers (65536ths of a step, per tick), so no fraction of a step is lost between the
//! commanded and the counted position. Each tick takes the highest velocity from which braking still ends at the
//! target. The target is therefore reached without overshoot, unless it moves closer than the braking distance.

use crate::io::TICK_HZ;

/// Fractions of a step.
const ONE: f32 = 65_536.0;

/// Highest velocity and largest change of velocity per tick, in 65536ths of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RampLimits {
    velocity: i32,
    acceleration: i32,
}

impl RampLimits {
    /// Limits from steps/s (up to 32767 per tick) and steps/s². Neither becomes less than the smallest unit.
    #[must_use]
    pub fn new(rate_hz: f32, acceleration_hz_per_s: f32) -> Self {
        let velocity = (rate_hz / TICK_HZ * ONE) as i32;
        let acceleration = (acceleration_hz_per_s / (TICK_HZ * TICK_HZ) * ONE) as i32;
        Self { velocity: velocity.clamp(1, 1 << 30), acceleration: acceleration.clamp(1, 1 << 30) }
    }
}

/// Position and velocity of the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ramp {
    /// 65536ths of a step.
    position: i64,
    /// 65536ths of a step per tick.
    velocity: i32,
}

impl Ramp {
    /// Steps counted so far.
    #[must_use]
    pub fn steps(&self) -> i32 {
        ((self.position + (1 << 15)) >> 16) as i32
    }

    /// The motor stands still.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.velocity == 0
    }

    /// The motor stands still at this step.
    #[must_use]
    pub fn is_at(&self, steps: i32) -> bool {
        self.velocity == 0 && self.position == i64::from(steps) << 16
    }

    /// Stops within this tick. Used at search rates, from which a motor can stop at once.
    pub fn halt(&mut self) {
        self.declare(self.steps());
    }

    /// Sets the velocity to zero and the present position to `steps`.
    pub fn declare(&mut self, steps: i32) {
        *self = Self { position: i64::from(steps) << 16, velocity: 0 };
    }

    /// Runs one tick towards `target`, or to a stop if there is none. Returns the steps to make, positive away from the
    /// limit switch.
    pub fn tick(&mut self, limits: &RampLimits, target: Option<i32>) -> i8 {
        let before = self.steps();
        let a = limits.acceleration;
        self.velocity = match target {
            None => brake(self.velocity, a),
            Some(target) => self.towards((i64::from(target) << 16) - self.position, limits),
        };
        self.position += i64::from(self.velocity);
        (self.steps() - before).clamp(-127, 127) as i8
    }

    fn towards(&self, remaining: i64, limits: &RampLimits) -> i32 {
        let (top, a) = (limits.velocity, limits.acceleration);
        if remaining == 0 {
            return brake(self.velocity, a);
        }
        // From here on in a frame in which the target lies ahead.
        let ahead = if remaining < 0 { -1 } else { 1 };
        let (room, v) = (remaining.abs(), self.velocity * ahead);
        let landing = room <= i64::from(a) && v >= 0 && v <= a;
        if landing && room <= i64::from(top) {
            return room as i32 * ahead;
        }
        let fastest = if v > top { top.max(v - a) } else { top.min(v + a) };
        let choice = [fastest, v.min(fastest)]
            .into_iter()
            .find(|&v| v <= 0 || i64::from(v) + braking_distance(v, a) <= room)
            .unwrap_or(v - a);
        choice * ahead
    }
}

/// The velocity after one tick of braking.
fn brake(velocity: i32, a: i32) -> i32 {
    velocity - velocity.clamp(-a, a)
}

/// Distance covered after a tick at velocity `v` > 0 with braking from the next tick on: the sum of v − a, v − 2a, ….
fn braking_distance(v: i32, a: i32) -> i64 {
    let n = i64::from(v / a);
    n * i64::from(v) - i64::from(a) * (n * (n + 1) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs to `target` and checks rate and acceleration on the way. Returns the number of ticks.
    fn run(ramp: &mut Ramp, limits: &RampLimits, target: i32) -> u32 {
        let from = ramp.steps();
        let mut counted = from;
        for tick in 1..200_000 {
            let before = ramp.velocity;
            counted += i32::from(ramp.tick(limits, Some(target)));
            assert_eq!(counted, ramp.steps());
            assert!((ramp.velocity - before).abs() <= limits.acceleration, "acceleration at tick {tick}");
            assert!(ramp.velocity.abs() <= limits.velocity, "rate at tick {tick}");
            if ramp.is_at(target) {
                return tick;
            }
        }
        panic!("{target} not reached from {from}: {ramp:?}");
    }

    #[test]
    fn every_distance_is_covered_exactly_without_overshoot() {
        for (rate, acceleration) in [(1000.0, 4000.0), (16_000.0, 1e6), (333.0, 16.0), (777.7, 1e7), (50.0, 123.4)] {
            let limits = RampLimits::new(rate, acceleration);
            for distance in [1, -1, 2, 3, 7, -50, 101, 999, -1000, 5000] {
                let mut ramp = Ramp::default();
                let (low, high) = (0.min(distance), 0.max(distance));
                let mut seen = ramp;
                while !seen.is_at(distance) {
                    seen.tick(&limits, Some(distance));
                    assert!((low..=high).contains(&seen.steps()), "{distance}: {}", seen.steps());
                }
                run(&mut ramp, &limits, distance);
            }
        }
    }

    #[test]
    fn a_long_move_takes_no_longer_than_the_trapezoid() {
        let limits = RampLimits::new(1000.0, 4000.0);
        let ticks = run(&mut Ramp::default(), &limits, 5000);
        // 5000 steps at 1000/s and 0.25 s more for the two slopes; one slope tick each end and one for landing.
        assert!((5250..=5260).contains(&ticks), "{ticks}");
    }

    #[test]
    fn a_target_behind_a_moving_motor_is_reached_by_braking_and_returning() {
        let limits = RampLimits::new(1000.0, 4000.0);
        let mut ramp = Ramp::default();
        (0..600).for_each(|_| _ = ramp.tick(&limits, Some(10_000)));
        let turn = ramp.steps();
        run(&mut ramp, &limits, turn - 5);
        assert!(ramp.is_at(turn - 5));
    }

    #[test]
    fn without_a_target_the_motor_stops_within_the_braking_distance() {
        let limits = RampLimits::new(1000.0, 4000.0);
        let mut ramp = Ramp::default();
        (0..600).for_each(|_| _ = ramp.tick(&limits, Some(10_000)));
        let from = ramp.steps();
        (0..251).for_each(|_| _ = ramp.tick(&limits, None));
        // v²/2a = 125 steps.
        assert!(ramp.is_still() && (ramp.steps() - from - 125).abs() <= 1, "{}", ramp.steps() - from);
    }
}
