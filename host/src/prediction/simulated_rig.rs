//! Checks what only a simulated rig states: how far its shaker moves for the demanded amplitude, and what its sensors resolve.

use std::f64::consts::TAU;

use damprig_core::control::base_follow;
use damprig_core::control::stepped_sine::DriveMode;
use damprig_simulator::plant::Shaker;

use super::{USABLE, trim};
use crate::campaign::{Campaign, CampaignSetUp, ExperimentKind, PointStart, RigSettings, SteppedSine};
use crate::failure::Failure;
use crate::input::locate::PathStep::{Item, Key};
use crate::input::{Problem, Span};

/// A start may move the table this much further than the steady motion.
const OVERSHOOT: f64 = 1.5;

/// The table moves more, or less, than this share of the demand: worth a warning.
const NOTABLE: f64 = 1.5;

/// Displacements below this are lost in single precision, m.
const MIN_M: f64 = 1e-9;

/// Checks a campaign on a simulated rig; returns warnings.
///
/// # Errors
/// A shaker that would move the base beyond its limits, or a motion that the sensors do not resolve.
pub fn check(campaign: &Campaign) -> Result<Vec<String>, Failure> {
    let mut warnings = Vec::new();
    for (place, experiment) in campaign.experiments.iter().enumerate() {
        for set_up in experiment.set_ups.iter().filter_map(|index| campaign.set_ups.get(*index)) {
            let (key, moved_m, span) = match &experiment.kind {
                ExperimentKind::SteppedSine(sine) => {
                    if let (Some(shaker), DriveMode::Constant) = (&campaign.rig.shaker, &sine.drive) {
                        warnings.extend(unloaded(campaign, shaker, set_up, sine));
                    }
                    let highest_hz = sine.drive_range_hz().into_iter().fold(0.0, f64::max) as f32;
                    let own = sine.smallest_amplitude().map(|(key, own)| {
                        let response = sine.response_loop().map(|held| held.response.with_amplitude(own.value as f32));
                        let moved_m = response.map_or(own.value, |response| response.amplitude_m(highest_hz).into());
                        (key, moved_m, &own.span)
                    });
                    let base = (set_up.amplitude_key(), set_up.base_amplitude_m, &set_up.base_amplitude_span);
                    own.unwrap_or(base)
                }
                ExperimentKind::Playback(playback) => (playback.key, playback.peak_m(), &playback.span),
                ExperimentKind::FreeVibration(free) => ("start_m", free.start_m.abs(), &free.span),
            };
            let per_m = match &experiment.kind {
                ExperimentKind::SteppedSine(sine) if sine.largest_amplitude().is_none() => {
                    set_up.force_amplitude_n().map(|force_n| force_n / set_up.base_amplitude_m)
                }
                _ => None,
            };
            resolved(campaign, key, (moved_m, per_m), span);
            let level_m = match &experiment.kind {
                ExperimentKind::SteppedSine(sine) if sine.start == PointStart::FromRest => Some(sine.rest_level_m),
                ExperimentKind::Playback(playback) => Some(playback.rest_level_m),
                _ => None,
            };
            level_m.into_iter().for_each(|level_m| comes_to_rest(campaign, place, level_m));
        }
    }
    campaign.source.verdict()?;
    warnings.dedup();
    Ok(warnings)
}

/// Reports a table without load that would leave its limits; a warning if it moves by another amplitude than demanded.
fn unloaded(campaign: &Campaign, shaker: &Shaker, set_up: &CampaignSetUp, sine: &SteppedSine) -> Option<String> {
    let gain = |f: f64| {
        let (re, im) = shaker.dynamic_stiffness_n_per_m(TAU * f);
        shaker.force_per_drive_n_per_m() / re.hypot(im)
    };
    let range_hz = sine.drive_range_hz();
    let gains = range_hz.iter().map(|f| (gain(*f), *f));
    let (largest, at_hz) = gains.clone().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (least, low_hz) = gains.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let z_m = sine.largest_amplitude().map_or(set_up.base_amplitude_m, |(_, own)| own.value);
    let most_m = shaker.half_stroke_m.min(USABLE * campaign.rig.base_limit_m());
    let calibrated = shaker.calibrated_at_hz;
    let moves = |gain: f64, at_hz: f64| {
        format!(
            "set-up {:?}: calibrated at {} Hz, the shaker's table without load moves {} times as far as demanded at {} Hz",
            set_up.name,
            trim(calibrated),
            crate::campaign::transient::two_digits_down(gain),
            trim(at_hz)
        )
    };
    let key = [Key("rig"), Key("shaker"), Key("calibrated_at_hz")];
    let span = || campaign.source.locate(&key).or_else(|| campaign.source.locate(&key[..2])).unwrap_or_default();
    let help = Some(format!("write calibrated_at_hz = {}, or drive = \"closed_loop\"", trim(at_hz)));
    let (much, little) = (f64::from(base_follow::MAX), f64::from(base_follow::MIN));
    let allowed = if OVERSHOOT * largest > much {
        format!("the rig stops when the base moves {much} times as far as demanded")
    } else if largest * z_m > most_m {
        format!("by {} mm, where at most {} mm may be used", trim(largest * z_m * 1e3), trim(most_m * 1e3))
    } else if least < 2.0 * little {
        format!("the rig stops when the base moves less than {little} of the demand")
    } else {
        let notable = if largest > NOTABLE { (largest, at_hz) } else { (least, low_hz) };
        return (notable.0 > NOTABLE || notable.0 < 1.0 / NOTABLE).then(|| moves(notable.0, notable.1));
    };
    let (gain, at_hz) = if least < 2.0 * little { (least, low_hz) } else { (largest, at_hz) };
    campaign.source.report(Problem { title: moves(gain, at_hz), span: span(), allowed, help });
    None
}

/// Smallest displacement that the simulated sensors tell apart, m.
fn resolution_m(rig: &RigSettings) -> f64 {
    let [_, range_m] = rig.sensor_range_m();
    match &rig.data_sheet {
        Some(sheet) => 2.0 * f64::from(range_m) / f64::from(1_u32 << sheet.bits.min(31)),
        None => rig.sensor_resolution_m,
    }
}

/// Reports a rest level that the noise of a structure at rest exceeds all the time. A rest takes 5000 samples: some are always
/// beyond three standard deviations.
fn comes_to_rest(campaign: &Campaign, experiment: usize, level_m: f64) {
    let half_step_m = 0.5 * resolution_m(&campaign.rig);
    let noise_m = 3.0 * campaign.rig.sensor_noise_rms_m;
    let reading_m = if noise_m < half_step_m { 0.0 } else { noise_m + half_step_m };
    if level_m > reading_m {
        return;
    }
    let table = [Key("experiment"), Item(experiment), Key("rest_level_m")];
    let span = campaign.source.locate(&table).or_else(|| campaign.source.locate(&table[..2])).unwrap_or_default();
    campaign.source.report(Problem {
        title: format!(
            "`experiment[{}].rest_level_m` = {level_m:e} is too small: the structure never comes to rest",
            experiment + 1
        ),
        span,
        allowed: format!("must be above {reading_m:.1e} m, which the sensors' noise and resolution reach"),
        help: None,
    });
}

/// Reports a motion that reads as zero.
/// `per_m`: the stiffness with which a force is a motion.
fn resolved(campaign: &Campaign, key: &str, (moved_m, per_m): (f64, Option<f64>), span: &Span) {
    let resolution_m = resolution_m(&campaign.rig);
    let least_m = MIN_M.max(0.5 * resolution_m);
    if moved_m >= least_m {
        return;
    }
    campaign.source.report(Problem {
        title: format!("`{key}` is too small: a motion of {moved_m:e} m cannot be measured"),
        span: span.clone(),
        allowed: match per_m {
            Some(k) => {
                format!("must be {:.1e} N or more: P/k is then {least_m:.1e} m, which the sensors resolve", k * least_m)
            }
            None => format!("must be {least_m:.1e} m or more: the sensors resolve {resolution_m:.1e} m"),
        },
        help: None,
    });
}
