//! Records a campaign's run into its folder: journal, samples and results while it runs; figures, report page and manifest when it
//! ends.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::campaign::Campaign;
use crate::client::session::Session;
use crate::failure::Failure;
use crate::host_time;
use crate::prediction::CampaignPrediction;
use crate::report::figures::campaign as figures;
use crate::report::figures::peak_motion::draw as draw_motions;
use crate::report::figures::{force_surface, resonance};
use crate::report::force_surface::ForceSurface;
use crate::report::page::page;
use crate::report::plot::{Breadth, Picture};
use crate::report::resonance::TrackedCurve;
use crate::report::resonance_table;
use crate::run_folder::checksum;
use crate::run_folder::journal::{Begin, CopiedFile, Ended, Journal, JournalEntry, Withdrawn};
use crate::run_folder::read::folder::id_of;
use crate::run_folder::schema::acting_settings::acting_settings;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::{Durations, Manifest, RunEnding, SetUpRecord};
use crate::run_folder::schema::self_description;
use crate::run_folder::write::writer::{RecordLayout, RunWriter};
use crate::run_folder::write::{OutputFolder, Recorder};
use crate::run_folder::{ResultRow, RunFolder};
use crate::runner::{RunError, Selection, Tally, device_record};

/// Journal entry for the start or resumption of a run.
#[must_use]
pub fn begin_entry(
    campaign: &Campaign,
    session: &Session,
    selection: &Selection,
    records: Vec<CopiedFile>,
    now: &jiff::Zoned,
) -> Begin {
    Begin {
        run: String::new(),
        records,
        at: host_time::text(now),
        damprig: crate::VERSION_LINE.to_string(),
        device: device_record(session),
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        campaign: campaign.source.text().to_string(),
        sums: true,
    }
}

/// Largest predicted |x| of each set-up in use, m.
fn largest_predicted(predicted: &CampaignPrediction) -> BTreeMap<usize, f64> {
    let largest = predicted.largest();
    let swings = largest.iter().map(|p| (p.set_up, p.swing.max_x_m));
    let mut all = BTreeMap::new();
    for (set_up, x_m) in swings.chain(predicted.expected.iter().map(|e| (e.set_up, e.outlook.max_abs_x_m))) {
        let most: &mut f64 = all.entry(set_up).or_default();
        *most = most.max(x_m);
    }
    all
}

/// What a run starts with.
pub struct RunStart {
    /// Its first line in the journal, from [`begin_entry`].
    pub begin: Begin,
    /// The folder's journal.
    pub journal: Journal,
    /// State of a resumed run.
    pub taken: JournalState,
    /// Results of a resumed run that do not count any more.
    pub withdrawn: Vec<Withdrawn>,
    /// Whether the recorder waits for the disk instead of dropping rows: under a granted clock.
    pub waits_for_room: bool,
}

/// A run that is being recorded.
pub struct RecordedRun<'a> {
    /// Takes what the run reports.
    pub recorder: Recorder<RunWriter>,
    campaign: &'a Campaign,
    folder: &'a OutputFolder,
    manifest: Manifest,
    taken: JournalState,
    wall: Instant,
}

/// A run that has ended, with its folder complete.
pub struct EndedRun {
    /// The manifest.
    pub manifest: Manifest,
    /// The sum of the journal.
    pub taken: JournalState,
    /// The results.
    pub rows: Vec<ResultRow>,
    /// How the run ended.
    pub result: Result<(), RunError>,
    /// Whether the files could be written.
    pub written: Result<(), Failure>,
    /// Whether the figures could be drawn.
    pub drawn: Result<(), Failure>,
}

impl<'a> RecordedRun<'a> {
    /// Writes the first line of the journal and the manifest, and starts the recorder.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn begin(
        campaign: &'a Campaign,
        predicted: &CampaignPrediction,
        folder: &'a OutputFolder,
        start: RunStart,
    ) -> Result<Self, Failure> {
        let RunStart { mut begin, journal, taken, withdrawn, waits_for_room } = start;
        let name = || id_of(folder.path());
        begin.run =
            taken.begun.first().map(|first| first.run.clone()).filter(|run| !run.is_empty()).unwrap_or_else(name);
        let mut manifest = first_manifest(campaign, predicted, &begin, &taken);
        let layout = RecordLayout {
            signals: begin.signals.clone(),
            every_ticks: begin.every_ticks,
            tick_hz: begin.device.tick_hz,
            order: campaign.in_order(),
            about: self_description::of_run(&begin.run, &manifest),
        };
        let mut writer = RunWriter::new(folder.path(), journal, layout, taken)?;
        writer.note(&JournalEntry::Begin(Box::new(begin)))?;
        withdrawn.into_iter().try_for_each(|result| writer.note(&JournalEntry::Withdrawn(result)))?;
        manifest.note(campaign, writer.state(), writer.rows());
        folder.write_manifest(&manifest)?;
        let taken = writer.state().clone();
        let recorder = Recorder::start(writer, waits_for_room);
        Ok(Self { recorder, campaign, folder, manifest, taken, wall: Instant::now() })
    }

    /// The sum of the journal at the start.
    #[must_use]
    pub fn taken(&self) -> &JournalState {
        &self.taken
    }

    /// Joins the samples, draws the figures, writes page and manifest. `None` if the recorder's thread has stopped: the run is
    /// incomplete.
    pub fn end(self, mut tally: Tally, result: Result<(), RunError>) -> Option<EndedRun> {
        let accepted = self.recorder.accepted_rows();
        let (writer, stored) = self.recorder.finish();
        let mut writer = writer?;
        let closed = stored.and(writer.close());
        let unwritten = writer.unwritten_rows(accepted);
        tally.counters.dropped_rows_host += unwritten;
        tally.counters.lost_rows += unwritten;
        let result = result.and(closed.map_err(RunError::from)).and_then(|()| Ok(writer.join()?));
        let reason = result.as_ref().err().map(ToString::to_string);
        let ended = Ended {
            at: host_time::now_text(),
            reason: reason.clone(),
            counters: tally.counters,
            controller: tally.controller,
            wall_s: self.wall.elapsed().as_secs_f64(),
        };
        let ended = JournalEntry::Ended(ended);
        let noted = writer.note(&ended);
        let mut taken = writer.state().clone();
        if noted.is_err() {
            // Keep the ending in memory although the journal could not be written.
            taken.add(&ended);
        }
        let rows = writer.results();
        let mut manifest = self.manifest;
        manifest.clock = Durations { rig_s: tally.rig_s, wall_s: taken.wall_s() };
        manifest.counters = taken.losses();
        manifest.note(self.campaign, &taken, writer.rows());
        manifest.ending = reason.map_or(RunEnding::Complete, |reason| RunEnding::Incomplete { reason });
        let path = self.folder.path();
        let source = source_of(&RunFolder::with_manifest(path, manifest.clone()).id(), &manifest);
        let write = |picture: Picture, stem: &str| picture.of_source(&source).write(path, stem);
        let has_sines = self.campaign.experiments.iter().any(|e| e.base_driven().is_some());
        let drawn = if has_sines {
            write(figures::response(self.campaign, &rows, None, Breadth::Broad), "figure")
        } else {
            Ok(())
        };
        let surfaces = ForceSurface::of(self.campaign, &rows);
        let drawn = drawn.and_then(|()| match surfaces.is_empty() {
            false => write(force_surface::draw(self.campaign, &surfaces, &[]), "force-surface"),
            true => Ok(()),
        });
        let tracked = TrackedCurve::of(self.campaign, &rows, manifest.is_simulated());
        let drawn = drawn.and_then(|()| match tracked.is_empty() {
            false => resonance_table::write(self.campaign, &tracked, &path.join("resonance.csv"))
                .and_then(|()| write(resonance::draw(self.campaign, &tracked), "resonance")),
            true => Ok(()),
        });
        let drawn = drawn.and_then(|()| match figures::transients(self.campaign, path, taken.transients())? {
            Some(picture) => write(picture, "transients"),
            None => Ok(()),
        });
        let with_samples = RunFolder::with_manifest(path, manifest.clone());
        let drawn = drawn.and_then(|()| match draw_motions(self.campaign, &with_samples, &taken)? {
            Some(picture) => write(picture, "motions"),
            None => Ok(()),
        });
        let page_written = self.folder.write_page(&page(&RunFolder::with_manifest(path, manifest.clone())).html);
        let sums = checksum::of_folder(path);
        manifest.files = sums.clone().unwrap_or_default();
        // What the manifest states is on the disk before it.
        let synced = self.folder.sync(&manifest.files);
        let written =
            noted.and(page_written).and(synced).and(self.folder.write_manifest(&manifest)).and(sums.map(|_| ()));
        Some(EndedRun { manifest, taken, rows, result, written, drawn })
    }
}

/// The run's name and start, as its figures state them.
fn source_of(id: &str, manifest: &Manifest) -> String {
    let started = host_time::parse(&manifest.started);
    let started = started.map_or_else(String::new, |at| at.strftime(" · %Y-%m-%d %H:%M %:z").to_string());
    format!("{id}{started}")
}

/// The manifest of a run that begins.
fn first_manifest(
    campaign: &Campaign,
    predicted: &CampaignPrediction,
    begin: &Begin,
    taken: &JournalState,
) -> Manifest {
    let record = |(set_up, x_m): (&usize, &f64)| {
        let own = predicted.responses.iter().filter(|response| response.set_up == *set_up);
        let in_dwells = own.filter_map(|response| response.dwell_max_x_m).fold(f64::NAN, f64::max);
        SetUpRecord::new(&campaign.set_ups[*set_up], *x_m, in_dwells)
    };
    let started = taken.begun.first().map_or(&begin.at, |first| &first.at);
    let mut manifest = Manifest::begin(campaign, largest_predicted(predicted).iter().map(record).collect(), started);
    manifest.device = Some(begin.device.clone());
    manifest.acting_settings = acting_settings(campaign, begin.device.settings.as_ref());
    manifest.signals = begin.signals.clone();
    manifest
}
