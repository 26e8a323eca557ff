//! Writes a table to a file row by row, with constant memory; a `.mat` file is kept in memory until the end.

use std::path::{Path, PathBuf};

use arrow_schema::{Metadata, SchemaRef};
use matrw::MatFile;
use parquet::arrow::ArrowWriter;

use super::TableBuilder;
use super::csv::{CsvTable, Heads};
use super::gathered::{ColumnValues, Names, gather};
use super::mat_file::{MAX_NUMBERS, MatTable, write_checked};
use super::parquet_properties::properties;
use crate::failure::Failure;
use crate::storage::whole_file::WholeFile;

/// Rows in a chunk.
const CHUNK: usize = 16_384;

/// Format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Parquet.
    Parquet,
    /// CSV.
    Csv,
    /// MATLAB's version 7.
    Mat,
}

impl TableFormat {
    /// That of a file by its extension.
    ///
    /// # Errors
    /// Names the extensions that are supported.
    pub fn of(path: &Path) -> Result<Self, String> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("parquet") => Ok(Self::Parquet),
            Some("csv") => Ok(Self::Csv),
            Some("mat") => Ok(Self::Mat),
            Some(other) => Err(format!("the extension .{other} is not supported; use .parquet, .csv or .mat")),
            None => Err("the file needs an extension: .parquet, .csv or .mat".into()),
        }
    }

    /// The extension.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
            Self::Mat => "mat",
        }
    }
}

/// The columns of a table of such rows.
type Columns<R> = Box<dyn for<'r> Fn(&'r [R]) -> TableBuilder<'r, R> + Send>;

/// A table being written. The file gets its name in [`TableFile::finish`]; without it, it leaves nothing.
pub struct TableFile<R> {
    path: PathBuf,
    columns: Columns<R>,
    about: Metadata,
    rows: Vec<R>,
    to: TableSink,
}

enum TableSink {
    Parquet(Box<ArrowWriter<WholeFile>>),
    Csv(Box<CsvTable<WholeFile>>),
    /// With the name of the file's variable.
    Mat(&'static str, WholeFile, Vec<ColumnValues>),
}

impl<R> TableFile<R> {
    /// `name`: that of the variable of a `.mat` file. `about`: what the table says of itself.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(
        path: &Path,
        format: TableFormat,
        name: &'static str,
        columns: impl for<'r> Fn(&'r [R]) -> TableBuilder<'r, R> + Send + 'static,
        about: Metadata,
    ) -> Result<Self, Failure> {
        let file = WholeFile::create(path).map_err(|e| Failure::cannot("create", path, e))?;
        let failed = |e: Failure| Failure::cannot("write", path, e);
        let empty = columns(&[]).finish(about.clone()).map_err(failed)?;
        let to = match format {
            TableFormat::Parquet => {
                TableSink::Parquet(Box::new(parquet_writer(file, &empty.schema()).map_err(failed)?))
            }
            TableFormat::Csv => {
                TableSink::Csv(Box::new(CsvTable::new(file, &empty.schema(), Heads::Names).map_err(failed)?))
            }
            TableFormat::Mat => {
                let mut gathered = Vec::new();
                gather(&mut gathered, &empty, Names::AsPlaces).map_err(failed)?;
                TableSink::Mat(name, file, gathered)
            }
        };
        Ok(Self { path: path.to_path_buf(), columns: Box::new(columns), about, rows: Vec::new(), to })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// The file cannot be written, or is too long for its format.
    pub fn push(&mut self, row: R) -> Result<(), Failure> {
        self.rows.push(row);
        if self.rows.len() < CHUNK { Ok(()) } else { self.flush() }
    }

    /// Writes the remaining rows and gives the file its name, in place of an earlier one.
    ///
    /// # Errors
    /// The file cannot be written; none is left.
    pub fn finish(mut self) -> Result<(), Failure> {
        self.flush()?;
        let path = self.path;
        let file = match self.to {
            TableSink::Parquet(writer) => writer.into_inner().map_err(Failure::from),
            TableSink::Csv(writer) => writer.finish(),
            TableSink::Mat(name, file, columns) => write_mat(&file, name, columns).map(|()| file),
        };
        let file = file.map_err(|e| Failure::cannot("write", &path, e))?;
        file.replace().map_err(|e| Failure::cannot("write", &path, e))
    }

    fn flush(&mut self) -> Result<(), Failure> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let batch = (self.columns)(&self.rows).finish(self.about.clone());
        let written = batch.and_then(|batch| match &mut self.to {
            TableSink::Parquet(writer) => Ok(writer.write(&batch)?),
            TableSink::Csv(writer) => writer.write(&batch),
            TableSink::Mat(_, _, columns) => {
                let held: usize = columns.iter().map(|column| column.values.count()).sum();
                if held + batch.num_rows() * batch.num_columns() > MAX_NUMBERS {
                    let message = "a .mat file holds at most 2 GiB; lower --rate, or write .parquet";
                    return Err(Failure::Storage(message.into()));
                }
                gather(columns, &batch, Names::AsPlaces)
            }
        });
        self.rows.clear();
        written.map_err(|e| Failure::cannot("write", &self.path, e))
    }
}

fn parquet_writer(file: WholeFile, schema: &SchemaRef) -> Result<ArrowWriter<WholeFile>, Failure> {
    let properties = properties(schema).into_builder().set_max_row_group_row_count(Some(8 * CHUNK)).build();
    Ok(ArrowWriter::try_new(file, schema.clone(), Some(properties))?)
}

fn write_mat(file: &WholeFile, name: &'static str, columns: Vec<ColumnValues>) -> Result<(), Failure> {
    let path = file
        .path()
        .to_str()
        .ok_or_else(|| Failure::Storage("the name is not UTF-8; give another with --out".into()))?;
    let MatTable { variable, units, descriptions, sums } = MatTable::new(name, columns);
    let mut mat = MatFile::new();
    mat.insert(name, variable);
    mat.insert("units", units);
    if let Some(descriptions) = descriptions {
        mat.insert("descriptions", descriptions);
    }
    write_checked(path, mat, &[sums]).map_err(Failure::Storage)
}
