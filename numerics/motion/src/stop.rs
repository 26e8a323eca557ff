//! Runs of the exact engine with their response, compiled in this crate and so at its level of optimisation. They end early when they
//! are not to go on.

use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Observer};

use super::{ExactObserver, Viewer};

/// Arcs between two questions whether to go on: about a millisecond.
const ARCS_PER_QUESTION: u32 = 4_096;

/// Asks now and then whether a run of the exact engine goes on, and ends it if not.
pub struct Stop<'a> {
    go_on: &'a mut dyn FnMut(f64) -> bool,
    arcs: u32,
    is_stopped: bool,
}

impl<'a> Stop<'a> {
    /// The run goes on while `go_on`, which gets the time of the motion, s, says so.
    #[must_use]
    pub fn unless(go_on: &'a mut dyn FnMut(f64) -> bool) -> Self {
        Self { go_on, arcs: 0, is_stopped: false }
    }

    /// Whether the run was ended.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}

impl Observer for Stop<'_> {
    const ARCS: bool = false;

    #[inline]
    fn goes_on(&mut self, time_s: f64) -> bool {
        self.arcs += 1;
        if self.arcs >= ARCS_PER_QUESTION {
            self.arcs = 0;
            self.is_stopped |= !(self.go_on)(time_s);
        }
        !self.is_stopped
    }
}

/// Advances a motion to `until_s`, or until `go_on` says no, adds to its response, and shows it to a viewer.
pub fn run_viewed(
    motion: &mut Exact,
    until_s: f64,
    response: &mut Response,
    viewer: &mut dyn Viewer,
    go_on: &mut dyn FnMut(f64) -> bool,
) {
    motion.run(until_s, &mut (response, (ExactObserver::new(viewer), Stop::unless(go_on))));
}

/// The response of a motion from a whole cycle on until `until_s`; `None` if it was stopped. `first_cycle` begins at `from_s`; what is
/// before it is not measured.
#[must_use]
pub fn response_from(
    motion: &mut Exact,
    from: (u64, f64),
    until_s: f64,
    wanted: Wanted,
    go_on: &dyn Fn() -> bool,
) -> Option<Response> {
    measured(motion, from, (None, until_s), wanted, go_on).map(|(response, _)| response)
}

/// The same with the motion as it is at `at_s`, at most `until_s`.
#[must_use]
pub fn response_and_motion(
    motion: &mut Exact,
    from: (u64, f64),
    (at_s, until_s): (f64, f64),
    wanted: Wanted,
    go_on: &dyn Fn() -> bool,
) -> Option<(Response, Exact)> {
    let (response, there) = measured(motion, from, (Some(at_s), until_s), wanted, go_on)?;
    Some((response, there?))
}

fn measured(
    motion: &mut Exact,
    (first_cycle, from_s): (u64, f64),
    (at_s, until_s): (Option<f64>, f64),
    wanted: Wanted,
    go_on: &dyn Fn() -> bool,
) -> Option<(Response, Option<Exact>)> {
    let mut go_on = |_: f64| go_on();
    let mut stop = Stop::unless(&mut go_on);
    let mut there = None;
    if let Some(at_s) = at_s.filter(|at_s| *at_s <= from_s) {
        motion.run(at_s, &mut stop);
        there = Some(motion.clone());
    }
    motion.run(from_s, &mut stop);
    let mut response = Response::new(wanted);
    response.skip_to(first_cycle);
    if let Some(at_s) = at_s.filter(|at_s| *at_s > from_s) {
        motion.run(at_s, &mut (&mut response, &mut stop));
        there = Some(motion.clone());
    }
    motion.run(until_s, &mut (&mut response, &mut stop));
    response.finish(motion.time_s());
    (!stop.is_stopped()).then_some((response, there))
}
