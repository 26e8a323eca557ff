//! A run as a source of the monitor: passes what the run's watcher sees to the feed, and the viewers' actions to the run.

use damprig_core::control::friction_spring::SpringEvent;
use damprig_core::io::{SensorSet, TICK_HZ};
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;

use super::action::{Action, Injection};
use super::control::{Actions, Asked};
use super::feed::{Feed, Update, Watched};
use super::message::{
    Activity, CurveKind, FaultText, Impact, Level, Limits, LinkState, MeasuredPoint, PredictedCurve, SourceKind,
    Transient, WatchedSource,
};
use super::numbers::SignalName;
use super::words;
use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::client::session::Session;
use crate::prediction::CampaignPrediction;
use crate::report::describe;
use crate::report::terminal::transients::in_words;
use crate::run_folder::ResultRow;
use crate::run_folder::journal::Losses;
use crate::run_folder::schema::journal_state::{JournalState, Planned};
use crate::run_folder::schema::peak_points::PeakPoints;
use crate::run_folder::schema::results::steadiness_text;
use crate::run_folder::schema::transients::TransientRow;
use crate::runner::{RestAnswer, RestFinding, RunAction, RunError, TimeLeft, WatchedStart, Watcher};

/// What is known of a run before it starts.
pub struct RunFacts<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// The session with the rig.
    pub session: &'a Session,
    /// The predicted responses.
    pub predicted: &'a CampaignPrediction,
    /// The run folder, as people are told.
    pub folder: String,
    /// What was measured before the run was resumed.
    pub taken: &'a JournalState,
}

/// Watches a run for the monitor and for another watcher, the terminal's.
pub struct MonitoredRun<'a> {
    terminal: &'a mut dyn Watcher,
    feed: Feed,
    actions: &'a Actions,
    asked: Option<(RunAction, Asked)>,
    /// The last action of the terminal.
    from_terminal: Option<RunAction>,
    watched: Watched,
    /// Names and units of the device's signals.
    link: LinkState,
    injected: Vec<(&'static str, &'static str)>,
    present: Option<PresentStart>,
    is_held: bool,
    was_stopped: bool,
    rig_s: f64,
}

/// What is needed to watch the rig when its run has ended.
#[derive(Debug)]
pub struct AfterRun {
    pub(super) watched: Watched,
    pub(super) link: LinkState,
    /// Places of the signals in the device's table, ticks from row to row and rig time of tick 0 of the last start.
    pub(super) selection: Option<(Vec<usize>, u32, f64)>,
    /// Rig time at the end, s.
    pub(super) rig_s: f64,
    /// Whether a viewer has stopped the run.
    pub was_stopped_by_viewer: bool,
}

/// The present start of the device.
struct PresentStart {
    set_up: String,
    experiment: String,
    from_s: f64,
    places: Vec<usize>,
    every_ticks: u32,
    /// Tick that the next row has if none is lost.
    next_tick: Option<u32>,
}

impl<'a> MonitoredRun<'a> {
    /// Watches a run; `actions` are those of the monitor's viewers.
    pub fn new(facts: &RunFacts, feed: Feed, actions: &'a Actions, terminal: &'a mut dyn Watcher) -> Self {
        let RunFacts { campaign, session, predicted, folder, taken } = facts;
        let table: Vec<SignalName> = session
            .signals
            .iter()
            .map(|signal| SignalName { name: signal.name.to_string(), unit: signal.unit.to_string() })
            .collect();
        let known = |limit: f32| (limit > 0.0).then_some(f64::from(limit));
        let planned = taken.planned(campaign);
        let watched = Watched {
            source: WatchedSource {
                kind: SourceKind::Run,
                name: campaign.name.clone(),
                rig: session.name().to_string(),
                board: session.identity.board.to_string(),
                folder: Some(folder.clone()),
            },
            signals: Vec::new(),
            table,
            curves: curves(campaign, predicted),
            points_planned: planned.points,
            limits: Limits {
                x_m: Some(campaign.rig.structure_limit_m()),
                z_m: Some(campaign.rig.base_limit_m()),
                wall_force_n: known(campaign.rig.acting.wall_force_n),
                clearance_m: None,
            },
        };
        let link = LinkState { name: session.name().to_string(), state: "connected".into(), ..LinkState::default() };
        feed.send(Update::Watch(Box::new(watched.clone())));
        feed.send(Update::Link(link.clone()));
        feed.send(Update::Activity(Activity::Waiting, "The run begins.".into()));
        taken.rows().iter().for_each(|row| feed.send(Update::Point(point(row))));
        taken.transients().iter().for_each(|row| feed.send(Update::Transient(transient(row))));
        feed.send(Update::Progress(taken.ticks() as f64 / f64::from(TICK_HZ)));
        Self {
            terminal,
            feed,
            actions,
            asked: None,
            from_terminal: None,
            watched,
            link,
            injected: Vec::new(),
            present: None,
            is_held: false,
            was_stopped: false,
            rig_s: 0.0,
        }
    }

    /// Tells how the run has ended, and how it goes on. Returns what is needed to watch the rig from here on.
    pub fn ended(mut self, result: &Result<(), RunError>) -> AfterRun {
        // An action just before the end.
        while let Some(asked) = self.actions.next() {
            self.for_run(asked);
        }
        let folder = self.watched.source.folder.clone().unwrap_or_default();
        let resume = format!("`damprig run --resume {folder}` continues the run.");
        let headline = match result {
            Ok(()) => "The run is complete.".into(),
            Err(RunError::Interrupted) => format!("The run was stopped. {resume}"),
            Err(error) => {
                let what = words::sentence(&error.to_string());
                self.feed.send(Update::Fault(Some(FaultText { what: what.clone(), advice: resume.clone() })));
                format!("The run has ended early. {resume}")
            }
        };
        self.feed.send(Update::Activity(Activity::Over, headline));
        AfterRun {
            selection: self.present.map(|present| (present.places, present.every_ticks, present.from_s)),
            rig_s: self.rig_s,
            was_stopped_by_viewer: self.was_stopped,
            watched: self.watched,
            link: self.link,
        }
    }

    fn running(&self) {
        let Some(PresentStart { set_up, experiment, .. }) = &self.present else { return };
        let (activity, word) = if self.is_held { (Activity::Held, "Held") } else { (Activity::Running, "Running") };
        self.feed.send(Update::Activity(activity, format!("{word}: set-up {set_up}, experiment {experiment}")));
    }

    /// The action as the run takes it; others are answered here.
    fn for_run(&mut self, asked: Asked) -> Option<RunAction> {
        let action = match &asked.action {
            Action::Pause => RunAction::Pause,
            Action::Resume => RunAction::Resume,
            Action::Hold => RunAction::Hold(true),
            Action::Release => RunAction::Hold(false),
            // These were done already: the run only notes them.
            Action::Stop => {
                self.was_stopped = true;
                RunAction::Noted("stopped on the live page")
            }
            Action::Inject { fault: fault @ Injection::Cable { on } } => {
                words::note_injection(&mut self.injected, fault);
                self.feed.send(Update::Injected(words::injected(&self.injected)));
                RunAction::Noted(if *on { "the cable was pulled" } else { "the cable was plugged in" })
            }
            Action::Inject { fault } => match fault.to_simulator() {
                Some(injected) => {
                    let (what, how) = fault.in_words();
                    RunAction::Inject { fault: injected, what, how }
                }
                None => {
                    asked.answer(Err("this rig has no cable that could be pulled from here".into()));
                    return None;
                }
            },
            Action::ClearFault => {
                asked.answer(Err("a fault ends the run; `damprig run --resume` clears it and goes on".into()));
                return None;
            }
            Action::SetSpring { .. } => {
                asked.answer(Err("the run sets the spring itself, from the campaign".into()));
                return None;
            }
            Action::Replay { .. } => {
                asked.answer(Err("a run cannot do this".into()));
                return None;
            }
        };
        self.asked = Some((action, asked));
        Some(action)
    }

    /// What an action that was carried out has changed.
    fn note_done(&mut self, action: RunAction) {
        match action {
            RunAction::Pause => {
                self.is_held = false;
                self.feed.send(Update::Activity(Activity::Paused, "Paused: the drive is off.".into()));
            }
            RunAction::Resume => {
                self.feed.send(Update::Activity(Activity::Waiting, "The run goes on.".into()));
            }
            RunAction::Hold(on) => {
                self.is_held = on;
                self.running();
            }
            RunAction::Noted(_) => {}
            RunAction::Inject { .. } => self.feed.send(Update::Injected(words::injected(&self.injected))),
        }
    }
}

impl Watcher for MonitoredRun<'_> {
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<bool, RunError> {
        if !simulated {
            let text = format!("Waiting: {} Confirm in the terminal.", describe::mounting(set_up));
            self.feed.send(Update::Activity(Activity::Waiting, text));
        }
        self.terminal.mount(set_up, simulated)
    }

    fn instruct(&mut self, experiment: &Experiment, instruction: &str) -> Result<bool, RunError> {
        let text = format!("Waiting: {} Confirm in the terminal.", describe::instruction(experiment, instruction));
        self.feed.send(Update::Activity(Activity::Waiting, text));
        self.terminal.instruct(experiment, instruction)
    }

    fn not_at_rest(&mut self, finding: &RestFinding) -> Result<RestAnswer, RunError> {
        let text = finding.question_in_line();
        self.feed.log(Level::Warning, text.clone());
        self.feed.send(Update::Activity(Activity::Waiting, format!("Waiting: {text} Answer in the terminal.")));
        self.terminal.not_at_rest(finding)
    }

    fn progress(&mut self, rig_s: f64) {
        self.rig_s = rig_s;
        self.feed.send(Update::Progress(rig_s));
        self.terminal.progress(rig_s);
    }

    fn time_left(&mut self, left: TimeLeft) {
        self.feed.send(Update::TimeLeft(left));
        self.terminal.time_left(left);
    }

    fn lost_sensors(&mut self, lost: SensorSet) {
        self.feed.send(Update::LostSensors(lost));
        self.terminal.lost_sensors(lost);
    }

    fn started(&mut self, start: &WatchedStart) {
        let signals: Vec<SignalName> =
            start.places.iter().filter_map(|place| self.watched.table.get(*place).cloned()).collect();
        if signals != self.watched.signals {
            self.watched.signals = signals;
            self.feed.send(Update::Watch(Box::new(self.watched.clone())));
            self.feed.send(Update::Link(self.link.clone()));
        }
        let (set_up, experiment) = (start.set_up.name.clone(), start.experiment.name.clone());
        self.feed.log(Level::Info, format!("Set-up {set_up}: experiment {experiment} starts."));
        self.feed.send(Update::Experiment {
            set_up: set_up.clone(),
            experiment: experiment.clone(),
            clearance_m: start.set_up.model().particle.map(|particle| particle.clearance_m),
        });
        let every_ticks = u32::from(start.every_ticks.max(1));
        self.present = Some(PresentStart {
            set_up,
            experiment,
            from_s: start.from_s,
            places: start.places.to_vec(),
            every_ticks,
            next_tick: None,
        });
        self.is_held = false;
        self.running();
        self.terminal.started(start);
    }

    fn rows(&mut self, ticks: &[u32], values: &[f32]) {
        if let Some(present) = &mut self.present {
            let seconds = |ticks: u32| f64::from(ticks) / f64::from(TICK_HZ);
            for tick in ticks {
                let missing = present.next_tick.map_or(0, |next| tick.saturating_sub(next)) / present.every_ticks;
                self.link.lost_rows += u64::from(missing);
                present.next_tick = Some(tick.saturating_add(present.every_ticks));
            }
            let t_s = ticks.iter().map(|tick| present.from_s + seconds(*tick)).collect();
            let longest_step_s = 1.5 * seconds(present.every_ticks);
            self.feed.send(Update::Rows { t_s, values: values.to_vec(), longest_step_s });
        }
        self.terminal.rows(ticks, values);
    }

    fn wants_values(&self) -> bool {
        true
    }

    fn values(&mut self, rig_s: f64, values: &[f32], losses: &Losses) {
        let tick = self.present.as_ref().map_or(0.0, |present| (rig_s - present.from_s) * f64::from(TICK_HZ)) as u32;
        self.feed.send(Update::Values { rig_s, tick, values: values.to_vec() });
        self.link.dropped_rows = losses.dropped_rows_host;
        self.link.bad_frames = losses.bad_frames_host.saturating_add(losses.bad_frames_device);
        self.link.interruptions = losses.interruptions;
        self.feed.send(Update::Link(self.link.clone()));
        self.terminal.values(rig_s, values, losses);
    }

    fn action(&mut self) -> Option<RunAction> {
        self.from_terminal = self.terminal.action();
        if self.from_terminal.is_some() {
            return self.from_terminal;
        }
        while let Some(asked) = self.actions.next() {
            if let Some(action) = self.for_run(asked) {
                return Some(action);
            }
        }
        None
    }

    fn answer(&mut self, result: Result<&str, &str>) {
        if let Some((action, asked)) = self.asked.take() {
            if result.is_ok() {
                if let Action::Inject { fault } = &asked.action {
                    words::note_injection(&mut self.injected, fault);
                }
                self.note_done(action);
            }
            asked.answer(result.map(words::sentence).map_err(words::sentence));
        } else {
            if let (Ok(_), Some(action)) = (result, self.from_terminal.take()) {
                self.note_done(action);
            }
            self.terminal.answer(result);
        }
    }

    fn point(&mut self, row: &ResultRow) {
        self.feed.send(Update::Point(point(row)));
        self.feed.log(Level::Info, words::measured(row));
        self.terminal.point(row);
    }

    fn peak_points(&mut self, points: &PeakPoints, planned: &Planned) {
        let level = if points.is_notable() { Level::Warning } else { Level::Info };
        self.feed.log(level, words::sentence(&points.text()));
        if planned.points != self.watched.points_planned {
            self.watched.points_planned = planned.points;
            self.feed.send(Update::Watch(Box::new(self.watched.clone())));
            self.feed.send(Update::Link(self.link.clone()));
        }
        self.terminal.peak_points(points, planned);
    }

    fn transient(&mut self, row: &TransientRow) {
        self.feed.send(Update::Transient(transient(row)));
        self.terminal.transient(row);
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if let Some(present) = &self.present {
            self.feed.send(Update::Impact(Impact::of(impact, present.from_s)));
        }
        self.terminal.impact(impact);
    }

    fn spring(&mut self, happening: &SpringEvent) {
        self.feed.log(Level::Info, words::spring(happening));
        self.terminal.spring(happening);
    }

    fn link(&mut self, state: &str) {
        self.link.state = state.to_string();
        self.feed.log(Level::Warning, words::sentence(state));
        if state == "the link is back" {
            self.link.state = "connected".into();
        } else {
            self.feed.send(Update::Activity(Activity::Lost, words::sentence(state)));
        }
        self.feed.send(Update::Link(self.link.clone()));
        self.terminal.link(state);
    }
}

/// A result as viewers get it.
pub(super) fn point(row: &ResultRow) -> MeasuredPoint {
    let known = |value: f64| value.is_finite().then_some(value);
    MeasuredPoint {
        set_up: row.set_up.clone(),
        experiment: row.experiment.clone(),
        index: row.point_index,
        frequency_hz: row.frequency_hz,
        x_over_z: known(row.x_over_z()),
        x_over_z_lock_in: known(row.x_over_z_lock_in()),
        mean_cycle_max_m: known(row.mean_cycle_max_m.into()),
        x_amplitude_m: known(row.x_amplitude_m.into()),
        z_amplitude_m: known(row.z_amplitude_m.into()),
        phase_rad: known(row.phase_rad.into()),
        steadiness: steadiness_text(row.steadiness).to_string(),
    }
}

/// The result of a playback, an impulse or a free vibration as viewers get it.
pub(super) fn transient(row: &TransientRow) -> Transient {
    Transient { set_up: row.set_up.clone(), experiment: row.experiment.clone(), text: in_words(row) }
}

/// The curves of a campaign's stepped sines on their set-ups, as far as they are predicted. The points of a sweep are joined in its
/// order, unless points around its peak follow.
pub(super) fn curves(campaign: &Campaign, predicted: &CampaignPrediction) -> Vec<PredictedCurve> {
    let mut curves = Vec::new();
    for (set_up, own) in campaign.set_ups.iter().enumerate() {
        for (place, experiment) in campaign.experiments.iter().enumerate() {
            if experiment.stepped_sine().is_none() || !experiment.set_ups.contains(&set_up) {
                continue;
            }
            let is_tracked = experiment.tracking().is_some();
            let draws = match experiment.response_controlled() {
                _ if is_tracked => CurveKind::Backbone,
                Some(_) => CurveKind::Sheet,
                None => CurveKind::Response,
            };
            let is_in_order = is_tracked || experiment.carries_over() && experiment.peak_points() == 0;
            let mut predicted = if draws == CurveKind::Response {
                let response = predicted.responses.iter().find(|it| (it.set_up, it.experiment) == (set_up, place));
                response.map_or_else(Vec::new, |response| response.points.clone())
            } else {
                let is_series = |it: &Experiment| it.series == experiment.series;
                let held = predicted.held.iter();
                let found =
                    held.filter(|it| it.set_up == set_up).find(|it| is_series(&campaign.experiments[it.experiment]));
                found.map_or_else(Vec::new, |held| held.points.iter().map(|it| place_of(it, draws)).collect())
            };
            if !is_in_order {
                predicted.sort_by(|a, b| a.0.total_cmp(&b.0));
            }
            let (set_up, experiment) = (own.name.clone(), experiment.name.clone());
            curves.push(PredictedCurve {
                set_up,
                about: describe::set_up(own),
                experiment,
                draws,
                is_in_order,
                predicted,
            });
        }
    }
    curves
}

/// Where a predicted point of the controller's loops is drawn.
fn place_of(point: &PointResult, draws: CurveKind) -> (f64, f64) {
    let [hz, x_m, z_m] = [point.frequency_hz, point.x_amplitude_m, point.z_amplitude_m].map(f64::from);
    if draws == CurveKind::Backbone { (x_m, hz) } else { (hz, z_m) }
}
