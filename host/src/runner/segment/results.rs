//! Results and impacts of a segment: takes those that arrive, requests those that were lost, and adds them to the journal.

use damprig_core::measure::point::PointResult;
use damprig_core::measure::transient::TransientResult;
use damprig_protocol::{Reply, Request};

use super::{Segment, Task};
use crate::client::session::SessionError;
use crate::run_folder::journal::JournalEntry;
use crate::run_folder::schema::impacts::Impacts;
use crate::runner::error::RunError;
use crate::runner::held_results::Measured;
use crate::runner::{transients, wire_mapping};

impl Segment<'_, '_, '_> {
    /// Adds the new impacts to the journal.
    pub(super) fn note_impacts(&mut self) {
        if let Some(impacts) = self.impacts.take_new() {
            self.run.note(JournalEntry::Impacts(Box::new(Impacts { id: self.task.id.clone(), impacts })));
        }
    }

    /// The device sends a point's result before the rows after it. When the drive has left the frequency and the result has
    /// not arrived, it was lost: it is requested at once, so that the rows get the right point.
    pub(super) fn fetch_at_end_of_point(&mut self, values: &[f32]) -> Result<(), RunError> {
        let Some(now) = self.frequency_at.and_then(|at| values.get(at)) else { return Ok(()) };
        let before = std::mem::replace(&mut self.frequency_hz, *now);
        if before != 0.0 && before != *now && self.label.point_index < u32::from(u16::MAX) {
            self.fetch_missing(self.label.point_index as u16 + 1)?;
        }
        Ok(())
    }

    pub(super) fn take(&mut self, result: &PointResult) {
        let index = usize::from(result.index);
        if !self.task.points.contains(&index) {
            return;
        }
        let row = wire_mapping::row(self.task.set_up, self.task.label(index), result);
        self.results.add(Measured::Point(Box::new(row)));
        self.note_recorded_results();
    }

    /// Tells the estimate of the time left that a point was measured.
    fn count_point(&mut self) {
        let experiment = self.task.experiment;
        self.run.estimate.point(experiment.expected_s() / experiment.points().max(1) as f64);
    }

    pub(super) fn take_transient(&mut self, result: &TransientResult) {
        let Task { set_up, experiment, id, .. } = self.task;
        let row = transients::row(set_up, experiment, id.segment, result, &self.run.campaign.rig.board.impacts);
        self.results.add(Measured::Transient(Box::new(row)));
        self.note_recorded_results();
    }

    /// Adds the results whose rows are recorded to the journal.
    pub(super) fn note_recorded_results(&mut self) {
        while let Some(measured) = self.results.take_recorded() {
            self.note_result(measured);
        }
    }

    pub(super) fn note_result(&mut self, measured: Measured) {
        match &measured {
            Measured::Point(row) => self.run.watcher.point(row),
            Measured::Transient(row) => self.run.watcher.transient(row),
        }
        // A point that is in the journal is not measured again: its impacts must be there before it.
        self.note_impacts();
        self.run.note(measured.into_entry());
        self.count_point();
    }

    /// Requests the results before `until` that have not arrived.
    pub(super) fn fetch_missing(&mut self, until: u16) -> Result<(), RunError> {
        let is_transient = self.task.experiment.stepped_sine().is_none();
        for index in self.progress.missing_points(until) {
            let ask = if is_transient { Request::Transient } else { Request::Result { index } };
            match self.run.session.request("repeat a result", ask) {
                Ok(Reply::Transient(result)) if self.check.admits_transient(&result, index) => {
                    self.progress.point_done(index, result.end_tick.saturating_sub(1));
                    self.take_transient(&result);
                }
                Ok(Reply::Result(result)) if self.check.admits_point(&result, index) => {
                    self.progress.point_done(index, result.end_tick.saturating_sub(1));
                    self.take(&result);
                }
                Ok(_) => {
                    self.count_misfit()?;
                    self.progress.point_lost(index);
                }
                Err(SessionError::Refused { .. }) => self.progress.point_lost(index),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}
