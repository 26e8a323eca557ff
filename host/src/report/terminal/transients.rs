//! Tables of playbacks, impulses and free vibrations: prediction and results.

use comfy_table::Table;

use crate::campaign::{Campaign, ExperimentKind};
use crate::prediction::transient::Expected;
use crate::quantity::Quantity;
use crate::report::text_table::{head, table};
use crate::run_folder::schema::transients::TransientRow;

fn mm(metres: f64) -> String {
    if metres.is_finite() { format!("{:.3}", metres * 1e3) } else { "–".into() }
}

/// A predicted count; a dash where x is not predicted either.
fn predicted(max_abs_x_m: f64, count: u32) -> String {
    if max_abs_x_m.is_nan() { "–".into() } else { count.to_string() }
}

/// Predicted displacements, and how each record was prepared.
pub fn plan(campaign: &Campaign, expected: &[Expected]) -> Option<String> {
    if expected.is_empty() {
        return None;
    }
    let mut table = table(&[
        head(Quantity::Experiment),
        head(Quantity::SetUp),
        head(Quantity::MaxAbsZM),
        head(Quantity::PredictedMaxAbsXM),
        head(Quantity::MaxAbsXMinusZM),
        "impacts\nto be counted".into(),
        "weaker\nimpacts".into(),
    ]);
    for Expected { set_up, experiment, outlook } in expected {
        table.add_row([
            campaign.experiments[*experiment].name.clone(),
            campaign.set_ups[*set_up].name.clone(),
            mm(outlook.max_abs_z_m),
            mm(outlook.max_abs_x_m),
            mm(outlook.max_abs_x_minus_z_m),
            predicted(outlook.max_abs_x_m, outlook.impacts),
            predicted(outlook.max_abs_x_m, outlook.weak_impacts),
        ]);
    }
    let records = campaign.experiments.iter().filter_map(|experiment| match &experiment.kind {
        ExperimentKind::Playback(p) => Some(format!(
            "{}: {}; {} samples at {} Hz, resolution {:.3} µm",
            experiment.name,
            p.about,
            p.samples_m.len(),
            p.sample_rate_hz,
            f64::from(p.scale_m()) * 1e6
        )),
        _ => None,
    });
    Some(std::iter::once(table.to_string()).chain(records).collect::<Vec<_>>().join("\n"))
}

/// A result in one line.
#[must_use]
pub fn in_words(row: &TransientRow) -> String {
    let mut text = format!("largest |x| {} mm, RMS {} mm", mm(row.max_abs_x_m.into()), mm(row.rms_x_m.into()));
    if row.damping_ratio.is_finite() {
        text += &format!(", ζ {:.5}", row.damping_ratio);
    }
    if row.frequency_hz.is_finite() {
        text += &format!(", f {:.4} Hz", row.frequency_hz);
    }
    if row.impacts > 0 {
        text += &format!(", {} impacts", row.impacts);
    }
    text
}

/// Results, a row per set-up and experiment.
pub fn results(rows: &[TransientRow]) -> Option<Table> {
    if rows.is_empty() {
        return None;
    }
    let heads = |all: &[Quantity]| all.iter().map(|own| head(*own)).collect::<Vec<_>>();
    let mut header = heads(&[
        Quantity::Experiment,
        Quantity::SetUp,
        Quantity::MaxAbsXM,
        Quantity::PredictedMaxAbsXM,
        Quantity::RmsXM,
        Quantity::RmsXMinusZM,
    ]);
    header.push("base error\n(%)".into());
    header.extend(heads(&[
        Quantity::Impacts,
        Quantity::PredictedImpacts,
        Quantity::DampingRatio,
        Quantity::FrequencyHz,
        Quantity::Cycles,
    ]));
    let mut table = table(&header);
    let share = |part: f32, whole: f32| if whole > 0.0 { format!("{:.2}", 100.0 * part / whole) } else { "–".into() };
    let digits = |value: f64, digits: usize| if value.is_finite() { format!("{value:.digits$}") } else { "–".into() };
    for row in rows {
        table.add_row([
            row.experiment.clone(),
            row.set_up.clone(),
            mm(f64::from(row.max_abs_x_m)),
            mm(row.predicted_max_abs_x_m),
            mm(f64::from(row.rms_x_m)),
            mm(f64::from(row.rms_x_minus_z_m)),
            share(row.base_error_rms_m, row.wanted_rms_m),
            row.impacts.to_string(),
            predicted(row.predicted_max_abs_x_m, row.predicted_impacts),
            digits(row.damping_ratio, 5),
            digits(row.frequency_hz, 4),
            if row.cycles > 0 { row.cycles.to_string() } else { "–".into() },
        ]);
    }
    Some(table)
}
