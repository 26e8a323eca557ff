//! Reads measured quantities from CSV files by the names of their columns, which end in a unit: `t_s`, `x_m` or `x_mm`.

use std::path::Path;

use crate::failure::Failure;
use crate::input::{listed, near, regular};
use crate::motion_record::{RecordRows, rows};

/// A quantity that a column may hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableQuantity {
    /// The column's name without its unit.
    pub stem: &'static str,
    /// Its units and SI units per unit; the SI unit first. An empty name is a column without a unit.
    pub units: &'static [(&'static str, f64)],
    /// Its meaning, for messages.
    pub about: &'static str,
    /// The largest magnitude that is probable, SI.
    pub most: f64,
}

/// Units of time.
pub const SECONDS: &[(&str, f64)] = &[("s", 1.0), ("ms", 1e-3)];
/// Units of length.
pub const METRES: &[(&str, f64)] = &[("m", 1.0), ("mm", 1e-3), ("um", 1e-6)];

/// Time.
pub const TIME: TableQuantity = TableQuantity { stem: "t", units: SECONDS, about: "time", most: 1e6 };
/// Displacement of the structure.
pub const X: TableQuantity =
    TableQuantity { stem: "x", units: METRES, about: "displacement of the structure", most: 0.5 };
/// Displacement of the base.
pub const Z: TableQuantity = TableQuantity { stem: "z", units: METRES, about: "displacement of the base", most: 0.5 };

impl TableQuantity {
    fn name(&self, unit: &str) -> String {
        if unit.is_empty() { self.stem.into() } else { format!("{}_{unit}", self.stem) }
    }

    /// The names that its column may have.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.units.iter().map(|(unit, _)| self.name(unit)).collect()
    }
}

/// A table of numbers with named columns.
#[derive(Debug)]
pub struct NumberTable {
    file: String,
    header: Vec<String>,
    rows: Vec<(u64, Vec<String>)>,
}

impl NumberTable {
    /// Reads a CSV file: its first row names the columns, each row after it has a number in every column.
    ///
    /// # Errors
    /// An unreadable file, a file without a header or without rows.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let file = path.display().to_string();
        let refuse = |text: String| Failure::Input(format!("{file}: {text}"));
        let bytes = regular::read_input(path).map_err(|e| Failure::Input(format!("cannot read {file}: {e}")))?;
        if bytes.contains(&0) {
            return Err(refuse("this is not a text: it must be CSV with a header, or the folder of a run".into()));
        }
        let RecordRows { header, rows } = rows(&String::from_utf8_lossy(&bytes)).map_err(refuse)?;
        let Some(header) = header else {
            let help = "the first row must name the columns with their units, for example t_s,x_m";
            return Err(Failure::Input(format!("{file}: there is no header\n  {help}")));
        };
        if rows.is_empty() {
            return Err(Failure::Input(format!("{file}: it has no row of numbers after the header")));
        }
        Ok(Self { file, header, rows })
    }

    /// The file's name in messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The line of a row in the file.
    #[must_use]
    pub fn line(&self, row: usize) -> u64 {
        self.rows[row].0
    }

    /// Whether the table has a column of a quantity.
    #[must_use]
    pub fn has(&self, quantity: &TableQuantity) -> bool {
        quantity.names().iter().any(|name| self.header.contains(name))
    }

    /// An error of this file.
    #[must_use]
    pub fn refuse(&self, text: impl std::fmt::Display) -> Failure {
        Failure::Input(format!("{}: {text}", self.file))
    }

    /// A column in SI units.
    ///
    /// # Errors
    /// A missing column, with near names; a value that is no number or not probable in its unit, with its line.
    pub fn column(&self, quantity: &TableQuantity) -> Result<Vec<f64>, Failure> {
        let names = quantity.names();
        let place = |name: &String| self.header.iter().position(|column| column == name);
        let found: Vec<(usize, usize)> =
            names.iter().enumerate().filter_map(|(unit, name)| Some((unit, place(name)?))).collect();
        let (unit, column) = match found[..] {
            [only] => only,
            [] => return Err(self.lacks(quantity, &names)),
            _ => {
                let text = format!("the {} is in several columns: keep one of {}", quantity.about, names.join(", "));
                return Err(self.refuse(text));
            }
        };
        let (name, factor) = (&names[unit], quantity.units[unit].1);
        let mut values = Vec::with_capacity(self.rows.len());
        for (line, fields) in &self.rows {
            let width = self.header.len();
            let filled = fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1);
            if filled > width || fields.len() <= column {
                let help = if filled > width {
                    "a decimal comma splits a number: write decimals after a point"
                } else {
                    "two columns may be glued together: separate them by a comma"
                };
                let text = format!("line {line}: {filled} columns where the header names {width}\n  {help}");
                return Err(self.refuse(text));
            }
            let text = &fields[column];
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            let Some(value) = value else {
                return Err(self.refuse(format!(
                    "line {line}: {name} = {text:?} is not allowed: must be a finite number\n  {}",
                    help_for(text)
                )));
            };
            if (value * factor).abs() > quantity.most {
                return Err(self.refuse(format!(
                    "line {line}: {name} = {text} is not probable for the {}: at most {} {} in magnitude\n  check the \
                     unit: the column's name states it, as one of {}",
                    quantity.about,
                    quantity.most,
                    quantity.units[0].0,
                    names.join(", ")
                )));
            }
            values.push(value * factor);
        }
        Ok(values)
    }

    fn lacks(&self, quantity: &TableQuantity, names: &[String]) -> Failure {
        let near = near(&names[0], self.header.iter().map(String::as_str));
        let hint = near.first().map_or(String::new(), |name| format!("; is it {name:?}? rename it in the header"));
        self.refuse(format!(
            "there is no column {} with the {}{hint}\n  the columns are {}",
            names.join(" or "),
            quantity.about,
            listed(self.header.iter().map(String::as_str))
        ))
    }

    /// Times that rise evenly, s.
    ///
    /// # Errors
    /// Names the line of a step back, of a gap and of an uneven step.
    pub fn times(&self) -> Result<Vec<f64>, Failure> {
        let times = self.column(&TIME)?;
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if let Some(n) = steps.iter().position(|step| *step <= 0.0) {
            return Err(self.refuse(format!(
                "line {}: the time {} s is not later than the one before, {} s\n  sort the rows by time and remove \
                 duplicates",
                self.line(n + 1),
                times[n + 1],
                times[n]
            )));
        }
        let uneven = steps.clone();
        steps.sort_by(f64::total_cmp);
        let Some(usual) = steps.get(steps.len() / 2).copied() else { return Ok(times) };
        // Times that are printed with few decimals deviate a little.
        if let Some(n) = uneven.iter().position(|step| (step / usual - 1.0).abs() > 0.25) {
            let (line, step) = (self.line(n + 1), uneven[n]);
            let text = if step > 1.5 * usual {
                format!(
                    "line {line}: a gap of {step:.6} s, where samples are {usual:.6} s apart\n  give the part before or \
                     after the gap as a file of its own"
                )
            } else {
                format!(
                    "line {line}: a step of {step:.6} s, where samples are {usual:.6} s apart: the time is not uniform\n  \
                     resample the record at a constant rate"
                )
            };
            return Err(self.refuse(text));
        }
        Ok(times)
    }
}

/// What is likely wrong with a text that is no number.
fn help_for(text: &str) -> String {
    let signs = text.char_indices().filter(|(at, c)| *at > 0 && (*c == '-' || *c == '+'));
    let is_glued = text.matches('.').count() > 1
        || signs.into_iter().any(|(at, _)| !text[..at].ends_with(['e', 'E']) && text[..at].parse::<f64>().is_ok());
    if text.is_empty() {
        "a value is missing: remove the row, or cut the record before it".into()
    } else if text.to_lowercase().contains("nan") || text.to_lowercase().contains("inf") {
        "the sensor gave no value here: cut the record before or after it".into()
    } else if is_glued {
        "two values are glued together: separate the columns by a comma".into()
    } else {
        "write numbers with a decimal point, and one value in each column".into()
    }
}
