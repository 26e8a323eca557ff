//! Transient experiments: playback of a record or of noise, an impulse, a free vibration from a release. `playback` reads
//! the playback.

use std::path::{Path, PathBuf};

use damprig_core::control::transient::playback::{MAX_SAMPLES, RecordId};
use damprig_core::control::transient::{self as core_transient, free_vibration};
use damprig_core::io::TICK_HZ;
use damprig_protocol::upload::checksum;

use super::RigSettings;
use super::keys::{MIN_RATE_HZ, free_vibration as free_keys, impulse as impulse_keys};
use super::playback::{Ends, sound};
use super::shape::PulseShape;
use crate::input::{Number, Section, Span};

/// Subfolder of a run folder with copies of the records of its campaign.
pub const RECORDS: &str = "records";

/// A record or a pulse that the base follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Its kind in a campaign: `playback` or `impulse`.
    pub kind: &'static str,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Displacements, m; the base rests at 0 before and after them.
    pub samples_m: Vec<f64>,
    /// Where they come from.
    pub origin: Origin,
    /// How it was processed, in words.
    pub about: String,
    /// Time over which the drive rises and falls at the ends, s.
    pub ramp_s: f64,
    /// Time measured after the end, s.
    pub tail_s: f64,
    /// |x| below which the structure counts as at rest before the beginning, m.
    pub rest_level_m: f64,
    /// The key that sets its peak, for messages.
    pub key: &'static str,
    /// The place of that key's value.
    pub span: Span,
}

/// Where the samples of a playback come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A record in a file.
    File(PathBuf),
    /// Noise from a seed.
    Noise,
    /// The shape of a pulse.
    Shape,
}

/// Counts on either side of zero.
const COUNTS: f64 = i16::MAX as f64;

/// Name under which a run folder keeps noise.
pub const NOISE_FILE: &str = "noise.csv";

impl Playback {
    /// Largest |z|, m.
    #[must_use]
    pub fn peak_m(&self) -> f64 {
        self.samples_m.iter().fold(0.0, |most, z| most.max(z.abs()))
    }

    /// Displacement of a count of the uploaded record, m: rounding to it is an error of 1/65 534 of the peak.
    #[must_use]
    pub fn scale_m(&self) -> f32 {
        (self.peak_m() / COUNTS) as f32
    }

    /// The record as it is uploaded: each sample in two bytes, little endian.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let scale = f64::from(self.scale_m());
        let count = |z: &f64| (z / scale).round().clamp(-COUNTS, COUNTS) as i16;
        self.samples_m.iter().flat_map(|z| count(z).to_le_bytes()).collect()
    }

    /// The motion as a CSV file: times (s) and displacements (m) that read back as the same numbers.
    #[must_use]
    pub fn csv(&self) -> String {
        let rows = self.samples_m.iter().enumerate().map(|(n, z)| format!("{},{z}\n", n as f64 / self.sample_rate_hz));
        format!("t_s,z_m\n{}", rows.collect::<String>())
    }

    /// The request to the device.
    #[must_use]
    pub fn order(&self) -> core_transient::Playback {
        core_transient::Playback {
            // Cannot overflow: the parser limits their number.
            record: RecordId { samples: self.samples_m.len() as u16, crc32: checksum(0, &self.bytes()) },
            sample_rate_hz: self.sample_rate_hz as f32,
            scale_m: self.scale_m(),
            ramp_s: self.ramp_s as f32,
            tail_s: self.tail_s as f32,
            rest_level_m: self.rest_level_m as f32,
            index: 0,
        }
    }
}

/// A structure that is held and released.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeVibration {
    /// Displacement at the release, m; a person pulls a real structure there, a simulated one starts there.
    pub start_m: f64,
    /// |x| beyond which it counts as held, m.
    pub level_m: f64,
    /// How long it must be held, s.
    pub hold_s: f64,
    /// How long the release may take, s.
    pub timeout_s: f64,
    /// Time measured after the release, s.
    pub measure_s: f64,
    /// Cycles over which the decay is measured.
    pub cycles: u16,
    /// The place of the start's value, for messages.
    pub span: Span,
}

impl FreeVibration {
    /// The request to the device.
    #[must_use]
    pub fn order(&self) -> core_transient::FreeVibration {
        core_transient::FreeVibration {
            level_m: self.level_m as f32,
            hold_s: self.hold_s as f32,
            timeout_s: self.timeout_s as f32,
            measure_s: self.measure_s as f32,
            cycles: self.cycles,
            index: 0,
        }
    }
}

/// Where a new run folder keeps the record of the `[[experiment]]` of this number, from 1. Its journal has the number of each copy.
#[must_use]
pub fn kept_record(folder: &Path, number: usize, file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    folder.join(RECORDS).join(format!("{number}-{name}"))
}

/// Reads an impulse.
pub(super) fn impulse(section: &Section) -> Option<Playback> {
    let shape = section.word(&impulse_keys::SHAPE);
    let amplitude = section.placed(&impulse_keys::AMPLITUDE);
    let duration = section.placed(&impulse_keys::DURATION);
    let rise = section.placed(&impulse_keys::RISE);
    let wanted_rate = section.placed(&impulse_keys::SAMPLE_RATE);
    let ends = Ends::read(section);
    let (shape, amplitude, duration, ends) = (shape?, amplitude?, duration?, ends?);
    let seconds = duration.value;
    let shape = match shape {
        0 => PulseShape::HalfSine,
        3 => PulseShape::Rectangle { ramp_s: rise_of(section, rise.as_ref(), seconds)? },
        _ => PulseShape::Versine,
    };
    let most_hz = (MAX_SAMPLES - 1) as f64 / seconds;
    if most_hz < MIN_RATE_HZ {
        let most_s = (MAX_SAMPLES - 1) as f64 / MIN_RATE_HZ;
        section.refuse("duration_s", &duration.span, format!("must be greater than 0, at most {most_s}"), None);
        return None;
    }
    let rate_hz = wanted_rate.map_or(f64::from(TICK_HZ).min(most_hz), |n| n.value);
    if rate_hz > most_hz * (1.0 + 1e-9) {
        let allowed =
            format!("gives more than {MAX_SAMPLES} samples, which the controller's record buffer of 40 KiB holds");
        let help = Some(format!("write sample_rate_hz = {}", two_digits_down(most_hz)));
        section.refuse("duration_s", &duration.span, allowed, help);
        return None;
    }
    if rate_hz * seconds < MIN_SAMPLES {
        let allowed = format!("holds fewer than {MIN_SAMPLES} samples of {rate_hz} Hz");
        section.refuse("duration_s", &duration.span, allowed, Some(format!("write {} or more", MIN_SAMPLES / rate_hz)));
        return None;
    }
    // The rate makes the pulse's length a whole number of samples, so the last one is at its end.
    let intervals = (seconds * rate_hz).floor();
    let sample_rate_hz = intervals / seconds;
    let samples_m =
        (0..=intervals as u32).map(|n| amplitude.value * shape.at(f64::from(n) / sample_rate_hz, seconds)).collect();
    let playback = Playback {
        kind: "impulse",
        sample_rate_hz,
        samples_m,
        origin: Origin::Shape,
        about: format!("{} of {} mm in {seconds} s", words(shape), amplitude.value * 1e3),
        ramp_s: ends.ramp_s,
        tail_s: ends.tail_s,
        rest_level_m: ends.level_m,
        key: "amplitude_m",
        span: amplitude.span,
    };
    sound(section, &playback)?;
    Some(playback)
}

/// Fewest samples in a pulse.
const MIN_SAMPLES: f64 = 10.0;

fn words(shape: PulseShape) -> &'static str {
    match shape {
        PulseShape::HalfSine => "half sine",
        PulseShape::Versine => "versine",
        PulseShape::Rectangle { .. } => "rectangle",
    }
}

/// Rise and fall of a rectangle; by default a tenth of its length.
fn rise_of(section: &Section, rise: Option<&Number>, duration_s: f64) -> Option<f64> {
    let Some(rise) = rise else { return Some(0.1 * duration_s) };
    if rise.value > 0.5 * duration_s {
        let allowed = format!("must be at most half of duration_s = {duration_s}");
        section.refuse("rise_s", &rise.span, allowed, None);
        return None;
    }
    Some(rise.value)
}

/// Reads a free vibration.
pub(super) fn free_vibration(section: &Section, rig: Option<&RigSettings>) -> Option<FreeVibration> {
    let start = section.placed(&free_keys::START);
    let measure_s = section.scalar(&free_keys::MEASURE);
    let level = section.placed(&free_keys::LEVEL);
    let hold_s = section.scalar(&free_keys::HOLD);
    let timeout_s = section.scalar(&free_keys::TIMEOUT);
    let cycles = section.scalar(&free_keys::CYCLES);
    let start = start?;
    let x0 = start.value.abs();
    if let Some(level) = level.as_ref().filter(|level| level.value >= x0) {
        let help = Some(format!("write level_m = {:.3e}", 0.8 * x0));
        section.refuse("level_m", &level.span, format!("must be below |start_m| = {x0}"), help);
        return None;
    }
    // A half-cycle counts above a hundredth of x0: three standard deviations of the mean over a tick's ten samples.
    if let Some(noise) = rig.map(|rig| rig.sensor_noise_rms_m).filter(|noise| x0 < 100.0 * noise) {
        let allowed = format!("must be ±{:.3e} or more: a hundred times sensor_noise_rms_m = {noise}", 100.0 * noise);
        section.refuse("start_m", &start.span, allowed, None);
        return None;
    }
    let free = FreeVibration {
        start_m: start.value,
        level_m: level.map_or(0.8 * x0, |n| n.value),
        hold_s: hold_s?,
        timeout_s: timeout_s?,
        measure_s: measure_s?,
        cycles: cycles? as u16,
        span: start.span,
    };
    if let Err(invalid) = free_vibration::FreeVibrationPlan::new(free.order()) {
        let key = ["timeout_s", "measure_s", "hold_s"].into_iter().find(|key| *key == invalid.parameter);
        section.reject(key.unwrap_or("start_m"), format!("must be {}", invalid.allowed), None);
        return None;
    }
    Some(free)
}

/// Rounds down to two significant digits.
pub(crate) fn two_digits_down(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32 - 1;
    let digits = (value / 10f64.powi(exponent) * (1.0 + 1e-12)).floor();
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}
