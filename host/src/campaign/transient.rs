//! Transient experiments: playback of a record, an impulse, a free vibration from a release.
//!
//! A file is read as in `damprig simulate` ([`crate::motion_record`]) and converted to displacements at the device's sample
//! rate. An acceleration is integrated exactly (it is linear between its samples).
//! **Baseline**: a recorded acceleration integrates to a velocity and a displacement that do not end at zero, as a base must.
//! So by default a straight line c0 + c1·t is subtracted from the acceleration that brings both to zero at the end; its
//! constants are reported. A displacement's baseline is the straight line through its ends; by default it is kept.

use std::path::{Path, PathBuf};

use damprig_core::control::transient::playback::{MOST_SAMPLES, RecordId};
use damprig_core::control::transient::{self as core_transient, free_vibration};
use damprig_core::io::TICK_HZ;
use damprig_protocol::upload::checksum;

use super::RigSettings;
use super::keys::{LEAST_RATE_HZ, free_vibration as free_keys, impulse as impulse_keys, playback as playback_keys};
use super::shape::Shape;
use crate::input::{Number, Section, Span};
use crate::motion_record::{Quantity, RECORD_FILE, RECORD_SCALE, Record, read_record};

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
    /// Their file.
    pub file: Option<PathBuf>,
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

/// Counts on either side of zero.
const COUNTS: f64 = i16::MAX as f64;

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

/// Where the run folder keeps the record of the experiment at `index` of its campaign.
#[must_use]
pub fn kept_record(folder: &Path, index: usize, file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    folder.join(RECORDS).join(format!("{}-{name}", index + 1))
}

/// Reads a playback; `index` is the experiment's place in the campaign.
pub(super) fn playback(section: &Section, index: usize) -> Option<Playback> {
    let campaign = Path::new(section.source().name());
    // A run folder has a copy of the file; its campaign names the original.
    let find = |file: &str| {
        let folder = campaign.parent().unwrap_or(Path::new("")).to_path_buf();
        let kept = kept_record(&folder, index, Path::new(file));
        if kept.is_file() { kept } else { folder.join(file) }
    };
    let target = section.placed(&playback_keys::TARGET);
    let is_scaled = section.is_given(&RECORD_SCALE);
    let baseline = section.word(&playback_keys::BASELINE);
    let wanted_rate = section.placed(&playback_keys::SAMPLE_RATE);
    let ends = Ends::read(section);
    let file = section.span_of(RECORD_FILE.name());
    let record = read_record(section, &find)?;
    let ends = ends?;
    let (key, span) = match &target {
        Some(target) => ("target_peak_m", target.span.clone()),
        None if is_scaled => ("scale", section.span_of("scale")),
        None => ("file", file.clone()),
    };
    let is_linear = baseline.map_or(record.quantity == Quantity::Acceleration, |word| word == 1);
    let rate_hz = wanted_rate.as_ref().map(|n| n.value).unwrap_or((1.0 / record.step_s).min(f64::from(TICK_HZ)));
    let count = (record.duration_s() * rate_hz * (1.0 + 1e-9)).floor() + 1.0;
    if rate_hz < LEAST_RATE_HZ {
        let allowed =
            format!("has a sample each {:.3e} s; at most {} s can be played", record.step_s, 1.0 / LEAST_RATE_HZ);
        section.refuse("file", &file, allowed, Some("give `time_step_s` in seconds, or resample the record".into()));
        return None;
    }
    if count < 2.0 {
        let allowed = format!(
            "{} samples in {:.3e} s: at {rate_hz} Hz the base would have no time to move",
            record.samples.len(),
            record.duration_s()
        );
        section.refuse("file", &file, allowed, Some("give `time_step_s` in seconds".into()));
        return None;
    }
    if count > MOST_SAMPLES as f64 {
        let fits = two_digits_down((MOST_SAMPLES - 1) as f64 / record.duration_s());
        let allowed = format!(
            "gives {count:.0} samples in {:.2} s; the controller's record buffer of 40 KiB holds {MOST_SAMPLES}",
            record.duration_s()
        );
        let help = Some(format!("write sample_rate_hz = {fits}, or cut the record"));
        match &wanted_rate {
            Some(rate) => section.refuse("sample_rate_hz", &rate.span, allowed, help),
            None => section.refuse("file", &file, allowed, help),
        }
        return None;
    }
    let (mut samples_m, mut about, before_m) = displacements(&record, rate_hz, is_linear);
    refuse_noise(section, &file, &samples_m, before_m)?;
    if let Some(target) = &target {
        let peak = samples_m.iter().fold(0.0f64, |most, z| most.max(z.abs()));
        let factor = target.value / peak;
        samples_m.iter_mut().for_each(|z| *z *= factor);
        about = format!("{about}; times {factor:.4e} to the target peak");
    }
    let playback = Playback {
        kind: "playback",
        sample_rate_hz: rate_hz,
        samples_m,
        file: Some(record.file.clone()),
        about,
        ramp_s: ends.ramp_s,
        tail_s: ends.tail_s,
        rest_level_m: ends.level_m,
        key,
        span,
    };
    sound(section, &playback)?;
    Some(playback)
}

/// The keys of the ends of a record or a pulse.
struct Ends {
    ramp_s: f64,
    tail_s: f64,
    level_m: f64,
}

impl Ends {
    fn read(section: &Section) -> Option<Self> {
        // Playback and impulse have the same.
        let ramp = section.scalar(&playback_keys::RAMP);
        let tail = section.scalar(&playback_keys::TAIL);
        let level = section.scalar(&playback_keys::REST_LEVEL);
        Some(Self { ramp_s: ramp?, tail_s: tail?, level_m: level? })
    }
}

/// Peak below which a record is no motion, m: a thousandth of what a displacement sensor resolves, and of a light wave.
const LEAST_PEAK_M: f64 = 1e-9;

/// Share of the displacement before the baseline was removed below which only the rounding of its numbers is left.
const ROUNDING: f64 = 1e-9;

/// Refuses a record that is nothing but rounding: scaling would make a motion of it. `before_m` is the largest |z| before
/// the baseline was removed.
fn refuse_noise(section: &Section, file: &Span, samples_m: &[f64], before_m: f64) -> Option<()> {
    let peak_m = samples_m.iter().fold(0.0f64, |most, z| most.max(z.abs()));
    let allowed = if peak_m > 0.0 && peak_m < ROUNDING * before_m {
        format!("less its baseline, {peak_m:.1e} m of {before_m:.1e} m are left: rounding, not a motion")
    } else if peak_m > 0.0 && peak_m < LEAST_PEAK_M {
        format!("its largest displacement is {peak_m:.1e} m: rounding, not a motion; at least {LEAST_PEAK_M:e} m")
    } else {
        return Some(());
    };
    if section.source().is_recorded() {
        // The campaign in a run folder may be older than this rule.
        return Some(());
    }
    section.refuse("file", file, allowed, Some("check `unit`, `scale` and the column".into()));
    None
}

/// A record as displacements at the playback rate, how it was processed, in words, and its largest |z| before the baseline
/// was removed.
fn displacements(record: &Record, rate_hz: f64, is_linear: bool) -> (Vec<f64>, String, f64) {
    let count = (record.duration_s() * rate_hz * (1.0 + 1e-9)).floor() as usize + 1;
    let mut play = record.play();
    let (mut segment, mut interval) = (play.next_segment().0, 0_usize);
    let last = record.samples.len() - 2;
    let mut at = |t_s: f64| {
        let place = (t_s / record.step_s).min((last + 1) as f64);
        while interval < last && place >= (interval + 1) as f64 {
            segment = play.next_segment().0;
            interval += 1;
        }
        let t = place - interval as f64;
        segment[0] + t * (segment[1] + t * (segment[2] + t * segment[3]))
    };
    let mut samples: Vec<f64> = (0..count).map(|n| at(n as f64 / rate_hz)).collect();
    let before_m = samples.iter().fold(0.0f64, |most, z| most.max(z.abs()));
    let seconds = record.duration_s();
    let (quantity, line) = match record.quantity {
        Quantity::Acceleration => {
            let (v, z) = end_of(record);
            // c0 T + c1 T²/2 = v,  c0 T²/2 + c1 T³/6 = z
            let c1 = (6.0 * v * seconds - 12.0 * z) / seconds.powi(3);
            ("acceleration", [v / seconds - 0.5 * c1 * seconds, c1])
        }
        Quantity::Displacement => {
            let (first, end) = (record.samples[0], record.samples[last + 1]);
            ("displacement", [first, (end - first) / seconds])
        }
    };
    let words = format!("{quantity} of {} samples in {seconds:.4} s", record.samples.len());
    if !is_linear {
        return (samples, format!("{words}, baseline as recorded"), before_m);
    }
    for (n, z) in samples.iter_mut().enumerate() {
        let t = n as f64 / rate_hz;
        *z -= match record.quantity {
            Quantity::Acceleration => t * t * (0.5 * line[0] + t / 6.0 * line[1]),
            Quantity::Displacement => line[0] + t * line[1],
        };
    }
    let unit = if quantity == "acceleration" { "m/s²" } else { "m" };
    (samples, format!("{words}, less the line {:.3e} {unit} {:+.3e} {unit}/s·t", line[0], line[1]), before_m)
}

/// Velocity (m/s) and displacement (m) at the end of an acceleration.
fn end_of(record: &Record) -> (f64, f64) {
    let mut play = record.play();
    let mut end = [0.0; 4];
    for _ in 1..record.samples.len() {
        end = play.next_segment().0;
    }
    ((end[1] + 2.0 * end[2] + 3.0 * end[3]) / record.step_s, end.iter().sum())
}

/// Largest |z| at an end of a record that counts as rest, as a share of its peak.
const AT_REST: f64 = 0.01;

/// Refuses what the device would refuse, and ends that are not at rest.
fn sound(section: &Section, playback: &Playback) -> Option<()> {
    let peak = playback.peak_m();
    if !(peak > 0.0 && peak.is_finite()) {
        section.refuse(playback.key, &playback.span, "nothing would move", None);
        return None;
    }
    let (first, last) = (playback.samples_m[0], playback.samples_m[playback.samples_m.len() - 1]);
    if playback.ramp_s == 0.0 && first.abs().max(last.abs()) > AT_REST * peak {
        let allowed = format!(
            "begins at {:.3} mm and ends at {:.3} mm, its peak is {:.3} mm: the base would be thrown there in one sample",
            first * 1e3,
            last * 1e3,
            peak * 1e3
        );
        let help = Some("write ramp_s for a rise and a fall, or baseline = \"linear\"".into());
        section.refuse(playback.key, &playback.span, allowed, help);
        return None;
    }
    if let Err(invalid) = playback.order().validate() {
        let known = ["ramp_s", "tail_s", "rest_level_m", "sample_rate_hz"].into_iter();
        let key = known.into_iter().find(|key| *key == invalid.parameter).unwrap_or(playback.key);
        let allowed = format!("{} = {}: must be {}", invalid.parameter, invalid.value, invalid.allowed);
        section.reject(key, allowed, None);
        return None;
    }
    Some(())
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
        0 => Shape::HalfSine,
        3 => Shape::Rectangle { ramp_s: rise_of(section, rise.as_ref(), seconds)? },
        _ => Shape::Versine,
    };
    let most_hz = (MOST_SAMPLES - 1) as f64 / seconds;
    if most_hz < LEAST_RATE_HZ {
        let most_s = (MOST_SAMPLES - 1) as f64 / LEAST_RATE_HZ;
        section.refuse("duration_s", &duration.span, format!("must be greater than 0, at most {most_s}"), None);
        return None;
    }
    let rate_hz = wanted_rate.map_or(f64::from(TICK_HZ).min(most_hz), |n| n.value);
    if rate_hz > most_hz * (1.0 + 1e-9) {
        let allowed =
            format!("gives more than {MOST_SAMPLES} samples, which the controller's record buffer of 40 KiB holds");
        let help = Some(format!("write sample_rate_hz = {}", two_digits_down(most_hz)));
        section.refuse("duration_s", &duration.span, allowed, help);
        return None;
    }
    if rate_hz * seconds < FEWEST_SAMPLES {
        let allowed = format!("holds fewer than {FEWEST_SAMPLES} samples of {rate_hz} Hz");
        section.refuse(
            "duration_s",
            &duration.span,
            allowed,
            Some(format!("write {} or more", FEWEST_SAMPLES / rate_hz)),
        );
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
        file: None,
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
const FEWEST_SAMPLES: f64 = 10.0;

fn words(shape: Shape) -> &'static str {
    match shape {
        Shape::HalfSine => "half sine",
        Shape::Versine => "versine",
        Shape::Rectangle { .. } => "rectangle",
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
