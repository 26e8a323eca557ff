//! Progress of runs and simulations: a bar on a terminal, otherwise a line per set-up of a campaign.

use std::io::{BufRead, IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::campaign::{Campaign, CampaignSetUp};
use crate::input::shown_in_line;
use crate::report::describe;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::transients::TransientRow;
use crate::runner::{RunError, Watcher};

/// Shows the progress of a run.
pub struct Progress {
    bar: ProgressBar,
    expected_s: f64,
    mount_without_asking: bool,
    set_ups: Vec<String>,
    mounted: usize,
    line: Option<Line>,
}

/// Summary of a set-up.
struct Line {
    label: String,
    points: usize,
    peak: Option<(f64, f64)>,
}

/// Bar steps per second of rig time.
const STEPS_PER_S: f64 = 10.0;

/// A bar, hidden without a terminal.
pub(super) fn bar(length: u64) -> ProgressBar {
    let target =
        if std::io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    let style = ProgressStyle::with_template("{msg:24!} {wide_bar} {percent:>3} %  {elapsed} elapsed, {eta} left");
    if let Ok(style) = style {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.enable_steady_tick(Duration::from_millis(200));
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

impl Progress {
    /// For a run of this campaign.
    #[must_use]
    pub fn new(campaign: &Campaign, mount_without_asking: bool) -> Self {
        let expected_s = campaign.expected_s();
        let bar = bar((expected_s * STEPS_PER_S) as u64);
        let used = (0..campaign.set_ups.len()).filter(|i| campaign.experiments.iter().any(|e| e.set_ups.contains(i)));
        let set_ups = used.map(|i| campaign.set_ups[i].name.clone()).collect();
        Self { bar, expected_s, mount_without_asking, set_ups, mounted: 0, line: None }
    }

    /// Ends the progress display.
    pub fn end(&mut self) {
        self.print_line();
        self.bar.finish_and_clear();
    }

    fn print_line(&mut self) {
        let Some(line) = self.line.take() else { return };
        if self.bar.is_hidden() {
            let peak = line.peak.map_or(String::new(), |(x, f)| format!(", peak X/Z {x:.2} at {f} Hz"));
            say!("[{}/{}] {}: {} points{peak}", self.mounted, self.set_ups.len(), line.label, line.points);
        }
    }
}

impl Watcher for Progress {
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<(), RunError> {
        self.print_line();
        self.mounted = self.set_ups.iter().position(|name| *name == set_up.name).map_or(0, |n| n + 1);
        let label = shown_in_line(&set_up.name).into_owned();
        self.bar.set_message(label.clone());
        self.line = Some(Line { label, points: 0, peak: None });
        if simulated || self.mount_without_asking {
            return Ok(());
        }
        let what = describe::set_up(set_up);
        if !std::io::stdin().is_terminal() {
            let message = format!(
                "set-up {:?} ({what}) must be mounted, and there is no terminal for the confirmation; mount it and use --yes",
                set_up.name
            );
            return Err(RunError::NobodyThere(message));
        }
        self.bar.suspend(|| {
            let _ = write!(std::io::stderr(), "Mount set-up {:?}: {what}. Press Enter when ready. ", set_up.name);
            let mut answer = String::new();
            match std::io::stdin().lock().read_line(&mut answer) {
                Ok(count) if count > 0 => Ok(()),
                _ => Err(RunError::NobodyThere(format!("mounting of set-up {:?} was not confirmed", set_up.name))),
            }
        })
    }

    fn progress(&mut self, rig_s: f64) {
        // A structure that comes to rest slowly makes the run longer than expected.
        self.bar.set_position((rig_s.min(self.expected_s) * STEPS_PER_S) as u64);
    }

    fn point(&mut self, row: &ResultRow) {
        if let Some(line) = &mut self.line {
            line.points += 1;
            if line.peak.is_none_or(|(x, _)| row.x_over_z() > x) {
                line.peak = Some((row.x_over_z(), row.frequency_hz));
            }
        }
    }

    fn transient(&mut self, _: &TransientRow) {
        if let Some(line) = &mut self.line {
            line.points += 1;
        }
    }

    fn link(&mut self, state: &str) {
        // Above the bar or to standard error, where it stays visible.
        self.bar.suspend(|| warn!("link: {state}"));
    }
}
