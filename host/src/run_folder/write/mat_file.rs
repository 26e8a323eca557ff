//! Writes `.mat` files (version 7, readable by MATLAB, Octave and `scipy.io.loadmat`) and checks them by reading them back.
//!
//! The library keeps the whole file in memory and ignores write errors, hence the check.

use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::time::{SystemTime, UNIX_EPOCH};

use matrw::{CellArray, MatFile, MatVariable, MatlabType, NumericArray, Structure, load_matfile, save_matfile_v7};

/// Beginning of the year 10000, s since 1970.
const YEAR_10000_S: u64 = 253_402_300_800;

/// Length and digest of the numbers of a column.
pub type Sum = (usize, u64);

/// A variable with the numbers that its fields must have; `None` for a field that is no column of numbers.
pub type TableSums = (String, Vec<(String, Option<Sum>)>);

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

/// A char array. The library counts characters instead of bytes, so non-ASCII characters are written as `\u{…}`.
#[must_use]
pub fn text(value: &str) -> MatVariable {
    let plain: Vec<char> = value
        .chars()
        .flat_map(|c| if c.is_ascii() { c.to_string() } else { c.escape_unicode().to_string() }.into_bytes())
        .map(char::from)
        .collect();
    array([usize::from(!plain.is_empty()), plain.len()], MatlabType::UTF8(plain))
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

/// Checks that the file holds the expected numbers.
fn compare(path: &str, expected: &[TableSums]) -> Result<(), String> {
    // The reader panics on a truncated file.
    if !is_complete(path).map_err(|e| format!("it could not be read back: {e}"))? {
        return Err("the file is truncated; is the disk full?".into());
    }
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
}
