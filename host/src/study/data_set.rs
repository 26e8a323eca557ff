//! The results of a study: parts of some rows each, and the table that they are joined to.
//!
//! A part is a whole Parquet file that appears under its name at once, so a kill costs the part that was being computed and nothing
//! else. Which rows a part has follows from the study alone. Every file carries the study's identity: parts of another study, of
//! another version or cut short are told apart.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use parquet::arrow::ArrowWriter;
use serde::{Deserialize, Serialize};

use super::evaluate::usual_s;
use super::file::Study;
use super::part::{self, Part, batch, schema};
use super::store::Store;
use super::sums::Sums;
use crate::failure::Failure;
use crate::run_folder::checksum;
use crate::run_folder::read::parquet_file::{self, Content};
use crate::run_folder::sealed_parquet::{self, IDENTITY};
use crate::table::parquet_properties::properties;

/// Version of the layout of parts and table; part of a study's identity.
pub const FORMAT: &str = "study 1";

/// Computing time of a part on one usual core, s, about.
const PART_S: f64 = 1.0;

/// Most rows of a part.
const MAX_ROWS_PER_PART: u64 = 65_536;

/// Encoded bytes from which a row group of the joined table ends: the memory that joining takes.
const ROW_GROUP_BYTES: usize = 32 << 20;

/// Name of the joined table.
pub const TABLE: &str = "table.parquet";

/// Name of the file that describes the data set.
pub const MANIFEST: &str = "study.json";

/// Folder of the parts.
pub const PARTS: &str = "parts";

/// What a data set is: written when it is created, compared when it is opened again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyManifest {
    /// Version of the layout.
    pub format: String,
    /// Program and version.
    pub damprig: String,
    /// Source revision of the program, if its build knew it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
    /// Digest of the program's sources ([`crate::BUILD`]); older versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub build: Option<String>,
    /// Name of the study.
    pub name: String,
    /// Identity of the study.
    pub identity: String,
    /// Rows of the table.
    pub rows: u64,
    /// Rows of each part; the last may have fewer.
    pub rows_per_part: u64,
    /// Text of the study.
    pub study: String,
    /// Text of its case.
    pub case: String,
    /// SHA-256 of the rest of this file; those of older versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl StudyManifest {
    /// Of a study.
    #[must_use]
    pub fn of(study: &Study) -> Self {
        let usual = (PART_S / usual_s(study)).ceil().clamp(1.0, MAX_ROWS_PER_PART as f64);
        let manifest = Self {
            format: FORMAT.into(),
            damprig: crate::VERSION_LINE.into(),
            revision: option_env!("DAMPRIG_REVISION").map(str::to_string),
            build: Some(crate::BUILD.into()),
            name: study.name.clone(),
            identity: study.identity.clone(),
            rows: study.rows(),
            rows_per_part: study.rows_per_part.unwrap_or(usual as u64),
            study: study.text.clone(),
            case: study.case_text.clone(),
            sha256: None,
        };
        Self { sha256: Some(manifest.digest()), ..manifest }
    }

    /// SHA-256 of the rest.
    fn digest(&self) -> String {
        let rest = Self { sha256: None, ..self.clone() };
        checksum::of_bytes(&serde_json::to_vec(&rest).unwrap_or_default())
    }

    /// The file's text.
    fn to_text(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).unwrap_or_default()
    }

    /// Number of parts.
    #[must_use]
    pub fn parts(&self) -> u64 {
        self.rows.div_ceil(self.rows_per_part)
    }

    /// Rows of a part.
    #[must_use]
    pub fn rows_of(&self, part: u64) -> Range<u64> {
        let from = part * self.rows_per_part;
        from..(from + self.rows_per_part).min(self.rows)
    }
}

/// A data set in a folder.
#[derive(Clone, Debug)]
pub struct DataSet {
    store: Store,
    manifest: StudyManifest,
}

/// Name of a part's file.
#[must_use]
pub fn part_name(part: u64) -> String {
    format!("{part:08}.parquet")
}

/// Number of the part with this file name.
#[must_use]
pub fn part_number(name: &str) -> Option<u64> {
    name.strip_suffix(".parquet")?.parse().ok().filter(|part| part_name(*part) == name)
}

fn place_of(part: u64) -> String {
    format!("{PARTS}/{}", part_name(part))
}

impl DataSet {
    /// Opens the results of a study, or begins them in an empty place. Several workers may do so at once.
    ///
    /// # Errors
    /// A place with results of another study or version, or with something else; one that cannot be written; a damaged manifest.
    pub fn open(study: &Study, store: Store) -> Result<Self, Failure> {
        // Listed first: whoever begins a data set writes its manifest before anything else.
        let others = store.list("")?;
        if let Some(data_set) = Self::existing(study, store.clone())? {
            return Ok(data_set);
        }
        let shown = store.path("");
        // Parts tell which study they belong to: their manifest may be written again.
        let has_parts = store.list(PARTS)?.iter().any(|entry| part_number(&entry.name).is_some());
        if !others.is_empty() && !has_parts {
            return Err(Failure::Input(format!(
                "{} is not empty and has no study; give another --out",
                shown.display()
            )));
        }
        store.put_new(MANIFEST, &StudyManifest::of(study).to_text())?;
        // It may be that of another worker.
        let written = Self::existing(study, store)?;
        let removed =
            || Failure::Storage(format!("{} was removed as soon as it was written", shown.join(MANIFEST).display()));
        written.ok_or_else(removed)
    }

    /// Opens the results of a study if there are any; writes nothing.
    ///
    /// # Errors
    /// Results of another study or version; a place that cannot be read; a damaged manifest.
    pub fn existing(study: &Study, store: Store) -> Result<Option<Self>, Failure> {
        let Some(bytes) = store.get(MANIFEST)? else { return Ok(None) };
        let now = StudyManifest::of(study);
        let shown = store.path(MANIFEST);
        let damaged = |what: &dyn std::fmt::Display| {
            let help = "remove it: the next `damprig study run` or `work` writes it again and goes on with the parts";
            Failure::Storage(format!("{} is damaged: {what}\n  {help}", shown.display()))
        };
        let there: StudyManifest = serde_json::from_slice(&bytes).map_err(|error| damaged(&error))?;
        // The digest is of the values; what is written between them counts too.
        let is_as_written = |digest: &String| *digest == there.digest() && *bytes == *there.to_text();
        if !there.sha256.as_ref().is_none_or(is_as_written) {
            return Err(damaged(&"it was changed since it was written (SHA-256 differs)"));
        }
        if there.rows_per_part == 0 {
            return Err(damaged(&"its parts have no rows"));
        }
        // An older version sized parts in another way, and knew no build.
        let build = there.build.as_ref().and(now.build.clone());
        let now = StudyManifest { build, rows_per_part: there.rows_per_part, ..now };
        if there.digest() != now.digest() {
            return Err(Failure::Input(changed(&there, &now, &store.path(""))));
        }
        Ok(Some(Self { store, manifest: there }))
    }

    /// Where it is.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// What it is.
    #[must_use]
    pub fn manifest(&self) -> &StudyManifest {
        &self.manifest
    }

    /// Path of a part.
    #[must_use]
    pub fn part_path(&self, part: u64) -> PathBuf {
        self.store.path(&place_of(part))
    }

    /// The parts that are there, and when each was written. They are not read.
    ///
    /// # Errors
    /// When they cannot be listed.
    pub fn parts(&self) -> Result<BTreeMap<u64, SystemTime>, Failure> {
        let entries = self.store.list(PARTS)?;
        let number = |name: &str| part_number(name).filter(|part| *part < self.manifest.parts());
        Ok(entries.iter().filter_map(|entry| Some((number(&entry.name)?, entry.modified))).collect())
    }

    /// Whether a part is there. It is not read.
    ///
    /// # Errors
    /// When that cannot be found out.
    pub fn has_part(&self, part: u64) -> Result<bool, Failure> {
        self.store.has(&place_of(part))
    }

    /// Reads a part, if it is there.
    ///
    /// # Errors
    /// A file that is no Parquet, is cut short, has changed since it was written, belongs to another study, or has other columns or
    /// points.
    pub fn part(&self, study: &Study, part: u64) -> Result<Option<Part>, Failure> {
        let shown = self.part_path(part).display().to_string();
        let Some(bytes) = self.store.get(&place_of(part))? else { return Ok(None) };
        let read = part::read(study, &self.manifest, &self.manifest.rows_of(part), (&shown, bytes));
        let wrong =
            |error: Failure| Failure::Storage(format!("{error}\n  remove {shown}: the part is then computed again"));
        Ok(Some(read.map_err(wrong)?))
    }

    /// Writes a part: values of the computed columns for each of its rows. One that another worker has written meanwhile stays: it
    /// has the same bytes.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_part(&self, study: &Study, part: u64, rows: &[Vec<f64>]) -> Result<(), Failure> {
        let path = self.part_path(part);
        let schema = schema(study, &self.manifest);
        let batch = batch(study, &schema, self.manifest.rows_of(part).start, rows);
        let bytes = batch.map_err(Failure::from).and_then(|batch| sealed_parquet::bytes(&batch));
        let bytes = bytes.map_err(|error| Failure::cannot("write", &path, error))?;
        self.store.put_new(&place_of(part), &bytes).map(drop)
    }

    /// Joins all parts to one table, part by part: memory does not grow with the table. `seen` gets every part.
    ///
    /// # Errors
    /// Parts that are missing or wrong; a table that cannot be written.
    pub fn join(&self, study: &Study, mut seen: impl FnMut(u64, &Part)) -> Result<PathBuf, Failure> {
        let missing = self.missing()?;
        if !missing.is_empty() {
            return Err(Failure::Storage(self.told_missing(&missing)));
        }
        let path = self.table_path();
        let failed = |error: &dyn std::fmt::Display| Failure::cannot("write", &path, error);
        let schema = schema(study, &self.manifest);
        let mut file = self.store.large_file(TABLE)?;
        let mut writer = ArrowWriter::try_new(file.as_file_mut(), schema.clone(), Some(properties(&schema)))
            .map_err(|error| failed(&error))?;
        for part in 0..self.manifest.parts() {
            let there = self.part(study, part)?.ok_or_else(|| Failure::Storage(self.told_missing(&[part])))?;
            seen(part, &there);
            writer.write(&there.batch).map_err(|error| failed(&error))?;
            if writer.in_progress_size() > ROW_GROUP_BYTES {
                writer.flush().map_err(|error| failed(&error))?;
            }
        }
        writer.close().map_err(|error| failed(&error))?;
        sealed_parquet::seal(file.as_file_mut()).map_err(|error| failed(&error))?;
        // What is written from here on is another table; a part that is wrong leaves the earlier one with its digests.
        Sums::remove(&self.store)?;
        file.replace().map_err(|error| failed(&error))?;
        Sums::default().of_stored(&self.store, TABLE)?.write(&self.store)?;
        for folder in ["", PARTS] {
            self.store.remove_abandoned(folder);
        }
        Ok(path)
    }

    /// Whether the joined table of this study is there as it was written: it has the digest in the file of them, and the study's identity.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn is_joined(&self) -> Result<bool, Failure> {
        let Ok(Some(sums)) = Sums::read(&self.store)? else { return Ok(false) };
        if !sums.has(&self.store, TABLE)? {
            return Ok(false);
        }
        let columns = parquet_file::columns(&self.table_path())?;
        Ok(columns.schema().metadata().get(IDENTITY) == Some(&self.manifest.identity))
    }

    /// Path of the joined table.
    #[must_use]
    pub fn table_path(&self) -> PathBuf {
        self.store.path(TABLE)
    }

    /// Whether the joined table has a digest, which one of an older version lacks; or why it is not the table of this study. `None`
    /// without a table.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn table_has_digest(&self) -> Result<Option<Result<bool, Failure>>, Failure> {
        let shown = self.store.path(TABLE).display().to_string();
        let Some(bytes) = self.store.get(TABLE)? else { return Ok(None) };
        let own = |content: Content| match content.metadata.get(IDENTITY) {
            Some(identity) if *identity == self.manifest.identity => Ok(content.has_digest),
            _ => Err(Failure::Storage(format!("{shown}: belongs to another study or another version of it"))),
        };
        Ok(Some(parquet_file::content(&shown, bytes).and_then(own)))
    }

    /// Parts that are not there.
    ///
    /// # Errors
    /// When the parts cannot be listed.
    pub fn missing(&self) -> Result<Vec<u64>, Failure> {
        let there = self.parts()?;
        Ok((0..self.manifest.parts()).filter(|part| !there.contains_key(part)).collect())
    }

    fn told_missing(&self, missing: &[u64]) -> String {
        let (all, shown) = (self.manifest.parts(), self.store.path(""));
        let (are, count) = (if missing.len() == 1 { "is" } else { "are" }, missing.len());
        format!(
            "{count} of {all} parts of {} {are} missing: {}\n  compute them with `damprig study work` or `run`, then join again",
            shown.display(),
            ranges(missing)
        )
    }
}

/// Rising numbers in words: `3, 7 to 12`.
#[must_use]
pub fn ranges(numbers: &[u64]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = |run: &[u64]| match run {
        [only] => only.to_string(),
        [first, second] => format!("{first}, {second}"),
        [first, .., last] => format!("{first} to {last}"),
        [] => String::new(),
    };
    runs.map(text).collect::<Vec<_>>().join(", ")
}

/// What differs between the data set that is there and the study.
fn changed(there: &StudyManifest, now: &StudyManifest, folder: &Path) -> String {
    let what = if there.damprig != now.damprig || there.revision != now.revision || there.format != now.format {
        format!("its parts were written by {}, this is {}", there.damprig, now.damprig)
    } else if there.build != now.build {
        let [there, now] = [there, now].map(|manifest| manifest.build.as_deref().unwrap_or_default());
        format!("its parts were written by another build of this version, {there}, this is {now}")
    } else if there.study != now.study {
        "the study file has changed since".into()
    } else if there.case != now.case {
        "the case has changed since".into()
    } else {
        "a file that the study or the case names has changed since".into()
    };
    format!(
        "{} has results of another study: {what}\n  give another --out, or remove these results if they are not needed",
        folder.display()
    )
}
