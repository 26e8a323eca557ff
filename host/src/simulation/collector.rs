//! Collects the results of a simulation run, and runs it in parts so that it can be stopped.

use super::Case;
use super::motion::{AccumulationRecord, ContactRecord, ImpactRecord, StateSamples, Viewer};
use super::result::ContactFigures;
use super::statistics::LastCyclesMeter;

/// Most impacts, and most accumulations, kept in a result. Later ones are only counted.
pub const MAX_IMPACTS: usize = 1_000_000;

/// Most accumulations kept in a result without impacts: enough for a line of text.
pub const MAX_ACCUMULATIONS_WITHOUT_IMPACTS: usize = 8;

/// Options of a run.
pub struct RunOptions<'a> {
    /// Keep the impacts and the states at the case's sample times. Memory grows with them.
    pub keep: bool,
    /// Longest simulated time between two calls of `go_on`, s.
    pub longest_part_s: f64,
    /// Called with the simulated time, s, after each part and after every few thousand arcs inside one. `false` stops the
    /// run there; once `false` it must stay `false`.
    pub go_on: &'a mut dyn FnMut(f64) -> bool,
}

/// Lists impacts, contacts with Hertz walls and accumulations, up to their limits.
#[derive(Debug, Default)]
pub(super) struct EventLog {
    /// Impacts; `None` if they are not kept.
    pub impacts: Option<Vec<ImpactRecord>>,
    pub contacts: Vec<ContactRecord>,
    pub accumulations: Vec<AccumulationRecord>,
    /// Of all contacts.
    pub contact_figures: Option<ContactFigures>,
}

impl Viewer for EventLog {
    fn pieces_from_s(&self) -> f64 {
        f64::INFINITY
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if let Some(kept) = self.impacts.as_mut().filter(|kept| kept.len() < MAX_IMPACTS) {
            kept.push(*impact);
        }
    }

    fn contact(&mut self, contact: &ContactRecord) {
        if self.impacts.is_some() && self.contacts.len() < MAX_IMPACTS {
            self.contacts.push(*contact);
        }
        self.contact_figures.get_or_insert_default().add(contact);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let most = if self.impacts.is_some() { MAX_IMPACTS } else { MAX_ACCUMULATIONS_WITHOUT_IMPACTS };
        if self.accumulations.len() < most {
            self.accumulations.push(*accumulation);
        }
    }
}

/// Collects states, events and the last cycles of a run, and passes the motion on to the caller's viewer.
pub(super) struct Collector<'v, V> {
    pub samples: StateSamples,
    pub events: EventLog,
    pub last_cycles: Option<LastCyclesMeter>,
    pub viewer: &'v mut V,
}

impl<'v, V: Viewer> Collector<'v, V> {
    pub fn new(case: &Case, keep: bool, viewer: &'v mut V) -> Self {
        Self {
            samples: StateSamples::at(if keep { case.run.sample_times_s.clone() } else { Vec::new() }),
            events: EventLog { impacts: keep.then(Vec::new), ..EventLog::default() },
            last_cycles: LastCyclesMeter::new(case.cycle_s(), case.run.duration_s),
            viewer,
        }
    }

    /// All of them as one viewer.
    pub fn all(&mut self) -> impl Viewer {
        ((&mut self.samples, &mut self.events), (&mut self.last_cycles, &mut *self.viewer))
    }
}

/// Calls `advance` with the end of each part until the run is over or stopped. `advance` returns the time reached.
pub(super) fn run_in_parts<V: Viewer>(
    duration_s: f64,
    options: RunOptions,
    collector: &mut Collector<'_, V>,
    mut advance: impl FnMut(f64, &mut Collector<'_, V>, &mut dyn FnMut(f64) -> bool) -> f64,
) {
    let count = (duration_s / options.longest_part_s).ceil().max(1.0);
    let mut part = 0.0;
    while part < count {
        part += 1.0;
        let until_s = if part >= count { duration_s } else { duration_s * (part / count) };
        let reached_s = advance(until_s, collector, options.go_on);
        if collector.viewer.is_done() || (part < count && !(options.go_on)(reached_s)) {
            return;
        }
    }
}
