//! The campaign of a run folder, with the copies of the files that it names.
//!
//! The journal has the number of the `[[experiment]]` of each copy. Runs before that numbered their copies by the experiment's place
//! among all, its earlier repeats included; where that leaves two choices, the folder is refused.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use toml::Table;

use super::folder::is_run;
use crate::campaign::transient::{NOISE_FILE, RECORDS, kept_record};
use crate::campaign::{Campaign, default_name, repeat_names};
use crate::failure::Failure;
use crate::input::{Copies, Source, regular};
use crate::run_folder::journal::{self, Begin, CopiedFile, JOURNAL, JournalLines};
use crate::run_folder::schema::journal_state::JournalState;
use crate::setup::set_up_file;

/// More repeats than an experiment can have.
const MAX_REPEATS: usize = 1000;

/// The campaign's name in a run folder.
const CAMPAIGN: &str = "campaign.toml";

/// The campaign as run.
///
/// # Errors
/// A campaign that cannot be read; a copy that is missing, has changed, or is one of two.
pub fn campaign(folder: &Path) -> Result<Campaign, Failure> {
    source(folder).and_then(Campaign::parse).map_err(Failure::storage)
}

/// The campaign as run, to be parsed.
///
/// # Errors
/// As [`campaign`].
pub fn source(folder: &Path) -> Result<Source, Failure> {
    with_copies(folder).map(Source::recorded)
}

/// Reads a campaign from a file, which may be in a run folder: then it is checked as a new one, and its files are the copies.
///
/// # Errors
/// As [`Campaign::read`] and [`campaign`].
pub fn new_campaign(file: &Path) -> Result<Campaign, Failure> {
    let folder = file.parent().filter(|folder| file.ends_with(CAMPAIGN) && is_run_with_journal(folder));
    let source = match folder {
        Some(folder) => with_copies(folder).map_err(Failure::input)?,
        None => Source::read(file)?,
    };
    Campaign::parse(source)
}

fn is_run_with_journal(folder: &Path) -> bool {
    is_run(folder) && journal::is_in(folder)
}

fn with_copies(folder: &Path) -> Result<Source, Failure> {
    let source = Source::read(&folder.join(CAMPAIGN))?;
    // A campaign that is not TOML is refused by its parser.
    let Ok(table) = source.text().parse::<Table>() else { return Ok(source) };
    let lines = match journal::read(folder) {
        Ok(lines) => lines,
        Err(_) if !journal::is_in(folder) => JournalLines::default(),
        Err(error) => return Err(error),
    };
    let copies = copies(folder, &table, &lines)?;
    Ok(source.with_copies(copies))
}

/// An `[[experiment]]` that plays a file or noise.
struct PlayedExperiment {
    /// From 1.
    number: usize,
    /// Its place among all experiments, with the repeats of earlier ones, from 1.
    place: usize,
    /// Names of its repeats.
    names: Vec<String>,
    file: PathBuf,
}

fn played(campaign: &Table) -> Vec<PlayedExperiment> {
    let mut place = 1;
    let mut all = Vec::new();
    let experiments = campaign.get("experiment").and_then(|list| list.as_array()).into_iter().flatten();
    for (number, experiment) in (1..).zip(experiments) {
        let repeats = experiment.get("repeats").and_then(toml::Value::as_integer).unwrap_or(1);
        // More are refused by the campaign's parser.
        let repeats = usize::try_from(repeats).unwrap_or(1).clamp(1, MAX_REPEATS);
        let file = match experiment.get("file").and_then(|file| file.as_str()) {
            Some(file) => Some(PathBuf::from(file)),
            None => experiment.get("noise").map(|_| PathBuf::from(NOISE_FILE)),
        };
        let name = experiment.get("name").and_then(|name| name.as_str());
        let names = repeat_names(&name.map_or_else(|| default_name(number), str::to_string), repeats);
        all.extend(file.map(|file| PlayedExperiment { number, place, names, file }));
        place += repeats;
    }
    all
}

fn copies(folder: &Path, campaign: &Table, lines: &JournalLines) -> Result<Copies, Failure> {
    let state = JournalState::of(&lines.entries);
    let listed = state.begun.first().map_or(&[][..], |begin| &begin.records);
    let all = played(campaign);
    let found: Result<_, Failure> = if listed.iter().any(|copy| copy.experiment.is_some()) {
        all.iter().map(|played| Ok((played.number, numbered(folder, listed, played)?))).collect()
    } else if state.begun.is_empty() {
        by_names(folder, &all)
    } else {
        all.iter().map(|played| Ok((played.number, unnumbered(folder, &state, played)?))).collect()
    };
    let changed = listed.iter().find_map(|copy| copy.file.difference(folder));
    if let Some(changed) = changed {
        let shown = folder.display();
        return Err(Failure::Storage(format!(
            "{shown}: a file that the campaign names is not the one of the run: {changed}"
        )));
    }
    let set_up_file = campaign.get("set_up_file").and_then(|file| file.as_str());
    let set_up_file = set_up_file.map(|file| set_up_file::kept(&folder.join(RECORDS), file));
    found.map(|records| Copies { records, set_up_file })
}

/// The copy that the journal lists for an experiment.
fn numbered(folder: &Path, listed: &[CopiedFile], played: &PlayedExperiment) -> Result<PathBuf, Failure> {
    let own = listed.iter().find(|copy| copy.experiment == Some(played.number));
    own.map(|copy| folder.join(&copy.file.name)).ok_or_else(|| {
        let (shown, number, file) = (folder.display(), played.number, played.file.display());
        Failure::Storage(format!("{shown}/{JOURNAL} lists no copy of {file}, which experiment {number} plays"))
    })
}

/// The copy of an experiment in a run whose journal does not number them.
fn unnumbered(folder: &Path, state: &JournalState, played: &PlayedExperiment) -> Result<PathBuf, Failure> {
    let by_place = kept_record(folder, played.place, &played.file);
    let by_number = kept_record(folder, played.number, &played.file);
    let differ = || regular::read(&by_place).ok() != regular::read(&by_number).ok();
    // A version that numbered them by place looked for them by number when it resumed a run.
    let is_resumed = state.begun.iter().skip(1).any(is_unnumbered);
    if !(is_resumed && by_number.is_file() && differ() && is_measured(state, played)) {
        return Ok(by_place);
    }
    let name = |path: &Path| path.strip_prefix(folder).unwrap_or(path).display().to_string();
    Err(Failure::Storage(format!(
        "{}: experiment {} plays {}, and its copy may be {} or {}: an earlier version resumed the run and may have played either\n  the data can be read (`damprig runs verify`, `runs export`), but not compared or continued; measure the experiment again in a new run",
        folder.display(),
        played.number,
        played.file.display(),
        name(&by_place),
        name(&by_number)
    )))
}

/// The copies of a run without the beginning of its journal: it was killed before that was written. The names of all copies together
/// tell how they are numbered.
fn by_names(folder: &Path, all: &[PlayedExperiment]) -> Result<BTreeMap<usize, PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder.join(RECORDS)).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_record = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(|c: char| c.is_ascii_digit()) && !name.ends_with(".tmp")
    };
    let there: BTreeSet<PathBuf> = entries.filter(is_record).collect();
    let by_number = |played: &PlayedExperiment| vec![kept_record(folder, played.number, &played.file)];
    let by_place = |played: &PlayedExperiment| {
        let places = played.place..played.place + played.names.len();
        places.map(|place| kept_record(folder, place, &played.file)).collect::<Vec<_>>()
    };
    type CopyPaths<'a> = &'a dyn Fn(&PlayedExperiment) -> Vec<PathBuf>;
    let ways: [CopyPaths<'_>; 2] = [&by_number, &by_place];
    let way = ways.into_iter().find(|way| all.iter().flat_map(way).collect::<BTreeSet<_>>() == there);
    let first = |way: CopyPaths<'_>, played: &PlayedExperiment| Some((played.number, way(played).into_iter().next()?));
    way.map(|way| all.iter().filter_map(|played| first(way, played)).collect()).ok_or_else(|| {
        let folder = folder.display();
        Failure::Storage(format!(
            "{folder}/{RECORDS} does not have the copies of the records that the campaign plays and no others, and {JOURNAL}, which lists them, has no beginning"
        ))
    })
}

fn is_unnumbered(begin: &Begin) -> bool {
    begin.records.iter().all(|copy| copy.experiment.is_none())
}

/// Whether a repeat of the experiment has a result on any set-up.
fn is_measured(state: &JournalState, played: &PlayedExperiment) -> bool {
    state.transients().iter().any(|row| played.names.contains(&row.experiment))
}
