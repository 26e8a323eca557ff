//! Follows a rig over an open link.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::control::friction_spring::{SpringCommand, SpringStage, Target};
use damprig_core::io::TICK_HZ;
use damprig_core::rig::{RigState, Status};
use damprig_protocol::{Event, PlantKind, Request, Telemetry};
use damprig_simulator::messages::ToSimulator;

use super::{RUN_IS_OVER, TURN};
use crate::client::controller::Controller;
use crate::client::session::{DeviceReport, Session, SessionError};
use crate::monitor::action::{Action, Injection};
use crate::monitor::control::{Actions, Asked};
use crate::monitor::feed::{Feed, Update, Watched};
use crate::monitor::message::{Activity, FaultText, Impact, Level, Limits, LinkState, SourceKind, WatchedSource};
use crate::monitor::numbers::SignalName;
use crate::monitor::run::AfterRun;
use crate::monitor::words;
use crate::report::numbers::significant;

/// The signals that are streamed at the tick rate, as far as the device has them.
const SIGNALS: [&str; 8] = ["x", "z", "drive", "frequency", "x_velocity", "spring_force", "wall_low", "wall_high"];

/// Host time between two questions for the controller's values, and for its status.
const VALUES_EVERY: Duration = Duration::from_millis(100);
const STATUS_EVERY: Duration = Duration::from_millis(500);

/// A rig that is watched.
pub(super) struct RigWatch<'a> {
    session: &'a mut Session,
    feed: &'a Feed,
    actions: &'a Actions,
    /// Its counts go on over interruptions.
    link: &'a mut LinkState,
    /// Values in a row of telemetry, and ticks from row to row.
    width: usize,
    every_ticks: u16,
    /// Rig time of tick 0, s.
    from_s: f64,
    /// The run is over: its end stays in sight.
    is_after_run: bool,
    /// The last tick of any row, and whether there was a row since the link was opened.
    tick: u32,
    has_rows: bool,
    values_at: Instant,
    status_at: Instant,
    /// The force that the spring is to be set to once it is ready, N.
    spring_goal_n: Option<f32>,
    spring_stage: Option<SpringStage>,
    is_faulted: bool,
    lost_sensors: String,
    injected: Vec<(&'static str, &'static str)>,
}

impl<'a> RigWatch<'a> {
    pub(super) fn new(
        session: &'a mut Session,
        feed: &'a Feed,
        actions: &'a Actions,
        link: &'a mut LinkState,
    ) -> Result<Self, SessionError> {
        let places = places(session);
        link.state = "connected".into();
        let safety = &session.settings.safety;
        let known = |limit: f32| (limit > 0.0).then_some(f64::from(limit));
        let watched = Watched {
            source: WatchedSource {
                kind: SourceKind::Rig,
                name: session.name().to_string(),
                rig: session.name().to_string(),
                board: session.identity.board.to_string(),
                folder: None,
            },
            signals: names(session, &places),
            table: names(session, &(0..session.signals.len()).collect::<Vec<_>>()),
            curves: Vec::new(),
            points_planned: 0,
            limits: Limits {
                x_m: known(safety.limits.structure_m),
                z_m: known(safety.limits.base_m),
                wall_force_n: known(safety.wall_force_n),
                clearance_m: None,
            },
        };
        feed.send(Update::Watch(Box::new(watched)));
        feed.send(Update::Link(link.clone()));
        let (status, _) = session.status()?;
        if let RigState::Running(_) = status.state {
            // Only the host's silence would end it, and this monitor is not silent.
            session.stop_drive()?;
            feed.log(
                Level::Warning,
                "The rig was running an experiment that no program follows any more: it was stopped.",
            );
        }
        Self::start(session, feed, actions, link, (&places, 1), status.tick)
    }

    /// On the time axis of a run that has ended, with its signals if they have x and z.
    pub(super) fn after_run(
        session: &'a mut Session,
        after: AfterRun,
        feed: &'a Feed,
        actions: &'a Actions,
        link: &'a mut LinkState,
    ) -> Result<Self, SessionError> {
        let AfterRun { mut watched, selection, rig_s, .. } = after;
        let has = |places: &[usize], name: &str| places.iter().any(|place| session.signals[*place].name == name);
        let own = selection.filter(|(places, ..)| has(places, "x") && has(places, "z"));
        let (status, _) = session.status()?;
        let (places, every_ticks, from_s) = own.unwrap_or_else(|| {
            let places = places(session);
            watched.signals = names(session, &places);
            feed.send(Update::Watch(Box::new(watched)));
            (places, 1, rig_s - time_s(status.tick))
        });
        let every_ticks = u16::try_from(every_ticks).unwrap_or(1).max(1);
        let watch = Self::start(session, feed, actions, link, (&places, every_ticks), 0)?;
        Ok(Self { from_s, is_after_run: true, ..watch })
    }

    fn start(
        session: &'a mut Session,
        feed: &'a Feed,
        actions: &'a Actions,
        link: &'a mut LinkState,
        (places, every_ticks): (&[usize], u16),
        tick: u32,
    ) -> Result<Self, SessionError> {
        let ask = Request::SetTelemetry {
            every_ticks,
            signals: places.iter().map(|place| *place as u8).collect(),
            impacts: true,
        };
        session.execute("send telemetry", ask)?;
        let now = Instant::now();
        Ok(Self {
            session,
            feed,
            actions,
            link,
            width: places.len(),
            every_ticks,
            from_s: 0.0,
            is_after_run: false,
            tick,
            has_rows: false,
            values_at: now,
            status_at: now.checked_sub(STATUS_EVERY).unwrap_or(now),
            spring_goal_n: None,
            spring_stage: None,
            is_faulted: false,
            lost_sensors: String::new(),
            injected: Vec::new(),
        })
    }

    pub(super) fn follow(&mut self, stop: &AtomicBool, until: Option<Instant>) -> Result<(), SessionError> {
        while !stop.load(Ordering::Relaxed) && until.is_none_or(|until| Instant::now() < until) {
            // Reports never pause on a rig at its work: the rest has its turn too.
            let turn = Instant::now();
            while turn.elapsed() < TURN
                && let Some(report) = self.session.next_report()?
            {
                self.show(report)?;
            }
            if self.values_at.elapsed() >= VALUES_EVERY {
                self.values_at = Instant::now();
                let values = self.session.signal_values()?;
                let rig_s = self.from_s + time_s(self.tick);
                self.feed.send(Update::Values { rig_s, tick: self.tick, values });
                if !self.is_after_run {
                    self.feed.send(Update::Progress(rig_s));
                }
            }
            if self.status_at.elapsed() >= STATUS_EVERY {
                self.status_at = Instant::now();
                self.show_status()?;
            }
            while let Some(asked) = self.actions.next() {
                self.act(asked)?;
            }
        }
        let ask = Request::SetTelemetry { every_ticks: 0, signals: Default::default(), impacts: false };
        self.session.execute("end the telemetry", ask)
    }

    fn show(&mut self, report: DeviceReport) -> Result<(), SessionError> {
        match report {
            DeviceReport::Telemetry(message) => self.show_rows(&message)?,
            DeviceReport::Event { event: Event::Impact(impact), .. } => {
                self.feed.send(Update::Impact(Impact::of(&impact, self.from_s)));
            }
            DeviceReport::Event { event: Event::Spring(event), .. } => {
                self.feed.log(Level::Info, words::spring(&event))
            }
            DeviceReport::Event { event: Event::Fault(_), .. } if !self.is_after_run => self.show_status()?,
            DeviceReport::Event { .. } => {}
        }
        Ok(())
    }

    fn show_rows(&mut self, message: &Telemetry) -> Result<(), SessionError> {
        let rows = message.values.len() / self.width.max(1);
        if usize::from(message.width) != self.width || message.every_ticks != self.every_ticks {
            // Rows that were asked for before.
            return self.session.note_misfit();
        }
        if message.first_tick < self.tick {
            // The board was reset, or counts from 0 again; after a run these are rows that were shown already.
            if !self.is_after_run {
                self.feed.send(Update::Restart);
            }
        } else if self.has_rows {
            let ticks = message.first_tick - self.tick;
            self.link.lost_rows += u64::from(ticks / u32::from(self.every_ticks)).saturating_sub(1);
        }
        self.has_rows = true;
        let every_ticks = u32::from(self.every_ticks);
        let tick = |row: u32| message.first_tick.saturating_add(row.saturating_mul(every_ticks));
        self.tick = tick((rows as u32).saturating_sub(1));
        let t_s = (0..rows as u32).map(|row| self.from_s + time_s(tick(row))).collect();
        let longest_step_s = 1.5 * time_s(every_ticks);
        self.feed.send(Update::Rows { t_s, values: message.values.to_vec(), longest_step_s });
        Ok(())
    }

    fn show_status(&mut self) -> Result<(), SessionError> {
        let (status, counters) = self.session.status()?;
        self.spring_stage = Some(status.spring.stage);
        self.is_faulted = status.fault.is_some() || status.spring.fault.is_some();
        let counted = Controller::between(&Default::default(), &counters);
        self.link.dropped_rows = counted.rows_dropped;
        self.link.bad_frames = counted.bad_frames + self.session.bad_frames();
        self.feed.send(Update::Link(self.link.clone()));
        let lost = status.sensors.lost.to_string();
        if lost != self.lost_sensors {
            let text = if lost.is_empty() {
                "All sensors have a signal.".into()
            } else {
                format!("Without a signal: {lost}.")
            };
            self.feed.log(if lost.is_empty() { Level::Info } else { Level::Warning }, text);
            self.lost_sensors = lost;
        }
        self.feed.send(Update::LostSensors(status.sensors.lost));
        if self.is_after_run {
            return Ok(());
        }
        self.feed.send(activity(&status, &self.lost_sensors));
        let fault = status.fault.or(status.spring.fault);
        let fault =
            fault.map(|fault| FaultText { what: words::fault(&fault, status.safe), advice: advice(&status).into() });
        self.feed.send(Update::Fault(fault));
        self.advance_spring(&status)
    }

    /// Moves the spring towards its goal: home, touch off, press.
    fn advance_spring(&mut self, status: &Status) -> Result<(), SessionError> {
        let Some(force_n) = self.spring_goal_n else { return Ok(()) };
        let command = match status.spring.stage {
            SpringStage::Unhomed => SpringCommand::Home,
            SpringStage::Homed => SpringCommand::TouchOff,
            SpringStage::Ready | SpringStage::Setting | SpringStage::Holding => {
                self.spring_goal_n = None;
                SpringCommand::Set(Target::Force { force_n })
            }
            SpringStage::Faulted => {
                self.spring_goal_n = None;
                return Ok(());
            }
            SpringStage::Homing | SpringStage::TouchingOff | SpringStage::Releasing => return Ok(()),
        };
        let done = self.session.execute("move the friction damper's spring", Request::Spring(command));
        if let Err(SessionError::Refused { why, .. }) = &done {
            self.spring_goal_n = None;
            self.feed.log(Level::Warning, format!("The spring cannot be moved: {why}."));
            return Ok(());
        }
        done
    }

    fn act(&mut self, asked: Asked) -> Result<(), SessionError> {
        if self.is_after_run {
            asked.answer(Err(RUN_IS_OVER.into()));
            return Ok(());
        }
        let (request, done) = match &asked.action {
            Action::Stop => {
                self.spring_goal_n = None;
                (Request::Stop, "The rig is stopped.")
            }
            Action::ClearFault if !self.is_faulted => {
                asked.answer(Err("There is no fault to clear.".into()));
                return Ok(());
            }
            Action::ClearFault => (self.clear_fault(), "The fault is cleared."),
            Action::SetSpring { .. } if self.is_faulted => {
                asked.answer(Err("Clear the fault first.".into()));
                return Ok(());
            }
            Action::SetSpring { force_n } if *force_n == 0.0 => {
                self.spring_goal_n = None;
                (Request::Spring(SpringCommand::Release), "The spring is released.")
            }
            Action::SetSpring { force_n } if (0.0..=self.most_force_n()).contains(force_n) => {
                self.spring_goal_n = Some(*force_n);
                let text = match self.spring_stage {
                    Some(SpringStage::Unhomed) => "The spring is homed first, then touches off, then presses.",
                    _ => "The spring moves to its force.",
                };
                asked.answer(Ok(text.into()));
                return Ok(());
            }
            // The cable was pulled or plugged in already: it is no part of the rig.
            Action::Inject { fault: fault @ Injection::Cable { .. } } => {
                words::note_injection(&mut self.injected, fault);
                self.feed.send(Update::Injected(words::injected(&self.injected)));
                asked.answer(Ok("Done.".into()));
                return Ok(());
            }
            Action::Inject { fault } => match fault.to_simulator() {
                Some(injected) if self.session.description.plant != PlantKind::Real => {
                    words::note_injection(&mut self.injected, fault);
                    self.feed.send(Update::Injected(words::injected(&self.injected)));
                    (ToSimulator::Inject(injected).request(), "Done.")
                }
                _ => {
                    asked.answer(Err("faults can be injected into a simulated rig only".into()));
                    return Ok(());
                }
            },
            Action::SetSpring { .. } => {
                let most_n = significant(self.most_force_n().into(), 3);
                asked.answer(Err(format!("The force must be from 0 to {most_n} N: 0.9 of spring.largest_force_n.")));
                return Ok(());
            }
            Action::Pause | Action::Resume | Action::Hold | Action::Release | Action::Replay { .. } => {
                asked.answer(Err("no run is in progress".into()));
                return Ok(());
            }
        };
        match self.session.execute("act", request) {
            Ok(()) => {
                // A stop was answered when it was asked for.
                if asked.action == Action::Stop {
                    self.feed.log(Level::Info, done);
                }
                asked.answer(Ok(done.into()));
            }
            Err(SessionError::Refused { why, .. }) => asked.answer(Err(words::sentence(&why))),
            Err(error) => {
                asked.answer(Err(words::sentence(&error.to_string())));
                return Err(error);
            }
        }
        self.show_status()
    }

    /// Largest force that the spring may be set to, N; the rest is for the regulation.
    fn most_force_n(&self) -> f32 {
        0.9 * self.session.settings.spring.largest_force_n
    }

    fn clear_fault(&self) -> Request {
        if self.spring_stage == Some(SpringStage::Faulted) {
            Request::Spring(SpringCommand::ClearFault)
        } else {
            Request::ClearFault
        }
    }
}

/// Places in the device's table of the signals that are shown.
fn places(session: &Session) -> Vec<usize> {
    SIGNALS.iter().filter_map(|name| session.signals.iter().position(|signal| signal.name == *name)).collect()
}

fn names(session: &Session, places: &[usize]) -> Vec<SignalName> {
    let named = |place: &usize| {
        let signal = &session.signals[*place];
        SignalName { name: signal.name.to_string(), unit: signal.unit.to_string() }
    };
    places.iter().map(named).collect()
}

fn time_s(tick: u32) -> f64 {
    f64::from(tick) / f64::from(TICK_HZ)
}

fn activity(status: &Status, lost_sensors: &str) -> Update {
    let (activity, mut headline) = match status.state {
        RigState::Idle if status.spring.fault.is_some() => {
            (Activity::Faulted, "The rig is idle; its spring has a fault.".to_string())
        }
        RigState::Idle => (Activity::Idle, "The rig is idle.".into()),
        RigState::Running(_) => (Activity::Running, "The rig runs an experiment.".into()),
        RigState::Stopping => (Activity::Stopping, "The drive fades out.".into()),
        RigState::Faulted => (Activity::Faulted, words::sentence(status.safe.text())),
    };
    if !lost_sensors.is_empty() {
        headline += &format!(" Without a signal: {lost_sensors}.");
    }
    Update::Activity(activity, headline)
}

fn advice(status: &Status) -> &'static str {
    use damprig_core::control::safety::SafeStage;
    match status.safe {
        SafeStage::Clear => "Clear the spring's fault, then home the spring again.",
        SafeStage::Fading => "Wait until the drive is silent.",
        SafeStage::Ringing => "Release the emergency stop if it is pressed, and wait for rest; then clear the fault.",
        SafeStage::Safe => "Remove the cause, then clear the fault.",
    }
}
