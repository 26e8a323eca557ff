//! Writes datasets of universal files (UFF, UNV) in fixed ASCII columns: 151 (header), 164 (units) and 58 (function at nodal
//! DOF), as listed by the Structural Dynamics Research Laboratory. [`super::uff`] supplies the contents.

use std::fmt::Write as _;
use std::io::{self, Write};

/// Columns of a text line.
const WIDTH: usize = 80;

/// A quantity on an axis: records 8 to 11 of dataset 58.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct AxisRecord {
    /// Specific data type: 0 unknown, 8 displacement, 9 reaction force, 11 velocity, 12 acceleration, 17 time, 18 frequency.
    pub kind: u8,
    /// Label.
    pub label: String,
    /// Unit.
    pub unit: String,
}

impl AxisRecord {
    pub(super) fn new(kind: u8, label: &str, unit: &str) -> Self {
        Self { kind, label: label.into(), unit: unit.into() }
    }

    /// An unused axis.
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

/// The values of a function.
#[derive(Clone, Debug)]
pub(super) enum OrdinateData<'a> {
    /// Real values, evenly spaced by `step` from `start`: format 4E20.12.
    Even { start: f64, step: f64, values: &'a [f32] },
    /// Complex values with their abscissa: format E13.5,2E20.12.
    Uneven(&'a [(f64, f64, f64)]),
}

/// A dataset 58.
#[derive(Clone, Debug)]
pub(super) struct FunctionRecord<'a> {
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
    pub ordinate: OrdinateData<'a>,
    pub abscissa: AxisRecord,
    pub numerator: AxisRecord,
    pub denominator: AxisRecord,
    /// Quantity and value on the z axis.
    pub z_axis: (AxisRecord, f64),
}

/// At most `width` columns of ASCII; other characters become `?`. A blank line becomes `NONE`.
fn ascii(text: &str, width: usize) -> String {
    let plain: String =
        text.chars().take(width).map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect();
    if plain.trim().is_empty() { "NONE".into() } else { plain }
}

/// `value` in Fortran's E format: `digits` after the point, two-digit exponent, right-aligned in `width` columns.
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

/// Dataset 151: model, description, program; `date_time` is `DD-MMM-YY HH:MM:SS`.
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

fn axis(out: &mut impl Write, axis: &AxisRecord) -> io::Result<()> {
    let (label, unit) = (ascii(&axis.label, 20), ascii(&axis.unit, 20));
    writeln!(out, "{:>10}{:>5}{:>5}{:>5} {label:<20} {unit:<20}", axis.kind, 0, 0, 0)
}

impl FunctionRecord<'_> {
    /// Writes dataset 58.
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
            OrdinateData::Even { start, step, values } => (4, values.len(), 1, *start, *step),
            OrdinateData::Uneven(values) => (6, values.len(), 0, 0.0, 0.0),
        };
        writeln!(out, "{kind:>10}{count:>10}{is_even:>10}{}{}{}", short(start), short(step), short(self.z_axis.1))?;
        for quantity in [&self.abscissa, &self.numerator, &self.denominator, &self.z_axis.0] {
            axis(out, quantity)?;
        }
        match &self.ordinate {
            OrdinateData::Even { values, .. } => {
                for four in values.chunks(4) {
                    let mut text = String::with_capacity(WIDTH);
                    four.iter().for_each(|value| text.push_str(&long(f64::from(*value))));
                    writeln!(out, "{text}")?;
                }
            }
            OrdinateData::Uneven(values) => {
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
    fn numbers_have_fortrans_form() {
        assert_eq!(real(-1.5, 20, 11), "  -1.50000000000e+00");
        assert_eq!(real(1e-45, 13, 5), "  1.00000e-45");
        assert_eq!(real(0.0, 13, 5), "  0.00000e+00");
        assert_eq!(real(-f64::from(f32::MAX), 20, 11), "  -3.40282346639e+38");
    }

    #[test]
    fn a_text_line_is_never_blank_or_too_long() {
        assert_eq!(ascii("  ", 80), "NONE");
        assert_eq!(ascii("Dämpfer\n", 80), "D?mpfer?");
        assert_eq!(ascii(&"x".repeat(100), 80).len(), 80);
    }
}
