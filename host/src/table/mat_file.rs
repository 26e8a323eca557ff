//! Writes `.mat` files (version 7, readable by MATLAB, Octave and `scipy.io.loadmat`) and checks them by reading them back.
//!
//! The library keeps the whole file in memory and ignores write errors, hence the check.

use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::time::{SystemTime, UNIX_EPOCH};

use matrw::{CellArray, MatFile, MatVariable, MatlabType, NumericArray, Structure, load_matfile, save_matfile_v7};

use super::gathered::{ColumnValues, Values};
use super::mat_text;

/// Beginning of the year 10000, s since 1970.
const YEAR_10000_S: u64 = 253_402_300_800;

/// Most numbers of a table: the 2 GiB of a variable, less room for the names and dimensions of its fields.
pub const MAX_NUMBERS: usize = ((1 << 31) - (1 << 20)) / size_of::<f64>();

/// Length and digest of the numbers of a column.
pub type Sum = (usize, u64);

/// A variable with the numbers that its fields must have; `None` for a field that is no column of numbers.
pub type TableSums = (String, Vec<(String, Option<Sum>)>);

/// A table as a variable, and what a file says of it.
pub struct MatTable {
    /// A struct with a field per column, then the lists of names that places refer to.
    pub variable: MatVariable,
    /// The unit of each field.
    pub units: MatVariable,
    /// The meaning of each field, if any is known.
    pub descriptions: Option<MatVariable>,
    /// What is read back.
    pub sums: TableSums,
}

impl MatTable {
    /// Of gathered columns.
    #[must_use]
    pub fn new(name: &str, columns: Vec<ColumnValues>) -> Self {
        let of_columns = |what: fn(&ColumnValues) -> &str| {
            structure(columns.iter().map(|column| (column.name.clone(), text(what(column)))))
        };
        let units = of_columns(|column| &column.unit);
        let is_described = columns.iter().any(|column| !column.description.is_empty());
        let descriptions = is_described.then(|| of_columns(|column| &column.description));
        let (mut fields, mut lists, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        for ColumnValues { name, values, .. } in columns {
            let (sum, value) = match values {
                Values::Numbers(all) => (Some(sum(&all)), numbers(all)),
                Values::Texts(all) => (None, cells(&all)),
                Values::Places(all, names) => {
                    // MATLAB counts from 1.
                    let all: Vec<f64> = all.iter().map(|place| (place + 1) as f64).collect();
                    lists.push((format!("{name}_names"), cells(&names)));
                    (Some(sum(&all)), numbers(all))
                }
            };
            sums.push((name.clone(), sum));
            fields.push((name, value));
        }
        fields.extend(lists);
        Self { variable: structure(fields), units, descriptions, sums: (name.to_string(), sums) }
    }
}

/// Writes the variables and reads them back.
///
/// # Errors
/// A clock that is not set (the file states its date, and the library panics without one); a file that is not what was written.
pub fn write_checked(path: &str, mat: MatFile, expected: &[TableSums]) -> Result<(), String> {
    let is_dated = SystemTime::now().duration_since(UNIX_EPOCH).is_ok_and(|since| since.as_secs() < YEAR_10000_S);
    if !is_dated {
        return Err(
            "a .mat file states its date, and the clock of this machine is not set; set it, or use --format csv or a .csv file".into()
        );
    }
    save_matfile_v7(path, mat, false).map_err(|e| e.to_string())?;
    refuse_truncated(path)?;
    mat_text::mark(path).map_err(|e| format!("its texts could not be written: {e}"))?;
    compare(path, expected)
}

/// Length and digest of numbers.
#[must_use]
pub fn sum(numbers: &[f64]) -> (usize, u64) {
    let mut hasher = DefaultHasher::new();
    numbers.iter().for_each(|n| n.to_bits().hash(&mut hasher));
    (numbers.len(), hasher.finish())
}

/// A struct with these fields.
pub fn structure(fields: impl IntoIterator<Item = (String, MatVariable)>) -> MatVariable {
    MatVariable::Structure(Structure::new(fields.into_iter().collect()))
}

/// An array of dimension `dim`. The constructor fails only if the number of values differs from it.
fn array(dim: [usize; 2], values: MatlabType) -> MatVariable {
    NumericArray::new(dim.to_vec(), values, None).map_or(MatVariable::Unsupported, MatVariable::NumericArray)
}

/// A column vector.
#[must_use]
pub fn numbers(values: Vec<f64>) -> MatVariable {
    array([values.len(), 1], MatlabType::F64(values))
}

/// A char array. The library writes ASCII alone: other text becomes an array of UTF-16 code units, of which `mat_text`
/// makes a char array in the file. Characters of two code units (beyond U+FFFF, as emoji) are written as `\u{…}`: `scipy` reads
/// no file that has them.
#[must_use]
pub fn text(value: &str) -> MatVariable {
    if value.is_ascii() {
        let plain: Vec<char> = value.chars().collect();
        return array([usize::from(!plain.is_empty()), plain.len()], MatlabType::UTF8(plain));
    }
    let escaped = |c: char| if c.len_utf16() == 1 { c.to_string() } else { c.escape_unicode().to_string() };
    let units: Vec<u16> = value.chars().map(escaped).collect::<String>().encode_utf16().collect();
    array([1, units.len()], MatlabType::U16(units))
}

/// A cell array of texts.
#[must_use]
pub fn cells(values: &[String]) -> MatVariable {
    let texts = values.iter().map(|v| text(v)).collect();
    CellArray::new(vec![values.len(), 1], texts).map_or(MatVariable::Unsupported, MatVariable::CellArray)
}

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

fn refuse_truncated(path: &str) -> Result<(), String> {
    match is_complete(path) {
        Ok(true) => Ok(()),
        Ok(false) => Err("the file is truncated; is the disk full?".into()),
        Err(error) => Err(format!("it could not be read back: {error}")),
    }
}

/// Checks that the file holds the expected numbers.
fn compare(path: &str, expected: &[TableSums]) -> Result<(), String> {
    // The reader panics on a truncated file.
    refuse_truncated(path)?;
    let mut mat = load_matfile(path).map_err(|e| format!("it could not be read back: {e}"))?;
    for (table, columns) in expected {
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
        let expected = [("samples".to_string(), columns)];
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

    /// Texts in every place where a file has them, with one, two and more code units: their elements have different shapes.
    #[test]
    fn texts_of_other_alphabets_are_read_back_as_they_are() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        let place = path.to_str().unwrap();
        let texts = ["Körnerdämpfer", "µ", "öä", "öäü", "plain", "", "测试, Δ"].map(String::from);
        let columns = vec![("counts".to_string(), Some(sum(&[500.0, 600.0])))];
        let fields = [
            ("counts".to_string(), numbers(vec![500.0, 600.0])),
            ("name".to_string(), text("Müller")),
            ("a_name_of_more_than_eight_letters".to_string(), structure([("inner".to_string(), cells(&texts))])),
            ("last".to_string(), text("e\u{1f600}é")),
        ];
        let mut mat = MatFile::new();
        mat.insert("run", structure(fields));
        mat.insert("units", structure([("x".to_string(), text("µm"))]));
        write_checked(place, mat, &[("run".to_string(), columns)]).unwrap();
        let mut read = load_matfile(place).unwrap();
        let is = |variable: Option<MatVariable>, expected: &str| match variable {
            Some(MatVariable::NumericArray(array)) if !expected.is_empty() => {
                let (MatlabType::UTF8(read) | MatlabType::UTF16(read)) = array.value else { panic!("no text") };
                assert_eq!(read.into_iter().collect::<String>(), expected);
                assert_eq!(array.dim, [1, expected.encode_utf16().count()]);
            }
            Some(MatVariable::NumericArray(array)) => assert_eq!(array.dim, [0, 0]),
            other => panic!("{expected:?}: {other:?}"),
        };
        let Some(MatVariable::Structure(mut run)) = read.take("run") else { panic!("no struct") };
        is(run.take("name"), "Müller");
        is(run.take("last"), "e\\u{1f600}é");
        let Some(MatVariable::Structure(mut inner)) = run.take("a_name_of_more_than_eight_letters") else { panic!() };
        let Some(MatVariable::CellArray(listed)) = inner.take("inner") else { panic!("no cells") };
        assert_eq!(listed.value.len(), texts.len());
        listed.value.into_iter().zip(&texts).for_each(|(variable, expected)| is(Some(variable), expected));
        let Some(MatVariable::Structure(mut units)) = read.take("units") else { panic!("no struct") };
        is(units.take("x"), "µm");
    }
}
