//! Searches, answers, and does the same with the alternatives.

use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};

use super::answer::Optimum;
use super::evaluate::Evaluated;
use super::file::Optimisation;
use super::front::{Front, Second};
use super::search::{self, SearchOutcome, SearchProgress};
use super::size::{self, SearchSize};
use crate::failure::Failure;

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached<'a> {
    /// Name of what is optimised: the optimisation's, or that of an alternative.
    pub name: &'a str,
    /// Simulations that have ended,
    pub simulations: u64,
    /// of about so many.
    pub about: u64,
    /// The best point of the search so far.
    pub best: Option<&'a Evaluated>,
}

/// Told where a run is; answers whether to go on.
pub type ReportProgress<'a> = &'a (dyn Fn(Reached) -> bool + Sync);

/// The optimisations of a run, each with how often something of its size is done: its own, those of its front and its alternatives.
fn parts(optimisation: &Optimisation) -> Vec<(Cow<'_, Optimisation>, u64)> {
    let mut parts = vec![(Cow::Borrowed(optimisation), 1)];
    if let Some(second) = &optimisation.second {
        // The best second objective, and all points but the optimum; the limit does not change their number.
        parts.push((Cow::Owned(second.limited(optimisation, 0.0)), second.count as u64));
    }
    parts.extend(optimisation.alternatives.iter().map(|alternative| (Cow::Borrowed(alternative), 1)));
    parts
}

/// Simulations of a run, about.
#[must_use]
pub fn about(optimisation: &Optimisation) -> u64 {
    parts(optimisation).iter().map(|(part, times)| times * SearchSize::of(part).about()).sum()
}

/// The most simulations of a run.
#[must_use]
pub fn most(optimisation: &Optimisation) -> u64 {
    parts(optimisation).iter().map(|(part, times)| times * SearchSize::of(part).most).sum()
}

/// Estimated computing time of a run on one core, s, from the beginnings of some of the simulations.
///
/// # Errors
/// The refusal of a case that the values make.
pub fn estimate_s(optimisation: &Optimisation) -> Result<f64, Failure> {
    let mut estimate_s = 0.0;
    for (part, times) in parts(optimisation) {
        estimate_s += times as f64 * size::estimate_s(&part)?;
    }
    Ok(estimate_s)
}

/// Optimises: what the search found, and the answer with its front and those of the alternatives. What was stopped is left out.
///
/// # Errors
/// The refusal of a case; a search that was stopped before its first point.
pub fn run(optimisation: &Optimisation, report: ReportProgress) -> Result<(SearchOutcome, Optimum), Failure> {
    let mut work = Work { simulations: 0, left: about(optimisation), report };
    let (found, mut answer) = work.one(optimisation)?;
    if let Some(second) = optimisation.second.as_ref().filter(|_| !answer.is_stopped) {
        (answer.front, answer.is_stopped) = work.front(optimisation, second, &answer)?;
    }
    for alternative in &optimisation.alternatives {
        let of = if answer.is_stopped { None } else { work.complete(alternative)? };
        answer.is_stopped |= of.is_none();
        answer.alternatives.extend(of);
    }
    answer.simulations = work.simulations;
    Ok((found, answer))
}

/// One optimisation after the other.
struct Work<'a> {
    /// Simulations that have ended,
    simulations: u64,
    /// and about so many are left.
    left: u64,
    report: ReportProgress<'a>,
}

impl Work<'_> {
    fn one(&mut self, optimisation: &Optimisation) -> Result<(SearchOutcome, Optimum), Failure> {
        let (name, report) = (optimisation.name.as_str(), self.report);
        let (before, about) = (self.simulations, self.simulations + self.left);
        let of_search = |progress: &SearchProgress| {
            // A point of a front has another metric or limit.
            let best = progress.best.as_ref().filter(|best| best.is_feasible() && optimisation.has_surroundings);
            report(Reached { name, simulations: before + progress.simulations, about, best })
        };
        let found = search::run(optimisation, &of_search)?;
        let simulations = AtomicU64::new(before + found.simulations);
        // What the search needed is known now.
        let size = SearchSize::of(optimisation);
        let about = (about + found.simulations).saturating_sub(size.search);
        let go_on = |ended: u64| {
            let simulations = simulations.fetch_add(ended, Ordering::Relaxed) + ended;
            report(Reached { name, simulations, about, best: None })
        };
        let answer = Optimum::of(optimisation, &found, &go_on)?;
        self.simulations = simulations.into_inner();
        self.left = self.left.saturating_sub(size.about());
        Ok((found, answer))
    }

    /// The answer of a whole optimisation; `None` if it was stopped.
    fn complete(&mut self, optimisation: &Optimisation) -> Result<Option<Optimum>, Failure> {
        let answer = Failure::unless_interrupted(self.one(optimisation))?.map(|(_, answer)| answer);
        Ok(answer.filter(|answer| !answer.is_stopped))
    }

    /// The front through an optimum, and whether it was stopped; none without its other end.
    fn front(
        &mut self,
        optimisation: &Optimisation,
        second: &Second,
        optimum: &Optimum,
    ) -> Result<(Option<Front>, bool), Failure> {
        let Some(first) = second.point(optimum) else { return Ok((None, false)) };
        let Some(alone) = self.complete(&second.alone(optimisation))? else { return Ok((None, true)) };
        if !alone.is_feasible || !alone.objective.is_finite() {
            return Ok((None, false));
        }
        let (ends, mut points) = ((first.second, alone.objective), vec![first]);
        for limit in second.limits(ends) {
            let Some(answer) = self.complete(&second.limited(optimisation, limit))? else {
                return Ok((Some(second.front(optimisation, &points)), true));
            };
            points.extend(second.point(&answer));
        }
        Ok((Some(second.front(optimisation, &points)), false))
    }
}
