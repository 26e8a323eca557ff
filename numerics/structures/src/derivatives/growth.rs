//! How disturbances grow, and where a motion has forgotten its start.

use nalgebra::DMatrix;

use super::NoDerivatives;
use super::follow::Follower;

/// Largest growth. The rounding of the start, 10⁻¹⁶, then changes the derivatives by 10⁻⁹ of their size.
const MAX_GROWTH: f64 = 1e7;

/// What is left of changes that were not followed is nothing if it is less than this share of the motion: far below what is printed, and above the
/// rounding of the growth times the changes.
const FORGOTTEN: f64 = 1e-6;

impl Follower<'_> {
    /// Bounds the growth of disturbances. Before what is measured begins, a motion may have grown more: it is then followed anew from now on, as if
    /// its state did not depend on the quantities, and is to forget that ([`Follower::check_forgotten`]).
    pub(super) fn check_growth(&mut self) -> Result<f64, NoDerivatives> {
        let growth = self.growth();
        if growth <= MAX_GROWTH {
            return Ok(growth);
        }
        if self.is_measured {
            return Err(NoDerivatives::Growth { growth });
        }
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let changes = self.s.view((0, 0), (2 * bodies, quantities));
        let all = (0..2 * bodies).flat_map(|i| changes.row(i).iter().map(move |of| (i, of.abs())).collect::<Vec<_>>());
        let largest = all.map(|(i, of)| self.scale(i) * of).fold(0.0, f64::max);
        self.unknown = largest / self.sizes[0] + self.unknown * growth;
        self.s.view_mut((0, 0), (2 * bodies, quantities + 2 * bodies)).fill(0.0);
        self.s.columns_mut(quantities, 2 * bodies).fill(0.0);
        for i in 0..2 * bodies {
            self.s[(i, quantities + i)] = 1.0;
        }
        self.holds_within.fill(f64::INFINITY);
        self.last_event = None;
        self.impacts.clear();
        Ok(1.0)
    }

    /// What was not followed must have decayed when what is measured begins.
    pub(super) fn check_forgotten(&self) -> Result<(), NoDerivatives> {
        let left = self.unknown * self.growth();
        if left <= FORGOTTEN { Ok(()) } else { Err(NoDerivatives::Growth { growth: left.max(MAX_GROWTH) }) }
    }

    /// The largest growth of a disturbance of the start, now.
    fn growth(&self) -> f64 {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let of = |i: usize, j: usize| self.scale(i) * self.s[(i, quantities + j)] / self.scale(j);
        let grown = DMatrix::from_fn(2 * bodies, 2 * bodies, of);
        if grown.iter().all(|grown| grown.is_finite()) { grown.singular_values().max() } else { f64::INFINITY }
    }

    /// Makes displacements and velocities comparable.
    fn scale(&self, place: usize) -> f64 {
        let size = self.size_of(place);
        if place < self.bodies() { size } else { size / self.lowest_rad_per_s() }
    }
}
