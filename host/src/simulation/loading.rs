//! The tables of a case that say what moves it, from where, and for how long: base, force, initial state, run.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Initial;

use super::case::RunSpec;
use super::record::read::{RecordError, Which, read, units};
use super::record::{Quantity, Record, Spec};
use crate::input::{Problem, Section};

/// What moves the case.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Loading {
    /// Known in closed form.
    Closed(Excitation),
    /// A record of the base's motion.
    Recorded(Record),
}

/// `base`; the record's file is found by `find`.
pub(super) fn base(s: &Section, find: &dyn Fn(&str) -> std::path::PathBuf) -> Option<Loading> {
    let kinds = ["fixed", "sine", "half_sine", "versine", "record"];
    let what = "\"fixed\", \"sine\", \"half_sine\", \"versine\" or \"record\"";
    let kind = s.required("kind", what, |s, k| s.choice(k, &kinds));
    let Some(kind) = kind else {
        s.finish();
        return None;
    };
    let base = match kind {
        0 => Some(Excitation::Fixed),
        1 => {
            let amplitude = s.required("amplitude_m", "Z, m", Section::not_negative);
            let omega = angular_frequency(s);
            let phase_rad = s.number("phase_rad").map_or(0.0, |n| n.value);
            match (amplitude, omega) {
                (Some(amplitude), Some(angular_frequency_rad_per_s)) => {
                    Some(Excitation::Sine { amplitude_m: amplitude.value, angular_frequency_rad_per_s, phase_rad })
                }
                _ => None,
            }
        }
        4 => {
            let record = record(s, find);
            s.finish();
            return record.map(Loading::Recorded);
        }
        pulse => {
            let amplitude = s.required("amplitude_m", "Z, m", Section::number);
            let duration = s.required("duration_s", "T, s", Section::positive);
            match (amplitude.map(|n| n.value), duration.map(|n| n.value)) {
                (Some(amplitude_m), Some(duration_s)) if pulse == 2 => {
                    Some(Excitation::HalfSine { amplitude_m, duration_s })
                }
                (Some(amplitude_m), Some(duration_s)) => Some(Excitation::Versine { amplitude_m, duration_s }),
                _ => None,
            }
        }
    };
    s.finish();
    base.map(Loading::Closed)
}

/// The keys of a record, of a case as of a campaign; its file is found by `find`. Does not finish the table.
pub(crate) fn record(s: &Section, find: &dyn Fn(&str) -> std::path::PathBuf) -> Option<Record> {
    let file = s.required("file", "the record: a CSV or AT2 file, relative to this one", Section::text);
    let quantities = [Quantity::Acceleration, Quantity::Displacement];
    let quantity = s.choice("quantity", &["acceleration", "displacement"]).map(|index| quantities[index]);
    let names = |quantity| units(quantity).iter().map(|(name, _)| *name).collect::<Vec<_>>();
    let allowed = match quantity {
        Some(quantity) => names(quantity),
        None => quantities.into_iter().flat_map(names).collect(),
    };
    let unit_si = s.choice("unit", &allowed).and_then(|index| {
        quantities.into_iter().flat_map(|q| units(q)).find(|(name, _)| *name == allowed[index]).map(|(_, si)| *si)
    });
    let scale = s.number_if("scale", |v| v != 0.0, "a number other than 0").map(|n| n.value);
    let time_step_s = s.positive("time_step_s").map(|n| n.value);
    let column = which(s, "column");
    let time_column = which(s, "time_column");
    let file = file?;
    let path = find(&file.value);
    // Other problems of this table are answered first: the file is read by what it says.
    if !s.source().is_clean() {
        return None;
    }
    let spec = Spec { quantity, unit_si, scale, time_step_s, column, time_column };
    match read(&path, &spec) {
        Ok(record) => Some(record),
        Err(RecordError(message)) => {
            let mut lines = message.lines();
            let first = lines.next().unwrap_or_default();
            s.source().report(Problem {
                title: format!("`{}` = {:?} cannot be used", s.full("file"), file.value),
                span: file.span,
                allowed: first.into(),
                help: lines.next().map(|line| line.trim().into()),
            });
            None
        }
    }
}

/// A column by place or name.
fn which(s: &Section, key: &'static str) -> Option<Which> {
    if s.is_text(key) {
        return s.text(key).map(|t| Which::Name(t.value));
    }
    let place = s.number_if(key, |v| v >= 1.0 && v.fract() == 0.0 && v < 1e6, "a place from 1 up, or a name in quotes");
    place.map(|n| Which::Place(n.value as usize))
}

/// `force`: on the structure, over a fixed base.
pub(super) fn force(s: &Section) -> Option<Excitation> {
    let kinds = ["sine", "half_sine"];
    let kind = s.required("kind", "\"sine\" or \"half_sine\"", |s, k| s.choice(k, &kinds));
    let force = match kind {
        None => None,
        Some(0) => {
            let amplitude = s.required("amplitude_n", "P, N", Section::not_negative);
            let omega = angular_frequency(s);
            let phase_rad = s.number("phase_rad").map_or(0.0, |n| n.value);
            amplitude.zip(omega).map(|(amplitude, angular_frequency_rad_per_s)| Excitation::ForceSine {
                amplitude_n: amplitude.value,
                angular_frequency_rad_per_s,
                phase_rad,
            })
        }
        Some(_) => {
            let amplitude = s.required("amplitude_n", "P, N", Section::number);
            let duration = s.required("duration_s", "T, s", Section::positive);
            amplitude.zip(duration).map(|(amplitude, duration)| Excitation::ForceHalfSine {
                amplitude_n: amplitude.value,
                duration_s: duration.value,
            })
        }
    };
    s.finish();
    force
}

fn angular_frequency(s: &Section) -> Option<f64> {
    match s.either(["angular_frequency_rad_per_s", "frequency_hz"], Section::positive)? {
        (0, omega) => Some(omega.value),
        (_, frequency) => Some(TAU * frequency.value),
    }
}

/// `initial`: a structure that is not spoken of starts at 0, on a record where the base starts; a second mass starts
/// with the structure, in the middle of its cavity.
pub(super) fn initial(s: Option<&Section>, base_start_m: f64) -> Initial {
    let or = |key: &'static str, absent: f64| s.and_then(|s| s.number(key)).map_or(absent, |n| n.value);
    let (x_m, v_m_per_s) = (or("x_m", base_start_m), or("v_m_per_s", 0.0));
    let initial = Initial { x_m, v_m_per_s, y_m: or("y_m", x_m), u_m_per_s: or("u_m_per_s", v_m_per_s) };
    if let Some(s) = s {
        s.finish();
    }
    initial
}

/// `run`; a record gives its length when none is asked for.
pub(super) fn run(s: &Section, record_s: Option<f64>) -> Option<RunSpec> {
    let duration = match record_s {
        Some(length_s) if !s.has_own("duration_s") => {
            s.positive("duration_s").map_or(Some(length_s), |n| Some(n.value))
        }
        _ => s.required("duration_s", "length of the run, s", Section::positive).map(|n| n.value),
    };
    let times = s.numbers("sample_times_s").unwrap_or_default();
    let cycle = s.positive("cycle_s");
    let whole =
        |s: &Section, k| s.number_if(k, |v| v >= 0.0 && v.fract() == 0.0 && v < 9e15, "a whole number, 0 or greater");
    let steady = whole(s, "steady_from_cycle");
    s.finish();
    let duration_s = duration?;
    for (i, time) in times.iter().enumerate() {
        let early = i > 0 && time.value < times[i - 1].value;
        if early || !(0.0..=duration_s * (1.0 + 1e-12)).contains(&time.value) {
            let allowed = format!("must be in rising order, from 0 to duration_s = {duration_s}");
            s.refuse("sample_times_s", &time.span, allowed, None);
            return None;
        }
    }
    if let Some(first) = &steady {
        let Some(cycle) = cycle.as_ref() else {
            s.refuse(
                "steady_from_cycle",
                &first.span,
                "without `cycle_s` there are no cycles to count",
                Some("give `cycle_s`, or leave out `steady_from_cycle`".into()),
            );
            return None;
        };
        if (first.value + 1.0) * cycle.value > duration_s * (1.0 + 1e-12) {
            let cycles = (duration_s / cycle.value * (1.0 + 1e-12)).floor();
            let allowed = format!("no whole cycle is left: the run has {cycles}, the first of which is 0");
            let help = Some("make `duration_s` longer, or `steady_from_cycle` smaller".into());
            s.refuse("steady_from_cycle", &first.span, allowed, help);
            return None;
        }
    }
    Some(RunSpec {
        duration_s,
        sample_times_s: times.iter().map(|n| n.value).collect(),
        cycle_s: cycle.map(|n| n.value),
        steady_from_cycle: steady.map(|n| n.value as u64),
    })
}
