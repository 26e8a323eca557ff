//! Takes records to identify from a run folder.

use std::path::Path;

use damprig_core::io::TICK_HZ;

use super::response::{DrivenBy, MIN, Point, Response};
use super::{Sensors, sensors};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::schema::results::steadiness_of;
use crate::table::values::{numbers, texts};

/// The record of a free vibration of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedFreeVibration {
    /// Run, set-up and experiment, in words.
    pub taken_from: String,
    /// Times from the release, s.
    pub t_s: Vec<f64>,
    /// Displacement of the structure, m.
    pub x_m: Vec<f64>,
    /// Mass of the structure as the campaign states it, kg; none in older runs.
    pub mass_kg: Option<f64>,
    /// The displacement sensors.
    pub sensors: Sensors,
}

/// Which experiment of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExperimentChoice {
    /// Name of the set-up.
    pub set_up: Option<String>,
    /// Name of the experiment.
    pub experiment: Option<String>,
}

impl ExperimentChoice {
    /// The one pair of set-up and experiment that fits. `what` names the kind of experiment in messages.
    pub(super) fn only(&self, run: &RunFolder, pairs: &[(String, String)], what: &str) -> Result<usize, Failure> {
        let is_wanted = |wanted: &Option<String>, name: &String| wanted.as_ref().is_none_or(|wanted| wanted == name);
        let fitting: Vec<usize> = (0..pairs.len())
            .filter(|n| is_wanted(&self.set_up, &pairs[*n].0) && is_wanted(&self.experiment, &pairs[*n].1))
            .collect();
        let list = || {
            let mut all: Vec<String> =
                pairs.iter().map(|(s, e)| format!("--set-up {s:?} --experiment {e:?}")).collect();
            all.dedup();
            all.join("\n  ")
        };
        match fitting[..] {
            // A later start of the same experiment supersedes the earlier one.
            [.., last] if fitting.iter().all(|n| pairs[*n] == pairs[last]) => Ok(last),
            [] if pairs.is_empty() => Err(Failure::Input(format!(
                "{}: the run has no {what}\n  add an experiment of this kind to the campaign",
                run.path().display()
            ))),
            [] => Err(Failure::Input(format!(
                "{}: no {what} of the run has these names; it has\n  {}",
                run.path().display(),
                list()
            ))),
            _ => Err(Failure::Input(format!(
                "{}: the run has several experiments of this kind ({what}); choose one\n  {}",
                run.path().display(),
                list()
            ))),
        }
    }
}

/// The samples of a signal in these ticks of an experiment: times from the first tick, s, and values.
pub(super) fn signal(
    run: &RunFolder,
    (set_up, experiment, segment): (&str, &str, f64),
    ticks: std::ops::Range<f64>,
    name: &str,
) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", run.path().display()));
    let (mut times, mut values) = (Vec::new(), Vec::new());
    let tick_hz = run.manifest().device.as_ref().map_or(f64::from(damprig_core::io::TICK_HZ), |d| d.tick_hz);
    for batch in run.samples() {
        let batch = batch.map_err(|e| failed(&e))?;
        if batch.column_by_name(name).is_none() {
            let help = format!("add {:?} to `signals` in the campaign's [telemetry]", name.trim_end_matches("_m"));
            return Err(failed(&format!("the samples have no column {name}\n  {help}")));
        }
        let read = |column: &str| numbers(&batch, column).map_err(|e| failed(&e));
        let names = |column: &str| texts(&batch, column).map_err(|e| failed(&e));
        let (set_ups, experiments) = (names("set_up")?, names("experiment")?);
        let (segments, at, signal) = (read("segment")?, read("tick")?, read(name)?);
        for n in 0..at.len() {
            let is_own = set_ups[n] == set_up && experiments[n] == experiment && segments[n] == segment;
            if is_own && ticks.contains(&at[n]) {
                times.push((at[n] - ticks.start) / tick_hz);
                values.push(signal[n]);
            }
        }
    }
    Ok((times, values))
}

/// Reads the free vibration of a run.
///
/// # Errors
/// No run, no free vibration or several of them; a damper that is not friction; missing samples.
pub fn free_vibration(path: &Path, choice: &ExperimentChoice) -> Result<RecordedFreeVibration, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let mut found: Vec<((String, String), [f64; 3])> = Vec::new();
    for batch in run.transients().map_err(|e| failed(&e))? {
        let names = |column: &str| texts(&batch, column).map_err(|e| failed(&e));
        let read = |column: &str| numbers(&batch, column).map_err(|e| failed(&e));
        let (set_ups, experiments, kinds) = (names("set_up")?, names("experiment")?, names("kind")?);
        let (segments, starts, ends) = (read("segment")?, read("start_tick")?, read("end_tick")?);
        for n in 0..kinds.len() {
            if kinds[n] == "free_vibration" {
                found.push(((set_ups[n].clone(), experiments[n].clone()), [segments[n], starts[n], ends[n]]));
            }
        }
    }
    let pairs: Vec<(String, String)> = found.iter().map(|f| f.0.clone()).collect();
    let chosen = choice.only(&run, &pairs, "free vibration")?;
    let ((set_up, experiment), [segment, start, end]) = &found[chosen];
    let record = run.manifest().set_ups.iter().find(|s| s.name == *set_up);
    if let Some(damper) = record.and_then(|record| record.damper_besides_friction()) {
        return Err(Failure::Input(format!(
            "{}: set-up {set_up:?} has {damper}: its free vibration is not that of the structure\n  measure one of the bare \
             structure, or with the friction damper alone",
            path.display()
        )));
    }
    let (t_s, x_m) = signal(&run, (set_up, experiment, *segment), *start..*end, "x_m")?;
    check_gaps(&t_s, "the release").map_err(|text| failed(&text))?;
    Ok(RecordedFreeVibration {
        taken_from: format!("{}, set-up {set_up:?}, experiment {experiment:?}", run.id()),
        t_s,
        x_m,
        mass_kg: record.and_then(|record| record.model()).map(|model| model.structure.mass_kg),
        sensors: sensors::of_run(&run),
    })
}

/// Reads the settled points of a stepped sine on the bare structure. X/Z (cycle maxima) is corrected by its deviation from its limit,
/// where the run has it. Under a force z is P/k with the stiffness k of the campaign, so X/P = (X/Z)/k does not depend on that k.
///
/// # Errors
/// No run, no stepped sine or several of them; a set-up with a damper; too few settled points.
pub fn stepped_sine(path: &Path, choice: &ExperimentChoice) -> Result<Response, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let sensors = sensors::of_run(&run);
    let campaign = campaign_copy::campaign(run.path()).ok();
    let tracked = |name: &str| {
        let own = campaign.iter().flat_map(|campaign| &campaign.experiments).find(|experiment| experiment.name == name);
        own.and_then(|experiment| Some(experiment.tracking()?.1))
    };
    let mut found: Vec<((String, String), Point, bool)> = Vec::new();
    for batch in run.results().map_err(|e| failed(&e))? {
        let names = |column: &str| texts(&batch, column).map_err(|e| failed(&e));
        let read = |column: &str| numbers(&batch, column).map_err(|e| failed(&e));
        let (set_ups, experiments, steady) = (names("set_up")?, names("experiment")?, read("steady")?);
        // Older runs have only the column `steady`.
        let verdicts = names("steadiness").unwrap_or_default();
        let is_settled = |n: usize| verdicts.get(n).map_or(steady[n] != 0.0, |text| steadiness_of(text).is_settled());
        let deviations = read("deviation").ok().zip(read("deviation_uncertainty").ok());
        let (f, x_over_z, x_m) = (read("frequency_hz")?, read("x_over_z")?, read("mean_cycle_max_m")?);
        let amplitudes =
            ["x_amplitude_m", "z_amplitude_m", "phase_rad", "x_noise_rms_m", "cycles"].map(|name| read(name).ok());
        for n in 0..f.len() {
            let deviation = deviations.as_ref().map(|(deviation, interval)| (deviation[n], 0.5 * interval[n]));
            let ratio = x_over_z[n] / (1.0 + deviation.map_or(0.0, |(deviation, _)| deviation));
            let uncertainty = deviation.map(|(_, uncertainty)| uncertainty);
            // The deviation is that of the amplitude: the phase of a motion that still settles is not known as well.
            let mut point = Point { frequency_hz: f[n], ratio, phase_rad: None, uncertainty, x_m: x_m[n] };
            let mut is_usable = is_settled(n);
            if let [Some(x), Some(z), Some(phase), Some(noise), Some(cycles)] = &amplitudes
                && let Some(tracked) = tracked(&experiments[n])
            {
                is_usable &= tracked.is_locked(phase[n]);
                // A loop keeps its phase. Where the base is small, noise and steps of z count most.
                let ticks = cycles[n] * f64::from(TICK_HZ) / f[n];
                let of_base = 0.5 * sensors.amplitude_error_95_m(z[n], noise[n], ticks) / z[n];
                let uncertainty = uncertainty.map(|uncertainty| uncertainty.hypot(of_base));
                let ratio = x[n] / z[n] / (1.0 + deviation.map_or(0.0, |(deviation, _)| deviation));
                point = Point { ratio, phase_rad: Some(phase[n]), uncertainty, x_m: x[n], ..point };
            }
            found.push(((set_ups[n].clone(), experiments[n].clone()), point, is_usable));
        }
    }
    let pairs: Vec<(String, String)> = found.iter().map(|f| f.0.clone()).collect();
    let (set_up, experiment) = pairs[choice.only(&run, &pairs, "stepped sine")?].clone();
    let record = run.manifest().set_ups.iter().find(|s| s.name == set_up);
    if let Some(damper) = record.and_then(|record| record.damper()) {
        return Err(failed(&format!(
            "set-up {set_up:?} has {damper}: its response is not that of the structure\n  measure one of the bare structure"
        )));
    }
    let forced = record.and_then(|record| record.model()).filter(|model| model.is_force_driven);
    let (driven_by, stiffness_n_per_m) =
        forced.map_or((DrivenBy::Base, 1.0), |model| (DrivenBy::Force, model.structure.stiffness_n_per_m));
    let own = || found.iter().filter(|f| f.0 == (set_up.clone(), experiment.clone()));
    let usable = own().filter(|f| f.2 && f.1.ratio.is_finite());
    let points: Vec<Point> = usable.map(|f| Point { ratio: f.1.ratio / stiffness_n_per_m, ..f.1 }).collect();
    let (all, settled) = (own().count(), points.len());
    if settled < MIN {
        let more = if settled < all { "settle longer" } else { "measure more points" };
        return Err(failed(&format!(
            "{settled} of {all} points of {set_up:?} are steady or stationary; at least {MIN} are needed\n  {more}, or \
             measure a free vibration for `damprig identify decay`"
        )));
    }
    let remarks = match all - settled {
        0 => vec![],
        _ => vec![format!("{settled} of {all} points are steady or stationary, and used")],
    };
    let taken_from = format!("{}, set-up {set_up:?}, experiment {experiment:?}", run.id());
    Ok(Response { taken_from, driven_by, points, sensors, remarks })
}

/// Refuses a record with lost rows: their share of the swings is unknown.
pub(super) fn check_gaps(t_s: &[f64], since: &str) -> Result<(), String> {
    let mut steps: Vec<f64> = t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let all = steps.clone();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    match all.iter().position(|step| *step > 1.5 * usual) {
        Some(n) => Err(format!(
            "samples are missing: {:.4} s after {since} there is a gap of {:.4} s\n  run the experiment again; \
             `damprig runs verify` shows what was lost",
            t_s[n], all[n]
        )),
        None => Ok(()),
    }
}
