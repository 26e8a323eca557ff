//! Computes the parts that `damprig-thesis` lacks, with their progress.

use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use indicatif::ProgressBar;

use crate::catalogue::{self, Catalogue};
use crate::run::{self, Ending, Task};
use damprig::cli::ctrl_c::CtrlC;
use damprig::cli::output::{print, print_error};
use damprig::cli::progress;
use damprig::failure::{Failure, Outcome};
use damprig::input::shown_in_line;
use damprig::report::numbers::duration;

/// Computes what is not complete; says nothing about parts that succeed if `is_silent`. The inner outcome is how that ended: the results
/// so far are kept.
pub(super) fn compute(catalogue: &Catalogue, tasks: &[Task], is_silent: bool) -> Result<Outcome, Failure> {
    let open: Vec<&Task> = tasks.iter().filter(|task| !task.is_complete).collect();
    if open.is_empty() {
        return Ok(Ok(()));
    }
    let ctrl_c = CtrlC::watch()?;
    let estimate_s: f64 = open.iter().map(|task| task.estimate_s).sum();
    if !is_silent {
        let (parts, all) = (open.len(), tasks.len());
        let cores = rayon::current_num_threads();
        print(&format!("{parts} of {all} parts to compute, about {} on {cores} cores", duration(estimate_s)));
    }
    let work = WorkArgs {
        catalogue,
        open: &open,
        bar: progress::bar((1e3 * estimate_s) as u64),
        ctrl_c: &ctrl_c,
        is_silent,
        state: Mutex::new(WorkState { shares: vec![0.0; open.len()], complete: 0, failure: None }),
    };
    // A virtual rig leaves cores free, so the other parts are computed beside it.
    let is_campaign = |&n: &usize| matches!(open[n].part.work, catalogue::Work::Campaign(_));
    let (campaigns, others): (Vec<usize>, Vec<usize>) = (0..open.len()).partition(is_campaign);
    thread::scope(|scope| {
        scope.spawn(|| work.one_by_one(&campaigns));
        work.one_by_one(&others);
    });
    work.bar.finish_and_clear();
    let state = work.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    if ctrl_c.is_pressed() && state.complete < open.len() {
        let message =
            format!("stopped after {} of {} parts; the same command goes on with them", state.complete, open.len());
        return Ok(Err(Failure::Interrupted(message)));
    }
    Ok(state.failure.map_or(Ok(()), Err))
}

/// Parts to compute.
struct WorkArgs<'a> {
    catalogue: &'a Catalogue,
    open: &'a [&'a Task<'a>],
    bar: ProgressBar,
    ctrl_c: &'a CtrlC,
    is_silent: bool,
    state: Mutex<WorkState>,
}

/// What was computed so far.
struct WorkState {
    /// Share of each part that is done, 0 to 1.
    shares: Vec<f64>,
    complete: usize,
    /// The first.
    failure: Option<Failure>,
}

impl WorkArgs<'_> {
    /// Computes some of the parts until it is stopped; goes on after one that fails.
    fn one_by_one(&self, parts: &[usize]) {
        for &n in parts {
            if self.is_stopped() {
                return;
            }
            let task = self.open[n];
            self.bar.set_message(shown_in_line(&format!("{}: {}", task.item.name, task.part.title)).into_owned());
            let start = Instant::now();
            let report = |share: f64| {
                self.reach(n, share);
                !self.is_stopped()
            };
            match run::run(self.catalogue, task, &report) {
                Ok(Ending::Complete) => self.complete(task, start),
                Ok(Ending::Stopped) => return,
                Err(error) => self.fail(task, error),
            }
            self.reach(n, 1.0);
        }
    }

    fn is_stopped(&self) -> bool {
        self.ctrl_c.is_pressed()
    }

    fn with_state<T>(&self, what: impl FnOnce(&mut WorkState) -> T) -> T {
        what(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn reach(&self, n: usize, share: f64) {
        let done_s = self.with_state(|state| {
            state.shares[n] = share.clamp(0.0, 1.0);
            self.open.iter().zip(&state.shares).map(|(task, share)| share * task.estimate_s).sum::<f64>()
        });
        self.bar.set_position((1e3 * done_s) as u64);
    }

    fn complete(&self, task: &Task, start: Instant) {
        self.with_state(|state| state.complete += 1);
        if !self.is_silent {
            let took = duration(start.elapsed().as_secs_f64());
            self.bar.suspend(|| print(&format!("{}: {} ({took})", task.item.name, task.part.title)));
        }
    }

    fn fail(&self, task: &Task, error: Failure) {
        let text = format!("{}, {}: {error}", task.item.name, task.part.title);
        self.bar.suspend(|| print_error(&format!("warning: {text}")));
        self.with_state(|state| {
            state.failure.get_or_insert(error.with(|_| format!("a part could not be computed: {text}")));
        });
    }
}
