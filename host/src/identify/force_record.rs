//! The pulses of a force record: a half-sine is fitted to each, whose duration does not depend on where the samples fall.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::statistics::fit;
use super::table::{NumberTable, TableQuantity};
use crate::failure::Failure;

/// Force on a wall.
pub const FORCE: TableQuantity =
    TableQuantity { stem: "force", units: &[("n", 1.0), ("kn", 1e3)], about: "force on the wall", most: 1e6 };

/// A pulse of a force record.
#[derive(Clone, Copy, Debug)]
pub struct ForcePulse {
    /// Duration of the half-sine, s.
    pub time_s: f64,
    /// Standard uncertainty of `time_s` by the fit.
    pub uncertainty_s: f64,
    /// F, N.
    pub peak_n: f64,
    /// J, N·s.
    pub impulse_n_s: f64,
    /// Samples in `time_s`.
    pub samples: f64,
}

impl ForcePulse {
    /// Peak times contact time over impulse.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.peak_n * self.time_s / self.impulse_n_s
    }
}

/// Share of the record's peak above which a force is a pulse.
const PULSE: f64 = 0.2;

/// The pulses of a force record (columns t_s and force_n).
///
/// # Errors
/// Missing columns, a force without a pulse, a sensor at its limit.
pub fn pulses(table: &NumberTable) -> Result<Vec<ForcePulse>, Failure> {
    let (t_s, force_n) = (table.times()?, table.column(&FORCE)?);
    let mut sorted = force_n.clone();
    sorted.sort_by(f64::total_cmp);
    let (about_n, highest_n) = (sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
    // The samples of the pulses would raise the median.
    sorted.retain(|force| force - about_n <= PULSE * (highest_n - about_n));
    let rest_n = sorted[sorted.len() / 2];
    let force_n: Vec<f64> = force_n.iter().map(|force| force - rest_n).collect();
    let peak_n = highest_n - rest_n;
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(start) = (from..t_s.len()).find(|n| force_n[*n] > PULSE * peak_n) {
        let end = (start..t_s.len()).find(|n| force_n[*n] <= PULSE * peak_n).unwrap_or(t_s.len());
        from = end;
        // A pulse that the record cuts has no duration, and a single sample no shape.
        if start < 3 || end + 3 > t_s.len() || end < start + 3 {
            continue;
        }
        if let Some(level) =
            force_n[start..end].windows(3).find(|w| w[0] > 0.9 * peak_n && w[0] == w[1] && w[1] == w[2])
        {
            return Err(table.refuse(format!(
                "the force sensor is saturated: it stays at {} N at the peak\n  make weaker impacts, or use a sensor of larger range",
                level[0] + rest_n
            )));
        }
        found.extend(fitted(&t_s, &force_n, start..end));
    }
    if found.is_empty() {
        let text = "there is no whole pulse of three samples or more\n  sample the force faster, and record it before and after the impact";
        return Err(table.refuse(text));
    }
    Ok(found)
}

/// Fits a half-sine to the pulse at these samples and those around them.
fn fitted(t_s: &[f64], force_n: &[f64], above: std::ops::Range<usize>) -> Option<ForcePulse> {
    let about = above.len().div_ceil(4) + 2;
    let around = above.start.saturating_sub(about)..(above.end + about).min(t_s.len());
    let (t, force) = (&t_s[around.clone()], &force_n[around.clone()]);
    let highest = above.clone().max_by(|a, b| force_n[*a].total_cmp(&force_n[*b]))?;
    // Above a fifth of its peak a half-sine is 87 % of its duration.
    let time_s = (t_s[above.end] - t_s[above.start]) / 0.872;
    let start = [force_n[highest], 0.5 * (t_s[above.end] + t_s[above.start - 1] - time_s), time_s];
    let step = 1e-4 * time_s;
    let sine = |p: &[f64], out: &mut Vec<f64>| {
        out.extend(t.iter().map(|t| {
            let at = (t - p[1]) / p[2];
            if (0.0..=1.0).contains(&at) { p[0] * (PI * at).sin() } else { 0.0 }
        }));
    };
    let fit = fit(force, &start, &[1e-4 * start[0], step, step], sine)?;
    let time_s = fit.parameters[2];
    let uncertainty_s = fit.value(2, fit.variance()).standard_uncertainty;
    let impulse_n_s = (1..t.len()).map(|n| 0.5 * (force[n] + force[n - 1]) * (t[n] - t[n - 1])).sum::<f64>();
    let peak_n = top_n(t_s, force_n, highest, TOP * time_s);
    let is_valid = time_s > 0.0 && impulse_n_s > 0.0 && uncertainty_s.is_finite();
    let samples = time_s * (t.len() - 1) as f64 / (t[t.len() - 1] - t[0]);
    is_valid.then_some(ForcePulse { time_s, uncertainty_s, peak_n, impulse_n_s, samples })
}

/// Share of a contact on either side of its highest sample in which a half-sine is a parabola to 10⁻⁴ of its peak.
const TOP: f64 = 0.125;

/// The top of the parabola through the samples within so many seconds of the highest one, and its neighbours at least. Through the three
/// highest alone noise would raise it.
fn top_n(t_s: &[f64], force_n: &[f64], highest: usize, within_s: f64) -> f64 {
    let is_near = |n: &usize| n.abs_diff(highest) <= 1 || (t_s[*n] - t_s[highest]).abs() <= within_s;
    let near: Vec<usize> = (0..t_s.len()).filter(is_near).collect();
    let at = |n: &usize| (t_s[*n] - t_s[highest]) / within_s;
    let terms = DMatrix::from_fn(near.len(), 3, |row, power| at(&near[row]).powi(power as i32));
    let forces = DVector::from_iterator(near.len(), near.iter().map(|n| force_n[*n]));
    let parabola = terms.svd(true, true).solve(&forces, f64::EPSILON).ok();
    match parabola.map(|p| [p[0], p[1], p[2]]) {
        Some([level, slope, bend]) if bend < 0.0 => level - slope * slope / (4.0 * bend),
        _ => force_n[highest],
    }
}
