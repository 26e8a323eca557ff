//! Root finding inside an arc of one oscillator: the instant of an impact and the turning point of a displacement.
//!
//! The series is evaluated at a guess; five derivatives at that point then give the motion to the last bit.

use super::excitation::Wave;
use super::oscillator::{Oscillator, dot};
use super::series::Bend;
use crate::integrator::modes::{Sign, signed};

/// Largest distance from the guess, in arcs, at which five derivatives suffice: the next term is at most NEAR⁵ ·
/// 0.8⁶/5! = 2·10⁻¹⁸ of the velocity.
const NEAR: f64 = 1e-3;

/// Newton steps after which the walk takes over.
const MAX_STEPS: u32 = 8;

/// Fraction of an arc at which a quantity that falls by `travel` over the arc has fallen by `part`, from its rates of
/// fall at both ends: the cubic that interpolates time as a function of the quantity, with value and slope at both
/// ends.
#[inline]
pub(super) fn inverse_cubic(part: f64, travel: f64, rate: f64, rate_end: f64) -> f64 {
    let (slow, slow_end) = (1.0 / rate, 1.0 / rate_end);
    let w = part / travel;
    let rest = 1.0 - w;
    let guess = w * (w * (3.0 - 2.0 * w) + travel * rest * (rest * slow - w * slow_end));
    if guess > 0.0 && guess < 1.0 { guess } else { w }
}

/// Fraction of an arc at which a gap closes that opens at `rate`, has the closing acceleration `pressing` and falls by
/// `travel` in total: first estimate from the parabola, second from the cubic that also has the gap's end value.
#[inline]
pub(super) fn back_after(gap: f64, rate: f64, pressing: f64, travel: f64) -> f64 {
    let half = 0.5 * pressing;
    let bend = -(travel + rate - half);
    let mut t = 0.5;
    for curved in [0.0, bend] {
        let effective = half - curved * t;
        t = (rate + libm::sqrt(rate * rate + 4.0 * effective.max(0.0) * gap)) / (2.0 * effective);
        if !(t > 0.0 && t < 1.0) {
            return 0.5;
        }
    }
    t
}

/// The motion of an oscillator over a full arc from a given state, as a series.
pub(super) struct ArcMotion<'a> {
    table: &'a Oscillator,
    unit: &'a [f64; 5],
    wave: &'a Wave,
    bend: Bend,
}

/// The motion at one instant.
pub(super) struct Near {
    /// Displacement, m.
    pub x: f64,
    /// Velocity × step minus its value at the start, m.
    pub rate: f64,
    /// The excitation at that instant.
    pub wave: Wave,
}

impl<'a> ArcMotion<'a> {
    /// Takes displacement, velocity, constant acceleration, sine and cosine.
    #[inline]
    pub fn new(table: &'a Oscillator, unit: &'a [f64; 5], wave: &'a Wave) -> Self {
        Self { table, unit, wave, bend: Bend::new(&table.columns, unit) }
    }

    /// Finds the single root of `gap − closing τ − pull τ² + side·(curved part)`. Returns the root, the motion there
    /// and the number of steps.
    #[inline]
    pub fn gap_closes(&self, side: Sign, gap: f64, closing: f64, pull: f64, guess: f64) -> Option<(f64, Near, u32)> {
        let (mut low, mut high, mut t) = (0.0, 1.0, guess);
        for steps in 1..=MAX_STEPS {
            let (curved, rate) = self.bend.at(t);
            let here = gap - (closing + pull * t) * t + signed(side, curved);
            let per_speed = 1.0 / (closing + 2.0 * pull * t - signed(side, rate));
            let step = here * per_speed;
            if step.abs() <= NEAR {
                let (wave, rates) = self.rates(t, curved, rate);
                // g = here − speed δ + bent δ² + …: two terms of the series reversion, then one Newton step.
                let bent = 0.5 * signed(side, rates[0]) - pull;
                let q = bent * per_speed;
                if (q * step).abs() <= NEAR {
                    let near = step * (1.0 + q * step);
                    let third = signed(side, rates[1] * (1.0 / 6.0) + near * (rates[2] * (1.0 / 24.0)));
                    let left = step - near + near * near * (bent + near * third) * per_speed;
                    let more = near + left * (1.0 + 2.0 * q * near);
                    return Some((t + more, self.after((t, more), (curved, rate), &rates, &wave), steps));
                }
            }
            if here > 0.0 {
                low = t;
            } else {
                high = t;
            }
            let next = t + step;
            t = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        None
    }

    /// Finds the single zero of the rate between 0 and 1, which must cross zero exactly once. Returns its instant and
    /// the displacement there.
    #[inline]
    pub fn top(&self, guess: f64) -> Option<(f64, f64)> {
        let start_rate = self.unit[1] * self.table.step_s;
        let mut t = guess;
        for _ in 0..MAX_STEPS {
            let (curved, bend_rate) = self.bend.at(t);
            let (_, [second, third, fourth, fifth]) = self.rates(t, curved, bend_rate);
            let rate = start_rate + bend_rate;
            let step = -rate / second;
            if step.abs() <= NEAR {
                // An error in the instant changes the displacement only to second order.
                let more = step * (1.0 - 0.5 * third / second * step);
                let rise = third * (1.0 / 6.0) + more * (fourth * (1.0 / 24.0) + more * fifth * (1.0 / 120.0));
                let x = self.unit[0] + (start_rate * t + curved);
                return Some((t + more, x + more * (rate + more * (0.5 * second + more * rise))));
            }
            t = (t + step).clamp(0.0, 1.0);
        }
        None
    }

    /// Displacement and velocity × step at `t`.
    #[inline]
    pub fn at(&self, t: f64) -> (f64, f64) {
        let (curved, rate) = self.bend.at(t);
        let start_rate = self.unit[1] * self.table.step_s;
        (self.unit[0] + (start_rate * t + curved), start_rate + rate)
    }

    /// The wave at `t`, and the second to fifth derivatives by τ.
    #[inline(always)]
    fn rates(&self, t: f64, curved: f64, rate: f64) -> (Wave, [f64; 4]) {
        let table = self.table;
        let wave = self.wave.turned(table.angle * t);
        let x = self.unit[0] + (self.unit[1] * table.step_s * t + curved);
        let v = self.unit[1] + rate * table.per_step;
        let unit = [x, v, self.unit[2], wave.sine, wave.cosine];
        (wave, table.rates.each_ref().map(|row| dot(row, &unit)))
    }

    /// The motion `more` arcs after `t`.
    #[inline(always)]
    fn after(&self, (t, more): (f64, f64), (curved, rate): (f64, f64), rates: &[f64; 4], wave: &Wave) -> Near {
        let [second, third, fourth, fifth] = *rates;
        let (third, fourth, fifth) = (third * 0.5, fourth * (1.0 / 6.0), fifth * (1.0 / 24.0));
        let gained = more * (second + more * (third + more * (fourth + more * fifth)));
        let mean = second * 0.5 + more * (third * (1.0 / 3.0) + more * (fourth * 0.25 + more * fifth * 0.2));
        let curved = curved + more * (rate + more * mean);
        Near {
            x: self.unit[0] + (self.unit[1] * self.table.step_s * (t + more) + curved),
            rate: rate + gained,
            wave: wave.nudged(self.table.angle * more),
        }
    }
}
