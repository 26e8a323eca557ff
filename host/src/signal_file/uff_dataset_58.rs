//! Dataset 58 of universal files: a function at a degree of freedom, as text or binary (58b).

use super::number::fortran;
use super::uff::{line, stated, text as plain};
use super::unit::Unit;
use super::{COHERENCE, FREQUENCY_RESPONSE, Signal, SignalAxis, TRANSMISSIBILITY};

/// Lines of its header.
const HEADER_LINES: usize = 11;

/// Names of the function types; empty for those that do not say what the values are.
const FUNCTIONS: [&str; 13] = [
    "",
    "",
    "auto spectrum",
    "cross spectrum",
    FREQUENCY_RESPONSE,
    TRANSMISSIBILITY,
    COHERENCE,
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density",
    "spectrum",
];

/// What the header says.
struct Header {
    name: String,
    remark: Vec<String>,
    function: u32,
    is_double: bool,
    is_complex: bool,
    count: usize,
    is_even: bool,
    start: f64,
    step: f64,
    abscissa: AxisDescription,
    ordinate: AxisDescription,
    denominator: AxisDescription,
}

/// A record of an axis: number of its data type, label, unit.
struct AxisDescription {
    kind: u32,
    label: Option<String>,
    unit: Option<String>,
}

/// Fields of a header line of fixed columns that many programs do not keep to: words, and labels by their place.
fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

fn field<T: std::str::FromStr>(words: &[&str], n: usize, record: usize, what: &str) -> Result<T, String> {
    let word = words.get(n).copied().unwrap_or_default();
    word.replace(['d', 'D'], "e").parse().map_err(|_| format!("record {record}: {what} is {word:?}"))
}

impl AxisDescription {
    fn of(line: &str) -> Self {
        let kind = words(line).first().and_then(|word| word.parse().ok()).unwrap_or(0);
        // I10, 3I5, then two labels of 20 characters, each after a blank.
        let part = |from: usize, to: usize| {
            let label: String = line.chars().skip(from).take(to - from).collect();
            stated(label.trim().into())
        };
        Self { kind, label: part(26, 46), unit: part(47, 67) }
    }

    /// The quantity that its data type means.
    fn meaning(&self) -> Option<&'static str> {
        Some(match self.kind {
            8 => "displacement",
            9 => "reaction force",
            11 => "velocity",
            12 => "acceleration",
            13 => "excitation force",
            15 | 21 => "pressure",
            _ => return None,
        })
    }
}

impl Header {
    fn of(lines: &[String]) -> Result<Self, String> {
        if lines.len() < HEADER_LINES {
            return Err(format!("its header has {} lines of {HEADER_LINES}: the file is cut short", lines.len()));
        }
        let location = words(&lines[5]);
        let form = words(&lines[6]);
        let kind: u32 = field(&form, 0, 7, "the data type")?;
        let (is_double, is_complex) = match kind {
            2 => (false, false),
            4 => (true, false),
            5 => (false, true),
            6 => (true, true),
            other => return Err(format!("record 7: the data type {other} is not 2, 4, 5 or 6")),
        };
        let is_even = field::<u32>(&form, 2, 7, "the spacing")? != 0;
        let step: f64 = field(&form, 4, 7, "the increment")?;
        if is_even && !(step.is_finite() && step > 0.0) {
            return Err(format!("record 7: the increment {step} is not greater than 0"));
        }
        let (abscissa, ordinate) = (AxisDescription::of(&lines[7]), AxisDescription::of(&lines[8]));
        let first = stated(lines[0].trim().into());
        let name = ordinate.label.clone().or_else(|| first.clone()).unwrap_or_else(|| "function".into());
        let remark = first.filter(|first| *first != name).into_iter().collect();
        Ok(Self {
            name,
            remark,
            function: field(&location, 0, 6, "the function type")?,
            is_double,
            is_complex,
            count: field(&form, 1, 7, "the number of values")?,
            is_even,
            start: field(&form, 3, 7, "the minimum")?,
            step,
            abscissa,
            ordinate,
            denominator: AxisDescription::of(&lines[9]),
        })
    }

    /// Numbers of a value.
    fn width(&self) -> usize {
        usize::from(!self.is_even) + 1 + usize::from(self.is_complex)
    }

    /// The signal of these numbers.
    fn signal(mut self, numbers: &[f64]) -> Result<Signal, String> {
        let width = self.width();
        let count = (numbers.len() / width).min(self.count);
        if count == 0 {
            return Err("it has no values".into());
        }
        if count < self.count {
            self.remark.push(format!("{count} of {} values: the file is cut short", self.count));
        }
        let values: Vec<&[f64]> = numbers.chunks_exact(width).take(count).collect();
        let at = usize::from(!self.is_even);
        let places = || values.iter().map(|value| value[0]).collect::<Vec<f64>>();
        let axis = match (self.abscissa.kind, self.is_even) {
            (17, true) => SignalAxis::Time { start_s: self.start, step_s: self.step },
            (17, false) => rising(places()).map(SignalAxis::of_times)?,
            (18, true) => SignalAxis::Frequency { start_hz: self.start, step_hz: self.step },
            (18, false) => SignalAxis::Frequencies(rising(places())?),
            (other, _) => {
                SignalAxis::Unknown(format!("its abscissa has the data type {other}, neither time nor frequency"))
            }
        };
        if let Some(unit) = self.abscissa.unit.as_deref()
            && Unit::of(unit).is_some_and(|unit| unit.si != 1.0)
        {
            return Err(format!("record 8: the unit of the abscissa is {unit:?}; s and Hz are read"));
        }
        let unit = self.ordinate.unit.clone().unwrap_or_default();
        let per = self.denominator.unit.as_ref().map_or(String::new(), |unit| format!("/{unit}"));
        let mut signal = Signal::new(
            self.name.clone(),
            format!("{unit}{per}"),
            axis,
            values.iter().map(|value| value[at]).collect(),
        );
        if self.is_complex {
            signal.imaginary = Some(values.iter().map(|value| value[at + 1]).collect());
        }
        let function = FUNCTIONS.get(self.function as usize).copied().unwrap_or_default();
        signal.function = Some(function).filter(|function| !function.is_empty());
        let said = [function, self.ordinate.meaning().unwrap_or_default()];
        self.remark.extend(said.into_iter().filter(|word| !word.is_empty()).map(String::from));
        signal.remark = (!self.remark.is_empty()).then(|| self.remark.join("; "));
        Ok(signal)
    }
}

fn rising(places: Vec<f64>) -> Result<Vec<f64>, String> {
    match places.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(n) => {
            Err(format!("value {}: the abscissa {} is not beyond the one before, {}", n + 2, places[n + 1], places[n]))
        }
        None => Ok(places),
    }
}

/// The lines of a header from `at` on, and where the values begin.
fn header(bytes: &[u8], mut at: usize) -> (Vec<String>, usize) {
    let mut lines = Vec::new();
    while lines.len() < HEADER_LINES && at < bytes.len() {
        let (one, next) = line(bytes, at);
        // Labels keep their places: only the end is trimmed.
        let decoded =
            str::from_utf8(one).map_or_else(|_| one.iter().map(|byte| char::from(*byte)).collect(), String::from);
        lines.push(decoded);
        at = next;
    }
    (lines, at)
}

/// A dataset of text, without its delimiters.
pub(super) fn text(bytes: &[u8]) -> Result<Signal, String> {
    let (lines, mut at) = header(bytes, 0);
    let header = Header::of(&lines)?;
    let mut numbers = Vec::new();
    let mut row = HEADER_LINES;
    while at < bytes.len() {
        let (one, next) = line(bytes, at);
        row += 1;
        let before = numbers.len();
        if let Err(why) = fortran(&plain(one), 0, &mut numbers) {
            // A number that the end of the file cuts is no number.
            if line(bytes, next).0.is_empty() && next >= bytes.len() && numbers.len() < header.count * header.width() {
                numbers.truncate(numbers.len().max(before));
                break;
            }
            return Err(format!("line {row} of it, {why}"));
        }
        at = next;
    }
    header.signal(&numbers)
}

/// A binary dataset whose header begins at `at`; gives where it ends.
pub(super) fn binary(first: &[u8], bytes: &[u8], at: usize) -> Result<(Signal, usize), String> {
    let first = plain(first);
    let form = words(&first);
    let order: u32 = field(&form, 1, 1, "the byte order")?;
    let float: u32 = field(&form, 2, 1, "the format of its numbers")?;
    let length: usize = field(&form, 4, 1, "the number of bytes")?;
    if !matches!(order, 1 | 2) {
        return Err(format!("record 1: the byte order {order} is not 1 (little endian) or 2 (big endian)"));
    }
    if float != 2 {
        return Err(format!("record 1: the format {float} of its numbers is not 2 (IEEE 754)"));
    }
    let (lines, at) = header(bytes, at);
    let header = Header::of(&lines)?;
    let present = &bytes[at..bytes.len().min(at.saturating_add(length))];
    let number = |part: &[u8]| -> f64 {
        let mut own = [0; 8];
        own[..part.len()].copy_from_slice(part);
        if order == 2 {
            own[..part.len()].reverse();
        }
        if part.len() == 8 {
            f64::from_le_bytes(own)
        } else {
            f64::from(f32::from_le_bytes([own[0], own[1], own[2], own[3]]))
        }
    };
    let value = if header.is_double { 8 } else { 4 };
    // The abscissa is of single precision, whatever the ordinate is; some programs write it in double precision.
    let ordinates = value * (1 + usize::from(header.is_complex));
    let is_wide = header.is_even || header.count.saturating_mul(value + ordinates) == length;
    let place = if is_wide { value } else { 4 };
    let mut numbers = Vec::new();
    let record = ordinates + if header.is_even { 0 } else { place };
    for one in present.chunks_exact(record) {
        let (abscissa, rest) = one.split_at(one.len() - ordinates);
        numbers.extend((!abscissa.is_empty()).then(|| number(abscissa)));
        numbers.extend(rest.chunks_exact(value).map(number));
    }
    if let Some(n) = numbers.iter().position(|number| !number.is_finite()) {
        return Err(format!("number {} of it is not finite", n + 1));
    }
    let mut end = at + present.len();
    // A line end after the numbers belongs to them.
    while bytes.get(end).is_some_and(|byte| matches!(byte, b'\r' | b'\n')) {
        end += 1;
    }
    Ok((header.signal(&numbers)?, end))
}
