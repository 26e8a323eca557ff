//! Creates a run folder, or opens one to resume its run, and writes its text files.

use std::fs;
use std::path::{Path, PathBuf};

use crate::campaign::Campaign;
use crate::campaign::transient::{Origin, RECORDS, kept_record};
use crate::run_folder::checksum::{self, FileRecord};
use crate::run_folder::journal::{JOURNAL, Journal};
use crate::run_folder::schema::manifest::{MANIFEST, Manifest};
use crate::run_folder::{StorageError, own_files};
use crate::setup::set_up_file::kept;

/// The report page of a run folder.
pub const PAGE: &str = "report.html";

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
    pub fn create_dated(base: &Path, campaign: &str, now: &jiff::Zoned) -> Result<Self, StorageError> {
        const LETTERS: &[u8] = b"abcdefghijkmnpqrstuvwxyz23456789";
        let id: String = (0..4).map(|_| char::from(LETTERS[fastrand::usize(..LETTERS.len())])).collect();
        let path = base.join("runs").join(format!("{}-{campaign}-{id}", now.strftime("%Y%m%d-%H%M%S")));
        fs::create_dir_all(&path).map_err(|e| StorageError::new("create the run folder", &path, e))?;
        Ok(Self { path })
    }

    /// The folder `path`; it may exist when it is empty.
    ///
    /// # Errors
    /// When it is not empty, or cannot be created.
    pub fn create_at(path: &Path) -> Result<Self, StorageError> {
        match fs::read_dir(path) {
            Ok(mut entries) => {
                if entries.next().is_some() {
                    let message = "it is not empty; give --out a new folder, or continue the run in it with --resume";
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

    /// Locks the folder for this program, and checks that no other program has written to it since it was created.
    ///
    /// # Errors
    /// When another program is recording into it, or has recorded into it.
    pub fn claim(&self) -> Result<Journal, StorageError> {
        let journal = Journal::open(&self.path)?;
        let mut entries = fs::read_dir(&self.path).map_err(|e| StorageError::new("use the folder", &self.path, e))?;
        let is_alone = entries.all(|entry| entry.is_ok_and(|entry| entry.file_name() == JOURNAL));
        if is_alone && journal.is_empty() {
            return Ok(journal);
        }
        let message = "another damprig has just started to record into it; give --out a new folder";
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

    /// Claims the folder and copies the campaign with all that it names.
    ///
    /// # Errors
    /// As [`OutputFolder::claim`]; a file that cannot be copied or written.
    pub fn keep_campaign(&self, campaign: &Campaign) -> Result<Journal, StorageError> {
        let journal = self.claim()?;
        // A folder with a campaign can be resumed, so it has the records by then.
        self.keep_records(campaign)?;
        self.keep_set_up_file(campaign)?;
        self.write_campaign(campaign.source.text())?;
        Ok(journal)
    }

    /// Copies the campaign as run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_campaign(&self, text: &str) -> Result<(), StorageError> {
        self.write("campaign.toml", text)
    }

    /// Copies the motion records that the campaign plays, so that the run can be resumed wherever the folder is, and writes the noise
    /// that it plays.
    ///
    /// # Errors
    /// When one cannot be copied or written.
    pub fn keep_records(&self, campaign: &Campaign) -> Result<(), StorageError> {
        for (index, experiment) in campaign.experiments.iter().enumerate() {
            let Some(playback) = experiment.playback() else { continue };
            let copies = self.path.join(RECORDS);
            let make = || fs::create_dir_all(&copies).map_err(|e| StorageError::new("create the folder", &copies, e));
            match &playback.origin {
                Origin::File(file) => {
                    make()?;
                    let to = kept_record(&self.path, index, file);
                    fs::copy(file, &to).map_err(|e| StorageError::new("copy the record to", &to, e))?;
                }
                Origin::Noise => {
                    make()?;
                    let to = kept_record(&self.path, index, Path::new("noise.csv"));
                    own_files::replace(&to, playback.csv().as_bytes())?;
                }
                Origin::Shape => {}
            }
        }
        Ok(())
    }

    /// Copies the campaign's set-up file, so that the run can be resumed and reported wherever the folder is.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_set_up_file(&self, campaign: &Campaign) -> Result<(), StorageError> {
        let Some(file) = &campaign.set_up_file else { return Ok(()) };
        let copies = self.path.join(RECORDS);
        fs::create_dir_all(&copies).map_err(|e| StorageError::new("create the folder", &copies, e))?;
        own_files::replace(&kept(&copies, &file.file), file.text.as_bytes())
    }

    /// The kept motion records and set-up file as they are now.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn records(&self) -> Result<Vec<FileRecord>, StorageError> {
        let mut all = checksum::of_folder(&self.path)?;
        all.retain(|file| file.name.starts_with(&format!("{RECORDS}/")));
        Ok(all)
    }

    /// Writes the manifest whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), StorageError> {
        let text = manifest.to_text().map_err(|e| StorageError::new("write", &self.path.join(MANIFEST), e))?;
        self.write(MANIFEST, &text)
    }

    /// Writes the report page whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_page(&self, page: &str) -> Result<(), StorageError> {
        self.write(PAGE, page)
    }

    fn write(&self, name: &str, text: &str) -> Result<(), StorageError> {
        own_files::replace(&self.path.join(name), text.as_bytes())
    }
}
