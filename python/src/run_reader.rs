//! A run folder, read by the host's reader.

use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::RecordBatch;
use damprig::failure::Failure;
use damprig::report::exports::uff::Uff;
use damprig::report::exports::{ExportSelection, Exporter, RunTable};
use damprig::run_folder::RunFolder;
use damprig::run_folder::read::folder::find;
use damprig::run_folder::read::verify::{Finding, verify};
use damprig::storage::out_file::OutFile;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns::Columns;
use crate::failure::work;

/// An opened run folder.
#[pyclass(frozen, module = "damprig._damprig")]
pub struct RunReader(RunFolder);

impl RunReader {
    fn table<'py>(
        &self,
        py: Python<'py>,
        read: fn(&RunFolder) -> Result<Vec<RecordBatch>, Failure>,
    ) -> PyResult<Bound<'py, PyDict>> {
        work(py, || Ok(Columns::of(&read(&self.0)?)?))?.into_dict(py)
    }
}

#[pymethods]
impl RunReader {
    /// Opens a folder: a path, or the name of a run below `runs/`.
    #[new]
    fn open(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        work(py, || Ok(Self(RunFolder::open(&find(&folder).map_err(Failure::storage)?)?)))
    }

    /// Where it is.
    #[getter]
    fn path(&self) -> PathBuf {
        self.0.path().to_path_buf()
    }

    /// The manifest as JSON.
    fn manifest(&self, py: Python<'_>) -> PyResult<String> {
        work(py, || Ok(serde_json::to_string(self.0.manifest())?))
    }

    /// How the run ended, in words.
    fn ending(&self) -> String {
        self.0.manifest().ending_text()
    }

    /// What verification finds: whether it is in order, and the text.
    fn verify(&self, py: Python<'_>) -> PyResult<Vec<(bool, String)>> {
        work(py, || {
            let found = verify(self.0.path())?.into_iter();
            Ok(found
                .map(|finding| match finding {
                    Finding::Good(text) => (true, text),
                    Finding::Wrong(text) => (false, text),
                })
                .collect())
        })
    }

    /// Writes its signals as a universal file.
    fn write_uff(&self, py: Python<'_>, file: PathBuf) -> PyResult<()> {
        let selection = ExportSelection {
            tables: vec![RunTable::Results, RunTable::Samples],
            set_up: None,
            from_s: 0.0,
            to_s: f64::INFINITY,
            samples_read: Arc::default(),
        };
        work(py, || {
            Uff.export(&self.0, &selection, &OutFile { path: file, force: true })?;
            Ok(())
        })
    }

    /// A row per measured point.
    fn results<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.table(py, RunFolder::results)
    }

    /// A row per record, pulse and free vibration.
    fn transients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.table(py, RunFolder::transients)
    }

    /// A row per measured impact.
    fn impacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.table(py, RunFolder::impacts)
    }

    /// The telemetry, and the files of it that cannot be read.
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        let (columns, damaged) = work(py, || {
            let (mut batches, mut damaged) = (Vec::new(), Vec::new());
            for batch in self.0.samples() {
                match batch {
                    Ok(batch) => batches.push(batch),
                    Err(error) => damaged.push(error.to_string()),
                }
            }
            Ok((Columns::of(&batches)?, damaged))
        })?;
        Ok((columns.into_dict(py)?, damaged))
    }
}
