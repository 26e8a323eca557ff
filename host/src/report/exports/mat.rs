//! MATLAB's `.mat` (version 7, as MATLAB, Octave and `scipy.io.loadmat` read it).
//!
//! Three variables: `run` (what the manifest tells), `samples` and `results` (and `transients` where a run has any): structs
//! with a field per column, numbers as double column vectors, names as cell arrays of char. `samples.set_up` and `samples.experiment` are places, from 1, in
//! the cell arrays `samples.set_up_names` and `samples.experiment_names`: a char array per row of telemetry would be most
//! of the file. `units.samples` and `units.results` have the unit of each field as char.
//!
//! The format's writer holds all of it in memory and passes over failing writes: so there is a limit, and the file is
//! read back and compared before it gets its name.

use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use arrow_array::RecordBatch;
use indexmap::IndexMap;
use matrw::{CellArray, MatFile, MatVariable, MatlabType, NumericArray, Structure, load_matfile, save_matfile_v7};

use super::atomic_file::{to_failure, write_whole};
use super::{Exported, Exporter, Part, Table};
use crate::run_folder::read::columns::{Value, unit, values};
use crate::run_folder::{ReadError, RunFolder};

/// Numbers in one file: 320 MB as doubles in memory (at most 400 MB were measured). MATLAB's
/// own limit is 2 GiB a variable.
pub const MOST_NUMBERS: usize = 40_000_000;

/// The longest name of a field that MATLAB takes.
const LONGEST_NAME: usize = 63;

/// The exporter.
#[derive(Clone, Copy, Debug)]
pub struct Mat;

/// A column as it is gathered.
#[derive(Debug)]
enum Column {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    /// Places from 1 in a list of names.
    Places(Vec<f64>, Vec<String>),
}

type Columns = IndexMap<String, (Column, String)>;

impl Exporter for Mat {
    fn usual_tables(&self) -> &'static [Table] {
        &[Table::Results, Table::Samples, Table::Transients]
    }

    fn extension(&self) -> &'static str {
        "mat"
    }

    fn export(&self, run: &RunFolder, part: &Part, out: &Path) -> Result<Exported, ReadError> {
        let failed = to_failure(out);
        write_whole(out, |file| {
            let path = file.path().to_str().ok_or_else(|| failed(&"the name is not UTF-8; give another with --out"))?;
            let mut exported = Exported::default();
            let mut mat = MatFile::new();
            mat.insert("run", facts(run));
            let (mut units, mut count) = (IndexMap::new(), 0);
            let mut sums = Vec::new();
            for &table in &part.tables {
                let mut columns = Columns::new();
                part.each(run, table, &mut exported, |batch| {
                    count += batch.num_rows() * batch.num_columns();
                    if count > MOST_NUMBERS {
                        return Err(failed(&format!(
                            "more than {MOST_NUMBERS} numbers, the most that a .mat file gets; choose fewer with \
                             --set-up, --from-s and --to-s, or take --format csv, which has no limit"
                        )));
                    }
                    gather(&mut columns, &batch, table)
                })?;
                if table == Table::Transients && columns.is_empty() {
                    // Most runs have none.
                    continue;
                }
                units.insert(
                    table.word().to_string(),
                    structure(columns.iter().map(|(n, (_, u))| (n.clone(), text(u)))),
                );
                sums.push((table, columns.iter().map(|(n, (c, _))| (n.clone(), c.sum())).collect::<Vec<_>>()));
                mat.insert(table.word(), to_variable(columns));
            }
            mat.insert("units", structure(units));
            save_matfile_v7(path, mat, false).map_err(|e| failed(&e))?;
            compare(path, &sums).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// A name that MATLAB takes for a field: a letter, then letters, digits and underscores, at most 63.
fn field_name(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        plain.insert_str(0, "x_");
    }
    plain.truncate(LONGEST_NAME);
    let shorter = &plain[..plain.len().min(LONGEST_NAME - 5)];
    let numbered = (2..).map(|n| format!("{shorter}_{n}"));
    std::iter::once(plain.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}

fn gather(columns: &mut Columns, batch: &RecordBatch, table: Table) -> Result<(), ReadError> {
    let schema = batch.schema();
    let is_first = columns.is_empty();
    for (index, (field, array)) in schema.fields().iter().zip(batch.columns()).enumerate() {
        let kind = array.data_type();
        let read = values(array.as_ref())
            .ok_or_else(|| ReadError(format!("column `{}` has the type {kind}, which no run has", field.name())))?;
        if is_first {
            let is_text = matches!(read.first(), Some(Value::Text(_)))
                || ["set_up", "experiment"].contains(&field.name().as_str());
            let column = match (is_text, table) {
                (false, _) => Column::Numbers(Vec::new()),
                (true, Table::Results | Table::Transients) => Column::Texts(Vec::new()),
                (true, Table::Samples) => Column::Places(Vec::new(), Vec::new()),
            };
            let name = field_name(field.name(), |n| columns.contains_key(n));
            columns.insert(name, (column, unit(field).to_string()));
        }
        let Some((_, (column, _))) = columns.get_index_mut(index) else {
            return Err(ReadError(format!("column `{}` is in some files of the run only", field.name())));
        };
        column.extend(read);
    }
    Ok(())
}

impl Column {
    fn extend(&mut self, read: Vec<Value>) {
        match self {
            Self::Numbers(all) => all.extend(read.iter().map(|v| v.number().unwrap_or(f64::NAN))),
            Self::Texts(all) => all.extend(read.iter().map(Value::to_string)),
            Self::Places(all, names) => all.extend(read.into_iter().map(|value| {
                let Value::Text(name) = value else { return f64::NAN };
                let place = names.iter().rposition(|n| *n == name).unwrap_or_else(|| {
                    names.push(name);
                    names.len() - 1
                });
                (place + 1) as f64
            })),
        }
    }

    /// Length and digest of the numbers; names have none.
    fn sum(&self) -> Option<(usize, u64)> {
        match self {
            Self::Numbers(all) | Self::Places(all, _) => Some(sum(all)),
            Self::Texts(_) => None,
        }
    }
}

fn sum(numbers: &[f64]) -> (usize, u64) {
    let mut hasher = DefaultHasher::new();
    numbers.iter().for_each(|n| n.to_bits().hash(&mut hasher));
    (numbers.len(), hasher.finish())
}

fn structure(fields: impl IntoIterator<Item = (String, MatVariable)>) -> MatVariable {
    MatVariable::Structure(Structure::new(fields.into_iter().collect()))
}

/// An array with as many values as `dim` says; the constructors fail on nothing else.
fn array(dim: [usize; 2], values: MatlabType) -> MatVariable {
    NumericArray::new(dim.to_vec(), values, None).map_or(MatVariable::Unsupported, MatVariable::NumericArray)
}

fn numbers(values: Vec<f64>) -> MatVariable {
    array([values.len(), 1], MatlabType::F64(values))
}

fn number(value: f64) -> MatVariable {
    numbers(vec![value])
}

/// The format's writer counts characters where bytes are meant: what is not ASCII is written as `\u{…}`.
fn text(value: &str) -> MatVariable {
    let plain: Vec<char> = value
        .chars()
        .flat_map(|c| if c.is_ascii() { c.to_string() } else { c.escape_unicode().to_string() }.into_bytes())
        .map(char::from)
        .collect();
    array([usize::from(!plain.is_empty()), plain.len()], MatlabType::UTF8(plain))
}

fn cells(values: &[String]) -> MatVariable {
    let texts = values.iter().map(|v| text(v)).collect();
    CellArray::new(vec![values.len(), 1], texts).map_or(MatVariable::Unsupported, MatVariable::CellArray)
}

fn to_variable(columns: Columns) -> MatVariable {
    let mut fields = IndexMap::new();
    let mut lists = Vec::new();
    for (name, (column, _)) in columns {
        let value = match column {
            Column::Numbers(all) => numbers(all),
            Column::Texts(all) => cells(&all),
            Column::Places(all, names) => {
                lists.push((format!("{name}_names"), cells(&names)));
                numbers(all)
            }
        };
        fields.insert(name, value);
    }
    fields.extend(lists);
    structure(fields)
}

/// What the manifest tells.
fn facts(run: &RunFolder) -> MatVariable {
    let m = run.manifest();
    let set_ups = |get: fn(&crate::run_folder::schema::manifest::SetUpRecord) -> &String| {
        cells(&m.set_ups.iter().map(|s| get(s).clone()).collect::<Vec<_>>())
    };
    let mut facts = vec![
        ("id", text(&run.id())),
        ("campaign", text(&m.campaign)),
        ("started", text(&m.started)),
        ("status", text(&m.ending_text())),
        ("program", text(&m.damprig)),
        ("points_planned", number(m.points_planned as f64)),
        ("points_taken", number(m.points_taken as f64)),
        ("telemetry_rate_hz", number(m.telemetry_rate_hz)),
        ("lost_rows", number(m.counters.lost_rows as f64)),
        ("interruptions", number(m.counters.interruptions as f64)),
        ("set_up_names", set_ups(|s| &s.name)),
        ("set_up_labels", set_ups(|s| &s.label)),
        ("set_up_base_amplitudes_m", numbers(m.set_ups.iter().map(|s| s.base_amplitude_m).collect())),
    ];
    if let Some(device) = &m.device {
        facts.extend([
            ("rig", text(&device.link)),
            ("board", text(&device.board)),
            ("firmware", text(&device.firmware)),
            ("protocol_schema", text(&device.protocol_schema)),
            ("tick_hz", number(device.tick_hz)),
        ]);
    }
    structure(facts.into_iter().map(|(name, value)| (name.to_string(), value)))
}

type Sums = [(Table, Vec<(String, Option<(usize, u64)>)>)];

/// Whether the variables' lengths, in the tags of 8 bytes before them, lead from the end of the header of 128 bytes to
/// that of the file.
fn is_whole(path: &str) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut place = 128;
    while place + 8 <= length {
        let mut tag = [0; 8];
        file.seek(SeekFrom::Start(place))?;
        file.read_exact(&mut tag)?;
        place += 8 + u64::from(u32::from_le_bytes([tag[4], tag[5], tag[6], tag[7]]));
    }
    Ok(place == length)
}

/// Whether the file holds the numbers that were to be written.
fn compare(path: &str, expected: &Sums) -> Result<(), String> {
    // First of all: the reader panics on a file that was cut.
    if !is_whole(path).map_err(|e| format!("it could not be read back: {e}"))? {
        return Err("it was cut short; is the disk full?".into());
    }
    let mut mat = load_matfile(path).map_err(|e| format!("it could not be read back: {e}"))?;
    for (table, columns) in expected {
        let table = table.word();
        let Some(MatVariable::Structure(mut fields)) = mat.take(table) else {
            return Err(format!("read back, it lacks `{table}`; is the disk full?"));
        };
        for (name, expected) in columns {
            let read = fields.take(name);
            let is_same = match (read, expected) {
                (Some(MatVariable::NumericArray(array)), Some(expected)) => {
                    array.real_to_vec::<f64>().is_some_and(|numbers| sum(&numbers) == *expected)
                }
                (Some(_), None) => true,
                _ => false,
            };
            if !is_same {
                return Err(format!("read back, `{table}.{name}` is not what was written; is the disk full?"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_a_field_is_one_that_matlab_takes() {
        assert_eq!(field_name("x_m", |_| false), "x_m");
        assert_eq!(field_name("2nd force (N)", |_| false), "x_2nd_force__N_");
        assert_eq!(field_name("", |_| false), "x_");
        assert_eq!(field_name("x_m", |n| n == "x_m"), "x_m_2");
        let long = field_name(&"ä".repeat(80), |n| !n.ends_with('3'));
        assert!(long.len() <= LONGEST_NAME && long.ends_with("_3"), "{long}");
    }

    #[test]
    fn a_file_that_was_cut_or_changed_is_not_taken_for_whole() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        let place = path.to_str().unwrap();
        let columns = vec![("x".to_string(), Some(sum(&[1.0, f64::NAN, -0.0])))];
        let expected = [(Table::Samples, columns)];
        let mut mat = MatFile::new();
        mat.insert("samples", structure([("x".to_string(), numbers(vec![1.0, f64::NAN, -0.0]))]));
        save_matfile_v7(place, mat, false).unwrap();
        assert_eq!(compare(place, &expected), Ok(()));
        let bytes = std::fs::read(place).unwrap();
        std::fs::write(place, &bytes[..bytes.len() - 9]).unwrap();
        assert!(compare(place, &expected).is_err());
        let mut changed = bytes.clone();
        let last = changed.len() - 20;
        changed[last] ^= 1;
        std::fs::write(place, &changed).unwrap();
        assert!(compare(place, &expected).is_err());
    }
}
