//! Verifies a run folder: what is damaged, and what can still be read. Every check runs, whatever the others found.

use std::collections::BTreeMap;
use std::path::Path;

use super::campaign_copy;
use super::cut_results::cut_results;
use super::folder::{RunFolder, find};
use super::open_part::read_stream;
use super::parquet_file::read;
use super::sample_files::{is_open_part, lost_open_parts, open_parts, read_samples, sample_files};
use super::unfinished_tables::differing;
use super::untracked_files::untracked;
use crate::campaign::{Campaign, differences};
use crate::failure::Failure;
use crate::input::{Source, regular};
use crate::run_folder::journal::JournalLines;
use crate::run_folder::own_files::refuse_links;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::MANIFEST;
use crate::run_folder::schema::results::RESULTS;
use crate::run_folder::schema::samples::JOINED;
use crate::run_folder::schema::transients::TRANSIENTS;
use crate::run_folder::{checksum, journal};
use crate::table::values::{numbers, texts};

/// One thing found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// In order.
    Good(String),
    /// Wrong.
    Wrong(String),
}

/// Checks a folder. Nothing is written.
///
/// # Errors
/// When the folder is no run at all.
pub fn verify(path: &Path) -> Result<Vec<Finding>, Failure> {
    let path = &find(path)?;
    let mut found = Vec::new();
    if let Err(error) = refuse_links(path) {
        // Nothing is read through a link.
        return Ok(vec![Finding::Wrong(error.to_string())]);
    }
    let run = match RunFolder::open(path) {
        Ok(run) => Some(run),
        Err(error) => {
            found.push(Finding::Wrong(error.to_string()));
            None
        }
    };
    if let Some(run) = &run {
        ending(run, &mut found);
        checksums(run, &mut found);
    }
    let lines = match journal::read(path) {
        Ok(lines) => lines,
        Err(error) => {
            // Older runs have no journal.
            found.extend(journal::is_in(path).then(|| Finding::Wrong(error.to_string())));
            JournalLines::default()
        }
    };
    let taken = JournalState::of(&lines.entries);
    journal(path, run.as_ref(), &lines, &taken, &mut found);
    let campaign = campaign(path, &mut found);
    untracked_files(path, campaign.as_ref(), &taken, &mut found);
    results(path, run.as_ref(), campaign.as_ref(), &taken, &mut found);
    if let (Some(run), Some(campaign)) = (run.as_ref().filter(|run| run.manifest().is_running()), &campaign) {
        let differing = differing(path, run.manifest(), &lines.entries, &campaign.in_order());
        found.extend(differing.into_iter().map(Finding::Wrong));
    }
    samples(path, run.as_ref(), &taken, &mut found);
    Ok(found)
}

fn ending(run: &RunFolder, found: &mut Vec<Finding>) {
    let manifest = run.manifest();
    let text = format!(
        "manifest.json: {}, {} of {} points",
        manifest.ending_text(),
        manifest.points_taken,
        manifest.points_planned
    );
    found.push(if manifest.is_complete() { Finding::Good(text) } else { Finding::Wrong(text) });
    let lost = manifest.counters;
    if lost.misfit_messages > 0 {
        let text = format!(
            "telemetry: {} messages of the board did not fit the campaign and were dropped",
            lost.misfit_messages
        );
        found.push(Finding::Wrong(text));
    }
    if [lost.dropped_records, lost.missing_records, lost.dropped_rows_host, lost.lost_rows].iter().any(|n| *n > 0) {
        let text = format!(
            "telemetry: {} rows dropped by the device, {} messages missing on the way, {} rows dropped by the host; {} rows missing in all",
            lost.dropped_records, lost.missing_records, lost.dropped_rows_host, lost.lost_rows
        );
        found.push(Finding::Wrong(text));
    }
}

fn checksums(run: &RunFolder, found: &mut Vec<Finding>) {
    let text = regular::read(&run.path().join(MANIFEST)).unwrap_or_default();
    match run.manifest().is_intact(&String::from_utf8_lossy(&text)) {
        Some(true) => found.push(Finding::Good(format!("{MANIFEST}: as damprig wrote it"))),
        Some(false) => {
            found.push(Finding::Wrong(format!("{MANIFEST}: changed since damprig wrote it (SHA-256 differs)")))
        }
        None => {}
    }
    let files = &run.manifest().files;
    if files.is_empty() {
        found.push(Finding::Good("checksums: the manifest has none (a run that was killed, or an old one)".into()));
        return;
    }
    let mut good = 0;
    for file in files {
        match checksum::of_file(run.path(), &file.name) {
            Err(error) => found.push(Finding::Wrong(format!("{}: cannot read it: {error}", file.name))),
            Ok(now) if now.bytes != file.bytes => found.push(Finding::Wrong(format!(
                "{}: {} bytes, and {} when the run ended",
                file.name, now.bytes, file.bytes
            ))),
            Ok(now) if now.sha256 != file.sha256 => {
                found.push(Finding::Wrong(format!("{}: changed since the run ended (SHA-256 differs)", file.name)));
            }
            Ok(_) => good += 1,
        }
    }
    found.push(Finding::Good(format!("checksums: {good} of {} files are as when the run ended", files.len())));
}

/// The journal itself, and the files that it lists.
fn journal(path: &Path, run: Option<&RunFolder>, lines: &JournalLines, taken: &JournalState, found: &mut Vec<Finding>) {
    let name = journal::JOURNAL;
    if !journal::is_in(path) {
        let is_lost = run.is_some_and(|run| run.manifest().is_running());
        found.extend(is_lost.then(|| Finding::Wrong(format!("{name}: missing"))));
        return;
    }
    found.push(Finding::Good(format!("{name}: {} lines, {} points", lines.entries.len(), taken.points())));
    if !lines.damaged.is_empty() {
        let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
        found.push(Finding::Wrong(format!("{name}: line {} is damaged", list.join(", "))));
    }
    if !lines.torn.is_empty() {
        let list: Vec<String> = lines.torn.iter().map(usize::to_string).collect();
        let text = format!("{name}: line {} was cut off by a kill and is ignored", list.join(", "));
        found.push(Finding::Good(text));
    }
    if let (Some(begin), Ok(now)) = (taken.begun.first(), Source::read(&path.join("campaign.toml"))) {
        let different = differences(&begin.campaign, now.text());
        if !different.is_empty() {
            let list = different.join("\n  ");
            let text = format!("campaign.toml is not the campaign that the run was started with ({name}):\n  {list}");
            found.push(Finding::Wrong(text));
        } else if taken.begun.iter().all(|begin| begin.campaign != now.text()) {
            let text = format!(
                "campaign.toml: remarks or layout have changed since the run was started ({name}); the values are the same"
            );
            found.push(Finding::Wrong(text));
        }
    }
    if let Ok(campaign) = campaign_copy::campaign(path) {
        for text in taken.unplanned(&campaign) {
            found.push(Finding::Wrong(format!("{name}: a result that the campaign does not have: {text}")));
        }
    }
    for withdrawn in taken.withdrawn() {
        found.push(Finding::Good(format!(
            "{name}: {:?}, {:?}, point {} of segment {} was measured again: {} rows of its samples had been lost",
            withdrawn.id.set_up,
            withdrawn.id.experiment,
            withdrawn.point_index,
            withdrawn.id.segment,
            withdrawn.lost_rows
        )));
    }
    let records = taken.begun.first().map_or(&[][..], |begin| &begin.records);
    found.extend(records.iter().filter_map(|copy| copy.file.difference(path)).map(Finding::Wrong));
    for part in taken.left_parts() {
        let file = &part.file.name;
        let now = if path.join(file).exists() { "was left in place" } else { "is gone" };
        found.push(Finding::Wrong(format!(
            "{file}: was damaged when the samples were joined; its {} rows are missing from {JOINED}, the file {now}",
            part.rows
        )));
    }
    for aside in &taken.set_aside {
        found.push(match aside.file.difference(path) {
            Some(difference) => Finding::Wrong(difference),
            None => Finding::Good(format!(
                "{}: was damaged when the run was resumed, and is kept aside; the rows of its first {} of {} bytes are in the samples",
                aside.file.name, aside.sound_bytes, aside.file.bytes
            )),
        });
    }
    if run.is_none_or(|run| run.manifest().files.is_empty()) {
        sample_checksums(path, taken, found);
    }
}

/// Compares the files of samples that the journal lists; parts that are joined may be removed.
fn sample_checksums(path: &Path, taken: &JournalState, found: &mut Vec<Finding>) {
    if taken.joined.is_none() && path.join(JOINED).exists() {
        let name = journal::JOURNAL;
        found.push(Finding::Wrong(format!("{JOINED}: {name} does not list it; `--resume` compares it with the parts")));
    }
    let left: Vec<u32> = taken.left_parts().map(|part| part.part).collect();
    let is_there = |name: &str| taken.joined.is_none() || path.join(name).exists();
    let parts = taken.sealed.iter().filter(|s| !left.contains(&s.part) && is_there(&s.file.name)).map(|s| &s.file);
    let joined = taken.joined.iter().filter_map(|joined| joined.file.as_ref());
    let files: Vec<_> = parts.chain(joined).collect();
    let different: Vec<Finding> = files.iter().filter_map(|f| f.difference(path)).map(Finding::Wrong).collect();
    let (good, all) = (files.len() - different.len(), files.len());
    found.extend(different);
    found.push(Finding::Good(format!("samples: {good} of {all} files are as the journal says")));
}

/// Files of a run that its journal does not list.
fn untracked_files(path: &Path, campaign: Option<&Campaign>, taken: &JournalState, found: &mut Vec<Finding>) {
    if !journal::is_in(path) {
        return;
    }
    // Without the campaign the number of points is unknown.
    let is_complete = campaign.is_none_or(|campaign| taken.points() >= taken.planned(campaign).points);
    let (untracked, name) = (untracked(path, taken, is_complete), journal::JOURNAL);
    found.extend(untracked.iter().map(|what| Finding::Wrong(format!("{what}; {name} does not list it"))));
}

fn campaign(path: &Path, found: &mut Vec<Finding>) -> Option<Campaign> {
    match campaign_copy::campaign(path) {
        Ok(campaign) => Some(campaign),
        Err(error) => {
            found.push(Finding::Wrong(format!("campaign.toml: {error}")));
            None
        }
    }
}

type PerPair = BTreeMap<(String, String), Vec<f64>>;

/// The numbers of a column for each set-up and experiment.
fn gather(batch: &arrow_array::RecordBatch, name: &str, into: &mut PerPair) -> Result<(), Failure> {
    let (set_ups, experiments, values) = (texts(batch, "set_up")?, texts(batch, "experiment")?, numbers(batch, name)?);
    for ((set_up, experiment), value) in set_ups.into_iter().zip(experiments).zip(values) {
        into.entry((set_up, experiment)).or_default().push(value);
    }
    Ok(())
}

fn results(
    path: &Path,
    run: Option<&RunFolder>,
    campaign: Option<&Campaign>,
    journal: &JournalState,
    found: &mut Vec<Finding>,
) {
    let mut taken = PerPair::new();
    let batches = match run {
        Some(run) => run.results(),
        None => read(&path.join(RESULTS)).and_then(Iterator::collect),
    };
    let read = batches.and_then(|all| all.iter().try_for_each(|batch| gather(batch, "frequency_hz", &mut taken)));
    if let Err(error) = read {
        found.push(Finding::Wrong(error.to_string()));
        return;
    }
    let mut rows: usize = taken.values().map(Vec::len).sum();
    // The numbers of a run that has not ended are those of the journal.
    let from = if run.is_some_and(|run| run.manifest().is_running()) { "results" } else { RESULTS };
    found.push(Finding::Good(format!("{from}: {rows} rows")));
    let mut events = PerPair::new();
    let read = run.map_or(Ok(Vec::new()), RunFolder::transients);
    match read.and_then(|all| all.iter().try_for_each(|batch| gather(batch, "max_abs_x_m", &mut events))) {
        Err(error) => found.push(Finding::Wrong(error.to_string())),
        Ok(()) if !events.is_empty() => {
            let own: usize = events.values().map(Vec::len).sum();
            let from = if run.is_some_and(|run| run.manifest().is_running()) { "transients" } else { TRANSIENTS };
            found.push(Finding::Good(format!("{from}: {own} rows")));
            rows += own;
        }
        Ok(()) => {}
    }
    if let Some(said) = run.map(|r| r.manifest()).filter(|m| !m.is_running() && m.points_taken != rows) {
        found.push(Finding::Wrong(format!("results: {rows} rows, the manifest says {}", said.points_taken)));
    }
    for experiment in campaign.iter().flat_map(|c| &c.experiments) {
        for set_up in experiment.set_ups.iter().filter_map(|i| campaign?.set_ups.get(*i)) {
            let experiment = &*journal.known(&set_up.name, experiment);
            let key = (set_up.name.clone(), experiment.name.clone());
            let have = taken.get(&key).map_or(&[][..], Vec::as_slice);
            if experiment.stepped_sine().is_none() && !events.contains_key(&key) {
                found.push(Finding::Wrong(format!("results: {:?}, {:?} is missing", key.0, key.1)));
            }
            let times = |list: &[f64], f: f64| list.iter().filter(|g| **g == f).count();
            let is_missing = |f: &&f64| times(have, **f) < times(experiment.frequencies_hz(), **f);
            let missing: Vec<String> =
                experiment.frequencies_hz().iter().filter(is_missing).map(f64::to_string).collect();
            let lacking = experiment.tracking().map_or(0, |_| experiment.points().saturating_sub(have.len()));
            if lacking > 0 {
                let (set_up, experiment) = &key;
                found.push(Finding::Wrong(format!("results: {set_up:?}, {experiment:?} lacks {lacking} points")));
            }
            if !missing.is_empty() {
                let (set_up, experiment) = key;
                let list = missing.join(", ");
                found.push(Finding::Wrong(format!("results: {set_up:?}, {experiment:?} lacks {list} Hz")));
            }
        }
    }
}

fn samples(path: &Path, run: Option<&RunFolder>, journal: &JournalState, found: &mut Vec<Finding>) {
    let files = sample_files(path);
    let (mut rows, mut ticks) = (0_u64, PerSegment::new());
    for file in &files {
        let mut own = 0;
        let read = read_samples(file).and_then(|mut batches| {
            batches.try_for_each(|batch| {
                let batch = batch?;
                own += batch.num_rows() as u64;
                gather_ticks(&batch, &mut ticks)
            })
        });
        rows += own;
        if let Err(error) = read {
            found.push(Finding::Wrong(format!("{error}\n  {own} rows of it can be read")));
        }
        if is_open_part(file) {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            found
                .push(Finding::Wrong(format!("{name}: was open when the program ended; {own} rows of it can be read")));
        }
    }
    for (_, open) in open_parts(path) {
        let problem = read_stream(&open).map_or_else(|error| Some(error.to_string()), |stream| stream.problem);
        let name = open.file_name().unwrap_or_default().to_string_lossy();
        found.extend(problem.map(|problem| Finding::Wrong(format!("{name}: {problem}"))));
    }
    let lost = lost_open_parts(path, journal).into_iter();
    found.extend(lost.map(|name| Finding::Wrong(format!("{name}: missing; its checksums are there"))));
    found.push(Finding::Good(format!("samples: {rows} rows can be read from {} files", files.len())));
    let last = ticks.iter().filter_map(|((set_up, experiment, segment), ticks)| {
        let highest = ticks.iter().fold(0.0f64, |most, tick| most.max(*tick)) as u64;
        Some(((set_up.clone(), experiment.clone(), segment.parse().ok()?), highest))
    });
    for cut in cut_results(journal, &last.collect()) {
        found.push(Finding::Wrong(format!(
            "samples: {:?}, {:?}, segment {}: the last {} rows of point {} are missing",
            cut.id.set_up, cut.id.experiment, cut.id.segment, cut.lost_rows, cut.point_index
        )));
    }
    let Some(manifest) = run.map(RunFolder::manifest) else { return };
    if !manifest.is_running() && manifest.sample_rows != rows {
        found.push(Finding::Wrong(format!("samples: {rows} rows, the manifest says {}", manifest.sample_rows)));
    }
    let Some(every) = manifest.every_ticks() else { return };
    for ((set_up, experiment, segment), ticks) in &ticks {
        if let Some(text) = gaps(ticks, every as f64) {
            let place = format!("{set_up:?}, {experiment:?}, segment {segment}");
            found.push(Finding::Wrong(format!("samples: {place}: {text}")));
        }
    }
}

/// Ticks count from 0 in each segment of an experiment on a set-up.
type PerSegment = BTreeMap<(String, String, String), Vec<f64>>;

fn gather_ticks(batch: &arrow_array::RecordBatch, into: &mut PerSegment) -> Result<(), Failure> {
    let (set_ups, experiments, ticks) = (texts(batch, "set_up")?, texts(batch, "experiment")?, numbers(batch, "tick")?);
    // Older runs have no segments: they could not be resumed.
    let has_segments = batch.schema().field_with_name("segment").is_ok();
    let segments = if has_segments { texts(batch, "segment")? } else { vec!["0".into(); ticks.len()] };
    for (((set_up, experiment), segment), tick) in set_ups.into_iter().zip(experiments).zip(segments).zip(ticks) {
        into.entry((set_up, experiment, segment)).or_default().push(tick);
    }
    Ok(())
}

/// Steps between rows that are not `every` ticks, in words; `None` when there are none.
fn gaps(ticks: &[f64], every: f64) -> Option<String> {
    let odd: Vec<&[f64]> = ticks.windows(2).filter(|w| w[1] - w[0] != every).collect();
    let first = odd.first()?;
    let lost: f64 = odd.iter().map(|w| ((w[1] - w[0]) / every - 1.0).max(0.0)).sum();
    let text = format!("{} gaps, {lost:.0} rows lost, the first after tick {}", odd.len(), first[0]);
    let backwards = odd.iter().filter(|w| w[1] <= w[0]).count();
    Some(if backwards > 0 { format!("{text}; {backwards} times the tick does not rise") } else { text })
}

#[cfg(test)]
mod tests {
    use super::gaps;

    #[test]
    fn a_gap_is_reported_with_its_place_and_its_length_in_rows() {
        assert_eq!(gaps(&[0.0, 10.0, 20.0], 10.0), None);
        assert_eq!(gaps(&[0.0, 10.0, 50.0], 10.0).unwrap(), "1 gaps, 3 rows lost, the first after tick 10");
        assert!(gaps(&[0.0, 10.0, 10.0], 10.0).unwrap().ends_with("1 times the tick does not rise"));
    }
}
