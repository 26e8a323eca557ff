//! Section of the report page on set-ups, experiments and limits.

use damprig_core::control::stepped_sine::DriveMode;
use maud::{Markup, html};

use super::data::PageData;
use super::tables::{label, largest, number, short};
use crate::campaign::{
    Campaign, CampaignSetUp, Experiment, ExperimentKind, PointStart, SteppedSine, TrackedResonance, kept_in_words,
};
use crate::report::compared::predicted_and_measured;
use crate::report::parameters::rows;
use crate::run_folder::schema::manifest::SetUpRecord;

/// Set-ups side by side in one table.
const SIDE_BY_SIDE: usize = 10;

/// Tables of set-ups, a column each, with every parameter, and the largest displacements predicted and measured.
pub(super) fn set_ups(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return from_manifest(data) };
    html! {
        @for set_ups in campaign.set_ups.chunks(SIDE_BY_SIDE) { (side_by_side(data, set_ups)) }
        @for note in predicted_and_measured(campaign) { p.under { (note) } }
    }
}

fn side_by_side(data: &PageData, set_ups: &[CampaignSetUp]) -> Markup {
    let recorded = |set_up: &CampaignSetUp, value: fn(&SetUpRecord) -> f64| {
        data.manifest.set_ups.iter().find(|record| record.name == set_up.name).map_or(f64::NAN, value)
    };
    html! {
        div.wide { table {
            thead { tr {
                th.word { "Parameter" }
                @for set_up in set_ups { th { (label(data, &set_up.name)) } }
            } }
            tbody {
                @for row in rows(set_ups) {
                    tr {
                        td.word.short { (row.name) }
                        @for value in &row.values { td { (value.as_deref().unwrap_or("–")) } }
                    }
                }
                tr.first {
                    td.word.short { "Largest |x| predicted, with settling (mm)" }
                    @for set_up in set_ups { td { (number(recorded(set_up, |r| r.predicted_max_x_m) * 1e3, 2)) } }
                }
                tr {
                    td.word.short { "Largest |x| predicted, as measured (mm)" }
                    @for set_up in set_ups { td { (number(recorded(set_up, |r| r.predicted_dwell_max_x_m) * 1e3, 2)) } }
                }
                tr {
                    td.word.short { "Largest |x| measured (mm)" }
                    @for set_up in set_ups { td { (number(largest(data, &set_up.name) * 1e3, 2)) } }
                }
            }
        } }
    }
}

/// Table of set-ups from the manifest alone.
fn from_manifest(data: &PageData) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th.word { "Set-up" } th { "Z" small { "mm" } } th { "Largest |x|" small { "mm, measured" } } } }
            tbody {
                @for set_up in &data.manifest.set_ups {
                    tr {
                        td.word { (label(data, &set_up.name)) }
                        td { (short(set_up.base_amplitude_m * 1e3, 4)) }
                        td { (number(largest(data, &set_up.name) * 1e3, 2)) }
                    }
                }
            }
        } }
    }
}

/// Table of experiments, and the rig.
pub(super) fn experiments(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    let [range_m, _] = campaign.rig.sensor_range_m();
    html! {
        div.wide { table {
            thead { tr {
                th.word { "Experiment" } th.word { "Frequencies" small { "Hz" } } th { "Points" }
                th.word { "Start" } th.word { "Controlled" }
                th { "Settle" small { "s" } } th { "Dwell" small { "s" } } th.word { "Set-ups" }
            } }
            tbody {
                @for experiment in &campaign.experiments {
                    tr {
                        td.word { (experiment.name) }
                        td.word { (range(experiment)) }
                        td { (experiment.points()) }
                        @if let Some(sine) = experiment.stepped_sine() {
                            td.word { (if sine.start == PointStart::FromRest { "from rest" } else { "motion carried over" }) }
                            td.word { (controlled(sine)) }
                            td { (short(sine.settle_s, 3)) }
                            td { (short(sine.dwell_s, 3)) }
                        } @else {
                            td.word { "from rest" } td.word { "–" } td { "–" } td { (short(experiment.expected_s(), 1)) }
                        }
                        td.word { (on(campaign, experiment)) }
                    }
                }
            }
        } }
        dl {
            dt { "Sensors" }
            dd { "±" (short(f64::from(range_m) * 1e3, 3)) " mm, resolution "
                (short(campaign.rig.sensor_resolution_m * 1e6, 3)) " µm, noise "
                (short(campaign.rig.sensor_noise_rms_m * 1e6, 3)) " µm RMS (simulated rig)" }
            dt { "Base" }
            dd { (if campaign.rig.shaker.is_some() { "shaker with load feedback" } else { "follows the drive" }) }
        }
    }
}

/// What a stepped sine keeps at its amplitude.
fn controlled(sine: &SteppedSine) -> String {
    let own = |tracked: &TrackedResonance| {
        let all: Vec<String> = tracked.amplitudes.iter().map(|own| sine.amplitude_in_words(own.value)).collect();
        format!(": {}", all.join(", "))
    };
    let amplitudes = sine.tracked.as_ref().map_or_else(String::new, own);
    match &sine.drive {
        DriveMode::Constant => format!("drive (constant){amplitudes}"),
        DriveMode::ClosedLoop(_) => format!("base (closed loop){amplitudes}"),
        DriveMode::Response(_) if sine.tracked.is_some() => format!("response (closed loop){amplitudes}"),
        DriveMode::Response(own) => format!("{} (closed loop)", kept_in_words(&own.response)),
    }
}

/// Table of the limits and spring properties in force, with their origin.
pub(super) fn acting(data: &PageData) -> Markup {
    let list = &data.manifest.acting_settings;
    html! {
        @if !list.is_empty() {
            h3 { "Limits and spring properties in force" }
            div.wide { table {
                thead { tr { th.word { "Setting" } th.word { "Set-up" } th { "Value" } th.word { "Set by" } th { "Board's value" } } }
                tbody {
                    @for acting in list {
                        tr {
                            td.word { (acting.setting) }
                            td.word { (acting.set_up.as_deref().unwrap_or("all")) }
                            td { (acting.value) }
                            td.word { (acting.origin) }
                            td { (acting.board_value.map_or("–".into(), |value| value.to_string())) }
                        }
                    }
                }
            } }
        }
    }
}

fn range(experiment: &Experiment) -> String {
    let list = experiment.frequencies_hz();
    match &experiment.kind {
        ExperimentKind::Playback(playback) => return playback.about.clone(),
        ExperimentKind::FreeVibration(free) => return format!("released at {} mm", short(free.start_m * 1e3, 3)),
        ExperimentKind::SteppedSine(SteppedSine { tracked: Some(TrackedResonance { lock, .. }), .. }) => {
            let [low, high] = [lock.low_hz, lock.high_hz].map(|f| short(f.into(), 4));
            return format!("resonance from {low} to {high}, at {}°", short(lock.phase_rad.to_degrees().into(), 4));
        }
        ExperimentKind::SteppedSine(_) => {}
    }
    let listed = match list {
        [first, .., last] if list.len() > 6 => format!("{} … {}", short(*first, 4), short(*last, 4)),
        _ => list.iter().map(|f| short(*f, 4)).collect::<Vec<_>>().join(", "),
    };
    match experiment.peak_points() {
        0 => listed,
        count => format!("{listed}; {count} around the peak"),
    }
}

fn on(campaign: &Campaign, experiment: &Experiment) -> String {
    if experiment.set_ups.len() == campaign.set_ups.len() {
        return "all".into();
    }
    let name = |i: &usize| campaign.set_ups.get(*i).map(|s| s.name.clone());
    experiment.set_ups.iter().filter_map(name).collect::<Vec<_>>().join(", ")
}
