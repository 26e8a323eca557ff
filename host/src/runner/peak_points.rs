//! Decides which points follow around the measured peak of a grid.

use super::context::Run;
use crate::campaign::{AroundPeak, CampaignSetUp, Experiment};
use crate::host_time;
use crate::run_folder::ResultRow;
use crate::run_folder::journal::JournalEntry;
use crate::run_folder::schema::peak_points::PeakPoints;

impl Run<'_> {
    /// Adds the points around the peak of an experiment on a set-up to the journal, once its grid is measured. Those that the journal
    /// has are kept: a resumed run measures the same points.
    pub(super) fn place_peak_points(&mut self, set_up: &CampaignSetUp, experiment: &Experiment) {
        if self.journal.peak(&set_up.name, &experiment.name).is_some() {
            return;
        }
        let is_own = |row: &&ResultRow| {
            row.set_up == set_up.name
                && row.experiment == experiment.name
                && (row.point_index as usize) < experiment.known_points()
        };
        let own = self.journal.rows().iter().filter(is_own);
        let measured: Vec<(f64, f64)> = own.map(|row| (row.frequency_hz, row.x_over_z())).collect();
        let around = experiment.stepped_sine().map_or_else(AroundPeak::default, |sine| sine.around_peak(&measured));
        let points = PeakPoints {
            set_up: set_up.name.clone(),
            experiment: experiment.name.clone(),
            around,
            at: host_time::now_text(),
        };
        self.note(JournalEntry::PeakPoints(Box::new(points.clone())));
        let planned = self.journal.planned(self.campaign);
        self.watcher.peak_points(&points, &planned);
    }
}
