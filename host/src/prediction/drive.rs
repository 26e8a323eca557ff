//! Refuses experiments that need more than the drive delivers, before the rig moves.
//!
//! The drive's range follows from its calibration ([`damprig_core::io::DriveRange`]). The device refuses the same when an
//! experiment is configured; this check gives the line in the campaign.

use damprig_core::control::stepped_sine::DriveMode;

use super::transient::Expected;
use super::trim;
use crate::campaign::transient::two_digits_down;
use crate::campaign::{Campaign, CampaignSetUp, ExperimentKind, Playback, SteppedSine};
use crate::failure::Failure;
use crate::input::{Number, Problem, Span};

/// A demand that is too large.
struct TooMuch {
    title: String,
    span: Span,
    asked_m: f64,
    key: &'static str,
    /// The range of the drive in the key's unit.
    most: String,
    /// The largest value of the key that would fit.
    fits: f64,
}

/// Refuses what a drive of ± `drive_m` cannot deliver.
///
/// # Errors
/// One message for all of them, each with the line of the key that sets the amplitude.
pub fn check(campaign: &Campaign, expected: &[Expected], drive_m: f64) -> Result<(), Failure> {
    let mut all: Vec<TooMuch> = Vec::new();
    for experiment in &campaign.experiments {
        let Some(sine) = experiment.stepped_sine() else { continue };
        all.extend(limit_too_high(sine, drive_m));
        if sine.response_loop().is_some() {
            // Its drive is whatever the response needs, up to the limit.
            continue;
        }
        if let Some((key, largest)) = sine.largest_amplitude() {
            all.extend(own_amplitude_too_high(key, largest, drive_m));
            continue;
        }
        for &index in &experiment.set_ups {
            all.extend(amplitude_too_high(&campaign.set_ups[index], drive_m));
        }
    }
    for Expected { set_up, experiment, outlook } in expected {
        let (set_up, experiment) = (&campaign.set_ups[*set_up], &campaign.experiments[*experiment]);
        if let ExperimentKind::Playback(playback) = &experiment.kind {
            all.extend(record_too_high(&set_up.name, &experiment.name, playback, outlook.max_abs_z_m, drive_m));
        }
    }
    let mut seen: Vec<Span> = Vec::new();
    for TooMuch { title, span, asked_m, key, most, fits } in all {
        // A set-up or a record may be used more than once.
        if seen.contains(&span) {
            continue;
        }
        seen.push(span.clone());
        campaign.source.report(Problem {
            title: format!(
                "{title}: it asks the drive for {} mm, which delivers ±{} mm",
                trim(asked_m * 1e3),
                trim(drive_m * 1e3)
            ),
            span,
            allowed: format!(
                "at most {most}: the drive's output is linear only up to there (settings, calibration.drive)"
            ),
            help: Some(format!("write {key} = {fits}")),
        });
    }
    campaign.source.verdict()
}

/// Rounded down to a hundredth of a millimetre.
fn trim_m(value: f64) -> String {
    format!("{}", (value * 1e5).floor() / 1e5)
}

fn amplitude_too_high(set_up: &CampaignSetUp, drive_m: f64) -> Option<TooMuch> {
    let asked_m = set_up.base_amplitude_m;
    (asked_m as f32 > drive_m as f32).then(|| TooMuch {
        title: match set_up.force_amplitude_n() {
            Some(_) => format!("set-up {:?} has too large a force (as P/k)", set_up.name),
            None => format!("set-up {:?} has too large a base amplitude", set_up.name),
        },
        span: set_up.base_amplitude_span.clone(),
        asked_m,
        key: set_up.amplitude_key(),
        most: match set_up.force_amplitude_n() {
            Some(force_n) => format!("{} N, k times {} m", trim(force_n * drive_m / asked_m), trim_m(drive_m)),
            None => format!("{} m", trim_m(drive_m)),
        },
        fits: set_up.amplitude_for(drive_m),
    })
}

fn own_amplitude_too_high(key: &'static str, largest: &Number, drive_m: f64) -> Option<TooMuch> {
    (largest.value as f32 > drive_m as f32).then(|| TooMuch {
        title: format!("`{key}` has too large an amplitude"),
        span: largest.span.clone(),
        asked_m: largest.value,
        key,
        most: format!("{} m", trim_m(drive_m)),
        fits: two_digits_down(drive_m),
    })
}

/// A stated limit of a closed loop that exceeds the drive's range.
fn limit_too_high(sine: &SteppedSine, drive_m: f64) -> Option<TooMuch> {
    let limit = sine.drive_limit.as_ref().filter(|_| sine.drive != DriveMode::Constant)?;
    (limit.value as f32 > drive_m as f32).then(|| TooMuch {
        title: "the closed loop's drive limit is too large".into(),
        span: limit.span.clone(),
        asked_m: limit.value,
        key: "drive_limit_m",
        most: format!("{} m", trim_m(drive_m)),
        fits: two_digits_down(drive_m),
    })
}

fn record_too_high(
    set_up: &str,
    experiment: &str,
    playback: &Playback,
    max_abs_z_m: f64,
    drive_m: f64,
) -> Option<TooMuch> {
    // The spline may overshoot between samples.
    let peak_m = max_abs_z_m.max(playback.peak_m());
    (peak_m as f32 > drive_m as f32).then(|| TooMuch {
        title: format!("experiment {experiment:?} on set-up {set_up:?} exceeds the drive's range"),
        span: playback.span.clone(),
        asked_m: peak_m,
        most: format!("{} m", trim_m(drive_m)),
        key: if playback.key == "amplitude_m" { playback.key } else { "target_peak_m" },
        fits: two_digits_down(drive_m * playback.peak_m() / peak_m),
    })
}
