//! Universal files (UFF, UNV): datasets 58, 58b, 151 and 164; others are named and passed over.

use super::uff_dataset_58;
use super::{Contents, Signal};

/// A line of the bytes from `at` on, without its end, and where the next begins.
pub(super) fn line(bytes: &[u8], at: usize) -> (&[u8], usize) {
    let rest = &bytes[at.min(bytes.len())..];
    let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
    let next = at + (end + 1).min(rest.len());
    (rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]), next)
}

/// Whether a line delimits datasets: `    -1`.
fn is_delimiter(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

/// Whether a file begins with a delimiter and the number of a dataset.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    let mut at = 0;
    while at < bytes.len() {
        let (first, next) = line(bytes, at);
        if is_delimiter(first) {
            return number(line(bytes, next).0).is_some();
        }
        if !first.trim_ascii().is_empty() {
            return false;
        }
        at = next;
    }
    false
}

/// The number of a dataset, and whether it is binary: `58b`.
fn number(header: &[u8]) -> Option<(u32, bool)> {
    let word = header.trim_ascii().split(u8::is_ascii_whitespace).next()?;
    let digits = word.strip_suffix(b"b").unwrap_or(word);
    Some((str::from_utf8(digits).ok()?.parse().ok()?, digits.len() < word.len()))
}

/// The text of a header, whatever its encoding: UTF-8, or one byte for each character (ISO 8859-1).
pub(super) fn text(line: &[u8]) -> String {
    match str::from_utf8(line) {
        Ok(text) => text.trim().into(),
        Err(_) => line.iter().map(|byte| char::from(*byte)).collect::<String>().trim().into(),
    }
}

/// `NONE` and blanks state nothing.
pub(super) fn stated(text: String) -> Option<String> {
    Some(text).filter(|text| !text.is_empty() && !text.eq_ignore_ascii_case("none"))
}

/// Parses a universal file.
pub(super) fn parse(bytes: &[u8]) -> Result<Contents, String> {
    let mut signals: Vec<Signal> = Vec::new();
    let mut remarks = Vec::new();
    let (mut at, mut dataset) = (0, 0);
    while at < bytes.len() {
        let (first, next) = line(bytes, at);
        if first.trim_ascii().is_empty() {
            at = next;
            continue;
        }
        dataset += 1;
        if !is_delimiter(first) {
            let shown: String = text(first).chars().take(40).collect();
            remarks.push(format!(
                "After dataset {} there is {shown:?} in place of -1: the rest is not read.",
                dataset - 1
            ));
            break;
        }
        let (header, body) = line(bytes, next);
        let name = |what: &str| format!("dataset {dataset} ({what})");
        let Some((kind, is_binary)) = number(header) else {
            remarks.push(format!("{} has no number: the rest is not read.", name("unknown")));
            break;
        };
        let end = match (kind, is_binary) {
            (58, true) => match uff_dataset_58::binary(header, bytes, body) {
                Ok((signal, end)) => {
                    signals.push(signal);
                    end
                }
                Err(why) => {
                    remarks.push(format!("{} is left out, and what follows it: {why}", name("58b")));
                    break;
                }
            },
            _ => {
                let end = end_of_text(bytes, body);
                let lines = &bytes[body..end];
                match kind {
                    58 => match uff_dataset_58::text(lines) {
                        Ok(signal) => signals.push(signal),
                        Err(why) => remarks.push(format!("{} is left out: {why}", name("58"))),
                    },
                    151 => remarks.extend(header_151(lines)),
                    164 => remarks.extend(units_164(lines)),
                    other => {
                        remarks.push(format!("{} is not read: it is no measured signal.", name(&other.to_string())))
                    }
                }
                end
            }
        };
        let (last, next) = line(bytes, end);
        if is_delimiter(last) {
            at = next;
        } else {
            if !last.trim_ascii().is_empty() || end < bytes.len() {
                remarks.push(format!("After {} there is no -1: the rest is not read.", name(&kind.to_string())));
                break;
            }
            remarks.push(format!("The file ends within {}.", name(&kind.to_string())));
            at = bytes.len();
        }
    }
    Ok(Contents { kind: "universal file (UFF)", signals, remarks })
}

/// A dataset that is text.
pub(super) struct TextDataset<'a> {
    /// Its number.
    pub kind: u32,
    /// Its place in the file, from 1.
    pub place: usize,
    /// Its lines after that of the number.
    pub lines: Vec<&'a str>,
    /// Whether the file goes on to its end.
    pub is_whole: bool,
}

/// The datasets that are text. Reading ends where the file's form does.
pub(super) fn text_datasets(bytes: &[u8]) -> Vec<TextDataset<'_>> {
    let mut all = Vec::new();
    let (mut at, mut place) = (0, 0);
    while at < bytes.len() {
        let (first, next) = line(bytes, at);
        if !is_delimiter(first) {
            at = next;
            continue;
        }
        place += 1;
        let (header, body) = line(bytes, next);
        let end = match number(header) {
            None => break,
            Some((58, true)) => match uff_dataset_58::binary(header, bytes, body) {
                Ok((_, end)) => end,
                Err(_) => break,
            },
            Some((kind, _)) => {
                let end = end_of_text(bytes, body);
                // Names in other encodings are passed over with their line.
                let lines = bytes[body..end].split(|byte| *byte == b'\n');
                let lines = lines.map(|line| str::from_utf8(line).unwrap_or_default().trim_end_matches('\r'));
                all.push(TextDataset {
                    kind,
                    place,
                    lines: lines.collect(),
                    is_whole: is_delimiter(line(bytes, end).0),
                });
                end
            }
        };
        at = line(bytes, end).1;
    }
    all
}

/// Where the delimiter after a text begins, or the end of the file.
fn end_of_text(bytes: &[u8], from: usize) -> usize {
    let mut at = from;
    while at < bytes.len() {
        let (one, next) = line(bytes, at);
        if is_delimiter(one) {
            return at;
        }
        at = next;
    }
    bytes.len()
}

fn header_151(lines: &[u8]) -> Option<String> {
    let (model, next) = line(lines, 0);
    let (description, _) = line(lines, next);
    let parts: Vec<String> = [model, description].into_iter().filter_map(|part| stated(text(part))).collect();
    (!parts.is_empty()).then(|| format!("Model: {}.", parts.join(", ")))
}

/// The units of datasets without labels of their own.
fn units_164(lines: &[u8]) -> Option<String> {
    let (first, _) = line(lines, 0);
    let first = text(first);
    let code = first.split_whitespace().next()?;
    let name = first.get(10..30).unwrap_or_default().trim();
    Some(format!("Units (164): code {code} {name}."))
}
