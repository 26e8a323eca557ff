//! What an export says of the run itself, from the manifest: facts of the whole run, and the parameters of its set-ups.

use damprig_core::model::SetUp;

use crate::host_time::plain;
use crate::run_folder::RunFolder;
use crate::run_folder::schema::manifest::SetUpRecord;
use crate::run_folder::schema::set_up_parameters::{PARAMETERS, RARE_PARAMETERS};

/// A fact of the whole run.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fact {
    Text(String),
    Number(f64),
}

/// The facts of a run, by name; a number's unit is the end of its name.
pub(super) fn of_run(run: &RunFolder) -> Vec<(&'static str, Fact)> {
    let m = run.manifest();
    let text = |text: &str| Fact::Text(text.to_string());
    let mut facts = vec![
        ("id", Fact::Text(run.id())),
        ("campaign", text(&m.campaign)),
        ("started", text(plain(&m.started))),
        ("status", Fact::Text(m.ending_text())),
        ("program", text(&m.damprig)),
        ("points_planned", Fact::Number(m.points_planned as f64)),
        ("points_taken", Fact::Number(m.points_taken as f64)),
        ("telemetry_rate_hz", Fact::Number(m.telemetry_rate_hz)),
        ("lost_rows", Fact::Number(m.counters.lost_rows as f64)),
        ("interruptions", Fact::Number(m.counters.interruptions as f64)),
    ];
    facts.extend(m.plan.texts().map(|(name, stated)| (name, text(stated))));
    facts.extend(m.plan.order_seed.map(|seed| ("order_seed", Fact::Number(f64::from(seed)))));
    if let Some(device) = &m.device {
        facts.extend([
            ("rig", text(&device.link)),
            ("board", text(&device.board)),
            ("firmware", text(&device.firmware)),
            ("protocol_schema", text(&device.protocol_schema)),
            ("tick_hz", Fact::Number(device.tick_hz)),
        ]);
    }
    facts
}

/// The parameters of the set-ups: a column for each, NaN where a set-up does not have it.
pub(super) fn set_up_columns(set_ups: &[SetUpRecord]) -> Vec<(&'static str, Vec<f64>)> {
    let of = |value: &fn(&SetUp) -> Option<f64>| -> Vec<f64> {
        set_ups.iter().map(|s| s.model().as_ref().and_then(value).unwrap_or(f64::NAN)).collect()
    };
    let unmodelled = set_ups.iter().map(|s| f64::from(u8::from(s.has_unmodelled_damper))).collect();
    let force_n = set_ups.iter().map(|s| s.force_amplitude_n().unwrap_or(f64::NAN)).collect();
    let more = [("has_unmodelled_damper", unmodelled), ("force_amplitude_n", force_n)];
    let has = |values: &Vec<f64>| values.iter().any(|value| !value.is_nan());
    let rare = RARE_PARAMETERS.iter().map(|(name, value)| (*name, of(value))).filter(|(_, values)| has(values));
    PARAMETERS.iter().map(|(name, value)| (*name, of(value))).chain(more).chain(rare).collect()
}
