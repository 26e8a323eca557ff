//! Errors on their way to Python: each kind has its exception in `damprig.errors`, with the words of the command.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use damprig::client::session::SessionError;
use damprig::failure::Failure;
use damprig::runner::RunError;
use damprig_core::control::fault::FaultCause;
use damprig_core::io::Invalid;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// Why a call failed, as Python gets to know it.
pub enum Raised {
    /// `InputError`, `RunFolderError`, `RigError` or `KeyboardInterrupt`.
    Failure(Failure),
    /// `FaultError`: an interlock or the friction damper's spring ended the experiment.
    Fault { message: String, cause: FaultCause, value: f32, limit: f32 },
    /// An exception that is one already: of a signal, or of an argument.
    Exception(PyErr),
}

impl Raised {
    fn exception(self, py: Python<'_>) -> PyErr {
        match self {
            Self::Exception(error) => error,
            Self::Fault { message, cause, value, limit } => fault(py, message, cause, value, limit),
            Self::Failure(Failure::Input(message)) => made(py, "InputError", (message,)),
            Self::Failure(Failure::Disk(message) | Failure::Storage(message)) => made(py, "RunFolderError", (message,)),
            Self::Failure(Failure::Failed(message)) => made(py, "RigError", (message,)),
            Self::Failure(Failure::Interrupted(message)) => PyKeyboardInterrupt::new_err(message),
        }
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
pub fn work<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Raised> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(done) => done.map_err(|failure| failure.exception(py)),
        Err(panic) => Err(made(py, "InternalError", (panic_text(panic.as_ref()),))),
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("a defect of damprig, please report it: {}", text.unwrap_or("no message"))
}

impl From<Failure> for Raised {
    fn from(failure: Failure) -> Self {
        Self::Failure(failure)
    }
}

impl From<serde_json::Error> for Raised {
    fn from(error: serde_json::Error) -> Self {
        Self::Failure(error.into())
    }
}

impl From<Invalid> for Raised {
    fn from(invalid: Invalid) -> Self {
        Self::Failure(invalid.into())
    }
}

impl From<SessionError> for Raised {
    fn from(error: SessionError) -> Self {
        Self::Failure(error.into())
    }
}

impl From<RunError> for Raised {
    fn from(error: RunError) -> Self {
        let message = error.to_string();
        match error {
            RunError::Fault { cause, value, limit, .. } | RunError::Spring { cause, value, limit, .. } => {
                Self::Fault { message, cause, value, limit }
            }
            error => Self::Failure(error.into()),
        }
    }
}

impl From<PyErr> for Raised {
    fn from(error: PyErr) -> Self {
        Self::Exception(error)
    }
}
