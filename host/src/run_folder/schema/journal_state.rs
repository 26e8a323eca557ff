//! What the lines of a journal add up to: the points taken, and what is still to do.
//!
//! The run keeps this sum while it writes the lines, so going on after a lost link and resuming a killed run are the same
//! operation.

use std::borrow::Cow;
use std::ops::Range;

use super::impacts::Impacts;
use super::journal_entry::{
    Begin, Ended, Finished, Joined, JournalEntry, Losses, Sealed, SegmentStart, SetAside, Withdrawn,
};
use super::peak_points::PeakPoints;
use super::results::ResultRow;
use super::segment_id::SegmentId;
use super::transients::TransientRow;
use crate::campaign::{Campaign, Experiment};
use crate::client::controller::Controller;

/// The sum of a journal's lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JournalState {
    /// Each beginning of the program.
    pub begun: Vec<Begin>,
    /// Each start of the device.
    pub segments: Vec<SegmentStart>,
    /// Segments that the device finished.
    pub finished: Vec<Finished>,
    /// Closed parts of the samples.
    pub sealed: Vec<Sealed>,
    /// Damaged open parts that are kept aside.
    pub set_aside: Vec<SetAside>,
    /// The parts are joined into `samples.parquet`.
    pub joined: Option<Joined>,
    /// Each orderly end of the program.
    pub ended: Vec<Ended>,
    /// Impacts as they were reported.
    pub impacts: Vec<Impacts>,
    /// The points around measured peaks.
    pub peaks: Vec<PeakPoints>,
    /// The latest counters of the controller since each beginning of the program.
    controllers: Vec<Option<Controller>>,
    transients: Vec<TransientRow>,
    rows: Vec<ResultRow>,
    superseded: Vec<ResultRow>,
    withdrawn: Vec<Withdrawn>,
}

/// What a run is to measure, as far as that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Planned {
    /// Points, those measured included.
    pub points: usize,
    /// Rig time as [`Campaign::expected_s`] has it, s.
    pub expected_s: f64,
}

impl JournalState {
    /// Of a journal.
    #[must_use]
    pub fn of(entries: &[JournalEntry]) -> Self {
        let mut state = Self::default();
        entries.iter().for_each(|entry| state.add(entry));
        state
    }

    /// Adds a line.
    pub fn add(&mut self, entry: &JournalEntry) {
        match entry {
            JournalEntry::Begin(begin) => {
                self.begun.push((**begin).clone());
                self.controllers.push(None);
            }
            JournalEntry::Segment(start) => {
                if start.anew {
                    let (id, first) = (&start.id, start.first_index);
                    let is_earlier = |r: &mut ResultRow| {
                        r.set_up == id.set_up && r.experiment == id.experiment && r.point_index as usize >= first
                    };
                    self.superseded.extend(self.rows.extract_if(.., is_earlier));
                    // The peak follows from the new results of the grid.
                    self.peaks.retain(|p| first > 0 || p.set_up != id.set_up || p.experiment != id.experiment);
                }
                self.segments.push(start.clone());
            }
            JournalEntry::Result(row) => {
                let is_same = |r: &ResultRow| {
                    r.point_index == row.point_index && r.set_up == row.set_up && r.experiment == row.experiment
                };
                // A point is taken once; a second line of it is a repetition.
                if !self.rows.iter().any(is_same) {
                    self.rows.push((**row).clone());
                }
            }
            JournalEntry::PeakPoints(points) => {
                if self.peak(&points.set_up, &points.experiment).is_none() {
                    self.peaks.push((**points).clone());
                }
            }
            JournalEntry::Transient(row) => {
                let is_same = |r: &TransientRow| r.set_up == row.set_up && r.experiment == row.experiment;
                if !self.transients.iter().any(is_same) {
                    self.transients.push((**row).clone());
                }
            }
            JournalEntry::Withdrawn(withdrawn) => {
                let is_it = |set_up: &str, experiment: &str, segment: u32, point_index: u32| {
                    let id = &withdrawn.id;
                    set_up == id.set_up
                        && experiment == id.experiment
                        && (segment, point_index) == (id.segment, withdrawn.point_index)
                };
                let rows = self.rows.extract_if(.., |r| is_it(&r.set_up, &r.experiment, r.segment, r.point_index));
                let transients =
                    self.transients.extract_if(.., |r| is_it(&r.set_up, &r.experiment, r.segment, r.point_index));
                if rows.count() + transients.count() > 0 {
                    self.withdrawn.push(withdrawn.clone());
                }
            }
            JournalEntry::Impacts(some) => self.impacts.push((**some).clone()),
            JournalEntry::Sealed(sealed) => {
                self.sealed.retain(|s| s.part != sealed.part);
                self.sealed.push(sealed.clone());
            }
            JournalEntry::SetAside(aside) => {
                self.set_aside.retain(|s| s.part != aside.part);
                self.set_aside.push(aside.clone());
            }
            JournalEntry::Finished(finished) => {
                self.update_controller(finished.controller);
                self.finished.push(finished.clone());
            }
            JournalEntry::Clock(_) | JournalEntry::Link { .. } | JournalEntry::Action { .. } => {}
            JournalEntry::Joined(joined) => self.joined = Some(joined.clone()),
            JournalEntry::Ended(ended) => {
                self.update_controller(ended.controller);
                self.ended.push(ended.clone());
            }
        }
    }

    /// The results that are not superseded, in the order in which they were taken.
    #[must_use]
    pub fn rows(&self) -> &[ResultRow] {
        &self.rows
    }

    /// The results of records, pulses and free vibrations, in the order in which they were taken.
    #[must_use]
    pub fn transients(&self) -> &[TransientRow] {
        &self.transients
    }

    /// Results of points that the campaign does not have, and points around a peak that it cannot have, one text each; none in a
    /// journal that is intact.
    #[must_use]
    pub fn unplanned(&self, campaign: &Campaign) -> Vec<String> {
        let is_planned = |set_up: &str, experiment: &str, point: usize| {
            campaign.experiments.iter().any(|e| {
                let mut set_ups = e.set_ups.iter().filter_map(|index| campaign.set_ups.get(*index));
                e.name == experiment && point < e.points() && set_ups.any(|own| own.name == set_up)
            })
        };
        let points = self.rows.iter().map(|r| (&r.set_up, &r.experiment, r.point_index as usize));
        let transients = self.transients.iter().map(|r| (&r.set_up, &r.experiment, 0));
        let unplanned =
            points.chain(transients).filter(|(set_up, experiment, point)| !is_planned(set_up, experiment, *point));
        let unplanned = unplanned
            .map(|(set_up, experiment, point)| format!("set-up {set_up:?}, experiment {experiment:?}, point {point}"));
        let fits = |points: &PeakPoints| {
            let mut own = campaign.experiments.iter().filter(|e| e.name == points.experiment);
            own.any(|e| is_planned(&points.set_up, &e.name, 0) && e.can_have_around_peak(&points.around))
        };
        let misfits = self.peaks.iter().filter(|points| !fits(points));
        let misfits =
            misfits.map(|p| format!("set-up {:?}, experiment {:?}, points around its peak", p.set_up, p.experiment));
        unplanned.chain(misfits).collect()
    }

    /// The points around the measured peak of an experiment on a set-up, once they are known.
    #[must_use]
    pub fn peak(&self, set_up: &str, experiment: &str) -> Option<&PeakPoints> {
        self.peaks.iter().find(|p| p.set_up == set_up && p.experiment == experiment)
    }

    /// An experiment on a set-up as far as it is known: with the points around its peak, once its grid is measured.
    #[must_use]
    pub fn known<'e>(&self, set_up: &str, experiment: &'e Experiment) -> Cow<'e, Experiment> {
        match self.peak(set_up, &experiment.name).filter(|points| experiment.can_have_around_peak(&points.around)) {
            Some(points) => Cow::Owned(experiment.with_points_around_peak(&points.around)),
            None => Cow::Borrowed(experiment),
        }
    }

    /// What the run of a campaign is to measure: as the campaign has it, less the points around peaks that could not be placed.
    #[must_use]
    pub fn planned(&self, campaign: &Campaign) -> Planned {
        let mut planned = Planned::default();
        for experiment in &campaign.experiments {
            for set_up in experiment.set_ups.iter().filter_map(|index| campaign.set_ups.get(*index)) {
                let known = self.known(&set_up.name, experiment);
                planned.points += known.points();
                planned.expected_s += known.expected_s();
            }
        }
        planned
    }

    /// Points that are taken: results of either kind.
    #[must_use]
    pub fn points(&self) -> usize {
        self.rows.len() + self.transients.len()
    }

    /// Results of sweeps that were repeated from their beginning.
    #[must_use]
    pub fn superseded(&self) -> &[ResultRow] {
        &self.superseded
    }

    /// Results that do not count any more, because the end of their samples was lost.
    #[must_use]
    pub fn withdrawn(&self) -> &[Withdrawn] {
        &self.withdrawn
    }

    /// The results in the order of the campaign, however often it was interrupted; `order` gives its set-ups and
    /// experiments as names. The points around a peak are among those of their grid, by frequency; in a random order they follow it.
    #[must_use]
    pub fn rows_in_order(&self, order: &[(String, String)]) -> Vec<ResultRow> {
        let place = |r: &ResultRow| {
            let pair = order.iter().position(|(s, e)| *s == r.set_up && *e == r.experiment).unwrap_or(order.len());
            (pair, r.point_index)
        };
        let mut rows: Vec<ResultRow> = self.rows.clone();
        rows.sort_by_key(place);
        for own in rows.chunk_by_mut(|a, b| a.set_up == b.set_up && a.experiment == b.experiment) {
            if let Some(points) = self.peak(&own[0].set_up, &own[0].experiment) {
                sort_by_frequency(own, &points.around.frequencies_hz);
            }
        }
        rows
    }

    /// The results of each experiment on each set-up together, in the order in which they were begun.
    #[must_use]
    pub fn rows_by_experiment(&self) -> Vec<ResultRow> {
        let mut order: Vec<(String, String)> = Vec::new();
        for row in &self.rows {
            let pair = (row.set_up.clone(), row.experiment.clone());
            if !order.contains(&pair) {
                order.push(pair);
            }
        }
        self.rows_in_order(&order)
    }

    /// Whether an experiment on a set-up was started at one of these points.
    #[must_use]
    pub fn has_begun(&self, set_up: &str, experiment: &str, points: &Range<usize>) -> bool {
        let mut starts = self.segments.iter().filter(|s| s.id.set_up == set_up && s.id.experiment == experiment);
        let mut rows = self.rows.iter().filter(|r| r.set_up == set_up && r.experiment == experiment);
        starts.any(|s| points.contains(&s.first_index)) || rows.any(|r| points.contains(&(r.point_index as usize)))
    }

    /// The next segment of an experiment on a set-up.
    #[must_use]
    pub fn next_segment(&self, set_up: &str, experiment: &str) -> SegmentId {
        let own = self.segments.iter().filter(|s| s.id.set_up == set_up && s.id.experiment == experiment);
        SegmentId { segment: own.count() as u32, set_up: set_up.into(), experiment: experiment.into() }
    }

    /// The ranges of neighbouring points of an experiment that are still to be taken; `points` is how many it has.
    #[must_use]
    pub fn missing(&self, set_up: &str, experiment: &str, points: usize) -> Vec<Range<usize>> {
        let own = self.rows.iter().filter(|r| r.set_up == set_up && r.experiment == experiment);
        let mut have = vec![false; points];
        let events = self.transients.iter().filter(|r| r.set_up == set_up && r.experiment == experiment);
        let indices = own.map(|r| r.point_index).chain(events.map(|r| r.point_index));
        indices.for_each(|index| have.get_mut(index as usize).into_iter().for_each(|h| *h = true));
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for index in (0..points).filter(|i| !have[*i]) {
            match ranges.last_mut() {
                Some(range) if range.end == index => range.end += 1,
                _ => ranges.push(index..index + 1),
            }
        }
        ranges
    }

    /// The losses counted by the runs of the program that ended, and the rows that the parts lack.
    #[must_use]
    pub fn losses(&self) -> Losses {
        let mut sum = Losses::default();
        self.ended.iter().for_each(|e| sum += e.counters);
        let missing = self.sealed.iter().map(|s| s.lost_rows).chain(self.finished.iter().map(|f| f.lost_rows));
        missing.chain(self.left_parts().map(|s| s.rows)).for_each(|n| sum.lost_rows = sum.lost_rows.saturating_add(n));
        sum
    }

    /// A line's counters cover the time since the program began, so the latest replace earlier ones.
    fn update_controller(&mut self, now: Option<Controller>) {
        if let (Some(latest), Some(_)) = (self.controllers.last_mut(), now) {
            *latest = now;
        }
    }

    /// The controller's counters over all runs of the program; none without any. Of a run of the program that was killed,
    /// up to the last segment that was finished.
    #[must_use]
    pub fn controller(&self) -> Option<Controller> {
        self.controllers.iter().flatten().copied().reduce(Controller::and)
    }

    /// Parts that were damaged when the others were joined: their rows are not in `samples.parquet`.
    pub fn left_parts(&self) -> impl Iterator<Item = &Sealed> {
        let left = self.joined.as_ref().map_or(&[][..], |joined| &joined.left);
        self.sealed.iter().filter(move |s| left.contains(&s.part))
    }

    /// Rows of the closed parts.
    #[must_use]
    pub fn sealed_rows(&self) -> u64 {
        self.sealed.iter().map(|s| s.rows).fold(0, u64::saturating_add)
    }

    /// Whether a part of this number is closed.
    #[must_use]
    pub fn is_sealed(&self, part: u32) -> bool {
        self.sealed.iter().any(|s| s.part == part)
    }

    /// The end of a segment, if the device finished it.
    #[must_use]
    pub fn end_of(&self, id: &SegmentId) -> Option<&Finished> {
        self.finished.iter().find(|f| f.id == *id)
    }

    /// Wall time of the runs of the program that ended in an orderly way, s.
    #[must_use]
    pub fn wall_s(&self) -> f64 {
        self.ended.iter().map(|e| e.wall_s).sum()
    }

    /// Device time up to the last point of each segment, ticks.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        let end = |start: &SegmentStart| {
            let id = &start.id;
            let is_own = |set_up: &str, experiment: &str, segment: u32| {
                set_up == id.set_up && experiment == id.experiment && segment == id.segment
            };
            let results = self.rows.iter().chain(&self.superseded);
            let results = results.filter(|r| is_own(&r.set_up, &r.experiment, r.segment)).map(|r| r.end_tick);
            let transients = self.transients.iter().filter(|r| is_own(&r.set_up, &r.experiment, r.segment));
            let finished = self.end_of(id).map(|f| u64::from(f.end_tick));
            results.chain(transients.map(|r| r.end_tick)).chain(finished).max().unwrap_or(0)
        };
        self.segments.iter().map(end).fold(0, u64::saturating_add)
    }
}

/// Sorts the results of a grid and those around its peak by frequency, in the grid's direction; a grid in a random order is left.
fn sort_by_frequency(rows: &mut [ResultRow], around_peak_hz: &[f64]) {
    let grid: Vec<f64> = rows.iter().map(|r| r.frequency_hz).filter(|f| !around_peak_hz.contains(f)).collect();
    if grid.is_sorted() {
        rows.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    } else if grid.is_sorted_by(|a, b| a >= b) {
        rows.sort_by(|a, b| b.frequency_hz.total_cmp(&a.frequency_hz));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{AroundPeak, GridPeak};

    fn result(point_index: u32, segment: u32) -> JournalEntry {
        let row =
            ResultRow { set_up: "a".into(), experiment: "e".into(), point_index, segment, ..ResultRow::default() };
        JournalEntry::Result(Box::new(row))
    }

    fn start(segment: u32, anew: bool) -> JournalEntry {
        let id = SegmentId { set_up: "a".into(), experiment: "e".into(), segment };
        JournalEntry::Segment(SegmentStart { id, points: 5, anew, ..SegmentStart::default() })
    }

    #[test]
    fn missing_points_are_listed_as_ranges() {
        let taken = JournalState::of(&[start(0, false), result(0, 0), result(3, 0)]);
        assert_eq!(taken.missing("a", "e", 6), [1..3, 4..6]);
        assert_eq!(taken.missing("b", "e", 2).first(), Some(&(0..2)));
        assert!(taken.missing("a", "e", 1).is_empty());
    }

    #[test]
    fn the_latest_counters_of_each_run_of_the_program_add_up() {
        let device = r#"{"link":"","board":"","firmware":"","protocol_version":1,"protocol_schema":"","simulated":true,"plant":"","clock":"","tick_hz":1.0}"#;
        let begin = format!(
            r#"{{"entry":"begin","at":"","damprig":"","device":{device},"signals":[],"every_ticks":1,"campaign":""}}"#
        );
        let finished = |controller: &str| {
            format!(
                r#"{{"entry":"finished","set_up":"a","experiment":"e","segment":0,"end_tick":1,"lost_rows":0,"clock":null{controller}}}"#
            )
        };
        let ended = |controller: &str| {
            format!(r#"{{"entry":"ended","at":"","reason":null,"counters":{{}},"wall_s":1.0{controller}}}"#)
        };
        let told = |overruns: u32, tick_us: u32| {
            format!(r#","controller":{{"overruns":{overruns},"longest_tick_us":{tick_us}}}"#)
        };
        let sum = |lines: &[String]| {
            let entries: Vec<JournalEntry> = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
            JournalState::of(&entries).controller().map(|c| (c.overruns, c.longest_tick_us))
        };
        // A run that ended, one that was killed, one without counters.
        let parts = [
            begin.clone(),
            finished(&told(1, 90)),
            ended(&told(3, 90)),
            begin.clone(),
            finished(&told(2, 40)),
            begin.clone(),
            ended(""),
        ];
        assert_eq!(sum(&parts), Some((5, 90)));
        assert_eq!(sum(&[begin, finished(""), ended("")]), None, "an older journal");
    }

    #[test]
    fn a_point_counts_once_and_a_repeated_sweep_counts_from_its_new_start() {
        let mut taken = JournalState::of(&[start(0, false), result(0, 0), result(1, 0), result(1, 0)]);
        assert_eq!((taken.rows().len(), taken.next_segment("a", "e").segment), (2, 1));
        taken.add(&start(1, true));
        taken.add(&result(0, 1));
        assert_eq!((taken.rows().len(), taken.superseded().len()), (1, 2));
        assert_eq!(taken.rows()[0].segment, 1);
    }

    fn measured(point_index: u32, frequency_hz: f64) -> JournalEntry {
        let JournalEntry::Result(row) = result(point_index, 0) else { unreachable!() };
        JournalEntry::Result(Box::new(ResultRow { frequency_hz, ..*row }))
    }

    fn around(frequencies_hz: &[f64]) -> JournalEntry {
        let peak = Some(GridPeak { frequency_hz: 2.5, between_hz: [2.4, 2.6] });
        let around = AroundPeak { peak, second: None, frequencies_hz: frequencies_hz.to_vec() };
        JournalEntry::PeakPoints(Box::new(PeakPoints {
            set_up: "a".into(),
            experiment: "e".into(),
            around,
            at: String::new(),
        }))
    }

    fn order(grid: [f64; 3]) -> Vec<f64> {
        let mut entries: Vec<JournalEntry> = (0..).zip(grid).map(|(n, f)| measured(n, f)).collect();
        entries.extend([around(&[2.45, 2.55]), measured(3, 2.45), measured(4, 2.55)]);
        JournalState::of(&entries).rows_in_order(&[("a".into(), "e".into())]).iter().map(|r| r.frequency_hz).collect()
    }

    #[test]
    fn points_around_a_peak_are_among_those_of_their_grid() {
        assert_eq!(order([2.4, 2.5, 2.6]), [2.4, 2.45, 2.5, 2.55, 2.6]);
        assert_eq!(order([2.6, 2.5, 2.4]), [2.6, 2.55, 2.5, 2.45, 2.4]);
        assert_eq!(order([2.6, 2.4, 2.5]), [2.6, 2.4, 2.5, 2.45, 2.55], "a random order");
    }

    #[test]
    fn a_sweep_around_a_peak_that_is_repeated_keeps_the_grid_and_a_repeated_grid_has_a_new_peak() {
        let anew = |segment, first_index| {
            let JournalEntry::Segment(start) = start(segment, true) else { unreachable!() };
            JournalEntry::Segment(SegmentStart { first_index, ..start })
        };
        let mut taken = JournalState::of(&[start(0, false), result(0, 0), result(1, 0), around(&[2.45]), result(2, 1)]);
        taken.add(&around(&[2.47]));
        assert_eq!(taken.peak("a", "e").map(|p| p.around.frequencies_hz.clone()), Some(vec![2.45]), "the first counts");
        taken.add(&anew(2, 2));
        assert_eq!((taken.rows().len(), taken.superseded().len(), taken.peaks.len()), (2, 1, 1));
        assert!(taken.has_begun("a", "e", &(0..2)) && !taken.has_begun("a", "e", &(3..5)));
        taken.add(&anew(3, 0));
        assert_eq!((taken.rows().len(), taken.superseded().len(), taken.peaks.len()), (0, 3, 0));
    }

    #[test]
    fn a_line_of_points_around_a_peak_reads_back_to_the_same_bits() {
        let line = around(&[2.433_333_333, 0.1 + 0.2]);
        let text = serde_json::to_string(&line).unwrap();
        assert!(text.starts_with("{\"entry\":\"peak_points\""), "{text}");
        assert_eq!(serde_json::from_str::<JournalEntry>(&text).unwrap(), line);
    }
}
