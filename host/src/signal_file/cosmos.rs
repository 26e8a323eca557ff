//! Strong-motion records in the COSMOS format (V0, V1 and V2, format 1.20): for each channel a text header, integers, real numbers, comments,
//! and values after a line `26219 acceleration pts, approx  131 secs, units=cm/sec2(04),Format=(1E15.6)`.
//!
//! The time step is the 62nd real number, in ms, which is that of the values; the 34th is that of the recorder, in s.

use super::csmip::{AnnouncedNumbers, title};
use super::{Contents, STRONG_MOTION, Signal, SignalAxis};

/// Lines in which the header of the real numbers is looked for.
const HEADER_LINES: usize = 60;
/// Places of the time steps among the real numbers, from 0.
const STEP_MS: usize = 61;
const RECORDER_STEP_S: usize = 33;
/// A number that stands for "unknown".
const UNKNOWN: f64 = -999.0;

/// How many values of a kind a line announces, and what it says of them.
fn announced<'a>(line: &'a str, what: &str) -> Option<(usize, &'a str)> {
    let (count, after) = line.trim_start().split_once(' ')?;
    let after = after.trim_start();
    after.get(..what.len()).filter(|begin| begin.eq_ignore_ascii_case(what)).and(Some((count.parse().ok()?, after)))
}

/// Whether a text is such a record.
pub(super) fn is_one(text: &str) -> bool {
    text.lines().take(HEADER_LINES).any(|line| announced(line, "Real-header values").is_some())
}

/// What the line before the values says.
struct CosmosHeader<'a> {
    count: usize,
    what: &'static str,
    unit: &'static str,
    stated_unit: &'a str,
    width: Option<usize>,
}

fn head(line: &str) -> Option<CosmosHeader<'_>> {
    let (before, after) = line.split_once(" pts")?;
    let (count, quantity) = before.trim_start().split_once(' ')?;
    let lower = quantity.to_ascii_lowercase();
    let what = [("accel", "acceleration"), ("veloc", "velocity"), ("displ", "displacement")];
    let (_, what) = what.into_iter().find(|(begin, _)| lower.contains(begin))?;
    let stated_unit =
        after.split_once("units=").map_or("", |(_, rest)| rest.split(['(', ',']).next().unwrap_or("").trim());
    let units = [
        ("cm/sec2", "cm/s2"),
        ("cm/sec/sec", "cm/s2"),
        ("g", "g"),
        ("mg", "mg"),
        ("in/sec2", "in/s2"),
        ("cm/sec", "cm/s"),
        ("in/sec", "in/s"),
        ("cm", "cm"),
        ("in", "in"),
        ("inches", "in"),
    ];
    let unit = units.into_iter().find(|(text, _)| stated_unit.eq_ignore_ascii_case(text)).map_or("", |(_, unit)| unit);
    Some(CosmosHeader { count: count.parse().ok()?, what, unit, stated_unit, width: width(after) })
}

/// Width of a value in `Format=(8F10.3)`, `(10I8)`, `(6E12.3)`.
fn width(line: &str) -> Option<usize> {
    let (_, form) = line.rsplit_once('(')?;
    let form = form.trim_start_matches(|c: char| c.is_ascii_digit());
    let number = form.strip_prefix(['F', 'f', 'E', 'e', 'I', 'i', 'D', 'd'])?;
    number.split(['.', ')']).next()?.trim().parse().ok().filter(|width| (1..=40).contains(width))
}

/// Its signals: of each channel acceleration, velocity and displacement, as far as they are there.
pub(super) fn parse(text: &str) -> Result<Contents, String> {
    let mut lines = text.lines().enumerate();
    let mut signals: Vec<Signal> = Vec::new();
    let (mut channel, mut channels) = (String::new(), Vec::new());
    let mut step_s = None;
    while let Some((at, line)) = lines.next() {
        if let Some(name) = channel_of(line) {
            channel = name;
        } else if let Some((count, after)) = announced(line, "Real-header values") {
            let reals = AnnouncedNumbers { at, count, width: width(after) }.read(&mut lines)?;
            let known = |place: usize| reals.get(place).copied().filter(|value| *value > 0.0 && *value != UNKNOWN);
            step_s = known(STEP_MS).map(|step_ms| 1e-3 * step_ms).or(known(RECORDER_STEP_S));
        } else if let Some((count, after)) = announced(line, "Integer-header values") {
            AnnouncedNumbers { at, count, width: width(after) }.read(&mut lines)?;
        } else if let Some(head) = head(line) {
            let values = AnnouncedNumbers { at, count: head.count, width: head.width }.read(&mut lines)?;
            let step_s = step_s.ok_or_else(|| {
                format!("line {}: the time step of the values is missing: the 62nd real number of the header states it in ms", at + 1)
            })?;
            let mut signal = Signal::new(head.what, head.unit, SignalAxis::Time { start_s: 0.0, step_s }, values);
            if head.unit.is_empty() {
                signal.unit_text = head.stated_unit.into();
                signal.remark =
                    Some(format!("in {}: a V1 or V2 file of this record has physical units", head.stated_unit));
            }
            signals.push(signal);
            channels.push(channel.clone());
        }
    }
    if channels.iter().any(|channel| *channel != channels[0]) {
        for (signal, channel) in signals.iter_mut().zip(channels) {
            signal.name = format!("{} {channel}", signal.name);
        }
    }
    if signals.is_empty() {
        return Err("it is cut short: no values follow the header of this COSMOS record".into());
    }
    Ok(Contents { kind: STRONG_MOTION, signals, remarks: title(text, 1, 5) })
}

/// The channel that a line of the text header names: `Sta Chan   1: 90 Deg (Rcrdr Chan  1) Location:Ground`.
fn channel_of(line: &str) -> Option<String> {
    let (number, rest) = line.strip_prefix("Sta Chan")?.split_once(':')?;
    let direction = rest.split('(').next().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
    let number = number.trim();
    Some(if number == "?" { direction } else { format!("channel {number}") })
}
