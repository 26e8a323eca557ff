//! Computes studies, bifurcation diagrams and continuations with the functions of their commands.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Ending;
use crate::catalogue::Bifurcation;
use crate::results::{BRANCHES, BRANCHES_TABLE};
use damprig::continuation::Continuation;
use damprig::failure::Failure;
use damprig::input::Source;
use damprig::report::figures::branches;
use damprig::report::{bifurcation_files, branch_table, documents, study_files};
use damprig::run_folder::own_files;
use damprig::simulation::case::default_name;
use damprig::simulation::{Case, SetValues};
use damprig::storage::out_file::OutFile;
use damprig::study::Study;
use damprig::study::bifurcation::{self, Direction, Sweep};
use damprig::study::data_set::{DataSet, MANIFEST};
use damprig::study::run::{self as study_run, StudyProgress};
use damprig::study::store::Store;

type Report<'a> = &'a (dyn Fn(f64) -> bool + Sync);

/// Runs a study into its folder; goes on where an earlier call stopped.
pub(super) fn study(file: &Path, folder: &Path, report: Report<'_>) -> Result<Ending, Failure> {
    let study = Study::read(file)?;
    let store = Store::at(folder)?;
    let data_set = match DataSet::open(&study, store.clone()) {
        Ok(data_set) => data_set,
        // Results of this folder by another version, or of a file as it was before.
        Err(Failure::Input(_)) if folder.join(MANIFEST).is_file() => {
            remove(folder)?;
            DataSet::open(&study, store)?
        }
        Err(error) => return Err(error),
    };
    let rows = study.rows().max(1) as f64;
    let within = |progress: &StudyProgress| report(progress.done as f64 / rows);
    let (ending, last) = study_run::run(&study, &data_set, &within)?;
    if ending == study_run::StudyEnding::Stopped {
        return Ok(Ending::Stopped);
    }
    data_set.join(&study, |_, _| ())?;
    let scope = documents::study::scope(&study, study_run::cycles(&study));
    let drawn = study_files::write(&study, &data_set, last.best, &scope);
    match drawn? {
        Some(drawn) if !drawn.undrawn.is_empty() => {
            let (stem, error) = &drawn.undrawn[0];
            Err(Failure::Failed(format!("{}: {stem}: {error}", folder.display())))
        }
        _ => Ok(Ending::Complete),
    }
}

/// Removes the results of a part that are out of date.
pub(super) fn remove(folder: &Path) -> Result<(), Failure> {
    std::fs::remove_dir_all(folder)
        .and_then(|()| std::fs::create_dir_all(folder))
        .map_err(|error| Failure::cannot("replace the results in", folder, error))
}

/// The cases of a bifurcation diagram, one for each value.
pub(super) fn swept_cases(files: &Path, wanted: &Bifurcation) -> Result<(Vec<Case>, Sweep), Failure> {
    let file = files.join(&wanted.case);
    let sweep = Sweep {
        key: wanted.swept.key.clone(),
        values: wanted.swept.values.clone(),
        settle_cycles: wanted.settle_cycles,
        cycles: wanted.cycles,
    };
    let source = Source::read(&file)?;
    let set = SetValues::from_arguments(&wanted.set)?;
    Ok((bifurcation::cases(source.name(), source.text(), &default_name(&file), &sweep, &set)?, sweep))
}

/// Draws a bifurcation diagram.
pub(super) fn bifurcation(
    files: &Path,
    wanted: &Bifurcation,
    folder: &Path,
    report: Report<'_>,
) -> Result<Ending, Failure> {
    let (cases, sweep) = swept_cases(files, wanted)?;
    let directions: &[Direction] = match wanted.direction {
        "up" => &[Direction::Up],
        "down" => &[Direction::Down],
        _ => &[Direction::Up, Direction::Down],
    };
    let steps = (cases.len() * directions.len()).max(1) as f64;
    let is_stopped = AtomicBool::new(false);
    let go_on = |done: u64| {
        let goes_on = report(done as f64 / steps);
        if !goes_on {
            is_stopped.store(true, Ordering::Relaxed);
        }
        goes_on
    };
    let samples = bifurcation::run_all(&cases, &sweep, directions, &go_on)?;
    if is_stopped.into_inner() {
        return Ok(Ending::Stopped);
    }
    bifurcation_files::write(folder, &cases[0], &samples, &sweep, wanted.section)?;
    Ok(Ending::Complete)
}

/// Follows periodic orbits.
pub(super) fn continuation(file: &Path, folder: &Path) -> Result<Ending, Failure> {
    let found = Continuation::read(file)?.follow(&|_| true)?;
    let out = OutFile { path: folder.join(BRANCHES_TABLE), force: true };
    branch_table::write(&branch_table::orbits(&found)?, &out)?;
    branches::draw(&found).and_then(|picture| picture.write(folder, "branches"))?;
    let json = serde_json::to_string(&found)?;
    own_files::replace(&folder.join(BRANCHES), json.as_bytes())?;
    Ok(Ending::Complete)
}
