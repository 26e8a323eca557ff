//! Points of a frequency response from a table.

use std::f64::consts::PI;

use super::Sensors;
use super::response::{DrivenBy, Point, Response};
use super::table::{NumberTable, TableQuantity, X, Z};
use crate::failure::Failure;

const FREQUENCY: TableQuantity =
    TableQuantity { stem: "frequency", units: &[("hz", 1.0)], about: "drive frequency", most: 1e4 };
const PHASE: TableQuantity = TableQuantity {
    stem: "phase",
    units: &[("rad", 1.0), ("deg", PI / 180.0)],
    about: "phase of x relative to z, or to the force",
    most: 10.0,
};
const FORCE: TableQuantity =
    TableQuantity { stem: "force", units: &[("n", 1.0)], about: "force on the structure", most: 1e5 };

/// The points of a table: of x and z, or of x and a force.
///
/// # Errors
/// Missing columns; values that are not positive.
pub fn points(table: &NumberTable) -> Result<Response, Failure> {
    let driven_by = if table.has(&FORCE) && !table.has(&Z) { DrivenBy::Force } else { DrivenBy::Base };
    let drive = if driven_by == DrivenBy::Force { &FORCE } else { &Z };
    let (f, x, z) = (table.column(&FREQUENCY)?, table.column(&X)?, table.column(drive)?);
    let phase = if table.has(&PHASE) { Some(table.column(&PHASE)?) } else { None };
    let points: Result<Vec<Point>, Failure> = (0..f.len())
        .map(|row| {
            if !(f[row] > 0.0 && x[row] > 0.0 && z[row] > 0.0) {
                let text = format!("line {}: frequency and amplitudes must be greater than 0", table.line(row));
                return Err(table.refuse(text));
            }
            let phase_rad = phase.as_ref().map(|phase| phase[row]);
            Ok(Point { frequency_hz: f[row], ratio: x[row] / z[row], phase_rad, uncertainty: None, x_m: x[row] })
        })
        .collect();
    let (taken_from, sensors) = (table.file().into(), Sensors::ASSUMED);
    Ok(Response { taken_from, driven_by, points: points?, sensors, remarks: Vec::new() })
}
