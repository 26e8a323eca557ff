//! When an event happens: functions that are positive as long as the pattern lasts, and their first change of sign in a step.

use super::super::equations::{Contact, End, Grip, Moment};
use super::{Reference, sign_of};
use damprig_core::model::Release;

/// A guard that comes this near to zero without crossing it at the ends of a step is looked at between them, relative to its size.
const NEAR: f64 = 1e-4;

/// Depth below zero that rounding causes, relative to the size of a guard.
const NOISE: f64 = 3e-15;

/// A function that is positive as long as the pattern lasts.
#[derive(Clone, Copy, Debug)]
pub enum Guard {
    /// Room between a particle and a wall.
    Gap(usize, usize),
    /// Penetration of a soft wall.
    Penetration(usize, usize),
    /// Force of a soft wall.
    Pressure(usize, usize),
    /// Speed of a slipping joint.
    Slip(usize, f64),
    /// Distance of the force in a stuck joint from a limit with this sign: position in the list of stuck joints, joint.
    Limit(usize, usize, f64),
}

impl Reference {
    pub fn guards(&self) -> Vec<Guard> {
        let mut guards = Vec::new();
        for (number, cage) in self.equations.cages.iter().enumerate() {
            if self.pattern.grips[number] == Grip::Stuck {
                continue;
            }
            match self.pattern.contacts[number] {
                Contact::Clear => guards.extend([Guard::Gap(number, 0), Guard::Gap(number, 1)]),
                Contact::Resting(_) => {}
                Contact::Released(side) => guards.push(Guard::Penetration(number, side)),
                Contact::Pressing(side) => guards.push(match cage.ends[side] {
                    End::Soft { release: Release::ZeroForce, .. } => Guard::Pressure(number, side),
                    _ => Guard::Penetration(number, side),
                }),
            }
        }
        for (joint, friction) in self.equations.friction.iter().enumerate() {
            if let Grip::Slip(sign) = self.pattern.grips[joint]
                && *friction > 0.0
            {
                guards.push(Guard::Slip(joint, sign));
            }
        }
        for (row, joint) in self.pattern.stuck.iter().enumerate() {
            let limits = self.limits(*joint);
            let finite = [-1.0, 1.0].into_iter().zip(limits).filter(|(_, limit)| limit.is_finite());
            guards.extend(finite.map(|(sign, _)| Guard::Limit(row, *joint, sign)));
        }
        guards
    }

    /// Limits of the force in a joint without relative velocity.
    pub fn limits(&self, joint: usize) -> [f64; 2] {
        let friction = self.equations.friction[joint];
        match self.pattern.contacts.get(joint) {
            Some(Contact::Resting(0)) => [-friction, f64::INFINITY],
            Some(Contact::Resting(_)) => [f64::NEG_INFINITY, friction],
            _ => [-friction, friction],
        }
    }

    /// Value and rate of a guard, and the size that its rounding is judged by.
    fn value(&self, guard: Guard, moment: &Moment) -> (f64, f64, f64) {
        let relative = |joint: usize| moment.relative(&self.equations.joints[joint]);
        let past = |number: usize, side: usize| {
            let [offset, slip, acceleration, _] = relative(number);
            let sign = sign_of(side);
            [sign * (offset - self.equations.cages[number].at[side]), sign * slip, sign * acceleration]
        };
        match guard {
            Guard::Gap(number, side) => {
                let [past, slip, _] = past(number, side);
                (-past, -slip, self.scale)
            }
            Guard::Penetration(number, side) => {
                let [past, slip, _] = past(number, side);
                (past, slip, self.scale)
            }
            Guard::Pressure(number, side) => {
                let [past, slip, acceleration] = past(number, side);
                let End::Soft { stiffness, damping, .. } = self.equations.cages[number].ends[side] else {
                    unreachable!("only a soft wall presses")
                };
                let size = stiffness * self.scale + damping * self.speed();
                (stiffness * past + damping * slip, stiffness * slip + damping * acceleration, size)
            }
            Guard::Slip(joint, sign) => {
                let [_, slip, acceleration, _] = relative(joint);
                (sign * slip, sign * acceleration, self.speed())
            }
            Guard::Limit(row, joint, sign) => {
                let compliance = self.equations.compliance(&[joint])[0][0];
                let size = self.equations.friction[joint].max(self.speed() * self.fastest / compliance);
                let limit = self.limits(joint)[usize::from(sign > 0.0)];
                (sign * (limit - moment.forces[row]), -sign * moment.force_rates[row], size)
            }
        }
    }

    /// The fraction of a step of length `h` at which a guard becomes negative for the first time.
    pub fn crossing(&self, guard: Guard, h: f64, before: &Moment, after: &Moment) -> Option<f64> {
        let value = |at: f64| {
            let (value, rate, _) = self.value(guard, &self.moment(at * h, &self.later(at * h)));
            (value, rate * h)
        };
        let (g0, d0, _) = self.value(guard, before);
        let (g1, d1, size) = self.value(guard, after);
        let (d0, d1) = (d0 * h, d1 * h);
        let noise = NOISE * size;
        let mut high = 1.0;
        if g1 >= -noise {
            // The cubic with these values and slopes tells where the guard comes near zero; the motion itself decides.
            let c2 = 3.0 * (g1 - g0) - 2.0 * d0 - d1;
            let c3 = d0 + d1 - 2.0 * (g1 - g0);
            let discriminant = c2 * c2 - 3.0 * c3 * d0;
            if discriminant <= 0.0 {
                return None;
            }
            let root = discriminant.sqrt();
            let mut at = if c2 > 0.0 { -d0 / (c2 + root) } else { (root - c2) / (3.0 * c3) };
            let lowest = g0 + at * (d0 + at * (c2 + at * c3));
            if !(at > 0.0 && at < 1.0 && lowest < NEAR * size) {
                return None;
            }
            let mut is_below = false;
            for _ in 0..6 {
                let (g, d) = value(at);
                if g < -noise {
                    is_below = true;
                    break;
                }
                let next = (at - d / (2.0 * root)).clamp(0.0, 1.0);
                if (next - at).abs() < 1e-12 {
                    break;
                }
                at = next;
            }
            if !is_below {
                return None;
            }
            high = at;
        }
        let mut low = 0.0;
        if g0 <= 0.0 {
            // The pattern has just begun with this guard at zero.
            let Some(positive) = (1..40).map(|n| high * 0.5_f64.powi(n)).find(|at| value(*at).0 > 0.0) else {
                return Some(0.0);
            };
            low = positive;
        }
        Some(Self::root(value, low, high))
    }

    /// Root between `low`, where a function is positive, and `high`, where it is not, by Newton's method within the bracket.
    fn root(value: impl Fn(f64) -> (f64, f64), mut low: f64, mut high: f64) -> f64 {
        let mut at = 0.5 * (low + high);
        for _ in 0..100 {
            let (g, d) = value(at);
            if g > 0.0 {
                low = at;
            } else {
                high = at;
            }
            let newton = at - g / d;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - at).abs() <= 1e-15 || high - low <= 1e-16 * high {
                return next;
            }
            at = next;
        }
        at
    }
}
