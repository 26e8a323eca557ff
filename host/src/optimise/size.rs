//! How many simulations an optimisation has, with those after its search, and how long they take.

use super::answer::DENSE_STARTS;
use super::cases::BandCases;
use super::evaluate;
use super::file::Optimisation;
use super::{gradient, mount, neighbourhood, over_band, scenarios, search};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::study::band::{Band, Effort};
use crate::study::evaluate::simulating_s;
use crate::study::sampling::{Sampling, SamplingMethod};

/// Share of the points of the search whose band is searched, about.
const SEARCHED: f64 = 0.5;

/// Share of the scenarios of a search that are simulated, about: the worst of a point is no better than its nominal values, so most points
/// need none, and neighbours share some.
const COMPARED: f64 = 0.05;

/// Points of gradient steps, about.
const DESCENDED: u64 = 150;

/// Points tried for an estimate.
const TRIED: usize = 4;

/// Numbers of simulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchSize {
    /// The most of all.
    pub most: u64,
    /// About those of the search.
    pub search: u64,
    /// About those after it.
    pub after: u64,
}

impl SearchSize {
    /// Of an optimisation.
    #[must_use]
    pub fn of(optimisation: &Optimisation) -> Self {
        let each = |effort: Effort| {
            let between = |band: &Band| band.most_between(effort);
            let constraints = optimisation.constraints.len() as u64 * between(&optimisation.constraint_band);
            let starts = optimisation.starts.as_ref().map_or(1, |starts| starts.len() as u64);
            starts * (optimisation.band_points() as u64 + between(&optimisation.reduced_band) + constraints)
        };
        let (grid, peaks, scan) = (each(Effort::Grid), each(Effort::Peaks), each(Effort::Scan));
        let one_start = |effort| optimisation.band_points() as u64 + optimisation.reduced_band.most_between(effort);
        let curves = 2 + scenarios::compared(optimisation).len() as u64;
        let over_band = if optimisation.band().len() == 1 { curves * u64::from(over_band::POINTS) } else { 0 };
        let around = neighbourhood::points(optimisation.variables.len()) * peaks
            + u64::from(DENSE_STARTS) * one_start(Effort::Peaks)
            + neighbourhood::scanned_points(optimisation.variables.len()) * scan
            + 2 * one_start(Effort::Scan)
            + optimisation.band_points() as u64
            + over_band;
        let around = if optimisation.has_surroundings { around } else { 0 };
        let (tried, scanned) = mount::points(optimisation);
        let points = search::points_that_can_be_made(optimisation).map(|points| points.len() as u64);
        let search = points.unwrap_or(optimisation.evaluations);
        // Likely the descents find all optima.
        let has_slopes = points.is_none() && optimisation.has_slopes();
        let likely = if has_slopes { search.min(DESCENDED) } else { search };
        let slopes = if has_slopes { gradient::most_simulations(optimisation.variables.len()) } else { 0 };
        // Each point at its nominal values, and some of them in all their scenarios.
        let few = if optimisation.is_robust() { scenarios::compared(optimisation).len() as u64 } else { 0 };
        let compared = (COMPARED * (likely * few) as f64) as u64;
        Self {
            most: search * ((1 + few) * peaks + slopes) + tried.most * peaks + scanned.most * scan + around,
            search: likely * grid + (SEARCHED * (likely * (peaks - grid)) as f64) as u64 + compared * peaks,
            after: tried.about * peaks + scanned.about * scan + around,
        }
    }

    /// About all simulations.
    #[must_use]
    pub const fn about(&self) -> u64 {
        self.search + self.after
    }
}

/// Estimated computing time on one core, s, from the beginnings of some of the simulations.
///
/// # Errors
/// The refusal of a case that the values make.
pub fn estimate_s(optimisation: &Optimisation) -> Result<f64, Failure> {
    let sampling = Sampling { method: SamplingMethod::Sobol, count: TRIED + 1, seed: optimisation.seed };
    let metrics: Vec<Quantity> =
        [optimisation.objective].into_iter().chain(optimisation.constraints.iter().map(|c| c.metric)).collect();
    let (points, mut simulation_s) = (optimisation.band_points(), 0.0);
    for (place, shares) in sampling.shares(optimisation.variables.len())[1..].iter().enumerate() {
        let values = evaluate::values(optimisation, shares);
        // One of each quarter of the band.
        let at = optimisation.band_values((2 * place + 1) * points / (2 * TRIED));
        let case = BandCases::at(optimisation, &values)?.case(&at)?;
        simulation_s += simulating_s(case, optimisation.record, &metrics)? / TRIED as f64;
    }
    Ok(simulation_s * SearchSize::of(optimisation).about() as f64)
}
