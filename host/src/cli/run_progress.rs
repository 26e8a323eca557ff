//! Progress of a run: a bar with the present numbers on a terminal, otherwise lines; and the log file.

use std::fs::{File, OpenOptions};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::control::friction_spring::SpringEvent;
use indicatif::ProgressBar;

use super::progress::bar_without_time;
use super::terminal_line::{forget_typed, typed_line};
use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::client::session::Session;
use crate::failure::Failure;
use crate::host_time;
use crate::input::shown_in_line;
use crate::report::describe;
use crate::report::terminal::transients::in_words;
use crate::run_folder::ResultRow;
use crate::run_folder::journal::Losses;
use crate::run_folder::schema::journal_state::{JournalState, Planned};
use crate::run_folder::schema::peak_points::PeakPoints;
use crate::run_folder::schema::results::steadiness_text;
use crate::run_folder::schema::transients::TransientRow;
use crate::runner::{RestAnswer, RestFinding, RunError, TimeLeft, WatchedStart, Watcher};

/// Time from line to line without a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Shows the progress of a run.
pub struct RunProgress {
    bar: ProgressBar,
    /// Lines are printed: there is no bar.
    has_lines: bool,
    /// The rig has its own clock: a run takes long enough to ask for its controller's values.
    is_real_time: bool,
    log: Option<LogFile>,
    places: SignalPlaces,
    left: Option<TimeLeft>,
    points: (usize, usize),
    mount_without_asking: bool,
    stop: Arc<AtomicBool>,
    set_ups: Vec<String>,
    mounted: usize,
    summary: Option<SetUpSummary>,
    present: String,
    numbers: String,
    line_at: Instant,
}

/// Places in the device's signal table.
struct SignalPlaces {
    frequency: Option<usize>,
    x_over_z_lock_in: Option<usize>,
    z_amplitude: Option<usize>,
    impacts_in_cycle: Option<usize>,
}

/// Summary of a set-up.
struct SetUpSummary {
    label: String,
    points: usize,
    peak: Option<(f64, f64)>,
}

/// The log file.
pub struct LogFile {
    file: File,
    path: String,
    has_failed: bool,
}

impl LogFile {
    /// Opens a log file, to append to it.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let shown = path.display().to_string();
        if is_pipe(path) {
            return Err(Failure::Input(format!("--log {shown}: it is a pipe; give a file")));
        }
        let file = OpenOptions::new().create(true).append(true).open(path);
        let file = file.map_err(|e| Failure::Input(format!("--log {shown}: cannot write this file: {e}")))?;
        Ok(Self { file, path: shown, has_failed: false })
    }

    /// Adds a line with the host's time. A log that cannot be written does not end a run.
    fn line(&mut self, text: &str) {
        let now = host_time::now().strftime("%Y-%m-%d %H:%M:%S%.3f").to_string();
        if let Err(error) = writeln!(self.file, "{now} {}", shown_in_line(text))
            && !self.has_failed
        {
            self.has_failed = true;
            warn!("warning: --log {}: cannot write: {error}; the run goes on without it", self.path);
        }
    }
}

/// Opening a pipe would wait for its reader.
#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|there| there.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}

/// What is shown, and how.
pub struct Display {
    /// Nothing is shown: `--quiet`, or the terminal view is open.
    pub is_hidden: bool,
    /// The log file.
    pub log: Option<LogFile>,
    /// Set-ups are mounted without confirmation.
    pub mount_without_asking: bool,
    /// Ends a question.
    pub stop: Arc<AtomicBool>,
}

impl RunProgress {
    /// For a run of this campaign on the rig of `session`; `taken` is what is measured already.
    #[must_use]
    pub fn new(campaign: &Campaign, session: &Session, taken: &JournalState, display: Display) -> Self {
        let points = taken.planned(campaign).points;
        let bar = if display.is_hidden { ProgressBar::hidden() } else { bar_without_time(points as u64) };
        bar.set_position(taken.points() as u64);
        let used = (0..campaign.set_ups.len()).filter(|i| campaign.experiments.iter().any(|e| e.set_ups.contains(i)));
        let at = |name: &str| session.signals.iter().position(|signal| signal.name == name);
        Self {
            has_lines: !display.is_hidden && bar.is_hidden(),
            is_real_time: !session.is_granted(),
            bar,
            log: display.log,
            places: SignalPlaces {
                frequency: at("frequency"),
                x_over_z_lock_in: at("x_over_z_lock_in"),
                z_amplitude: at("z_amplitude"),
                impacts_in_cycle: at("impacts_in_cycle"),
            },
            left: None,
            points: (taken.points(), points),
            mount_without_asking: display.mount_without_asking,
            stop: display.stop,
            set_ups: used.map(|i| campaign.set_ups[i].name.clone()).collect(),
            mounted: 0,
            summary: None,
            present: String::new(),
            numbers: String::new(),
            line_at: Instant::now(),
        }
    }

    /// Ends the progress display.
    pub fn end(&mut self) {
        self.print_summary();
        self.bar.finish_and_clear();
    }

    fn log(&mut self, text: &str) {
        if let Some(log) = &mut self.log {
            log.line(text);
        }
    }

    fn print_summary(&mut self) {
        let Some(summary) = self.summary.take() else { return };
        if self.has_lines {
            let peak =
                summary.peak.map_or(String::new(), |(x, f)| format!(", peak X/Z (cycle maxima) {x:.2} at {f} Hz"));
            let SetUpSummary { label, points, .. } = summary;
            say!("[{}/{}] {label}: {points} points{peak}", self.mounted, self.set_ups.len());
        }
    }

    /// Asks a person to do something, and waits until it is confirmed. `what` names it in errors.
    fn ask(&self, request: &str, what: &str) -> Result<bool, RunError> {
        self.line(&format!("{request} Press Enter when ready. "), request, what).map(|_| true)
    }

    /// The line that a person types after a prompt.
    fn line(&self, prompt: &str, request: &str, what: &str) -> Result<String, RunError> {
        if !std::io::stdin().is_terminal() {
            let message =
                format!("there is no terminal for the confirmation of this: {request}\n  Do it and use --yes");
            return Err(RunError::NobodyThere(message));
        }
        self.bar.suspend(|| {
            forget_typed();
            let _ = write!(std::io::stderr(), "{prompt}");
            match typed_line(|| !self.stop.load(Ordering::Relaxed)) {
                // Ctrl-C, or a stop on the live page.
                Ok(None) => Err(RunError::Interrupted),
                Ok(Some(answer)) if !answer.is_empty() => Ok(answer.trim().to_string()),
                _ => Err(RunError::NobodyThere(format!("{what} was not confirmed"))),
            }
        })
    }

    /// The present numbers on the bar, or on a line now and then.
    fn show(&mut self) {
        let Self { present, numbers, left, .. } = self;
        let left = left.map_or(String::new(), |left| format!(", {left}"));
        self.bar.set_message(format!("{present}{numbers}{left}"));
        if self.has_lines && self.line_at.elapsed() >= LINE_EVERY {
            self.line_at = Instant::now();
            let (taken, planned) = self.points;
            say!("{}{}; {taken} of {planned} points{left}", self.present, self.numbers);
        }
    }
}

impl Watcher for RunProgress {
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<bool, RunError> {
        self.print_summary();
        self.mounted = self.set_ups.iter().position(|name| *name == set_up.name).map_or(0, |n| n + 1);
        let label = shown_in_line(&set_up.name).into_owned();
        self.present.clone_from(&label);
        self.numbers.clear();
        self.show();
        self.summary = Some(SetUpSummary { label, points: 0, peak: None });
        if simulated || self.mount_without_asking {
            return Ok(false);
        }
        self.ask(&describe::mounting(set_up), &format!("mounting of set-up {:?}", set_up.name))
    }

    fn instruct(&mut self, experiment: &Experiment, instruction: &str) -> Result<bool, RunError> {
        if self.mount_without_asking {
            return Ok(false);
        }
        let what = format!("what experiment {:?} needs", experiment.name);
        self.ask(&describe::instruction(experiment, instruction), &what)
    }

    fn not_at_rest(&mut self, finding: &RestFinding) -> Result<RestAnswer, RunError> {
        let question: Vec<String> = finding.question().iter().map(|line| shown_in_line(line).into_owned()).collect();
        let question = question.join("\n  ");
        self.log(&finding.to_string());
        if self.mount_without_asking {
            self.bar.suspend(|| warn!("warning: {question}\n  --yes: the run goes on"));
            return Ok(RestAnswer::GoOn);
        }
        let prompt =
            format!("{question}\nEnter measures again, g goes on anyway, s stops (--resume continues the run): ");
        loop {
            match self.line(&prompt, &question, "what to do about a rig that is not at rest")?.as_str() {
                "" => return Ok(RestAnswer::Again),
                "g" => return Ok(RestAnswer::GoOn),
                "s" => return Ok(RestAnswer::Stop),
                _ => {}
            }
        }
    }

    fn progress(&mut self, _: f64) {}

    fn time_left(&mut self, left: TimeLeft) {
        self.left = Some(left);
    }

    fn started(&mut self, start: &WatchedStart) {
        self.log(&format!("set-up {}: experiment {} starts", start.set_up.name, start.experiment.name));
    }

    fn wants_values(&self) -> bool {
        self.has_lines && self.is_real_time || !self.bar.is_hidden()
    }

    fn values(&mut self, _: f64, values: &[f32], _: &Losses) {
        let value = |at: Option<usize>| at.and_then(|at| values.get(at)).copied().filter(|value| value.is_finite());
        let mut text = String::new();
        if let Some(frequency_hz) = value(self.places.frequency).filter(|hz| *hz > 0.0) {
            text += &format!("  {frequency_hz:.3} Hz");
        }
        if let Some(x_over_z) = value(self.places.x_over_z_lock_in).filter(|ratio| *ratio > 0.0) {
            text += &format!("  X/Z (lock-in) {x_over_z:.2}");
        }
        if let Some(z_m) = value(self.places.z_amplitude).filter(|z| *z > 0.0) {
            text += &format!("  Z {:.3} mm", z_m * 1e3);
        }
        if let Some(impacts) = value(self.places.impacts_in_cycle).filter(|impacts| *impacts > 0.0) {
            text += &format!("  {impacts:.0} impacts/cycle");
        }
        self.numbers = text;
        self.show();
    }

    fn point(&mut self, row: &ResultRow) {
        self.points.0 += 1;
        let (taken, planned) = self.points;
        self.bar.set_position(taken as u64);
        self.numbers = format!("  {} Hz  X/Z (cycle maxima) {:.2}", row.frequency_hz, row.x_over_z());
        self.show();
        let steady = steadiness_text(row.steadiness);
        let (x_mm, z_mm) = (row.mean_cycle_max_m * 1e3, row.z_amplitude_m * 1e3);
        self.log(&format!(
            "point {taken} of {planned}: set-up {}, {} Hz: X/Z (cycle maxima) {:.3}, X/Z (lock-in) {:.3}, X {x_mm:.3} mm, Z {z_mm:.4} mm, {steady}",
            row.set_up,
            row.frequency_hz,
            row.x_over_z(),
            row.x_over_z_lock_in()
        ));
        if let Some(summary) = &mut self.summary {
            summary.points += 1;
            if summary.peak.is_none_or(|(x, _)| row.x_over_z() > x) {
                summary.peak = Some((row.x_over_z(), row.frequency_hz));
            }
        }
    }

    fn peak_points(&mut self, points: &PeakPoints, planned: &Planned) {
        let text = points.text();
        self.log(&text);
        let text = shown_in_line(&text);
        if points.is_notable() {
            self.bar.suspend(|| warn!("note: {text}"));
        } else if self.has_lines {
            say!("{text}");
        }
        self.points.1 = planned.points;
        self.bar.set_length(planned.points as u64);
    }

    fn transient(&mut self, row: &TransientRow) {
        self.points.0 += 1;
        self.bar.set_position(self.points.0 as u64);
        self.log(&format!("set-up {}, experiment {}: {}", row.set_up, row.experiment, in_words(row)));
        if let Some(summary) = &mut self.summary {
            summary.points += 1;
        }
    }

    fn spring(&mut self, event: &SpringEvent) {
        self.log(&crate::monitor::spring_event(event));
    }

    fn link(&mut self, state: &str) {
        // Above the bar or to standard error, where it stays visible.
        self.bar.suspend(|| warn!("link: {state}"));
        self.log(&format!("link: {state}"));
    }

    fn answer(&mut self, result: Result<&str, &str>) {
        self.log(result.unwrap_or_else(|why| why));
    }
}
