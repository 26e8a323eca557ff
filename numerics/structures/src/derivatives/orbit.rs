//! Derivatives of a periodic motion: its start moves with the quantities so that it repeats.

use nalgebra::{Complex, DMatrix};

use super::follow::Follower;
use super::periods::REPEATS;
use super::setting::Sloped;
use super::{NoDerivatives, Varied};
use crate::State;

/// Singular values of 1 − M below this share of its largest are zero: the rounding of M is 10⁻¹⁴ per event.
const SINGULAR: f64 = 1e-9;

impl Follower<'_> {
    /// The disturbances of the start as independent ones of comparable size, where friction does not let all begin.
    pub(super) fn take_free_starts(&mut self) {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let svd = DMatrix::from_fn(2 * bodies, 2 * bodies, |i, j| {
            self.scale(i) * self.s[(i, quantities + j)] / self.scale(j)
        })
        .svd(true, false);
        let Some(along) = svd.u else { return };
        for (j, size) in svd.singular_values.iter().enumerate() {
            let share = if *size > SINGULAR * svd.singular_values.max() { 1.0 } else { 0.0 };
            for i in 0..2 * bodies {
                self.s[(i, quantities + j)] = share * along[(i, j)] / self.scale(i);
            }
        }
        self.start = self.s.clone();
        self.start_w = self.w.clone();
    }

    /// Lets the start move with the quantities so that the motion repeats; gives the multipliers of disturbances, the largest first.
    pub(super) fn close_orbit(&mut self) -> Result<Vec<Complex<f64>>, NoDerivatives> {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let returned = self.returned();
        let free = returned.map.nrows();
        let svd = (DMatrix::identity(free, free) - &returned.map).svd(true, true);
        if svd.singular_values.min() <= SINGULAR * svd.singular_values.max() {
            return Err(NoDerivatives::NotIsolated);
        }
        // How far the motion is from the orbit, by what it misses after its periods.
        let start = svd.solve(&returned.missed, 0.0).map_err(|_| NoDerivatives::NotIsolated)?;
        if start.norm() > REPEATS * returned.size {
            return Err(NoDerivatives::NotPeriodic);
        }
        let solved = svd.solve(&returned.by, 0.0).map_err(|_| NoDerivatives::NotIsolated)?;
        // In the columns of the start that friction lets begin.
        let mut by = DMatrix::zeros(2 * bodies, quantities);
        let begin = (0..2 * bodies).filter(|&j| self.start.column(quantities + j).norm() > 0.0);
        for (row, j) in begin.enumerate() {
            by.row_mut(j).copy_from(&solved.row(row));
        }
        let moved = |of: &mut Sloped| {
            let more = by.tr_mul(&of.slopes.rows(quantities, 2 * bodies));
            let mut own = of.slopes.rows_mut(0, quantities);
            own += more;
        };
        let more = self.s.view((0, quantities), (2 * bodies, 2 * bodies)) * &by;
        let mut own = self.s.view_mut((0, 0), (2 * bodies, quantities));
        own += more;
        self.margins.iter_mut().for_each(moved);
        self.squares.iter_mut().for_each(moved);
        self.peaks.iter_mut().flatten().for_each(moved);
        for (.., time, speed) in &mut self.impacts {
            moved(time);
            moved(speed);
        }
        Ok(returned.multipliers())
    }
}

/// The motions of [`Varied`] over these periods.
pub(super) fn varied_at(varied: &[Varied], periods: u32, state: &State, advance_rad: f64) -> Vec<Varied> {
    let at = |varied: &Varied| Varied {
        value: varied.value,
        cases: varied.cases.each_ref().map(|case| case.of_periods(periods, state, advance_rad)),
    };
    varied.iter().map(at).collect()
}
