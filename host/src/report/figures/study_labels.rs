//! Names of a study's axes as the field writes them: d/Z, e, μi.

use super::symbols;
use crate::study::Study;
use crate::study::axis::Axis;

/// The symbol of the case's reference length at the first point.
fn reference(study: &Study) -> &'static str {
    let first = study.points.values(&study.axes, 0, 0);
    study.case_with(&first).map_or("Z", |case| symbols::reference(&case))
}

/// Quantity and unit of an axis: `d/Z`, `f (Hz)`; the key where it has no symbol.
#[must_use]
pub fn label(study: &Study, axis: &Axis) -> String {
    symbols::label(&axis.key, || reference(study))
}

/// Name of an axis before a value: `d/Z`, `f`; the key without its tables where it has no symbol.
#[must_use]
pub fn name(study: &Study, axis: &Axis) -> String {
    symbols::name(&axis.key, || reference(study))
}
