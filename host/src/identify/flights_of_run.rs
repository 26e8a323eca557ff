//! Takes the impacts and x of an experiment from a run folder.

use std::collections::BTreeMap;
use std::path::Path;

use damprig_core::io::TICK_HZ;
use damprig_core::model::SetUp;

use super::flights::{Hit, Record};
use super::from_run::ExperimentChoice;
use super::{Sensors, sensors};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::table::values::{numbers, texts};

/// The impacts and x of an experiment with an impact damper.
#[derive(Clone, Debug)]
pub struct ParticleRun {
    /// Run, set-up and experiment, in words.
    pub taken_from: String,
    /// A record for each point.
    pub records: Vec<Record>,
    /// The set-up.
    pub set_up: SetUp,
    /// The displacement sensors.
    pub sensors: Sensors,
}

/// Middle of a tick's ten samples, in ticks from its start.
const MIDDLE: f64 = 0.55;

/// Readings of a start of an experiment, with the points that they belong to.
#[derive(Debug, Default)]
struct FlightSegment {
    hits: Vec<Hit>,
    t_s: Vec<f64>,
    x_m: Vec<f64>,
    points: Vec<f64>,
}

/// The set-up, the experiment and the number of a segment.
type SegmentKey = (String, String, u64);

/// Reads the impacts and x of an experiment.
///
/// # Errors
/// No run, no impacts or those of several experiments; a set-up without a model; no samples of x.
pub fn particle_run(path: &Path, choice: &ExperimentChoice) -> Result<ParticleRun, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let mut segments = impacts(&run).map_err(|e| failed(&e))?;
    let pairs: Vec<(String, String)> = segments.keys().map(|key| (key.0.clone(), key.1.clone())).collect();
    let (set_up, experiment) = pairs[choice.only(&run, &pairs, "experiment with impacts")?].clone();
    let record = run.manifest().set_ups.iter().find(|record| record.name == set_up);
    let model = record.filter(|record| !record.has_unmodelled_damper).and_then(|record| record.model());
    let Some(model) = model else {
        return Err(failed(&format!(
            "set-up {set_up:?} has no model of its particle: mass ratio and clearance are not known\n  describe the particle in the \
             campaign"
        )));
    };
    segments.retain(|key, _| (&key.0, &key.1) == (&set_up, &experiment));
    add_samples(&run, &mut segments)?;
    let records: Vec<Record> = segments.into_values().flat_map(FlightSegment::records).collect();
    if records.is_empty() {
        return Err(failed(&format!(
            "there are no samples of x of experiment {experiment:?} on {set_up:?}\n  record with rate_hz = 1000 and \"x\" in the \
             campaign's [telemetry]"
        )));
    }
    let taken_from = format!("{}, set-up {set_up:?}, experiment {experiment:?}", run.id());
    Ok(ParticleRun { taken_from, records, set_up: model, sensors: sensors::of_run(&run) })
}

/// The impacts of all segments.
fn impacts(run: &RunFolder) -> Result<BTreeMap<SegmentKey, FlightSegment>, Failure> {
    let mut segments: BTreeMap<SegmentKey, FlightSegment> = BTreeMap::new();
    for batch in run.impacts()? {
        let read = |column: &str| numbers(&batch, column);
        let (set_ups, experiments, places) = (texts(&batch, "set_up")?, texts(&batch, "experiment")?, read("segment")?);
        let (t_s, sides, contacts) = (read("t_s")?, read("side")?, read("contact_s")?);
        let (clipped, held) = (read("clipped")?, read("held")?);
        for n in 0..t_s.len() {
            let key = (set_ups[n].clone(), experiments[n].clone(), places[n] as u64);
            segments.entry(key).or_default().hits.push(Hit {
                t_s: t_s[n],
                side: sides[n].signum(),
                contact_s: contacts[n],
                clipped: clipped[n] != 0.0,
                held: held[n] != 0.0,
            });
        }
    }
    Ok(segments)
}

/// Adds the samples of x to the segments.
fn add_samples(run: &RunFolder, segments: &mut BTreeMap<SegmentKey, FlightSegment>) -> Result<(), Failure> {
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", run.path().display()));
    let tick_hz = run.manifest().device.as_ref().map_or(f64::from(TICK_HZ), |device| device.tick_hz);
    for batch in run.samples() {
        let batch = batch.map_err(|e| failed(&e))?;
        if batch.column_by_name("x_m").is_none() {
            return Err(failed(
                &"the samples have no column x_m\n  add \"x\" to `signals` in the campaign's [telemetry]",
            ));
        }
        let read = |column: &str| numbers(&batch, column).map_err(|e| failed(&e));
        let names = |column: &str| texts(&batch, column).map_err(|e| failed(&e));
        let (set_ups, experiments, places) = (names("set_up")?, names("experiment")?, read("segment")?);
        let (ticks, points, x_m) = (read("tick")?, read("point_index")?, read("x_m")?);
        for n in 0..ticks.len() {
            let key = (set_ups[n].clone(), experiments[n].clone(), places[n] as u64);
            let Some(segment) = segments.get_mut(&key) else { continue };
            segment.t_s.push((ticks[n] + MIDDLE) / tick_hz);
            segment.x_m.push(x_m[n]);
            segment.points.push(points[n]);
        }
    }
    Ok(())
}

impl FlightSegment {
    /// A record for each point: between two of them the structure may have been brought to rest.
    fn records(mut self) -> Vec<Record> {
        self.hits.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        let mut records = Vec::new();
        let mut from = 0;
        while from < self.t_s.len() {
            let length = self.points[from..].iter().take_while(|point| **point == self.points[from]).count();
            let times = &self.t_s[from..from + length];
            let within = |hit: &&Hit| (times[0]..=times[length - 1]).contains(&hit.t_s);
            let hits = self.hits.iter().filter(within).copied().collect();
            records.push(Record { t_s: times.to_vec(), x_m: self.x_m[from..from + length].to_vec(), hits });
            from += length;
        }
        records
    }
}
