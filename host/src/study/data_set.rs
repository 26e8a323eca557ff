//! The results of a study: parts of some rows each, and the table that they are joined to.
//!
//! A part is a whole Parquet file that appears under its name at once, so a kill costs the part that was being computed and nothing
//! else. Which rows a part has follows from the study alone. Every file carries the study's identity: parts of another study, of
//! another version or cut short are told apart.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use arrow_select::concat::concat_batches;
use parquet::arrow::ArrowWriter;
use parquet::errors::ParquetError;
use serde::{Deserialize, Serialize};

use super::axis::{Value, Values};
use super::evaluate::{Column, columns, cycles_per_row};
use super::file::Study;
use super::store::Store;
use crate::input::Refusal;
use crate::run_folder::read::parquet_file;
use crate::run_folder::write::parquet_file::properties;
use crate::run_folder::{ReadError, StorageError};

/// Version of the layout of parts and table; part of a study's identity.
pub const FORMAT: &str = "study 1";

/// Simulated cycles of a part, about: a second of computing.
const CYCLES_PER_PART: f64 = 2e6;

/// Most rows of a part.
const MOST_ROWS_PER_PART: u64 = 65_536;

/// Encoded bytes from which a row group of the joined table ends: the memory that joining takes.
const ROW_GROUP_BYTES: usize = 32 << 20;

/// Name of the joined table.
pub const TABLE: &str = "table.parquet";

/// Name of the file that describes the data set.
pub const MANIFEST: &str = "study.json";

/// Folder of the parts.
pub const PARTS: &str = "parts";

/// Folder of the leases of workers.
pub const LEASES: &str = "leases";

/// Column with the number of a row.
pub const ROW: &str = "row";

/// Key of the identity in the metadata of a file.
const IDENTITY: &str = "damprig.identity";

/// What a data set is: written when it is created, compared when it is opened again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub format: String,
    /// Program and version.
    pub damprig: String,
    /// Source revision of the program, if its build knew it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
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
}

impl Manifest {
    /// Of a study.
    #[must_use]
    pub fn of(study: &Study) -> Self {
        let usual = (CYCLES_PER_PART / cycles_per_row(study)).ceil().clamp(1.0, MOST_ROWS_PER_PART as f64);
        Self {
            format: FORMAT.into(),
            damprig: crate::VERSION_LINE.into(),
            revision: option_env!("DAMPRIG_REVISION").map(str::to_string),
            name: study.name.clone(),
            identity: study.identity.clone(),
            rows: study.rows(),
            rows_per_part: study.rows_per_part.unwrap_or(usual as u64),
            study: study.text.clone(),
            case: study.case_text.clone(),
        }
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

/// A data set in a folder or an object store.
#[derive(Clone, Debug)]
pub struct DataSet {
    store: Store,
    manifest: Manifest,
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
    /// A place with results of another study or version, or with something else; one that cannot be written.
    pub fn open(study: &Study, store: Store) -> Result<Self, Refusal> {
        // Listed first: whoever begins a data set writes its manifest before anything else.
        let others = store.list("").map_err(|error| Refusal(error.to_string()))?;
        if let Some(data_set) = Self::existing(study, store.clone())? {
            return Ok(data_set);
        }
        let shown = store.address("");
        if !others.is_empty() {
            return Err(Refusal(format!("{} is not empty and has no study; give another --out", shown.display())));
        }
        let text = serde_json::to_vec_pretty(&Manifest::of(study)).unwrap_or_default();
        store.put_new(MANIFEST, &text).map_err(|error| Refusal(error.to_string()))?;
        // It may be that of another worker.
        let written = Self::existing(study, store)?;
        written
            .ok_or_else(|| Refusal(format!("{} was removed as soon as it was written", shown.join(MANIFEST).display())))
    }

    /// Opens the results of a study if there are any; writes nothing.
    ///
    /// # Errors
    /// Results of another study or version; a place that cannot be read.
    pub fn existing(study: &Study, store: Store) -> Result<Option<Self>, Refusal> {
        let Some(bytes) = store.get(MANIFEST).map_err(|error| Refusal(error.to_string()))? else { return Ok(None) };
        let manifest = Manifest::of(study);
        let there: Manifest = serde_json::from_slice(&bytes).map_err(|error| {
            Refusal(format!("{} cannot be read: {error}\n  give another --out", store.address(MANIFEST).display()))
        })?;
        if there != manifest {
            return Err(Refusal(changed(&there, &manifest, &store.address(""))));
        }
        Ok(Some(Self { store, manifest }))
    }

    /// Where it is.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// What it is.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Path or URL of a part.
    #[must_use]
    pub fn part_path(&self, part: u64) -> PathBuf {
        self.store.address(&place_of(part))
    }

    /// The parts that are there, and when each was written. They are not read.
    ///
    /// # Errors
    /// When they cannot be listed.
    pub fn parts(&self) -> Result<BTreeMap<u64, SystemTime>, StorageError> {
        let entries = self.store.list(PARTS)?;
        let number = |name: &str| part_number(name).filter(|part| *part < self.manifest.parts());
        Ok(entries.iter().filter_map(|entry| Some((number(&entry.name)?, entry.modified))).collect())
    }

    /// Whether a part is there. It is not read.
    ///
    /// # Errors
    /// When that cannot be found out.
    pub fn has_part(&self, part: u64) -> Result<bool, StorageError> {
        self.store.has(&place_of(part))
    }

    /// Reads a part, if it is there.
    ///
    /// # Errors
    /// A file that is no Parquet, is cut short, or belongs to another study.
    pub fn part(&self, part: u64) -> Result<Option<RecordBatch>, ReadError> {
        let shown = self.part_path(part).display().to_string();
        let wrong = |what: &dyn std::fmt::Display| {
            ReadError(format!("{what}\n  remove {shown}: the part is then computed again"))
        };
        let bytes = self.store.get(&place_of(part)).map_err(|error| ReadError(error.to_string()))?;
        let Some(bytes) = bytes else { return Ok(None) };
        let (metadata, batches) = parquet_file::content(&shown, bytes).map_err(|error| wrong(&error))?;
        if metadata.get(IDENTITY) != Some(&self.manifest.identity) {
            return Err(wrong(&format!("{shown}: belongs to another study or another version of it")));
        }
        let Some(schema) = batches.first().map(RecordBatch::schema) else {
            return Err(wrong(&format!("{shown}: has no rows")));
        };
        let whole = concat_batches(&schema, &batches).map_err(|error| wrong(&error))?;
        let rows = self.manifest.rows_of(part);
        if !rows_are(&whole, &rows) {
            let what = format!("{shown}: does not have the rows {} to {} in this order", rows.start, rows.end - 1);
            return Err(wrong(&what));
        }
        Ok(Some(whole))
    }

    /// Writes a part: values of the computed columns for each of its rows. One that another worker has written meanwhile stays: it
    /// has the same bytes.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_part(&self, study: &Study, part: u64, rows: &[Vec<f64>]) -> Result<(), StorageError> {
        let path = self.part_path(part);
        let schema = schema(study, &self.manifest);
        let batch = batch(study, &schema, self.manifest.rows_of(part).start, rows);
        let bytes = batch.and_then(|batch| table_bytes(&batch).map_err(arrow_schema::ArrowError::from));
        let bytes = bytes.map_err(|error| StorageError::new("write", &path, error))?;
        self.store.put_new(&place_of(part), &bytes).map(drop)
    }

    /// Joins all parts to one table, part by part: memory does not grow with the table. `seen` gets every part.
    ///
    /// # Errors
    /// Parts that are missing or wrong; a table that cannot be written.
    pub fn join(&self, study: &Study, mut seen: impl FnMut(u64, &RecordBatch)) -> Result<PathBuf, Refusal> {
        let missing = self.missing().map_err(|error| Refusal(error.to_string()))?;
        if !missing.is_empty() {
            return Err(Refusal(self.told_missing(&missing)));
        }
        let path = self.store.address(TABLE);
        let failed = |error: &dyn std::fmt::Display| Refusal(format!("cannot write {}: {error}", path.display()));
        let schema = schema(study, &self.manifest);
        let mut file = self.store.large_file(TABLE).map_err(|error| Refusal(error.to_string()))?;
        let mut writer = ArrowWriter::try_new(file.as_file_mut(), schema.clone(), Some(properties(&schema)))
            .map_err(|error| failed(&error))?;
        for part in 0..self.manifest.parts() {
            let batch = self.part(part).map_err(|error| Refusal(error.0))?;
            let batch = batch.ok_or_else(|| Refusal(self.told_missing(&[part])))?;
            seen(part, &batch);
            // Read back, a batch has lost the metadata of the file.
            let batch = batch.with_schema(schema.clone()).map_err(|error| failed(&error))?;
            writer.write(&batch).map_err(|error| failed(&error))?;
            if writer.in_progress_size() > ROW_GROUP_BYTES {
                writer.flush().map_err(|error| failed(&error))?;
            }
        }
        writer.close().map_err(|error| failed(&error))?;
        self.store.put_file(TABLE, file).map_err(|error| Refusal(error.to_string()))?;
        for folder in ["", PARTS, LEASES] {
            self.store.remove_abandoned(folder);
        }
        Ok(path)
    }

    /// Parts that are not there.
    ///
    /// # Errors
    /// When the parts cannot be listed.
    pub fn missing(&self) -> Result<Vec<u64>, StorageError> {
        let there = self.parts()?;
        Ok((0..self.manifest.parts()).filter(|part| !there.contains_key(part)).collect())
    }

    fn told_missing(&self, missing: &[u64]) -> String {
        let (all, shown) = (self.manifest.parts(), self.store.address(""));
        let (are, count) = (if missing.len() == 1 { "is" } else { "are" }, missing.len());
        format!(
            "{count} of {all} parts of {} {are} missing: {}\n  compute them with `damprig study work`, then join again",
            shown.display(),
            ranges(missing)
        )
    }
}

/// A table as a whole Parquet file.
///
/// # Errors
/// When it cannot be encoded.
pub fn table_bytes(table: &RecordBatch) -> Result<Vec<u8>, ParquetError> {
    let schema = table.schema();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, schema.clone(), Some(properties(&schema)))?;
    writer.write(table)?;
    writer.close()?;
    Ok(bytes)
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

/// Whether a batch has exactly these rows, in order.
fn rows_are(batch: &RecordBatch, rows: &Range<u64>) -> bool {
    let column = batch.column_by_name(ROW).and_then(|column| column.as_any().downcast_ref::<UInt64Array>());
    column.is_some_and(|column| column.null_count() == 0 && column.values().iter().copied().eq(rows.clone()))
}

/// What differs between the data set that is there and the study.
fn changed(there: &Manifest, now: &Manifest, folder: &Path) -> String {
    let what = if there.damprig != now.damprig || there.revision != now.revision || there.format != now.format {
        format!("its parts were written by {}, this is {}", there.damprig, now.damprig)
    } else if there.study != now.study {
        "the study file has changed since".into()
    } else if there.case != now.case {
        "the case has changed since".into()
    } else {
        "a file that the case names has changed since".into()
    };
    format!(
        "{} has results of another study: {what}\n  give another --out, or remove these results if they are not needed",
        folder.display()
    )
}

/// Columns: number of the row, axes, results; each with its unit and its meaning.
#[must_use]
pub fn schema(study: &Study, manifest: &Manifest) -> SchemaRef {
    let field = |name: &str, kind: DataType, unit: &str, doc: &str, is_missing: bool| {
        let metadata = [("unit", unit), ("description", doc)].map(|(key, text)| (key.to_string(), text.to_string()));
        Field::new(name, kind, is_missing).with_metadata(HashMap::from(metadata))
    };
    let mut fields = vec![field(ROW, DataType::UInt64, "1", "number of the row, from 0", false)];
    for &place in study.points.kept() {
        let axis = &study.axes[place];
        let (kind, unit) = match &axis.values {
            Values::Words(_) => (DataType::Utf8, ""),
            _ => (DataType::Float64, plain(axis.unit())),
        };
        fields.push(field(&axis.key, kind, unit, "axis of the study", false));
    }
    for Column { name, unit, doc } in columns(study) {
        fields.push(field(&name, DataType::Float64, plain(unit), &doc, true));
    }
    let metadata = [
        (IDENTITY, manifest.identity.clone()),
        ("damprig.version", manifest.damprig.clone()),
        ("damprig.revision", manifest.revision.clone().unwrap_or_default()),
        ("damprig.name", manifest.name.clone()),
        ("damprig.study", manifest.study.clone()),
        ("damprig.case", manifest.case.clone()),
    ];
    let metadata = metadata.map(|(key, text)| (key.to_string(), text));
    Arc::new(Schema::new_with_metadata(fields, HashMap::from(metadata)))
}

fn plain(unit: &str) -> &str {
    if unit.is_empty() { "1" } else { unit }
}

/// Rows as a record batch; what is not a number is missing.
fn batch(
    study: &Study,
    schema: &SchemaRef,
    first: u64,
    rows: &[Vec<f64>],
) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let numbers = first..first + rows.len() as u64;
    let axes: Vec<Vec<Value>> = numbers.clone().map(|row| study.points.values(&study.axes, row, 0)).collect();
    let mut arrays: Vec<ArrayRef> = vec![Arc::new(UInt64Array::from_iter_values(numbers))];
    for &place in study.points.kept() {
        let number = |values: &Vec<Value>| if let Value::Number(number) = values[place] { number } else { f64::NAN };
        let word =
            |values: &Vec<Value>| if let Value::Word(word) = &values[place] { word.clone() } else { String::new() };
        arrays.push(match &study.axes[place].values {
            Values::Words(_) => Arc::new(StringArray::from_iter_values(axes.iter().map(word))),
            _ => Arc::new(Float64Array::from_iter_values(axes.iter().map(number))),
        });
    }
    for column in 0..columns(study).len() {
        let value = |row: &Vec<f64>| Some(row[column]).filter(|value| !value.is_nan());
        arrays.push(Arc::new(rows.iter().map(value).collect::<Float64Array>()));
    }
    RecordBatch::try_new(schema.clone(), arrays)
}
