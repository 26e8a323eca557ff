//! Runs all set-ups and experiments of a campaign, segment by segment.

use std::ops::Range;

use damprig_protocol::PlantKind;

use super::context::{Run, Tally};
use super::error::RunError;
use super::reconnect;
use super::segment::{Segment, SegmentEnd, Task};
use crate::campaign::{CampaignSetUp, Experiment};
use crate::client::session::SessionError;

/// Starts in a row without a new point after which a run ends.
const FRUITLESS_STARTS: u32 = 5;

impl Run<'_> {
    /// Runs all experiments. On an error, too, the tally is valid, and the rig has been told to stop.
    pub fn carry_out(mut self) -> (Tally, Result<(), RunError>) {
        let result = self.all().and_then(|()| Ok(self.recorder.check()?));
        self.note_last_actions();
        if result.is_err() {
            self.end_drive(&result);
        }
        // A lost device would only cost another timeout.
        if !matches!(result, Err(RunError::Session(_))) {
            let _ = self.session.status();
        }
        self.tally.controller = self.controller();
        self.tally.counters.bad_frames_device = self.tally.controller.map_or(0, |c| c.bad_frames);
        self.tally.counters.bad_frames_host += self.session.bad_frames();
        self.tally.counters.dropped_rows_host = self.recorder.dropped_rows();
        (self.tally, result)
    }

    /// Brings the rig to idle, then configures and starts an experiment on a set-up of the campaign. The caller follows it: its reports
    /// arrive in the session. Returns the places in the device's signal table of the values in a row of telemetry.
    ///
    /// # Errors
    /// The device, the link, the friction damper's spring, or Ctrl-C.
    pub fn start_experiment(mut self, set_up: &CampaignSetUp, experiment: &Experiment) -> Result<Vec<usize>, RunError> {
        self.make_ready()?;
        let id = self.journal.next_segment(&set_up.name, &experiment.name);
        let task = Task { set_up, experiment, id, points: 0..experiment.known_points(), anew: false };
        Segment::start_only(&mut self, &task)
    }

    fn all(&mut self) -> Result<(), RunError> {
        self.make_ready()?;
        let campaign = self.campaign;
        let simulated = self.session.description.plant != PlantKind::Real;
        for (set_up, own) in &campaign.run_order {
            let set_up = &campaign.set_ups[*set_up];
            let own = || own.iter().map(|&place| &campaign.experiments[place]);
            // Each set-up is mounted once, or never when all its points are taken.
            if own().any(|e| self.is_open(set_up, e)) {
                if self.with_person(|watcher| watcher.mount(set_up, simulated))? {
                    self.note_action(&format!(
                        "confirmed: set-up {:?} is mounted{}",
                        set_up.name,
                        also(set_up.instruction.as_deref())
                    ));
                }
                let mut is_changed = !simulated;
                for experiment in own() {
                    if self.is_open(set_up, experiment) {
                        is_changed |= self.instruct(experiment, simulated)?;
                        if std::mem::take(&mut is_changed) {
                            self.check_rest(set_up, experiment)?;
                        }
                    }
                    self.experiment(set_up, experiment)?;
                }
            }
        }
        Ok(())
    }

    /// Asks a person for what an experiment needs, and returns whether it needs something; a simulated rig needs nobody.
    fn instruct(&mut self, experiment: &Experiment, simulated: bool) -> Result<bool, RunError> {
        let Some(instruction) = experiment.instruction.as_ref().filter(|_| !simulated) else { return Ok(false) };
        if self.with_person(|watcher| watcher.instruct(experiment, instruction))? {
            self.note_action(&format!("confirmed before experiment {:?}: {instruction}", experiment.name));
        }
        Ok(true)
    }

    /// Whether an experiment on a set-up has points that are not measured.
    fn is_open(&self, set_up: &CampaignSetUp, experiment: &Experiment) -> bool {
        let points = self.journal.known(&set_up.name, experiment).points();
        !self.journal.missing(&set_up.name, &experiment.name, points).is_empty()
    }

    /// The next start that these points of an experiment on a set-up need, if any; those before them are measured.
    fn next<'c>(
        &self,
        set_up: &'c CampaignSetUp,
        experiment: &'c Experiment,
        points: &Range<usize>,
    ) -> Option<Task<'c>> {
        let missing = self.missing(set_up, experiment, points).into_iter().next()?;
        let id = self.journal.next_segment(&set_up.name, &experiment.name);
        // An interrupted sweep has lost its motion, so it starts from its beginning.
        let anew = experiment.carries_over() && self.journal.has_begun(&set_up.name, &experiment.name, points);
        let points = if anew { points.clone() } else { missing };
        Some(Task { set_up, experiment, id, points, anew })
    }

    /// The ranges of these points that are not measured.
    fn missing(&self, set_up: &CampaignSetUp, experiment: &Experiment, points: &Range<usize>) -> Vec<Range<usize>> {
        let all = self.journal.missing(&set_up.name, &experiment.name, points.end);
        let within = all.into_iter().map(|range| range.start.max(points.start)..range.end);
        within.filter(|range| !range.is_empty()).collect()
    }

    /// Measures an experiment on a set-up: its grid, then the points around the peak of that.
    fn experiment(&mut self, set_up: &CampaignSetUp, experiment: &Experiment) -> Result<(), RunError> {
        let known = experiment.known_points();
        self.measure(set_up, experiment, &(0..known))?;
        if experiment.peak_points() > 0 {
            self.place_peak_points(set_up, experiment);
            let whole = self.journal.known(&set_up.name, experiment).into_owned();
            self.measure(set_up, &whole, &(known..whole.known_points()))?;
        }
        self.estimate.is_whole();
        Ok(())
    }

    /// Measures these points of an experiment on a set-up, in as many starts as it takes.
    fn measure(
        &mut self,
        set_up: &CampaignSetUp,
        experiment: &Experiment,
        points: &Range<usize>,
    ) -> Result<(), RunError> {
        let mut fruitless = 0;
        while let Some(task) = self.next(set_up, experiment, points) {
            let before = self.journal.points();
            let last = match Segment::carry_out(self, &task) {
                Ok(SegmentEnd::Finished) => {
                    "results were lost on the link and the device no longer has them".to_string()
                }
                Ok(SegmentEnd::Paused) => {
                    self.estimate.stand();
                    self.wait_for_resumption()?;
                    self.estimate.go_on();
                    continue;
                }
                Ok(SegmentEnd::Reset) => {
                    self.readings.board_was_reset();
                    self.session.forget_counters();
                    self.interrupted("the device was reset during the run");
                    self.make_ready()?;
                    "the device was reset".to_string()
                }
                Err(RunError::Session(error)) if reconnect::is_recoverable(&error) => {
                    let text = error.to_string();
                    self.estimate.stand();
                    self.reconnect(error)?;
                    self.estimate.go_on();
                    text
                }
                Err(error) => return Err(error),
            };
            fruitless = if self.journal.points() > before { 0 } else { fruitless + 1 };
            if fruitless >= FRUITLESS_STARTS {
                let left = self.missing(set_up, experiment, points);
                let missing = left.iter().map(ExactSizeIterator::len).sum();
                return Err(RunError::NoProgress { set_up: set_up.name.clone(), tries: fruitless, last, missing });
            }
        }
        Ok(())
    }

    /// Stops the drive when the run has failed.
    fn end_drive(&mut self, result: &Result<(), RunError>) {
        match result {
            Err(RunError::Session(
                SessionError::Broken { .. } | SessionError::Silent { .. } | SessionError::Flood { .. },
            )) => self.session.stop_without_reply(),
            _ => {
                if self.session.stop_drive().is_err() {
                    self.session.stop_without_reply();
                }
            }
        }
    }
}

/// What was confirmed besides the mounting.
fn also(instruction: Option<&str>) -> String {
    instruction.map_or_else(String::new, |instruction| format!(", and: {instruction}"))
}
