//! Measured signals of files, and response spectra.

use std::path::PathBuf;

use damprig::failure::Failure;
use damprig::input::Files;
use damprig::motion_record::{RecordQuantity, Spec, read};
use damprig::signal_file::unit::Unit;
use damprig::signal_file::{Selector, SensorSensitivity, Signal, SignalAxis, StatedSignal, read as read_file};
use damprig::spectrum::{PeakMethod, spectra};
use numpy::{Complex64, IntoPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{input_error, work};

fn dict(py: Python<'_>, signal: Signal) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", signal.name)?;
    dict.set_item("unit_str", signal.unit_text)?;
    dict.set_item("kind", signal.unit.map(|unit| unit.kind.text()))?;
    dict.set_item("si", signal.unit.map(|unit| unit.si))?;
    dict.set_item("remark", signal.remark)?;
    match signal.axis {
        SignalAxis::Time { start_s, step_s } => {
            dict.set_item("start_s", start_s)?;
            dict.set_item("step_s", step_s)?;
        }
        SignalAxis::Times(times_s) => dict.set_item("time", times_s.into_pyarray(py))?,
        SignalAxis::Frequency { .. } => {
            let places: Vec<f64> = (0..signal.values.len()).map(|n| signal.axis.at(n)).collect();
            dict.set_item("frequency", places.into_pyarray(py))?;
        }
        SignalAxis::Frequencies(places) => dict.set_item("frequency", places.into_pyarray(py))?,
        SignalAxis::Unknown(why) => dict.set_item("unknown", why)?,
    }
    match signal.imaginary {
        Some(imaginary) => {
            let values = signal.values.into_iter().zip(imaginary);
            let values: Vec<Complex64> = values.map(|(re, im)| Complex64::new(re, im)).collect();
            dict.set_item("data", values.into_pyarray(py))?;
        }
        None => dict.set_item("data", signal.values.into_pyarray(py))?,
    }
    Ok(dict)
}

/// The signals of a file, or the one that `FILE#name` selects.
#[pyfunction]
pub fn read_signals(py: Python<'_>, file: PathBuf) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let signals = work(py, || {
        let selector = Selector::of(&file);
        Ok(match selector.which {
            Some(_) => vec![selector.read()?],
            None => read_file(&file)?.signals,
        })
    })?;
    signals.into_iter().map(|signal| dict(py, signal)).collect()
}

/// The columns of a response spectrum: damping ratio, period and the five values of each point.
#[pyfunction]
pub fn response_spectrum<'py>(
    py: Python<'py>,
    record: PathBuf,
    damping: Vec<f64>,
    periods_s: Vec<f64>,
    method: &str,
    unit: Option<&str>,
    sensitivity: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let method = match method {
        "exact" => PeakMethod::Exact,
        "at-samples" => PeakMethod::AtSamples,
        "newmark" => PeakMethod::Newmark,
        other => {
            let text = format!("method = {other:?} is not allowed: must be \"exact\", \"at-samples\" or \"newmark\"");
            return Err(input_error(py, text));
        }
    };
    if let Some(ratio) = damping.iter().find(|ratio| !(0.0..1.0).contains(*ratio)) {
        return Err(input_error(py, format!("damping = {ratio} is not allowed: must be from 0 to below 1")));
    }
    if let Some(period) = periods_s.iter().find(|period| !(**period > 0.0 && period.is_finite())) {
        return Err(input_error(py, format!("periods_s = {period} is not allowed: must be greater than 0")));
    }
    let stated = |name: &str, why: String| input_error(py, format!("{name}: {why}"));
    let spec = Spec {
        quantity: Some(RecordQuantity::Acceleration),
        stated: StatedSignal {
            unit: unit.map(str::parse::<Unit>).transpose().map_err(|why| stated("unit", why))?,
            sensitivity: sensitivity
                .map(str::parse::<SensorSensitivity>)
                .transpose()
                .map_err(|why| stated("sensitivity", why))?,
            calibration: None,
        },
        ..Spec::default()
    };
    let points = work(py, || {
        let read = read(&record, &spec, &Files::default())?;
        let points = spectra(&read, &damping, &periods_s, method);
        Ok(points.map_err(|why| Failure::Input(format!("{}: {why}", record.display())))?)
    })?;
    let dict = PyDict::new(py);
    let column = |name: &str, value: fn(&damprig::spectrum::SpectrumPoint) -> f64| {
        dict.set_item(name, points.iter().map(value).collect::<Vec<f64>>().into_pyarray(py))
    };
    column("damping_ratio", |point| point.damping_ratio)?;
    column("period_s", |point| point.period_s)?;
    column("sd_m", |point| point.sd_m)?;
    column("sv_m_per_s", |point| point.sv_m_per_s)?;
    column("sa_m_per_s2", |point| point.sa_m_per_s2)?;
    column("psv_m_per_s", |point| point.psv_m_per_s)?;
    column("psa_m_per_s2", |point| point.psa_m_per_s2)?;
    Ok(dict)
}
