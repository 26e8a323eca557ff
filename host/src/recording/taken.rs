//! What the lines of a journal add up to: the points that are taken, and what is still to do.
//!
//! The run itself keeps this sum while it writes the lines, so that going on after a break of the link and taking up a
//! run that was killed are the same thing.

use std::ops::Range;

use super::ResultRow;
use super::controller::Controller;
use super::impacts::Impacts;
use super::journal::{Begin, Ended, Entry, Finished, Sealed, Segment};
use super::manifest::Counters;
use super::transients::TransientRow;

/// What has been taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Taken {
    /// Each time that the program began.
    pub begun: Vec<Begin>,
    /// Each start of the device.
    pub segments: Vec<Segment>,
    /// Segments that came to their end.
    pub finished: Vec<Finished>,
    /// The parts of the samples.
    pub sealed: Vec<Sealed>,
    /// Rows in `samples.parquet`, once the parts are joined in it.
    pub joined: Option<u64>,
    /// Numbers of the parts that were damaged when the others were joined.
    pub left: Vec<u32>,
    /// Each orderly end of the program.
    pub ended: Vec<Ended>,
    /// Links that were lost or came back, in words.
    pub link: Vec<String>,
    /// Impacts as they were reported.
    pub impacts: Vec<Impacts>,
    /// The latest word on the controller since each time that the program began.
    controllers: Vec<Option<Controller>>,
    transients: Vec<TransientRow>,
    rows: Vec<ResultRow>,
    superseded: Vec<ResultRow>,
}

impl Taken {
    /// Of a journal.
    #[must_use]
    pub fn of(entries: &[Entry]) -> Self {
        let mut taken = Self::default();
        entries.iter().for_each(|entry| taken.add(entry));
        taken
    }

    /// One more line.
    pub fn add(&mut self, entry: &Entry) {
        match entry {
            Entry::Begin(begin) => {
                self.begun.push((**begin).clone());
                self.controllers.push(None);
            }
            Entry::Segment(segment) => {
                if segment.anew {
                    let is_earlier = |r: &ResultRow| r.set_up == segment.set_up && r.experiment == segment.experiment;
                    self.superseded.extend(self.rows.extract_if(.., |r| is_earlier(r)));
                }
                self.segments.push(segment.clone());
            }
            Entry::Result(row) => {
                let is_same = |r: &ResultRow| {
                    r.point_index == row.point_index && r.set_up == row.set_up && r.experiment == row.experiment
                };
                // A point is taken once; a second line of it would be a repetition.
                if !self.rows.iter().any(is_same) {
                    self.rows.push((**row).clone());
                }
            }
            Entry::Transient(row) => {
                let is_same = |r: &TransientRow| r.set_up == row.set_up && r.experiment == row.experiment;
                if !self.transients.iter().any(is_same) {
                    self.transients.push((**row).clone());
                }
            }
            Entry::Impacts(some) => self.impacts.push((**some).clone()),
            Entry::Sealed(sealed) => {
                self.sealed.retain(|s| s.part != sealed.part);
                self.sealed.push(sealed.clone());
            }
            Entry::Finished(finished) => {
                self.hear_of_the_controller(finished.controller);
                self.finished.push(finished.clone());
            }
            Entry::Clock(_) => {}
            Entry::Link { what, at } => self.link.push(format!("{at}: {what}")),
            Entry::Joined { rows, left } => {
                self.joined = Some(*rows);
                self.left.clone_from(left);
            }
            Entry::Ended(ended) => {
                self.hear_of_the_controller(ended.controller);
                self.ended.push(ended.clone());
            }
        }
    }

    /// The results that count, in the order in which they were taken.
    #[must_use]
    pub fn rows(&self) -> &[ResultRow] {
        &self.rows
    }

    /// The results of records, pulses and free vibrations, in the order in which they were taken.
    #[must_use]
    pub fn transients(&self) -> &[TransientRow] {
        &self.transients
    }

    /// Points that are taken: results of either kind.
    #[must_use]
    pub fn points(&self) -> usize {
        self.rows.len() + self.transients.len()
    }

    /// Results of sweeps that had to be begun anew.
    #[must_use]
    pub fn superseded(&self) -> &[ResultRow] {
        &self.superseded
    }

    /// The results in the order of the campaign, however often it was interrupted; `order` gives its set-ups and
    /// experiments as names.
    #[must_use]
    pub fn rows_in_order(&self, order: &[(String, String)]) -> Vec<ResultRow> {
        let place = |r: &ResultRow| {
            let pair = order.iter().position(|(s, e)| *s == r.set_up && *e == r.experiment).unwrap_or(order.len());
            (pair, r.point_index)
        };
        let mut rows = self.rows.clone();
        rows.sort_by_key(place);
        rows
    }

    /// The number that the next segment of an experiment gets.
    #[must_use]
    pub fn next_segment(&self, set_up: &str, experiment: &str) -> u32 {
        self.segments.iter().filter(|s| s.set_up == set_up && s.experiment == experiment).count() as u32
    }

    /// The runs of neighbouring points of an experiment of so many points that are still to be taken.
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

    /// What earlier runs of the program have counted as lost, and the rows that the parts lack.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let mut sum = Counters::default();
        self.ended.iter().for_each(|e| sum += e.counters);
        let missing = self.sealed.iter().map(|s| s.lost_rows).chain(self.finished.iter().map(|f| f.lost_rows));
        sum.lost_rows += missing.chain(self.left_parts().map(|s| s.rows)).sum::<u64>();
        sum
    }

    /// It tells of all since the program began.
    fn hear_of_the_controller(&mut self, now: Option<Controller>) {
        if let (Some(latest), Some(_)) = (self.controllers.last_mut(), now) {
            *latest = now;
        }
    }

    /// How the controller kept up, over all runs of the program; none when nothing was heard of it. Of a run of the
    /// program that was killed, up to the last segment that came to its end.
    #[must_use]
    pub fn controller(&self) -> Option<Controller> {
        self.controllers.iter().flatten().copied().reduce(Controller::and)
    }

    /// Parts that were damaged when the others were joined: their rows are in no file that can be relied on.
    pub fn left_parts(&self) -> impl Iterator<Item = &Sealed> {
        self.sealed.iter().filter(|s| self.left.contains(&s.part))
    }

    /// Wall time of the runs of the program that ended in an orderly way, s.
    #[must_use]
    pub fn wall_s(&self) -> f64 {
        self.ended.iter().map(|e| e.wall_s).sum()
    }

    /// Device time up to the last point of each segment, ticks.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        let end = |s: &Segment| {
            let finished = self
                .finished
                .iter()
                .filter(|f| f.set_up == s.set_up && f.experiment == s.experiment && f.segment == s.segment);
            let rows = self
                .rows
                .iter()
                .chain(&self.superseded)
                .filter(|r| r.set_up == s.set_up && r.experiment == s.experiment && r.segment == s.segment);
            let events = self
                .transients
                .iter()
                .filter(|r| r.set_up == s.set_up && r.experiment == s.experiment && r.segment == s.segment);
            let ends = rows.map(|r| r.end_tick).chain(events.map(|r| r.end_tick));
            finished.map(|f| u64::from(f.end_tick)).chain(ends).max().unwrap_or(0)
        };
        self.segments.iter().map(end).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(point_index: u32, segment: u32) -> Entry {
        let row = ResultRow { set_up: "a".into(), experiment: "e".into(), point_index, segment, ..ResultRow::SAMPLE };
        Entry::Result(Box::new(row))
    }

    fn start(segment: u32, anew: bool) -> Entry {
        let (set_up, experiment, at) = ("a".into(), "e".into(), String::new());
        Entry::Segment(Segment { set_up, experiment, segment, first_index: 0, points: 5, anew, at })
    }

    #[test]
    fn what_is_missing_comes_in_runs_of_neighbours() {
        let taken = Taken::of(&[start(0, false), result(0, 0), result(3, 0)]);
        assert_eq!(taken.missing("a", "e", 6), [1..3, 4..6]);
        assert_eq!(taken.missing("b", "e", 2).first(), Some(&(0..2)));
        assert!(taken.missing("a", "e", 1).is_empty());
    }

    #[test]
    fn the_controllers_latest_word_of_each_part_counts_and_the_parts_add_up() {
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
            let entries: Vec<Entry> = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
            Taken::of(&entries).controller().map(|c| (c.overruns, c.longest_tick_us))
        };
        // A part that ended in order, one that was killed, one that never asked.
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
    fn a_point_counts_once_and_a_sweep_begun_anew_counts_from_its_new_start() {
        let mut taken = Taken::of(&[start(0, false), result(0, 0), result(1, 0), result(1, 0)]);
        assert_eq!((taken.rows().len(), taken.next_segment("a", "e")), (2, 1));
        taken.add(&start(1, true));
        taken.add(&result(0, 1));
        assert_eq!((taken.rows().len(), taken.superseded().len()), (1, 2));
        assert_eq!(taken.rows()[0].segment, 1);
    }
}
