//! Signals of named columns of numbers, of which one may be the times.

use super::unit::{Kind, Unit};
use super::{Axis, Signal};

/// A column: name, unit as the file writes it, values, imaginary parts.
pub(super) struct Column {
    pub(super) name: String,
    pub(super) unit_text: String,
    pub(super) values: Vec<f64>,
    pub(super) imaginary: Option<Vec<f64>>,
}

/// A signal of each column. Columns that are as long as a column of times in a unit of time have these times.
pub(super) fn signals(columns: Vec<Column>, remarks: &mut Vec<String>) -> Vec<Signal> {
    let is_time = |column: &Column| {
        Unit::of(&column.unit_text).is_some_and(|unit| unit.kind == Kind::Time) && column.imaginary.is_none()
    };
    let columns = columns.into_iter().filter(|column| !column.values.is_empty());
    let (times, others): (Vec<Column>, Vec<Column>) = columns.partition(is_time);
    for time in &times {
        if !time.values.windows(2).all(|pair| pair[1] > pair[0]) {
            remarks.push(format!("The times {:?} do not always rise: they are not used.", time.name));
        }
    }
    let axis = |length: usize| {
        let own = times
            .iter()
            .find(|time| time.values.len() == length && time.values.windows(2).all(|pair| pair[1] > pair[0]));
        match own {
            Some(time) => {
                let si = Unit::of(&time.unit_text).map_or(1.0, |unit| unit.si);
                Axis::of_times(time.values.iter().map(|t| t * si).collect())
            }
            None => Axis::Unknown("the file states no times with a unit for it".into()),
        }
    };
    let signal = |column: Column| {
        let axis = axis(column.values.len());
        let mut signal = Signal::new(column.name, column.unit_text, axis, column.values);
        signal.imaginary = column.imaginary;
        signal
    };
    others.into_iter().map(signal).collect()
}
