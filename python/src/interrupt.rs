//! Looks for Ctrl-C while native code works.

use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::failure::Raised;
use damprig::failure::Failure;

/// Time between two looks.
pub const EVERY: Duration = Duration::from_millis(50);

/// Remembers what a signal's handler raised. Python runs handlers in the main thread only; in another thread nothing is found.
pub struct Interrupt {
    looked: Instant,
    raised: Option<Raised>,
}

impl Interrupt {
    /// From now on.
    pub fn new() -> Self {
        Self { looked: Instant::now(), raised: None }
    }

    /// Whether the work goes on; never again after a `false`.
    pub fn goes_on(&mut self) -> bool {
        if self.raised.is_none() && self.looked.elapsed() >= EVERY {
            self.looked = Instant::now();
            self.raised = match Python::try_attach(|py| py.check_signals()) {
                Some(Ok(())) => None,
                Some(Err(error)) => Some(Raised::Exception(error)),
                // The interpreter is shutting down.
                None => Some(Failure::stopped().into()),
            };
        }
        self.raised.is_none()
    }

    /// Calls into Python while the work goes on; an exception there ends it.
    pub fn call(&mut self, call: impl FnOnce(Python<'_>) -> PyResult<()>) {
        if self.raised.is_none()
            && let Some(Err(error)) = Python::try_attach(call)
        {
            self.raised = Some(Raised::Exception(error));
        }
    }

    /// What was raised.
    ///
    /// # Errors
    /// The exception of the handler: `KeyboardInterrupt` for Ctrl-C.
    pub fn check(self) -> Result<(), Raised> {
        self.raised.map_or(Ok(()), Err)
    }
}
