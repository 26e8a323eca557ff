//! The samples of x, z and the friction spring's force of a run, segment by segment.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::schema::segment_id::SegmentId;
use crate::table::values::{numbers, texts};

/// Samples of one segment in some ticks, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct RecordedSamples {
    ticks: Vec<u64>,
    x_m: Vec<f32>,
    z_m: Vec<f32>,
    /// Force of the friction damper's spring, N; empty if it was not recorded.
    spring_n: Vec<f32>,
}

impl RecordedSamples {
    /// Places of the samples of all these ticks; `None` if one is missing.
    fn places(&self, ticks: &Range<u64>) -> Option<Range<usize>> {
        let from = self.ticks.binary_search(&ticks.start).ok()?;
        let until = from + usize::try_from(ticks.end.checked_sub(ticks.start)?).ok()?;
        let last = self.ticks.get(until.checked_sub(1)?)?;
        (*last == ticks.end - 1).then_some(from..until)
    }

    /// x of all these ticks, m; `None` if one is missing.
    pub(super) fn x_m(&self, ticks: &Range<u64>) -> Option<&[f32]> {
        self.x_m.get(self.places(ticks)?)
    }

    /// z of all these ticks with `beyond` more at either end, m, where the base counts as staying where it is; `None` if one of the
    /// ticks is missing.
    pub(super) fn z_m(&self, ticks: &Range<u64>, beyond: usize) -> Option<Vec<f32>> {
        let places = self.places(ticks)?;
        let whole = self.z_m.get(places.clone())?;
        let mut around = Vec::with_capacity(whole.len() + 2 * beyond);
        for back in (1..=beyond).rev() {
            let place = places.start.checked_sub(back).filter(|place| self.ticks[*place] + back as u64 == ticks.start);
            around.push(place.map_or(whole[0], |place| self.z_m[place]));
        }
        around.extend_from_slice(whole);
        for on in 0..beyond {
            let place = places.end + on;
            let is_next = self.ticks.get(place) == Some(&(ticks.end + on as u64));
            around.push(if is_next { self.z_m[place] } else { whole[whole.len() - 1] });
        }
        Some(around)
    }

    /// The last tick at or before `until` at whose end |z| has stayed below `level_m` for `quiet_ticks`; `None` without enough samples.
    pub(super) fn last_at_rest(&self, until: u64, level_m: f64, quiet_ticks: u64) -> Option<u64> {
        let rows = self.ticks.partition_point(|tick| *tick <= until);
        let mut moved_at = None;
        let mut quiet_until = None;
        for n in (0..rows).rev() {
            if f64::from(self.z_m[n]).abs() >= level_m {
                (moved_at, quiet_until) = (Some(self.ticks[n]), None);
                continue;
            }
            let end = *quiet_until.get_or_insert(self.ticks[n]);
            if end - self.ticks[n] >= quiet_ticks {
                // Between the two rows the base began to move.
                return Some(moved_at.map_or(end, |moved| end.midpoint(moved)));
            }
        }
        None
    }

    /// The force of the friction damper's spring in each of these ticks as the mean over `window` ticks around it, N, and the RMS noise
    /// of a sample; `None` if it was not recorded, or not in every window.
    pub(super) fn spring_n(&self, ticks: &Range<u64>, window: f64) -> Option<(Vec<f64>, f64)> {
        let half = (0.5 * window) as u64;
        let from = self.ticks.partition_point(|tick| tick + half < ticks.start);
        let until = self.ticks.partition_point(|tick| *tick < ticks.end + half);
        let (at, forces) = (self.ticks.get(from..until)?, self.spring_n.get(from..until)?);
        let steps = forces.windows(2).map(|pair| f64::from(pair[1] - pair[0]).powi(2));
        let noise_n = (0.5 * steps.sum::<f64>() / forces.len().saturating_sub(1).max(1) as f64).sqrt();
        let (mut first, mut next, mut sum) = (0, 0, 0.0);
        let mut mean = |tick: u64| {
            while next < at.len() && at[next] <= tick + half {
                sum += f64::from(forces[next]);
                next += 1;
            }
            while first < next && at[first] + half < tick {
                sum -= f64::from(forces[first]);
                first += 1;
            }
            (next > first).then(|| sum / (next - first) as f64)
        };
        let means: Option<Vec<f64>> = ticks.clone().map(&mut mean).collect();
        means.filter(|means| means.iter().all(|force_n| force_n.is_finite())).map(|means| (means, noise_n))
    }

    /// Samples per tick, at most 1; 0 without samples.
    pub(super) fn density(&self) -> f64 {
        match (self.ticks.first(), self.ticks.last()) {
            (Some(first), Some(last)) if last > first => (self.ticks.len() - 1) as f64 / (last - first) as f64,
            _ => 0.0,
        }
    }
}

/// Rows of evenly spaced ticks that follow each other in the file.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first_tick: u64,
    /// Ticks from row to row.
    every: u64,
    rows: u64,
    /// Place of the first row in the file.
    place: u64,
}

impl Stretch {
    /// The rows of these ticks, counted from the first.
    fn within(&self, ticks: &Range<u64>) -> Range<u64> {
        let before = |tick: u64| tick.saturating_sub(self.first_tick).div_ceil(self.every).min(self.rows);
        before(ticks.start)..before(ticks.end)
    }
}

/// The rows of a segment, in the order of their ticks.
#[derive(Clone, Debug, Default)]
struct RecordedSegment {
    stretches: Vec<Stretch>,
    last_tick: Option<u64>,
    /// A tick is not later than the one before: the file is damaged.
    is_unordered: bool,
}

impl RecordedSegment {
    fn push(&mut self, tick: u64, place: u64) {
        self.is_unordered |= self.last_tick.is_some_and(|last| tick <= last);
        self.last_tick = Some(tick);
        if let Some(own) = self.stretches.last_mut()
            && own.place + own.rows == place
            && tick > own.first_tick
        {
            if own.rows == 1 {
                own.every = tick - own.first_tick;
            }
            let next = own.rows.checked_mul(own.every).and_then(|ticks| own.first_tick.checked_add(ticks));
            if next == Some(tick) {
                own.rows += 1;
                return;
            }
        }
        self.stretches.push(Stretch { first_tick: tick, every: 1, rows: 1, place });
    }
}

/// The samples of a run: x, z and the spring's force of each row in a temporary file, and where the rows of each segment are in it.
/// So memory does not grow with the run.
#[derive(Debug, Default)]
pub(super) struct AllRecorded {
    segments: BTreeMap<(String, String, u32), RecordedSegment>,
    file: Option<Mutex<File>>,
    rows: u64,
    has_x: bool,
    has_spring: bool,
    /// What could not be read.
    pub(super) unreadable: Vec<String>,
}

/// Bytes of a row in the file: x, z and force in single precision, NaN where one is not recorded.
const ROW: usize = 3 * size_of::<f32>();

impl AllRecorded {
    /// Reads the samples of a run that has recorded z. `go_on` ends the reading when it is false.
    ///
    /// # Errors
    /// When the temporary file cannot be written.
    pub(super) fn of(run: &RunFolder, go_on: impl Fn() -> bool) -> Result<Self, Failure> {
        let mut all = Self::default();
        let has = |name: &str| run.manifest().signals.iter().any(|signal| signal.name == name);
        if !has("z_m") {
            return Ok(all);
        }
        // A run may have recorded z alone.
        (all.has_x, all.has_spring) = (has("x_m"), has("spring_force_n"));
        let failed = |error: std::io::Error| {
            Failure::Storage(format!("cannot write a temporary file: {error}; is the disk full?"))
        };
        let mut file = tempfile::tempfile().map_err(failed)?;
        for batch in run.samples().take_while(|_| go_on()) {
            let read = batch.and_then(|batch| all.note(&batch));
            match read {
                Ok(bytes) => file.write_all(&bytes).map_err(failed)?,
                Err(error) => all.unreadable.push(error.to_string()),
            }
        }
        all.file = Some(Mutex::new(file));
        // Rows of a damaged file need not be in order.
        let unreadable = &mut all.unreadable;
        all.segments.retain(|id, own| {
            if own.is_unordered {
                unreadable.push(format!("samples of {:?} on {:?}: their ticks do not rise", id.1, id.0));
            }
            !own.is_unordered
        });
        Ok(all)
    }

    /// Notes where the rows of a batch will be, and gives their bytes.
    fn note(&mut self, batch: &RecordBatch) -> Result<Vec<u8>, Failure> {
        let read = |name: &str| numbers(batch, name);
        let names = |name: &str| texts(batch, name);
        let (set_ups, experiments, segments) = (names("set_up")?, names("experiment")?, read("segment")?);
        let (ticks, z_m) = (read("tick")?, read("z_m")?);
        let optional = |has: bool, name: &str| if has { read(name) } else { Ok(vec![f64::NAN; ticks.len()]) };
        let (x_m, spring_n) = (optional(self.has_x, "x_m")?, optional(self.has_spring, "spring_force_n")?);
        let key = |n: usize| (&set_ups[n], &experiments[n], segments[n] as u32);
        let mut bytes = Vec::with_capacity(ticks.len() * ROW);
        for rows in (0..ticks.len()).collect::<Vec<_>>().chunk_by(|a, b| key(*a) == key(*b)) {
            let (set_up, experiment, segment) = key(rows[0]);
            let own = self.segments.entry((set_up.clone(), experiment.clone(), segment)).or_default();
            for &n in rows {
                own.push(ticks[n] as u64, self.rows);
                self.rows += 1;
                bytes.extend([x_m[n], z_m[n], spring_n[n]].iter().flat_map(|value| (*value as f32).to_le_bytes()));
            }
        }
        Ok(bytes)
    }

    /// The samples of a segment in these ticks; `None` if there are none of the segment.
    pub(super) fn samples(&self, id: &SegmentId, ticks: &Range<u64>) -> Option<RecordedSamples> {
        let segment = self.segments.get(&(id.set_up.clone(), id.experiment.clone(), id.segment))?;
        let mut file = self.file.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        let mut recorded = RecordedSamples::default();
        for stretch in &segment.stretches {
            let rows = stretch.within(ticks);
            let mut bytes = vec![0; (rows.end - rows.start) as usize * ROW];
            file.seek(SeekFrom::Start((stretch.place + rows.start) * ROW as u64)).ok()?;
            file.read_exact(&mut bytes).ok()?;
            recorded.ticks.extend(rows.map(|row| stretch.first_tick + row * stretch.every));
            for row in bytes.chunks_exact(ROW) {
                let value = |n: usize| f32::from_le_bytes([row[n], row[n + 1], row[n + 2], row[n + 3]]);
                recorded.x_m.extend(self.has_x.then(|| value(0)));
                recorded.z_m.push(value(4));
                recorded.spring_n.extend(self.has_spring.then(|| value(8)));
            }
        }
        Some(recorded)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float32Array, UInt32Array, UInt64Array};
    use arrow_schema::Metadata;

    use super::*;
    use crate::run_folder::schema::samples::{PointLabel, SampleColumn, complete, schema, stream_schema};

    fn recorded(ticks: impl Iterator<Item = u64> + Clone, z: impl Fn(u64) -> f32) -> RecordedSamples {
        RecordedSamples { z_m: ticks.clone().map(z).collect(), ticks: ticks.collect(), ..RecordedSamples::default() }
    }

    /// Rows of two segments in turns, with gaps, one row apart and then two, in batches that end anywhere.
    #[test]
    fn the_samples_of_any_ticks_are_those_of_the_run() {
        let signals = ["x_m", "z_m"].map(|name| SampleColumn { name: name.into(), unit: "m".into() });
        let id = |segment| SegmentId { set_up: "a".into(), experiment: "e".into(), segment };
        let mut rows: Vec<(u32, u64)> = (0..500).filter(|tick| tick % 97 > 2).map(|tick| (0, tick)).collect();
        rows.extend((0..300).step_by(2).map(|tick| (1, tick)));
        rows.extend((900..1000).map(|tick| (0, tick)));
        let mut all = AllRecorded { has_x: true, ..AllRecorded::default() };
        let mut file = tempfile::tempfile().unwrap();
        for part in rows.chunks(33).flat_map(|part| part.chunk_by(|a, b| a.0 == b.0)) {
            let label = PointLabel { id: id(part[0].0), ..PointLabel::default() };
            let columns: Vec<ArrayRef> = vec![
                Arc::new(UInt64Array::from_iter_values(part.iter().map(|row| row.1))),
                Arc::new(UInt32Array::from(vec![0; part.len()])),
                Arc::new(Float32Array::from_iter_values(part.iter().map(|row| row.1 as f32))),
                Arc::new(Float32Array::from_iter_values(part.iter().map(|row| -(row.1 as f32)))),
            ];
            let batch = RecordBatch::try_new(stream_schema(&label, &signals, 1000.0), columns).unwrap();
            let batch = complete(&schema(&signals, &Metadata::new()), &label, 1000.0, &batch).unwrap();
            file.write_all(&all.note(&batch).unwrap()).unwrap();
        }
        all.file = Some(Mutex::new(file));
        for segment in [0, 1] {
            for ticks in [0..u64::MAX, 0..1, 3..94, 90..110, 299..301, 499..901, 950..2000, 2000..3000, 5..5] {
                let expected: Vec<u64> =
                    rows.iter().filter(|row| row.0 == segment && ticks.contains(&row.1)).map(|row| row.1).collect();
                let found = all.samples(&id(segment), &ticks).unwrap();
                assert_eq!(found.ticks, expected, "{segment}: {ticks:?}");
                assert!(found.x_m.iter().zip(&expected).all(|(x, tick)| *x == *tick as f32), "{segment}: {ticks:?}");
                assert!(found.z_m.iter().zip(&expected).all(|(z, tick)| *z == -(*tick as f32)), "{segment}: {ticks:?}");
                assert_eq!(
                    (found.x_m.len(), found.z_m.len(), found.spring_n.len()),
                    (expected.len(), expected.len(), 0)
                );
            }
        }
        assert!(all.samples(&id(2), &(0..10)).is_none());
        assert!(all.segments.values().all(|segment| segment.stretches.len() < 10), "a stretch has many rows");
    }

    #[test]
    fn ticks_are_given_only_if_none_is_missing() {
        let whole = recorded(10..100, |tick| tick as f32);
        assert_eq!(whole.z_m(&(10..13), 2).unwrap(), [10.0, 10.0, 10.0, 11.0, 12.0, 13.0, 14.0]);
        assert_eq!(whole.z_m(&(98..100), 1).unwrap(), [97.0, 98.0, 99.0, 99.0]);
        assert_eq!(whole.z_m(&(98..101), 1), None);
        let gap = recorded((10..100).filter(|tick| *tick != 50), |tick| tick as f32);
        assert!(gap.z_m(&(10..50), 0).is_some() && gap.z_m(&(45..55), 0).is_none());
    }

    #[test]
    fn the_force_of_a_spring_is_the_mean_around_a_tick() {
        let ticks = 0..1000;
        let force = |tick: u64| if tick < 500 { 1.0 } else { 2.0 };
        let own = RecordedSamples { spring_n: ticks.clone().map(force).collect(), ..recorded(ticks, |_| 0.0) };
        let (forces_n, _) = own.spring_n(&(100..900), 100.0).unwrap();
        assert_eq!(forces_n.len(), 800);
        assert!((forces_n[0] - 1.0).abs() < 1e-12 && (forces_n[799] - 2.0).abs() < 1e-12);
        assert!((forces_n[400] - 1.5).abs() < 0.01, "{}", forces_n[400]);
        assert_eq!(own.spring_n(&(900..1200), 100.0), None, "samples are missing");
        assert_eq!(recorded(0..1000, |_| 0.0).spring_n(&(100..900), 100.0), None, "it was not recorded");
    }

    #[test]
    fn the_last_rest_before_a_drive_is_found_at_any_rate() {
        for every in [1, 20] {
            let z = |tick: u64| if tick < 1000 { 1e-6 } else { (1e-3 * (0.0157 * (tick - 1000) as f64).sin()) as f32 };
            let own = recorded((0..3000).step_by(every), z);
            let found = own.last_at_rest(2900, 1e-4, 400).unwrap();
            assert!(found.abs_diff(1006) <= every as u64, "{found}");
        }
    }
}
