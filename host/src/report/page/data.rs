//! Gathers the contents of the report page from a run folder, as far as it can be read.

use std::path::Path;

use arrow_array::RecordBatch;
use damprig_core::measure::steadiness::Steadiness;

use super::gaps::{self, SampleGaps};
use crate::campaign::Campaign;
use crate::report::figures::campaign::PlottedPoint;
use crate::run_folder::journal::{self, Entry};
use crate::run_folder::read::campaign_copy;
use crate::run_folder::schema::device::BoardSettings;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::results::{self, steadiness_of};
use crate::run_folder::{ReadError, RunFolder};
use crate::table::values::{Value, column, numbers, texts};

/// A measured point, as the page shows it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PagePoint {
    pub(super) shown: PlottedPoint,
    /// X/Z (lock-in).
    pub(super) x_over_z_lock_in: f64,
    /// Lock-in amplitude of z, m.
    pub(super) z_m: f64,
    /// Mean of the cycle maxima of |x|, m.
    pub(super) x_m: f64,
    /// Largest |x|, m.
    pub(super) max_abs_x_m: f64,
    pub(super) cycles: u64,
    pub(super) saturated: bool,
    /// Names of the clipped sensors.
    pub(super) clipped: String,
    pub(super) segment: u64,
}

/// The contents of the page.
#[derive(Debug)]
pub(super) struct PageData {
    /// Name of the run folder.
    pub(super) id: String,
    pub(super) manifest: Manifest,
    /// The campaign as run, or why it cannot be read.
    pub(super) campaign: Result<Campaign, String>,
    /// Points in the order of the campaign.
    pub(super) points: Vec<PagePoint>,
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
                journal::Lines::default()
            }
        };
        if !lines.damaged.is_empty() {
            let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
            unreadable.push(format!("{}: line {}", journal::JOURNAL, list.join(", ")));
        }
        let taken = JournalState::of(&lines.entries);
        let link = lines.entries.iter().filter_map(|entry| match entry {
            Entry::Link { what, at } | Entry::Action { what, at } => Some((at.clone(), what.clone())),
            Entry::PeakPoints(points) => Some((points.at.clone(), points.text())),
            _ => None,
        });
        let board = taken.begun.last().and_then(|begin| begin.device.settings.as_ref());
        let campaign = read_campaign(path, board);
        let batches = match &campaign {
            Ok(campaign) if !taken.rows().is_empty() => {
                results::table(&taken.rows_in_order(&campaign.in_order())).map(|batch| vec![batch]).map_err(ReadError)
            }
            _ => run.results(),
        };
        let points = batches.and_then(|all| all.iter().map(points).collect::<Result<Vec<_>, _>>());
        let points = points.unwrap_or_else(|error| {
            unreadable.push(error.to_string());
            Vec::new()
        });
        Self {
            id: run.id(),
            manifest: run.manifest().clone(),
            points: points.concat(),
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

    /// The points for the figures.
    pub(super) fn plotted_points(&self) -> Vec<PlottedPoint> {
        self.points.iter().map(|p| p.shown.clone()).collect()
    }

    /// Points of a set-up.
    pub(super) fn points_of<'a>(&'a self, set_up: &'a str) -> impl Iterator<Item = &'a PagePoint> {
        self.points.iter().filter(move |p| p.shown.set_up == set_up)
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

fn points(batch: &RecordBatch) -> Result<Vec<PagePoint>, ReadError> {
    let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
    let number = |name: &str| numbers(batch, name);
    let (f, ratio, phase) = (number("frequency_hz")?, number("x_over_z")?, number("phase_rad")?);
    let (z, x, x_max) = (number("z_amplitude_m")?, number("mean_cycle_max_m")?, number("max_abs_x_m")?);
    // Older runs lack the column of the ratio.
    let x_amplitude = number("x_amplitude_m")?;
    let (cycles, steady) = (number("cycles")?, column(batch, "steady")?);
    // Older runs lack these columns.
    let saturated = column(batch, "drive_saturated").unwrap_or_default();
    let clipped = texts(batch, "sensors_clipped").unwrap_or_default();
    let segments = number("segment").unwrap_or_default();
    let is = |list: &[Value], n: usize| list.get(n) == Some(&Value::Bool(true));
    // Older runs lack these columns too.
    let verdicts = texts(batch, "steadiness").unwrap_or_default();
    let intervals = number("interval").unwrap_or_default();
    let steadiness = |n: usize| match verdicts.get(n) {
        Some(text) => steadiness_of(text),
        None if is(&steady, n) => Steadiness::Steady,
        None => Steadiness::NotSteady,
    };
    let point = |n: usize| PagePoint {
        shown: PlottedPoint {
            set_up: set_ups[n].clone(),
            experiment: experiments[n].clone(),
            frequency_hz: f[n],
            x_over_z: ratio[n],
            interval: intervals.get(n).copied().unwrap_or(f64::NAN),
            phase_rad: phase[n],
            steadiness: steadiness(n),
        },
        x_over_z_lock_in: x_amplitude[n] / z[n],
        z_m: z[n],
        x_m: x[n],
        max_abs_x_m: x_max[n],
        cycles: cycles[n] as u64,
        saturated: is(&saturated, n),
        clipped: clipped.get(n).cloned().unwrap_or_default(),
        segment: segments.get(n).copied().unwrap_or(0.0) as u64,
    };
    Ok((0..batch.num_rows()).map(point).collect())
}
