//! Tables of numbers as text: CSV with any usual delimiter, decimal commas, a byte-order mark, units in a row of their own, and lines
//! of a vendor before the header.

use std::io::{BufRead, Read};

use super::complex::{frequencies, frequency_column, has_parts, paired};
use super::even::uneven;
use super::number::{finite, is_name};
use super::unit::{Unit, UnitKind, of_column};
use super::{Contents, Signal, SignalAxis, TABLE};

/// Bytes from which the dialect of a table is determined.
pub const SAMPLE_BYTES: usize = 1 << 16;

/// Lines before the header that are passed over at most.
const MAX_PREAMBLE: usize = 100;

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DelimitedColumn {
    /// Its name without a unit; its number from 1 in a table without a header.
    pub name: String,
    /// Its unit as the file writes it; empty if it writes none.
    pub unit_text: String,
}

/// How a table is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Dialect {
    delimiter: char,
    has_decimal_comma: bool,
    /// Its columns.
    pub columns: Vec<DelimitedColumn>,
    /// The column of the times, if the file states one with its unit, and seconds per unit.
    pub time: Option<(usize, f64)>,
    /// In a table without times the column of the frequencies, if the file states one with its unit, and Hz per unit.
    pub frequency: Option<(usize, f64)>,
    /// Number of lines before the first row of numbers.
    pub lines_before: usize,
    /// What was recognised, for people.
    pub remarks: Vec<String>,
}

impl Dialect {
    /// Whether the signals of the table follow from all its rows only: values over frequency, and complex values in two columns.
    #[must_use]
    pub(super) fn is_of_frequencies(&self) -> bool {
        self.frequency.is_some()
            || (self.time.is_none() && has_parts(self.columns.iter().map(|column| column.name.as_str())))
    }

    /// Recognises the dialect of a text by its beginning.
    ///
    /// # Errors
    /// No row of numbers, a first row that is neither names nor numbers, or two columns of times.
    pub fn of(sample: &str) -> Result<Self, String> {
        let sample = sample.strip_prefix('\u{feff}').unwrap_or(sample);
        let lines: Vec<(usize, &str)> = sample.lines().enumerate().filter(|(_, line)| !is_skipped(line)).collect();
        let found = [';', '\t', ',', ' ']
            .into_iter()
            .filter_map(|delimiter| {
                let first = first_row(&lines, delimiter)?;
                Some((split(lines[first].1, delimiter).len(), delimiter, first))
            })
            .fold(None, |best: Option<(usize, char, usize)>, next| best.filter(|best| best.0 >= next.0).or(Some(next)));
        let Some((_, delimiter, first)) = found else {
            let line = lines.first().map_or(String::new(), |(n, line)| {
                format!(": line {} is {:?}", n + 1, line.chars().take(60).collect::<String>())
            });
            return Err(format!("there is no row of numbers in it{line}\n  known are {}", super::KINDS));
        };
        // The last columns may be empty at first.
        let widest = lines[first..].iter().map(|(_, line)| split(line, delimiter).len()).max().unwrap_or_default();
        let rows_width = widest.min(fields(lines[first].1, delimiter).count());
        let has_decimal_comma =
            lines[first..].iter().flat_map(|(_, line)| split(line, delimiter)).any(|field| field.contains(','));
        let DelimitedHeader { at: header_at, names: header, units } =
            DelimitedHeader::of(&lines[..first], delimiter, rows_width)?;
        let width = header.as_ref().map_or(rows_width, |names| names.len().max(rows_width));
        let column = |n: usize| match (&header, &units) {
            (Some(names), Some(units)) => DelimitedColumn {
                name: names[n].trim().into(),
                unit_text: units.get(n).map_or("", String::as_str).trim().trim_matches(['(', ')', '[', ']']).into(),
            },
            (Some(names), None) => {
                let (name, unit_text) = of_column(&names[n]);
                DelimitedColumn { name, unit_text }
            }
            (None, _) => DelimitedColumn { name: numbered(n), unit_text: String::new() },
        };
        let mut remarks = Vec::new();
        if has_decimal_comma {
            remarks.push("Decimals are after a comma.".into());
        }
        if header.is_none() {
            remarks.push("It has no header: its columns have numbers for names, and no units.".into());
        }
        let passed = header_at.unwrap_or(first);
        if passed > 0 {
            remarks.push(format!(
                "{passed} lines before the table are passed over, the first is {:?}.",
                lines[0].1.trim()
            ));
        }
        let columns: Vec<DelimitedColumn> = (0..width).map(column).collect();
        let time = time_column(&columns)?;
        let named = columns.iter().enumerate().map(|(n, column)| (n, column.name.as_str(), column.unit_text.as_str()));
        let frequency = frequency_column(named).filter(|_| time.is_none());
        Ok(Self { delimiter, has_decimal_comma, time, frequency, columns, lines_before: lines[first].0, remarks })
    }
}

impl Dialect {
    /// The fields of a line.
    pub fn fields<'l>(&self, line: &'l str) -> impl Iterator<Item = &'l str> {
        fields(line, self.delimiter)
    }

    /// The finite number that a field writes.
    #[must_use]
    pub fn number(&self, field: &str) -> Option<f64> {
        if self.has_decimal_comma { number(field) } else { finite(field) }
    }

    /// Whether the file names its columns.
    #[must_use]
    pub fn has_names(&self) -> bool {
        self.columns.iter().enumerate().any(|(n, column)| column.name != numbered(n))
    }
}

/// The name of a column of a table without a header.
fn numbered(n: usize) -> String {
    format!("column {}", n + 1)
}

/// The column of the times, and seconds per unit.
fn time_column(columns: &[DelimitedColumn]) -> Result<Option<(usize, f64)>, String> {
    let unit = |column: &DelimitedColumn| Unit::of(&column.unit_text).filter(|unit| unit.kind == UnitKind::Time);
    let found: Vec<(usize, f64)> =
        columns.iter().enumerate().filter_map(|(n, column)| Some((n, unit(column)?.si))).collect();
    match found[..] {
        [] => Ok(None),
        [only] => Ok(Some(only)),
        [(a, _), (b, _), ..] => Err(format!(
            "there are two columns of times, {:?} and {:?}: keep one, or give each signal a file of its own",
            columns[a].name, columns[b].name
        )),
    }
}

/// What stands above the first row of numbers.
#[derive(Default)]
struct DelimitedHeader {
    /// Place of the names among the lines.
    at: Option<usize>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
}

impl DelimitedHeader {
    /// Finds the nearest line of names, and a line of units between it and the first row.
    fn of(above: &[(usize, &str)], delimiter: char, rows_width: usize) -> Result<Self, String> {
        let Some((last, before)) = above.split_last() else { return Ok(Self::default()) };
        let words = |line: &str| -> Option<Vec<String>> {
            let words = names(line, delimiter);
            // A sentence has words too: between blanks their number must be right.
            let fits = if delimiter == ' ' { words.len() == rows_width } else { words.len() >= rows_width };
            fits.then_some(words)
        };
        let header = |line: &str| words(line).filter(|words| words.iter().all(|word| is_name(word)));
        let has_units = words(last.1).is_some_and(|words| words.iter().all(|word| is_unit(word)))
            && before.last().is_some_and(|(_, line)| header(line).is_some());
        if !has_units && let Some(wrong) = words(last.1).and_then(|words| words.into_iter().find(|word| !is_name(word)))
        {
            let line = last.0 + 1;
            return Err(format!("line {line}: {wrong:?} is not a finite number; a header has a name in every column"));
        }
        let searched = if has_units { before } else { above };
        let at = searched.iter().rposition(|(_, line)| header(line).is_some());
        Ok(Self { at, names: at.and_then(|at| header(above[at].1)), units: words(last.1).filter(|_| has_units) })
    }
}

fn is_skipped(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#')
}

/// The fields of a line. A delimiter within quotes separates nothing; blanks as delimiters count once.
struct Fields<'l> {
    rest: Option<&'l str>,
    delimiter: char,
}

fn fields(line: &str, delimiter: char) -> Fields<'_> {
    let line = if delimiter == ' ' { line.trim() } else { line.strip_suffix('\r').unwrap_or(line) };
    Fields { rest: Some(line), delimiter }
}

impl<'l> Iterator for Fields<'l> {
    type Item = &'l str;

    fn next(&mut self) -> Option<&'l str> {
        let rest = self.rest?;
        let mut is_quoted = false;
        let is_end = |byte: u8| {
            is_quoted ^= byte == b'"';
            byte == self.delimiter as u8 && !is_quoted
        };
        let (field, after) = match rest.bytes().position(is_end) {
            Some(at) => (&rest[..at], Some(&rest[at + 1..])),
            None => (rest, None),
        };
        self.rest = if self.delimiter == ' ' { after.map(|after| after.trim_start_matches(' ')) } else { after };
        Some(field.trim().trim_matches('"').trim())
    }
}

/// The fields of a line, without empty ones at its end.
fn split(line: &str, delimiter: char) -> Vec<&str> {
    let mut all: Vec<&str> = fields(line, delimiter).collect();
    while all.len() > 1 && all.last().is_some_and(|field| field.is_empty()) {
        all.pop();
    }
    all
}

/// The names of a header; between blanks a unit in brackets belongs to the name before it.
fn names(line: &str, delimiter: char) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for field in split(line, delimiter) {
        match names.last_mut() {
            Some(last) if delimiter == ' ' && field.starts_with(['(', '[']) => {
                last.push(' ');
                last.push_str(field);
            }
            _ => names.push(field.into()),
        }
    }
    names
}

fn number(field: &str) -> Option<f64> {
    finite(field).or_else(|| finite(&field.replacen(',', ".", 1)))
}

/// Place of the first line that has only numbers and missing values, followed by a line with a number, if by any.
fn first_row(lines: &[(usize, &str)], delimiter: char) -> Option<usize> {
    let has_number = |line: &str| fields(line, delimiter).any(|field| number(field).is_some());
    let is_row = |line: &str| {
        has_number(line) && fields(line, delimiter).all(|field| field.is_empty() || number(field).is_some())
    };
    (0..lines.len().min(MAX_PREAMBLE + 1))
        .find(|at| is_row(lines[*at].1) && lines.get(at + 1).is_none_or(|(_, next)| has_number(next)))
}

/// Whether a field of the row below the names is a unit: a known one, one in brackets, or none.
fn is_unit(field: &str) -> bool {
    let field = field.trim();
    field.is_empty() || field == "-" || Unit::of(field).is_some() || field.starts_with(['(', '['])
}

/// The rows of a table, one after another, in constant memory.
pub struct DelimitedRows<'d, R> {
    text: R,
    bytes: Vec<u8>,
    dialect: &'d Dialect,
    line: u64,
    /// The column of the times, and the last time.
    time: Option<(usize, f64)>,
}

/// Longest line, bytes: a binary file without line ends is no table.
const MAX_LINE: u64 = 1 << 20;

impl<'d, R: BufRead> DelimitedRows<'d, R> {
    /// The rows of a text from its beginning; passes over the lines before them.
    pub fn new(text: R, dialect: &'d Dialect) -> Self {
        let time = dialect.time.map(|(column, _)| (column, f64::NEG_INFINITY));
        Self { text, bytes: Vec::new(), dialect, line: 0, time }
    }

    /// Reads the next row into `values`; NaN is a missing value. `false` at the end.
    ///
    /// # Errors
    /// Names line and column of what is no number, of a row with more columns than the first, and of a time that does not rise.
    pub fn next(&mut self, values: &mut Vec<f64>) -> Result<bool, String> {
        let width = self.dialect.columns.len();
        loop {
            self.bytes.clear();
            let read = self.text.by_ref().take(MAX_LINE).read_until(b'\n', &mut self.bytes);
            let length = read.map_err(|error| format!("after line {}: {error}", self.line))?;
            if length == 0 {
                return Ok(false);
            }
            self.line += 1;
            let line = self.line;
            if length as u64 == MAX_LINE {
                return Err(format!("line {line}: it is longer than {MAX_LINE} bytes: this is no table"));
            }
            if line <= self.dialect.lines_before as u64 {
                continue;
            }
            let text = str::from_utf8(&self.bytes).map_err(|_| format!("line {line}: it is no text in UTF-8"))?;
            let text = text.trim_start_matches('\u{feff}').trim_end_matches(['\n', '\r']);
            if is_skipped(text) {
                continue;
            }
            values.clear();
            let mut filled = 0;
            for field in fields(text, self.dialect.delimiter) {
                let value = if field.is_empty() {
                    f64::NAN
                } else {
                    filled = values.len() + 1;
                    value(field, self.dialect.has_decimal_comma, line, filled)?
                };
                values.push(value);
            }
            if filled == 0 {
                continue;
            }
            if filled > width {
                let help = if self.dialect.delimiter == ',' {
                    "\n  a decimal comma splits a number: separate the columns by semicolons"
                } else {
                    ""
                };
                return Err(format!("line {line}: {filled} columns where the first row has {width}{help}"));
            }
            values.resize(width, f64::NAN);
            if self.dialect.frequency.is_some_and(|(column, _)| values[column].is_nan()) {
                return Err(format!("line {line}: the frequency is missing"));
            }
            if let Some((column, last)) = &mut self.time {
                let time = values[*column];
                if time.is_nan() {
                    return Err(format!("line {line}: the time is missing"));
                }
                if time <= *last {
                    return Err(format!(
                        "line {line}: the time {time} is not later than the one before, {last}\n  sort the rows by time and remove \
                         duplicates"
                    ));
                }
                *last = time;
            }
            return Ok(true);
        }
    }
}

fn value(text: &str, has_decimal_comma: bool, line: u64, column: usize) -> Result<f64, String> {
    let parsed = if has_decimal_comma && text.contains(',') {
        text.replacen(',', ".", 1).parse::<f64>()
    } else {
        text.parse::<f64>()
    };
    match parsed {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!(
            "line {line}, column {column}: {text:?} is not a finite number\n  cut the record before or after it, or leave the field empty"
        )),
    }
}

/// A signal for each column that is not the times'.
pub(super) fn parse(text: &str) -> Result<Contents, String> {
    let end = text.char_indices().nth(SAMPLE_BYTES).map_or(text.len(), |(at, _)| at);
    // A line that the sample cuts is not looked at.
    let sample = if end < text.len() { &text[..text[..end].rfind('\n').unwrap_or(end)] } else { text };
    let dialect = Dialect::of(sample)?;
    let (time, width) = (dialect.time, dialect.columns.len());
    let abscissa = time.or(dialect.frequency);
    let mut columns = vec![Vec::new(); width];
    let mut values = Vec::new();
    let mut rows = DelimitedRows::new(text.as_bytes(), &dialect);
    while rows.next(&mut values)? {
        columns.iter_mut().zip(&values).for_each(|(column, value)| column.push(*value));
    }
    let (mut signals, mut remarks) = (Vec::new(), dialect.remarks.clone());
    for n in (0..width).filter(|n| abscissa.is_none_or(|(column, _)| column != *n)) {
        let own = &dialect.columns[n];
        let (mut places, mut kept) = (Vec::new(), Vec::new());
        for (row, value) in columns[n].iter().enumerate().filter(|(_, value)| !value.is_nan()) {
            places.push(abscissa.map_or(0.0, |(column, si)| columns[column][row] * si));
            kept.push(*value);
        }
        let missing = columns[n].len() - kept.len();
        if kept.is_empty() {
            remarks.push(no_values(&own.name));
            continue;
        }
        let axis = match (time, dialect.frequency) {
            (Some(_), _) => SignalAxis::of_times(places),
            (None, Some(_)) => frequencies(&places, 1.0),
            (None, None) => SignalAxis::Unknown("the file states no times with a unit".into()),
        };
        let mut signal = Signal::new(own.name.clone(), own.unit_text.clone(), axis, kept);
        signal.remark = remark(&signal, missing);
        signals.push(signal);
    }
    if time.is_some() && signals.is_empty() {
        return Err("it has times and no other column".into());
    }
    Ok(Contents { kind: TABLE, signals: paired(signals), remarks })
}

/// A column that is left out.
pub(super) fn no_values(name: &str) -> String {
    format!("The column {name:?} has no values.")
}

fn remark(signal: &Signal, missing: usize) -> Option<String> {
    let mut parts = Vec::new();
    if missing > 0 {
        parts.push(format!("{missing} values are missing"));
    }
    if let SignalAxis::Times(times_s) = &signal.axis {
        parts.push(uneven(times_s));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}
