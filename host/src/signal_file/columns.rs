//! Signals of named columns of numbers, of which one may be the times.

use super::complex::{frequencies, frequency_column, paired};
use super::unit::{Unit, UnitKind};
use super::{Signal, SignalAxis};

/// A column: name, unit as the file writes it, values, imaginary parts.
pub(super) struct FileColumn {
    pub(super) name: String,
    pub(super) unit_text: String,
    pub(super) values: Vec<f64>,
    pub(super) imaginary: Option<Vec<f64>>,
}

/// A signal of each column. Columns that are as long as a column of times in a unit of time have these times; others, that are as long
/// as one of frequencies in Hz, have these. Two columns of the parts of a complex value are one signal.
pub(super) fn signals(columns: Vec<FileColumn>, remarks: &mut Vec<String>) -> Vec<Signal> {
    let is_time = |column: &FileColumn| {
        Unit::of(&column.unit_text).is_some_and(|unit| unit.kind == UnitKind::Time) && column.imaginary.is_none()
    };
    let columns = columns.into_iter().filter(|column| !column.values.is_empty());
    let (times, others): (Vec<FileColumn>, Vec<FileColumn>) = columns.partition(is_time);
    for time in &times {
        if !time.values.windows(2).all(|pair| pair[1] > pair[0]) {
            remarks.push(format!("The times {:?} do not always rise: they are not used.", time.name));
        }
    }
    let time_axis = |length: usize| {
        let own = times
            .iter()
            .find(|time| time.values.len() == length && time.values.windows(2).all(|pair| pair[1] > pair[0]))?;
        let si = Unit::of(&own.unit_text).map_or(1.0, |unit| unit.si);
        Some(SignalAxis::of_times(own.values.iter().map(|t| t * si).collect()))
    };
    let frequency = |length: usize| {
        let of_length =
            others.iter().enumerate().filter(|(_, column)| column.values.len() == length && column.imaginary.is_none());
        frequency_column(of_length.map(|(n, column)| (n, column.name.as_str(), column.unit_text.as_str())))
    };
    let mut found = Vec::new();
    for (n, column) in others.iter().enumerate() {
        let length = column.values.len();
        let axis = match (time_axis(length), frequency(length)) {
            (Some(axis), _) => axis,
            (None, Some((own, _))) if own == n => continue,
            (None, Some((own, si))) => frequencies(&others[own].values, si),
            (None, None) => SignalAxis::Unknown("the file states no times with a unit for it".into()),
        };
        let mut signal = Signal::new(column.name.clone(), column.unit_text.clone(), axis, column.values.clone());
        signal.imaginary.clone_from(&column.imaginary);
        found.push(signal);
    }
    paired(found)
}
