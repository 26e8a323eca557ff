//! The impacts between the flights of a film: where two of them meet, how fast the ball comes and leaves, and how well that is known.

use nalgebra::{DMatrix, DVector};

use super::fit::{Fit, Flight};
use super::floor::{Floor, impacts};
use super::frames::{Bounce, LONG, fitted};
use super::met::{ImpactValues, Met};
use super::read::Track;
use super::segments::Segments;
use super::{FilmNames, FilmScale, tracked};
use crate::identify::restitution::law::{Impact, Impacts};
use crate::identify::statistics::correlation;

/// A fitted film.
pub(super) struct Bounces {
    at: Vec<f64>,
    /// Towards the floor, from it.
    down: Vec<f64>,
    /// Steps and places across the vertical.
    across: (Vec<f64>, Vec<f64>),
    flights: Vec<Bounce>,
    pub(super) fit: Fit,
    /// Noise of a place, with what makes it larger in the mean of neighbours.
    variance: f64,
    /// The floor, where several impacts show it.
    pub(super) floor: Option<Floor>,
    /// Flights that are too short.
    short: usize,
    /// Whether the vertical is y, and the sign towards the floor.
    axis: (usize, f64),
    missing: usize,
}

/// Neighbours whose mean shows noise that is not white, or a misfit.
const BLOCK: usize = 5;
/// Standard uncertainties by which frames may contradict a contact time, and the least of them, in steps.
const FAR: f64 = 3.0;
const MOMENT: f64 = 0.2;
/// Speed over its standard uncertainty that an impact needs at least.
const CLEAR: f64 = 10.0;
/// Share by which stated scale, frame rate and gravity may disagree.
const DISAGREE: f64 = 0.05;

impl Bounces {
    /// Fits the flights.
    ///
    /// # Errors
    /// Too few frames of flight on both sides of every impact.
    pub(super) fn of(track: &Track, axis: usize, segments: Segments) -> Result<Self, String> {
        let (at, values) = tracked(track, axis);
        let down: Vec<f64> = values.iter().map(|value| segments.sign * value - segments.floor).collect();
        let all = segments.flights.len();
        let mut flights: Vec<Bounce> = segments.flights.into_iter().map(Bounce::of).filter(Bounce::is_long).collect();
        let short = all - flights.len();
        let few = || {
            format!(
                "its {all} flights have fewer than {LONG} frames each\n  film with a higher frame rate, or from a greater height"
            )
        };
        if flights.len() < 2 {
            return Err(few());
        }
        let fit = fitted(&at, &down, &mut flights, segments.noise).ok_or_else(few)?;
        let blocks = (fit.left.len() / BLOCK) as f64;
        // The ratio of white noise scatters by √(2/blocks).
        let inflated = correlation(&fit.left, BLOCK).filter(|ratio| *ratio > 1.0 + 3.0 * (2.0 / blocks).sqrt());
        let variance = fit.variance() * inflated.unwrap_or(1.0);
        let other = 1 - axis;
        let across = if track.places[other].is_empty() { Default::default() } else { tracked(track, other) };
        let missing = flights
            .iter()
            .map(|flight| {
                let (first, last) = (flight.used[0], flight.used[flight.used.len() - 1]);
                ((at[last] - at[first]).round() as usize).saturating_sub(last - first)
            })
            .sum();
        let touched = impacts(&at, &flights);
        // Frames that show a contact longer than the one of the floor say that the floor is not level, or the film is not.
        let seen = touched.iter().map(|(n, _)| shown_contact(&at, &flights[*n], &flights[n + 1])).fold(0.0, f64::max);
        let floor = Floor::of(&fit, touched, variance)
            .filter(|floor| floor.contact + FAR * floor.contact_uncertainty.max(MOMENT) > seen);
        Ok(Self { at, down, across, flights, fit, variance, floor, short, axis: (axis, segments.sign), missing })
    }

    /// The impacts, and what a person has to know about them.
    pub(super) fn impacts(&self, names: FilmNames, scale: &FilmScale) -> Result<(Impacts, Vec<String>), String> {
        let scale_text = self.checked_scale(names, scale)?;
        let pairs: Vec<usize> =
            (0..self.flights.len() - 1).filter(|n| self.flights[*n].touches(&self.flights[n + 1])).collect();
        let mut found: Vec<Met> = Vec::new();
        for pair in &pairs {
            let met = self.meet(*pair).ok_or_else(|| self.no_impact(*pair, scale))?;
            found.push(met);
        }
        let of_all = self.jacobian(&found, scale);
        let spread = &self.fit.covariance * self.variance;
        let mut covariance = &of_all * spread * of_all.transpose();
        let n = found.len();
        for (i, met) in found.iter().enumerate() {
            // The contact is somewhere within the frames that show it.
            let values = met.values(self, &self.fit.parameters, scale);
            let acceleration = self.acceleration(met.pair, &self.fit.parameters);
            let [before, after] =
                [acceleration * met.unknown[0] / values.before, acceleration * met.unknown[1] / values.after];
            covariance[(i, i)] += values.e.powi(2) * (before * before + after * after);
            covariance[(n + i, n + i)] += before * before;
            covariance[(i, n + i)] -= values.e * before * before;
            covariance[(n + i, i)] -= values.e * before * before;
        }
        if let Some(floor) = &self.floor {
            // How e and ln v go with the level of the floor.
            let by_level = DVector::from_iterator(
                2 * n,
                found
                    .iter()
                    .map(|met| (met, met.values(self, &self.fit.parameters, scale)))
                    .map(|(met, values)| (self.acceleration(met.pair, &self.fit.parameters), values))
                    .flat_map(|(acceleration, values)| {
                        let [before, after] = [values.before, values.after].map(|speed| acceleration / speed.powi(2));
                        [values.e * (after - before), before]
                    }),
            );
            let by_level = DVector::from_fn(2 * n, |i, _| by_level[2 * (i % n) + i / n]);
            covariance += &by_level * by_level.transpose() * floor.level_by_uneven.powi(2);
            for (i, j) in (0..2 * n).flat_map(|i| [(i, i), (i, (i + n) % (2 * n))]) {
                covariance[(i, j)] += by_level[i] * by_level[j] * floor.uneven.powi(2);
            }
        }
        let is_clear = |i: &usize| {
            let ln_v = covariance[(n + i, n + i)].sqrt();
            let e = found[*i].values(self, &self.fit.parameters, scale).e;
            CLEAR * ln_v < 1.0 && CLEAR * covariance[(*i, *i)].sqrt() < e.max(0.1)
        };
        let kept: Vec<usize> = (0..n).filter(is_clear).collect();
        if kept.is_empty() {
            return Err(
                "no impact has a speed that is known to a tenth\n  film with a higher frame rate, or nearer".into()
            );
        }
        let mut all = Vec::new();
        for i in &kept {
            all.push(self.impact(&found, *i, &covariance, names, scale)?);
        }
        let places: Vec<usize> = kept.iter().copied().chain(kept.iter().map(|i| n + i)).collect();
        let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| covariance[(places[i], places[j])]);
        let mut remarks = vec![scale_text];
        remarks.extend(self.remarks(names, &all, n - kept.len(), &found, scale));
        let impacts = Impacts {
            all,
            covariance,
            is_absolute: true,
            degrees_of_freedom: self.fit.degrees_of_freedom,
            method: "tracked film: speeds where flights meet",
        };
        Ok((impacts, remarks))
    }

    /// Metres per pixel in words; compares what is stated with gravity.
    fn checked_scale(&self, names: FilmNames, scale: &FilmScale) -> Result<String, String> {
        let (acceleration, uncertainty) = self.mean_acceleration();
        let share = uncertainty / acceleration;
        let by_gravity = scale.gravity_m_per_s2 * scale.step_s.powi(2) / acceleration;
        let unit = names.unit;
        let Some(stated) = scale.m_per_pixel else {
            return Ok(format!(
                "scale by gravity: {:.4} mm per {unit} at the floor ({:.2} % standard uncertainty)",
                by_gravity * 1e3,
                100.0 * share
            ));
        };
        let falls = acceleration * stated / scale.step_s.powi(2);
        let ratio = falls / scale.gravity_m_per_s2;
        if (ratio - 1.0).abs() > DISAGREE + 3.0 * share {
            let rate_hz = (ratio.sqrt() * scale.step_s).recip();
            let (stated_text, clock) = if unit == "m" {
                ("the places of the file".to_string(), "its times")
            } else {
                (format!("--m-per-pixel {stated}"), if scale.has_times { "its times" } else { "--frame-rate-hz" })
            };
            return Err(format!(
                "{stated_text} and {clock} do not fit together: the ball falls at {falls:.3} m/s², not at {} m/s²\n  if the scale is right, the \
                 film has {rate_hz:.1} Hz (a slow-motion replay has another rate than the recording); if the rate is right, the scale is \
                 {by_gravity:.4e} m per {unit}\n  correct what is wrong{}",
                scale.gravity_m_per_s2,
                if unit == "m" { "" } else { ", or leave --m-per-pixel out: gravity gives the scale" }
            ));
        }
        Ok(format!(
            "with the stated scale the ball falls at {falls:.3} m/s² at the floor, {:+.1} % from {} m/s²",
            100.0 * (ratio - 1.0),
            scale.gravity_m_per_s2
        ))
    }

    fn no_impact(&self, pair: usize, scale: &FilmScale) -> String {
        let at = self.at[self.flights[pair].candidates.end - 1];
        format!(
            "the flights before and after {} do not meet: something else than a floor turned the ball",
            self.moment(at, scale)
        )
    }

    /// A frame or a time, in words.
    fn moment(&self, at: f64, scale: &FilmScale) -> String {
        if scale.has_times { format!("{:.4} s", at * scale.step_s) } else { format!("frame {at:.1}") }
    }

    pub(super) fn flight(&self, n: usize, parameters: &DVector<f64>) -> Flight {
        self.fit.flight(n, parameters)
    }

    /// Acceleration at an impact, per step²: the mean of the flights beside it.
    pub(super) fn acceleration(&self, pair: usize, parameters: &DVector<f64>) -> f64 {
        0.5 * (self.flight(pair, parameters).acceleration() + self.flight(pair + 1, parameters).acceleration())
    }

    /// Mean acceleration of all flights and its standard uncertainty.
    fn mean_acceleration(&self) -> (f64, f64) {
        let parameters = &self.fit.parameters;
        let mean = |parameters: &DVector<f64>| {
            let sum: f64 = (0..self.flights.len())
                .map(|n| self.flight(n, parameters).acceleration() * self.flights[n].used.len() as f64)
                .sum();
            sum / self.fit.left.len() as f64
        };
        let by = DVector::from_fn(parameters.len(), |place, _| self.fit.slope(place, self.variance, mean));
        (mean(parameters), (by.dot(&(&self.fit.covariance * &by)) * self.variance).max(0.0).sqrt())
    }

    /// Where two flights meet.
    fn meet(&self, pair: usize) -> Option<Met> {
        let [a, b] = [&self.flights[pair], &self.flights[pair + 1]];
        let (last, first) = (*a.used.last()?, *b.used.first()?);
        let ends = [self.at[last], self.at[first]];
        let inner = [self.at[last + 1.min(first - last)], self.at[first - 1.min(first - last)]];
        let met = Met { pair, ends, inner, has_contact: first - last > 1, unknown: [0.0; 2] };
        let moments = met.moments(self, &self.fit.parameters)?;
        // A contact that frames show lies somewhere between the frames beside it.
        let half = 12f64.sqrt();
        let unknown = if met.has_contact && self.floor.is_none() {
            let [before, after] = met.contact(moments.1);
            [(before[1] - before[0]) / half, (after[1] - after[0]) / half]
        } else {
            [0.0; 2]
        };
        Some(Met { unknown, ..met })
    }

    /// Derivatives of all e, then of all ln v, by the parameters.
    fn jacobian(&self, found: &[Met], scale: &FilmScale) -> DMatrix<f64> {
        let (n, count) = (found.len(), self.fit.parameters.len());
        let mut all = DMatrix::zeros(2 * n, count);
        for (i, met) in found.iter().enumerate() {
            // The level of the floor follows from all flights.
            let places: Vec<usize> =
                if self.floor.is_some() { (0..count).collect() } else { self.fit.places(met.pair).collect() };
            for place in places {
                let slope = |of: &dyn Fn(&ImpactValues) -> f64| {
                    self.fit.slope(place, self.variance, |moved| of(&met.values(self, moved, scale)))
                };
                all[(i, place)] = slope(&|values| values.e);
                all[(n + i, place)] = slope(&|values| values.speed.ln());
            }
        }
        all
    }

    fn impact(
        &self,
        found: &[Met],
        i: usize,
        covariance: &DMatrix<f64>,
        names: FilmNames,
        scale: &FilmScale,
    ) -> Result<Impact, String> {
        let (met, n) = (&found[i], found.len());
        let parameters = &self.fit.parameters;
        let values = met.values(self, parameters, scale);
        let [e_u, ln_u] = [covariance[(i, i)], covariance[(n + i, n + i)]].map(f64::sqrt);
        if values.e > 1.0 + 3.0 * e_u || values.e <= 0.0 {
            return Err(format!(
                "impact at {}: the ball leaves {:.3} times as fast as it comes ({:.3} with the uncertainty): it gains energy there\n  is it a \
                 hand, a moving floor, a film that runs backwards, or a wrong --vertical? Cut the film before it",
                self.moment(values.at, scale),
                values.e,
                e_u
            ));
        }
        let drop = self.flights[met.pair].drop;
        let number = found[..i].iter().filter(|other| self.flights[other.pair].drop == drop).count() as u32 + 1;
        // Two flights between impacts: the one before and the one after.
        let before = i.checked_sub(1).map(|n| &found[n]).filter(|other| other.pair + 1 == met.pair);
        let after = found.get(i + 1).filter(|other| other.pair == met.pair + 1);
        let by_times = before.zip(after).map(|(before, after)| {
            let ends = |met: &Met| met.values(self, parameters, scale).ends;
            (ends(after)[0] - values.ends[1]) / (values.ends[0] - ends(before)[1])
        });
        let [height_before, height_after] = [0, 1].map(|side| self.height(met.pair + side, &values, side));
        Ok(Impact {
            source: names.file.into(),
            drop: drop + 1,
            number,
            time_s: Some(values.at * scale.step_s),
            speed_m_per_s: values.speed,
            speed_standard_uncertainty_m_per_s: ln_u * values.speed,
            coefficient: values.e,
            coefficient_standard_uncertainty: e_u,
            coefficient_by_times: by_times,
            coefficient_by_heights: height_before.zip(height_after).map(|(before, after)| (after / before).sqrt()),
            sideways_m_per_s: self.sideways(met.pair, scale),
        })
    }

    /// Height of a flight above an impact by its highest reading, where the film shows its top.
    fn height(&self, flight: usize, impact: &ImpactValues, side: usize) -> Option<f64> {
        let own = &self.flights[flight];
        let motion = self.flight(flight, &self.fit.parameters);
        let highest = own.used.iter().copied().min_by(|a, b| self.down[*a].total_cmp(&self.down[*b]))?;
        let (first, last) = (own.used[0], own.used[own.used.len() - 1]);
        let is_inside = highest > first && highest < last;
        // A release from rest: the flight begins at its top.
        let speed = motion.velocity(self.at[highest]).abs();
        (is_inside || speed < 0.1 * impact.before)
            .then(|| motion.height(impact.ends[side]) - motion.of_film(self.down[highest]))
            .filter(|height| *height > 0.0)
    }

    /// Speeds across the vertical before and after an impact, m/s.
    fn sideways(&self, pair: usize, scale: &FilmScale) -> Option<[f64; 2]> {
        let slope = |flight: usize| {
            let own = &self.flights[flight].used;
            let within = self.at[own[0]]..=self.at[own[own.len() - 1]];
            let (at, places): (Vec<f64>, Vec<f64>) = self
                .across
                .0
                .iter()
                .zip(&self.across.1)
                .filter(|(at, _)| within.contains(*at))
                .map(|(a, b)| (*a, *b))
                .unzip();
            crate::identify::statistics::line(&at, &places, |_| 1.0).map(|line| line.slope.value)
        };
        let per_step = scale.per_step(self.acceleration(pair, &self.fit.parameters));
        Some([slope(pair)? * per_step, slope(pair + 1)? * per_step])
    }

    fn remarks(
        &self,
        names: FilmNames,
        all: &[Impact],
        unclear: usize,
        found: &[Met],
        scale: &FilmScale,
    ) -> Vec<String> {
        let unit = names.unit;
        let parameters = &self.fit.parameters;
        let mut remarks = vec![format!(
            "{} flights with {} frames; the fit leaves {:.3} {unit} RMS; the vertical is {}, which grows {}",
            self.flights.len(),
            self.fit.left.len(),
            (self.fit.squares() / self.fit.left.len() as f64).sqrt(),
            ["x", "y"][self.axis.0],
            if self.axis.1 > 0.0 { "downwards" } else { "upwards" }
        )];
        if self.fit.shape.perspective {
            let perspective = self.fit.perspective(parameters);
            remarks.push(format!(
                "the scale changes along the vertical, by {:.1} % per 100 {unit}s at the floor: perspective, fitted",
                2e4 * perspective.abs()
            ));
        }
        if self.fit.shape.accelerations {
            remarks.push(
                "each flight has an acceleration of its own: the ball comes nearer or goes away, and the scale with it"
                    .into(),
            );
        }
        if self.fit.shape.cubic {
            remarks.push("the acceleration changes within the flights: the ball moves towards or from the camera, or the air brakes it; fitted as a \
                          line over time".into());
        }
        if self.missing > 0 {
            remarks.push(format!("{} frames are missing or left out within the flights", self.missing));
        }
        if self.short > 0 {
            remarks.push(format!("{} flights with fewer than {LONG} frames are left out", self.short));
        }
        if unclear > 0 {
            remarks.push(format!("{unclear} impacts whose speeds are not known to a tenth are left out"));
        }
        let contacts: Vec<f64> =
            found.iter().filter(|met| met.has_contact).map(|met| met.ends[1] - met.ends[0]).collect();
        let ms = scale.step_s * 1e3;
        if let Some(floor) = &self.floor {
            let (contact, uncertainty) = (floor.contact * ms, floor.contact_uncertainty * ms);
            remarks.push(format!(
                "mean contact time {contact:.2} ms ({uncertainty:.2} ms standard uncertainty), from the depths at which the flights meet: e is that of the \
                 speeds at the floor"
            ));
            if floor.uneven > 0.0 {
                remarks.push(format!(
                    "the level of the floor differs by {:.2} {unit}s from impact to impact beyond the noise; the intervals include it",
                    floor.uneven
                ));
            }
        } else if contacts.is_empty() {
            remarks.push(format!(
                "the contact time is not known from one impact, or from impacts that are all alike: e is that of a contact much shorter than {ms:.1} ms"
            ));
        } else {
            let longest = contacts.iter().copied().fold(0.0, f64::max);
            remarks.push(format!(
                "{} of {} impacts show contact in frames of their own (at most {:.2} ms): when it begins and ends is known to a frame, which is part \
                 of the uncertainty",
                contacts.len(),
                found.len(),
                longest * ms
            ));
        }
        let fastest = all
            .iter()
            .flat_map(|impact| impact.sideways_m_per_s.iter().flatten())
            .fold(0.0f64, |most, v| most.max(v.abs()));
        if fastest > 0.0 {
            let angle = |impact: &Impact| {
                impact
                    .sideways_m_per_s
                    .map_or(0.0, |[before, _]| (before / impact.speed_m_per_s).atan().to_degrees().abs())
            };
            let steepest = all.iter().map(angle).fold(0.0, f64::max);
            remarks.push(format!(
                "the ball moves sideways at up to {fastest:.3} m/s in the film's plane, {steepest:.1}° from the vertical at impact; e is that of the vertical"
            ));
        }
        remarks
    }
}

/// Time between the first and the last frame that belong to neither of two flights, in steps.
fn shown_contact(at: &[f64], before: &Bounce, after: &Bounce) -> f64 {
    let (Some(last), Some(first)) = (before.used.last(), after.used.first()) else { return 0.0 };
    if *first > last + 2 { at[first - 1] - at[last + 1] } else { 0.0 }
}

impl FilmScale {
    /// m/s per place and step.
    pub(super) fn per_step(&self, acceleration: f64) -> f64 {
        match self.m_per_pixel {
            Some(m) => m / self.step_s,
            None => self.gravity_m_per_s2 * self.step_s / acceleration,
        }
    }
}
