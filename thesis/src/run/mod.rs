//! Computes the parts of items. A part that is complete is not computed again: `part.json` is written last, with the digest of all that
//! the part follows from. A study that was stopped goes on with its own parts.

mod campaign;
mod cases;
mod parts;
mod scheme;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use cases::OVERLAYS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::catalogue::{Catalogue, Item, Part, Work};
use super::marked::WITH_PUBLISHED;
use super::results::{BIFURCATION_TABLE, BRANCHES, BRANCHES_TABLE, METHOD_TABLE, RUN, Results, STUDY_TABLE};
use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::failure::Failure;
use damprig::run_folder::own_files;
use damprig::simulation::case::default_name;
use damprig::simulation::{Case, cost};
use damprig::study::Study;
use damprig::study::run as study_run;

/// File that marks a complete part.
const MARK: &str = "part.json";

/// Computing time of a continuation, s, about: what it takes is not known before.
const CONTINUATION_S: f64 = 10.0;

/// Time of a virtual rig over the computing time, about.
const VIRTUAL_RIG_PACE: f64 = 300.0;

/// What marks a complete part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Mark {
    /// Program and version.
    damprig: String,
    /// Of all that the part follows from.
    digest: String,
    /// Computing time, s, of the call that completed it.
    wall_s: f64,
    /// SHA-256 of each file of its folder.
    files: BTreeMap<String, String>,
}

/// A part to compute.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The item.
    pub item: &'a Item,
    /// Its part.
    pub part: &'a Part,
    /// Its folder.
    pub folder: PathBuf,
    /// Estimated computing time on all cores, s; 0 if it is complete.
    pub estimate_s: f64,
    /// Whether it is complete already.
    pub is_complete: bool,
    digest: String,
}

/// How the computation of a part ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It is complete.
    Complete,
    /// It was stopped.
    Stopped,
}

/// The parts of some items, which of them are complete, and what the others will take.
///
/// # Errors
/// A file of a part that is wrong; all items are checked before anything is computed.
pub fn plan<'a>(
    catalogue: &Catalogue,
    results: &Results,
    items: &[&'a Item],
    is_quick: bool,
) -> Result<Vec<Task<'a>>, Failure> {
    let parts: Vec<(&Item, &Part)> =
        items.iter().flat_map(|item| item.parts(is_quick).map(move |part| (*item, part))).collect();
    parts.into_par_iter().map(|(item, part)| task(catalogue, results, item, part)).collect()
}

fn task<'a>(catalogue: &Catalogue, results: &Results, item: &'a Item, part: &'a Part) -> Result<Task<'a>, Failure> {
    let folder = results.part(&item.name, &part.name);
    let read = Read::of(&catalogue.folder, part)?;
    let digest = read.digest(part);
    let is_valid = |mark: Mark| mark.digest == digest && is_as_written(&folder, &mark);
    let is_complete = mark_in(&folder).is_some_and(is_valid) && has_results(&folder, part);
    let estimate_s = if is_complete { 0.0 } else { read.estimate_s()? };
    Ok(Task { item, part, folder, estimate_s, is_complete, digest })
}

fn mark_in(folder: &Path) -> Option<Mark> {
    serde_json::from_slice(&std::fs::read(folder.join(MARK)).ok()?).ok()
}

/// SHA-256 of the files in a part's folder, other than the mark and what is drawn anew for every page.
fn digests(folder: &Path) -> std::io::Result<BTreeMap<String, String>> {
    let mut digests = BTreeMap::new();
    add_digests(folder, "", &mut digests)?;
    digests.retain(|name, _| name != MARK && name != WITH_PUBLISHED);
    Ok(digests)
}

fn add_digests(folder: &Path, before: &str, digests: &mut BTreeMap<String, String>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{before}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            add_digests(&entry.path(), &format!("{name}/"), digests)?;
        } else if entry.file_type()?.is_file() {
            digests.insert(name, hex(&Sha256::digest(std::fs::read(entry.path())?)));
        }
    }
    Ok(())
}

/// Whether the files that a part wrote are as they were.
fn is_as_written(folder: &Path, mark: &Mark) -> bool {
    digests(folder).is_ok_and(|there| mark.files.iter().all(|(name, digest)| there.get(name) == Some(digest)))
}

/// Removes the mark of a part, and the files that have changed since: a study goes on with the others.
fn remove_changed(folder: &Path) -> Result<(), Failure> {
    let Some(mark) = mark_in(folder) else { return Ok(()) };
    let there = digests(folder).map_err(|error| Failure::cannot("read", folder, error))?;
    let changed = there.iter().filter(|(name, digest)| mark.files.get(*name).is_some_and(|written| written != *digest));
    for name in changed.map(|(name, _)| name.as_str()).chain([MARK]) {
        let file = folder.join(name);
        std::fs::remove_file(&file).map_err(|error| Failure::cannot("remove", &file, error))?;
    }
    Ok(())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Whether the files that others read are there.
fn has_results(folder: &Path, part: &Part) -> bool {
    let is_there = |name: &str| folder.join(name).is_file();
    match &part.work {
        Work::Study(_) => is_there(STUDY_TABLE),
        Work::Cases(cases) => cases.iter().all(|case| is_there(&format!("{}.json", default_name(case)))),
        Work::Bifurcation(_) => is_there(BIFURCATION_TABLE),
        Work::Continuation(_) => is_there(BRANCHES) && is_there(BRANCHES_TABLE),
        Work::Campaign(_) => folder.join(RUN).is_dir(),
        Work::Method(_) => is_there(METHOD_TABLE),
    }
}

/// What a part's files hold.
enum Read {
    Study(Box<Study>),
    Cases(Vec<Case>),
    Bifurcation(Vec<Case>, u32),
    Continuation(Box<Continuation>),
    Campaign(Box<Campaign>),
    Method,
}

impl Read {
    fn of(folder: &Path, part: &Part) -> Result<Self, Failure> {
        Ok(match &part.work {
            Work::Study(file) => Self::Study(Box::new(Study::read(&folder.join(file))?)),
            Work::Cases(files) => {
                Self::Cases(files.iter().map(|file| Case::read(&folder.join(file))).collect::<Result<_, _>>()?)
            }
            Work::Bifurcation(sweep) => {
                let (cases, sweep) = parts::swept_cases(folder, sweep)?;
                Self::Bifurcation(cases, sweep.settle_cycles + sweep.cycles)
            }
            Work::Continuation(file) => Self::Continuation(Box::new(Continuation::read(&folder.join(file))?)),
            Work::Campaign(file) => Self::Campaign(Box::new(Campaign::read(&folder.join(file))?)),
            Work::Method(_) => Self::Method,
        })
    }

    /// SHA-256 of all that the part's results follow from.
    fn digest(&self, part: &Part) -> String {
        if let Self::Study(study) = self {
            return study.identity.clone();
        }
        let text = match self {
            Self::Study(_) | Self::Method => String::new(),
            Self::Cases(cases) | Self::Bifurcation(cases, _) => format!("{cases:?}"),
            Self::Continuation(continuation) => format!("{continuation:?}"),
            Self::Campaign(campaign) => format!("{}{:?}", campaign.source.text(), campaign.experiments),
        };
        let mut digest = Sha256::new();
        for part in [damprig::VERSION_LINE, &format!("{:?}", part.work), &text] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        hex(&digest.finalize())
    }

    /// Computing time on all cores, s, about.
    fn estimate_s(&self) -> Result<f64, Failure> {
        let cost_s = |case: &Case| cost::estimate(case).map(|cost| cost.seconds);
        let cores = rayon::current_num_threads() as f64;
        Ok(match self {
            Self::Study(study) => study_run::estimate_s(study)? / cores,
            Self::Cases(cases) => cases.iter().map(cost_s).sum::<Result<f64, _>>()?,
            Self::Bifurcation(cases, cycles) => match cases.get(cases.len() / 2) {
                Some(case) => {
                    let mut case = case.clone();
                    case.run.duration_s = f64::from(*cycles) * case.cycle_s();
                    // Both directions run side by side.
                    cost_s(&case)? * cases.len() as f64
                }
                None => 0.0,
            },
            Self::Continuation(_) => CONTINUATION_S,
            Self::Campaign(campaign) => campaign.longest_s() / VIRTUAL_RIG_PACE,
            Self::Method => 1.0,
        })
    }
}

/// Computes a part. `report` sees the share of it that is done, 0 to 1, and answers whether to go on.
///
/// # Errors
/// A file that is wrong, or that cannot be written.
pub fn run(catalogue: &Catalogue, task: &Task, report: &(dyn Fn(f64) -> bool + Sync)) -> Result<Ending, Failure> {
    let start = Instant::now();
    let Task { part, folder, .. } = task;
    let files = &catalogue.folder;
    std::fs::create_dir_all(folder).map_err(|error| Failure::cannot("create", folder, error))?;
    remove_changed(folder)?;
    let ending = match &part.work {
        Work::Study(file) => parts::study(&files.join(file), folder, report)?,
        Work::Cases(cases) => {
            let cases: Vec<PathBuf> = cases.iter().map(|case| files.join(case)).collect();
            cases::run(&cases, &part.title, folder, report)?
        }
        Work::Bifurcation(sweep) => parts::bifurcation(files, sweep, folder, report)?,
        Work::Continuation(file) => parts::continuation(&files.join(file), folder)?,
        Work::Campaign(file) => campaign::run(&files.join(file), folder, report)?,
        // `scheme` is the only one.
        Work::Method(_) => scheme::run(folder, report)?,
    };
    if ending == Ending::Complete {
        let mark = Mark {
            damprig: damprig::VERSION_LINE.into(),
            digest: task.digest.clone(),
            wall_s: start.elapsed().as_secs_f64(),
            files: digests(folder).map_err(|error| Failure::cannot("read", folder, error))?,
        };
        let text = serde_json::to_string_pretty(&mark)?;
        own_files::replace(&folder.join(MARK), text.as_bytes())?;
    }
    Ok(ending)
}

/// The public command that computes a part, started in the folder with the files.
#[must_use]
pub fn command(part: &Part, files: &Path) -> String {
    let shown = |file: &Path| files.join(file).display().to_string();
    match &part.work {
        Work::Study(file) => format!("damprig study run {}", shown(file)),
        Work::Cases(cases) => {
            let cases: Vec<String> = cases.iter().map(|case| shown(case)).collect();
            format!("damprig simulate {}", cases.join(" "))
        }
        Work::Bifurcation(sweep) => {
            let mut text = format!("damprig study bifurcation {} --axis {}", shown(&sweep.case), sweep.axis);
            let options = [
                (sweep.direction != "both").then(|| format!(" --direction {}", sweep.direction)),
                (sweep.settle_cycles != 200).then(|| format!(" --settle-cycles {}", sweep.settle_cycles)),
                (sweep.cycles != 60).then(|| format!(" --cycles {}", sweep.cycles)),
                sweep.section.map(|value| format!(" --section {value}")),
            ];
            text.extend(options.into_iter().flatten());
            text.extend(sweep.set.iter().map(|set| format!(" --set {set}")));
            // Two diagrams do not go into one folder.
            text + " --out bifurcation-" + &part.name
        }
        Work::Continuation(file) => format!("damprig continue {} --plot {}.svg", shown(file), default_name(file)),
        Work::Campaign(file) => format!("damprig run {}", shown(file)),
        Work::Method(_) => String::new(),
    }
}
