//! Simulates the cases of a part: for each its time history, its result and its figure; for several the displacements and the cycle
//! maxima over each other.

use std::path::{Path, PathBuf};

use super::Ending;
use damprig::failure::Failure;
use damprig::report::case_files::{CaseAsSimulated, SimulationJson};
use damprig::report::figures::case_overlay::{self, DrawnCase};
use damprig::report::figures::simulated_motion;
use damprig::run_folder::own_files;
use damprig::simulation::case::default_name;
use damprig::simulation::cycle_maxima::CycleMaxima;
use damprig::simulation::time_history::{TablePath, TimeHistory};
use damprig::simulation::{Case, RunOptions, cost, simulate};

/// Names of the figures with all cases.
pub const OVERLAYS: [&str; 2] = ["histories", "cycle-maxima"];

/// Simulates the cases into the part's folder.
pub(super) fn run(
    files: &[PathBuf],
    title: &str,
    folder: &Path,
    report: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Ending, Failure> {
    let mut drawn = Vec::new();
    for (place, file) in files.iter().enumerate() {
        let case = Case::read(file)?;
        let within = |share: f64| report((place as f64 + share) / files.len() as f64);
        match simulate_into(&case, &default_name(file), folder, &within)? {
            Some(case) => drawn.push(case),
            None => return Ok(Ending::Stopped),
        }
    }
    let [histories, maxima] = OVERLAYS;
    case_overlay::histories(&drawn, title).write(folder, histories)?;
    case_overlay::cycle_maxima(&drawn, title).write(folder, maxima)?;
    Ok(Ending::Complete)
}

/// Simulates one case; `None` if it was stopped.
fn simulate_into(
    case: &Case,
    stem: &str,
    folder: &Path,
    report: &dyn Fn(f64) -> bool,
) -> Result<Option<DrawnCase>, Failure> {
    let path: TablePath =
        folder.join(format!("{stem}.parquet")).display().to_string().parse().map_err(Failure::Failed)?;
    let rate_hz = case.usual_rate_hz();
    let history = TimeHistory::create(&path, rate_hz, case)?;
    let envelope = simulated_motion::envelope(case, 0.0, case.run.duration_s, case_overlay::COLUMNS);
    let whole = simulated_motion::usual_envelopes(case);
    let mut viewer = ((history, CycleMaxima::new(case.cycle_s())), (envelope, whole));
    let longest_part_s = cost::longest_part_s(case, Some(rate_hz))?;
    let mut go_on = |t_s: f64| report(t_s / case.run.duration_s);
    let options = RunOptions { keep: true, longest_part_s, go_on: &mut go_on };
    let result = simulate(case, &mut viewer, options)?;
    if result.stopped_at_s.is_some() {
        return Ok(None);
    }
    let ((history, maxima), (envelope, (whole, last))) = viewer;
    history.finish()?;
    let picture = simulated_motion::of_case(case, whole.as_ref(), last.as_ref())?;
    picture.write(folder, &format!("case-{stem}"))?;
    let cycle_max_m = maxima.whole_m().to_vec();
    let answer = SimulationJson {
        case: CaseAsSimulated::of(case, ""),
        result: &result,
        analysis: None,
        cycle_max_m: Some(&cycle_max_m),
    };
    let json = serde_json::to_string(&answer)?;
    own_files::replace(&folder.join(format!("{stem}.json")), json.as_bytes())?;
    Ok(Some(DrawnCase { name: case.name.clone(), envelope, cycle_max_m }))
}
