//! A case, a campaign or settings as a user gives them: the path of a file, or a dict with the same keys.

use std::path::{Path, PathBuf};

use damprig::failure::Failure;
use damprig::input::Source;
use damprig::simulation::case::default_name;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{Raised, input_error};
use crate::plain_toml;

/// Where an input comes from.
pub enum Given {
    /// A file.
    File(PathBuf),
    /// A dict, as TOML; its relative files are those of the working directory.
    Text(Box<Source>),
}

/// A study, an optimisation or a continuation as a user gives it.
pub enum Design {
    /// A file.
    File(PathBuf),
    /// A dict, as TOML, with its case if that is a dict too; relative files are those of the working directory.
    Texts(Box<Source>, Option<Box<Source>>),
}

impl Design {
    /// Reads the argument called `name`.
    ///
    /// # Errors
    /// As [`Given::of`].
    pub fn of(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Ok(dict) = argument.cast::<PyDict>() else {
            return Ok(match Given::of(name, argument)? {
                Given::File(path) => Self::File(path),
                Given::Text(text) => Self::Texts(text, None),
            });
        };
        let dict = dict.copy()?;
        let mut case = None;
        if let Some(given) = dict.get_item("case")?
            && let Ok(given) = given.cast::<PyDict>()
        {
            case = Some(Box::new(Source::new("case", plain_toml::text("case", given)?)));
            dict.set_item("case", "case")?;
        }
        Ok(Self::Texts(Box::new(Source::new(name, plain_toml::text(name, &dict)?)), case))
    }

    /// Reads it: `file` reads a file, `text` a text with its name as path and its case.
    ///
    /// # Errors
    /// Those of the reader.
    pub fn read<T>(
        &self,
        file: impl FnOnce(&Path) -> Result<T, Failure>,
        text: impl FnOnce(&Source, &Path, Option<&Source>) -> Result<T, Failure>,
    ) -> Result<T, Raised> {
        Ok(match self {
            Self::File(path) => file(path)?,
            Self::Texts(source, case) => text(source, Path::new(source.name()), case.as_deref())?,
        })
    }
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

    /// Name of a case that states none.
    pub fn name(&self) -> String {
        if let Self::File(path) = self { default_name(path) } else { "case".into() }
    }

    /// The text, for a reader that takes one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn source(self) -> Result<Source, Raised> {
        Ok(match self {
            Self::File(path) => Source::read(&path)?,
            Self::Text(source) => *source,
        })
    }
}
