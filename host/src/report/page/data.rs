//! Gathers the contents of the report page from a run folder, as far as it can be read.

use std::path::Path;

use super::gaps::{self, SampleGaps};
use crate::campaign::Campaign;
use crate::run_folder::journal::{self, JournalEntry};
use crate::run_folder::read::campaign_copy;
use crate::run_folder::schema::device::BoardSettings;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::{ResultRow, RunFolder};

/// The contents of the page.
#[derive(Debug)]
pub(super) struct PageData {
    /// Name of the run folder.
    pub(super) id: String,
    pub(super) manifest: Manifest,
    /// The campaign as run, or why it cannot be read.
    pub(super) campaign: Result<Campaign, String>,
    /// Points in the order of the campaign.
    pub(super) points: Vec<ResultRow>,
    /// State of the journal; empty for a run without one.
    pub(super) taken: JournalState,
    /// Times and texts of link events, actions, and points around peaks.
    pub(super) link: Vec<(String, String)>,
    pub(super) gaps: SampleGaps,
    /// Parts that cannot be read.
    pub(super) unreadable: Vec<String>,
}

impl PageData {
    pub(super) fn of(run: &RunFolder) -> Self {
        let path = run.path();
        let mut unreadable = Vec::new();
        let lines = match journal::read(path) {
            Ok(lines) => lines,
            Err(error) => {
                unreadable.push(error.to_string());
                journal::JournalLines::default()
            }
        };
        if !lines.damaged.is_empty() {
            let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
            unreadable.push(format!("{}: line {}", journal::JOURNAL, list.join(", ")));
        }
        let taken = JournalState::of(&lines.entries);
        let link = lines.entries.iter().filter_map(|entry| match entry {
            JournalEntry::Link { what, at } | JournalEntry::Action { what, at } => Some((at.clone(), what.clone())),
            JournalEntry::PeakPoints(points) => Some((points.at.clone(), points.text())),
            _ => None,
        });
        let board = taken.begun.last().and_then(|begin| begin.device.settings.as_ref());
        let campaign = read_campaign(path, board);
        let points = match &campaign {
            Ok(campaign) if !taken.rows().is_empty() => Ok(taken.rows_in_order(&campaign.in_order())),
            _ => run.result_rows(),
        };
        let points = points.unwrap_or_else(|error| {
            unreadable.push(error.to_string());
            Vec::new()
        });
        Self {
            id: run.id(),
            manifest: run.manifest().clone(),
            points,
            link: link.collect(),
            gaps: gaps::find(run, &taken),
            campaign: campaign.map_err(|error| format!("campaign.toml: {error}")),
            taken,
            unreadable,
        }
    }

    /// All parts that cannot be read.
    pub(super) fn all_unreadable(&self) -> Vec<String> {
        let campaign = self.campaign.as_ref().err();
        campaign.into_iter().chain(&self.unreadable).chain(&self.gaps.unreadable).cloned().collect()
    }

    /// Whether the base of an experiment, by its name, moves by other amplitudes than that of the set-up.
    pub(super) fn has_own_base(&self, name: &str) -> bool {
        let mut experiments = self.campaign.iter().flat_map(|campaign| &campaign.experiments);
        experiments.any(|experiment| experiment.name == name && experiment.led_by_loops().is_some())
    }

    /// Points of a set-up.
    pub(super) fn points_of<'a>(&'a self, set_up: &'a str) -> impl Iterator<Item = &'a ResultRow> {
        self.points.iter().filter(move |p| p.set_up == set_up)
    }
}

fn read_campaign(path: &Path, board: Option<&BoardSettings>) -> Result<Campaign, String> {
    let mut campaign = campaign_copy::campaign(path).map_err(|e| e.to_string())?;
    if let Some(board) = board {
        // Experiments that the board rejects did not run.
        let _ = campaign.on_board(&board.settings, false);
    }
    Ok(campaign)
}
