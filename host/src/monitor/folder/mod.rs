//! A run folder as a source of the monitor: follows one that another program is recording, or replays one that is over. Nothing here
//! writes to the folder.

mod reader;
mod recomputed;
mod replay;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::io::TICK_HZ;

use super::control::Actions;
use super::feed::{Feed, Update, Watched};
use super::message::{Activity, Level, Limits, SourceKind, WatchedSource};
use super::numbers::SignalName;
use super::run::curves;
use crate::failure::Failure;
use crate::prediction::CampaignPrediction;
use crate::run_folder::RunFolder;
use crate::run_folder::journal::{self, JournalEntry};
use crate::run_folder::read::campaign_copy;
use crate::run_folder::read::sample_files::{read_samples, sample_files};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::samples::SampleColumn;
use reader::Reader;
use recomputed::Recomputed;
pub use replay::REPLAY_SPEEDS;

/// Time between two looks at a growing folder.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Longest pause before Ctrl-C is checked again.
const TURN: Duration = Duration::from_millis(50);

/// Watches a run folder until `stop` is set: follows it while it grows, or replays it with this many rig seconds per second.
///
/// # Errors
/// The folder holds no run, or its manifest or samples cannot be read.
pub fn watch(path: &Path, speed: f64, feed: &Feed, actions: &Actions, stop: &AtomicBool) -> Result<(), Failure> {
    let run = RunFolder::open(path)?;
    let grows = journal::is_being_written(path) == Some(true);
    let kind = if grows { SourceKind::Folder } else { SourceKind::Replay };
    let (watched, warning) = describe(&run, kind);
    feed.send(Update::Watch(Box::new(watched.clone())));
    warning.into_iter().for_each(|text| feed.log(Level::Warning, text));
    let mut reader = Reader::new(run, feed.clone(), &watched);
    if grows { follow(&mut reader, actions, stop) } else { replay::replay(&mut reader, &watched, speed, actions, stop) }
}

/// Follows a folder that grows, until `stop`. Results from before are shown, samples from the present part on.
fn follow(reader: &mut Reader, actions: &Actions, stop: &AtomicBool) -> Result<(), Failure> {
    let path = reader.run.path().to_path_buf();
    reader.start_over()?;
    reader.begin_at(present_segment_s(reader));
    let mut part = sample_files(&path).len().saturating_sub(1);
    let mut is_over = false;
    while !stop.load(Ordering::Relaxed) {
        let looked = Instant::now();
        while let Some(asked) = actions.next() {
            asked.answer(Err("This page only follows a run that another program records.".into()));
        }
        let is_written = journal::is_being_written(&path) == Some(true);
        if is_written || !is_over {
            reader.read_journal()?;
            part = tell_new_rows(reader, part)?;
            is_over = !is_written;
            reader.tell_due(is_over || !reader.has_samples());
            if is_over {
                reader.feed.send(Update::Activity(Activity::Over, state_of(&path)));
            }
        }
        while looked.elapsed() < LOOK_EVERY && !stop.load(Ordering::Relaxed) {
            std::thread::sleep(TURN);
        }
    }
    Ok(())
}

/// Rig time at which the present segment began, s.
fn present_segment_s(reader: &Reader) -> f64 {
    let entries: Vec<JournalEntry> = reader.waiting().cloned().collect();
    let start = entries.iter().rposition(|entry| matches!(entry, JournalEntry::Segment(_))).unwrap_or(0);
    JournalState::of(&entries[..start]).ticks() as f64 / f64::from(TICK_HZ)
}

/// Tells the rows that were added since the last look, from the part `part` on; returns the last part.
fn tell_new_rows(reader: &mut Reader, part: usize) -> Result<usize, Failure> {
    let files = sample_files(reader.run.path());
    // Fewer than before once the parts have been joined.
    let mut part = part.min(files.len().saturating_sub(1));
    for (index, file) in files.iter().enumerate().skip(part) {
        // A file may be closed or removed while it is listed: the next look finds its rows.
        let Ok(batches) = read_samples(file) else { break };
        for batch in batches.flatten() {
            reader.tell_between(&batch, f64::NEG_INFINITY, f64::INFINITY)?;
        }
        part = index;
    }
    Ok(part)
}

fn state_of(path: &Path) -> String {
    match RunFolder::open(path) {
        Ok(run) => format!("State of the run: {}.", run.manifest().ending_text()),
        Err(error) => format!("The run can no longer be read: {error}"),
    }
}

/// What is watched, and why the prediction is missing.
fn describe(run: &RunFolder, kind: SourceKind) -> (Watched, Option<String>) {
    let manifest = run.manifest();
    let device = manifest.device.as_ref();
    let signals: Vec<SignalName> = manifest.signals.iter().map(signal).collect();
    let settings = device.and_then(|device| device.settings.as_ref());
    let known = campaign_copy::campaign(run.path()).and_then(|mut campaign| {
        if let Some(settings) = settings {
            campaign.on_board(&settings.settings, device.is_some_and(|device| device.simulated))?;
        }
        let limits = Limits {
            x_m: Some(campaign.rig.structure_limit_m()),
            z_m: Some(campaign.rig.base_limit_m()),
            wall_force_n: Some(f64::from(campaign.rig.acting.wall_force_n)).filter(|limit| *limit > 0.0),
            clearance_m: None,
        };
        Ok((campaign, limits))
    });
    let (curves, limits, refusal) = match known {
        Ok((campaign, limits)) => match CampaignPrediction::of(&campaign) {
            Ok(predicted) => (curves(&campaign, &predicted), limits, None),
            Err(refusal) => (curves(&campaign, &CampaignPrediction::default()), limits, Some(refusal)),
        },
        Err(refusal) => (Vec::new(), Limits::default(), Some(refusal)),
    };
    let warning = refusal.map(|refusal| {
        let first = refusal.to_string().lines().next().unwrap_or_default().to_string();
        format!("Without a prediction: the copy of the campaign cannot be used: {first}")
    });
    let watched = Watched {
        source: WatchedSource {
            kind,
            name: manifest.campaign.clone(),
            rig: device.map_or_else(String::new, |device| device.link.clone()),
            board: device.map_or_else(String::new, |device| device.board.clone()),
            folder: Some(run.path().display().to_string()),
        },
        // What was recorded comes first, so it is preferred to what is computed again.
        table: signals.iter().cloned().chain(Recomputed::signals()).collect(),
        signals,
        curves,
        points_planned: manifest.points_planned,
        limits,
    };
    (watched, warning)
}

/// The device's name of a recorded column: `x` for `x_m`.
fn signal(column: &SampleColumn) -> SignalName {
    let unit = column.unit.to_lowercase().replace('/', "_per_");
    let name = column.name.strip_suffix(&format!("_{unit}")).filter(|_| !unit.is_empty()).unwrap_or(&column.name);
    SignalName { name: name.to_string(), unit: column.unit.clone() }
}
