//! A run folder that is only read: the one place that knows where its manifest, results and samples are.
//!
//! Samples come as record batches from `samples.parquet`, or while there is no such file from those of
//! `samples.parts/` and from the part that was open when the program ended. The numbers of a run that has not ended come
//! from its journal. Whether the folder is sound is [`super::verify`]'s question.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::RecordBatch;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::manifest::Manifest;
use crate::input::{near, regular};
use crate::recording::journal::{self, JOURNAL};
use crate::recording::manifest::FORMAT;
use crate::recording::parquet::results;
use crate::recording::taken::Taken;
use crate::recording::{part, samples, transients};

/// Why a run cannot be read. The text names the file and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ReadError(pub String);

/// A run folder.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    manifest: Manifest,
}

const OWN_FILES: [&str; 6] =
    ["manifest.json", "campaign.toml", JOURNAL, "results.parquet", "samples.parquet", "samples.parts"];

/// Whether a folder holds anything that a run writes.
#[must_use]
pub fn is_run(path: &Path) -> bool {
    OWN_FILES.iter().any(|name| path.join(name).exists())
}

/// The run folders directly in `base`.
#[must_use]
pub fn below(base: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(base).into_iter().flatten().flatten().map(|e| e.path());
    entries.filter(|p| p.is_dir() && is_run(p)).collect()
}

/// The folder that a person means: a path, or the name of a run (or the end of one) below `runs/`.
///
/// # Errors
/// When there is no such folder, with those that look like it; or when it holds no run.
pub fn find(wanted: &Path) -> Result<PathBuf, ReadError> {
    if wanted.is_dir() {
        return if is_run(wanted) { Ok(wanted.to_path_buf()) } else { Err(no_run(wanted)) };
    }
    if wanted.exists() {
        let message = "it is a file; give the folder of a run, the one that holds manifest.json";
        return Err(ReadError(format!("{}: {message}", wanted.display())));
    }
    let text = wanted.to_string_lossy();
    let name = |p: &PathBuf| p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let all: Vec<PathBuf> = below(Path::new("runs")).into_iter().chain(below(Path::new("."))).collect();
    let ending: Vec<&PathBuf> =
        all.iter().filter(|p| name(p) == text || name(p).ends_with(&format!("-{text}"))).collect();
    match ending[..] {
        [only] => return Ok(only.clone()),
        [] => {}
        _ => {
            let list: Vec<String> = ending.iter().map(|p| p.display().to_string()).collect();
            return Err(ReadError(format!("{text:?} is the end of several runs; give one of {}", list.join(", "))));
        }
    }
    let names: Vec<String> = all.iter().map(name).collect();
    let candidates = near(&text, names.iter().map(String::as_str));
    let help = match candidates[..] {
        [] => "`damprig runs` lists the runs below ./runs".to_string(),
        _ => format!("did you mean {}?", candidates.join(", ")),
    };
    Err(ReadError(format!("there is no run {text:?}, neither as a folder nor below ./runs\n  {help}")))
}

fn no_run(path: &Path) -> ReadError {
    let inside = below(path).into_iter().chain(below(&path.join("runs"))).take(3);
    let inside: Vec<String> = inside.map(|p| p.display().to_string()).collect();
    let help = if inside.is_empty() {
        "a run folder holds manifest.json, campaign.toml and results.parquet".to_string()
    } else {
        format!("it holds runs; give one of them, as {}", inside.join(", "))
    };
    ReadError(format!("{}: this folder is no run\n  {help}", path.display()))
}

impl RunFolder {
    /// Reads the manifest; the tables are read when asked for.
    ///
    /// # Errors
    /// No run, a missing or damaged manifest, or a format of a later version.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        if !is_run(path) {
            return Err(no_run(path));
        }
        let mut manifest = manifest_of(path)?;
        if manifest.status == "running"
            && let Ok(lines) = journal::read(path)
        {
            manifest.is_recording = journal::is_being_written(path);
            // It has not been written since the beginning.
            let taken = Taken::of(&lines.entries);
            manifest.points_taken = taken.points();
            manifest.controller = taken.controller();
            let open = part::open_parts(path).into_iter().filter(|(n, _)| taken.sealed.iter().all(|s| s.part != *n));
            let open_rows = open.filter_map(|(_, file)| part::salvage(&file).ok()).map(|s| s.rows);
            manifest.sample_rows = taken.sealed.iter().map(|s| s.rows).chain(open_rows).sum();
        }
        Ok(Self { path: path.to_path_buf(), manifest })
    }

    /// A folder whose manifest is known and need not be there yet.
    ///
    /// # Errors
    /// When it is not one that could be read back.
    pub fn with_manifest(path: &Path, written: &impl serde::Serialize) -> Result<Self, ReadError> {
        let failed = |e: serde_json::Error| ReadError(format!("{}: {e}", path.join("manifest.json").display()));
        let manifest = serde_json::to_value(written).and_then(serde_json::from_value).map_err(failed)?;
        Ok(Self { path: path.to_path_buf(), manifest })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The last part of its path.
    #[must_use]
    pub fn id(&self) -> String {
        let whole = fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        whole.file_name().map_or_else(|| "run".into(), |n| n.to_string_lossy().into_owned())
    }

    /// The manifest.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The results, one row a point; of a run that has not ended, from its journal.
    ///
    /// # Errors
    /// When the file is missing or damaged.
    pub fn results(&self) -> Result<Vec<RecordBatch>, ReadError> {
        if self.manifest.status == "running"
            && let Ok(lines) = journal::read(&self.path)
        {
            return Ok(vec![results(Taken::of(&lines.entries).rows()).map_err(ReadError)?]);
        }
        read(&self.path.join("results.parquet"))?.collect()
    }

    /// The results of records, pulses and free vibrations; nothing when there are none.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn transients(&self) -> Result<Vec<RecordBatch>, ReadError> {
        if self.manifest.status == "running"
            && let Ok(lines) = journal::read(&self.path)
        {
            return Ok(vec![transients::table(Taken::of(&lines.entries).transients()).map_err(ReadError)?]);
        }
        let path = self.path.join(transients::TRANSIENTS);
        if path.exists() { read(&path)?.collect() } else { Ok(Vec::new()) }
    }

    /// Batches of samples in the order they were taken; none when none were recorded. A damaged file gives
    /// an error in its place, and the files after it are read.
    pub fn samples(&self) -> impl Iterator<Item = Result<RecordBatch, ReadError>> + use<> {
        sample_files(&self.path).into_iter().flat_map(|file| -> Box<dyn Iterator<Item = _>> {
            match read_samples(&file) {
                Ok(batches) => batches,
                Err(error) => Box::new(std::iter::once(Err(error))),
            }
        })
    }

    /// Names of the set-ups.
    #[must_use]
    pub fn set_up_names(&self) -> BTreeSet<String> {
        self.manifest.set_ups.iter().map(|s| s.name.clone()).collect()
    }

    /// Size of all files, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        fn size(path: &Path) -> u64 {
            // What a link points at is not of the folder, and may be the folder itself.
            let entries = fs::read_dir(path).into_iter().flatten().flatten();
            let of = |e: fs::DirEntry| match e.file_type() {
                Ok(kind) if kind.is_dir() => size(&e.path()),
                _ => e.metadata().map_or(0, |m| m.len()),
            };
            entries.map(of).sum()
        }
        size(&self.path)
    }
}

/// The manifest of a run folder as it was last written.
///
/// # Errors
/// A missing or damaged manifest, or a format of a later version.
pub fn manifest_of(path: &Path) -> Result<Manifest, ReadError> {
    let file = path.join("manifest.json");
    let failed = |message: String| ReadError(format!("{}: {message}", file.display()));
    let text = regular::read(&file).map_err(|e| failed(format!("cannot read the manifest: {e}")))?;
    let value: serde_json::Value = serde_json::from_slice(&text)
        .map_err(|e| failed(format!("the manifest is damaged, it is not JSON from this place on: {e}")))?;
    // The number first: a later format may hold what this reader cannot take.
    if let Some(format) = value.get("format").and_then(serde_json::Value::as_u64).filter(|f| *f > u64::from(FORMAT)) {
        let by = value.get("damprig").and_then(serde_json::Value::as_str).unwrap_or("a later version");
        let message =
            format!("the run has format {format}, written by {by}; {} reads up to {FORMAT}", crate::VERSION_LINE);
        return Err(failed(format!("{message}\n  read it with that version or a later one")));
    }
    serde_json::from_value(value).map_err(|e| failed(format!("the manifest is damaged: {e}")))
}

/// The files that hold samples, in order.
#[must_use]
pub fn sample_files(folder: &Path) -> Vec<PathBuf> {
    let whole = folder.join(samples::JOINED);
    if whole.exists() {
        return vec![whole];
    }
    let closed = samples::parts(folder);
    // A stream that goes on beside its closed part holds nothing more than that.
    let mut open = part::open_parts(folder);
    open.retain(|(number, _)| !closed.iter().any(|(other, _)| other == number));
    let mut all: Vec<(u32, PathBuf)> = closed.into_iter().chain(open).collect();
    all.sort();
    all.into_iter().map(|(_, path)| path).collect()
}

/// Whether a file of samples was still open when the program ended.
#[must_use]
pub fn is_open_part(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "arrows")
}

type Batches = Box<dyn Iterator<Item = Result<RecordBatch, ReadError>>>;

/// Batches of one of [`sample_files`]: of an open part, up to the last whole one.
///
/// # Errors
/// As [`read`].
pub fn read_samples(path: &Path) -> Result<Batches, ReadError> {
    if is_open_part(path) {
        let salvaged = part::salvage(path).map_err(|e| ReadError(e.to_string()))?;
        return Ok(Box::new(salvaged.batches.into_iter().map(Ok)));
    }
    Ok(Box::new(read(path)?))
}

/// Batches of one Parquet file.
///
/// # Errors
/// When it is missing, or is no whole Parquet file. A batch that cannot be decoded is an error in its place.
pub fn read(path: &Path) -> Result<impl Iterator<Item = Result<RecordBatch, ReadError>> + use<>, ReadError> {
    let shown = path.display().to_string();
    let failed = |message: String| ReadError(format!("{shown}: {message}"));
    let file = regular::open(path).map_err(|e| failed(format!("cannot read it: {e}")))?;
    let bytes = file.metadata().map_or(0, |m| m.len());
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(|e| failed(format!("not a whole Parquet file ({bytes} bytes; cut off or damaged): {e}")))?;
    Ok(reader.map(move |batch| batch.map_err(|e| ReadError(format!("{shown}: a damaged part: {e}")))))
}
