//! A mode that is no peak: it is added where the fit of the others leaves what it explains.

use super::fit::{Fitted, Problem};
use super::{LINES_PER_MODE, MAX_MODES};

/// Half-power width at most of a mode that is no peak, as a share of the band.
const NARROW: f64 = 0.25;

/// Its part of H at its own frequency at least, over that of all else.
const SEEN: f64 = 0.5;

impl Problem {
    /// The fit with one mode more, where this one leaves most: if it is within the band and explains more than noise does, by Schwarz's criterion.
    pub fn with_another(&self, fit: &Fitted, driven: usize, band_hz: [f64; 2]) -> Option<Fitted> {
        let count = fit.poles().len() / 2 + 1;
        let fewest = self.places.iter().map(|place| place.lines.len()).min()?;
        if count > MAX_MODES || fewest < LINES_PER_MODE * (count + 1) {
            return None;
        }
        let before = self.modes(fit, driven, band_hz).ok()?;
        let mut poles = [fit.poles(), &[before.worst_hz, 0.01]].concat();
        self.search(&mut poles, count - 1, &fit.deviations);
        let mut pairs: Vec<&[f64]> = poles.chunks(2).collect();
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let fit_more = self.fit(pairs.concat(), fit.deviations.clone()).ok()?;
        let modes = self.modes(&fit_more, driven, band_hz).ok()?;
        // The mode that is left when each one of before has its nearest.
        let poles: Vec<&[f64]> = fit_more.poles().chunks(2).collect();
        let mut left: Vec<usize> = (0..count).collect();
        for known in fit.poles().chunks(2) {
            let apart_hz = |which: &usize| (poles[*which][0] - known[0]).abs();
            let nearest = (0..left.len()).min_by(|a, b| apart_hz(&left[*a]).total_cmp(&apart_hz(&left[*b])))?;
            left.remove(nearest);
        }
        let added = *left.first()?;
        let ([low_hz, high_hz], half_width_hz) = (band_hz, poles[added][0] * poles[added][1]);
        let is_inside = poles[added][0] - half_width_hz > low_hz && poles[added][0] + half_width_hz < high_hz;
        let is_narrow = 2.0 * half_width_hz < NARROW * (high_hz - low_hz);
        let lines: usize = self.places.iter().map(|place| place.lines.len()).sum();
        let parameters = 2 * (1 + self.places.len());
        let gain = (self.misfit_of(fit)? - self.misfit_of(&fit_more)?) / modes.inflation;
        let is_more = gain > parameters as f64 * (2.0 * lines as f64).ln();
        (is_more && is_inside && is_narrow && self.is_seen(&fit_more, added)).then_some(fit_more)
    }

    /// Whether a mode is a good part of H at its own frequency, at one place at least: what bends under other modes, or is a disturbance, may be
    /// explained by a mode, but is none that anyone would see.
    fn is_seen(&self, fit: &Fitted, which: usize) -> bool {
        let natural_hz = fit.poles()[2 * which];
        self.places.iter().zip(&fit.deviations).any(|(place, deviations)| {
            let constants = place.constants(fit.poles(), deviations);
            let apart_hz = |n: &usize| (place.lines[*n].frequency_hz - natural_hz).abs();
            let nearest = (0..place.lines.len()).min_by(|a, b| apart_hz(a).total_cmp(&apart_hz(b)));
            constants.zip(nearest).is_some_and(|(of, n)| {
                let own = of.columns[(n, which)] * of.values[which];
                let rest = of.fitted()[n] - own;
                own.norm() > SEEN * rest.norm()
            })
        })
    }

    /// −2 ln L of a fit, but for a constant.
    fn misfit_of(&self, fit: &Fitted) -> Option<f64> {
        let mut residuals = Vec::new();
        self.residuals(fit.poles(), &fit.deviations, &mut residuals);
        let squares: f64 = residuals.iter().map(|r| r * r).sum();
        let variances: f64 = fit.deviations.iter().flatten().map(|deviation| 4.0 * deviation.ln()).sum();
        Some(squares + variances).filter(|sum| sum.is_finite())
    }
}
