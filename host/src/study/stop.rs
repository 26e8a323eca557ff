//! Ends a run of the exact engine when it is not to go on.

use damprig_core::integrator::exact::Observer;

/// Arcs between two questions whether to go on: about a millisecond.
const ARCS_PER_QUESTION: u32 = 1_024;

/// Asks now and then whether a run of the exact engine goes on, and ends it if not.
pub(super) struct Stop<'a> {
    go_on: &'a dyn Fn() -> bool,
    arcs: u32,
    is_stopped: bool,
}

impl<'a> Stop<'a> {
    /// The run goes on while `go_on` says so.
    pub fn unless(go_on: &'a dyn Fn() -> bool) -> Self {
        Self { go_on, arcs: 0, is_stopped: false }
    }

    /// Whether the run was ended.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}

impl Observer for Stop<'_> {
    const ARCS: bool = false;

    fn goes_on(&mut self, _: f64) -> bool {
        self.arcs += 1;
        if self.arcs >= ARCS_PER_QUESTION {
            self.arcs = 0;
            self.is_stopped |= !(self.go_on)();
        }
        !self.is_stopped
    }
}
