//! Makes the run folder, or opens one to go on in it, and writes its two texts.

use std::fs;
use std::path::{Path, PathBuf};

use super::StorageError;
use super::journal::{JOURNAL, Journal};
use super::manifest::Manifest;
use crate::campaign::Campaign;
use crate::campaign::transient::{RECORDS, kept_record};

/// The page for people in a run folder; [`crate::report::page`] makes it.
pub const PAGE: &str = "report.html";

/// A run folder that is written.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// `runs/<date>-<campaign>-<short id>` below `base`, made anew.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn create_dated(base: &Path, campaign: &str, now: &jiff::Zoned) -> Result<Self, StorageError> {
        const LETTERS: &[u8] = b"abcdefghijkmnpqrstuvwxyz23456789";
        let id: String = (0..4).map(|_| char::from(LETTERS[fastrand::usize(..LETTERS.len())])).collect();
        let path = base.join("runs").join(format!("{}-{campaign}-{id}", now.strftime("%Y%m%d-%H%M%S")));
        fs::create_dir_all(&path).map_err(|e| StorageError::new("create the run folder", &path, e))?;
        Ok(Self { path })
    }

    /// Just the folder asked for; it may exist when it is empty.
    ///
    /// # Errors
    /// When it holds anything, or cannot be made.
    pub fn create_at(path: &Path) -> Result<Self, StorageError> {
        match fs::read_dir(path) {
            Ok(mut entries) => {
                if entries.next().is_some() {
                    let message = "it is not empty; give --out a new folder, so that no earlier run is lost, or go on with the run in it with --resume";
                    return Err(StorageError::new("use the folder", path, message));
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                fs::create_dir_all(path).map_err(|e| StorageError::new("create the folder", path, e))?;
            }
            Err(error) => return Err(StorageError::new("use the folder", path, error)),
        }
        Ok(Self { path: path.to_path_buf() })
    }

    /// Takes the folder for this program alone, and sees that nobody has been there since it was made.
    ///
    /// # Errors
    /// When another program is recording into it, or has.
    pub fn claim(&self) -> Result<Journal, StorageError> {
        let journal = Journal::open(&self.path)?;
        let mut entries = fs::read_dir(&self.path).map_err(|e| StorageError::new("use the folder", &self.path, e))?;
        let is_alone = entries.all(|entry| entry.is_ok_and(|entry| entry.file_name() == JOURNAL));
        if is_alone && journal.is_empty() {
            return Ok(journal);
        }
        let message = "another damprig has just begun to record into it; give --out a new folder";
        Err(StorageError::new("use the folder", &self.path, message))
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

    /// Copies the campaign as run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_campaign(&self, text: &str) -> Result<(), StorageError> {
        self.write("campaign.toml", text)
    }

    /// Copies the records that the campaign plays, so that the run can be taken up again wherever the folder is.
    ///
    /// # Errors
    /// When one cannot be copied.
    pub fn keep_records(&self, campaign: &Campaign) -> Result<(), StorageError> {
        for (index, experiment) in campaign.experiments.iter().enumerate() {
            let Some(file) = experiment.playback().and_then(|playback| playback.file.as_ref()) else { continue };
            let to = kept_record(&self.path, index, file);
            let failed = |e: std::io::Error| StorageError::new("copy the record to", &to, e);
            fs::create_dir_all(self.path.join(RECORDS)).map_err(failed)?;
            fs::copy(file, &to).map_err(failed)?;
        }
        Ok(())
    }

    /// Writes the manifest whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), StorageError> {
        let text = serde_json::to_string_pretty(manifest)
            .map_err(|e| StorageError::new("write", &self.path.join("manifest.json"), e))?;
        self.write("manifest.json", &(text + "\n"))
    }

    /// Writes the page for people whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_page(&self, page: &str) -> Result<(), StorageError> {
        self.write(PAGE, page)
    }

    /// Writes a text beside its file and gives it its name: the file is there as a whole or not at all.
    fn write(&self, name: &str, text: &str) -> Result<(), StorageError> {
        let path = self.path.join(name);
        let beside = self.path.join(format!("{name}.tmp"));
        let written = fs::write(&beside, text).and_then(|()| fs::rename(&beside, &path));
        written.map_err(|e| {
            let _ = fs::remove_file(&beside);
            StorageError::new("write", &path, e)
        })
    }
}
