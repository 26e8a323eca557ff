//! Reads a run folder to resume its run: what is taken, and whether campaign and device are unchanged.

use std::path::Path;

use crate::campaign::{Campaign, differences};
use crate::failure::Failure;
use crate::input::Source;
use crate::run_folder::checksum;
use crate::run_folder::journal::{self, Begin, JournalEntry, JournalLines, Withdrawn};
use crate::run_folder::own_files::refuse_links;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::read::cut_results::cut_off;
use crate::run_folder::read::folder::manifest_of;
use crate::run_folder::read::open_part::read_stream;
use crate::run_folder::read::sample_files::{lost_open_parts, open_parts};
use crate::run_folder::read::untracked_files::untracked;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::samples::damaged_part_name;
use crate::run_folder::write::output_folder::is_unused;
use crate::settings;

/// A run to resume.
#[derive(Debug)]
pub struct EarlierRun {
    /// The campaign as run.
    pub campaign: Campaign,
    /// The sum of the journal, less the results that are withdrawn.
    pub journal: JournalState,
    /// Results whose samples were lost: their points are measured again.
    pub withdrawn: Vec<Withdrawn>,
    /// Damage that does not prevent the run from being resumed.
    pub warnings: Vec<String>,
}

impl EarlierRun {
    /// Reads a run folder. Nothing is written.
    ///
    /// # Errors
    /// A folder without journal; a campaign that is missing, damaged, or differs from the one that the run was started with.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let shown = folder.display();
        let has = |name: &str| folder.join(name).exists();
        refuse_links(folder)?;
        let lines = match journal::read(folder) {
            Ok(lines) => lines,
            Err(_) if !has(journal::JOURNAL) && !has("manifest.json") && has("campaign.toml") => {
                JournalLines::default()
            }
            Err(_) if !has(journal::JOURNAL) => {
                let message = format!(
                    "{shown} has no {}: it was recorded by an earlier version, or is not a run\n  `damprig runs verify {shown}` shows what can be read; to measure again, run its campaign.toml as a new run",
                    journal::JOURNAL
                );
                return Err(Failure::Input(message));
            }
            Err(error) => return Err(Failure::input(error)),
        };
        let mut taken = JournalState::of(&lines.entries);
        if is_unused(folder).unwrap_or(false) {
            let message =
                "the run was killed before anything was recorded in it; start it with `damprig run CAMPAIGN --out";
            return Err(Failure::Input(format!("{shown}: {message} {shown}`")));
        }
        let mut warnings: Vec<String> = Vec::new();
        let source = Source::read(&folder.join("campaign.toml")).map_err(|e| {
            Failure::Input(format!("{e}\n  the first line of {shown}/{} holds the campaign as run", journal::JOURNAL))
        })?;
        if let Some(begin) = taken.begun.first() {
            let different = differences(&begin.campaign, source.text());
            if !different.is_empty() {
                let list = different.join("\n  ");
                let message = format!(
                    "{shown}/campaign.toml is not the campaign that the run was started with:\n  {list}\n  put it back (the first line of {} holds it), or start a new run with the changed one",
                    journal::JOURNAL
                );
                return Err(Failure::Input(message));
            }
            if taken.begun.iter().all(|begin| begin.campaign != source.text()) {
                warnings.push("campaign.toml: remarks or layout have changed; the journal keeps both texts".into());
            }
        } else if !lines.entries.is_empty() || !lines.damaged.is_empty() {
            let message = format!(
                "{shown}/{}: its first line is damaged, so campaign and device cannot be compared",
                journal::JOURNAL
            );
            return Err(Failure::Input(message));
        }
        let records = taken.begun.first().map_or(&[][..], |begin| &begin.records);
        let changed: Vec<String> = records.iter().filter_map(|copy| copy.file.difference(folder)).collect();
        if !changed.is_empty() {
            let message = format!(
                "{shown}: the motion records are not those that the run was started with:\n  {}\n  put them back, or start a new run with the changed ones; nothing was changed",
                changed.join("\n  ")
            );
            return Err(Failure::Input(message));
        }
        let campaign = campaign_copy::campaign(folder)?;
        check_manifest(folder, &campaign, &taken)?;
        let unplanned = taken.unplanned(&campaign);
        if !unplanned.is_empty() {
            let message = format!(
                "{shown}/{} lists results that the campaign does not have:\n  {}\n  it was changed, or lines of another run are in it; the data can be read (`damprig runs verify {shown}`); nothing was changed",
                journal::JOURNAL,
                unplanned.join("\n  ")
            );
            return Err(Failure::Input(message));
        }
        if let Some(changed) = taken.joined.iter().find_map(|joined| joined.file.as_ref()?.difference(folder)) {
            let message = format!(
                "{shown}/{changed}\n  put the joined samples back as they were; the results are not affected (`damprig runs verify {shown}`); nothing was changed"
            );
            return Err(Failure::Input(message));
        }
        if !lines.damaged.is_empty() {
            let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
            let name = journal::JOURNAL;
            warnings
                .push(format!("{name}: line {} cannot be read; the points in it are measured again", list.join(", ")));
        }
        warnings.extend(damaged_parts(folder, &taken));
        let untracked = untracked(folder, &taken, taken.points() >= taken.planned(&campaign).points);
        if !untracked.is_empty() {
            return Err(Failure::Input(untracked_message(folder, &untracked, &taken)));
        }
        let lost = lost_open_parts(folder, &taken).into_iter();
        warnings.extend(lost.map(|name| format!("{name}: missing; its rows are lost")));
        for (part, path) in open_parts(folder) {
            let stream = read_stream(&path)?;
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let aside = if stream.has_damage() {
                format!("; its sound rows are used, and the file is kept aside as {}", damaged_part_name(part))
            } else {
                String::new()
            };
            warnings.extend(stream.problem.map(|problem| format!("{name}: {problem}{aside}")));
        }
        let withdrawn = cut_off(folder, &taken);
        for cut in &withdrawn {
            taken.add(&JournalEntry::Withdrawn(cut.clone()));
            warnings.push(withdrawal(&campaign, cut));
        }
        Ok(Self { campaign, journal: taken, withdrawn, warnings })
    }

    /// Differences between the device at the start of the run and now, one a line.
    #[must_use]
    pub fn differences(&self, now: &Begin) -> Vec<String> {
        let Some(then) = self.journal.begun.first() else { return Vec::new() };
        let (a, b) = (&then.device, &now.device);
        let mut list = Vec::new();
        let mut compare = |what: &str, then: String, now: String| {
            if then != now {
                list.push(format!("{what}: {then} when it was started, {now} now"));
            }
        };
        compare("board", a.board.clone(), b.board.clone());
        compare("firmware", a.firmware.clone(), b.firmware.clone());
        compare("plant", a.plant.clone(), b.plant.clone());
        compare("clock", a.clock.clone(), b.clock.clone());
        compare("tick rate (Hz)", a.tick_hz.to_string(), b.tick_hz.to_string());
        compare("protocol version", a.protocol_version.to_string(), b.protocol_version.to_string());
        compare("protocol schema", a.protocol_schema.clone(), b.protocol_schema.clone());
        let names = |begin: &Begin| {
            begin.signals.iter().map(|s| format!("{} ({})", s.name, s.unit)).collect::<Vec<_>>().join(", ")
        };
        compare("signals", names(then), names(now));
        compare("ticks between rows", then.every_ticks.to_string(), now.every_ticks.to_string());
        // Limits do not change a result that was taken within them: see `changed_limits`.
        if let (Some(then), Some(now)) = (&a.settings, &b.settings) {
            list.extend(settings::differences(&then.settings, &now.settings, |place| !is_limit(place)));
        }
        list
    }

    /// The board's limits that have changed since the run was last started, one a line.
    #[must_use]
    pub fn changed_limits(&self, now: &Begin) -> Vec<String> {
        let then = self.journal.begun.last().and_then(|then| then.device.settings.as_ref());
        let (Some(then), Some(now)) = (then, &now.device.settings) else { return Vec::new() };
        settings::differences(&then.settings, &now.settings, is_limit)
    }

    /// Whether every point is taken.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.journal.points() >= self.journal.planned(&self.campaign).points
    }

    /// What resuming will do, one line a step.
    #[must_use]
    pub fn intentions(&self) -> Vec<String> {
        let planned = self.journal.planned(&self.campaign).points;
        let mut list = vec![format!("{} of {planned} points are kept as they are", self.journal.points())];
        for (set_up, own) in &self.campaign.run_order {
            let set_up = &self.campaign.set_ups[*set_up];
            for experiment in own.iter().map(|&place| &self.campaign.experiments[place]) {
                let experiment = &*self.journal.known(&set_up.name, experiment);
                let points = experiment.points();
                let missing = self.journal.missing(&set_up.name, &experiment.name, points);
                let begun = self.journal.next_segment(&set_up.name, &experiment.name).segment > 0;
                let Some(first) = missing.first().map(|range| range.start).filter(|_| begun) else { continue };
                let place = format!("set-up {:?}, {:?}", set_up.name, experiment.name);
                let at = experiment.stepped_sine().map_or_else(String::new, |sine| sine.point_in_words(first));
                let around_peak =
                    self.journal.peak(&set_up.name, &experiment.name).map(|p| p.around.frequencies_hz.len());
                let is_around_peak = first + around_peak.unwrap_or(0) >= experiment.known_points();
                list.push(if first >= experiment.known_points() {
                    format!("{place} continues with the points around its peak")
                } else if experiment.stepped_sine().is_none() {
                    format!("{place} is repeated; the samples of its interrupted start are kept")
                } else if experiment.carries_over() && is_around_peak {
                    format!(
                        "{place}: the sweep around its peak starts from its beginning; its points so far stay in the journal and are superseded"
                    )
                } else if experiment.carries_over() {
                    format!(
                        "{place} starts from its beginning: the motion at {at} cannot be carried over; its points so far stay in the journal and are superseded"
                    )
                } else {
                    format!("{place} continues at {at}, from rest; the samples of that point's interrupted start are kept")
                });
            }
        }
        list
    }
}

/// The result that is withdrawn, and why.
fn withdrawal(campaign: &Campaign, cut: &Withdrawn) -> String {
    let experiment = campaign.experiments.iter().find(|e| e.name == cut.id.experiment);
    let point = experiment.and_then(|e| Some(e.stepped_sine()?.point_in_words(cut.point_index as usize)));
    let at = point.filter(|point| !point.is_empty()).map_or_else(String::new, |point| format!(" at {point}"));
    format!(
        "set-up {:?}, {:?}{at}: the last {} rows of its samples were lost; the point is measured again",
        cut.id.set_up, cut.id.experiment, cut.lost_rows
    )
}

/// Whether a setting is one of the board's limits.
fn is_limit(place: &[String]) -> bool {
    place.first().is_some_and(|table| table == "safety")
}

/// Checks that manifest and journal are of one run, in a format that this program writes. A missing manifest is written
/// again from the journal.
fn check_manifest(folder: &Path, campaign: &Campaign, taken: &JournalState) -> Result<(), Failure> {
    if !folder.join("manifest.json").exists() {
        return Ok(());
    }
    let manifest = manifest_of(folder).map_err(|e| Failure::Input(format!("{e}\n  nothing was changed")))?;
    let shown = folder.display();
    let file = format!("{shown}/manifest.json");
    if manifest.campaign != campaign.name {
        let message = format!(
            "{file} is of another run: its campaign is {:?}, that of campaign.toml {:?}\n  put the run's own manifest back, or remove this one: a new one is made from {}",
            manifest.campaign,
            campaign.name,
            journal::JOURNAL
        );
        return Err(Failure::Input(message));
    }
    if let Some(begin) = taken.begun.first().filter(|begin| begin.at != manifest.started) {
        let message = format!(
            "{file} is of another run: it was started {}, the run of {} {}\n  put the run's own manifest back, or remove this one: a new one is made from {}",
            manifest.started,
            journal::JOURNAL,
            begin.at,
            journal::JOURNAL
        );
        return Err(Failure::Input(message));
    }
    let known = taken.points() + taken.superseded().len() + taken.withdrawn().len();
    if manifest.points_taken > known {
        let points = format!("manifest.json: {} points taken", manifest.points_taken);
        return Err(Failure::Input(untracked_message(folder, &[points], taken)));
    }
    Ok(())
}

/// The message for a folder that holds more than its journal lists.
fn untracked_message(folder: &Path, data: &[String], taken: &JournalState) -> String {
    let (shown, name) = (folder.display(), journal::JOURNAL);
    let more = if data.len() > 8 { format!("\n  and {} more", data.len() - 8) } else { String::new() };
    let list = data.iter().take(8).map(String::as_str).collect::<Vec<_>>().join("\n  ");
    format!(
        "{shown} holds files that its {name} ({} points) does not list:\n  {list}{more}\n  {name} was cut or replaced, or these are files of another run; resuming would overwrite them, so nothing was changed\n  the files can still be read (`damprig runs verify {shown}` shows which): keep this folder and start a new run with `damprig run {shown}/campaign.toml`,\n  or, if the files are not of this run, move them elsewhere and resume again",
        taken.points()
    )
}

/// Closed parts of the samples that are not as the journal says.
fn damaged_parts(folder: &Path, taken: &JournalState) -> Vec<String> {
    if taken.joined.is_some() {
        return Vec::new();
    }
    let damaged = taken.sealed.iter().filter_map(|sealed| {
        let name = &sealed.file.name;
        match checksum::of_file(folder, name) {
            Ok(now) if now == sealed.file => None,
            Ok(_) => {
                Some(format!("{name}: changed since it was closed (SHA-256 differs); the results are not affected"))
            }
            Err(error) => Some(format!("{name}: {error}; {} rows of samples are lost", sealed.rows)),
        }
    });
    damaged.collect()
}
