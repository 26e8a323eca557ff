//! Creates a run folder, or opens one to resume its run, and writes its text files.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::campaign::Campaign;
use crate::campaign::transient::{NOISE_FILE, Origin, RECORDS, kept_record};
use crate::failure::Failure;
use crate::input::regular;
use crate::run_folder::checksum::{self, FileRecord};
use crate::run_folder::journal::{CopiedFile, JOURNAL, Journal};
use crate::run_folder::own_files;
use crate::run_folder::schema::manifest::{MANIFEST, Manifest};
use crate::setup::set_up_file::kept;

/// The report page of a run folder.
pub const PAGE: &str = "report.html";

/// Whether nothing is recorded in a folder: it is empty, or holds what a program leaves that is killed before it has copied the
/// campaign: an empty journal, and copies of the records.
///
/// # Errors
/// When it cannot be listed.
pub fn is_unused(folder: &Path) -> io::Result<bool> {
    let names = fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>()?;
    let has_empty_journal =
        fs::symlink_metadata(folder.join(JOURNAL)).is_ok_and(|file| file.is_file() && file.len() == 0);
    let is_left = |name: &OsString| [JOURNAL, RECORDS, "campaign.toml.tmp"].iter().any(|left| name == left);
    Ok(names.is_empty() || has_empty_journal && names.iter().all(is_left))
}

/// A run folder open for writing.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// `runs/<date>-<campaign>-<short id>` below `base`, newly created.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn create_dated(base: &Path, campaign: &str, now: &jiff::Zoned) -> Result<Self, Failure> {
        const LETTERS: &[u8] = b"abcdefghijkmnpqrstuvwxyz23456789";
        let id: String = (0..4).map(|_| char::from(LETTERS[fastrand::usize(..LETTERS.len())])).collect();
        let path = base.join("runs").join(format!("{}-{campaign}-{id}", now.strftime("%Y%m%d-%H%M%S")));
        fs::create_dir_all(&path).map_err(|e| Failure::cannot("create the run folder", &path, e))?;
        Ok(Self { path })
    }

    /// The folder `path`; it may exist when it is unused ([`is_unused`]).
    ///
    /// # Errors
    /// When it is not empty, or cannot be created.
    pub fn create_at(path: &Path) -> Result<Self, Failure> {
        match is_unused(path) {
            Ok(true) => {}
            Ok(false) => {
                let message = "it is not empty; give --out a new folder, or continue the run in it with --resume";
                return Err(Failure::cannot("use the folder", path, message));
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                fs::create_dir_all(path).map_err(|e| Failure::cannot("create the folder", path, e))?;
            }
            Err(error) => return Err(Failure::cannot("use the folder", path, error)),
        }
        Ok(Self { path: path.to_path_buf() })
    }

    /// Locks the folder for this program, and checks that no other program has written to it since it was created.
    ///
    /// # Errors
    /// When another program is recording into it, or has recorded into it.
    pub fn claim(&self) -> Result<Journal, Failure> {
        let journal = Journal::open(&self.path)?;
        if is_unused(&self.path).map_err(|e| Failure::cannot("use the folder", &self.path, e))? {
            return Ok(journal);
        }
        let message = "another damprig has just started to record into it; give --out a new folder";
        Err(Failure::cannot("use the folder", &self.path, message))
    }

    /// A folder that holds a run.
    #[must_use]
    pub fn existing(path: &Path) -> Self {
        Self { path: path.to_path_buf() }
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Claims the folder and copies the campaign with all that it names.
    ///
    /// # Errors
    /// As [`OutputFolder::claim`]; a file that cannot be copied or written.
    pub fn keep_campaign(&self, campaign: &Campaign) -> Result<Journal, Failure> {
        let journal = self.claim()?;
        // A folder with a campaign can be resumed, so it has the records by then.
        self.keep_records(campaign)?;
        self.keep_set_up_file(campaign)?;
        self.write_campaign(campaign.source.text())?;
        self.sync_own_name();
        Ok(journal)
    }

    /// Copies the campaign as run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_campaign(&self, text: &str) -> Result<(), Failure> {
        self.write("campaign.toml", text)
    }

    /// Copies the motion records that the campaign plays, so that the run can be resumed wherever the folder is, and writes the noise
    /// that it plays.
    ///
    /// # Errors
    /// When one cannot be copied or written.
    pub fn keep_records(&self, campaign: &Campaign) -> Result<(), Failure> {
        // The repeats of an experiment play the same record.
        for experiment in campaign.experiments.iter().filter(|e| e.repeat == 0) {
            let Some(playback) = experiment.playback() else { continue };
            let Some(to) = self.record_of(experiment.number, &playback.origin) else { continue };
            let bytes = match &playback.origin {
                Origin::File(file) => regular::read(file).map_err(|e| Failure::cannot("copy the record to", &to, e))?,
                Origin::Noise | Origin::Shape => playback.csv().into_bytes(),
            };
            self.keep(&to, &bytes)?;
        }
        Ok(())
    }

    /// Where a new folder keeps the motion of an experiment; none of a pulse.
    fn record_of(&self, number: usize, origin: &Origin) -> Option<PathBuf> {
        match origin {
            Origin::File(file) => Some(kept_record(&self.path, number, file)),
            Origin::Noise => Some(kept_record(&self.path, number, Path::new(NOISE_FILE))),
            Origin::Shape => None,
        }
    }

    fn keep(&self, to: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let copies = self.path.join(RECORDS);
        fs::create_dir_all(&copies).map_err(|e| Failure::cannot("create the folder", &copies, e))?;
        own_files::sync_folder(&self.path).map_err(|e| Failure::cannot("write", &self.path, e))?;
        own_files::replace(to, bytes)
    }

    /// Copies the campaign's set-up file, so that the run can be resumed and reported wherever the folder is.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_set_up_file(&self, campaign: &Campaign) -> Result<(), Failure> {
        let Some(file) = &campaign.set_up_file else { return Ok(()) };
        self.keep(&kept(&self.path.join(RECORDS), &file.file), file.text.as_bytes())
    }

    /// The kept motion records and set-up file of a campaign as they are now.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn records(&self, campaign: &Campaign) -> Result<Vec<CopiedFile>, Failure> {
        let kept: BTreeMap<PathBuf, usize> = match campaign.source.copies().filter(|_| campaign.source.is_recorded()) {
            Some(copies) => copies.records.iter().map(|(number, path)| (path.clone(), *number)).collect(),
            None => {
                let played = campaign.experiments.iter().filter_map(|e| Some((e.number, &e.playback()?.origin)));
                played.filter_map(|(number, origin)| Some((self.record_of(number, origin)?, number))).collect()
            }
        };
        let mut all = checksum::of_folder(&self.path)?;
        all.retain(|file| file.name.starts_with(&format!("{RECORDS}/")));
        let copied = |file: FileRecord| CopiedFile { experiment: kept.get(&self.path.join(&file.name)).copied(), file };
        Ok(all.into_iter().map(copied).collect())
    }

    /// Writes the manifest whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), Failure> {
        let text = manifest.to_text().map_err(|e| Failure::cannot("write", &self.path.join(MANIFEST), e))?;
        self.write(MANIFEST, &text)
    }

    /// Writes the report page whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_page(&self, page: &str) -> Result<(), Failure> {
        self.write(PAGE, page)
    }

    /// Syncs files of the folder to the disk.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn sync(&self, files: &[FileRecord]) -> Result<(), Failure> {
        files.iter().map(|file| self.path.join(&file.name)).try_for_each(|path| {
            let synced = fs::File::open(&path).and_then(|file| file.sync_data());
            synced.map_err(|e| Failure::cannot("write", &path, e))
        })?;
        own_files::sync_folder(&self.path).map_err(|e| Failure::cannot("write", &self.path, e))
    }

    /// Syncs the names of the folder and of the one that it is in to the disk; those above may be of others.
    fn sync_own_name(&self) {
        if let Ok(path) = fs::canonicalize(&self.path) {
            path.ancestors().skip(1).take(2).for_each(|above| drop(own_files::sync_folder(above)));
        }
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        own_files::replace(&self.path.join(name), text.as_bytes())
    }
}
