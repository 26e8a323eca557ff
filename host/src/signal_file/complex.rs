//! Complex signals that a file keeps as two columns: real and imaginary part, or magnitude and phase.

use super::unit::{Unit, UnitKind};
use super::{Signal, SignalAxis};

/// Part of a complex value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ComplexPart {
    Real,
    Imaginary,
    Phase,
}

/// Ends of names. Between name and end there may be a blank, a line, a point or brackets: `h_real`, `H (imag)`, `Re(H)`.
const ENDS: &[(&str, ComplexPart)] = &[
    ("real", ComplexPart::Real),
    ("re", ComplexPart::Real),
    ("imaginary", ComplexPart::Imaginary),
    ("imag", ComplexPart::Imaginary),
    ("im", ComplexPart::Imaginary),
    ("phase", ComplexPart::Phase),
];

/// Name of the complex value and the part, of a column's name.
fn part(name: &str) -> Option<(String, ComplexPart)> {
    let name = name.trim().to_lowercase();
    let separates = |c: char| " _-.()[]/".contains(c);
    ENDS.iter().find_map(|(word, part)| {
        let rest = match (name.strip_suffix([')', ']']).unwrap_or(&name).strip_suffix(word), name.strip_prefix(word)) {
            (Some(rest), _) if rest.is_empty() || rest.ends_with(separates) => rest,
            (_, Some(rest)) if rest.starts_with(separates) => rest,
            _ => return None,
        };
        Some((rest.trim_matches(separates).into(), *part))
    })
}

/// Name of the complex value whose magnitude a column may be: `h`, `h_abs`, `|H|`; none for a coherence.
fn magnitude(name: &str) -> Option<String> {
    let name = name.trim().to_lowercase();
    if name.starts_with("coh") || name.ends_with("coherence") || name.ends_with("coh") {
        return None;
    }
    let separates = |c: char| " _-.()[]|/".contains(c);
    let of = ["magnitude", "amplitude", "abs", "mag"].into_iter().find_map(|word| name.strip_suffix(word));
    Some(of.unwrap_or(&name).trim_matches(separates).into())
}

/// Whether some of these columns are parts of complex values.
pub(super) fn has_parts<'n>(mut names: impl Iterator<Item = &'n str>) -> bool {
    names.any(|name| part(name).is_some())
}

fn is_angle(signal: &Signal) -> bool {
    signal.kind() == Some(UnitKind::Angle)
}

/// Places of two columns that make a complex signal, and its name.
fn pair(signals: &[Signal]) -> Option<(usize, usize, String)> {
    let is_free = |signal: &Signal| signal.imaginary.is_none() && !signal.axis.is_time();
    let fits =
        |a: &Signal, b: &Signal| is_free(a) && is_free(b) && a.axis == b.axis && a.values.len() == b.values.len();
    for (n, upper) in signals.iter().enumerate().filter(|(_, signal)| is_free(signal)) {
        let Some((stem, own)) = part(&upper.name) else { continue };
        match own {
            ComplexPart::Real => {
                let is_other = |other: &Signal| {
                    part(&other.name) == Some((stem.clone(), ComplexPart::Imaginary))
                        && fits(upper, other)
                        && (other.unit_text == upper.unit_text || other.unit_text.is_empty())
                };
                if let Some(at) = signals.iter().position(is_other) {
                    return Some((n, at, if stem.is_empty() { "complex".into() } else { stem }));
                }
            }
            ComplexPart::Phase if is_angle(upper) => {
                // A phase without a name is that of the only other column.
                let others: Vec<usize> = (0..signals.len())
                    .filter(|at| {
                        let other = &signals[*at];
                        let is_named = magnitude(&other.name).is_some_and(|own| stem.is_empty() || own == stem);
                        *at != n && is_named && !is_angle(other) && fits(upper, other)
                    })
                    .collect();
                if let [only] = others[..] {
                    return Some((only, n, signals[only].name.clone()));
                }
            }
            _ => {}
        }
    }
    None
}

/// The signals, with the two columns of a complex one as one signal at the place of the first of them.
pub(super) fn paired(mut signals: Vec<Signal>) -> Vec<Signal> {
    while let Some((main, other, name)) = pair(&signals) {
        let place = main.min(other);
        let second = signals[other].clone();
        let mut own = signals[main].clone();
        own.imaginary = Some(match second.unit.filter(|_| is_angle(&second)) {
            Some(Unit { si, .. }) => {
                let angles: Vec<f64> = second.values.iter().map(|angle| angle * si).collect();
                let magnitudes = own.values.clone();
                own.values = magnitudes.iter().zip(&angles).map(|(r, angle)| r * angle.cos()).collect();
                magnitudes.iter().zip(&angles).map(|(r, angle)| r * angle.sin()).collect()
            }
            None => second.values,
        });
        own.name = name;
        signals[place] = own;
        signals.remove(main.max(other));
    }
    signals
}

/// The frequencies among columns of names and units, and Hz per unit: the only column in Hz, or the only one of the name frequency.
pub(super) fn frequency_column<'c>(columns: impl Iterator<Item = (usize, &'c str, &'c str)>) -> Option<(usize, f64)> {
    let unit = |text: &str| Unit::of(text).filter(|unit| unit.kind == UnitKind::Frequency);
    let all: Vec<(usize, &str, f64)> = columns.filter_map(|(n, name, text)| Some((n, name, unit(text)?.si))).collect();
    let named: Vec<_> = all
        .iter()
        .filter(|(_, name, _)| matches!(name.to_lowercase().as_str(), "frequency" | "freq" | "f" | "frequencies"))
        .collect();
    match (&all[..], &named[..]) {
        ([(n, _, si)], _) | (_, [(n, _, si)]) => Some((*n, *si)),
        _ => None,
    }
}

/// The axis of columns whose frequencies a file states.
pub(super) fn frequencies(values: &[f64], si: f64) -> SignalAxis {
    SignalAxis::Frequencies(values.iter().map(|value| value * si).collect())
}
