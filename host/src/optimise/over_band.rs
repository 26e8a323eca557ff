//! The objective's metric over the band: of the optimum at its nominal values, between its least and largest values in the scenarios, and of
//! the bare structure.

use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::{Evaluated, GoOnAfter, on_axis};
use super::file::Optimisation;
use super::scenarios;
use crate::failure::Failure;
use crate::study::axis::{AxisValue, AxisValues};

/// Points of the curve, evenly spaced in the band.
pub const POINTS: u32 = 121;

/// A point of the curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OverBand {
    /// Value of the band's axis.
    pub at: f64,
    /// The metric of the optimum at its nominal values, from the start for which it is worst.
    pub value: f64,
    /// Its least value in the scenarios by which the search compared points, from any start.
    pub low: f64,
    /// Its largest value there.
    pub high: f64,
    /// That of the bare structure, where it exists.
    pub bare: Option<f64>,
}

/// The curve, of a band of one axis of numbers; empty of another. The metric is simulated at each point as it is, without a search
/// between them.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn curve(optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<Vec<OverBand>, Failure> {
    let [axis] = optimisation.band() else { return Ok(Vec::new()) };
    let AxisValues::Numbers(numbers) = &axis.values else { return Ok(Vec::new()) };
    let (Some(from), Some(to)) = (numbers.first(), numbers.last()) else { return Ok(Vec::new()) };
    let place = |n: u32| from + (to - from) * f64::from(n) / f64::from(POINTS - 1);
    let at: Vec<f64> = (0..POINTS).map(place).collect();
    let points: Vec<Vec<AxisValue>> = at.iter().map(|at| vec![AxisValue::Number(*at)]).collect();
    let nominal = on_axis(optimisation, &best.values, &points, false, go_on)?;
    let bare = on_axis(optimisation, &best.values, &points, true, go_on).ok();
    let mut all = nominal.clone();
    if optimisation.is_robust() {
        let of = |scenario: &scenarios::Scenario| {
            let values = scenarios::values(optimisation, &best.values, scenario);
            on_axis(optimisation, &values, &points, false, go_on)
        };
        let found: Vec<Vec<Vec<f64>>> =
            scenarios::compared(optimisation).par_iter().map(of).collect::<Result<_, Failure>>()?;
        all.extend(found.into_iter().flatten());
    }
    let worse = |a: f64, b: f64| if optimisation.is_better(a, b) { b } else { a };
    let point = |(n, at): (usize, f64)| OverBand {
        at,
        value: nominal.iter().map(|start| start[n]).reduce(worse).unwrap_or(f64::NAN),
        low: all.iter().map(|of| of[n]).fold(f64::INFINITY, f64::min),
        high: all.iter().map(|of| of[n]).fold(f64::NEG_INFINITY, f64::max),
        bare: bare.as_ref().and_then(|bare| bare.first()).map(|bare| bare[n]).filter(|bare| bare.is_finite()),
    };
    Ok(at.into_iter().enumerate().map(point).collect())
}
