//! What is in a file, in constant memory: counts, extremes and an envelope of each signal.

use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::delimited::{DelimitedRows, Dialect, SAMPLE_BYTES, no_values};
use super::unit::{Unit, UnitKind};
use super::{FileFormat, Signal, SignalAxis, TABLE, UNEVEN};
use crate::failure::Failure;
use crate::input::regular;

/// Entries of an envelope at most.
const MAX_BUCKETS: usize = 2048;

/// An overview of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Kind of the file, for people.
    pub kind: &'static str,
    /// Its signals, in its order.
    pub signals: Vec<SignalOverview>,
    /// What else it says, and what was left out and why.
    pub remarks: Vec<String>,
}

/// An overview of a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalOverview {
    /// Its name in the file.
    pub name: String,
    /// Quantity and SI units per unit, if the file states a known unit.
    pub unit: Option<Unit>,
    /// The unit as the file writes it.
    pub unit_text: String,
    /// Its places: over time or frequency, or by number.
    pub places: OverviewAxis,
    /// Number of values.
    pub count: u64,
    /// Number of missing values.
    pub missing: u64,
    /// Whether its values are complex: the others are of their magnitude.
    pub is_complex: bool,
    /// Smallest value, in the unit of the file.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Mean value.
    pub mean: f64,
    /// Root mean square about the mean.
    pub rms: f64,
    /// Places with the smallest and the largest value in each part of the signal.
    pub envelope: Vec<Bucket>,
    /// What a user must know of this signal.
    pub remark: Option<String>,
}

/// The axis of a signal.
#[derive(Clone, Debug, PartialEq)]
pub enum OverviewAxis {
    /// Time, s.
    Time {
        /// First time, s.
        first_s: f64,
        /// Last time, s.
        last_s: f64,
        /// Mean step, s.
        step_s: f64,
        /// Whether the steps are even.
        is_even: bool,
    },
    /// Frequency, Hz.
    Frequency {
        /// First frequency, Hz.
        first_hz: f64,
        /// Last frequency, Hz.
        last_hz: f64,
    },
    /// Something else, or unknown, and why: the values are counted.
    Unknown(String),
}

/// A part of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bucket {
    /// Its first place.
    pub at: f64,
    /// Its smallest value.
    pub min: f64,
    /// Its largest value.
    pub max: f64,
}

/// Collects the overview of a signal, value after value. The parts of its envelope double when there are too many.
#[derive(Debug, Default)]
struct OverviewCollector {
    count: u64,
    missing: u64,
    mean: f64,
    squares: f64,
    buckets: Vec<Bucket>,
    per_bucket: u64,
    in_last: u64,
}

impl OverviewCollector {
    fn push(&mut self, at: f64, value: f64) {
        if value.is_nan() {
            self.missing += 1;
            return;
        }
        self.count += 1;
        let off = value - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (value - self.mean);
        self.per_bucket = self.per_bucket.max(1);
        if self.in_last == self.per_bucket || self.buckets.is_empty() {
            if self.buckets.len() == MAX_BUCKETS {
                let join = |pair: &[Bucket]| Bucket {
                    at: pair[0].at,
                    min: pair[0].min.min(pair[1].min),
                    max: pair[0].max.max(pair[1].max),
                };
                self.buckets = self.buckets.chunks_exact(2).map(join).collect();
                self.per_bucket *= 2;
            }
            self.buckets.push(Bucket { at, min: value, max: value });
            self.in_last = 0;
        }
        if let Some(last) = self.buckets.last_mut() {
            (last.min, last.max) = (last.min.min(value), last.max.max(value));
        }
        self.in_last += 1;
    }

    fn overview(self, name: String, unit_text: String, places: OverviewAxis) -> SignalOverview {
        let extreme = |pick: fn(f64, f64) -> f64, of: fn(&Bucket) -> f64| self.buckets.iter().map(of).reduce(pick);
        SignalOverview {
            name,
            unit: Unit::of(&unit_text),
            unit_text,
            places,
            count: self.count,
            missing: self.missing,
            is_complex: false,
            min: extreme(f64::min, |bucket| bucket.min).unwrap_or(f64::NAN),
            max: extreme(f64::max, |bucket| bucket.max).unwrap_or(f64::NAN),
            mean: self.mean,
            rms: (self.squares / self.count.max(1) as f64).sqrt(),
            envelope: self.buckets,
            remark: None,
        }
    }
}

/// Reads the overview of a file. A table of text may be of any size.
///
/// # Errors
/// As [`super::read`].
pub fn read(path: &Path) -> Result<Overview, Failure> {
    let file = path.display();
    let refuse = |why: String| Failure::Input(format!("{file}: {why}"));
    let cannot = |error: std::io::Error| Failure::Input(format!("cannot read {file}: {error}"));
    let mut open = regular::open(path).map_err(cannot)?;
    let mut sample = vec![0; SAMPLE_BYTES];
    let mut length = 0;
    while length < sample.len() {
        match open.read(&mut sample[length..]).map_err(cannot)? {
            0 => break,
            more => length += more,
        }
    }
    let is_whole = length < sample.len();
    sample.truncate(length);
    let text = String::from_utf8_lossy(&sample);
    let whole = || {
        let contents = super::read(path)?;
        let signals = contents.signals.into_iter().map(of_signal).collect();
        Ok(Overview { kind: contents.kind, signals, remarks: contents.remarks })
    };
    if FileFormat::of(&sample) != FileFormat::Table {
        return whole();
    }
    // A line that the sample cuts is not looked at.
    let end = if is_whole { text.len() } else { text.rfind('\n').unwrap_or(text.len()) };
    let dialect = Dialect::of(&text[..end]).map_err(refuse)?;
    if dialect.is_of_frequencies() {
        return whole();
    }
    open.rewind().map_err(cannot)?;
    table(BufReader::with_capacity(1 << 16, open), dialect).map_err(refuse)
}

fn of_signal(signal: Signal) -> SignalOverview {
    let mut collector = OverviewCollector::default();
    for (n, value) in signal.values.iter().enumerate() {
        let value = signal.imaginary.as_ref().map_or(*value, |imaginary| value.hypot(imaginary[n]));
        collector.push(signal.axis.at(n), value);
    }
    let last = signal.values.len().saturating_sub(1);
    let (first_at, last_at) = (signal.axis.at(0), signal.axis.at(last));
    let step_s = (last_at - first_at) / last.max(1) as f64;
    let places = match &signal.axis {
        SignalAxis::Time { .. } => OverviewAxis::Time { first_s: first_at, last_s: last_at, step_s, is_even: true },
        SignalAxis::Times(_) => OverviewAxis::Time { first_s: first_at, last_s: last_at, step_s, is_even: false },
        SignalAxis::Frequency { .. } | SignalAxis::Frequencies(_) => {
            OverviewAxis::Frequency { first_hz: first_at, last_hz: last_at }
        }
        SignalAxis::Unknown(why) => OverviewAxis::Unknown(why.clone()),
    };
    let unit = signal.unit;
    SignalOverview {
        unit,
        is_complex: signal.imaginary.is_some(),
        remark: signal.remark,
        ..collector.overview(signal.name, signal.unit_text, places)
    }
}

/// The overview of a table, row by row.
fn table(text: impl BufRead, dialect: Dialect) -> Result<Overview, String> {
    let time = dialect.time;
    let mut collectors: Vec<OverviewCollector> = dialect.columns.iter().map(|_| OverviewCollector::default()).collect();
    let (mut first_s, mut last_s, mut min_step_s, mut max_step_s) = (None, 0.0, f64::INFINITY, 0.0f64);
    let mut count: u64 = 0;
    let mut values = Vec::new();
    let mut rows = DelimitedRows::new(text, &dialect);
    while rows.next(&mut values)? {
        count += 1;
        let at = time.map_or(count as f64, |(column, si)| values[column] * si);
        if time.is_some() {
            if first_s.is_some() {
                (min_step_s, max_step_s) = (min_step_s.min(at - last_s), max_step_s.max(at - last_s));
            }
            first_s.get_or_insert(at);
            last_s = at;
        }
        collectors.iter_mut().zip(&values).for_each(|(collector, value)| collector.push(at, *value));
    }
    let places = match first_s {
        Some(first_s) => {
            let step_s = (last_s - first_s) / (count - 1).max(1) as f64;
            let is_even = (max_step_s - step_s).max(step_s - min_step_s) <= UNEVEN * step_s;
            OverviewAxis::Time { first_s, last_s, step_s, is_even }
        }
        None => OverviewAxis::Unknown("the file states no times with a unit".into()),
    };
    let (mut signals, mut remarks) = (Vec::new(), dialect.remarks);
    for (n, collector) in collectors.into_iter().enumerate() {
        if time.is_some_and(|(column, _)| column == n) {
            continue;
        }
        let column = &dialect.columns[n];
        if collector.count == 0 {
            remarks.push(no_values(&column.name));
            continue;
        }
        let mut own = collector.overview(column.name.clone(), column.unit_text.clone(), places.clone());
        if let OverviewAxis::Time { is_even: false, .. } = places {
            own.remark = Some(format!("steps from {min_step_s:.6} to {max_step_s:.6} s"));
        }
        signals.push(own);
    }
    Ok(Overview { kind: TABLE, signals, remarks })
}

impl SignalOverview {
    /// Commands that may use the signal, for people.
    #[must_use]
    pub fn uses(&self) -> Vec<&'static str> {
        let is_time = matches!(self.places, OverviewAxis::Time { .. });
        if self.is_complex && !is_time {
            return vec!["damprig identify response, if it is a frequency response"];
        }
        match self.unit.map(|unit| unit.kind) {
            Some(UnitKind::Acceleration) if is_time => {
                vec![
                    "damprig spectrum",
                    "base motion of a case or a playback (file)",
                    "damprig identify decay, if it is a free decay",
                ]
            }
            Some(UnitKind::Displacement) if is_time => {
                vec!["damprig identify decay, if it is a free decay", "base motion of a case or a playback (file)"]
            }
            Some(UnitKind::Velocity) if is_time => vec!["damprig identify decay, if it is a free decay"],
            Some(UnitKind::Pressure) if is_time => vec!["damprig identify sound"],
            _ => Vec::new(),
        }
    }
}
