//! Runs a campaign on the virtual rig, as `damprig run` does.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::{Ending, parts};
use crate::results::RUN;
use damprig::campaign::{Campaign, CampaignSetUp};
use damprig::client::link::Address;
use damprig::client::session::Session;
use damprig::failure::Failure;
use damprig::host_time;
use damprig::prediction::CampaignPrediction;
use damprig::recorded_run::{RecordedRun, RunStart, begin_entry};
use damprig::run_folder::ResultRow;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::OutputFolder;
use damprig::runner::rehearsal::accept;
use damprig::runner::{Run, RunError, Watcher};

/// Time without a message from the virtual rig after which it counts as lost.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Passes the progress on, and stops the run.
struct Reporter<'a> {
    report: &'a (dyn Fn(f64) -> bool + Sync),
    length_s: f64,
    stop: &'a AtomicBool,
}

impl Watcher for Reporter<'_> {
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<bool, RunError> {
        Ok(false)
    }

    fn progress(&mut self, rig_s: f64) {
        if !(self.report)((rig_s / self.length_s).min(1.0)) {
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    fn point(&mut self, _: &ResultRow) {}

    fn link(&mut self, _: &str) {}
}

/// Runs a campaign into a run folder of its own; one that was stopped is run again.
pub(super) fn run(file: &Path, folder: &Path, report: &(dyn Fn(f64) -> bool + Sync)) -> Result<Ending, Failure> {
    let mut campaign = Campaign::read(file)?;
    let mut session = Session::open(&Address::VIRTUAL, TIMEOUT)?;
    let (selection, _) = accept(&mut campaign, &session)?;
    let predicted = CampaignPrediction::of(&campaign)?;
    predicted.check(&campaign, f64::from(session.settings.calibration.drive.range().amplitude_m()))?;
    let out = folder.join(RUN);
    if out.is_dir() {
        parts::remove(&out)?;
    }
    let out = OutputFolder::create_at(&out)?;
    let journal = out.keep_campaign(&campaign)?;
    let begin = begin_entry(&campaign, &session, &selection, out.records(&campaign)?, &host_time::now());
    let start = RunStart {
        begin,
        journal,
        taken: JournalState::default(),
        withdrawn: Vec::new(),
        waits_for_room: session.is_granted(),
    };
    let mut recorded = RecordedRun::begin(&campaign, &predicted, &out, start)?;
    let taken = recorded.taken().clone();
    let stop = AtomicBool::new(false);
    let mut watcher = Reporter { report, length_s: campaign.longest_s(), stop: &stop };
    let run = Run::new(&campaign, &mut session, &mut recorded.recorder, &mut watcher, &stop, selection, taken);
    let (tally, result) = run.carry_out();
    let ended = recorded.end(tally, result).ok_or_else(|| Failure::failed("the recorder thread has stopped"))?;
    match ended.result {
        Err(RunError::Interrupted) => return Ok(Ending::Stopped),
        Err(error) => return Err(Failure::failed(error)),
        Ok(()) => {}
    }
    ended.written?;
    ended.drawn?;
    Ok(Ending::Complete)
}
