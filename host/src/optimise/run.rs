//! Searches, answers, and does the same with the alternatives.

use std::sync::atomic::{AtomicU64, Ordering};

use super::answer::Answer;
use super::evaluate::Evaluated;
use super::file::Optimisation;
use super::search::{self, Found, Progress};
use super::size::Size;
use crate::input::Refusal;

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
pub type Report<'a> = &'a (dyn Fn(Reached) -> bool + Sync);

/// Simulations of an optimisation and its alternatives, about.
#[must_use]
pub fn about(optimisation: &Optimisation) -> u64 {
    Size::of(optimisation).about() + optimisation.alternatives.iter().map(about).sum::<u64>()
}

/// Optimises: what the search found, and the answer with those of the alternatives. One that was stopped is left out.
///
/// # Errors
/// The refusal of a case; a search that was stopped before its first point.
pub fn run(optimisation: &Optimisation, report: Report) -> Result<(Found, Answer), Refusal> {
    let (found, mut answer, mut simulations) = one(optimisation, (0, about(optimisation)), report)?;
    for alternative in &optimisation.alternatives {
        if answer.is_stopped {
            break;
        }
        let rest = about(alternative);
        match one(alternative, (simulations, simulations + rest), report) {
            Ok((_, of, done)) if !of.is_stopped => {
                simulations = done;
                answer.alternatives.push(of);
            }
            Err(refusal) if refusal.0 != search::STOPPED => return Err(refusal),
            Ok(_) | Err(_) => answer.is_stopped = true,
        }
    }
    Ok((found, answer))
}

/// Optimises one damper after so many simulations, of about so many in all.
fn one(
    optimisation: &Optimisation,
    (before, about): (u64, u64),
    report: Report,
) -> Result<(Found, Answer, u64), Refusal> {
    let name = optimisation.name.as_str();
    let of_search = |progress: &Progress| {
        let best = progress.best.as_ref().filter(|best| best.is_feasible());
        report(Reached { name, simulations: before + progress.simulations, about, best })
    };
    let found = search::run(optimisation, &of_search)?;
    let simulations = AtomicU64::new(before + found.simulations);
    // What the search needed is known now.
    let about = (about + found.simulations).saturating_sub(Size::of(optimisation).search);
    let go_on = |ended: u64| {
        let simulations = simulations.fetch_add(ended, Ordering::Relaxed) + ended;
        report(Reached { name, simulations, about, best: None })
    };
    let answer = Answer::of(optimisation, &found, &go_on)?;
    Ok((found, answer, simulations.into_inner()))
}
