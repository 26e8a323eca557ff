//! Finds the flights of a bouncing ball in a track: which way gravity points, where the ball hits the floor, and which frames are flight.
//!
//! Every part of the motion between a turn and the next has gravity's curvature, which gives the sign of the axis. The turns towards which
//! the ball falls are impacts. Between two of them is a flight; before the first and after the last one a flight grows from the impact as long
//! as frames follow, so that the hand, a catch and the rest are left out.

use std::ops::Range;

/// A flight before it is fitted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FlightCandidate {
    /// Places of the frames that it may have.
    pub(super) frames: Range<usize>,
    /// Whether it begins and ends with an impact.
    pub(super) ends: [bool; 2],
    /// Number of the drop, from 0.
    pub(super) drop: u32,
}

/// What a track shows along an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segments {
    /// Sign that turns the axis towards the floor.
    pub(super) sign: f64,
    /// Middle place of the impacts on the turned axis.
    pub(super) floor: f64,
    /// Acceleration on it, per step².
    pub(super) acceleration: f64,
    /// Noise of a place.
    pub(super) noise: f64,
    /// Flights in their order; neighbours of a drop that end and begin with an impact share it.
    pub(super) flights: Vec<FlightCandidate>,
}

/// Frames that a track needs at least.
const MIN: usize = 12;
/// Frames of a part between two turns that show a curvature.
const MIN_PART: usize = 5;
/// Standard deviations of the noise that a turn has to exceed.
const TURN: f64 = 10.0;
/// Part of the amplitudes whose curvature must have one sign.
const ONE_SIGN: f64 = 0.6;
/// Part of the height of a flight in which a hand may hold the ball.
const TOP: f64 = 0.2;
/// Ratio of an acceleration to the usual one within which a part may be a flight.
const LIKE: Range<f64> = 0.5..2.0;
/// Part of a flight's height that what a parabola leaves may have at most.
const MISFIT: f64 = 0.05;
/// Or noise that it may have.
const NOISY: f64 = 2.5;
/// Frames by which a flight grows.
const WINDOW: usize = 14;
/// Standard deviations from the frames before at which a flight ends.
const LEAVES: f64 = 5.0;

/// A parabola through points by least squares.
pub(super) struct Parabola {
    middle: f64,
    half: f64,
    coefficients: [f64; 3],
    inverse: nalgebra::Matrix3<f64>,
    /// Root mean square of what is left.
    pub(super) left: f64,
}

impl Parabola {
    /// Through at least four points.
    pub(super) fn through(at: &[f64], values: &[f64]) -> Option<Self> {
        let (first, last) = (*at.first()?, *at.last()?);
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        if at.len() < 4 || half <= 0.0 {
            return None;
        }
        let (mut normal, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
        let basis = |at: f64| {
            let s = (at - middle) / half;
            nalgebra::Vector3::new(1.0, s, s * s)
        };
        for (at, value) in at.iter().zip(values) {
            let row = basis(*at);
            normal += row * row.transpose();
            right += row * *value;
        }
        let inverse = normal.try_inverse()?;
        let fitted = inverse * right;
        let squares: f64 = at.iter().zip(values).map(|(at, value)| (value - basis(*at).dot(&fitted)).powi(2)).sum();
        let left = (squares / (at.len() as f64 - 3.0)).sqrt();
        Some(Self { middle, half, coefficients: fitted.into(), inverse, left })
    }

    /// The second derivative.
    pub(super) fn acceleration(&self) -> f64 {
        2.0 * self.coefficients[2] / self.half.powi(2)
    }

    /// Its standard uncertainty for a noise.
    fn acceleration_uncertainty(&self, noise: f64) -> f64 {
        2.0 * self.inverse[(2, 2)].sqrt() * noise / self.half.powi(2)
    }

    /// The value at a place, and its standard deviation from a reading there for unit noise.
    fn at(&self, at: f64) -> (f64, f64) {
        let s = (at - self.middle) / self.half;
        let row = nalgebra::Vector3::new(1.0, s, s * s);
        let value = row.dot(&nalgebra::Vector3::from(self.coefficients));
        (value, (1.0 + row.dot(&(self.inverse * row))).sqrt())
    }
}

/// Noise of the places: third differences have no part of a parabola. Places that are written in steps have the noise of rounding at least.
pub(super) fn noise(at: &[f64], values: &[f64]) -> f64 {
    let usual = at.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let is_even = |four: &[f64]| four.windows(2).all(|pair| pair[1] - pair[0] < 1.25 * usual);
    let third = |v: &[f64]| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).abs();
    let mut all: Vec<f64> =
        at.windows(4).zip(values.windows(4)).filter(|(at, _)| is_even(at)).map(|(_, v)| third(v)).collect();
    all.sort_by(f64::total_cmp);
    // Median of a normal magnitude: 0.6745 standard deviations; Σ of the squared weights: 20.
    let of_differences = all.get(all.len() / 2).map_or(0.0, |median| median / (0.6745 * 20f64.sqrt()));
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    let step = steps.fold(f64::INFINITY, f64::min);
    let is_rounded =
        step.is_finite() && values.iter().all(|value| (value / step - (value / step).round()).abs() < 1e-6);
    let of_rounding = if is_rounded { step / 12f64.sqrt() } else { 0.0 };
    let largest = values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    of_differences.max(of_rounding).max(1e-9 * largest)
}

/// Turns of a signal: places of maxima (`true`) and minima in turn, each a `threshold` from the next. The ends count as turns.
fn turns(values: &[f64], threshold: f64) -> Vec<(usize, bool)> {
    let mut all = Vec::new();
    let (mut low, mut high) = (0, 0);
    let mut is_rising: Option<bool> = None;
    for n in 0..values.len() {
        if values[n] > values[high] {
            high = n;
        }
        if values[n] < values[low] {
            low = n;
        }
        if is_rising != Some(false) && values[n] < values[high] - threshold {
            all.push((high, true));
            (is_rising, low) = (Some(false), n);
            high = n;
        } else if is_rising != Some(true) && values[n] > values[low] + threshold {
            all.push((low, false));
            (is_rising, high) = (Some(true), n);
            low = n;
        }
    }
    match is_rising {
        Some(true) => all.push((high, true)),
        Some(false) => all.push((low, false)),
        None => {}
    }
    all
}

/// A part between two turns.
struct FilmPart {
    amplitude: f64,
    acceleration: f64,
    is_clear: bool,
}

/// Finds the flights along an axis.
///
/// # Errors
/// Too few frames, no curvature of one sign, no impact.
pub(super) fn segments(at: &[f64], values: &[f64]) -> Result<Segments, String> {
    if at.len() < MIN {
        return Err(format!("{} tracked frames are too few; at least {MIN} are needed", at.len()));
    }
    let noise = noise(at, values);
    let turns = turns(values, TURN * noise);
    let part = |pair: &[(usize, bool)]| -> Option<FilmPart> {
        let (from, to) = (pair[0].0, pair[1].0 + 1);
        let inner = from + 1..to - 1;
        let parabola = (inner.len() >= MIN_PART).then(|| Parabola::through(&at[inner.clone()], &values[inner]))??;
        let acceleration = parabola.acceleration();
        Some(FilmPart {
            amplitude: (values[to - 1] - values[from]).abs(),
            acceleration,
            is_clear: acceleration.abs() > 3.0 * parabola.acceleration_uncertainty(noise),
        })
    };
    let parts: Vec<FilmPart> = turns.windows(2).filter_map(part).filter(|part| part.is_clear).collect();
    let all: f64 = parts.iter().map(|part| part.amplitude).sum();
    let signed: f64 = parts.iter().map(|part| part.amplitude * part.acceleration.signum()).sum();
    if all <= 0.0 || signed.abs() < ONE_SIGN * all {
        return Err("no flight was found: nothing in it falls and rises with one acceleration".into());
    }
    let sign = signed.signum();
    let down: Vec<f64> = values.iter().map(|value| sign * value).collect();
    let mut weighted: Vec<(f64, f64)> = turns
        .windows(2)
        .filter_map(|pair| below_the_top(at, &down, pair[0].0, pair[1].0))
        .filter(|(a, _)| *a > 0.0)
        .collect();
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * weighted.iter().map(|(_, amplitude)| amplitude).sum::<f64>();
    let mut sum = 0.0;
    let middle = weighted.iter().find(|(_, amplitude)| {
        sum += amplitude;
        sum >= half
    });
    let acceleration = middle.map_or(0.0, |(acceleration, _)| *acceleration);
    let is_floor = |(_, is_high): &(usize, bool)| *is_high == (sign > 0.0);
    let inner = &turns[1.min(turns.len())..turns.len().saturating_sub(1)];
    let floors: Vec<usize> = inner.iter().filter(|turn| is_floor(turn)).map(|(place, _)| *place).collect();
    if floors.is_empty() {
        return Err("no impact was found: the ball does not come back from a floor".into());
    }
    let mut places: Vec<f64> = floors.iter().map(|place| down[*place]).collect();
    places.sort_by(f64::total_cmp);
    let floor = places[places.len() / 2];
    let track = Downwards { at, down: &down, noise, acceleration };
    let flights = track.flights(&turns, &floors);
    Ok(Segments { sign, floor, acceleration, noise, flights })
}

/// Acceleration and height of a part between two turns, without its top, where a hand may hold the ball.
fn below_the_top(at: &[f64], down: &[f64], from: usize, to: usize) -> Option<(f64, f64)> {
    let height = (down[to] - down[from]).abs();
    let top = down[from].min(down[to]);
    let inner = from + 1..to;
    let below: Vec<usize> = inner.filter(|place| down[*place] > top + TOP * height).collect();
    let pick = |values: &[f64]| below.iter().map(|place| values[*place]).collect::<Vec<_>>();
    let parabola = (below.len() >= MIN_PART).then(|| Parabola::through(&pick(at), &pick(down)))??;
    Some((parabola.acceleration(), height))
}

/// A track on the axis that points to the floor.
struct Downwards<'a> {
    at: &'a [f64],
    down: &'a [f64],
    noise: f64,
    acceleration: f64,
}

impl Downwards<'_> {
    fn flights(&self, turns: &[(usize, bool)], floors: &[usize]) -> Vec<FlightCandidate> {
        let before = |place: usize| turns.iter().rev().find(|turn| turn.0 < place).map_or(0, |turn| turn.0);
        let mut flights = Vec::new();
        let mut drop = 0;
        let head = |floor: usize, limit: usize, drop: u32| {
            let top = before(floor).max(limit);
            self.grown(&(top..floor + 1).rev().collect::<Vec<_>>())
                .map(|first| FlightCandidate { frames: first..floor + 1, ends: [false, true], drop })
                .filter(|head| self.is_flight(head.frames.start, floor))
        };
        let tail = |floor: usize, limit: usize, drop: u32| {
            self.grown(&(floor..limit).collect::<Vec<_>>())
                .map(|last| FlightCandidate { frames: floor..last + 1, ends: [true, false], drop })
                .filter(|tail| self.is_flight(floor, tail.frames.end - 1))
        };
        flights.extend(head(floors[0], 0, drop));
        for pair in floors.windows(2) {
            if self.is_flight(pair[0], pair[1]) {
                flights.push(FlightCandidate { frames: pair[0]..pair[1] + 1, ends: [true, true], drop });
                continue;
            }
            // The ball was caught or lay still, and was dropped again.
            flights.extend(tail(pair[0], pair[1], drop));
            drop += 1;
            flights.extend(head(pair[1], pair[0] + 1, drop));
        }
        flights.extend(tail(floors[floors.len() - 1], self.at.len(), drop));
        flights
    }

    /// Whether one parabola of about gravity's acceleration leads from one frame to another.
    fn is_flight(&self, from: usize, to: usize) -> bool {
        let margin = 1 + (to - from) / 12;
        let inner = from + margin..(to + 1).saturating_sub(margin);
        if inner.len() < 4 {
            return true;
        }
        let Some(parabola) = Parabola::through(&self.at[inner.clone()], &self.down[inner.clone()]) else {
            return false;
        };
        let own = &self.down[inner];
        let height = self.down[from].max(self.down[to]) - own.iter().copied().fold(f64::INFINITY, f64::min);
        let unknown = 3.0 * parabola.acceleration_uncertainty(self.noise) / self.acceleration;
        let ratio = parabola.acceleration() / self.acceleration;
        ratio + unknown > LIKE.start
            && ratio - unknown < LIKE.end
            && parabola.left < (MISFIT * height).max(NOISY * self.noise)
    }

    /// The last frame of a flight that begins with an impact at the first of these frames and goes on along them. `None` for too few frames.
    fn grown(&self, frames: &[usize]) -> Option<usize> {
        let at: Vec<f64> = frames.iter().map(|place| self.at[*place] * direction(frames)).collect();
        let down: Vec<f64> = frames.iter().map(|place| self.down[*place]).collect();
        let highest = down.iter().copied().fold(f64::INFINITY, f64::min);
        // The frames at the impact may show the contact.
        let skipped = 3.min(frames.len() / 6).max(1);
        let height = down.first()? - highest;
        let is_core = |place: &f64| down[0] - place < 0.3 * height;
        let core = down.iter().take_while(|place| is_core(place)).count().max(skipped + 5);
        if core > frames.len() {
            return (frames.len() >= skipped + 3).then(|| frames[frames.len() - 1]);
        }
        let mut accepted: Vec<usize> = (skipped..core).collect();
        let mut missed = 0;
        let mut next = core;
        while next < frames.len() && missed < 2 {
            let near = &accepted[accepted.len().saturating_sub(WINDOW)..];
            let near_at: Vec<f64> = near.iter().map(|n| at[*n]).collect();
            let near_down: Vec<f64> = near.iter().map(|n| down[*n]).collect();
            let parabola = Parabola::through(&near_at, &near_down)?;
            let (expected, deviation) = parabola.at(at[next]);
            let noise = self.noise.max(parabola.left);
            let curved = parabola.acceleration() + 3.0 * parabola.acceleration_uncertainty(noise);
            if curved < LIKE.start * self.acceleration {
                missed = 2;
            } else if (down[next] - expected).abs() > LEAVES * noise * deviation {
                missed += 1;
            } else {
                missed = 0;
                accepted.push(next);
            }
            next += 1;
        }
        let end = *accepted.last()?;
        if missed < 2 {
            return Some(frames[end]);
        }
        // A hand that lets go is not seen before the ball has fallen out of the noise.
        let hidden = (2.0 * LEAVES * self.noise / self.acceleration).sqrt();
        let margin = accepted.iter().rev().take_while(|n| at[end] - at[**n] < hidden + 1e-9).count();
        let kept = accepted.len().saturating_sub(margin).max(1) - 1;
        Some(frames[accepted[kept]])
    }
}

/// +1 for frames in the order of time, −1 against it.
fn direction(frames: &[usize]) -> f64 {
    if frames.first() <= frames.last() { 1.0 } else { -1.0 }
}
