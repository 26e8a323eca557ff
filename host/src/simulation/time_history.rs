//! Writes the time history of a simulation to a CSV or Parquet file, in chunks while it runs, with constant memory; or to a `.mat` file,
//! which is kept in memory until the end.
//!
//! A file gets its name when it is complete; one that cannot be written leaves nothing. The file of a run that is stopped is
//! complete up to there. Impacts and
//! accumulations have tables of their own beside it (`motion.csv`, `motion.impacts.csv`, `motion.accumulations.csv`).

use std::fs::File;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, Int32Builder, StringDictionaryBuilder};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Metadata, Schema, SchemaRef};
use matrw::MatFile;
use parquet::arrow::ArrowWriter;
use tempfile::TempPath;

use super::case::Case;
use super::motion::{AccumulationRecord, ImpactRecord, Phase, Piece, Viewer};
use crate::quantity::Quantity;
use crate::run_folder::StorageError;
use crate::run_folder::read::columns::{Value, description, unit, values};
use crate::run_folder::schema::self_description::DESCRIPTION;
use crate::run_folder::write::mat_file::{self, sum};
use crate::run_folder::write::parquet_file::properties;
use crate::table::Column;

/// Rows in a chunk.
const CHUNK: usize = 16_384;

/// Path of a table; the extension selects the format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TablePath {
    path: PathBuf,
    format: TableFormat,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TableFormat {
    Parquet,
    Csv,
    Mat,
}

impl TableFormat {
    fn extension(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
            Self::Mat => "mat",
        }
    }
}

/// Most values of a `.mat` file: 2 GB, as in exports of runs.
const MOST_MAT_VALUES: usize = 250_000_000;

impl TablePath {
    /// The path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Approximate bytes per row of a time history, measured on a forced impact damper at 500 Hz.
    #[must_use]
    pub fn bytes_per_row(&self) -> f64 {
        match self.format {
            TableFormat::Csv => 140.0,
            TableFormat::Parquet => 23.0,
            TableFormat::Mat => 64.0,
        }
    }

    /// Path of the table of impacts.
    #[must_use]
    pub fn impacts(&self) -> Self {
        self.beside("impacts")
    }

    /// Path of the table of accumulations.
    #[must_use]
    pub fn accumulations(&self) -> Self {
        self.beside("accumulations")
    }

    fn beside(&self, what: &str) -> Self {
        let extension = self.format.extension();
        Self { path: self.path.with_extension(format!("{what}.{extension}")), format: self.format }
    }
}

impl FromStr for TablePath {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let format = match extension.as_deref() {
            Some("parquet") => TableFormat::Parquet,
            Some("csv") => TableFormat::Csv,
            Some("mat") => TableFormat::Mat,
            Some(other) => return Err(format!("the extension .{other} is not supported; use .parquet, .csv or .mat")),
            None => return Err("the file needs an extension: .parquet, .csv or .mat".into()),
        };
        Ok(Self { path, format })
    }
}

/// A table being written.
#[derive(Debug)]
struct TableFile {
    path: PathBuf,
    schema: SchemaRef,
    writer: FormatWriter,
    /// Removes the file if it is not completed.
    beside: TempPath,
}

#[derive(Debug)]
enum FormatWriter {
    Parquet(Box<ArrowWriter<File>>),
    Csv(Box<csv::Writer<File>>),
    Mat(MatTable),
}

/// The columns of a `.mat` file so far.
#[derive(Debug, Default)]
struct MatTable {
    /// Name of its one variable.
    name: &'static str,
    columns: Vec<MatColumn>,
}

/// A column: its numbers, or places in a list of words, from 1.
#[derive(Debug, Default)]
struct MatColumn {
    numbers: Vec<f64>,
    words: Vec<String>,
}

impl MatColumn {
    fn push(&mut self, value: &Value) {
        let number = match value {
            Value::Text(word) => {
                let known = self.words.iter().position(|known| known == word);
                let place = known.unwrap_or_else(|| {
                    self.words.push(word.clone());
                    self.words.len() - 1
                });
                Some((place + 1) as f64)
            }
            other => other.number(),
        };
        self.numbers.push(number.unwrap_or(f64::NAN));
    }
}

impl MatTable {
    fn push(&mut self, batch: &RecordBatch) -> Result<(), String> {
        self.columns.resize_with(batch.num_columns(), MatColumn::default);
        let held: usize = self.columns.iter().map(|column| column.numbers.len()).sum();
        if held + batch.num_rows() * batch.num_columns() > MOST_MAT_VALUES {
            return Err("a .mat file holds at most 2 GB; lower --rate, or write .parquet".into());
        }
        for (column, array) in self.columns.iter_mut().zip(batch.columns()) {
            values(array.as_ref()).unwrap_or_default().iter().for_each(|value| column.push(value));
        }
        Ok(())
    }

    fn write(mut self, path: &Path, schema: &Schema) -> Result<(), String> {
        let path = path.to_str().ok_or("the name is not UTF-8; give another with --out")?;
        self.columns.resize_with(schema.fields().len(), MatColumn::default);
        let sums = schema.fields().iter().zip(&self.columns).map(|(f, c)| (f.name().clone(), Some(sum(&c.numbers))));
        let expected = [(self.name.to_string(), sums.collect())];
        let text_of = |what: fn(&Field) -> &str| {
            mat_file::structure(schema.fields().iter().map(|field| (field.name().clone(), mat_file::text(what(field)))))
        };
        let (units, descriptions) = (text_of(unit), text_of(description));
        let mut fields = Vec::new();
        for (field, column) in schema.fields().iter().zip(self.columns) {
            fields.push((field.name().clone(), mat_file::numbers(column.numbers)));
            if !column.words.is_empty() {
                fields.push((format!("{}_names", field.name()), mat_file::cells(&column.words)));
            }
        }
        let mut mat = MatFile::new();
        mat.insert(self.name, mat_file::structure(fields));
        mat.insert("units", units);
        mat.insert("descriptions", descriptions);
        mat_file::write_checked(path, mat, &expected)
    }
}

impl TableFile {
    /// `name`: that of the variable of a `.mat` file.
    fn create(to: &TablePath, name: &'static str, fields: Vec<Field>, about: Metadata) -> Result<Self, StorageError> {
        let folder = to.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".damprig-").suffix(".tmp");
        // Temporary files are private by default.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let (file, beside) =
            builder.tempfile_in(folder).map_err(|e| StorageError::new("create", &to.path, e))?.into_parts();
        let schema = Arc::new(Schema::new_with_metadata(fields, about));
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &to.path, e);
        let writer = match to.format {
            TableFormat::Parquet => {
                let properties =
                    properties(&schema).into_builder().set_max_row_group_row_count(Some(8 * CHUNK)).build();
                let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties)).map_err(|e| failed(&e))?;
                FormatWriter::Parquet(Box::new(writer))
            }
            TableFormat::Csv => {
                let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(file);
                writer.write_record(schema.fields().iter().map(|f| f.name())).map_err(|e| failed(&e))?;
                FormatWriter::Csv(Box::new(writer))
            }
            TableFormat::Mat => FormatWriter::Mat(MatTable { name, columns: Vec::new() }),
        };
        Ok(Self { path: to.path.clone(), schema, writer, beside })
    }

    fn write(&mut self, columns: Vec<ArrayRef>) -> Result<(), StorageError> {
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &self.path, e);
        let batch = RecordBatch::try_new(self.schema.clone(), columns).map_err(|e| failed(&e))?;
        match &mut self.writer {
            FormatWriter::Parquet(writer) => writer.write(&batch).map_err(|e| failed(&e)),
            FormatWriter::Csv(writer) => {
                let columns: Vec<_> = batch.columns().iter().filter_map(|c| values(c.as_ref())).collect();
                for row in 0..batch.num_rows() {
                    writer.write_record(columns.iter().map(|c| c[row].to_string())).map_err(|e| failed(&e))?;
                }
                Ok(())
            }
            FormatWriter::Mat(mat) => mat.push(&batch).map_err(|e| failed(&e)),
        }
    }

    fn finish(self) -> Result<(), StorageError> {
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &self.path, e);
        match self.writer {
            FormatWriter::Parquet(writer) => drop(writer.close().map_err(|e| failed(&e))?),
            FormatWriter::Csv(mut writer) => writer.flush().map_err(|e| failed(&e))?,
            FormatWriter::Mat(mat) => mat.write(&self.beside, &self.schema).map_err(|e| failed(&e))?,
        }
        self.beside.persist(&self.path).map_err(|e| StorageError::new("name", &self.path, e.error))
    }
}

/// The table of the motion, with its next chunk.
struct MotionTable {
    table: TableFile,
    numbers: [Float64Builder; 6],
    labels: [StringDictionaryBuilder<Int32Type>; 2],
    rows: usize,
}

impl MotionTable {
    fn create(to: &TablePath, about: &Metadata) -> Result<Self, StorageError> {
        let about = about.clone().with(DESCRIPTION, "the motion at a constant rate");
        let number = |name: &str, unit: &str, about: &str| Column::new(name, unit, about).field(DataType::Float64);
        let word = |name: &str, about: &str| {
            let kind = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
            Column::new(name, "", about).field(kind)
        };
        let second = "of the particle or tuned mass; that of the structure without one";
        let fields = vec![
            number("t_s", "s", "time"),
            number("x_m", "m", "displacement of the structure"),
            number("v_m_per_s", "m/s", "velocity of the structure"),
            number("y_m", "m", &format!("displacement {second}")),
            number("u_m_per_s", "m/s", &format!("velocity {second}")),
            number("z_m", "m", "displacement of the base"),
            word("structure", "free, or slipping or stuck on the friction damper"),
            word("particle", "between the walls, held by friction, resting on a wall, in the wall"),
        ];
        let labels = Default::default();
        Ok(Self {
            table: TableFile::create(to, "motion", fields, about)?,
            numbers: Default::default(),
            labels,
            rows: 0,
        })
    }

    fn flush(&mut self) -> Result<(), StorageError> {
        if self.rows == 0 {
            return Ok(());
        }
        self.rows = 0;
        let mut columns: Vec<ArrayRef> = self.numbers.iter_mut().map(|b| Arc::new(b.finish()) as ArrayRef).collect();
        columns.extend(self.labels.iter_mut().map(|b| Arc::new(b.finish()) as ArrayRef));
        self.table.write(columns)
    }
}

/// A table of wall events: impacts with their speed, or accumulations.
#[derive(Debug)]
struct WallEventTable {
    table: TableFile,
    time: Float64Builder,
    side: Int32Builder,
    speed: Option<Float64Builder>,
    rows: usize,
}

impl WallEventTable {
    fn impacts(to: &TablePath, about: &Metadata) -> Result<Self, StorageError> {
        let about = about.clone().with(DESCRIPTION, "a row for each impact");
        let speed = Column::from(Quantity::ApproachSpeedMPerS).field(DataType::Float64);
        Self::create(&to.impacts(), "impacts", "time", Some(speed), about)
    }

    fn accumulations(to: &TablePath, about: &Metadata) -> Result<Self, StorageError> {
        let about = about.clone().with(DESCRIPTION, "a row for each accumulation");
        Self::create(
            &to.accumulations(),
            "accumulations",
            "when the chatter ended and the particle rested on the wall",
            None,
            about,
        )
    }

    fn create(
        to: &TablePath,
        name: &'static str,
        time: &str,
        speed: Option<Field>,
        about: Metadata,
    ) -> Result<Self, StorageError> {
        let mut fields = vec![
            Column::new("t_s", "s", time).field(DataType::Float64),
            Column::from(Quantity::Side).field(DataType::Int32),
        ];
        let has_speed = speed.is_some();
        fields.extend(speed);
        Ok(Self {
            table: TableFile::create(to, name, fields, about)?,
            time: Float64Builder::new(),
            side: Int32Builder::new(),
            speed: has_speed.then(Float64Builder::new),
            rows: 0,
        })
    }

    fn take(&mut self, t_s: f64, side: i8, speed_m_per_s: f64) -> Result<(), StorageError> {
        self.time.append_value(t_s);
        self.side.append_value(i32::from(side));
        if let Some(speed) = &mut self.speed {
            speed.append_value(speed_m_per_s);
        }
        self.rows += 1;
        if self.rows >= CHUNK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), StorageError> {
        if self.rows == 0 {
            return Ok(());
        }
        self.rows = 0;
        let mut columns: Vec<ArrayRef> = vec![Arc::new(self.time.finish()), Arc::new(self.side.finish())];
        columns.extend(self.speed.as_mut().map(|speed| Arc::new(speed.finish()) as ArrayRef));
        self.table.write(columns)
    }

    fn finish(mut self) -> Result<(), StorageError> {
        self.flush()?;
        self.table.finish()
    }
}

/// Writes the motion at a constant rate, and every impact and accumulation.
pub struct TimeHistory {
    rate_hz: f64,
    next: u64,
    rows: u64,
    motion: MotionTable,
    impacts: Option<WallEventTable>,
    accumulations: Option<WallEventTable>,
    failure: Option<StorageError>,
}

impl TimeHistory {
    /// Creates the files: `rate_hz` rows per second from t = 0, and tables of impacts and accumulations if the case has impacts.
    ///
    /// # Errors
    /// When a file cannot be created.
    pub fn create(to: &TablePath, rate_hz: f64, case: &Case) -> Result<Self, StorageError> {
        let (about, has_walls) = (case.description(), case.has_impacts());
        let motion = MotionTable::create(to, &about)?;
        let impacts = has_walls.then(|| WallEventTable::impacts(to, &about)).transpose()?;
        let accumulations = has_walls.then(|| WallEventTable::accumulations(to, &about)).transpose()?;
        Ok(Self { rate_hz, next: 0, rows: 0, motion, impacts, accumulations, failure: None })
    }

    /// Rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Completes and renames the files.
    ///
    /// # Errors
    /// When a write has failed since [`TimeHistory::create`]; no file is left.
    pub fn finish(mut self) -> Result<(), StorageError> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        self.motion.flush()?;
        self.motion.table.finish()?;
        for events in [self.impacts, self.accumulations].into_iter().flatten() {
            events.finish()?;
        }
        Ok(())
    }

    fn keep_failure(&mut self, written: Result<(), StorageError>) {
        if let Err(failure) = written {
            self.failure.get_or_insert(failure);
        }
    }
}

impl Viewer for TimeHistory {
    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let mut phase: Option<Phase> = None;
        while self.failure.is_none() {
            let t_s = self.next as f64 / self.rate_hz;
            let after_s = t_s - start_s;
            // Rounding must not lose a row at the end of the run.
            if after_s > length_s + 4.0 * f64::EPSILON * t_s {
                return;
            }
            let phase = *phase.get_or_insert_with(|| piece.phase());
            let at = piece.at(after_s.clamp(0.0, length_s));
            let row = [t_s, at.state.x_m, at.state.v_m_per_s, at.state.y_m(), at.state.u_m_per_s(), at.z_m];
            for (builder, value) in self.motion.numbers.iter_mut().zip(row) {
                builder.append_value(value);
            }
            self.motion.labels[0].append_value(phase.structure());
            self.motion.labels[1].append_value(phase.particle());
            self.motion.rows += 1;
            self.next += 1;
            self.rows += 1;
            if self.motion.rows >= CHUNK {
                let written = self.motion.flush();
                self.keep_failure(written);
            }
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        let Some(impacts) = self.impacts.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = impacts.take(impact.t_s, impact.side, impact.approach_speed_m_per_s);
        self.keep_failure(written);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let Some(accumulations) = self.accumulations.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = accumulations.take(accumulation.t_s, accumulation.side, 0.0);
        self.keep_failure(written);
    }

    fn is_done(&self) -> bool {
        self.failure.is_some()
    }
}
