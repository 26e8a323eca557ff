//! What a run folder says about going on with it: what is taken, and whether campaign and device are still the same.

use std::path::Path;

use crate::campaign::Campaign;
use crate::input::Source;
use crate::recording::checksum;
use crate::recording::journal::{self, Begin, Lines};
use crate::recording::known;
use crate::recording::taken::Taken;
use crate::runs::folder::manifest_of;
use crate::settings;

/// Why a run cannot be taken up again. The text names what is wrong, what is still good, and what can be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct CannotResume(pub String);

/// A run that was begun before.
#[derive(Debug)]
pub struct Earlier {
    /// The campaign as run.
    pub campaign: Campaign,
    /// What the journal adds up to.
    pub taken: Taken,
    /// What is not as it should be, and does not keep the run from going on.
    pub warnings: Vec<String>,
}

impl Earlier {
    /// Reads a run folder. Nothing is written.
    ///
    /// # Errors
    /// A folder without journal, a campaign that is missing, damaged or not the one that the run was begun with.
    pub fn read(folder: &Path) -> Result<Self, CannotResume> {
        let shown = folder.display();
        let has = |name: &str| folder.join(name).exists();
        let lines = match journal::read(folder) {
            Ok(lines) => lines,
            Err(_) if !has(journal::JOURNAL) && !has("manifest.json") && has("campaign.toml") => Lines::default(),
            Err(_) if !has(journal::JOURNAL) => {
                let message = format!(
                    "{shown} has no {}: it was recorded by an earlier version, or is no run\n  `damprig runs verify {shown}` says what of it can be read; to measure again, run its campaign.toml anew",
                    journal::JOURNAL
                );
                return Err(CannotResume(message));
            }
            Err(error) => return Err(CannotResume(error.to_string())),
        };
        let taken = Taken::of(&lines.entries);
        let source = Source::read(&folder.join("campaign.toml")).map_err(|e| {
            CannotResume(format!("{e}\n  the campaign as run stands in the first line of {shown}/{}", journal::JOURNAL))
        })?;
        if let Some(begin) = taken.begun.first() {
            let different = campaign_differences(&begin.campaign, source.text());
            if !different.is_empty() {
                let list = different.join("\n  ");
                let message = format!(
                    "{shown}/campaign.toml is not the campaign that the run was begun with:\n  {list}\n  put it back (the first line of {} holds it), or run the changed one anew",
                    journal::JOURNAL
                );
                return Err(CannotResume(message));
            }
        } else if !lines.entries.is_empty() || !lines.damaged.is_empty() {
            let message =
                format!("{shown}/{}: its first line is damaged: nobody can tell what it was", journal::JOURNAL);
            return Err(CannotResume(message));
        }
        let campaign = Campaign::parse(source.recorded()).map_err(|e| CannotResume(e.to_string()))?;
        is_one_run(folder, &campaign, &taken)?;
        let mut warnings: Vec<String> = Vec::new();
        if !lines.damaged.is_empty() {
            let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
            let name = journal::JOURNAL;
            warnings.push(format!("{name}: line {} cannot be read; what it held is measured again", list.join(", ")));
        }
        warnings.extend(damaged_parts(folder, &taken));
        let unknown = known::unknown(folder, &taken, taken.points() >= campaign.points());
        if !unknown.data.is_empty() {
            return Err(CannotResume(not_in_the_journal(folder, &unknown.data, &taken)));
        }
        warnings
            .extend(unknown.unreadable.iter().map(|name| format!("{name}: not a word of it can be read; left there")));
        Ok(Self { campaign, taken, warnings })
    }

    /// What differs between how the run was begun and how it would go on, one difference a line.
    #[must_use]
    pub fn differences(&self, now: &Begin) -> Vec<String> {
        let Some(then) = self.taken.begun.first() else { return Vec::new() };
        let (a, b) = (&then.device, &now.device);
        let mut list = Vec::new();
        let mut compare = |what: &str, then: String, now: String| {
            if then != now {
                list.push(format!("{what}: {then} when it was begun, {now} now"));
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
        // Limits change no result that was taken within them: see `changed_limits`.
        if let (Some(then), Some(now)) = (&a.settings, &b.settings) {
            list.extend(settings::differences(&then.settings, &now.settings, |place| !is_limit(place)));
        }
        list
    }

    /// The board's limits that have changed since the run was begun, one a line.
    #[must_use]
    pub fn changed_limits(&self, now: &Begin) -> Vec<String> {
        let then = self.taken.begun.last().and_then(|then| then.device.settings.as_ref());
        let (Some(then), Some(now)) = (then, &now.device.settings) else { return Vec::new() };
        settings::differences(&then.settings, &now.settings, is_limit)
    }

    /// Whether every point is taken.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.taken.points() >= self.campaign.points()
    }

    /// What will be done, one line a thing.
    #[must_use]
    pub fn intentions(&self) -> Vec<String> {
        let mut list =
            vec![format!("{} of {} points are kept as they are", self.taken.points(), self.campaign.points())];
        for (index, set_up) in self.campaign.set_ups.iter().enumerate() {
            for experiment in self.campaign.experiments.iter().filter(|e| e.set_ups.contains(&index)) {
                let points = experiment.points();
                let missing = self.taken.missing(&set_up.name, &experiment.name, points);
                let begun = self.taken.next_segment(&set_up.name, &experiment.name) > 0;
                let Some(first) = missing.first().map(|range| range.start).filter(|_| begun) else { continue };
                let place = format!("set-up {:?}, {:?}", set_up.name, experiment.name);
                let frequency_hz = experiment.frequency_hz(first);
                list.push(if experiment.stepped_sine().is_none() {
                    format!("{place} is repeated; what was begun of it stays in the samples")
                } else if experiment.carries_over() {
                    format!(
                        "{place} begins anew: the motion at {frequency_hz} Hz cannot be carried over; its points so far stay in the journal and count no more"
                    )
                } else {
                    format!("{place} goes on at {frequency_hz} Hz, from rest; what was begun of that point stays in the samples")
                });
            }
        }
        list
    }
}

/// Whether a setting is one of the board's limits.
fn is_limit(place: &[String]) -> bool {
    place.first().is_some_and(|table| table == "safety")
}

/// Whether manifest and journal are of one run, in a format that this program writes. A manifest that is missing is made
/// anew: it follows from the journal.
fn is_one_run(folder: &Path, campaign: &Campaign, taken: &Taken) -> Result<(), CannotResume> {
    if !folder.join("manifest.json").exists() {
        return Ok(());
    }
    let manifest = manifest_of(folder).map_err(|e| CannotResume(format!("{e}\n  nothing was changed")))?;
    let shown = folder.display();
    let file = format!("{shown}/manifest.json");
    if manifest.campaign != campaign.name {
        let message = format!(
            "{file} is of another run: its campaign is {:?}, that of campaign.toml {:?}\n  put the run's own back, or take it away: it follows from {}",
            manifest.campaign,
            campaign.name,
            journal::JOURNAL
        );
        return Err(CannotResume(message));
    }
    if let Some(begin) = taken.begun.first().filter(|begin| begin.at != manifest.started) {
        let message = format!(
            "{file} is of another run: it was started {}, the run of {} {}\n  put the run's own back, or take it away: it follows from {}",
            manifest.started,
            journal::JOURNAL,
            begin.at,
            journal::JOURNAL
        );
        return Err(CannotResume(message));
    }
    let known = taken.points() + taken.superseded().len();
    if manifest.points_taken > known {
        let points = format!("manifest.json: {} points taken", manifest.points_taken);
        return Err(CannotResume(not_in_the_journal(folder, &[points], taken)));
    }
    Ok(())
}

/// What to say of a folder that holds more than its journal knows.
fn not_in_the_journal(folder: &Path, data: &[String], taken: &Taken) -> String {
    let (shown, name) = (folder.display(), journal::JOURNAL);
    let more = if data.len() > 8 { format!("\n  and {} more", data.len() - 8) } else { String::new() };
    let list = data.iter().take(8).map(String::as_str).collect::<Vec<_>>().join("\n  ");
    format!(
        "{shown} holds what its {name} ({} points) does not know:\n  {list}{more}\n  {name} was cut or replaced, or these are files of another run; going on would write over them, so nothing was changed\n  all files can still be read (`damprig runs verify {shown}` tells which): keep this folder and begin a new run with `damprig run {shown}/campaign.toml`,\n  or, if the files are not of this run, move them elsewhere and resume again",
        taken.points()
    )
}

/// Closed parts of the samples that are not as the journal says.
fn damaged_parts(folder: &Path, taken: &Taken) -> Vec<String> {
    if taken.joined.is_some() {
        return Vec::new();
    }
    let damaged = taken.sealed.iter().filter_map(|sealed| {
        let name = &sealed.file.name;
        match checksum::of_file(folder, name) {
            Ok(now) if now == sealed.file => None,
            Ok(_) => Some(format!("{name}: changed since it was closed (SHA-256 differs); the results do not need it")),
            Err(error) => Some(format!("{name}: {error}; {} rows of samples are lost", sealed.rows)),
        }
    });
    damaged.collect()
}

/// The values in which two campaigns differ, one a line; their comments and their layout do not count.
pub(crate) fn campaign_differences(then: &str, now: &str) -> Vec<String> {
    let mut list = Vec::new();
    match (toml::from_str::<toml::Table>(then), toml::from_str::<toml::Table>(now)) {
        (Ok(then), Ok(now)) => differ("", &toml::Value::Table(then), &toml::Value::Table(now), &mut list),
        _ if then != now => list.push("it is no TOML any more".into()),
        _ => {}
    }
    list
}

fn differ(place: &str, then: &toml::Value, now: &toml::Value, list: &mut Vec<String>) {
    use toml::Value::{Array, Table};
    match (then, now) {
        (Table(a), Table(b)) => {
            let keys = a.keys().chain(b.keys().filter(|k| !a.contains_key(*k)));
            for key in keys {
                let inner = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
                match (a.get(key), b.get(key)) {
                    (Some(a), Some(b)) => differ(&inner, a, b, list),
                    (Some(a), None) => list.push(format!("{inner}: {a} when it was begun, absent now")),
                    (None, Some(b)) => list.push(format!("{inner}: absent when it was begun, {b} now")),
                    (None, None) => {}
                }
            }
        }
        (Array(a), Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(n, (a, b))| differ(&format!("{place}[{}]", n + 1), a, b, list));
        }
        _ if then != now => list.push(format!("{place}: {then} when it was begun, {now} now")),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_of_two_campaigns_is_named_and_comments_are_none() {
        let then = "a = 1\n[rig]\nseed = 7\n[[set_up]]\nz = 0.1\n[[set_up]]\nz = 0.2\n";
        assert!(campaign_differences(then, &format!("# later\n{then}")).is_empty());
        let now = "a = 1\nb = 2\n[rig]\n[[set_up]]\nz = 0.1\n[[set_up]]\nz = 0.3\n";
        let expected = [
            "rig.seed: 7 when it was begun, absent now",
            "set_up[2].z: 0.2 when it was begun, 0.3 now",
            "b: absent when it was begun, 2 now",
        ];
        assert_eq!(campaign_differences(then, now), expected);
        assert_eq!(campaign_differences(then, "a = ").len(), 1);
    }
}
