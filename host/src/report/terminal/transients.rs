//! What a run says of its records, pulses and free vibrations: what is to be expected, what came, and the figure.

use std::collections::BTreeMap;
use std::path::Path;

use comfy_table::Table;

use super::campaign::table;
use crate::campaign::{Campaign, Kind};
use crate::prediction::transient::Expected;
use crate::report::figures::time_histories::{Curve, Panel, draw};
use crate::report::figures::{FigureError, Picture};
use crate::run_folder::RunFolder;
use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::schema::transients::TransientRow;

fn mm(metres: f64) -> String {
    if metres.is_finite() { format!("{:.3}", metres * 1e3) } else { "–".into() }
}

/// What is to be expected, and what the records are.
pub fn plan(campaign: &Campaign, expected: &[Expected]) -> Option<String> {
    if expected.is_empty() {
        return None;
    }
    let mut table =
        table(&["experiment", "set-up", "peak z (mm)", "predicted max|x| (mm)", "max|x−z| (mm)", "impacts"]);
    for Expected { set_up, experiment, outlook } in expected {
        table.add_row([
            campaign.experiments[*experiment].name.clone(),
            campaign.set_ups[*set_up].name.clone(),
            mm(outlook.z_peak_m),
            mm(outlook.x_peak_m),
            mm(outlook.relative_peak_m),
            outlook.impacts.to_string(),
        ]);
    }
    let about = campaign.experiments.iter().filter_map(|experiment| match &experiment.kind {
        Kind::Playback(p) => Some(format!(
            "{}: {}; {} samples at {} Hz, to {:.3} µm",
            experiment.name,
            p.about,
            p.samples_m.len(),
            p.sample_rate_hz,
            f64::from(p.scale_m()) * 1e6
        )),
        _ => None,
    });
    Some(std::iter::once(table.to_string()).chain(about).collect::<Vec<_>>().join("\n"))
}

/// What came of them.
pub fn results(rows: &[TransientRow]) -> Option<Table> {
    if rows.is_empty() {
        return None;
    }
    let header = [
        "experiment",
        "set-up",
        "max|x| (mm)",
        "predicted (mm)",
        "RMS x (mm)",
        "RMS x−z (mm)",
        "base error (%)",
        "impacts",
        "ζ",
        "f (Hz)",
        "cycles",
    ];
    let mut table = table(&header);
    let share = |part: f32, whole: f32| if whole > 0.0 { format!("{:.2}", 100.0 * part / whole) } else { "–".into() };
    let digits = |value: f64, digits: usize| if value.is_finite() { format!("{value:.digits$}") } else { "–".into() };
    for row in rows {
        table.add_row([
            row.experiment.clone(),
            row.set_up.clone(),
            mm(f64::from(row.x_peak_m)),
            mm(row.predicted_x_peak_m),
            mm(f64::from(row.x_rms_m)),
            mm(f64::from(row.relative_rms_m)),
            share(row.base_error_rms_m, row.wanted_rms_m),
            row.impacts.to_string(),
            digits(row.damping_ratio, 5),
            digits(row.frequency_hz, 4),
            if row.cycles > 0 { row.cycles.to_string() } else { "–".into() },
        ]);
    }
    Some(table)
}

type Histories = BTreeMap<(String, String), Vec<(f64, f64)>>;

/// x over time of every experiment that is one event; nothing where x was not recorded.
///
/// # Errors
/// What the drawing library says, or samples that cannot be read.
pub fn figure(campaign: &Campaign, folder: &Path, rows: &[TransientRow]) -> Result<Option<Picture>, FigureError> {
    if rows.is_empty() {
        return Ok(None);
    }
    let run = RunFolder::open(folder).map_err(FigureError::of)?;
    let wanted: BTreeMap<(&str, &str), (String, u64, u64)> = rows
        .iter()
        .map(|r| ((r.set_up.as_str(), r.experiment.as_str()), (r.segment.to_string(), r.start_tick, r.end_tick)))
        .collect();
    let (mut x, mut z) = (Histories::new(), Histories::new());
    for batch in run.samples() {
        let batch = batch.map_err(FigureError::of)?;
        let names = (texts(&batch, "set_up"), texts(&batch, "experiment"), texts(&batch, "segment"));
        let (Ok(set_ups), Ok(experiments), Ok(segments)) = names else { continue };
        let (Ok(ticks), Ok(times)) = (numbers(&batch, "tick"), numbers(&batch, "t_s")) else { continue };
        for (column, into) in [("x_m", &mut x), ("z_m", &mut z)] {
            let Ok(values) = numbers(&batch, column) else { continue };
            for n in 0..values.len() {
                let Some((segment, start, end)) = wanted.get(&(set_ups[n].as_str(), experiments[n].as_str())) else {
                    continue;
                };
                if segments[n] == *segment && (*start as f64..*end as f64).contains(&ticks[n]) {
                    let key = (set_ups[n].clone(), experiments[n].clone());
                    into.entry(key).or_default().push((times[n], values[n]));
                }
            }
        }
    }
    let panels: Vec<Panel> = campaign
        .experiments
        .iter()
        .filter(|e| e.stepped_sine().is_none())
        .filter_map(|experiment| {
            // Each from its own beginning.
            let history = |all: &Histories, name: &str| -> Option<Vec<(f64, f64)>> {
                let points = all.get(&(name.to_string(), experiment.name.clone()))?;
                let from = points.first()?.0;
                Some(points.iter().map(|(t, value)| (t - from, *value)).collect())
            };
            let set_ups: Vec<_> = experiment.set_ups.iter().filter_map(|i| campaign.set_ups.get(*i)).collect();
            let curves: Vec<Curve> = set_ups
                .iter()
                .filter_map(|s| Some(Curve { label: s.label.clone(), points: history(&x, &s.name)? }))
                .collect();
            let base = experiment.playback().and(set_ups.first()).and_then(|s| history(&z, &s.name));
            let about = match &experiment.kind {
                Kind::Playback(playback) => playback.about.clone(),
                _ => "free vibration".into(),
            };
            (!curves.is_empty()).then(|| Panel { title: format!("{}: {about}", experiment.name), curves, base })
        })
        .collect();
    if panels.is_empty() { Ok(None) } else { draw(&panels).map(Some) }
}
