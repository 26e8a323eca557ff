//! How disturbances grow.

use nalgebra::DMatrix;

use super::NoDerivatives;
use super::follow::Follower;

/// Largest growth. The rounding of the start, 10⁻¹⁶, then changes the derivatives by 10⁻⁹ of their size.
const MAX_GROWTH: f64 = 1e7;

impl Follower<'_> {
    /// The largest growth of a disturbance of the start, now; refused if rounding has grown too.
    pub(super) fn check_growth(&self) -> Result<f64, NoDerivatives> {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let of = |i: usize, j: usize| self.scale(i) * self.s[(i, quantities + j)] / self.scale(j);
        let grown = DMatrix::from_fn(2 * bodies, 2 * bodies, of);
        let is_finite = grown.iter().all(|grown| grown.is_finite());
        let growth = if is_finite { grown.singular_values().max() } else { f64::INFINITY };
        if growth <= MAX_GROWTH { Ok(growth) } else { Err(NoDerivatives::Growth { growth }) }
    }

    /// Makes displacements and velocities comparable.
    pub(super) fn scale(&self, place: usize) -> f64 {
        let size = self.size_of(place);
        if place < self.bodies() { size } else { size / self.lowest_rad_per_s() }
    }
}
