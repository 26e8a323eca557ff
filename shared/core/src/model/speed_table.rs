//! Coefficient of restitution as a table over the approach speed.

use crate::io::{Invalid, require};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most points of a [`SpeedTable`].
pub const SPEED_TABLE_POINTS: usize = 6;

/// Least ratio of a speed to the one before: they differ in single precision too.
const MIN_STEP: f64 = 1.001;

/// A point of a table: approach speed and e.
type Point<S> = [S; 2];

/// Coefficient of restitution e over the approach speed v of an impact: linear in v between points, and constant beyond the ends.
///
/// The rebound speed v·e(v) never falls as v rises, and e is less than 1: every chatter ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpeedTable {
    /// Approach speed, m/s, and e of each point, in the order of their speeds. A table with fewer points repeats its last one.
    points: [Point<f64>; SPEED_TABLE_POINTS],
}

impl SpeedTable {
    /// The name of the list of speeds in refusals.
    const SPEEDS: &str = "particle.wall.speeds_m_per_s";

    /// The name of the list of coefficients in refusals.
    const COEFFICIENTS: &str = "particle.wall.coefficients";

    /// A table of 2 to 6 points, each an approach speed in m/s and its e, in the order of their speeds; `None` of another number
    /// of points. [`Self::validate`] checks the values.
    #[must_use]
    pub fn new(points: &[Point<f64>]) -> Option<Self> {
        let last = *points.get(1..SPEED_TABLE_POINTS.min(points.len()))?.last()?;
        let mut all = [last; SPEED_TABLE_POINTS];
        all.get_mut(..points.len())?.copy_from_slice(points);
        Some(Self { points: all })
    }

    /// Its points: approach speed, m/s, and e.
    #[must_use]
    pub fn points(&self) -> &[Point<f64>] {
        let repeated = self.points.windows(2).rev().take_while(|pair| pair[0] == pair[1]).count();
        &self.points[..SPEED_TABLE_POINTS - repeated]
    }

    /// The largest e of any speed.
    #[must_use]
    pub fn maximum(&self) -> f64 {
        self.points.iter().fold(0.0, |most, point| most.max(point[1]))
    }

    /// e of an impact with this approach speed, m/s.
    #[must_use]
    pub fn at(&self, speed_m_per_s: f64) -> f64 {
        Pieces { points: self.points }.at(speed_m_per_s)
    }

    /// de/dv at this approach speed, s/m. At a point it is that of the faster side.
    #[must_use]
    pub fn slope(&self, speed_m_per_s: f64) -> f64 {
        let pieces = self.points.windows(2).rev();
        let within = |pair: &&[Point<f64>]| (pair[0][0]..pair[1][0]).contains(&speed_m_per_s);
        pieces.into_iter().find(within).map_or(0.0, |pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]))
    }

    /// The table in the scalar of a calculation whose unit of velocity is this many m/s.
    pub(super) fn pieces<S: Scalar>(&self, velocity_m_per_s: f64) -> Pieces<S> {
        Pieces { points: self.points.map(|[speed, e]| [S::from_f64(speed / velocity_m_per_s), S::from_f64(e)]) }
    }

    /// The least e at `to`, a faster speed than that of `point`, with which the rebound speed v·e(v) does not fall between them.
    ///
    /// v·e(v) is a parabola between two points. Where e falls it is steepest at the slower one, and its slope at the faster one is
    /// e + v·de/dv.
    #[must_use]
    pub fn least_at(point: [f64; 2], to: f64) -> f64 {
        point[1] * to / (2.0 * to - point[0])
    }

    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the list of the first value that is not: speeds that are not positive or do not rise by at least 0.1 %, e outside 0 to
    /// less than 1, a rebound that falls.
    pub fn validate(&self) -> Result<(), Invalid> {
        let (speeds, coefficients) = (Self::SPEEDS, Self::COEFFICIENTS);
        let points = self.points();
        require(points.len() > 1, speeds, points[0][0], "one of 2 to 6 speeds that rise")?;
        let mut before = [0.0, 0.0];
        for point in points {
            let [speed, e] = *point;
            let rises = speed > 0.0 && speed >= MIN_STEP * before[0] && speed.is_finite();
            require(rises, speeds, speed, "greater than 0 and at least 1.001 times the speed before")?;
            let allowed = "from 0 to less than 1, and so large that the rebound speed v·e(v) never falls";
            require((Self::least_at(before, speed)..1.0).contains(&e), coefficients, e, allowed)?;
            before = *point;
        }
        Ok(())
    }
}

/// A [`SpeedTable`] in the scalar and the unit of velocity of a calculation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pieces<S> {
    points: [Point<S>; SPEED_TABLE_POINTS],
}

impl<S: Scalar> Pieces<S> {
    /// e at this speed.
    pub(super) fn at(&self, speed: S) -> S {
        let [mut from, last] = [self.points[0], self.points[SPEED_TABLE_POINTS - 1]];
        if speed < from[0] {
            return from[1];
        }
        for to in &self.points[1..] {
            if speed < to[0] {
                return from[1] + (to[1] - from[1]) * ((speed - from[0]) / (to[0] - from[0]));
            }
            from = *to;
        }
        last[1]
    }

    /// e of slow impacts.
    pub(super) fn slow(&self) -> S {
        self.points[0][1]
    }

    /// Whether e is that of slow impacts at this speed and all lower ones.
    pub(super) fn is_slow(&self, speed: S) -> bool {
        speed <= self.points[0][0]
    }

    /// The largest e.
    pub(super) fn maximum(&self) -> S {
        self.points.iter().fold(S::ZERO, |most, point| most.max(point[1]))
    }

    /// The approach speed v at which v (1 + e(v)), which rises with v, is `closing`.
    pub(super) fn approach(&self, closing: S) -> S {
        let closing_at = |point: Point<S>| point[0] * (S::ONE + point[1]);
        let mut from = self.points[0];
        if closing < closing_at(from) {
            return closing / (S::ONE + from[1]);
        }
        for to in &self.points[1..] {
            if closing < closing_at(*to) {
                // With v = v0 + u and the slope s of e: s u² + (1 + e0 + s v0) u is what is left of the closing speed. The factor of u is
                // at least 1, and so is the root, as the rebound speed never falls.
                let slope = (to[1] - from[1]) / (to[0] - from[0]);
                let left = closing - closing_at(from);
                let linear = S::ONE + from[1] + slope * from[0];
                let root = (linear * linear + S::from_u8(4) * slope * left).max(S::ZERO).sqrt();
                return from[0] + left * S::from_u8(2) / (linear + root);
            }
            from = *to;
        }
        closing / (S::ONE + from[1])
    }
}
