//! An orbit of a structure and its neighbours on the branch: Newton's method on the map of its start.

use damprig_structures::{MotionCase, NoDerivatives, Returned, Section, Varied};
use nalgebra::{DMatrix, DVector};

use super::Family;

/// Most steps of Newton's method, and the last one's size as a share of the motion and the range: that of rounding in the map.
const MAX_STEPS: usize = 12;
const CONVERGED: f64 = 1e-10;

/// An orbit returns to its start within this share of its size.
const MISSED: f64 = 1e-8;

/// Singular values of 1 − M below this share of its largest are zero: the rounding of M is 10⁻¹⁴ per event.
const SINGULAR: f64 = 1e-9;

/// A step of Newton's method beyond this share leads elsewhere.
const FAR: f64 = 0.5;

/// Largest error of the multipliers by rounding at which their crossing of the unit circle is looked for.
const RESOLVED: f64 = 1e-7;

/// An event closer than this share of a period to the section is in the way of the next orbits.
const CLEAR: f64 = 0.01;

/// An orbit, or a guess of one.
#[derive(Clone, Debug)]
pub(super) struct OrbitPoint {
    /// Displacements and velocities of the bodies at the section.
    pub bodies: DVector<f64>,
    /// Place of the parameter in its range, 0 to 1.
    pub share: f64,
}

/// A direction from a point: of the bodies, and of the parameter's place.
pub(super) type Direction = OrbitPoint;

/// An orbit with its map.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    pub point: OrbitPoint,
    pub case: MotionCase,
    pub returned: Returned,
    /// Steps of Newton's method.
    pub steps: usize,
}

/// Where another branch crosses: its direction, and that in which the equations are singular.
#[derive(Clone, Debug)]
pub(super) struct Crossing {
    along: Direction,
    left: Direction,
}

/// Test functions of an orbit; each changes its sign at its special point.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrbitTests {
    /// Change of the parameter along the branch.
    pub fold: f64,
    /// Zero where a multiplier is +1.
    pub plus: f64,
    /// Zero where a multiplier is −1.
    pub minus: f64,
    /// Number of complex multipliers outside the unit circle.
    pub outside: usize,
    /// |μ| − 1 of the complex multipliers nearest to the circle.
    pub circle: f64,
}

/// Orbits of one number of periods from one section.
#[derive(Clone)]
pub(super) struct Shooter<'a> {
    pub family: &'a Family<'a>,
    pub section: Section,
    /// A case whose modes have the signs of all.
    like: MotionCase,
    /// Of each body's displacement and velocity: one over its typical size.
    weights: DVector<f64>,
}

impl<'a> Shooter<'a> {
    /// Of the orbits near this one.
    pub fn new(family: &'a Family<'a>, section: Section, shot: &MotionCase, returned: &Returned) -> Self {
        // In the directions of `along`, which are orthonormal in its units, a motion has the size `size`.
        let of = |i: usize| {
            let row = returned.along.row(i).norm();
            if row > 0.0 { 1.0 / (row * returned.size) } else { 0.0 }
        };
        let weights = DVector::from_fn(returned.along.nrows(), |i, _| of(i));
        Self { family, section, like: shot.clone(), weights }
    }

    pub fn value(&self, share: f64) -> f64 {
        let (low, high) = self.family.range;
        low + share * (high - low)
    }

    fn width(&self) -> f64 {
        self.family.range.1 - self.family.range.0
    }

    pub fn inner(&self, a: &Direction, b: &Direction) -> f64 {
        let bodies = a.bodies.iter().zip(&b.bodies).zip(&self.weights).map(|((a, b), w)| a * b * w * w);
        bodies.sum::<f64>() + a.share * b.share
    }

    pub fn length(&self, of: &Direction) -> f64 {
        self.inner(of, of).sqrt()
    }

    /// The motion from a point at another value of the parameter.
    fn case_at(&self, point: &OrbitPoint, value: f64) -> Result<MotionCase, NoDerivatives> {
        let case = (self.family.at)(value).ok_or(NoDerivatives::NoCase)?;
        case.at_section(&self.like, self.section, point.bodies.as_slice())
    }

    /// The map of a point's start.
    pub fn shoot(&self, point: OrbitPoint, steps: usize) -> Result<Shot, NoDerivatives> {
        let value = self.value(point.share);
        if !(self.family.goes_on)(value) {
            return Err(NoDerivatives::Stopped);
        }
        let case = self.case_at(&point, value)?;
        let at = |factor: f64| self.case_at(&point, value * factor);
        let [a, b, c, d, e, f] = Varied::AT.map(at);
        let varied = Varied { value, cases: [a?, b?, c?, d?, e?, f?] };
        let returned = case.returned(std::slice::from_ref(&varied))?;
        Ok(Shot { point: OrbitPoint { bodies: returned.start.clone(), ..point }, case, returned, steps })
    }

    /// The orbit from a guess on, whose distance from `anchor` along `tangent` is `arc`.
    pub fn correct(
        &self,
        guess: OrbitPoint,
        anchor: &OrbitPoint,
        tangent: &Direction,
        arc: f64,
    ) -> Result<Shot, NoDerivatives> {
        self.correct_beside(guess, (anchor, tangent, arc), None)
    }

    /// As [`Shooter::correct`]; with a crossing where another branch crosses. There the equations are singular; with the directions of the crossing
    /// in the disturbances and in the equations they are not: the orbit stays where the guess is along the first, and the second takes up what
    /// remains, zero on a branch of mirror-symmetric orbits.
    pub fn correct_beside(
        &self,
        guess: OrbitPoint,
        (anchor, tangent, arc): (&OrbitPoint, &Direction, f64),
        crossing: Option<&Crossing>,
    ) -> Result<Shot, NoDerivatives> {
        let chord = guess.clone();
        let mut shot = self.shoot(guess, 0)?;
        let mut remains = 0.0;
        for steps in 1..=MAX_STEPS {
            let (free, returned) = (shot.returned.map.nrows(), &shot.returned);
            let mut right = -returned.missed.clone().push(0.0);
            right[free] = arc - self.inner(tangent, &shot.point.minus(anchor));
            let mut matrix = self.bordered(returned, tangent);
            if let Some(crossing) = crossing {
                let [along, left] = [&crossing.along, &crossing.left].map(|of| returned.coordinates(&of.bodies));
                let off = returned.coordinates(&shot.point.minus(&chord).bodies);
                right = right.push(-along.dot(&off));
                matrix = matrix.resize(free + 2, free + 2, 0.0);
                for i in 0..free {
                    right[i] -= remains * left[i];
                    matrix[(i, free + 1)] = left[i];
                    matrix[(free + 1, i)] = along[i];
                }
            }
            let step = matrix.lu().solve(&right).ok_or(NoDerivatives::NotIsolated)?;
            remains += if crossing.is_some() { step[free + 1] } else { 0.0 };
            let moved = self.direction(returned, &step);
            let size = self.length(&moved);
            if size.is_nan() || size > FAR {
                return Err(NoDerivatives::NotPeriodic);
            }
            if size <= CONVERGED {
                // Beside a crossing something may remain that is no orbit.
                let is_orbit = returned.missed.norm() <= MISSED * returned.size;
                return if is_orbit { Ok(shot) } else { Err(NoDerivatives::NotPeriodic) };
            }
            shot = self.shoot(shot.point.plus(&moved, 1.0), steps)?;
        }
        Err(NoDerivatives::NotPeriodic)
    }

    /// The orbit at a place of the parameter.
    pub fn correct_at(&self, guess: OrbitPoint, share: f64) -> Result<Shot, NoDerivatives> {
        let only = Direction { bodies: DVector::zeros(guess.bodies.len()), share: 1.0 };
        let anchor = OrbitPoint { share, ..guess.clone() };
        self.correct(OrbitPoint { share, ..guess }, &anchor, &only, 0.0)
    }

    /// The derivative of what the motion misses by disturbances and the parameter's place; its last row is that of `border`.
    fn bordered(&self, returned: &Returned, border: &Direction) -> DMatrix<f64> {
        let free = returned.map.nrows();
        let mut matrix = DMatrix::zeros(free + 1, free + 1);
        matrix.view_mut((0, 0), (free, free)).copy_from(&(&returned.map - DMatrix::identity(free, free)));
        matrix.view_mut((0, free), (free, 1)).copy_from(&(&returned.by * self.width()));
        let weighted = DVector::from_fn(border.bodies.len(), |i, _| border.bodies[i] * self.weights[i].powi(2));
        matrix.view_mut((free, 0), (1, free)).copy_from(&returned.along.tr_mul(&weighted).transpose());
        matrix[(free, free)] = border.share;
        matrix
    }

    /// A direction from its disturbances and the parameter's place.
    fn direction(&self, returned: &Returned, of: &DVector<f64>) -> Direction {
        let free = returned.map.nrows();
        Direction { bodies: &returned.along * of.rows(0, free), share: of[free] }
    }

    /// The crossing near an orbit.
    pub fn crossing(&self, shot: &Shot) -> Option<Crossing> {
        let free = shot.returned.map.nrows();
        let svd = (&shot.returned.map - DMatrix::identity(free, free)).svd(true, true);
        let last = svd.singular_values.imin();
        let direction = |of: DVector<f64>| self.direction(&shot.returned, &of.push(0.0));
        let (left, along) = (svd.u?.column(last).into_owned(), svd.v_t?.row(last).transpose());
        Some(Crossing { along: direction(along), left: direction(left) })
    }

    /// The direction of the branch, of length 1, on the side of `towards`.
    pub fn tangent(&self, shot: &Shot, towards: &Direction) -> Option<Direction> {
        let free = shot.returned.map.nrows();
        let mut right = DVector::zeros(free + 1);
        right[free] = 1.0;
        let along = self.bordered(&shot.returned, towards).lu().solve(&right)?;
        let along = self.direction(&shot.returned, &along);
        let length = self.length(&along);
        (length.is_finite() && length > 0.0).then(|| along.scaled(1.0 / length))
    }

    /// The direction in which the parameter grows.
    pub fn upwards(&self, shot: &Shot) -> Option<Direction> {
        let only = Direction { bodies: DVector::zeros(shot.point.bodies.len()), share: 1.0 };
        self.tangent(shot, &only)
    }

    /// The direction, of length 1, in which a disturbance of an orbit is multiplied by `multiplier`, nearly.
    pub fn neutral(&self, shot: &Shot, multiplier: f64) -> Option<Direction> {
        let free = shot.returned.map.nrows();
        let shifted = &shot.returned.map - DMatrix::identity(free, free) * multiplier;
        let last = shifted.svd(false, true).v_t?.row(free.checked_sub(1)?).transpose();
        let along = self.direction(&shot.returned, &last.push(0.0));
        let length = self.length(&along);
        (length > 0.0).then(|| along.scaled(1.0 / length))
    }

    pub fn tests(&self, shot: &Shot, tangent: &Direction) -> OrbitTests {
        let map = &shot.returned.map;
        let one = DMatrix::identity(map.nrows(), map.nrows());
        let is_resolved = map.norm() * f64::EPSILON < RESOLVED;
        let multipliers = shot.returned.multipliers();
        let complex = || multipliers.iter().filter(|m| is_resolved && m.im.abs() > 1e-9 * m.norm());
        let nearest = complex().map(|m| m.norm() - 1.0).min_by(|a, b| a.abs().total_cmp(&b.abs()));
        OrbitTests {
            fold: tangent.share,
            plus: (&one - map).determinant(),
            minus: (&one + map).determinant(),
            outside: complex().filter(|m| m.norm() > 1.0).count(),
            circle: nearest.unwrap_or(f64::NAN),
        }
    }

    /// The same orbits from another section if an event is close to this one: with the two last orbits of a branch there.
    pub fn moved(&self, last: &OrbitPoint, shot: &Shot) -> Option<(Self, OrbitPoint, Shot)> {
        let period_s = shot.case.duration_s / f64::from(self.section.periods);
        if shot.returned.clear_s.iter().all(|clear_s| *clear_s > CLEAR * period_s) {
            return None;
        }
        let at_s = shot.case.clear_section_s(self.section.periods).ok()?;
        let advance_rad = self.section.advance_rad + std::f64::consts::TAU * at_s / period_s;
        let shooter = Self { section: Section { advance_rad, ..self.section }, ..self.clone() };
        let later = |point: &OrbitPoint| {
            let case = self.case_at(point, self.value(point.share)).ok()?;
            // At the same phase of its own sine.
            let after_s = at_s * case.duration_s / shot.case.duration_s;
            Some(OrbitPoint { bodies: DVector::from_vec(case.bodies_after(after_s).ok()?), ..point.clone() })
        };
        let (last, point) = (later(last)?, later(&shot.point)?);
        let shot = shooter.correct_at(point, shot.point.share).ok()?;
        Some((shooter, last, shot))
    }

    /// How an orbit's state after half its length differs from that at its start, of it mirrored (`sign` −1) or as it is.
    pub fn half_apart(&self, shot: &Shot, sign: f64) -> f64 {
        let Ok(half) = shot.case.bodies_after(0.5 * shot.case.duration_s) else { return f64::INFINITY };
        self.length(&Direction { bodies: DVector::from_vec(half) * sign - &shot.point.bodies, share: 0.0 })
    }
}

impl Shot {
    /// Whether no other orbit is beside it at the same value of the parameter: a particle that meets no wall may be anywhere, and what friction
    /// holds all the time too.
    pub fn is_alone(&self) -> bool {
        let map = &self.returned.map;
        let values = (map - DMatrix::identity(map.nrows(), map.nrows())).singular_values();
        values.is_empty() || values.min() > SINGULAR * values.max()
    }
}

impl OrbitPoint {
    pub fn minus(&self, other: &Self) -> Direction {
        Direction { bodies: &self.bodies - &other.bodies, share: self.share - other.share }
    }

    pub fn plus(&self, along: &Direction, by: f64) -> Self {
        Self { bodies: &self.bodies + by * &along.bodies, share: self.share + by * along.share }
    }

    pub fn scaled(self, by: f64) -> Self {
        Self { bodies: self.bodies * by, share: self.share * by }
    }
}
