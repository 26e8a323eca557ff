//! Finds the best values that can be made, judged by what tolerances and uncertain values make of them.
//!
//! An impact damper's optimum often lies on the edge of a jump. The search finds the edge; here the place is moved away from it as far as
//! the tolerances ask for.

use rayon::prelude::*;

use super::evaluate::{Care, Evaluated, GoOnAfter, at_values, with_scenarios};
use super::file::Optimisation;
use super::scenarios::{self, Scenario};
use super::search::{self, APART, PLACES, SearchOutcome, SearchStage, best_places};
use super::variable::Variable;
use super::verify::{self, Verification};
use crate::failure::Failure;
use crate::study::band::{Effort, Smoothness};
use crate::study::over::Over;

/// Best places of the search that are moved.
const MOVED: usize = 3;

/// Steps of the first move, in tolerances; each further one has half of it, down to one tolerance.
const FIRST_STEP: f64 = 16.0;

/// Most values that are tried in moving a place.
const TRIES: usize = 60;

/// Share of the moves with which the tolerances are evaluated, about; the others are no better without them.
const WHOLE_MOVES: f64 = 0.05;

/// Places whose band is scanned, unless none of them keeps the constraints; without jumps the worst scenarios whose band is.
const SCANNED: usize = 2;

/// Number and distance of the places that are scanned if none of those keeps the constraints.
const FURTHER: (usize, f64) = (64, 0.01);

/// Values that can be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// What they give at their nominal values.
    pub at: Evaluated,
    /// The worst of that and of scenarios within tolerances that no file states; or what the scenarios give together over which the
    /// objective counts.
    pub over: Evaluated,
}

/// A number of points: the most, and about how many.
pub(super) struct PointCounts {
    pub most: u64,
    pub about: u64,
}

/// Points that [`best`] evaluates around the peaks of their grid, and with a scan.
pub(super) fn points(optimisation: &Optimisation) -> (PointCounts, PointCounts) {
    let variables = optimisation.variables.len();
    if optimisation.is_robust() {
        let is_made = search::points_that_can_be_made(optimisation).is_some();
        let compared = if is_made { 0 } else { MOVED * TRIES.next_multiple_of(2 * variables.max(1)) + PLACES };
        let compared = compared as u64 * scenarios::compared(optimisation).len() as u64;
        let (verified, scanned) = verify::points(optimisation);
        let most = compared + verified.most;
        let about = (WHOLE_MOVES * compared as f64) as u64 + verified.about;
        return (PointCounts { most, about }, PointCounts { most: scanned.most + 1, about: scanned.about + 1 });
    }
    // A setting and its scenarios.
    let setting = 1 + scenarios::compared(optimisation).len() as u64;
    let moves = (MOVED * TRIES.next_multiple_of(2 * variables.max(1))) as u64;
    let first = PLACES as u64 * setting;
    let tried =
        PointCounts { most: first + moves * setting, about: first + (WHOLE_MOVES * (moves * setting) as f64) as u64 };
    let settings = SCANNED as u64 * setting;
    // Those that keep no constraint are scanned one after the other, then places further away and the best of these.
    let further = if optimisation.constraints.is_empty() {
        0
    } else {
        FURTHER.0 + (PLACES + MOVED + 1 - SCANNED) * setting as usize
    };
    (tried, PointCounts { most: settings + further as u64, about: settings })
}

/// The best values that can be made, near the best places of a search.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn best(optimisation: &Optimisation, found: &SearchOutcome, go_on: GoOnAfter) -> Result<Option<Setting>, Failure> {
    let mounting = Mounting { optimisation, scenarios: scenarios::compared(optimisation), go_on };
    if optimisation.is_robust() {
        return mounting.verified_best(found);
    }
    let mut settings: Vec<Setting> = Vec::new();
    for place in best_places(&found.points, optimisation.is_maximum, (places(found), APART)) {
        settings.extend(mounting.setting(&place.values, Effort::Peaks, None)?);
    }
    mounting.sort(&mut settings);
    let moved: Vec<Setting> =
        settings.iter().take(MOVED).map(|setting| mounting.moved(setting.clone())).collect::<Result<_, Failure>>()?;
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
        let scanned = |place: Evaluated| mounting.made(&place.values, Effort::Scan);
        let scanned: Vec<Evaluated> = places.into_par_iter().map(scanned).collect::<Result<_, Failure>>()?;
        let cheapest = scanned.iter().min_by(|a, b| mounting.cost(a).total_cmp(&mounting.cost(b)));
        if let Some(place) = cheapest {
            best = mounting.setting(&place.values, Effort::Scan, best.as_ref())?.or(best);
        }
    }
    Ok(best)
}

/// Places of a search that are made: its best one alone if it has no others, likely.
const fn places(found: &SearchOutcome) -> usize {
    if found.is_complete { 1 } else { PLACES }
}

struct Mounting<'a> {
    optimisation: &'a Optimisation,
    /// Those by which settings are compared.
    scenarios: Vec<Scenario>,
    go_on: GoOnAfter<'a>,
}

impl Mounting<'_> {
    /// What the nearest values that can be made give.
    fn made(&self, values: &[f64], effort: Effort) -> Result<Evaluated, Failure> {
        let made = |(variable, value): (&Variable, &f64)| variable.made(*value);
        let made: Vec<f64> = self.optimisation.variables.iter().zip(values).map(made).collect();
        let values = scenarios::values(self.optimisation, &made, &scenarios::nominal(self.optimisation));
        at_values(self.optimisation, values, Care::of(effort), self.go_on)
    }

    /// The nearest values that can be made; `None` if they are no better than `bar` already at their nominal values.
    fn setting(&self, values: &[f64], effort: Effort, bar: Option<&Setting>) -> Result<Option<Setting>, Failure> {
        let at = self.made(values, effort)?;
        let alone = Setting { over: at.clone(), at };
        let is_worst = self.optimisation.over == Over::Worst || !self.optimisation.is_robust();
        if is_worst && bar.is_some_and(|bar| !self.is_better(&alone, bar)) {
            return Ok(None);
        }
        let at = |values: &Vec<f64>, effort: Effort| {
            at_values(self.optimisation, values.clone(), Care::of(effort), self.go_on)
        };
        let all = |values: &[Vec<f64>], effort: Effort| -> Result<Vec<Evaluated>, Failure> {
            values.par_iter().map(|values| at(values, effort)).collect()
        };
        let values = |scenario: &Scenario| scenarios::values(self.optimisation, &alone.at.values, scenario);
        let values: Vec<Vec<f64>> = self.scenarios.iter().map(values).collect();
        let others = if effort == Effort::Scan && self.optimisation.reduced_band.smoothness > Smoothness::Jumps {
            // A scan changes little here, so that the worst stays among the worst.
            let mut others = all(&values, Effort::Peaks)?;
            others.sort_by(|a, b| self.cost(b).total_cmp(&self.cost(a)));
            let worst = others.iter().take(SCANNED).map(|other| other.values.clone());
            let scanned = all(&worst.collect::<Vec<_>>(), effort)?;
            others.splice(..scanned.len(), scanned);
            others
        } else {
            all(&values, effort)?
        };
        let over = if self.optimisation.is_robust() {
            with_scenarios(self.optimisation, &alone.at, &others.iter().collect::<Vec<_>>())
        } else {
            let worse = |a: Evaluated, b: Evaluated| if self.cost(&b) > self.cost(&a) { b } else { a };
            others.into_iter().fold(alone.over, worse)
        };
        let setting = Setting { over, at: alone.at };
        Ok(Some(setting).filter(|setting| bar.is_none_or(|bar| self.is_better(setting, bar))))
    }

    /// The best of the values that can be made, with the objective over many more scenarios than the search had.
    fn verified_best(&self, found: &SearchOutcome) -> Result<Option<Setting>, Failure> {
        let is_made = found.points.first().is_some_and(|(stage, _)| *stage == SearchStage::All);
        let mut places: Vec<Evaluated> = if is_made {
            found.points.iter().map(|(_, point)| point.clone()).collect()
        } else {
            let mut settings: Vec<Setting> = Vec::new();
            for place in best_places(&found.points, self.optimisation.is_maximum, (places(found), APART)) {
                settings.extend(self.setting(&place.values, Effort::Peaks, None)?);
            }
            self.sort(&mut settings);
            for setting in settings.clone().into_iter().take(MOVED) {
                settings.push(self.moved(setting)?);
            }
            settings.into_iter().map(|setting| setting.over).collect()
        };
        places.sort_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        places.dedup_by(|a, b| a.values == b.values);
        let Some(over) = Verification::of(self.optimisation, self.go_on).best(&places)? else { return Ok(None) };
        let at = at_values(self.optimisation, over.values.clone(), Care::of(Effort::Scan), self.go_on)?;
        Ok(Some(Setting { at, over }))
    }

    /// Moves a setting in steps along each variable as long as that makes it better.
    fn moved(&self, mut best: Setting) -> Result<Setting, Failure> {
        let (mut step, mut tries) = (FIRST_STEP, 0);
        while step >= 1.0 && tries < TRIES {
            let mut better = None;
            for (place, variable) in self.optimisation.variables.iter().enumerate() {
                for side in [-step, step] {
                    let mut values = best.at.values.clone();
                    let moved = values[place] + side * variable.tolerance(values[place]);
                    values[place] = moved.clamp(variable.range.0, variable.range.1);
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
        (!setting.at.is_feasible(), self.cost(&setting.over))
    }

    fn is_better(&self, new: &Setting, old: &Setting) -> bool {
        self.rank(new) < self.rank(old)
    }

    fn sort(&self, settings: &mut [Setting]) {
        let order = |a: &(bool, f64), b: &(bool, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        settings.sort_by(|a, b| order(&self.rank(a), &self.rank(b)));
    }
}
