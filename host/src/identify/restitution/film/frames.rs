//! Which frames belong to the flights of a film: those that one fit of all flights describes.
//!
//! Frames away from contacts and hands are fitted first, with what the camera does; then frames beside them are taken as long as they fit.

use super::fit::{FilmShape, Fit, Flight, FlightFrames};
use super::floor::{Floor, crossing, impacts};
use super::segments::FlightCandidate;
use crate::identify::lack_of_fit::most_chi_square;

/// Robust standard deviations of a frame from the fit that end a flight.
const OUTSIDE: f64 = 4.5;
/// Rounds in which frames are taken and left at most.
const ROUNDS: usize = 40;
/// Frames that a flight needs at least: with the frames at its impacts, so that a turn is seen; and to fit it.
pub(super) const LONG: usize = 9;
const MIN: usize = 5;

/// A flight and its frames.
#[derive(Clone, Debug)]
pub(super) struct Bounce {
    /// Places of the frames in the track.
    pub(super) used: Vec<usize>,
    /// Frames that may belong to it.
    pub(super) candidates: std::ops::Range<usize>,
    pub(super) ends: [bool; 2],
    pub(super) drop: u32,
}

impl Bounce {
    /// With the frames that surely belong to the flight: those away from a contact and from the hand.
    pub(super) fn of(flight: FlightCandidate) -> Self {
        let FlightCandidate { frames, ends, drop } = flight;
        let margin = |is_impact: bool| if is_impact { 1 + frames.len() / 10 } else { frames.len() / 4 };
        let [first, last] = ends.map(margin);
        let from = frames.start + first;
        let used = from..frames.end.saturating_sub(last).max(from);
        Self { used: used.collect(), candidates: frames, ends, drop }
    }

    /// Whether an impact is between this flight and the next one.
    pub(super) fn touches(&self, next: &Self) -> bool {
        self.drop == next.drop && self.ends[1] && next.ends[0] && self.candidates.end == next.candidates.start + 1
    }

    pub(super) fn is_long(&self) -> bool {
        self.candidates.len() >= LONG && self.used.len() >= MIN
    }
}

/// Where two flights meet, near a step, by Newton's method.
pub(super) fn meeting(before: &Flight, after: &Flight, near: f64) -> f64 {
    let mut at = near;
    for _ in 0..20 {
        let step = (after.height(at) - before.height(at)) / (before.velocity(at) - after.velocity(at));
        at += step;
        if step.abs() < 1e-12 {
            break;
        }
    }
    at
}

fn frames(at: &[f64], down: &[f64], flights: &[Bounce]) -> Vec<FlightFrames> {
    let pick = |values: &[f64], used: &[usize]| used.iter().map(|place| values[*place]).collect();
    flights.iter().map(|flight| FlightFrames { at: pick(at, &flight.used), down: pick(down, &flight.used) }).collect()
}

/// Standard deviation of what is left, from its median: what does not belong to the flights does not widen it.
fn deviation(fit: &Fit, noise: f64) -> f64 {
    let mut sizes: Vec<f64> = fit.left.iter().map(|left| left.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let freedom = (fit.left.len() as f64 / fit.degrees_of_freedom).sqrt();
    (sizes[sizes.len() / 2] / 0.6745 * freedom).max(0.5 * noise)
}

/// Fits the frames that surely belong to the flights, then takes those beside them that fit.
pub(super) fn fitted(at: &[f64], down: &[f64], flights: &mut [Bounce], noise: f64) -> Option<Fit> {
    let mut fit = shaped(at, down, flights)?;
    for _ in 0..ROUNDS {
        let limit = OUTSIDE * deviation(&fit, noise);
        let mut has_changed = false;
        for (n, flight) in flights.iter_mut().enumerate() {
            let own = fit.flight(n, &fit.parameters);
            let fits = |place: &usize| own.left(at[*place], down[*place]).abs() <= limit;
            let kept: Vec<usize> = flight.used.iter().copied().filter(fits).collect();
            if kept.len() >= MIN && kept.len() < flight.used.len() {
                flight.used = kept;
                has_changed = true;
            }
        }
        if !has_changed {
            break;
        }
        fit = shaped(at, down, flights)?;
    }
    fit = settle(at, down, flights, fit, noise)?;
    // More frames may show what fewer did not.
    let again = shaped(at, down, flights)?;
    if again.shape != fit.shape {
        fit = settle(at, down, flights, again, noise)?;
    }
    let acceleration = fit.flight(0, &fit.parameters).acceleration();
    let hidden = (2.0 * OUTSIDE * deviation(&fit, noise) / acceleration).sqrt();
    for flight in flights.iter_mut() {
        flight.cut(at, hidden);
    }
    Fit::of(&frames(at, down, flights), fit.shape)
}

impl Bounce {
    /// Leaves out the frames at the ends without an impact in which a hand that lets go or catches would be hidden by the noise.
    fn cut(&mut self, at: &[f64], hidden: f64) {
        let (first, last) = (at[self.used[0]], at[self.used[self.used.len() - 1]]);
        let from = if self.ends[0] || self.candidates.start == 0 { first } else { first + hidden };
        let to = if self.ends[1] || self.candidates.end == at.len() { last } else { last - hidden };
        let kept: Vec<usize> = self.used.iter().copied().filter(|place| (from..=to).contains(&at[*place])).collect();
        if kept.len() >= MIN {
            self.used = kept;
        }
    }
}

/// Takes the frames that fit and leaves the others, until that changes nothing.
fn settle(at: &[f64], down: &[f64], flights: &mut [Bounce], mut fit: Fit, noise: f64) -> Option<Fit> {
    for _ in 0..ROUNDS {
        let limit = OUTSIDE * deviation(&fit, noise);
        let mut has_changed = false;
        // A frame that both flights fit belongs to the one on whose side of the impact it is; one below the floor to none.
        let touched = impacts(at, flights);
        let floor = Floor::of(&fit, touched.clone(), fit.variance()).map(|floor| floor.level(&fit, &fit.parameters));
        let mut limits = vec![[f64::NEG_INFINITY, f64::INFINITY]; flights.len()];
        for (n, near) in touched {
            let [before, after] = [n, n + 1].map(|n| fit.flight(n, &fit.parameters));
            let met = meeting(&before, &after, near);
            let ends = floor.map_or([met; 2], |level| [crossing(&before, level, met), crossing(&after, level, met)]);
            if (met - near).abs() < 3.0 && ends.iter().all(|end| end.is_finite()) {
                limits[n][1] = ends[0].min(met);
                limits[n + 1][0] = ends[1].max(met);
            }
        }
        for (n, flight) in flights.iter_mut().enumerate() {
            let own = fit.flight(n, &fit.parameters);
            let [from, to] = limits[n];
            let fits =
                |place: &usize| own.left(at[*place], down[*place]).abs() <= limit && (from..=to).contains(&at[*place]);
            let kept = fitting(flight, fits);
            if kept.len() >= MIN && kept != flight.used {
                flight.used = kept;
                has_changed = true;
            }
        }
        if !has_changed {
            break;
        }
        fit = Fit::of(&frames(at, down, flights), fit.shape)?;
    }
    Some(fit)
}

/// The frames of a flight that fit, from its middle to the first two in a row that do not.
fn fitting(flight: &Bounce, fits: impl Fn(&usize) -> bool) -> Vec<usize> {
    let middle = flight.used[flight.used.len() / 2];
    let along = |places: &mut dyn Iterator<Item = usize>| {
        let (mut kept, mut missed) = (Vec::new(), 0);
        for place in places {
            if fits(&place) {
                missed = 0;
                kept.push(place);
            } else {
                missed += 1;
                if missed == 2 {
                    break;
                }
            }
        }
        kept
    };
    let mut all = along(&mut (flight.candidates.start..middle).rev());
    all.reverse();
    all.extend(along(&mut (middle..flight.candidates.end)));
    all
}

/// The fit with perspective and cubics, where they explain what is no noise.
fn shaped(at: &[f64], down: &[f64], flights: &[Bounce]) -> Option<Fit> {
    let frames = frames(at, down, flights);
    let mut best = Fit::of(&frames, FilmShape::default())?;
    // Each may show only beside the others: from the simplest to all.
    for n in 1..8 {
        let shape = FilmShape { perspective: n & 1 > 0, cubic: n & 2 > 0, accelerations: n & 4 > 0 };
        let Some(fit) = Fit::of(&frames, shape) else { continue };
        let explained = (best.squares() - fit.squares()) / fit.variance();
        let more = best.degrees_of_freedom - fit.degrees_of_freedom;
        if more > 0.0 && explained > most_chi_square(more as usize, fit.degrees_of_freedom) {
            best = fit;
        }
    }
    Some(best)
}
