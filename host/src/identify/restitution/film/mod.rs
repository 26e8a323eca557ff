//! Impacts of a ball in a tracked film: its flights are parabolas, an impact is where two of them meet, between frames.
//!
//! e is the ratio of the speeds from and to the floor where they meet. Gravity gives the scale of the film, since every flight falls with g.

mod bounces;
mod fit;
mod floor;
mod frames;
mod met;
mod read;
mod segments;

use std::path::Path;

use super::RestitutionOptions;
use super::law::Impacts;
use crate::failure::Failure;
use bounces::Bounces;
use read::{Film, Track};
use segments::{Segments, segments};

/// An axis of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FilmAxis {
    /// x.
    X,
    /// y.
    Y,
}

/// Whether a file is a tracked film.
#[must_use]
pub(super) fn is_film(path: &Path) -> bool {
    read::is_film(path)
}

/// The impacts of a film, and what a person has to know about them.
///
/// # Errors
/// A file that is no film, a missing frame rate, no flight, several tracks or axes without a choice, a scale and a frame rate that gravity
/// contradicts, impacts that gain energy.
pub(super) fn impacts(path: &Path, options: &RestitutionOptions) -> Result<(Impacts, Vec<String>), Failure> {
    let film = Film::read(path)?;
    let refuse = |why: String| Failure::Input(format!("{}: {why}", film.file));
    check(&film, options).map_err(refuse)?;
    let track = film.track(&options.tracks)?;
    let (step_s, track) = in_steps(&film, track, options).map_err(refuse)?;
    let (axis, segments) = vertical(&track, options.vertical).map_err(refuse)?;
    let bounces = Bounces::of(&track, axis, segments).map_err(refuse)?;
    let m_per_pixel = film.metres.or(options.m_per_pixel);
    let names = FilmNames { file: &film.file, unit: if film.metres.is_some() { "m" } else { "pixel" } };
    let scale =
        FilmScale { step_s, m_per_pixel, gravity_m_per_s2: options.gravity_m_per_s2, has_times: film.has_times };
    bounces.impacts(names, &scale).map_err(refuse)
}

/// How a film is named in messages.
#[derive(Clone, Copy, Debug)]
struct FilmNames<'a> {
    file: &'a str,
    unit: &'a str,
}

/// What makes a speed of a film one in m/s.
#[derive(Clone, Copy, Debug)]
struct FilmScale {
    /// Seconds per step.
    step_s: f64,
    /// Metres per unit of the places, where stated.
    m_per_pixel: Option<f64>,
    gravity_m_per_s2: f64,
    /// Whether the file states times.
    has_times: bool,
}

/// Refuses options that do not fit the film.
fn check(film: &Film, options: &RestitutionOptions) -> Result<(), String> {
    if film.has_times && options.frame_rate_hz.is_some() {
        return Err("--frame-rate-hz is for a film with frame numbers, and this one has times\n  leave it out".into());
    }
    if !film.has_times && options.frame_rate_hz.is_none() {
        return Err("it has frame numbers and no times: the frame rate is missing\n  state the rate of the recording, not that of a \
                    slow-motion replay: --frame-rate-hz HZ"
            .into());
    }
    if film.metres.is_some() && options.m_per_pixel.is_some() {
        return Err("--m-per-pixel is for places in pixels, and this film states their unit\n  leave it out".into());
    }
    Ok(())
}

/// The track over steps of the film's clock, and seconds per step.
fn in_steps(film: &Film, mut track: Track, options: &RestitutionOptions) -> Result<(f64, Track), String> {
    if let Some(rate_hz) = options.frame_rate_hz {
        return Ok((rate_hz.recip(), track));
    }
    let mut steps: Vec<f64> = track.at.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let step_s = *steps.get(steps.len() / 2).ok_or_else(|| format!("one place is tracked in {}", film.file))?;
    track.at.iter_mut().for_each(|at| *at /= step_s);
    Ok((step_s, track))
}

/// Ratio of the accelerations along the axes from which the greater one is the vertical.
const CLEAR: f64 = 3.0;

/// The axis along which the ball falls, and its flights.
fn vertical(track: &Track, chosen: Option<FilmAxis>) -> Result<(usize, Segments), String> {
    let along = |axis: usize| -> Result<Segments, String> {
        let name = ["x", "y"][axis];
        if track.places[axis].is_empty() {
            return Err(format!("there is no column of {name}"));
        }
        let (at, values) = tracked(track, axis);
        segments(&at, &values)
    };
    if let Some(chosen) = chosen {
        let axis = usize::from(chosen == FilmAxis::Y);
        return along(axis).map(|found| (axis, found)).map_err(|why| format!("along {}: {why}", ["x", "y"][axis]));
    }
    match [along(0), along(1)] {
        [Err(_), Ok(found)] => Ok((1, found)),
        [Ok(found), Err(_)] => Ok((0, found)),
        [Ok(x), Ok(y)] if y.acceleration > CLEAR * x.acceleration => Ok((1, y)),
        [Ok(x), Ok(y)] if x.acceleration > CLEAR * y.acceleration => Ok((0, x)),
        [Ok(x), Ok(y)] => Err(format!(
            "the ball falls along x ({:.3} per step²) and along y ({:.3} per step²): which is the vertical?\n  state it: --vertical x, or \
             --vertical y",
            x.acceleration, y.acceleration
        )),
        [Err(of_x), Err(of_y)] if track.places[0].is_empty() || of_x == of_y => Err(of_y),
        [Err(of_x), Err(_)] if track.places[1].is_empty() => Err(of_x),
        [Err(of_x), Err(of_y)] => Err(format!("along x: {of_x}; along y: {of_y}")),
    }
}

/// Steps and places along an axis, without missing ones.
fn tracked(track: &Track, axis: usize) -> (Vec<f64>, Vec<f64>) {
    track
        .at
        .iter()
        .zip(&track.places[axis])
        .filter(|(_, value)| !value.is_nan())
        .map(|(at, value)| (*at, *value))
        .unzip()
}
