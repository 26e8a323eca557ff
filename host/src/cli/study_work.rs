//! `damprig study work`, `status`, `verify` and `merge`: a study computed by several workers.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use jiff::Timestamp;
use jiff::tz::TimeZone;

use super::arguments::{JsonArg, QuietArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::progress::StudyBar;
use super::study::{kept, place};
use super::study_figures::{say_result, without_digest};
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::report::documents;
use crate::report::numbers::duration;
use crate::study::Study;
use crate::study::data_set::{DataSet, ranges};
use crate::study::inspect::{self, StudyParts};
use crate::study::run::{self, StudyEnding, StudyProgress};
use crate::study::store::Store;
use crate::study::sums::SUMS;
use crate::study::work::{self, Done, Shard};

/// Computes a share of a study as one of several workers, and joins nothing.
#[derive(Debug, Args)]
#[command(after_help = WORK_HELP)]
pub(super) struct WorkArgs {
    #[command(flatten)]
    place: PlaceArgs,

    #[command(flatten)]
    quiet: QuietArg,

    /// Compute the i-th of n shares of the parts and stop; i counts from 1
    #[arg(long, value_name = "I/N")]
    shard: Shard,
}

/// A study and the place of its results.
#[derive(Debug, Args)]
pub(super) struct PlaceArgs {
    /// Study file (TOML), or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "STUDY")]
    study: PathBuf,

    /// Folder of the results [default: studies/ and the name of the file]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// Joins the parts of a study to its table.
#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    #[command(flatten)]
    place: PlaceArgs,

    #[command(flatten)]
    json: JsonArg,
}

const WORK_HELP: &str = "\
Examples:
  damprig study work my-study.toml --out /data/my-study --shard 3/8    the third of eight shares
  damprig study status my-study.toml --out /data/my-study
  damprig study merge my-study.toml --out /data/my-study               when all parts are there

All workers of a study have the same --out. A share leaves out the parts that are there, so the
same command goes on after a kill. RAYON_NUM_THREADS sets the number of threads of a worker.
host/studies/cluster has a script for SLURM.

Exit codes:
  0    success: the share is computed
  1    a file could not be read or written
  2    the command line, the study or its case is wrong
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the parts so far are kept";

pub(super) fn work(args: &WorkArgs) -> Outcome {
    args.quiet.apply();
    let study = Study::read(&examples::find(FileKind::Study, &args.place.study)?)?;
    let store = store(&args.place)?;
    let data_set = DataSet::open(&study, store)?;
    let ctrl_c = CtrlC::watch()?;
    let (parts, threads) = (data_set.manifest().parts(), rayon::current_num_threads());
    say!("{}; parts: {parts}, threads: {threads}", documents::study::scope(&study, run::cycles(&study)));
    let seen = |Done { part, rows, took_s }: Done| {
        let (now, last, took) = (clock(), rows.end - 1, duration(took_s));
        say!("{now}  part {part} of {parts}: rows {} to {last}, {took}", rows.start);
    };
    let ending = work::shard(&study, &data_set, args.shard, seen, &|| !ctrl_c.is_pressed());
    if ending.map_err(|error| kept(&data_set, error))? == StudyEnding::Stopped {
        return Err(Failure::Interrupted(
            "stopped; the parts so far are kept, and the same command goes on with them".into(),
        ));
    }
    let missing = data_set.missing()?;
    if missing.is_empty() {
        say!("all parts are there: `damprig study merge` joins them");
    } else {
        say!("the share is done; missing parts of other shares: {}", missing.len());
    }
    Ok(())
}

pub(super) fn status(args: &PlaceArgs) -> Outcome {
    let (study, data_set) = existing(args)?;
    let status = inspect::status(&study, &data_set)?;
    let (parts, all) = (&status.parts, data_set.manifest().parts());
    say!("{}", documents::study::scope(&study, run::cycles(&study)));
    say_parts(parts);
    say!("{} of {all} parts done, {} missing", parts.good, parts.missing.len());
    if parts.good == all {
        say!("`damprig study merge` joins them");
    } else if let Some((left_s, latest)) = status.left_s {
        say!("about {} left at the pace of the latest {latest} parts", duration(left_s));
    } else {
        let cores = rayon::current_num_threads();
        let whole_s = run::estimate_s(&study)? / cores as f64;
        let left = duration(whole_s * parts.missing.len() as f64 / all as f64);
        say!("about {left} left on {cores} cores of this machine");
    }
    verdict(&data_set, parts.wrong.len())
}

/// Prints what is wrong with the parts.
fn say_parts(parts: &StudyParts) {
    for wrong in &parts.wrong {
        say!("FAILED  {wrong}");
    }
    if parts.without_digest > 0 {
        say!("{}", without_digest(parts.without_digest));
    }
}

/// Fails if files are wrong.
fn verdict(data_set: &DataSet, wrong: usize) -> Outcome {
    let (files, place) = (if wrong == 1 { "file" } else { "files" }, data_set.store().path(""));
    match wrong {
        0 => Ok(()),
        _ => Err(Failure::Failed(format!(
            "wrong or missing {files} in {}: {wrong}; nothing was changed",
            place.display()
        ))),
    }
}

pub(super) fn verify(args: &PlaceArgs) -> Outcome {
    let (study, data_set) = existing(args)?;
    let bar = StudyBar::new(&study.name, data_set.manifest().parts());
    let found = inspect::verify(&study, &data_set, |part| bar.reach(part + 1, None));
    bar.end();
    let found = found?;
    say_parts(&found.parts);
    for wrong in &found.wrong {
        say!("FAILED  {wrong}");
    }
    say!("{} of {} parts are right", found.parts.good, data_set.manifest().parts());
    if !found.parts.missing.is_empty() {
        say!("missing parts: {}\n  `damprig study run` or `work` computes them", ranges(&found.parts.missing));
    }
    match found.results {
        Some(good) => say!("table, figures and page: {good} files are as they were written"),
        None if found.has_table => {
            say!("table, figures and page are not checked: there is no {SUMS}; `damprig study merge` writes it")
        }
        None => say!("there is no table yet: `damprig study merge` writes it"),
    }
    verdict(&data_set, found.wrong_files())
}

pub(super) fn merge(args: &MergeArgs) -> Outcome {
    let (study, data_set) = existing(&args.place)?;
    let (start, bar) = (Instant::now(), StudyBar::new(&study.name, study.rows()));
    let mut progress = StudyProgress::none(study.rows());
    let table = data_set.join(&study, |part, there| {
        progress.meet_part(&study, data_set.manifest().rows_of(part).start, there);
        bar.reach(progress.done, None);
    });
    bar.end();
    let table = table.map_err(|error| kept(&data_set, error))?;
    say_result(&study, &data_set, &progress, (&table, start), args.json)
}

fn store(args: &PlaceArgs) -> Result<Store, Failure> {
    Store::at(&place(&args.study, args.out.as_deref()))
}

/// A study and its results; nothing is created.
fn existing(args: &PlaceArgs) -> Result<(Study, DataSet), Failure> {
    let study = Study::read(&examples::find(FileKind::Study, &args.study)?)?;
    let store = store(args)?;
    let place = store.path("");
    match DataSet::existing(&study, store)? {
        Some(data_set) => Ok((study, data_set)),
        None => Err(Failure::Input(format!(
            "{} has no results of a study\n  give the --out of its workers, or start one with `damprig study work`",
            place.display()
        ))),
    }
}

/// The time in whole seconds, in UTC as the other workers have it: 2026-05-01T10:20:30Z.
fn clock() -> String {
    Timestamp::now().to_zoned(TimeZone::UTC).strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}
