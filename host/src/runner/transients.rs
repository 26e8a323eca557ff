//! Makes the row of a record, a pulse or a free vibration: the measurement, quantities derived from it, and the prediction.

use std::f64::consts::TAU;

use damprig_core::measure::impacts::ImpactConfig;
use damprig_core::measure::transient::TransientResult;

use crate::campaign::{CampaignSetUp, Experiment, ExperimentKind};
use crate::prediction::transient::outlook;
use crate::run_folder::schema::transients::TransientRow;

pub(super) fn row(
    set_up: &CampaignSetUp,
    experiment: &Experiment,
    segment: u32,
    result: &TransientResult,
    detection: &ImpactConfig,
) -> TransientRow {
    // The campaign was predicted before the start, so every experiment here can be simulated.
    let predicted = outlook(set_up, experiment, detection).ok().flatten();
    let is_driven = experiment.free_vibration().is_none();
    let of_drive = |value: f32| if is_driven { value } else { f32::NAN };
    let decay = &result.decay;
    let (start_m, end_m) = (f64::from(decay.start_m), f64::from(decay.end_m));
    let (has_start, has_decay) = (!is_driven, !is_driven && decay.cycles > 0);
    let of_decay = |value: f64| if has_decay { value } else { f64::NAN };
    let log_decrement = of_decay((start_m / end_m).ln() / f64::from(decay.cycles));
    TransientRow {
        set_up: set_up.name.clone(),
        experiment: experiment.name.clone(),
        kind: match &experiment.kind {
            ExperimentKind::Playback(playback) => playback.kind,
            _ => "free_vibration",
        }
        .to_string(),
        max_abs_x_m: result.max_abs_x_m,
        rms_x_m: result.rms_x_m,
        max_abs_z_m: result.max_abs_z_m,
        rms_z_m: result.rms_z_m,
        max_abs_x_minus_z_m: result.max_abs_x_minus_z_m,
        rms_x_minus_z_m: result.rms_x_minus_z_m,
        wanted_rms_m: of_drive(result.wanted_rms_m),
        base_error_rms_m: of_drive(result.base_error_rms_m),
        base_delay_s: of_drive(result.base_delay_s),
        drive_saturated: result.drive_saturated,
        sensors_clipped: super::wire_mapping::clipped(result.clipped),
        impacts: result.impacts,
        start_m: if has_start { start_m } else { f64::NAN },
        end_m: of_decay(end_m),
        cycles: u32::from(decay.cycles),
        log_decrement,
        damping_ratio: log_decrement / (TAU * TAU + log_decrement * log_decrement).sqrt(),
        frequency_hz: of_decay(f64::from(decay.cycles) / f64::from(decay.span_s)),
        predicted_max_abs_x_m: predicted.map_or(f64::NAN, |p| p.max_abs_x_m),
        predicted_rms_x_m: predicted.map_or(f64::NAN, |p| p.rms_x_m),
        predicted_impacts: predicted.map_or(0, |p| p.impacts),
        start_tick: u64::from(result.start_tick),
        end_tick: u64::from(result.end_tick),
        point_index: u32::from(result.index),
        segment,
    }
}
