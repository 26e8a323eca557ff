//! Section of the report page on set-ups, experiments and limits.

use damprig_core::control::stepped_sine::DriveMode;
use damprig_core::model::{Tmd, Wall};
use maud::{Markup, html};

use super::data::PageData;
use super::tables::{label, largest, number, optional, short};
use crate::campaign::{Campaign, CampaignSetUp, Experiment, Kind, SpringTarget, Start};
use crate::report::compared::predicted_and_measured;

/// Table of set-ups, a row each.
pub(super) fn set_ups(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return from_manifest(data) };
    let predicted = |s: &CampaignSetUp| {
        data.manifest.set_ups.iter().find(|record| record.name == s.name).map_or(f64::NAN, |r| r.predicted_max_x_m)
    };
    let in_dwell = |s: &CampaignSetUp| {
        let record = data.manifest.set_ups.iter().find(|record| record.name == s.name);
        record.map_or(f64::NAN, |record| record.predicted_dwell_max_x_m)
    };
    let has_tmd = campaign.set_ups.iter().any(|set_up| set_up.model().tmd.is_some());
    html! {
        div.wide { table {
            thead { tr {
                th.word { "Set-up" }
                th { "Z" small { "mm" } } th { "M" small { "kg" } } th { "fn" small { "Hz" } } th { "ζ" small { "%" } }
                th { "Particle" small { "kg" } } th { "d" small { "mm" } } th { "d/Z" }
                th.word { "Walls" } th { "μ" small { "internal" } }
                th { "Friction" small { "N" } } th { "γF" } th.word { "Spring" }
                @if has_tmd { th.word { "Tuned mass" } }
                th { "max|x|" small { "mm, predicted, with settling" } } th { "max|x|" small { "mm, predicted, as measured" } }
                th { "max|x|" small { "mm, measured" } }
            } }
            tbody {
                @for set_up in &campaign.set_ups {
                    @let model = set_up.model();
                    tr {
                        td.word {
                            (label(data, &set_up.name))
                            @if set_up.has_unmodelled_damper { small { "damper without a model" } }
                        }
                        td { (short(set_up.base_amplitude_m * 1e3, 4)) }
                        td { (short(model.structure.mass_kg, 4)) }
                        td { (short(set_up.natural_frequency_hz(), 4)) }
                        td { (short(model.structure.damping_ratio() * 100.0, 4)) }
                        td { (optional(model.particle.map(|p| p.mass_kg), 4)) }
                        td { (optional(model.particle.map(|p| p.clearance_m * 1e3), 3)) }
                        td { (optional(set_up.clearance_ratio(), 3)) }
                        td.word.short { (model.particle.map_or("–".into(), |p| wall(p.wall))) }
                        td { (optional(model.particle.map(|p| p.friction_coefficient), 4)) }
                        td { (optional(model.friction_damper.map(|d| d.force_n), 4)) }
                        td { (optional(set_up.friction_ratio(), 3)) }
                        td.word { (spring(set_up)) }
                        @if has_tmd { td.word { (model.tmd.map_or("–".into(), |tmd| tuned_mass(&tmd))) } }
                        td { (number(predicted(set_up) * 1e3, 2)) }
                        td { (number(in_dwell(set_up) * 1e3, 2)) }
                        td { (number(largest(data, &set_up.name) * 1e3, 2)) }
                    }
                }
            }
        } }
        @for note in predicted_and_measured(campaign) { p.under { (note) } }
    }
}

fn wall(wall: Wall) -> String {
    match wall {
        Wall::Restitution { coefficient } => format!("e = {}", short(coefficient, 3)),
        Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
            format!("{} N/m, {} N·s/m", short(stiffness_n_per_m, 1), short(damping_n_s_per_m, 3))
        }
    }
}

fn tuned_mass(tmd: &Tmd) -> String {
    let (k1, c1) = (short(tmd.stiffness_n_per_m, 2), short(tmd.damping_n_s_per_m, 3));
    format!("{} kg, {k1} N/m, {c1} N·s/m", short(tmd.mass_kg, 4))
}

fn spring(set_up: &CampaignSetUp) -> String {
    match set_up.spring().map(|spring| spring.target) {
        None => "–".into(),
        Some(SpringTarget::FrictionRatio(ratio)) => format!("kept at γF = {}", short(ratio, 3)),
        Some(SpringTarget::NormalForce(force)) => format!("kept at {} N", short(force, 3)),
        Some(SpringTarget::Deflection(deflection)) => format!("kept at {} mm", short(deflection * 1e3, 3)),
    }
}

/// Table of set-ups from the manifest alone.
fn from_manifest(data: &PageData) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th.word { "Set-up" } th { "Z" small { "mm" } } th { "max|x|" small { "mm, measured" } } } }
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
                            td.word { (if sine.start == Start::FromRest { "from rest" } else { "motion carried over" }) }
                            td.word { (if sine.drive == DriveMode::Constant { "drive (constant)" } else { "base (closed loop)" }) }
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
        Kind::Playback(playback) => return playback.about.clone(),
        Kind::FreeVibration(free) => return format!("released at {} mm", short(free.start_m * 1e3, 3)),
        Kind::SteppedSine(_) => {}
    }
    match list {
        [first, .., last] if list.len() > 6 => format!("{} … {}", short(*first, 4), short(*last, 4)),
        _ => list.iter().map(|f| short(*f, 4)).collect::<Vec<_>>().join(", "),
    }
}

fn on(campaign: &Campaign, experiment: &Experiment) -> String {
    if experiment.set_ups.len() == campaign.set_ups.len() {
        return "all".into();
    }
    let name = |i: &usize| campaign.set_ups.get(*i).map(|s| s.name.clone());
    experiment.set_ups.iter().filter_map(name).collect::<Vec<_>>().join(", ")
}
