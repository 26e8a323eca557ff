//! How the command's figures look, for those of `damprig.plots`.

use damprig::report::plot::axis;
use damprig::report::plot::palette::{COLOURS, INK, MARKED, WALL, colour};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Colours of curves, text, walls and marks, as `#rrggbb`.
#[pyfunction]
pub fn palette(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("colours", (0..COLOURS).map(|place| colour(place).to_string()).collect::<Vec<_>>())?;
    for (name, colour) in [("ink", INK), ("wall", WALL), ("marked", MARKED)] {
        all.set_item(name, colour.to_string())?;
    }
    Ok(all)
}

/// Unit of displacements up to a length in m: its name and the number of units per metre.
#[pyfunction]
pub fn length_unit(largest_m: f64) -> (&'static str, f64) {
    axis::length_unit(largest_m)
}
