//! A run with its response and an observer behind a pointer, compiled in this crate.
//!
//! [`Exact::run`] is compiled anew for each observer, in the crate that calls it and at that crate's level of
//! optimisation. [`Exact::run_watched`] is compiled once, here.

use super::motion::Exact;
use super::observe::{Accumulation, Arc, Impact, Observer};
use super::response::Response;

/// Arcs between two calls of [`DynObserver::goes_on`].
const ARCS_PER_CHECK: u32 = 4_096;

/// Receives the events of a run, and the arcs after a given time, through a pointer.
pub trait DynObserver {
    /// Time from which arcs are wanted, s; infinite if none is. Asked at the start of each run.
    fn arcs_from_s(&self) -> f64;

    /// A smooth piece of the motion that ends at or after [`DynObserver::arcs_from_s`].
    fn arc(&mut self, arc: &Arc<'_>);

    /// The particle met a wall at a non-zero speed.
    fn impact(&mut self, impact: &Impact);

    /// Accumulating impacts ended with the particle at rest on a hard wall.
    fn accumulation(&mut self, accumulation: &Accumulation);

    /// Called every few thousand arcs with the present time of the motion: `false` ends the run there.
    fn goes_on(&mut self, time_s: f64) -> bool;
}

struct Watched<'a> {
    response: &'a mut Response,
    observer: &'a mut dyn DynObserver,
    arcs_from_s: f64,
    arcs: u32,
    is_over: bool,
}

impl Observer for Watched<'_> {
    #[inline]
    fn arc(&mut self, arc: &Arc<'_>) {
        self.response.arc(arc);
        if arc.start_s + arc.length_s >= self.arcs_from_s {
            self.observer.arc(arc);
        }
    }

    fn impact(&mut self, impact: &Impact) {
        self.response.impact(impact);
        self.observer.impact(impact);
    }

    fn contact_end(&mut self, end: &super::ContactEnd) {
        self.response.contact_end(end);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.response.accumulation(accumulation);
        self.observer.accumulation(accumulation);
    }

    #[inline]
    fn goes_on(&mut self, time_s: f64) -> bool {
        self.arcs += 1;
        if self.arcs >= ARCS_PER_CHECK && !self.is_over {
            self.arcs = 0;
            self.is_over = !self.observer.goes_on(time_s);
        }
        !self.is_over
    }
}

impl Exact {
    /// Advances like [`Exact::run`] and accumulates the response; `observer` sees the events, and the arcs that it
    /// wants.
    pub fn run_watched(&mut self, until_s: f64, response: &mut Response, observer: &mut dyn DynObserver) {
        let arcs_from_s = observer.arcs_from_s();
        self.run(until_s, &mut Watched { response, observer, arcs_from_s, arcs: 0, is_over: false });
    }
}
