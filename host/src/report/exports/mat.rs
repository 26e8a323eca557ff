//! Exports to MATLAB's `.mat` (version 7, readable by MATLAB, Octave and `scipy.io.loadmat`).
//!
//! Variables: `run` (from the manifest), `results`, `samples` and, if the run has any, `transients` and `impacts`. Each is a
//! struct with a field per column: numbers as double column vectors, names as cell arrays of char. In `samples` and `impacts`
//! the fields `set_up` and `experiment` are indices, from 1, into the cell arrays `set_up_names` and `experiment_names` beside
//! them. `units` has the unit of each field, `descriptions` its meaning. `run.set_ups` has the parameters of the set-ups'
//! models, in the order of `run.set_up_names`.
//!
//! The library keeps the whole file in memory and ignores write errors. Hence the limit on its size, and the check that reads
//! the file back before it gets its name.

use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::time::{SystemTime, UNIX_EPOCH};

use indexmap::IndexMap;
use matrw::{CellArray, MatFile, MatVariable, MatlabType, NumericArray, Structure, load_matfile, save_matfile_v7};

use super::atomic_file::{OutFile, to_failure, write_export};
use super::columns::{self, Column, Values};
use super::facts::{self, Fact};
use super::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::run_folder::schema::manifest::SetUpRecord;
use crate::run_folder::{ReadError, RunFolder};

/// Beginning of the year 10000, s since 1970.
const YEAR_10000_S: u64 = 253_402_300_800;

/// The MATLAB exporter.
#[derive(Clone, Copy, Debug)]
pub struct Mat;

impl Exporter for Mat {
    fn usual_tables(&self) -> &'static [RunTable] {
        &RunTable::ALL
    }

    fn extension(&self) -> &'static str {
        "mat"
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, ReadError> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let path = file.path().to_str().ok_or_else(|| failed(&"the name is not UTF-8; give another with --out"))?;
            // The library writes the date into the file, and panics without one.
            let is_dated =
                SystemTime::now().duration_since(UNIX_EPOCH).is_ok_and(|since| since.as_secs() < YEAR_10000_S);
            if !is_dated {
                return Err(failed(
                    &"a .mat file states its date, and the clock of this machine is not set; set it, or use --format csv",
                ));
            }
            let mut exported = ExportSummary::default();
            let mut mat = MatFile::new();
            mat.insert("run", run_struct(run));
            let (mut units, mut descriptions, mut sums) = (IndexMap::new(), IndexMap::new(), Vec::new());
            for (table, columns) in columns::tables(run, part, &mut exported).map_err(|e| failed(&e))? {
                let of_columns = |what: fn(&Column) -> &str| {
                    structure(columns.iter().map(|column| (column.name.clone(), text(what(column)))))
                };
                units.insert(table.name().to_string(), of_columns(|column| &column.unit));
                if columns.iter().any(|column| !column.description.is_empty()) {
                    descriptions.insert(table.name().to_string(), of_columns(|column| &column.description));
                }
                sums.push((table, columns.iter().map(|c| (c.name.clone(), sum_of(&c.values))).collect::<Vec<_>>()));
                mat.insert(table.name(), to_variable(columns));
            }
            mat.insert("units", structure(units));
            if !descriptions.is_empty() {
                mat.insert("descriptions", structure(descriptions));
            }
            save_matfile_v7(path, mat, false).map_err(|e| failed(&e))?;
            compare(path, &sums).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// Length and digest of the numbers of a column; `None` for names.
fn sum_of(values: &Values) -> Option<(usize, u64)> {
    match values {
        Values::Numbers(all) => Some(sum(all)),
        Values::Places(all, _) => Some(sum(&from_one(all))),
        Values::Texts(_) => None,
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

/// An array of dimension `dim`. The constructor fails only if the number of values differs from it.
fn array(dim: [usize; 2], values: MatlabType) -> MatVariable {
    NumericArray::new(dim.to_vec(), values, None).map_or(MatVariable::Unsupported, MatVariable::NumericArray)
}

fn numbers(values: Vec<f64>) -> MatVariable {
    array([values.len(), 1], MatlabType::F64(values))
}

/// A char array. The library counts characters instead of bytes, so non-ASCII characters are written as `\u{…}`.
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

/// A table as a struct: a field per column, then the lists of names.
fn to_variable(columns: Vec<Column>) -> MatVariable {
    let mut fields = IndexMap::new();
    let mut lists = Vec::new();
    for Column { name, values, .. } in columns {
        let value = match values {
            Values::Numbers(all) => numbers(all),
            Values::Texts(all) => cells(&all),
            Values::Places(all, names) => {
                lists.push((format!("{name}_names"), cells(&names)));
                numbers(from_one(&all))
            }
        };
        fields.insert(name, value);
    }
    fields.extend(lists);
    structure(fields)
}

/// Places in a list as MATLAB counts them, from 1.
fn from_one(places: &[usize]) -> Vec<f64> {
    places.iter().map(|place| (place + 1) as f64).collect()
}

/// The struct `run`, from the manifest.
fn run_struct(run: &RunFolder) -> MatVariable {
    let records = &run.manifest().set_ups;
    let set_ups = |get: fn(&SetUpRecord) -> &String| cells(&records.iter().map(|s| get(s).clone()).collect::<Vec<_>>());
    let facts = facts::of_run(run).into_iter().map(|(name, fact)| match fact {
        Fact::Text(fact) => (name, text(&fact)),
        Fact::Number(fact) => (name, numbers(vec![fact])),
    });
    let parameters = facts::set_up_columns(records).into_iter().map(|(name, all)| (name.to_string(), numbers(all)));
    let of_set_ups = [
        ("set_up_names", set_ups(|s| &s.name)),
        ("set_up_labels", set_ups(|s| &s.label)),
        ("set_up_base_amplitudes_m", numbers(records.iter().map(|s| s.base_amplitude_m).collect())),
        ("set_ups", structure(parameters)),
    ];
    structure(facts.chain(of_set_ups).map(|(name, value)| (name.to_string(), value)))
}

type Sums = [(RunTable, Vec<(String, Option<(usize, u64)>)>)];

/// Whether the file is complete: the lengths of the variables, in tags of 8 bytes, add up from the header of 128 bytes to
/// the end of the file.
fn is_complete(path: &str) -> std::io::Result<bool> {
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

/// Checks that the file holds the expected numbers.
fn compare(path: &str, expected: &Sums) -> Result<(), String> {
    // The reader panics on a truncated file.
    if !is_complete(path).map_err(|e| format!("it could not be read back: {e}"))? {
        return Err("the file is truncated; is the disk full?".into());
    }
    let mut mat = load_matfile(path).map_err(|e| format!("it could not be read back: {e}"))?;
    for (table, columns) in expected {
        let table = table.name();
        let Some(MatVariable::Structure(mut fields)) = mat.take(table) else {
            return Err(format!("the written file lacks `{table}`; is the disk full?"));
        };
        for (name, expected) in columns {
            let read = fields.take(name);
            let is_same = match (read, expected) {
                // An empty array has no values to compare.
                (Some(_), None | Some((0, _))) => true,
                (Some(MatVariable::NumericArray(array)), Some(expected)) => {
                    array.real_to_vec::<f64>().is_some_and(|numbers| sum(&numbers) == *expected)
                }
                _ => false,
            };
            if !is_same {
                return Err(format!("`{table}.{name}` differs in the written file; is the disk full?"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truncated_or_changed_file_is_detected() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        let place = path.to_str().unwrap();
        let columns = vec![("x".to_string(), Some(sum(&[1.0, f64::NAN, -0.0])))];
        let expected = [(RunTable::Samples, columns)];
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
