//! The samples of x, z and the friction spring's force of a run, segment by segment.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::run_folder::RunFolder;
use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::schema::segment_id::SegmentId;

/// Samples of one segment, in the order of their ticks.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorded {
    ticks: Vec<u64>,
    x_m: Vec<f32>,
    z_m: Vec<f32>,
    /// Force of the friction damper's spring, N; empty if it was not recorded.
    spring_n: Vec<f32>,
}

impl Recorded {
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

/// The samples of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct AllRecorded {
    segments: BTreeMap<(String, String, u32), Recorded>,
    /// What could not be read.
    pub(super) unreadable: Vec<String>,
}

impl AllRecorded {
    /// Reads the samples of a run that has recorded z.
    pub(super) fn of(run: &RunFolder) -> Self {
        let mut all = Self::default();
        if !run.manifest().signals.iter().any(|signal| signal.name == "z_m") {
            return all;
        }
        for batch in run.samples() {
            let read = batch.map_err(|error| error.to_string()).and_then(|batch| all.add(&batch));
            all.unreadable.extend(read.err());
        }
        // Rows of a damaged file need not be in order.
        all.segments.retain(|id, own| {
            let is_ordered = own.ticks.is_sorted_by(|a, b| a < b);
            if !is_ordered {
                all.unreadable.push(format!("samples of {:?} on {:?}: their ticks do not rise", id.1, id.0));
            }
            is_ordered
        });
        all
    }

    fn add(&mut self, batch: &arrow_array::RecordBatch) -> Result<(), String> {
        let read = |name: &str| numbers(batch, name).map_err(|error| error.to_string());
        let names = |name: &str| texts(batch, name).map_err(|error| error.to_string());
        let (set_ups, experiments, segments) = (names("set_up")?, names("experiment")?, read("segment")?);
        let (ticks, z_m) = (read("tick")?, read("z_m")?);
        // A run may have recorded z alone.
        let x_m = if batch.column_by_name("x_m").is_some() { Some(read("x_m")?) } else { None };
        let spring_n =
            if batch.column_by_name("spring_force_n").is_some() { Some(read("spring_force_n")?) } else { None };
        let mut from = 0;
        while from < ticks.len() {
            let key = |n: usize| (&set_ups[n], &experiments[n], segments[n] as u32);
            let until = (from..ticks.len()).find(|n| key(*n) != key(from)).unwrap_or(ticks.len());
            let (set_up, experiment, segment) = key(from);
            let own = self.segments.entry((set_up.clone(), experiment.clone(), segment)).or_default();
            own.ticks.extend(ticks[from..until].iter().map(|tick| *tick as u64));
            own.z_m.extend(z_m[from..until].iter().map(|z| *z as f32));
            own.x_m.extend(x_m.iter().flat_map(|x| &x[from..until]).map(|x| *x as f32));
            own.spring_n.extend(spring_n.iter().flat_map(|force| &force[from..until]).map(|force| *force as f32));
            from = until;
        }
        Ok(())
    }

    /// The samples of a segment.
    pub(super) fn segment(&self, id: &SegmentId) -> Option<&Recorded> {
        self.segments.get(&(id.set_up.clone(), id.experiment.clone(), id.segment))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(ticks: impl Iterator<Item = u64> + Clone, z: impl Fn(u64) -> f32) -> Recorded {
        Recorded { z_m: ticks.clone().map(z).collect(), ticks: ticks.collect(), ..Recorded::default() }
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
        let own = Recorded { spring_n: ticks.clone().map(force).collect(), ..recorded(ticks, |_| 0.0) };
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
