//! Measured signals of other programs' files: what is in a file, and one signal of it.
//!
//! The kind of a file follows from its content, not from its name. A quantity or a unit that the content does not state stays
//! unknown; it is never guessed.

pub mod at2;
mod columns;
mod complex;
mod cosmos;
mod csmip;
mod delimited;
mod even;
mod mat;
pub mod mode_shapes;
pub(crate) mod number;
pub mod overview;
mod parquet;
mod selector;
mod stated;
mod tone;
mod uff;
mod uff_dataset_58;
pub mod unit;
mod wav;

use std::io::Read;
use std::path::Path;

use crate::failure::Failure;
use crate::input::{regular, without_panic};
pub use delimited::Dialect;
pub(crate) use delimited::SAMPLE_BYTES;
pub use even::EvenSignal;
pub use selector::Selector;
pub use stated::{Calibration, SensorSensitivity, StatedSignal, UnknownQuantity};
pub use tone::Tone;
use unit::{Ratio, Unit, UnitKind};

/// Size limit of a file that is read whole: an hour of sound is smaller.
const MAX_BYTES: u64 = 2 << 30;

/// Kinds of files, for messages.
pub const KINDS: &str =
    "CSV, UFF/UNV (datasets 58, 58b, 151, 164), PEER AT2, CSMIP V2, COSMOS V1/V2, WAV, MATLAB 5 and 7.3, HDF5, Parquet";

/// Kind of a table of text.
pub const TABLE: &str = "CSV table";

/// Kind of a strong-motion record with acceleration, velocity and displacement.
pub const STRONG_MOTION: &str = "strong-motion record";

/// Functions that files name.
pub const FREQUENCY_RESPONSE: &str = "frequency response";
/// A frequency response of two motions.
pub const TRANSMISSIBILITY: &str = "transmissibility";
/// γ² of a frequency response.
pub const COHERENCE: &str = "coherence";

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// Its kind, for people.
    pub kind: &'static str,
    /// Its signals, in its order.
    pub signals: Vec<Signal>,
    /// What else it says, and what was left out and why.
    pub remarks: Vec<String>,
}

/// Values over time or frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Its name in the file.
    pub name: String,
    /// Quantity, and SI units per unit of the values; `None` if the file does not state a known unit.
    pub unit: Option<Unit>,
    /// The unit as the file writes it; empty if it writes none.
    pub unit_text: String,
    /// Places of the values.
    pub axis: SignalAxis,
    /// The values as the file has them, in its unit; the real part of a complex signal.
    pub values: Vec<f64>,
    /// The imaginary part of a complex signal.
    pub imaginary: Option<Vec<f64>>,
    /// What the file calls the function: `frequency response`, `cross spectrum`, `coherence` …; `None` if it does not say.
    pub function: Option<&'static str>,
    /// What a user must know of this signal, for example that the file ends before its values do.
    pub remark: Option<String>,
}

/// The axis of a signal.
#[derive(Clone, Debug, PartialEq)]
pub enum SignalAxis {
    /// Evenly spaced times, s.
    Time {
        /// First time, s.
        start_s: f64,
        /// Time step, s; greater than 0.
        step_s: f64,
    },
    /// Times as the file has them, s: not evenly spaced.
    Times(Vec<f64>),
    /// Evenly spaced frequencies, Hz.
    Frequency {
        /// First frequency, Hz.
        start_hz: f64,
        /// Frequency step, Hz.
        step_hz: f64,
    },
    /// Frequencies as the file has them, Hz.
    Frequencies(Vec<f64>),
    /// Something else, or unknown, and why: the values are counted.
    Unknown(String),
}

impl SignalAxis {
    /// Evenly spaced where the times of a table are so within what their printed decimals allow, else as they are.
    fn of_times(times_s: Vec<f64>) -> Self {
        match even_step(&times_s) {
            Some(step_s) => Self::Time { start_s: times_s[0], step_s },
            None => Self::Times(times_s),
        }
    }

    /// Place `n` of the axis, in its SI unit; the number from 1 where it has none.
    #[must_use]
    pub fn at(&self, n: usize) -> f64 {
        match self {
            Self::Time { start_s: start, step_s: step } | Self::Frequency { start_hz: start, step_hz: step } => {
                start + n as f64 * step
            }
            Self::Times(places) | Self::Frequencies(places) => places[n],
            Self::Unknown(_) => (n + 1) as f64,
        }
    }

    /// Whether the values are over time.
    #[must_use]
    pub fn is_time(&self) -> bool {
        matches!(self, Self::Time { .. } | Self::Times(_))
    }
}

/// Allowed deviation of a time step from the mean one, as a share of it.
const UNEVEN: f64 = 0.1;
/// Allowed deviation of a time from even spacing, as a share of a step.
const OFF_GRID: f64 = 0.25;

/// The mean step of times that are evenly spaced, as far as printed decimals allow.
#[must_use]
pub fn even_step(times_s: &[f64]) -> Option<f64> {
    let [first, .., last] = times_s else { return None };
    let step_s = (last - first) / (times_s.len() - 1) as f64;
    let is_even = |n: usize| {
        ((times_s[n] - times_s[n - 1]) / step_s - 1.0).abs() <= UNEVEN
            && ((times_s[n] - first) / step_s - n as f64).abs() <= OFF_GRID
    };
    (step_s > 0.0 && (1..times_s.len()).all(is_even)).then_some(step_s)
}

impl Signal {
    /// A real signal without a remark.
    fn new(name: impl Into<String>, unit_text: impl Into<String>, axis: SignalAxis, values: Vec<f64>) -> Self {
        let unit_text = unit_text.into();
        let unit = Unit::of(&unit_text);
        Self { name: name.into(), unit, unit_text, axis, values, imaginary: None, function: None, remark: None }
    }

    /// The quantity of the values, if the file states a known unit.
    #[must_use]
    pub fn kind(&self) -> Option<UnitKind> {
        self.unit.map(|unit| unit.kind)
    }

    /// The quantities of a frequency response, if the file states known units.
    #[must_use]
    pub fn ratio(&self) -> Option<Ratio> {
        Ratio::of(&self.unit_text)
    }
}

/// Reads all signals of a file.
///
/// # Errors
/// Names the file, the line or byte, what was found there, and what is accepted.
pub fn read(path: &Path) -> Result<Contents, Failure> {
    let file = path.display();
    let cannot = |error: std::io::Error| Failure::Input(format!("cannot read {file}: {error}"));
    let mut bytes = Vec::new();
    regular::open(path).and_then(|open| open.take(MAX_BYTES + 1).read_to_end(&mut bytes)).map_err(cannot)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Failure::Input(format!(
            "{file}: it holds more than the {} GiB that are read: cut it",
            MAX_BYTES >> 30
        )));
    }
    parse(&bytes).map_err(|why| Failure::Input(format!("{file}: {why}")))
}

/// Kind of a file by its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FileFormat {
    Empty,
    Utf16,
    Wav,
    Parquet,
    Hdf5,
    Mat,
    Uff,
    Csmip,
    Cosmos,
    At2,
    Table,
    Unknown,
}

impl FileFormat {
    /// The kind, by the beginning of a file.
    fn of(bytes: &[u8]) -> Self {
        let text = || String::from_utf8_lossy(bytes);
        match bytes {
            [] => Self::Empty,
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Self::Utf16,
            _ if bytes.starts_with(b"RIFF") || bytes.starts_with(b"RF64") => Self::Wav,
            _ if bytes.starts_with(b"PAR1") => Self::Parquet,
            _ if mat::is_hdf5(bytes) => Self::Hdf5,
            _ if bytes.starts_with(b"MATLAB 5.0") => Self::Mat,
            _ if uff::is_one(bytes) => Self::Uff,
            _ if bytes.contains(&0) => Self::Unknown,
            _ if csmip::is_one(&text()) => Self::Csmip,
            _ if cosmos::is_one(&text()) => Self::Cosmos,
            _ if at2::is_one(&text()) => Self::At2,
            _ => Self::Table,
        }
    }
}

/// Parses the bytes of a file.
///
/// # Errors
/// Why they cannot be read, without the file's name.
pub fn parse(bytes: &[u8]) -> Result<Contents, String> {
    let text = || String::from_utf8_lossy(bytes);
    let damaged = |said: String| Err(format!("it is damaged: {said}\n  copy or export it again"));
    match FileFormat::of(bytes) {
        FileFormat::Empty => Err("it is empty".into()),
        FileFormat::Utf16 => Err("it is text in UTF-16: save it as UTF-8 (in Excel: \"CSV UTF-8\")".into()),
        FileFormat::Wav => wav::parse(bytes),
        FileFormat::Parquet => without_panic(|| parquet::parse(bytes)).unwrap_or_else(damaged),
        FileFormat::Hdf5 => without_panic(|| mat::parse_hdf5(bytes)).unwrap_or_else(damaged),
        FileFormat::Mat => mat::parse(bytes),
        FileFormat::Uff => uff::parse(bytes),
        FileFormat::Csmip => csmip::parse(&text()),
        FileFormat::Cosmos => cosmos::parse(&text()),
        FileFormat::At2 => at2::parse(&text()),
        FileFormat::Table => delimited::parse(&text()),
        FileFormat::Unknown => Err(format!("this is a binary file of an unknown kind\n  known are {KINDS}")),
    }
}

/// Whether bytes are text that may need a case to say what it is: a table, or a PEER record, whose header a case may correct.
#[must_use]
pub fn is_plain_table(bytes: &[u8]) -> bool {
    matches!(FileFormat::of(bytes), FileFormat::Empty | FileFormat::Table | FileFormat::At2)
}
