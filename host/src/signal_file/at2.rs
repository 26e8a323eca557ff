//! Parses AT2 files of the PEER ground-motion data base: four header lines, then accelerations.
//!
//! The third line has quantity and unit (`ACCELERATION TIME SERIES IN UNITS OF G`), the fourth the number of values and the
//! time step.

use super::number::finite;
use super::unit::STANDARD_GRAVITY;
use super::{Contents, Signal, SignalAxis};

/// Header lines that are searched at most.
const HEADER_LINES: usize = 6;

/// Contents of an AT2 file.
pub struct At2 {
    /// Time step, s.
    pub step_s: f64,
    /// Accelerations, m/s².
    pub values: Vec<f64>,
}

/// Whether a text is one by its first line.
pub(super) fn is_one(text: &str) -> bool {
    text.starts_with("PEER ")
        || text.lines().take(HEADER_LINES).any(|line| line.contains("NPTS") && line.contains("DT"))
}

/// Parses a file as a signal.
pub(super) fn parse(text: &str) -> Result<Contents, String> {
    let At2 { step_s, values } = at2(text, None, |unit_si, _, value| Ok(unit_si * value))?;
    let title = text.lines().nth(1).unwrap_or_default().trim();
    let signal = Signal::new("acceleration", "m/s2", SignalAxis::Time { start_s: 0.0, step_s }, values);
    Ok(Contents { kind: "PEER record (AT2)", signals: vec![signal], remarks: vec![title.into()] })
}

/// Parses the text of an AT2 file. `unit_si` is the case's unit, which takes precedence over the header's; g when neither states
/// one, as the format defines. `to_si` gives a value in m/s², of the unit, the value's text and the value; or why it is not allowed.
///
/// # Errors
/// Names line and value.
pub fn at2(
    text: &str,
    unit_si: Option<f64>,
    to_si: impl Fn(f64, &str, f64) -> Result<f64, String>,
) -> Result<At2, String> {
    let mut lines = text.lines().enumerate();
    let mut stated = None;
    let mut head = None;
    for (n, line) in lines.by_ref().take(HEADER_LINES) {
        let upper = line.to_ascii_uppercase();
        if upper.contains("NPTS") {
            head = Some((n, line));
            break;
        }
        if let Some(unit) = unit(n + 1, &upper, unit_si.is_some())? {
            stated = Some(unit);
        }
    }
    let (at, header) = head.ok_or("line 4 of an AT2 file gives `NPTS= …, DT= …`, and none of the first six does")?;
    let upper = header.to_ascii_uppercase();
    let (count, step_s) = counts(&upper).ok_or_else(|| {
        format!(
            "line {}: {:?} must give the number of samples and the step, `NPTS= 5372, DT= .0100 SEC`",
            at + 1,
            header.trim()
        )
    })?;
    let unit_si = unit_si.or(stated).unwrap_or(STANDARD_GRAVITY);
    let mut values = Vec::new();
    for (n, line) in lines {
        for (column, word) in line.split_whitespace().enumerate() {
            let value = finite(word)
                .ok_or_else(|| format!("line {}: {word:?} is not allowed: must be a finite number", n + 1))?;
            let si = to_si(unit_si, word, value);
            values.push(si.map_err(|why| format!("line {}, column {}: {why}", n + 1, column + 1))?);
        }
    }
    if values.len() != count {
        let cut = if values.len() < count { "the file is cut short, or " } else { "" };
        return Err(format!(
            "{} values, but line {} says NPTS = {count}: {cut}one of the two is wrong",
            values.len(),
            at + 1
        ));
    }
    Ok(At2 { step_s, values })
}

/// NPTS and DT of an AT2 header in either of its forms: `NPTS= 5372, DT= .0100 SEC`, `5372 0.0100 NPTS, DT`.
fn counts(header: &str) -> Option<(usize, f64)> {
    let numbers: Vec<&str> = header
        .split(|c: char| c.is_whitespace() || c == ',' || c == '=')
        .filter(|word| word.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
        .collect();
    let [count, step, ..] = numbers[..] else { return None };
    let step_s = finite(step).filter(|s| *s > 0.0)?;
    Some((count.parse().ok()?, step_s))
}

/// m/s² per unit of a header line, if it states one; an unknown unit is ignored when the case gives one.
fn unit(at: usize, upper: &str, is_given: bool) -> Result<Option<f64>, String> {
    let (series, stated) = match upper.split_once("UNITS OF") {
        Some((series, stated)) => (series, Some(stated)),
        None if upper.contains("TIME HISTORY") || upper.contains("TIME SERIES") => (upper, None),
        None => return Ok(None),
    };
    if let Some(other) = ["VELOCITY", "DISPLACEMENT"].into_iter().find(|other| series.contains(other)) {
        return Err(format!(
            "line {at}: {other} is not allowed: must be an ACCELERATION series; take the record's .AT2 file, or put the \
             values of a displacement into a CSV file"
        ));
    }
    let Some(stated) = stated else { return Ok(None) };
    let word = stated.split_whitespace().next().unwrap_or_default().trim_end_matches(['.', ',', ';', ':']);
    let plain = word.replace(['*', '^', '\''], "").replace("SEC", "S").replace("/S/S", "/S2");
    let unit_si = match plain.as_str() {
        "G" | "GS" => STANDARD_GRAVITY,
        "M/S2" | "M/SS" => 1.0,
        "CM/S2" | "CM/SS" | "GAL" | "GALS" => 0.01,
        "MM/S2" | "MM/SS" => 0.001,
        _ if is_given => return Ok(None),
        _ => {
            return Err(format!(
                "line {at}: the unit {word:?} is not allowed: must be one of an acceleration, G, M/S2, CM/S2 (also CM/S/S, \
                 CM/SEC**2, GAL) or MM/S2; if the header is wrong, give `unit` in the case"
            ));
        }
    };
    Ok(Some(unit_si))
}
