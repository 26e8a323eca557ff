//! A run folder opened for reading: its manifest, results, transients and samples.
//!
//! Samples come as record batches from `samples.parquet`, or until that exists from `samples.parts/` and the part that was
//! open when the program ended. The numbers of a run that has not ended come from its journal. Whether the folder is
//! intact is checked by [`super::verify`].

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::RecordBatch;
use damprig_core::io::TICK_HZ;

use super::open_part::salvage;
use super::parquet_file::read;
use super::sample_files::{open_parts, read_samples, sample_files};
use crate::failure::Failure;
use crate::input::{near, regular};
use crate::run_folder::journal::{self, JOURNAL};
use crate::run_folder::own_files::refuse_links;
use crate::run_folder::schema::impacts::{self, IMPACTS};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::{Durations, FORMAT, MANIFEST, Manifest};
use crate::run_folder::schema::results::{self, RESULTS, ResultRow};
use crate::run_folder::schema::samples::{JOINED, PARTS};
use crate::run_folder::schema::transients::{self, TRANSIENTS, TransientRow};

/// A run folder.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    manifest: Manifest,
}

const OWN_FILES: [&str; 6] = [MANIFEST, "campaign.toml", JOURNAL, RESULTS, JOINED, PARTS];

/// Whether a folder holds a file of a run.
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

/// The folder of a run, given as a path, or as the name of a run (or the end of its name) below `runs/`.
///
/// # Errors
/// When there is no such folder, with similar names; or when it holds no run.
pub fn find(wanted: &Path) -> Result<PathBuf, Failure> {
    if wanted.is_dir() {
        return if is_run(wanted) { Ok(wanted.to_path_buf()) } else { Err(Failure::Input(no_run(wanted))) };
    }
    if wanted.exists() {
        let message = "it is a file; give the folder of a run, the one that holds manifest.json";
        return Err(Failure::Input(format!("{}: {message}", wanted.display())));
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
            return Err(Failure::Input(format!(
                "{text:?} is the end of several runs; give one of {}",
                list.join(", ")
            )));
        }
    }
    let names: Vec<String> = all.iter().map(name).collect();
    let candidates = near(&text, names.iter().map(String::as_str));
    let help = match candidates[..] {
        [] => "`damprig runs` lists the runs below ./runs".to_string(),
        _ => format!("did you mean {}?", candidates.join(", ")),
    };
    Err(Failure::Input(format!("there is no run {text:?}, neither as a folder nor below ./runs\n  {help}")))
}

fn no_run(path: &Path) -> String {
    let inside = below(path).into_iter().chain(below(&path.join("runs"))).take(3);
    let inside: Vec<String> = inside.map(|p| p.display().to_string()).collect();
    let help = if inside.is_empty() {
        "a run folder holds manifest.json, campaign.toml and results.parquet".to_string()
    } else {
        format!("it holds runs; give one of them, as {}", inside.join(", "))
    };
    format!("{}: this folder is no run\n  {help}", path.display())
}

/// The name of a run: that of its folder.
#[must_use]
pub fn id_of(folder: &Path) -> String {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    whole.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned())
}

impl RunFolder {
    /// Reads the manifest; tables are read on demand.
    ///
    /// # Errors
    /// No run, a missing or damaged manifest, or a format of a later version.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        if !is_run(path) {
            return Err(Failure::Storage(no_run(path)));
        }
        refuse_links(path)?;
        let mut manifest = manifest_of(path)?;
        if manifest.is_running()
            && let Ok(lines) = journal::read(path)
        {
            // The manifest has not been written since the run began.
            manifest.is_recording = journal::is_being_written(path);
            let state = JournalState::of(&lines.entries);
            manifest.points_taken = state.points();
            manifest.clock = Durations { rig_s: state.ticks() as f64 / f64::from(TICK_HZ), wall_s: state.wall_s() };
            manifest.controller = state.controller();
            manifest.sample_rows = readable_rows(path, &state);
        }
        Ok(Self::with_manifest(path, manifest))
    }

    /// A folder with this manifest, which need not be written yet.
    #[must_use]
    pub fn with_manifest(path: &Path, manifest: Manifest) -> Self {
        Self { path: path.to_path_buf(), manifest }
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The last part of its path.
    #[must_use]
    pub fn id(&self) -> String {
        id_of(&self.path)
    }

    /// The manifest.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The journal's sum, if the run has not ended: its tables may be older than its journal.
    fn unfinished(&self) -> Option<JournalState> {
        let lines = journal::read(&self.path).ok().filter(|_| self.manifest.is_running())?;
        Some(JournalState::of(&lines.entries))
    }

    /// The results, one row a point; of a run that has not ended, from its journal.
    ///
    /// # Errors
    /// When the file is missing or damaged.
    pub fn results(&self) -> Result<Vec<RecordBatch>, Failure> {
        match self.unfinished() {
            Some(state) => Ok(vec![results::table(&state.rows_by_experiment())?]),
            None => read(&self.path.join(RESULTS))?.collect(),
        }
    }

    /// The results as rows, in the same order.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn result_rows(&self) -> Result<Vec<ResultRow>, Failure> {
        Ok(self.results()?.iter().map(results::rows).collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// The results of records, pulses and free vibrations; nothing when there are none.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn transients(&self) -> Result<Vec<RecordBatch>, Failure> {
        if let Some(state) = self.unfinished() {
            return Ok(vec![transients::table(state.transients())?]);
        }
        let path = self.path.join(TRANSIENTS);
        if path.exists() { read(&path)?.collect() } else { Ok(Vec::new()) }
    }

    /// The results of records, pulses and free vibrations as rows.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn transient_rows(&self) -> Result<Vec<TransientRow>, Failure> {
        Ok(self.transients()?.iter().map(transients::rows).collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// The impacts that the device reported; nothing when there are none.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn impacts(&self) -> Result<Vec<RecordBatch>, Failure> {
        if let Some(state) = self.unfinished() {
            return Ok(vec![impacts::table(&state.impacts, f64::from(TICK_HZ))?]);
        }
        let path = self.path.join(IMPACTS);
        if path.exists() { read(&path)?.collect() } else { Ok(Vec::new()) }
    }

    /// Batches of samples in the order in which they were taken. A damaged file gives an error in its place; the files after
    /// it are read.
    pub fn samples(&self) -> impl Iterator<Item = Result<RecordBatch, Failure>> + use<> {
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
            // Links are not followed: one may point at this folder.
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

/// Rows of samples that can be read while the parts are not joined: in closed parts, and in open ones that are not closed.
#[must_use]
pub fn readable_rows(folder: &Path, journal: &JournalState) -> u64 {
    let open = open_parts(folder).into_iter().filter(|(number, _)| !journal.is_sealed(*number));
    let open_rows = open.filter_map(|(_, file)| salvage(&file).ok()).map(|s| s.rows);
    open_rows.fold(journal.sealed_rows(), u64::saturating_add)
}

/// The manifest of a run folder as it was last written.
///
/// # Errors
/// A missing or damaged manifest, or a format of a later version.
pub fn manifest_of(path: &Path) -> Result<Manifest, Failure> {
    let file = path.join(MANIFEST);
    let failed = |message: String| Failure::Storage(format!("{}: {message}", file.display()));
    let text = regular::read(&file).map_err(|e| failed(format!("cannot read the manifest: {e}")))?;
    let value: serde_json::Value = serde_json::from_slice(&text)
        .map_err(|e| failed(format!("the manifest is damaged, it is not JSON from this place on: {e}")))?;
    // The version first: this reader may be unable to parse a later format.
    if let Some(format) = value.get("format").and_then(serde_json::Value::as_u64).filter(|f| *f > u64::from(FORMAT)) {
        let by = value.get("damprig").and_then(serde_json::Value::as_str).unwrap_or("a later version");
        let message =
            format!("the run has format {format}, written by {by}; {} reads up to {FORMAT}", crate::VERSION_LINE);
        return Err(failed(format!("{message}\n  read it with that version or a later one")));
    }
    serde_json::from_value(value).map_err(|e| failed(format!("the manifest is damaged: {e}")))
}
