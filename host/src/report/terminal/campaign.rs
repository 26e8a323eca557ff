//! Text of `damprig run`: the plan with its prediction, the table of results, the summary.

use comfy_table::Table;

use super::table;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, GridPeak};
use crate::input::shown_in_line;
use crate::prediction::{Prediction, Response};
use crate::report::describe;
use crate::report::figures::campaign::stepped_sines;
use crate::report::figures::force_surface::folds;
use crate::report::force_surface::ForceSurface;
use crate::report::numbers::{significant, trimmed};
use crate::report::peak::{Peak, points_of};
use crate::report::resonance::{self, TrackedCurve};
use crate::run_folder::ResultRow;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::results::steadiness_text;

fn ratio(value: Option<f64>) -> String {
    value.map_or("–".into(), |v| trimmed(v, 2))
}

/// The points in a random order, the first twelve.
fn order_of(campaign: &Campaign, experiment: &Experiment) -> String {
    const SHOWN: usize = 12;
    let Some(sine) = experiment.stepped_sine() else { return String::new() };
    if campaign.plan.order_seed.is_none() || experiment.carries_over() {
        return String::new();
    }
    let (what, first): (_, Vec<String>) = match &sine.tracked {
        Some(tracked) => (
            "Amplitudes",
            tracked.amplitudes.iter().take(SHOWN).map(|own| sine.amplitude_in_words(own.value)).collect(),
        ),
        None => ("Hz", sine.frequencies_hz.iter().take(SHOWN).map(|f| trimmed(*f, 4)).collect()),
    };
    let more = if sine.known_points() > SHOWN { ", …" } else { "" };
    format!(" {what}: {}{more}", first.join(", "))
}

/// What a person does and what is run, step by step; empty for a campaign that is run as written and instructs nobody.
#[must_use]
pub fn steps(campaign: &Campaign) -> Vec<String> {
    let instructs = campaign.set_ups.iter().any(|s| s.instruction.is_some())
        || campaign.experiments.iter().any(|e| e.instruction.is_some());
    if campaign.plan.order_seed.is_none() && !instructs {
        return Vec::new();
    }
    let mut lines = vec!["Order of work:".to_string()];
    for (place, (set_up, experiments)) in campaign.run_order.iter().enumerate() {
        lines.push(format!("{:3}. {}", place + 1, describe::mounting(&campaign.set_ups[*set_up])));
        for experiment in experiments.iter().map(|&place| &campaign.experiments[place]) {
            let what = match &experiment.instruction {
                Some(instruction) => describe::instruction(experiment, instruction),
                None => format!("Experiment {:?}.", experiment.name),
            };
            lines.push(format!("     - {what}{}", order_of(campaign, experiment)));
        }
    }
    lines
}

/// What moves otherwise than stated, or than the board knows it: lines for each set-up with walls of Hertz contact, or a plant.
#[must_use]
pub fn what_moves(campaign: &Campaign) -> Vec<String> {
    let lines = |set_up: &CampaignSetUp| {
        let hertz = set_up.hertz_as_hard().map(|text| format!("in prediction, twin and simulated plant {text}"));
        let plant = set_up.moves_as_plant().map(|text| format!("in prediction and on a virtual rig {text}"));
        let all = [hertz, plant].into_iter().flatten();
        all.map(|text| shown_in_line(&format!("Set-up {:?}: {text}", set_up.name)).into_owned()).collect::<Vec<_>>()
    };
    campaign.set_ups.iter().flat_map(lines).collect()
}

/// A number, or a dash where nothing is predicted.
fn known(value: f64, decimals: usize) -> String {
    if value.is_nan() { "–".into() } else { format!("{value:.decimals$}") }
}

/// The set-ups with their predicted displacements.
pub fn plan(campaign: &Campaign, predictions: &[Prediction]) -> Table {
    let mut table =
        table(&["set-up", "Z (mm)", "d/Z", "γF", "predicted\nlargest |x|\n(mm)", "at (Hz)", "of the sensor range (%)"]);
    let range_m = f64::from(campaign.rig.sensor_range_m()[0]);
    for prediction in predictions {
        let set_up = &campaign.set_ups[prediction.set_up];
        let swing = prediction.swing;
        table.add_row([
            set_up.name.clone(),
            trimmed(set_up.base_amplitude_m * 1e3, 3),
            ratio(set_up.clearance_ratio()),
            ratio(set_up.friction_ratio()),
            known(swing.max_x_m * 1e3, 1),
            if swing.max_x_m.is_nan() { "–".into() } else { trimmed(swing.frequency_hz, 4) },
            known(100.0 * swing.max_x_m / range_m, 0),
        ]);
    }
    table
}

/// The points that follow around measured peaks, with the places that the prediction expects; a line for each experiment on each set-up.
#[must_use]
pub fn peak_points(campaign: &Campaign, responses: &[Response]) -> Vec<String> {
    let mut lines = Vec::new();
    for (place, experiment) in campaign.experiments.iter().enumerate().filter(|(_, e)| e.peak_points() > 0) {
        for &set_up in &experiment.set_ups {
            let own = responses.iter().find(|r| r.set_up == set_up && r.experiment == place);
            let expected = match own
                .and_then(|own| own.around_peak.as_ref())
                .and_then(|around| Some((around.peak?, around.second)))
            {
                Some((peak, second)) => {
                    let place = |what: &str, peak: GridPeak| {
                        let [low, high, at] =
                            [peak.between_hz[0], peak.between_hz[1], peak.frequency_hz].map(|f| trimmed(f, 4));
                        let end = if peak.is_at_end() { ", an end of the grid" } else { "" };
                        format!("from {low} to {high} Hz ({what} at {at} Hz{end})")
                    };
                    let second = second.map(|second| format!(" and {}", place("second maximum", second)));
                    format!("predicted {}{}", place("highest point of the grid", peak), second.unwrap_or_default())
                }
                None => "their place is not predicted".into(),
            };
            let (set_up, name) = (&campaign.set_ups[set_up].name, &experiment.name);
            let count = experiment.peak_points();
            let line = format!(
                "Set-up {set_up:?}, experiment {name:?}: {count} further points around the measured peak; {expected}"
            );
            lines.push(shown_in_line(&line).into_owned());
        }
    }
    lines
}

/// A line for each peak that the predicted points do not resolve.
#[must_use]
pub fn unresolved_predictions(campaign: &Campaign, responses: &[Response]) -> Vec<String> {
    let points_of = |set_up: &str, experiment: &str| {
        let is_own = |r: &&Response| {
            campaign.set_ups[r.set_up].name == set_up && campaign.experiments[r.experiment].name == experiment
        };
        responses.iter().find(is_own).map_or(Vec::new(), |response| response.points.clone())
    };
    let lines = Peak::notes_of(campaign, points_of);
    lines.iter().map(|line| shown_in_line(&format!("Predicted: {line}")).into_owned()).collect()
}

/// A line for each peak that its points do not resolve.
#[must_use]
pub fn unresolved_peaks(campaign: &Campaign, rows: &[ResultRow]) -> Vec<String> {
    let lines = Peak::notes(campaign, rows);
    lines.iter().map(|line| shown_in_line(line).into_owned()).collect()
}

/// Largest |x| of the dwells of an experiment on a set-up as predicted, m.
fn predicted_m(campaign: &Campaign, responses: &[Response], set_up: &str, experiment: &str) -> Option<f64> {
    let is_own = |r: &&Response| {
        campaign.set_ups[r.set_up].name == set_up && campaign.experiments[r.experiment].name == experiment
    };
    responses.iter().find(is_own)?.dwell_max_x_m
}

/// Peak of X/Z (cycle maxima) with X/Z (lock-in) there, and X/Z at fn, a row for each experiment on each set-up.
pub fn results(campaign: &Campaign, responses: &[Response], rows: &[ResultRow]) -> Table {
    let has_several = {
        let mut set_ups: Vec<&str> = stepped_sines(campaign).map(|(set_up, _)| set_up.name.as_str()).collect();
        let all = set_ups.len();
        set_ups.dedup();
        set_ups.len() < all
    };
    let mut columns = vec!["set-up"];
    columns.extend(has_several.then_some("experiment"));
    columns.extend([
        "peak X/Z\n(cycle maxima)",
        "X/Z there\n(lock-in)",
        "at (Hz)",
        "peak",
        "steadiness",
        "X/Z at fn\n(cycle maxima)",
        "steadiness",
        "largest |x|\n(mm)",
        "predicted\n(mm)",
        "points",
        "settled\npoints",
    ]);
    let mut table = table(&columns);
    for (set_up, experiment) in stepped_sines(campaign) {
        let is_own = |r: &&ResultRow| r.set_up == set_up.name && r.experiment == experiment.name;
        let own: Vec<&ResultRow> = rows.iter().filter(is_own).collect();
        let Some(peak) = own.iter().max_by(|a, b| a.x_over_z().total_cmp(&b.x_over_z())) else { continue };
        let natural = set_up.natural_frequency_hz();
        let at_natural = own.iter().find(|r| (r.frequency_hz - natural).abs() < 1e-4 * natural);
        let verdict = |row: &ResultRow| steadiness_text(row.steadiness).to_string();
        let mut cells = vec![set_up.name.clone()];
        cells.extend(has_several.then(|| experiment.name.clone()));
        cells.extend([
            format!("{:.2}", peak.x_over_z()),
            format!("{:.2}", peak.x_over_z_lock_in()),
            trimmed(peak.frequency_hz, 4),
            Peak::measured(set_up, experiment, &points_of(rows, &set_up.name, &experiment.name))
                .map_or("–".into(), |peak| peak.verdict().to_string()),
            verdict(peak),
            at_natural.map_or("–".into(), |r| format!("{:.2}", r.x_over_z())),
            at_natural.map_or("–".into(), |r| verdict(r)),
            format!("{:.2}", own.iter().map(|r| r.max_abs_x_m).fold(f32::NAN, f32::max) * 1e3),
            predicted_m(campaign, responses, &set_up.name, &experiment.name)
                .map_or("–".into(), |x_m| format!("{:.2}", x_m * 1e3)),
            own.len().to_string(),
            own.iter().filter(|r| r.steadiness.is_settled()).count().to_string(),
        ]);
        table.add_row(cells);
    }
    table
}

/// What experiments that keep the response gave: a line for each on its set-up, and one for its folds.
#[must_use]
pub fn sheets(campaign: &Campaign, rows: &[ResultRow]) -> Vec<String> {
    let surfaces = ForceSurface::of(campaign, rows);
    let line = |surface: &ForceSurface| {
        let held: Vec<f64> = surface.z_m.iter().copied().filter(|z_m| z_m.is_finite()).collect();
        let [low, high] =
            [held.iter().copied().fold(f64::INFINITY, f64::min), held.iter().copied().fold(0.0, f64::max)];
        format!(
            "Set-up {:?}, experiment {:?}: {} held at {} of {} points, with Z from {} to {} mm",
            campaign.set_ups[surface.set_up].name,
            surface.experiment,
            surface.kept.name,
            held.len(),
            surface.z_m.len(),
            significant(low * 1e3, 3),
            significant(high * 1e3, 3),
        )
    };
    surfaces.iter().map(line).chain(folds(campaign, &surfaces)).map(|line| shown_in_line(&line).into_owned()).collect()
}

/// What experiments that follow a resonance gave: a table, if there are any.
#[must_use]
pub fn resonances(campaign: &Campaign, rows: &[ResultRow], is_simulated: bool) -> Option<Table> {
    let curves = TrackedCurve::of(campaign, rows, is_simulated);
    (!curves.is_empty()).then(|| resonance::table(campaign, &curves).for_terminal())
}

/// One line: points, times, samples, losses.
pub fn summary(manifest: &Manifest) -> String {
    let clock = manifest.clock;
    let tick_hz = manifest.device.as_ref().map_or(0.0, |d| d.tick_hz);
    let counters = manifest.counters;
    let late = manifest.controller.map_or(0, |c| c.overruns);
    let late = if late > 0 { format!("; {late} ticks of the board were late") } else { String::new() };
    let misfits = counters.misfit_messages;
    let misfits = if misfits > 0 {
        format!("; {misfits} messages of the board did not fit the campaign and were dropped")
    } else {
        String::new()
    };
    let speed = clock.rig_s / clock.wall_s;
    // Not finite for a run whose end was not recorded.
    let speed = if speed.is_finite() { format!(" ({speed:.0} times real time)") } else { String::new() };
    format!(
        "{} of {} points; {:.0} s of rig time in {:.2} s{speed}, tick {tick_hz} Hz; {} sample rows, {} lost ({} dropped); {} bad frames{misfits}{late}",
        manifest.points_taken,
        manifest.points_planned,
        clock.rig_s,
        clock.wall_s,
        manifest.sample_rows,
        counters.lost_rows,
        counters.dropped_records + counters.dropped_rows_host,
        counters.bad_frames_host + counters.bad_frames_device,
    )
}
