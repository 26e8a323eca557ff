//! Reads recorded motions: CSV tables, AT2 files of the PEER ground-motion data base, and the signals of other files ([`signal_file`]).
//!
//! [`Spec`] has the properties that a file does not state (quantity, unit, column). Errors name file, line, value and what is
//! allowed.

use std::fs;
use std::path::Path;

use super::record::{Record, RecordOrigin, RecordQuantity};
use super::units::{ToSi, unit_list};
use crate::failure::Failure;
use crate::input::key::KeyUnit;
use crate::input::{Files, near};
use crate::signal_file::at2::at2;
use crate::signal_file::number::{finite, is_name};
use crate::signal_file::unit::{self, UnitKind, of_column};
use crate::signal_file::{self, Selector, Signal, SignalAxis, StatedSignal, UnknownQuantity};

/// Allowed deviation of a time step from the mean one, as a share: times printed with few decimals deviate.
const UNEVEN: f64 = 0.1;

/// Allowed deviation of a time from even spacing, as a share of a step.
const OFF_GRID: f64 = 0.25;

/// Largest change of a record by resampling, of its RMS.
const MAX_RESAMPLING: f64 = 0.01;

/// Which column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Which {
    /// By its place, from 1.
    Place(usize),
    /// By its name in the header.
    Name(String),
}

/// Properties of a record that its file does not state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spec {
    /// Its quantity; an AT2 or V2 file states it.
    pub quantity: Option<RecordQuantity>,
    /// Unit of the values, which an AT2 or V2 file states, and the name of a column may end in (`acceleration_g`), or the sensor's calibration.
    pub stated: StatedSignal,
    /// Factor on every value.
    pub scale: Option<f64>,
    /// Time step, s; else there is a column of times.
    pub time_step_s: Option<f64>,
    /// The values' column; else the first that is not the times'.
    pub column: Option<Which>,
    /// The times' column; else the first.
    pub time_column: Option<Which>,
}

/// Reads a record, unless it is among the files that were read already.
///
/// # Errors
/// Names file, line and value; for a missing file, those that look like it.
pub fn read(path: &Path, spec: &Spec, files: &Files) -> Result<Record, Failure> {
    let selected = Selector::of(path);
    files.parsed(&selected.path, &format!("{spec:?} {:?}", selected.which), |bytes| parse(&selected, spec, bytes))
}

fn parse(selected: &Selector, spec: &Spec, bytes: std::io::Result<Vec<u8>>) -> Result<Record, Failure> {
    let path = selected.path.as_path();
    let bytes = bytes.map_err(|e| Failure::Input(format!("cannot read {}: {e}{}", path.display(), beside(path))))?;
    if selected.which.is_some() || spec.stated.is_of_sensor() || !signal_file::is_plain_table(&bytes) {
        return of_signal(selected, spec, &bytes);
    }
    let text = String::from_utf8_lossy(&bytes);
    let is_at2 = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("at2")) || text.starts_with("PEER ");
    let answer = |message: String| Failure::Input(format!("{}: {message}", path.display()));
    let scale = spec.scale.unwrap_or(1.0);
    let (quantity, step_s, samples) = if is_at2 {
        if spec.quantity.is_some_and(|q| q != RecordQuantity::Acceleration) {
            return Err(answer("an AT2 file holds accelerations; leave out `quantity`".into()));
        }
        let to_si = |unit_si, text: &str, value| {
            ToSi { quantity: RecordQuantity::Acceleration, unit_si, scale }.value(text, value)
        };
        let at2 = at2(&text, spec.stated.unit.map(|unit| unit.si), to_si).map_err(answer)?;
        (RecordQuantity::Acceleration, spec.time_step_s.unwrap_or(at2.step_s), at2.values)
    } else {
        let Some(quantity) = spec.quantity else { return of_signal(selected, spec, &bytes) };
        match table(&text, spec, quantity, scale) {
            Ok((step_s, samples)) => (quantity, step_s, samples),
            // Another program's table may state quantity and unit itself, and be written in another way.
            Err(why) => return of_signal(selected, spec, &bytes).map_err(|_| answer(why)),
        }
    };
    if samples.len() < 2 {
        return Err(answer(format!("{} samples; a motion has at least 2", samples.len())));
    }
    if let Some(refusal) = KeyUnit::of("time_step_s").and_then(|unit| unit.refusal(step_s)) {
        return Err(answer(format!("a time step of {step_s:e} s is not allowed: {refusal}")));
    }
    Ok(Record { origin: RecordOrigin::File(path.to_path_buf()), quantity, step_s, samples, resampling: None })
}

/// The record of a signal of another program's file, which states quantity, unit and time step itself.
fn of_signal(selected: &Selector, spec: &Spec, bytes: &[u8]) -> Result<Record, Failure> {
    let file = selected.path.display();
    let refuse = |why: String| Failure::Input(format!("{file}: {why}"));
    let contents = signal_file::parse(bytes).map_err(refuse)?;
    let kind = contents.kind;
    let by_column = spec.column.as_ref().map(|which| match which {
        Which::Place(place) => place.to_string(),
        Which::Name(name) => name.clone(),
    });
    // The velocity and the displacement of such a record were computed from its acceleration.
    let usual = (kind == signal_file::STRONG_MOTION).then(|| "acceleration".to_string());
    let selected = Selector { path: selected.path.clone(), which: selected.which.clone().or(by_column).or(usual) };
    let signal = selected.choose(contents)?;
    let name = &signal.name;
    let unit = signal.measured(&spec.stated).map_err(|why| match (why, spec.quantity) {
        (UnknownQuantity::Contradiction(why), _) => refuse(why),
        (UnknownQuantity::SensitivityMissing, _) => {
            refuse(format!("{name:?} is a voltage: give the sensor's sensitivity = \"100 mV/g\""))
        }
        (UnknownQuantity::UnitMissing, Some(quantity)) => {
            refuse(format!("the unit of {name:?} is not known: give unit = {}", unit_list(quantity)))
        }
        (UnknownQuantity::UnitMissing, None) => refuse(format!(
            "what the values of {name:?} are is not known: give quantity = \"acceleration\" or \"displacement\""
        )),
    })?;
    let quantity = match unit.kind {
        UnitKind::Acceleration => RecordQuantity::Acceleration,
        UnitKind::Displacement => RecordQuantity::Displacement,
        other => {
            return Err(refuse(format!(
                "{name:?} is a {}: a record is an acceleration or a displacement",
                other.text()
            )));
        }
    };
    if spec.quantity.is_some_and(|given| given != quantity) {
        return Err(refuse(format!("{name:?} has the unit {:?}; leave out `quantity`", signal.unit_text)));
    }
    if spec.time_column.is_some() {
        return Err(refuse("`time_column` is for a CSV file whose columns are chosen by `column`".into()));
    }
    if signal.imaginary.is_some() {
        return Err(refuse(format!("{name:?} is complex: a record has real values")));
    }
    let given =
        spec.time_step_s.map(|step_s| Signal { axis: SignalAxis::Time { start_s: 0.0, step_s }, ..signal.clone() });
    let even = given.as_ref().unwrap_or(&signal).evenly().map_err(|why| match signal.axis {
        SignalAxis::Unknown(_) => refuse(format!("the time step of {name:?} is not known: give `time_step_s`")),
        _ => refuse(why),
    })?;
    let rms = (even.values.iter().map(|value| value * value).sum::<f64>() / even.values.len() as f64).sqrt();
    if even.rms_error > MAX_RESAMPLING * rms {
        return Err(refuse(format!(
            "{name:?}: {}; to resample it would change it by {:.1} % (RMS, estimated), at most {} % are allowed: record at a higher rate, or \
             give `time_step_s`",
            signal.remark.as_deref().unwrap_or("the times are uneven"),
            100.0 * even.rms_error / rms,
            100.0 * MAX_RESAMPLING
        )));
    }
    let to_si = ToSi { quantity, unit_si: unit.si, scale: spec.scale.unwrap_or(1.0) };
    let value = |(n, value): (usize, &f64)| {
        to_si.value(&value.to_string(), *value).map_err(|why| refuse(format!("value {} of {name:?}: {why}", n + 1)))
    };
    let samples = even.values.iter().enumerate().map(value).collect::<Result<Vec<f64>, _>>()?;
    if samples.len() < 2 {
        return Err(refuse(format!("{kind}, {name:?}: {} samples; a motion has at least 2", samples.len())));
    }
    let resampling = (even.rms_error > 0.0).then(|| even.rms_error / rms);
    Ok(Record { origin: RecordOrigin::File(selected.path), quantity, step_s: even.step_s, samples, resampling })
}

/// "did you mean": files beside a missing one.
fn beside(path: &Path) -> String {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = fs::read_dir(folder) else { return format!("\n  there is no folder {}", folder.display()) };
    let names: Vec<String> = entries.flatten().map(|e| e.file_name().to_string_lossy().to_string()).collect();
    let wanted = path.file_name().unwrap_or_default().to_string_lossy().to_string();
    let found: Vec<String> = near(&wanted, names.iter().map(String::as_str))
        .into_iter()
        .map(|name| folder.join(name).display().to_string())
        .collect();
    if found.is_empty() { String::new() } else { format!("\n  did you mean {}?", found.join(" or ")) }
}

/// The rows of a table, each its line and its fields, after an optional header.
pub(crate) struct RecordRows {
    pub(crate) header: Option<Vec<String>>,
    pub(crate) rows: Vec<(u64, Vec<String>)>,
}

pub(crate) fn rows(text: &str) -> Result<RecordRows, String> {
    let sample = text.lines().find(|l| !l.trim().is_empty() && !l.starts_with('#')).unwrap_or_default();
    let delimiter = [',', ';', '\t'].into_iter().find(|d| sample.contains(*d)).unwrap_or(' ');
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter as u8)
        .comment(Some(b'#'))
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let fields: Vec<String> =
            record.iter().filter(|f| delimiter != ' ' || !f.is_empty()).map(str::to_string).collect();
        if fields.iter().any(|f| !f.is_empty()) {
            rows.push((line, fields));
        }
    }
    let has_header = rows.first().is_some_and(|(_, fields)| fields.iter().all(|field| is_name(field)));
    let header = if has_header { Some(rows.remove(0).1) } else { None };
    Ok(RecordRows { header, rows })
}

impl RecordRows {
    /// The place of a column, from 0.
    fn place(&self, which: &Which, key: &str, width: usize) -> Result<usize, String> {
        match (which, &self.header) {
            (Which::Place(place), _) if (1..=width).contains(place) => Ok(place - 1),
            (Which::Place(place), _) => Err(format!("`{key}` = {place} is not allowed: the columns are 1 to {width}")),
            (Which::Name(name), Some(header)) => header.iter().position(|h| h == name).ok_or_else(|| {
                let hint = near(name, header.iter().map(String::as_str));
                let hint = hint.first().map_or(String::new(), |n| format!("; did you mean {n:?}?"));
                format!("`{key}` = {name:?} is not allowed: the columns are {}{hint}", header.join(", "))
            }),
            (Which::Name(name), None) => {
                Err(format!("`{key}` = {name:?} is not allowed: the file has no header; give the place, 1 to {width}"))
            }
        }
    }
}

/// Characters of the columns' names in a message.
const MAX_OF_NAMES: usize = 200;

/// The time step, s, and the values of a table in SI units. Where `spec` has no unit, the name of the values' column has to end in it.
fn table(text: &str, spec: &Spec, quantity: RecordQuantity, scale: f64) -> Result<(f64, Vec<f64>), String> {
    let rows = rows(text)?;
    if rows.rows.is_empty() {
        return Err("it holds no row of numbers".into());
    }
    let width = rows.rows.first().map_or(0, |(_, fields)| fields.len());
    let time = match (&spec.time_column, spec.time_step_s) {
        (Some(_), Some(_)) => return Err("`time_step_s` and `time_column` are both given: leave out one".into()),
        (Some(which), None) => Some(rows.place(which, "time_column", width)?),
        (None, Some(_)) => None,
        (None, None) if width < 2 => {
            return Err("there is one column and no time in it: give `time_step_s`".into());
        }
        (None, None) => Some(0),
    };
    let value = match &spec.column {
        Some(which) => rows.place(which, "column", width)?,
        None => {
            let others: Vec<usize> = (0..width).filter(|c| Some(*c) != time).collect();
            let [only] = others[..] else {
                let names = rows.header.as_ref().map_or(format!("1 to {width}"), |h| h.join(", "));
                let names: String = names.escape_debug().take(MAX_OF_NAMES).collect();
                return Err(format!("there are {width} columns ({names}): say which holds the values with `column`"));
            };
            only
        }
    };
    let of_name = || {
        let (_, unit) = of_column(rows.header.as_ref()?.get(value)?);
        unit::Unit::of(&unit)
    };
    let unit = spec.stated.unit.or_else(of_name).filter(|unit| unit.kind == quantity.kind());
    let unit_si = unit
        .map(|unit| unit.si)
        .ok_or_else(|| format!("the unit of the values is not known: give unit = {}", unit_list(quantity)))?;
    let to_si = ToSi { quantity, unit_si, scale };
    let first_line = rows.rows[0].0;
    let (mut times, mut values) = (Vec::new(), Vec::new());
    for (line, fields) in &rows.rows {
        let number = |column: usize| {
            let text = fields
                .get(column)
                .ok_or_else(|| format!("line {line}: {} columns where the first row has {width}", fields.len()))?;
            finite(text).ok_or_else(|| {
                let with_point = text.replace(',', ".");
                let fix = if text.contains(',') && finite(&with_point).is_some() {
                    format!("; write the decimals after a point: {with_point}")
                } else {
                    String::new()
                };
                let fix = if fix.is_empty() && *line == first_line && rows.header.is_none() {
                    "; a header has a name in every column"
                } else {
                    &fix
                };
                format!("line {line}, column {}: {text:?} is not allowed: must be a finite number{fix}", column + 1)
            })
        };
        // A decimal comma splits a number into two columns.
        if let Some(more) = fields.get(width..).filter(|more| more.iter().any(|field| !field.is_empty())) {
            let count = width + more.len();
            return Err(format!("line {line}: {count} columns where the first row has {width}"));
        }
        if let Some(column) = time {
            let t = number(column)?;
            if let Some(last) = times.last().filter(|last| t <= **last) {
                return Err(format!("line {line}: time {t} is not allowed: must be later than the one before, {last}"));
            }
            times.push(t);
        }
        let given = number(value)?;
        let si = to_si.value(&fields[value], given);
        values.push(si.map_err(|why| format!("line {line}, column {}: {why}", value + 1))?);
    }
    let step_s = match (spec.time_step_s, times.as_slice()) {
        (Some(step_s), _) => step_s,
        (None, [first, .., last]) => {
            let step_s = (last - first) / (times.len() - 1) as f64;
            let is_uneven = |n: &usize| {
                ((times[*n] - times[n - 1]) / step_s - 1.0).abs() > UNEVEN
                    || ((times[*n] - first) / step_s - *n as f64).abs() > OFF_GRID
            };
            if let Some(n) = (1..times.len()).find(is_uneven) {
                return Err(format!(
                    "line {}: a step of {:.6e} s where the mean is {step_s:.6e} s: the samples must be evenly spaced; \
                     resample the record, or give `time_step_s`",
                    rows.rows[n].0,
                    times[n] - times[n - 1]
                ));
            }
            step_s
        }
        (None, _) => return Err("fewer than 2 samples".into()),
    };
    Ok((step_s, values))
}
