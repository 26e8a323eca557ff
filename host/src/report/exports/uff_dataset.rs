//! The records of universal files (UFF, UNV), fixed columns of ASCII: datasets 151 (header), 164 (units) and 58 (function
//! at nodal DOF) after the Structural Dynamics Research Laboratory's list. What is put into them is [`super::uff`]'s.

use std::fmt::Write as _;
use std::io::{self, Write};

/// Columns of a line of text.
const WIDTH: usize = 80;

/// A quantity on an axis: records 8 to 11 of dataset 58.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Axis {
    /// Specific data type: 0 unknown, 8 displacement, 9 reaction force, 11 velocity, 12 acceleration, 17 time, 18 frequency.
    pub kind: u8,
    /// Label.
    pub label: String,
    /// Unit.
    pub unit: String,
}

impl Axis {
    pub(super) fn new(kind: u8, label: &str, unit: &str) -> Self {
        Self { kind, label: label.into(), unit: unit.into() }
    }

    /// Not used.
    pub(super) fn none() -> Self {
        Self::new(0, "NONE", "NONE")
    }
}

/// A degree of freedom: a node and a direction (1 is +X, 0 none).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dof {
    pub node: usize,
    pub direction: u8,
}

/// What is over the abscissa.
#[derive(Clone, Debug)]
pub(super) enum Ordinate<'a> {
    /// Real, evenly spaced from `start` on by `step`: format 4E20.12.
    Even { start: f64, step: f64, values: &'a [f32] },
    /// Complex, abscissa with each value: format E13.5,2E20.12.
    Uneven(&'a [(f64, f64, f64)]),
}

/// A dataset 58.
#[derive(Clone, Debug)]
pub(super) struct Function<'a> {
    /// ID lines 1 to 5: function, run, date and time, load case, free.
    pub id: [String; 5],
    /// 1 time response, 4 frequency response.
    pub kind: u8,
    /// Running number in the file.
    pub number: usize,
    /// Version or sequence number.
    pub version: u32,
    pub response: Dof,
    pub reference: Dof,
    pub ordinate: Ordinate<'a>,
    pub abscissa: Axis,
    pub numerator: Axis,
    pub denominator: Axis,
    /// Quantity and value on the z axis.
    pub z_axis: (Axis, f64),
}

/// At most `width` columns of ASCII; other characters become `?`. A line may not be blank.
fn ascii(text: &str, width: usize) -> String {
    let plain: String =
        text.chars().take(width).map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect();
    if plain.trim().is_empty() { "NONE".into() } else { plain }
}

/// `value` as Fortran's E format reads it: `digits` after the point, two digits of exponent, right in `width` columns.
pub(super) fn real(value: f64, width: usize, digits: usize) -> String {
    let text = format!("{value:.digits$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, exponent) = exponent.strip_prefix('-').map_or(('+', exponent), |rest| ('-', rest));
    let text = format!("{mantissa}e{sign}{exponent:0>2}");
    format!("{text:>width$}")
}

fn short(value: f64) -> String {
    real(value, 13, 5)
}

fn long(value: f64) -> String {
    real(value, 20, 11)
}

fn begin(out: &mut impl Write, number: u32) -> io::Result<()> {
    writeln!(out, "{:>6}\n{number:>6}{:74}", -1, "")
}

fn end(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{:>6}", -1)
}

fn line(out: &mut impl Write, text: &str) -> io::Result<()> {
    writeln!(out, "{:<WIDTH$}", ascii(text, WIDTH))
}

/// Dataset 151: `model`, what it is, and the program; `date_time` is `DD-MMM-YY HH:MM:SS`.
pub(super) fn header(out: &mut impl Write, model: &str, about: &str, program: &str, date_time: &str) -> io::Result<()> {
    let (date, time) = date_time.split_once(' ').unwrap_or(("", ""));
    begin(out, 151)?;
    line(out, model)?;
    line(out, about)?;
    line(out, program)?;
    writeln!(out, "{date:<10}{time:<10}{:>10}{:>10}{:>10}", 0, 0, 0)?;
    writeln!(out, "{date:<10}{time:<10}")?;
    line(out, program)?;
    writeln!(out, "{date:<10}{time:<10}")?;
    end(out)
}

/// Dataset 164: SI units, absolute temperature.
pub(super) fn si_units(out: &mut impl Write) -> io::Result<()> {
    let real = |value: f64| real(value, 25, 16).replace('e', "D");
    begin(out, 164)?;
    writeln!(out, "{:>10}{:<20}{:>10}", 1, "SI", 1)?;
    writeln!(out, "{}{}{}\n{}", real(1.0), real(1.0), real(1.0), real(273.15))?;
    end(out)
}

fn axis(out: &mut impl Write, axis: &Axis) -> io::Result<()> {
    let (label, unit) = (ascii(&axis.label, 20), ascii(&axis.unit, 20));
    writeln!(out, "{:>10}{:>5}{:>5}{:>5} {label:<20} {unit:<20}", axis.kind, 0, 0, 0)
}

impl Function<'_> {
    /// Writes it.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        begin(out, 58)?;
        for id in &self.id {
            line(out, id)?;
        }
        let name = "NONE";
        let (p, q) = (self.response, self.reference);
        writeln!(
            out,
            "{:>5}{:>10}{:>5}{:>10} {name:<10}{:>10}{:>4} {name:<10}{:>10}{:>4}",
            self.kind, self.number, self.version, 0, p.node, p.direction, q.node, q.direction
        )?;
        let (kind, count, is_even, start, step) = match &self.ordinate {
            Ordinate::Even { start, step, values } => (4, values.len(), 1, *start, *step),
            Ordinate::Uneven(values) => (6, values.len(), 0, 0.0, 0.0),
        };
        writeln!(out, "{kind:>10}{count:>10}{is_even:>10}{}{}{}", short(start), short(step), short(self.z_axis.1))?;
        for quantity in [&self.abscissa, &self.numerator, &self.denominator, &self.z_axis.0] {
            axis(out, quantity)?;
        }
        match &self.ordinate {
            Ordinate::Even { values, .. } => {
                for four in values.chunks(4) {
                    let mut text = String::with_capacity(WIDTH);
                    four.iter().for_each(|value| text.push_str(&long(f64::from(*value))));
                    writeln!(out, "{text}")?;
                }
            }
            Ordinate::Uneven(values) => {
                for (x, real, imaginary) in *values {
                    let mut text = short(*x);
                    let _ = write!(text, "{}{}", long(*real), long(*imaginary));
                    writeln!(out, "{text}")?;
                }
            }
        }
        end(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_columns_in_fortrans_form() {
        assert_eq!(real(-1.5, 20, 11), "  -1.50000000000e+00");
        assert_eq!(real(1e-45, 13, 5), "  1.00000e-45");
        assert_eq!(real(0.0, 13, 5), "  0.00000e+00");
        assert_eq!(real(-f64::from(f32::MAX), 20, 11), "  -3.40282346639e+38");
    }

    #[test]
    fn a_line_of_text_is_never_blank_and_never_longer_than_its_columns() {
        assert_eq!(ascii("  ", 80), "NONE");
        assert_eq!(ascii("Dämpfer\n", 80), "D?mpfer?");
        assert_eq!(ascii(&"x".repeat(100), 80).len(), 80);
    }
}
