//! The run that is compared: its campaign as run, its journal, and what is missing.

use crate::campaign::Campaign;
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::journal::{self, JOURNAL};
use crate::run_folder::read::campaign_copy;
use crate::run_folder::schema::journal_state::JournalState;

/// The campaign as run, the journal's sum, and what cannot be read.
pub(super) fn read(run: &RunFolder) -> Result<(Campaign, JournalState, Vec<String>), Failure> {
    let failed = |error: String| Failure::Storage(format!("{}: {error}", run.path().display()));
    let lines = journal::read(run.path())?;
    let mut unreadable = Vec::new();
    if !lines.damaged.is_empty() {
        let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
        unreadable.push(format!("{JOURNAL}: line {}", list.join(", ")));
    }
    let state = JournalState::of(&lines.entries);
    let Some(begin) = state.begun.last() else {
        return Err(failed(format!("{JOURNAL} has no beginning of the run: it is damaged, or of an older version")));
    };
    if state.points() == 0 {
        return Err(failed("no point has been measured: there is nothing to compare".into()));
    }
    let (board, is_simulated) = (begin.device.settings.clone(), begin.device.simulated);
    let mut campaign = campaign_copy::campaign(run.path())?;
    if let Some(board) = &board {
        // Limits were checked before the run.
        let _ = campaign.on_board(&board.settings, is_simulated);
    }
    Ok((campaign, state, unreadable))
}

/// Points that are planned and not measured, and a run that goes on.
pub(super) fn missing(run: &RunFolder, campaign: &Campaign, state: &JournalState) -> Vec<String> {
    let manifest = run.manifest();
    let mut missing = Vec::new();
    if !manifest.is_complete() {
        let (taken, planned) = (state.points(), state.planned(campaign).points);
        missing.push(format!(
            "the run is not complete ({}): {taken} of {planned} points are compared",
            manifest.ending_text()
        ));
    }
    missing
}
