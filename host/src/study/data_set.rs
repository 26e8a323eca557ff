//! The results of a study: parts of some rows each, and the table that they are joined to.
//!
//! A part is a whole Parquet file that appears under its name at once, so a kill costs the part that was being computed and nothing
//! else. Which rows a part has follows from the study alone. Every file carries the study's identity: parts of another study, of
//! another version or cut short are told apart.

use std::collections::HashMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use arrow_select::concat::concat_batches;
use parquet::arrow::ArrowWriter;
use serde::{Deserialize, Serialize};

use super::axis::{Value, Values};
use super::evaluate::{Column, columns, cycles_per_row};
use super::file::Study;
use crate::input::Refusal;
use crate::run_folder::read::parquet_file;
use crate::run_folder::write::parquet_file::properties;
use crate::run_folder::{ReadError, StorageError, own_files};

/// Version of the layout of parts and table; part of a study's identity.
pub const FORMAT: &str = "study 1";

/// Simulated cycles of a part, about: a second of computing.
const CYCLES_PER_PART: f64 = 2e6;

/// Most rows of a part.
const MOST_ROWS_PER_PART: u64 = 65_536;

/// Name of the joined table.
pub const TABLE: &str = "table.parquet";

/// Name of the file that describes the data set.
pub const MANIFEST: &str = "study.json";

/// Folder of the parts.
pub const PARTS: &str = "parts";

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

/// A data set in a folder.
#[derive(Clone, Debug)]
pub struct DataSet {
    folder: PathBuf,
    manifest: Manifest,
}

/// Name of a part's file.
#[must_use]
pub fn part_name(part: u64) -> String {
    format!("{part:08}.parquet")
}

impl DataSet {
    /// Opens the folder of a study, or creates it.
    ///
    /// # Errors
    /// A folder of another study or version, or one that is not a study's; a folder that cannot be created.
    pub fn open(study: &Study, folder: &Path) -> Result<Self, Refusal> {
        let manifest = Manifest::of(study);
        let path = folder.join(MANIFEST);
        match fs::read(&path) {
            Ok(bytes) => {
                let there: Manifest = serde_json::from_slice(&bytes).map_err(|error| {
                    Refusal(format!("{} cannot be read: {error}\n  give another --out", path.display()))
                })?;
                if there != manifest {
                    return Err(Refusal(changed(&there, &manifest, folder)));
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let is_empty = fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
                if !is_empty {
                    let why = "is not empty and has no study; give another --out";
                    return Err(Refusal(format!("{} {why}", folder.display())));
                }
                create(folder, &manifest).map_err(|error| Refusal(error.to_string()))?;
            }
            Err(error) => return Err(Refusal(format!("cannot read {}: {error}", path.display()))),
        }
        Ok(Self { folder: folder.to_path_buf(), manifest })
    }

    /// Its folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What it is.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Path of a part.
    #[must_use]
    pub fn part_path(&self, part: u64) -> PathBuf {
        self.folder.join(PARTS).join(part_name(part))
    }

    /// Reads a part, if it is there.
    ///
    /// # Errors
    /// A file that is no Parquet, is cut short, or belongs to another study.
    pub fn part(&self, part: u64) -> Result<Option<RecordBatch>, ReadError> {
        let path = self.part_path(part);
        if !path.try_exists().unwrap_or(true) {
            return Ok(None);
        }
        let wrong = |what: &dyn std::fmt::Display| {
            ReadError(format!("{what}\n  remove {}: the part is then computed again", path.display()))
        };
        let metadata = parquet_file::metadata(&path).map_err(|error| wrong(&error))?;
        if metadata.get(IDENTITY) != Some(&self.manifest.identity) {
            return Err(wrong(&format!("{}: belongs to another study or another version of it", path.display())));
        }
        let batches = parquet_file::read(&path).and_then(|batches| batches.collect::<Result<Vec<_>, _>>());
        let batches = batches.map_err(|error| wrong(&error))?;
        let Some(schema) = batches.first().map(RecordBatch::schema) else {
            return Err(wrong(&format!("{}: has no rows", path.display())));
        };
        let whole = concat_batches(&schema, &batches).map_err(|error| wrong(&error))?;
        let rows = self.manifest.rows_of(part);
        if whole.num_rows() as u64 != rows.end - rows.start || first_row(&whole) != Some(rows.start) {
            return Err(wrong(&format!(
                "{}: does not have the rows {} to {}",
                path.display(),
                rows.start,
                rows.end - 1
            )));
        }
        Ok(Some(whole))
    }

    /// Writes a part: values of the computed columns for each of its rows.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_part(&self, study: &Study, part: u64, rows: &[Vec<f64>]) -> Result<(), StorageError> {
        let path = self.part_path(part);
        let schema = schema(study, &self.manifest);
        let batch = batch(study, &schema, self.manifest.rows_of(part).start, rows);
        write_table(&path, &batch.map_err(|error| StorageError::new("write", &path, error))?)
    }

    /// Joins all parts to one table, part by part: memory does not grow with the table.
    ///
    /// # Errors
    /// A part that is missing or wrong; a table that cannot be written.
    pub fn join(&self, study: &Study) -> Result<PathBuf, Refusal> {
        let path = self.folder.join(TABLE);
        let beside = own_files::beside(&path);
        let failed = |error: &dyn std::fmt::Display| Refusal(format!("cannot write {}: {error}", path.display()));
        let schema = schema(study, &self.manifest);
        let file = own_files::create(&beside).map_err(|error| failed(&error))?;
        let mut writer =
            ArrowWriter::try_new(file, schema.clone(), Some(properties(&schema))).map_err(|error| failed(&error))?;
        for part in 0..self.manifest.parts() {
            let batch = self.part(part).map_err(|error| Refusal(error.0))?;
            let batch = batch.ok_or_else(|| Refusal(format!("{} is missing", self.part_path(part).display())))?;
            // Read back, a batch has lost the metadata of the file.
            let batch = batch.with_schema(schema.clone()).map_err(|error| failed(&error))?;
            writer.write(&batch).map_err(|error| failed(&error))?;
        }
        writer.close().map_err(|error| failed(&error))?;
        fs::rename(&beside, &path).map_err(|error| failed(&error))?;
        Ok(path)
    }
}

/// Writes a table as a whole Parquet file.
///
/// # Errors
/// When the file cannot be written.
pub fn write_table(path: &Path, table: &RecordBatch) -> Result<(), StorageError> {
    let failed = |error: &dyn std::fmt::Display| StorageError::new("write", path, error);
    let schema = table.schema();
    let mut bytes = Vec::new();
    let mut writer =
        ArrowWriter::try_new(&mut bytes, schema.clone(), Some(properties(&schema))).map_err(|error| failed(&error))?;
    writer.write(table).map_err(|error| failed(&error))?;
    writer.close().map_err(|error| failed(&error))?;
    own_files::replace(path, &bytes)
}

fn first_row(batch: &RecordBatch) -> Option<u64> {
    let column = batch.column_by_name(ROW)?;
    column.as_any().downcast_ref::<UInt64Array>()?.values().first().copied()
}

fn create(folder: &Path, manifest: &Manifest) -> Result<(), StorageError> {
    let parts = folder.join(PARTS);
    fs::create_dir_all(&parts).map_err(|error| StorageError::new("create", &parts, error))?;
    let text = serde_json::to_vec_pretty(manifest).unwrap_or_default();
    own_files::replace(&folder.join(MANIFEST), &text)
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
        "{} has results of another study: {what}\n  give another --out, or remove the folder if its results are not needed",
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
