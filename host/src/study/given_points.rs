//! Points from outside: keys of the case, and at each point a number for each of them.

use std::collections::HashSet;
use std::io;
use std::sync::Arc;

use super::axis::{AxisValues, StudyAxis, is_key};
use crate::input::Span;
use crate::motion_record::rows;
use crate::signal_file::number::finite;

/// Points from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenPoints {
    /// The keys with their tables, as in the case.
    pub keys: Vec<String>,
    /// For each point a number for each key, in the key's unit.
    pub rows: Arc<Vec<Vec<f64>>>,
}

impl GivenPoints {
    /// From keys and rows.
    ///
    /// # Errors
    /// A key that no case can have or that is there twice, a row with another number of values, a value that is not finite, no row.
    pub fn new(keys: Vec<String>, rows: Vec<Vec<f64>>) -> Result<Self, String> {
        check_keys(&keys)?;
        if rows.is_empty() {
            return Err("there is no point: give a row of numbers for each".into());
        }
        for (point, row) in rows.iter().enumerate() {
            if row.len() != keys.len() {
                return Err(format!("point {point} has {} values for {} keys", row.len(), keys.len()));
            }
            if let Some(place) = row.iter().position(|value| !value.is_finite()) {
                return Err(format!("point {point}: {} = {} is not a finite number", keys[place], row[place]));
            }
        }
        Ok(Self { keys, rows: Arc::new(rows) })
    }

    /// From a CSV file: a line of keys, then a line of numbers for each point.
    ///
    /// # Errors
    /// As [`Self::new`], with the line; a file that cannot be read, has no line of keys, or a value that is no number.
    pub fn of_csv(bytes: io::Result<Vec<u8>>) -> Result<Self, String> {
        let bytes = bytes.map_err(|error| format!("it cannot be read: {error}"))?;
        let text = String::from_utf8(bytes).map_err(|_| "it is not UTF-8 text".to_string())?;
        let table = rows(&text)?;
        let keys =
            table.header.ok_or("its first line must have the keys that the columns are of: particle.clearance_m")?;
        check_keys(&keys)?;
        let mut points = Vec::with_capacity(table.rows.len());
        for (line, fields) in table.rows {
            if fields.len() != keys.len() {
                return Err(format!("line {line} has {} values for {} keys", fields.len(), keys.len()));
            }
            let number = |(key, field): (&String, &String)| {
                let hint = if field.contains(',') { "; write a decimal point" } else { "" };
                finite(field).ok_or_else(|| format!("line {line}: {key} = {field:?} is not a finite number{hint}"))
            };
            points.push(keys.iter().zip(&fields).map(number).collect::<Result<Vec<f64>, String>>()?);
        }
        Self::new(keys, points)
    }

    /// An axis for each key, which the study file has at `span`.
    #[must_use]
    pub fn axes(&self, span: &Span) -> Vec<StudyAxis> {
        let axis = |(place, key): (usize, &String)| {
            let values = || self.rows.iter().map(|row| row[place]);
            let (from, to) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            let values = AxisValues::Given { from, to };
            StudyAxis {
                key: key.clone(),
                values,
                is_log: false,
                reduce: None,
                span: span.clone(),
                value_spans: Vec::new(),
            }
        };
        self.keys.iter().enumerate().map(axis).collect()
    }
}

fn check_keys(keys: &[String]) -> Result<(), String> {
    let mut seen = HashSet::new();
    for (place, key) in keys.iter().enumerate() {
        if !is_key(key) {
            let place = place + 1;
            return Err(format!(
                "column {place} is {key:?}, not a key of the case with its tables, as particle.clearance_m"
            ));
        }
        if !seen.insert(key) {
            return Err(format!("{key} is there twice"));
        }
    }
    if keys.is_empty() { Err("there is no key".into()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<GivenPoints, String> {
        GivenPoints::of_csv(Ok(text.into()))
    }

    #[test]
    fn a_csv_file_has_a_line_of_keys_and_a_line_for_each_point() {
        let points = of("particle.clearance_m, particle.wall.coefficient\n0.001,0.5\n# a comment\n3e-3, .7\n").unwrap();
        assert_eq!(points.keys, ["particle.clearance_m", "particle.wall.coefficient"]);
        assert_eq!(*points.rows, [[0.001, 0.5], [0.003, 0.7]]);
        let ends = points.axes(&(0..0)).into_iter().map(|axis| axis.values).collect::<Vec<_>>();
        assert_eq!(ends, [AxisValues::Given { from: 0.001, to: 0.003 }, AxisValues::Given { from: 0.5, to: 0.7 }]);
    }

    #[test]
    fn a_wrong_file_is_refused_with_its_line_and_key() {
        for (text, words) in [
            ("", "first line"),
            ("0.1,0.2\n", "first line"),
            ("a.b\n", "no point"),
            ("a.b,a.b\n1,2\n", "a.b is there twice"),
            ("a b,c\n1,2\n", "column 1 is \"a b\""),
            ("a.b,c\n1,2\n3\n", "line 3 has 1 values for 2 keys"),
            ("a.b,c\n1,2\n3,x\n", "line 3: c = \"x\" is not a finite number"),
            ("a.b,c\n1,nan\n", "line 2: c = \"nan\""),
            ("a.b;c\n0,1;2\n", "line 2: a.b = \"0,1\" is not a finite number; write a decimal point"),
        ] {
            let why = of(text).unwrap_err();
            assert!(why.contains(words), "{text:?}: {why}");
        }
        assert!(GivenPoints::new(vec!["a".into()], vec![vec![f64::NAN]]).unwrap_err().contains("point 0: a = NaN"));
    }
}
