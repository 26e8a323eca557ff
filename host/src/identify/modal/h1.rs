//! H1 and coherence of a mode from motion and excitation over time, by Welch's method.

use std::cmp::Ordering;
use std::path::Path;

use super::quantity::Quantity;
use super::read::{named, quantity};
use super::{FrequencyResponse, Modal, ResponseLine, Wish, identify};
use crate::failure::Failure;
use crate::identify::time_response::welch::{self, Segments};
use crate::identify::time_response::{HANN_WIDTH_LINES, Motion, RESOLVED, USUAL_SEGMENTS, Wanted, needed_s};
use crate::signal_file::unit::UnitKind;
use crate::signal_file::{self, EvenSignal, Selector, Signal, SignalAxis};

/// Motion and excitation in files.
#[derive(Clone, Copy, Debug)]
pub struct Channels<'a> {
    /// The motion: `FILE#name`.
    pub file: &'a Path,
    /// The excitation (`--drive`): a signal of the same file, or `FILE#name`.
    pub drive: &'a str,
    /// Signal of the times in s (`--times-s`), if the file does not state them.
    pub times_s: Option<&'a str>,
    /// Unit of motion per excitation (`--unit`), if the file does not state both.
    pub unit: Option<&'a str>,
}

/// Motion and excitation.
#[derive(Clone, Debug)]
pub struct MotionAndExcitation {
    /// x is the motion, z the excitation, in the units of the file.
    motion: Motion,
    quantity: Quantity,
    remarks: Vec<String>,
}

/// What two channels are.
#[derive(Clone, Debug)]
pub enum ChannelPair {
    /// Displacements of structure and base, in m.
    Displacements(Motion),
    /// Another motion and its excitation.
    Other(MotionAndExcitation),
}

impl Channels<'_> {
    /// Reads the channels.
    ///
    /// # Errors
    /// A signal that is not there or not over time, signals of different times, a unit that neither file nor option states, or both.
    pub fn read(&self) -> Result<ChannelPair, Failure> {
        let selector = Selector::of(self.file);
        let contents = signal_file::read(&selector.path)?;
        let response = selector.choose(contents.clone())?;
        let drive = named("--drive", self.drive, &selector.path, &contents)?;
        let taken_from = format!("{} driven by {}", self.file.display(), self.drive);
        let refuse = |text: String| Failure::Input(format!("{taken_from}: {text}"));
        let times = self.times_s.map(|name| named("--times-s", name, &selector.path, &contents)).transpose()?;
        let [x, z] = [&response, &drive].map(|signal| evenly(signal, times.as_ref()).map_err(refuse));
        let (x, z) = (x?, z?);
        let is_same = x.values.len() == z.values.len()
            && (x.step_s / z.step_s - 1.0).abs() < 1e-6
            && (x.start_s - z.start_s).abs() < 0.01 * x.step_s;
        if !is_same {
            return Err(refuse(format!(
                "{:?} has {} samples, one each {:.6e} s from {} s on, {:?} {}, one each {:.6e} s from {} s on: motion and excitation must be sampled \
                 together",
                response.name,
                x.values.len(),
                x.step_s,
                x.start_s,
                drive.name,
                z.values.len(),
                z.step_s,
                z.start_s
            )));
        }
        let scaled = |signal: &EvenSignal, si: f64| signal.values.iter().map(|value| value * si).collect();
        if let (Some(own), Some(base), None) = (response.unit, drive.unit, self.unit)
            && own.kind == UnitKind::Displacement
            && base.kind == UnitKind::Displacement
        {
            let (x_m, z_m) = (scaled(&x, own.si), scaled(&z, base.si));
            return Ok(ChannelPair::Displacements(Motion { taken_from, step_s: x.step_s, x_m, z_m }));
        }
        let unit = match (response.unit_text.as_str(), drive.unit_text.as_str()) {
            ("", _) | (_, "") => String::new(),
            (own, other) => format!("({own})/({other})"),
        };
        let name = format!("{} per {}", response.name, drive.name);
        let quantity = quantity(&unit, self.unit, &name).map_err(refuse)?;
        let rms_error = x.rms_error.max(z.rms_error);
        let mut remarks = Vec::new();
        if rms_error > 0.0 {
            remarks.push(format!("the times are uneven: resampled by cubics at {:.1} Hz", 1.0 / x.step_s));
        }
        let motion = Motion { taken_from, step_s: x.step_s, x_m: x.values, z_m: z.values };
        Ok(ChannelPair::Other(MotionAndExcitation { motion, quantity, remarks }))
    }
}

/// A signal at even times: those of the file, or those of the signal of `--times-s`.
fn evenly(signal: &Signal, times: Option<&Signal>) -> Result<EvenSignal, String> {
    let name = &signal.name;
    if signal.imaginary.is_some() {
        return Err(format!("{name:?} is complex: motion and excitation over time are real"));
    }
    if let Some(n) = signal.values.iter().position(|value| !value.is_finite()) {
        return Err(format!("value {} of {name:?} is {}: it must be a finite number", n + 1, signal.values[n]));
    }
    let Some(times) = times else {
        return signal.evenly().map_err(|error| match signal.axis {
            SignalAxis::Unknown(_) => format!("{error}\n  name the signal that has them, in s: --times-s SIGNAL"),
            _ => error,
        });
    };
    if !matches!(signal.axis, SignalAxis::Unknown(_)) {
        return Err(format!("the file states the axis of {name:?}: leave out --times-s"));
    }
    if times.values.len() != signal.values.len() || times.imaginary.is_some() {
        let (own, of_times) = (signal.values.len(), times.values.len());
        return Err(format!("--times-s: {:?} has {of_times} values, {name:?} has {own}", times.name));
    }
    if let Some(n) = times.values.windows(2).position(|pair| pair[1].partial_cmp(&pair[0]) != Some(Ordering::Greater)) {
        return Err(format!("--times-s: time {} of {:?} is not later than the one before", n + 2, times.name));
    }
    let axis = match signal_file::even_step(&times.values) {
        Some(step_s) => SignalAxis::Time { start_s: times.values[0], step_s },
        None => SignalAxis::Times(times.values.clone()),
    };
    Signal { axis, ..signal.clone() }.evenly()
}

impl MotionAndExcitation {
    /// H1 and coherence by segments of this length and overlap.
    fn h1(&self, segment_s: f64, overlap: f64, wish: Wish) -> Result<FrequencyResponse, Failure> {
        let segments = Segments::new(&self.motion, segment_s, overlap)?;
        let spectrum = welch::spectrum(&self.motion, &segments);
        let is_within = |hz: f64| wish.from_hz.is_none_or(|from| hz >= from) && wish.to_hz.is_none_or(|to| hz <= to);
        let lines = spectrum
            .excited()
            .filter(|line| is_within(line.frequency_hz) && line.coherence > 0.0 && line.h.norm() > 0.0)
            .map(|line| ResponseLine {
                frequency_hz: line.frequency_hz,
                h: self.quantity.in_si(line.h),
                coherence: Some(line.coherence),
            })
            .collect();
        let mut remarks = self.remarks.clone();
        remarks.push(format!(
            "H1 by Welch's method: Hann's window over {:.4} s, overlap {:.0} %, {:.1} independent averages",
            segments.segment_s,
            100.0 * overlap,
            spectrum.averages
        ));
        Ok(FrequencyResponse {
            taken_from: self.motion.taken_from.clone(),
            quantity: self.quantity,
            lines,
            averages: Some(spectrum.averages),
            window_hz: Some(HANN_WIDTH_LINES / segments.segment_s),
            remarks,
        })
    }

    /// Identifies a mode from H1, by segments that resolve it where the record is long enough.
    ///
    /// # Errors
    /// A record too short for segments that resolve the resonance; as [`identify`].
    pub fn identify(&self, wanted: Wanted, wish: Wish) -> Result<(FrequencyResponse, Modal), Failure> {
        let overlap = wanted.overlap.unwrap_or(0.5);
        let length_s = self.motion.step_s * self.motion.x_m.len() as f64;
        let longest_s = length_s / USUAL_SEGMENTS;
        let of_h1 = |response: &FrequencyResponse| {
            let window_hz = response.window_hz.unwrap_or_default();
            identify(response, wish).map_err(|error| {
                Failure::Input(format!(
                    "{error}\n  the lines of H1 are {window_hz:.4} Hz wide: for a narrower resonance record longer, or give a longer --segment-s"
                ))
            })
        };
        let rough = self.h1(wanted.segment_s.unwrap_or(longest_s), overlap, wish)?;
        let found = of_h1(&rough)?;
        let (response, found) = match wanted.segment_s {
            Some(_) => (rough, found),
            None => {
                let segment_s = needed_s(found.width_hz()).max(20.0 / found.natural_frequency_hz.value).min(longest_s);
                let response = self.h1(segment_s, overlap, wish)?;
                let found = of_h1(&response)?;
                (response, found)
            }
        };
        let (width_hz, window_hz) = (found.width_hz(), response.window_hz.unwrap_or_default());
        if width_hz < RESOLVED * window_hz {
            let needed_s = needed_s(width_hz);
            return Err(Failure::Input(format!(
                "{}: H1 does not resolve the resonance at {:.4} Hz: its half-power width is at most {width_hz:.4} Hz, the width of the lines {window_hz:.4} \
                 Hz; that needs segments of {needed_s:.1} s or more, a record of {:.0} s, and there are {length_s:.1} s\n  record longer, or give a longer \
                 --segment-s",
                self.motion.taken_from,
                found.natural_frequency_hz.value,
                needed_s * USUAL_SEGMENTS
            )));
        }
        Ok((response, found))
    }
}
