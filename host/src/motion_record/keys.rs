//! The keys of a recorded base motion in a case or a campaign: their declaration, and reading the file that they name.

use std::path::PathBuf;

use damprig_core::control::transient::playback::MAX_SAMPLES;

use super::noise::{MIN_LINES, MIN_PER_PERIOD, Noise};
use super::read::{Spec, Which, read};
use super::record::{Record, RecordQuantity};
use super::units::{UNITS, unit_list};
use crate::input::key::DefaultValue::Number;
use crate::input::key::Need::{Default, Forbidden, Optional, Required};
use crate::input::key::Range::{Above, NotNegative, NotZero, Positive, Whole};
use crate::input::key::{KeyedQuantity, Need, Table, ValueKind, key, number, tables, word};
use crate::input::section::Given;
use crate::input::{Problem, Section, Text};
use crate::signal_file::unit::{Unit, UnitKind};
use crate::signal_file::{SensorSensitivity, StatedSignal};

/// Highest frequency of noise, Hz: the controller's tick of 1000 Hz gives its period 10 samples.
const HIGHEST_HZ: f64 = damprig_core::io::TICK_HZ as f64 / MIN_PER_PERIOD;

/// Of the keys that describe a file.
pub(crate) const OF_FILE: Need = Need::If(&base_record::NOISE, "noise", &Forbidden, &Optional);

tables! {
    "The tables of a recorded base motion."

    "A recorded base motion, or noise from a seed."
    base_record("base", "record") {
        NOISE: Optional, [key("noise", ValueKind::Table, "band-limited noise in place of a file")];
        FILE: Need::If(&NOISE, "noise", &Forbidden, &Required), [
            key("file", ValueKind::Text, "CSV, AT2, V2, UFF, MAT, HDF5 or Parquet file, relative to this file; `FILE#3` or `FILE#name` is one of several signals; or `noise`"),
        ];
        QUANTITY: OF_FILE, [word("quantity", &["acceleration", "displacement"], "quantity of the values, where the file does not state it")];
        UNIT: OF_FILE, [word("unit", &UNITS, "unit of the values, where neither the file nor the end of the column's name states it")];
        SENSITIVITY: OF_FILE, [key("sensitivity", ValueKind::Text, "of the sensor, if the values are its voltage: \"100 mV/g\", \"10.2 mV/(m/s2)\", \"2.5 V/mm\"")];
        SCALE: OF_FILE, [number("scale", NotZero, "factor on every value")];
        TIME_STEP: OF_FILE, [number("time_step_s", Positive, "time between samples; otherwise the file has a time column")];
        COLUMN: OF_FILE, [key("column", ValueKind::TextOrPlace, "column of the values; default: the only one beside the time column")];
        TIME_COLUMN: OF_FILE, [key("time_column", ValueKind::TextOrPlace, "time column; default: the first")];
    }

    "The peak of a case's noise."
    base_peak("base", "record") {
        TARGET: Need::If(&base_record::NOISE, "noise", &Required, &Forbidden), [
            number("target_peak_m", Positive, "largest |z| of the noise").usual(1e-5, 0.05),
        ];
    }

    "Noise: sines of equal amplitudes and random phases within a band, under an envelope. The same seed gives the same motion on every machine."
    noise("base.noise") {
        SEED: Default(Number(1.0)), [number("seed", Whole(0.0, u32::MAX as f64), "seed of the phases")];
        FROM: Required, [number("from_hz", Positive, "lower end of the band").usual(0.05, 25.0)];
        TO: Required, [number("to_hz", Above(0.0, HIGHEST_HZ), "upper end of the band").usual(0.5, 50.0)];
        DURATION: Required, [number("duration_s", Positive, "length, with its envelope").usual(1.0, 600.0)];
        ENVELOPE: Optional, [key("envelope", ValueKind::Table, "rise and fall at the ends; a tenth of the length each when left out")];
    }

    "Envelope of the noise."
    envelope("base.noise.envelope") {
        RISE: Required, [number("rise_s", NotNegative, "time over which the noise rises from 0")];
        FALL: Required, [number("fall_s", NotNegative, "time over which it falls to 0; with `rise_s` at most `duration_s`")];
    }
}

/// The table of a recorded base motion in a case.
pub(crate) const BASE_RECORD: Table = base_record::TABLE;
/// The table of its noise.
pub(crate) const NOISE: Table = noise::TABLE;
/// The table of the noise's envelope.
pub(crate) const ENVELOPE: Table = envelope::TABLE;

/// A base motion as a case or a campaign gives it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum GivenMotion {
    /// Of a file.
    Recorded(Record),
    /// From a seed.
    Noise(Noise),
}

/// Reads the keys of a base motion in a case or a campaign, and its file, whose path `find` gives. Does not finish the table.
pub(crate) fn read_motion(s: &Section, find: &dyn Fn(&str) -> PathBuf) -> Option<GivenMotion> {
    if s.is_given(&base_record::NOISE) {
        // The keys of a file are refused beside it.
        let _ = keys_of_file(s);
        return s.table_of(&base_record::NOISE, None).and_then(|table| read_noise(&table)).map(GivenMotion::Noise);
    }
    read_record(s, find).map(GivenMotion::Recorded)
}

/// Reads the peak of a case's noise, m.
pub(crate) fn read_peak(s: &Section) -> Option<f64> {
    s.scalar(&base_peak::TARGET)
}

fn read_noise(s: &Section) -> Option<Noise> {
    let seed = s.scalar(&noise::SEED);
    let from = s.placed(&noise::FROM);
    let to = s.placed(&noise::TO);
    let duration = s.placed(&noise::DURATION);
    let envelope = s.table_of(&noise::ENVELOPE, None).map(|table| {
        let ends = (table.scalar(&envelope::RISE), table.scalar(&envelope::FALL));
        table.finish();
        ends
    });
    s.finish();
    let (seed, from, to, duration) = (seed?, from?, to?, duration?);
    let duration_s = duration.value;
    let (rise_s, fall_s) = match envelope {
        Some((rise, fall)) => (rise?, fall?),
        None => (0.1 * duration_s, 0.1 * duration_s),
    };
    let read = Noise { seed: seed as u64, from_hz: from.value, to_hz: to.value, duration_s, rise_s, fall_s };
    if to.value <= from.value {
        s.refuse(noise::TO.name(), &to.span, format!("must be greater than from_hz = {}", from.value), None);
    } else if rise_s + fall_s > duration_s {
        let allowed =
            format!("rise_s and fall_s are {} s together: at most duration_s = {duration_s}", rise_s + fall_s);
        s.refuse(noise::ENVELOPE.name(), &s.span_of(noise::ENVELOPE.name()), allowed, None);
    } else if read.rate_hz() < MIN_PER_PERIOD * to.value {
        let longest_s = MAX_SAMPLES as f64 / (MIN_PER_PERIOD * to.value);
        let allowed = format!(
            "gives {:.1} samples in a period of to_hz = {} Hz: the controller's record buffer of 40 KiB holds {MAX_SAMPLES}, and {} are \
             needed",
            read.rate_hz() / to.value,
            to.value,
            MIN_PER_PERIOD
        );
        let help = Some(format!("write at most duration_s = {:.0}, or a lower to_hz", longest_s.floor()));
        s.refuse(noise::DURATION.name(), &duration.span, allowed, help);
    } else if read.lines().count() < MIN_LINES {
        let allowed = format!(
            "the band has {} frequencies with whole periods in duration_s; noise has at least {MIN_LINES}",
            read.lines().count()
        );
        let help = Some("widen the band or make the noise longer".into());
        s.refuse(noise::TO.name(), &to.span, allowed, help);
    } else {
        return Some(read);
    }
    None
}

/// Reads the keys that describe a file.
fn keys_of_file(s: &Section) -> (Option<Text>, Spec) {
    let file = s.text_of(&base_record::FILE);
    let quantity =
        s.word(&base_record::QUANTITY).map(|word| [RecordQuantity::Acceleration, RecordQuantity::Displacement][word]);
    let unit = s.word(&base_record::UNIT).and_then(|word| Unit::of(UNITS[word]));
    if let (Some(quantity), Some(unit)) = (quantity, unit)
        && unit.kind != quantity.kind()
        && unit.kind != UnitKind::Voltage
    {
        let allowed = format!("must be {}: the quantity is {}", unit_list(quantity), quantity.name());
        s.reject(base_record::UNIT.name(), allowed, None);
    }
    let sensitivity = s.text_of(&base_record::SENSITIVITY).and_then(|text| {
        let read = text.value.parse::<SensorSensitivity>();
        if let Err(why) = &read {
            s.reject(base_record::SENSITIVITY.name(), why.clone(), None);
        }
        read.ok()
    });
    let spec = Spec {
        quantity,
        stated: StatedSignal { unit, sensitivity, calibration: None },
        scale: s.scalar(&base_record::SCALE),
        time_step_s: s.scalar(&base_record::TIME_STEP),
        column: which(s, &base_record::COLUMN),
        time_column: which(s, &base_record::TIME_COLUMN),
    };
    (file, spec)
}

/// Reads the keys of a record and its file, whose path `find` gives.
fn read_record(s: &Section, find: &dyn Fn(&str) -> PathBuf) -> Option<Record> {
    let (file, spec) = keys_of_file(s);
    let file = file?;
    // Problems of this table are reported first: reading the file depends on its keys.
    if !s.source().is_clean() {
        return None;
    }
    match read(&find(&file.value), &spec, s.source().files()) {
        Ok(record) => Some(record),
        Err(failure) => {
            let message = failure.to_string();
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
fn which(s: &Section, quantity: &KeyedQuantity) -> Option<Which> {
    match s.given(quantity)? {
        (_, Given::Text(name)) => Some(Which::Name(name.value)),
        (_, Given::Number(place)) => Some(Which::Place(place as usize)),
        _ => None,
    }
}
