//! Names of a study's axes and metrics as the field writes them: d/Z, X/x0.

use super::symbols;
use crate::quantity::Quantity;
use crate::study::Study;
use crate::study::axis::StudyAxis;

/// The symbol of the case's reference length at the first point.
fn reference(study: &Study) -> &'static str {
    let first = study.points.values(&study.axes, 0, 0);
    study.case_with(&first).map_or("Z", |case| symbols::reference(&case))
}

/// Quantity and unit of an axis: `d/Z`, `f (Hz)`; the key where it has no symbol.
#[must_use]
pub fn label(study: &Study, axis: &StudyAxis) -> String {
    symbols::label(&axis.key, || reference(study))
}

/// Name of an axis before a value: `d/Z`, `f`; the key without its tables where it has no symbol.
#[must_use]
pub fn name(study: &Study, axis: &StudyAxis) -> String {
    symbols::name(&axis.key, || reference(study))
}

/// The reference length of a ratio of lengths; nothing for other metrics.
fn reference_of(study: &Study, metric: Quantity) -> &'static str {
    if metric.is_ratio() { reference(study) } else { "" }
}

/// Label of a metric on an axis or a colour scale: `X/Z (cycle maxima)`, `RMS of x/x0`.
#[must_use]
pub fn metric_label(study: &Study, metric: Quantity) -> String {
    metric.axis_label(reference_of(study, metric))
}

/// Meaning of a metric in a caption: `RMS of x over x0`.
#[must_use]
pub fn metric_meaning(study: &Study, metric: Quantity) -> String {
    metric.meaning(reference_of(study, metric))
}
