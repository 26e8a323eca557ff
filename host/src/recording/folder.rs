//! Makes the run folder, and keeps its files whole while the run goes on.

use std::fs;
use std::path::{Path, PathBuf};

use super::manifest::Manifest;
use super::parquet::{Point, SampleFile, write_results};
use super::{ResultRow, Signal, StorageError};

/// A run being recorded.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    rows: Vec<ResultRow>,
    samples: Option<SampleFile>,
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
        Ok(Self { path, rows: Vec::new(), samples: None })
    }

    /// Just the folder asked for; it may exist when it is empty.
    ///
    /// # Errors
    /// When it holds anything, or cannot be made.
    pub fn create_at(path: &Path) -> Result<Self, StorageError> {
        match fs::read_dir(path) {
            Ok(mut entries) => {
                if entries.next().is_some() {
                    let message = "it is not empty; give --out a new folder, so that no earlier run is lost";
                    return Err(StorageError::new("use the folder", path, message));
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                fs::create_dir_all(path).map_err(|e| StorageError::new("create the folder", path, e))?;
            }
            Err(error) => return Err(StorageError::new("use the folder", path, error)),
        }
        Ok(Self { path: path.to_path_buf(), rows: Vec::new(), samples: None })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The results so far.
    #[must_use]
    pub fn rows(&self) -> &[ResultRow] {
        &self.rows
    }

    /// Samples recorded so far, rows.
    #[must_use]
    pub fn sample_rows(&self) -> u64 {
        self.samples.as_ref().map_or(0, SampleFile::rows)
    }

    /// Copies the campaign as run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_campaign(&self, text: &str) -> Result<(), StorageError> {
        let path = self.path.join("campaign.toml");
        fs::write(&path, text).map_err(|e| StorageError::new("write", &path, e))
    }

    /// Writes the manifest whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; an earlier one stays.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), StorageError> {
        let path = self.path.join("manifest.json");
        let beside = self.path.join("manifest.json.tmp");
        let text = serde_json::to_string_pretty(manifest).map_err(|e| StorageError::new("write", &path, e))?;
        fs::write(&beside, text + "\n").map_err(|e| StorageError::new("write", &path, e))?;
        fs::rename(&beside, &path).map_err(|e| StorageError::new("write", &path, e))
    }

    /// Begins recording these signals.
    ///
    /// # Errors
    /// When the samples cannot be begun.
    pub fn record(&mut self, signals: &[Signal]) -> Result<(), StorageError> {
        self.samples = Some(SampleFile::create(&self.path, signals)?);
        Ok(())
    }

    /// Adds one tick's signal values.
    ///
    /// # Errors
    /// When a full part cannot be written.
    pub fn push_sample(
        &mut self,
        point: Point,
        tick: u64,
        t_s: f64,
        values: impl Iterator<Item = f32>,
    ) -> Result<(), StorageError> {
        match &mut self.samples {
            Some(samples) => samples.push(point, tick, t_s, values),
            None => Ok(()),
        }
    }

    /// Adds a result: it and the samples up to it are on the disk when this returns.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn push_result(&mut self, row: ResultRow) -> Result<(), StorageError> {
        self.rows.push(row);
        write_results(&self.path.join("results.parquet"), &self.rows)?;
        self.samples.as_mut().map_or(Ok(()), SampleFile::flush)
    }

    /// Joins the samples into one file. The run is over, well or not.
    ///
    /// # Errors
    /// When they cannot be joined; they stay in parts then, and can be read as they are.
    pub fn close(&mut self) -> Result<(), StorageError> {
        self.samples.take().map_or(Ok(()), |mut samples| samples.close())
    }
}
