//! Finds the best values that a person can set: rounded to digits within their tolerances, and judged by the worst that the tolerances
//! make of them.
//!
//! An impact damper's optimum often lies on the edge of a jump. The search finds the edge; here the place is moved away from it as far as
//! the tolerances ask for.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::evaluate::{Care, Evaluated, GoOn, at_values};
use super::file::Optimisation;
use super::search::{APART, Found, PLACES, best_places};
use crate::study::band::Effort;
use crate::study::simulate::Halt;

/// Best places of the search that are moved.
const MOVED: usize = 3;

/// Steps of the first move, in tolerances; each further one has half of it, down to one tolerance.
const FIRST_STEP: f64 = 16.0;

/// Most values that are tried in moving a place.
const TRIES: usize = 60;

/// Share of the moves with which the tolerances are evaluated, about; the others are no better without them.
const WHOLE_MOVES: f64 = 0.05;

/// Places whose band is scanned, unless none of them keeps the constraints.
const SCANNED: usize = 2;

/// Number and distance of the places that are scanned if none of those keeps the constraints.
const FURTHER: (usize, f64) = (64, 0.01);

/// Places within the tolerance of each variable alone, to either side, as shares of it. The least one shows a motion that is chaotic.
const WITHIN: [f64; 3] = [1.0, 0.5, 0.01];

/// Most variables whose tolerances are combined; of more, each counts alone.
const COMBINED: usize = 4;

/// Values that can be set.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// What they give.
    pub at: Evaluated,
    /// The worst of them and of some values within their tolerances: the end, the middle and a hundredth of each variable's alone, to
    /// either side, and the corners of all together for up to four variables.
    pub worst: Evaluated,
}

/// A number of points: the most, and about how many.
pub(super) struct Points {
    pub most: u64,
    pub about: u64,
}

/// Points that [`best`] evaluates around the peaks of their grid, and with a scan.
pub(super) fn points(optimisation: &Optimisation) -> (Points, Points) {
    let variables = optimisation.variables;
    let corners = if (2..=COMBINED).contains(&variables) { 1 << variables } else { 0 };
    // A setting and what is within its tolerances.
    let setting = (1 + 2 * WITHIN.len() * variables + corners) as u64;
    let moves = (MOVED * TRIES.next_multiple_of(2 * variables)) as u64;
    let first = PLACES as u64 * setting;
    let tried =
        Points { most: first + moves * setting, about: first + (WHOLE_MOVES * (moves * setting) as f64) as u64 };
    let settings = SCANNED as u64 * setting;
    // Those that keep no constraint are scanned one after the other, then places further away and the best of these.
    let further = if optimisation.constraints.is_empty() {
        0
    } else {
        FURTHER.0 + (PLACES + MOVED + 1 - SCANNED) * setting as usize
    };
    (tried, Points { most: settings + further as u64, about: settings })
}

/// The best values that can be set, near the best places of a search.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn best(optimisation: &Optimisation, found: &Found, go_on: GoOn) -> Result<Option<Setting>, Halt> {
    let mounting = Mounting { optimisation, go_on };
    let mut settings: Vec<Setting> = Vec::new();
    for place in best_places(&found.points, optimisation.is_maximum, (PLACES, APART)) {
        settings.extend(mounting.setting(&place.values, Effort::Peaks, None)?);
    }
    mounting.sort(&mut settings);
    let moved: Vec<Setting> =
        settings.iter().take(MOVED).map(|setting| mounting.moved(setting.clone())).collect::<Result<_, Halt>>()?;
    settings.extend(moved);
    mounting.sort(&mut settings);
    settings.dedup_by(|a, b| a.at.values == b.at.values);
    let mut best: Option<Setting> = None;
    for (place, setting) in settings.iter().enumerate() {
        if let Some(best) = &best
            && ((place >= SCANNED && best.at.is_feasible()) || !mounting.is_better(setting, best))
        {
            break;
        }
        best = mounting.setting(&setting.at.values, Effort::Scan, best.as_ref())?.or(best);
    }
    if best.as_ref().is_some_and(|best| !best.at.is_feasible()) {
        // The constraints are not kept between the frequencies: other places of the search may keep them.
        let places = best_places(&found.points, optimisation.is_maximum, FURTHER);
        let scanned = |place: Evaluated| mounting.rounded(&place.values, Effort::Scan);
        let scanned: Vec<Evaluated> = places.into_par_iter().map(scanned).collect::<Result<_, Halt>>()?;
        let cheapest = scanned.iter().min_by(|a, b| mounting.cost(a).total_cmp(&mounting.cost(b)));
        if let Some(place) = cheapest {
            best = mounting.setting(&place.values, Effort::Scan, best.as_ref())?.or(best);
        }
    }
    Ok(best)
}

struct Mounting<'a> {
    optimisation: &'a Optimisation,
    go_on: GoOn<'a>,
}

impl Mounting<'_> {
    /// What these values give, rounded.
    fn rounded(&self, values: &[f64], effort: Effort) -> Result<Evaluated, Halt> {
        let rounded = |(variable, value): (usize, &f64)| rounded(self.optimisation, variable, *value);
        let values = values.iter().enumerate().map(rounded).collect();
        at_values(self.optimisation, values, Care::of(effort), self.go_on)
    }

    /// These values, rounded; `None` if they are no better than `bar` already without their tolerances.
    fn setting(&self, values: &[f64], effort: Effort, bar: Option<&Setting>) -> Result<Option<Setting>, Halt> {
        let at = self.rounded(values, effort)?;
        let alone = Setting { worst: at.clone(), at };
        if bar.is_some_and(|bar| !self.is_better(&alone, bar)) {
            return Ok(None);
        }
        let at = |values| at_values(self.optimisation, values, Care::of(effort), self.go_on);
        let others: Vec<Evaluated> =
            within(self.optimisation, &alone.at.values).into_par_iter().map(at).collect::<Result<_, Halt>>()?;
        let worse = |a: Evaluated, b: Evaluated| if self.cost(&b) > self.cost(&a) { b } else { a };
        let setting = Setting { worst: others.into_iter().fold(alone.worst, worse), at: alone.at };
        Ok(Some(setting).filter(|setting| bar.is_none_or(|bar| self.is_better(setting, bar))))
    }

    /// Moves a setting in steps along each variable as long as that makes it better.
    fn moved(&self, mut best: Setting) -> Result<Setting, Halt> {
        let (mut step, mut tries) = (FIRST_STEP, 0);
        while step >= 1.0 && tries < TRIES {
            let mut better = None;
            for variable in 0..self.optimisation.variables {
                for side in [-step, step] {
                    let mut values = best.at.values.clone();
                    let (from, to) = self.optimisation.range(variable);
                    let moved = values[variable] + side * self.optimisation.tolerance(variable, values[variable]);
                    values[variable] = moved.clamp(from, to);
                    tries += 1;
                    let bar = better.as_ref().unwrap_or(&best);
                    better = self.setting(&values, Effort::Peaks, Some(bar))?.or(better);
                }
            }
            match better {
                Some(better) => best = better,
                None => step /= 2.0,
            }
        }
        Ok(best)
    }

    fn cost(&self, point: &Evaluated) -> f64 {
        point.cost(self.optimisation.is_maximum)
    }

    /// Values that keep the constraints come first, then those whose worst point is the best.
    fn rank(&self, setting: &Setting) -> (bool, f64) {
        (!setting.at.is_feasible(), self.cost(&setting.worst))
    }

    fn is_better(&self, new: &Setting, old: &Setting) -> bool {
        self.rank(new) < self.rank(old)
    }

    fn sort(&self, settings: &mut [Setting]) {
        let order = |a: &(bool, f64), b: &(bool, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        settings.sort_by(|a, b| order(&self.rank(a), &self.rank(b)));
    }
}

/// A variable's value rounded to the power of ten at or below its tolerance, or the end of its range that rounding crosses.
#[must_use]
pub fn rounded(optimisation: &Optimisation, variable: usize, value: f64) -> f64 {
    let (from, to) = optimisation.range(variable);
    let exponent = libm::floor(libm::log10(optimisation.tolerance(variable, value)));
    // Read from its digits, so that a printed value is the evaluated one.
    let digits = format!("{:.0}e{exponent}", value / libm::pow(10.0, exponent));
    digits.parse().unwrap_or(value).clamp(from, to)
}

/// Values within the tolerances around others, and within the ranges.
fn within(optimisation: &Optimisation, values: &[f64]) -> Vec<Vec<f64>> {
    let count = optimisation.variables;
    let mut sides: Vec<Vec<f64>> = Vec::new();
    for variable in 0..count {
        for side in WITHIN.into_iter().flat_map(|share| [-share, share]) {
            let mut alone = vec![0.0; count];
            alone[variable] = side;
            sides.push(alone);
        }
    }
    if (2..=COMBINED).contains(&count) {
        let side = |corner: usize, variable: usize| if corner >> variable & 1 == 0 { -1.0 } else { 1.0 };
        sides.extend((0..1 << count).map(|corner| (0..count).map(|variable| side(corner, variable)).collect()));
    }
    let at = |sides: Vec<f64>| -> Vec<f64> {
        let end = |(variable, side): (usize, &f64)| {
            let (from, to) = optimisation.range(variable);
            (values[variable] + side * optimisation.tolerance(variable, values[variable])).clamp(from, to)
        };
        sides.iter().enumerate().map(end).collect()
    };
    let mut seen = BTreeSet::new();
    let bits = |point: &Vec<f64>| -> Vec<u64> { point.iter().map(|value| value.to_bits()).collect() };
    sides.into_iter().map(at).filter(|point| seen.insert(bits(point))).collect()
}
