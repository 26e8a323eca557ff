//! Errors on their way to Python: each kind has its exception in `damprig.errors`, with the words of the command.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use damprig::client::session::SessionError;
use damprig::input::Refusal;
use damprig::run_folder::{ReadError, StorageError};
use damprig::runner::RunError;
use damprig::study::failure::StudyFailure;
use damprig_core::control::fault::FaultCause;
use damprig_core::io::Invalid;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// Why a call failed.
pub enum Failure {
    /// `InputError`: an argument or a file is wrong.
    Input(String),
    /// `RigError`: the rig or the link failed, or refused.
    Rig(String),
    /// `FaultError`: an interlock or the friction damper's spring ended the experiment.
    Fault { message: String, cause: FaultCause, value: f32, limit: f32 },
    /// `RunFolderError`: a run folder cannot be read or written.
    Folder(String),
    /// An exception that is one already: of a signal, or of an argument.
    Raised(PyErr),
}

impl Failure {
    fn exception(self, py: Python<'_>) -> PyErr {
        let (class, message) = match self {
            Self::Raised(error) => return error,
            Self::Fault { message, cause, value, limit } => return fault(py, message, cause, value, limit),
            Self::Input(message) => ("InputError", message),
            Self::Rig(message) => ("RigError", message),
            Self::Folder(message) => ("RunFolderError", message),
        };
        made(py, class, (message,))
    }
}

fn fault(py: Python<'_>, message: String, cause: FaultCause, value: f32, limit: f32) -> PyErr {
    made(py, "FaultError", (message, cause.text(), f64::from(value), f64::from(limit)))
}

/// An exception of `damprig.errors`, or the error of making it.
fn made<'py>(py: Python<'py>, class: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py.import("damprig.errors").and_then(|module| module.getattr(class)?.call1(arguments));
    made.map_or_else(|error| error, |exception| PyErr::from_value(exception))
}

/// An `InputError`.
pub fn input_error(py: Python<'_>, message: String) -> PyErr {
    made(py, "InputError", (message,))
}

/// Works without the interpreter's lock.
///
/// # Errors
/// Those of the work; a panic is an `InternalError`.
pub fn work<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Failure> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(done) => done.map_err(|failure| failure.exception(py)),
        Err(panic) => Err(made(py, "InternalError", (panic_text(panic.as_ref()),))),
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("a defect of damprig, please report it: {}", text.unwrap_or("no message"))
}

/// The exception of Ctrl-C.
pub fn interrupted() -> Failure {
    Failure::Raised(PyKeyboardInterrupt::new_err("interrupted"))
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        Self::Input(refusal.to_string())
    }
}

impl From<Invalid> for Failure {
    fn from(invalid: Invalid) -> Self {
        Self::Input(invalid.to_string())
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::Folder(error.to_string())
    }
}

impl From<StorageError> for Failure {
    fn from(error: StorageError) -> Self {
        Self::Folder(error.to_string())
    }
}

impl From<StudyFailure> for Failure {
    fn from(error: StudyFailure) -> Self {
        match error {
            StudyFailure::Refused(refusal) => refusal.into(),
            StudyFailure::Storage(error) => error.into(),
            StudyFailure::Damaged(error) => error.into(),
        }
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        RunError::from(error).into()
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        let message = error.to_string();
        match error {
            RunError::Refused(_) => Self::Input(message),
            RunError::Interrupted => interrupted(),
            RunError::Storage(_) => Self::Folder(message),
            RunError::Fault { cause, value, limit, .. } | RunError::Spring { cause, value, limit, .. } => {
                Self::Fault { message, cause, value, limit }
            }
            _ => Self::Rig(message),
        }
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}
