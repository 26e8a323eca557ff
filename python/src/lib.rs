//! The native part of the Python package `damprig`. What users see, with its documentation, is Python (`python/damprig`); here are the
//! calls into the host library, one file per area.
//!
//! Every call releases the interpreter's lock while it works, checks for Ctrl-C twenty times a second, and turns errors into the
//! package's exceptions (`failure`). A panic becomes an exception too.

mod columns;
mod failure;
mod interrupt;
mod looks;
mod native_rig;
mod plain_toml;
mod run_reader;
mod signals;
mod simulation;
mod source;
mod studies;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// Loads what calls need of NumPy. Within a call Ctrl-C could interrupt it there, which its library answers with a panic.
#[pyfunction]
fn load_numpy(py: Python<'_>) {
    let _ = PyArray1::<f64>::zeros(py, 0, false).readonly();
}

#[pymodule]
fn _damprig(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(load_numpy, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::analyse, module)?)?;
    module.add_function(wrap_pyfunction!(signals::read_signals, module)?)?;
    module.add_function(wrap_pyfunction!(signals::response_spectrum, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_run, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_missing, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_rows, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_write, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_open, module)?)?;
    module.add_function(wrap_pyfunction!(studies::study_join, module)?)?;
    module.add_function(wrap_pyfunction!(studies::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(studies::bifurcation, module)?)?;
    module.add_function(wrap_pyfunction!(studies::basins, module)?)?;
    module.add_function(wrap_pyfunction!(studies::optimise, module)?)?;
    module.add_function(wrap_pyfunction!(studies::continuation, module)?)?;
    module.add_function(wrap_pyfunction!(looks::palette, module)?)?;
    module.add_function(wrap_pyfunction!(looks::length_unit, module)?)?;
    module.add_class::<run_reader::RunReader>()?;
    module.add_class::<studies::ParquetTable>()?;
    module.add_class::<native_rig::NativeRig>()
}
