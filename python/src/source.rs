//! A case, a campaign or settings as a user gives them: the path of a file, or a dict with the same keys.

use std::path::PathBuf;

use damprig::input::Source;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{Failure, input_error};
use crate::plain_toml;

/// Where an input comes from.
pub enum Given {
    /// A file.
    File(PathBuf),
    /// A dict, as TOML; its relative files are those of the working directory.
    Text(Box<Source>),
}

impl Given {
    /// Reads the argument called `name`.
    ///
    /// # Errors
    /// Neither a path nor a dict; a value of the dict that no file can have.
    pub fn of(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(dict) = argument.cast::<PyDict>() {
            return Ok(Self::Text(Box::new(Source::new(name, plain_toml::text(name, dict)?))));
        }
        if let Ok(path) = argument.extract::<PathBuf>() {
            return Ok(Self::File(path));
        }
        let kind = argument.get_type().name()?;
        let message = format!("{name}: must be the path of a file, or a dict with the keys of one, not {kind}");
        Err(input_error(argument.py(), message))
    }

    /// The text, for a reader that takes one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn source(self) -> Result<Source, Failure> {
        Ok(match self {
            Self::File(path) => Source::read(&path)?,
            Self::Text(source) => *source,
        })
    }
}
