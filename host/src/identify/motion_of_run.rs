//! Takes what shows a frequency response from a run folder: the points of a stepped sine, or x and z of a playback.

use std::path::Path;

use super::from_run::{ExperimentChoice, check_gaps, signal, stepped_sine};
use super::response::Response;
use super::time_response::Motion;
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::table::values::{numbers, texts};

/// What an experiment of a run has for a frequency response.
#[derive(Clone, Debug)]
pub enum OfRun {
    /// The points of a stepped sine.
    Points(Response),
    /// x and z of a playback or a pulse.
    Motion(Motion),
}

/// A record or a pulse of a run.
struct PlayedMotion {
    names: (String, String),
    segment: f64,
    ticks: std::ops::Range<f64>,
}

/// Reads the experiment of a run that shows the frequency response: the only one, or the chosen one.
///
/// # Errors
/// No run, none or several such experiments; a set-up with a damper; missing samples.
pub fn response_of_run(path: &Path, choice: &ExperimentChoice) -> Result<OfRun, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let played = played(&run).map_err(|e| failed(&e))?;
    let mut pairs: Vec<(String, String)> = played.iter().map(|played| played.names.clone()).collect();
    for batch in run.results().map_err(|e| failed(&e))? {
        let names = |column: &str| texts(&batch, column).map_err(|e| failed(&e));
        pairs.extend(names("set_up")?.into_iter().zip(names("experiment")?));
    }
    let chosen = choice.only(&run, &pairs, "stepped sine or playback")?;
    let Some(played) = played.get(chosen) else {
        let (set_up, experiment) = pairs[chosen].clone();
        let choice = ExperimentChoice { set_up: Some(set_up), experiment: Some(experiment) };
        return stepped_sine(path, &choice).map(OfRun::Points);
    };
    let (set_up, experiment) = &played.names;
    let record = run.manifest().set_ups.iter().find(|record| record.name == *set_up);
    if let Some(damper) = record.and_then(|record| record.damper()) {
        return Err(failed(&format!(
            "set-up {set_up:?} has {damper}: its response is not that of the structure\n  measure one of the bare structure"
        )));
    }
    let read = |name: &str| signal(&run, (set_up, experiment, played.segment), played.ticks.clone(), name);
    let (t_s, x_m) = read("x_m")?;
    let (_, z_m) = read("z_m")?;
    check_gaps(&t_s, "the start").map_err(|text| failed(&text))?;
    let step_s = match t_s[..] {
        [first, .., last] => (last - first) / (t_s.len() - 1) as f64,
        _ => return Err(failed(&format!("there are no samples of experiment {experiment:?} on {set_up:?}"))),
    };
    let taken_from = format!("{}, set-up {set_up:?}, experiment {experiment:?}", run.id());
    Ok(OfRun::Motion(Motion { taken_from, step_s, x_m, z_m }))
}

/// The records and pulses of a run.
fn played(run: &RunFolder) -> Result<Vec<PlayedMotion>, Failure> {
    let mut all = Vec::new();
    for batch in run.transients()? {
        let (set_ups, experiments) = (texts(&batch, "set_up")?, texts(&batch, "experiment")?);
        let kinds = texts(&batch, "kind")?;
        let read = |column: &str| numbers(&batch, column);
        let (segments, starts, ends) = (read("segment")?, read("start_tick")?, read("end_tick")?);
        for n in 0..kinds.len() {
            if kinds[n] != "free_vibration" {
                all.push(PlayedMotion {
                    names: (set_ups[n].clone(), experiments[n].clone()),
                    segment: segments[n],
                    ticks: starts[n]..ends[n],
                });
            }
        }
    }
    Ok(all)
}
