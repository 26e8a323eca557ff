//! Reads the playback of a record or of noise.
//!
//! A file is read as in `damprig simulate` ([`crate::motion_record`]) and converted to displacements at the device's sample
//! rate. An acceleration is integrated exactly (it is linear between its samples).
//! **Baseline**: a recorded acceleration integrates to a velocity and a displacement that do not end at zero, as a base must.
//! So by default a straight line c0 + c1·t is subtracted from the acceleration that brings both to zero at the end; its
//! constants are reported. A displacement's baseline is the straight line through its ends; by default it is kept.
//! **Noise** is made at the sample rate of the playback.

use std::path::Path;

use damprig_core::control::transient::playback::MAX_SAMPLES;
use damprig_core::io::TICK_HZ;

use super::keys::{MIN_RATE_HZ, playback as playback_keys};
use super::transient::{Origin, Playback, kept_record, two_digits_down};
use crate::input::{Number, Section, Span};
use crate::motion_record::{GivenMotion, Noise, RECORD_FILE, RECORD_SCALE, Record, RecordQuantity, read_motion};

/// Reads a playback; `number` is that of its `[[experiment]]`, from 1.
pub(super) fn read(section: &Section, number: usize) -> Option<Playback> {
    let folder = Path::new(section.source().name()).parent().unwrap_or(Path::new(""));
    // The campaign of a run folder names the originals.
    let find = |file: &str| match section.source().copies() {
        Some(copies) => {
            let copy = copies.records.get(&number).cloned();
            copy.unwrap_or_else(|| kept_record(folder, number, Path::new(file)))
        }
        None => folder.join(file),
    };
    let target = section.placed(&playback_keys::TARGET);
    let baseline = section.word(&playback_keys::BASELINE);
    let wanted_rate = section.placed(&playback_keys::SAMPLE_RATE);
    let ends = Ends::read(section);
    let motion = read_motion(section, &find)?;
    match motion {
        GivenMotion::Recorded(record) => recorded(section, record, target, baseline, wanted_rate, ends?),
        GivenMotion::Noise(noise) => generated(section, &noise, &target?, wanted_rate, ends?),
    }
}

/// The playback of noise.
fn generated(
    section: &Section,
    noise: &Noise,
    target: &Number,
    wanted_rate: Option<Number>,
    ends: Ends,
) -> Option<Playback> {
    let rate_hz = wanted_rate.as_ref().map_or(noise.rate_hz(), |rate| rate.value);
    if let Some(rate) = wanted_rate.filter(|rate| rate.value > noise.rate_hz() || rate.value < noise.least_rate_hz()) {
        let allowed = format!(
            "must be from {} to {} for this noise: 10 samples in a period of to_hz, at most {MAX_SAMPLES} in duration_s",
            noise.least_rate_hz(),
            noise.rate_hz()
        );
        section.refuse("sample_rate_hz", &rate.span, allowed, Some("leave it out".into()));
        return None;
    }
    let playback = Playback {
        kind: "playback",
        sample_rate_hz: rate_hz,
        samples_m: noise.record(rate_hz, target.value).samples,
        origin: Origin::Noise,
        about: noise.about(),
        ramp_s: ends.ramp_s,
        tail_s: ends.tail_s,
        rest_level_m: ends.level_m,
        key: "target_peak_m",
        span: target.span.clone(),
    };
    sound(section, &playback)?;
    Some(playback)
}

/// The playback of a record.
fn recorded(
    section: &Section,
    record: Record,
    target: Option<Number>,
    baseline: Option<usize>,
    wanted_rate: Option<Number>,
    ends: Ends,
) -> Option<Playback> {
    let file = section.span_of(RECORD_FILE.name());
    let (key, span) = match &target {
        Some(target) => ("target_peak_m", target.span.clone()),
        None if section.is_given(&RECORD_SCALE) => ("scale", section.span_of("scale")),
        None => ("file", file.clone()),
    };
    let is_linear = baseline.map_or(record.quantity == RecordQuantity::Acceleration, |word| word == 1);
    let rate_hz = wanted_rate.as_ref().map(|n| n.value).unwrap_or((1.0 / record.step_s).min(f64::from(TICK_HZ)));
    let count = (record.duration_s() * rate_hz * (1.0 + 1e-9)).floor() + 1.0;
    if rate_hz < MIN_RATE_HZ {
        let allowed =
            format!("has a sample each {:.3e} s; at most {} s can be played", record.step_s, 1.0 / MIN_RATE_HZ);
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
    if count > MAX_SAMPLES as f64 {
        let fits = two_digits_down((MAX_SAMPLES - 1) as f64 / record.duration_s());
        let allowed = format!(
            "gives {count:.0} samples in {:.2} s; the controller's record buffer of 40 KiB holds {MAX_SAMPLES}",
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
        origin: record.origin.file().map_or(Origin::Noise, |file| Origin::File(file.into())),
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
pub(super) struct Ends {
    pub(super) ramp_s: f64,
    pub(super) tail_s: f64,
    pub(super) level_m: f64,
}

impl Ends {
    pub(super) fn read(section: &Section) -> Option<Self> {
        // Playback and impulse have the same.
        let ramp = section.scalar(&playback_keys::RAMP);
        let tail = section.scalar(&playback_keys::TAIL);
        let level = section.scalar(&playback_keys::REST_LEVEL);
        Some(Self { ramp_s: ramp?, tail_s: tail?, level_m: level? })
    }
}

/// Peak below which a record is no motion, m: a thousandth of what a displacement sensor resolves, and of a light wave.
const MIN_PEAK_M: f64 = 1e-9;

/// Share of the displacement before the baseline was removed below which only the rounding of its numbers is left.
const ROUNDING: f64 = 1e-9;

/// Refuses a record that is nothing but rounding: scaling would make a motion of it. `before_m` is the largest |z| before
/// the baseline was removed.
fn refuse_noise(section: &Section, file: &Span, samples_m: &[f64], before_m: f64) -> Option<()> {
    let peak_m = samples_m.iter().fold(0.0f64, |most, z| most.max(z.abs()));
    let allowed = if peak_m > 0.0 && peak_m < ROUNDING * before_m {
        format!("less its baseline, {peak_m:.1e} m of {before_m:.1e} m are left: rounding, not a motion")
    } else if peak_m > 0.0 && peak_m < MIN_PEAK_M {
        format!("its largest displacement is {peak_m:.1e} m: rounding, not a motion; at least {MIN_PEAK_M:e} m")
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
        RecordQuantity::Acceleration => {
            let (v, z) = end_of(record);
            // c0 T + c1 T²/2 = v,  c0 T²/2 + c1 T³/6 = z
            let c1 = (6.0 * v * seconds - 12.0 * z) / seconds.powi(3);
            ("acceleration", [v / seconds - 0.5 * c1 * seconds, c1])
        }
        RecordQuantity::Displacement => {
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
            RecordQuantity::Acceleration => t * t * (0.5 * line[0] + t / 6.0 * line[1]),
            RecordQuantity::Displacement => line[0] + t * line[1],
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
pub(super) fn sound(section: &Section, playback: &Playback) -> Option<()> {
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
