//! Strong-motion records of the California programme (CSMIP volume 2): acceleration, velocity and displacement, each after a line
//! `5696 points of accel data equally spaced at .010 sec, in cm/sec2. (8f10.7)`.

use super::number::fortran;
use super::{Contents, STRONG_MOTION, Signal, SignalAxis};

/// Lines in which the first such line is looked for.
const HEADER_LINES: usize = 120;

/// What the line before the values says.
struct CsmipHeader {
    count: usize,
    step_s: f64,
    name: &'static str,
    unit: &'static str,
    /// Characters of a value, if stated.
    width: Option<usize>,
}

fn head(line: &str) -> Option<CsmipHeader> {
    let lower = line.to_ascii_lowercase();
    let (before, after) = lower.split_once(" points of ")?;
    let (what, after) = after.split_once("equally spaced at")?;
    let name = ["acceleration", "velocity", "displacement"].into_iter().find(|name| what.contains(&name[..5]))?;
    let plain = after.replace(' ', "");
    let units: &[(&str, &str)] = match name {
        "acceleration" => {
            &[("cm/sec2", "cm/s2"), ("cm/sec/sec", "cm/s2"), ("in/sec2", "in/s2"), ("ing", "g"), ("units:g", "g")]
        }
        "velocity" => &[("cm/sec", "cm/s"), ("in/sec", "in/s")],
        _ => &[("cm", "cm"), ("inches", "in")],
    };
    let unit = units.iter().find(|(text, _)| plain.contains(text)).map_or("", |(_, unit)| unit);
    let width = plain
        .split_once('(')
        .and_then(|(_, form)| form.split_once('f'))
        .and_then(|(_, form)| form.split_once('.').and_then(|(width, _)| width.parse().ok()));
    Some(CsmipHeader {
        count: before.trim().parse().ok()?,
        step_s: after.split_whitespace().next()?.parse().ok().filter(|step: &f64| *step > 0.0)?,
        name,
        unit,
        width,
    })
}

/// Whether a text is such a record.
pub(super) fn is_one(text: &str) -> bool {
    text.lines().take(HEADER_LINES).any(|line| head(line).is_some())
}

/// Its signals. The titles become remarks.
pub(super) fn parse(text: &str) -> Result<Contents, String> {
    let mut signals = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((at, line)) = lines.next() {
        let Some(head) = head(line) else { continue };
        let values = AnnouncedNumbers { at, count: head.count, width: head.width }.read(&mut lines)?;
        signals.push(Signal::new(head.name, head.unit, SignalAxis::Time { start_s: 0.0, step_s: head.step_s }, values));
    }
    Ok(Contents { kind: STRONG_MOTION, signals, remarks: title(text, 4, 8) })
}

/// The texts of some lines of the header that are not empty.
pub(super) fn title(text: &str, from: usize, to: usize) -> Vec<String> {
    let lines = text.lines().take(to).map(str::trim).filter(|line| !line.is_empty());
    lines.skip(from).map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// Numbers that a line announces.
pub(super) struct AnnouncedNumbers {
    /// The line, from 0.
    pub at: usize,
    pub count: usize,
    /// Characters of a value, if stated.
    pub width: Option<usize>,
}

impl AnnouncedNumbers {
    /// Reads them from the lines that follow.
    pub(super) fn read<'a>(&self, lines: &mut impl Iterator<Item = (usize, &'a str)>) -> Result<Vec<f64>, String> {
        if self.count < 2 {
            return Err(format!("line {}: {} values are too few", self.at + 1, self.count));
        }
        let mut values = Vec::new();
        while values.len() < self.count {
            let Some((n, line)) = lines.next() else { break };
            let width = self.width.filter(|_| line.is_ascii()).unwrap_or(line.len()).max(1);
            for (field, bytes) in line.as_bytes().chunks(width).enumerate() {
                fortran(&String::from_utf8_lossy(bytes), field * width, &mut values)
                    .map_err(|why| format!("line {}, {why}", n + 1))?;
            }
        }
        if values.len() == self.count {
            return Ok(values);
        }
        Err(format!(
            "line {}: {} values are announced, {} follow: the file is cut short or damaged",
            self.at + 1,
            self.count,
            values.len()
        ))
    }
}
