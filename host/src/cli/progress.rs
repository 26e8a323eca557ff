//! Progress bars, and the progress of simulations. That of runs is in `run_progress`.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::output::is_quiet;
use crate::input::shown_in_line;

/// A bar with the time left at the pace so far, hidden without a terminal and with --quiet.
#[must_use]
pub fn bar(length: u64) -> ProgressBar {
    bar_with(length, "{msg} {wide_bar} {percent:>3} %  {eta} left")
}

/// A bar that states no time.
pub(super) fn bar_without_time(length: u64) -> ProgressBar {
    bar_with(length, "{msg} {wide_bar} {percent:>3} %")
}

fn bar_with(length: u64, template: &str) -> ProgressBar {
    let is_shown = std::io::stderr().is_terminal() && !is_quiet();
    let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    let style = ProgressStyle::with_template(template);
    if let Ok(style) = style {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Work of unknown length, with what it looks at; hidden as [`bar`] is.
#[must_use]
pub fn spinner() -> ProgressBar {
    let bar = bar_with(1, "{spinner} {msg}");
    bar.set_length(0);
    bar
}

/// Progress of a simulation; shown after one second.
pub struct SimulationBar {
    name: String,
    duration_s: f64,
    start: Instant,
    bar: Option<ProgressBar>,
}

impl SimulationBar {
    /// For a simulation of `duration_s`.
    #[must_use]
    pub fn new(name: &str, duration_s: f64) -> Self {
        Self { name: shown_in_line(name).into_owned(), duration_s, start: Instant::now(), bar: None }
    }

    /// Shows the simulated time `t_s`.
    pub fn reach(&mut self, t_s: f64) {
        if self.bar.is_none() && self.start.elapsed() > Duration::from_secs(1) {
            let bar = bar(10_000).with_elapsed(self.start.elapsed());
            bar.set_message(self.name.clone());
            self.bar = Some(bar);
        }
        if let Some(bar) = &self.bar {
            bar.set_position((10_000.0 * t_s / self.duration_s) as u64);
        }
    }

    /// Removes the bar.
    pub fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

/// Progress of a study.
pub struct StudyBar {
    name: String,
    bar: ProgressBar,
}

impl StudyBar {
    /// For a study of so many points.
    #[must_use]
    pub fn new(name: &str, points: u64) -> Self {
        let name = shown_in_line(name).into_owned();
        let bar = bar(points);
        bar.set_message(name.clone());
        Self { name, bar }
    }

    /// Shows the number of points that are done, and the best value so far.
    pub fn reach(&self, done: u64, best: Option<&str>) {
        if done > self.bar.position() {
            self.bar.set_position(done);
        }
        if let Some(best) = best {
            self.bar.set_message(format!("{}  best {best}", self.name));
        }
    }

    /// Changes the number of points to come in all.
    pub fn set_length(&self, points: u64) {
        self.bar.set_length(points);
    }

    /// Removes the bar.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}
