//! The time history of a run as a table in a file, written in chunks while it runs: memory does not grow.
//!
//! A file is written beside its place and gets its name when it is whole; a run that is stopped is whole up to there.
//! Impacts and accumulations have tables of their own beside it (`motion.csv`, `motion.impacts.csv`,
//! `motion.accumulations.csv`).

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, Int32Builder, StringDictionaryBuilder};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::ArrowWriter;

use super::motion::{AccumulationRecord, ImpactRecord, Phase, Piece, Viewer};
use crate::run_folder::StorageError;
use crate::run_folder::read::columns::values;
use crate::run_folder::schema::table::field;
use crate::run_folder::write::parquet_file::properties;

/// Rows in a chunk.
const CHUNK: usize = 16_384;

/// A file for a table; the extension says the format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TablePath {
    path: PathBuf,
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Parquet,
    Csv,
}

impl TablePath {
    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes that a row of a history takes, about: as measured on a forced impact damper at 500 Hz.
    #[must_use]
    pub fn bytes_a_row(&self) -> f64 {
        if self.format == Format::Csv { 140.0 } else { 23.0 }
    }

    /// The table of impacts beside it.
    #[must_use]
    pub fn impacts(&self) -> Self {
        self.beside("impacts")
    }

    /// The table of accumulations beside it.
    #[must_use]
    pub fn accumulations(&self) -> Self {
        self.beside("accumulations")
    }

    fn beside(&self, what: &str) -> Self {
        let extension = if self.format == Format::Csv { "csv" } else { "parquet" };
        Self { path: self.path.with_extension(format!("{what}.{extension}")), format: self.format }
    }
}

impl FromStr for TablePath {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let format = match extension.as_deref() {
            Some("parquet") => Format::Parquet,
            Some("csv") => Format::Csv,
            Some(other) => return Err(format!("the extension .{other} is none of those allowed: .parquet, .csv")),
            None => return Err("the file needs an extension: .parquet or .csv".into()),
        };
        Ok(Self { path, format })
    }
}

/// A table that is being written.
#[derive(Debug)]
struct Table {
    path: PathBuf,
    beside: PathBuf,
    schema: SchemaRef,
    writer: Writer,
}

#[derive(Debug)]
enum Writer {
    Parquet(Box<ArrowWriter<File>>),
    Csv(Box<csv::Writer<File>>),
}

impl Table {
    fn create(to: &TablePath, fields: Vec<Field>) -> Result<Self, StorageError> {
        let beside = PathBuf::from(format!("{}.tmp", to.path.display()));
        let file = File::create(&beside).map_err(|e| StorageError::new("create", &beside, e))?;
        let schema = Arc::new(Schema::new(fields));
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &beside, e);
        let writer = match to.format {
            Format::Parquet => {
                let properties =
                    properties(&schema).into_builder().set_max_row_group_row_count(Some(8 * CHUNK)).build();
                let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties)).map_err(|e| failed(&e))?;
                Writer::Parquet(Box::new(writer))
            }
            Format::Csv => {
                let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(file);
                writer.write_record(schema.fields().iter().map(|f| f.name())).map_err(|e| failed(&e))?;
                Writer::Csv(Box::new(writer))
            }
        };
        Ok(Self { path: to.path.clone(), beside, schema, writer })
    }

    fn write(&mut self, columns: Vec<ArrayRef>) -> Result<(), StorageError> {
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &self.beside, e);
        let batch = RecordBatch::try_new(self.schema.clone(), columns).map_err(|e| failed(&e))?;
        match &mut self.writer {
            Writer::Parquet(writer) => writer.write(&batch).map_err(|e| failed(&e)),
            Writer::Csv(writer) => {
                let columns: Vec<_> = batch.columns().iter().filter_map(|c| values(c.as_ref())).collect();
                for row in 0..batch.num_rows() {
                    writer.write_record(columns.iter().map(|c| c[row].to_string())).map_err(|e| failed(&e))?;
                }
                Ok(())
            }
        }
    }

    fn finish(self) -> Result<(), StorageError> {
        let failed = |e: &dyn std::fmt::Display| StorageError::new("write", &self.beside, e);
        match self.writer {
            Writer::Parquet(writer) => drop(writer.close().map_err(|e| failed(&e))?),
            Writer::Csv(mut writer) => writer.flush().map_err(|e| failed(&e))?,
        }
        fs::rename(&self.beside, &self.path).map_err(|e| StorageError::new("name", &self.path, e))
    }
}

/// A table and what its next chunk holds.
struct Motion {
    table: Table,
    numbers: [Float64Builder; 6],
    words: [StringDictionaryBuilder<Int32Type>; 2],
    rows: usize,
}

impl Motion {
    fn create(to: &TablePath) -> Result<Self, StorageError> {
        let number = |name: &str, unit: &str, about: &str| described(field(name, DataType::Float64, unit), about);
        let word = |name: &str, about: &str| {
            let kind = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
            described(field(name, kind, ""), about)
        };
        let second = "of particle or tuned mass; without one the structure's own";
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
        let words = Default::default();
        Ok(Self { table: Table::create(to, fields)?, numbers: Default::default(), words, rows: 0 })
    }

    fn flush(&mut self) -> Result<(), StorageError> {
        if self.rows == 0 {
            return Ok(());
        }
        self.rows = 0;
        let mut columns: Vec<ArrayRef> = self.numbers.iter_mut().map(|b| Arc::new(b.finish()) as ArrayRef).collect();
        columns.extend(self.words.iter_mut().map(|b| Arc::new(b.finish()) as ArrayRef));
        self.table.write(columns)
    }
}

/// A table of what happened at a wall: impacts with their speed, or accumulations without one.
#[derive(Debug)]
struct WallEvents {
    table: Table,
    time: Float64Builder,
    side: Int32Builder,
    speed: Option<Float64Builder>,
    rows: usize,
}

impl WallEvents {
    fn impacts(to: &TablePath) -> Result<Self, StorageError> {
        let speed = described(field("approach_speed_m_per_s", DataType::Float64, "m/s"), "|x' - y'| just before");
        Self::create(&to.impacts(), "time", Some(speed))
    }

    fn accumulations(to: &TablePath) -> Result<Self, StorageError> {
        Self::create(&to.accumulations(), "when the chatter ended and the particle rested on the wall", None)
    }

    fn create(to: &TablePath, time: &str, speed: Option<Field>) -> Result<Self, StorageError> {
        let mut fields = vec![
            described(field("t_s", DataType::Float64, "s"), time),
            described(field("side", DataType::Int32, ""), "+1 where y - x = +d, -1 where y - x = -d"),
        ];
        let has_speed = speed.is_some();
        fields.extend(speed);
        Ok(Self {
            table: Table::create(to, fields)?,
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

fn described(field: Field, about: &str) -> Field {
    let mut metadata = field.metadata().clone();
    metadata.insert("description", about);
    field.with_metadata(metadata)
}

/// Writes the motion at equal intervals, and every impact and accumulation.
pub struct History {
    rate_hz: f64,
    next: u64,
    rows: u64,
    motion: Motion,
    impacts: Option<WallEvents>,
    accumulations: Option<WallEvents>,
    failure: Option<StorageError>,
}

impl History {
    /// Begins the files: `rate_hz` rows a second from t = 0 on, and tables of impacts and accumulations if `has_walls`.
    ///
    /// # Errors
    /// When a file cannot be created.
    pub fn create(to: &TablePath, rate_hz: f64, has_walls: bool) -> Result<Self, StorageError> {
        let motion = Motion::create(to)?;
        let impacts = has_walls.then(|| WallEvents::impacts(to)).transpose()?;
        let accumulations = has_walls.then(|| WallEvents::accumulations(to)).transpose()?;
        Ok(Self { rate_hz, next: 0, rows: 0, motion, impacts, accumulations, failure: None })
    }

    /// Rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Completes the files and gives them their names.
    ///
    /// # Errors
    /// When anything since [`History::create`] could not be written; what could is in a file ending in `.tmp`.
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

    fn note(&mut self, written: Result<(), StorageError>) {
        if let Err(failure) = written {
            self.failure.get_or_insert(failure);
        }
    }
}

impl Viewer for History {
    fn piece(&mut self, piece: &impl Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let mut phase: Option<Phase> = None;
        while self.failure.is_none() {
            let t_s = self.next as f64 / self.rate_hz;
            let after_s = t_s - start_s;
            // A row that falls on the end of the run is not lost to rounding.
            if after_s > length_s + 4.0 * f64::EPSILON * t_s {
                return;
            }
            let phase = *phase.get_or_insert_with(|| piece.phase());
            let at = piece.at(after_s.clamp(0.0, length_s));
            let row = [t_s, at.state.x_m, at.state.v_m_per_s, at.state.y_m(), at.state.u_m_per_s(), at.z_m];
            for (builder, value) in self.motion.numbers.iter_mut().zip(row) {
                builder.append_value(value);
            }
            self.motion.words[0].append_value(phase.structure());
            self.motion.words[1].append_value(phase.particle());
            self.motion.rows += 1;
            self.next += 1;
            self.rows += 1;
            if self.motion.rows >= CHUNK {
                let written = self.motion.flush();
                self.note(written);
            }
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        let Some(impacts) = self.impacts.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = impacts.take(impact.t_s, impact.side, impact.approach_speed_m_per_s);
        self.note(written);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let Some(accumulations) = self.accumulations.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = accumulations.take(accumulation.t_s, accumulation.side, 0.0);
        self.note(written);
    }

    fn is_done(&self) -> bool {
        self.failure.is_some()
    }
}
