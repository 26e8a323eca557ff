//! MAT files of MATLAB 5 to 7 (their numeric arrays), and HDF5 files, which those of MATLAB 7.3 are.

use std::io::Read;

use flate2::read::ZlibDecoder;
use hdf5_pure::{AttrValue, CompoundField, CompoundType, Dataset, Datatype, File, FormatError, Group};

use super::Contents;
use super::columns::{FileColumn, signals};
use super::unit::of_column;

/// Bytes that a compressed variable may unpack to.
const MAX_UNPACKED: u64 = 1 << 30;

/// Structures within structures, and groups within groups.
const MAX_DEPTH: usize = 8;

/// The last signature of an HDF5 file is looked for at 0, 512, 1024, … up to here.
const MAX_USER_BLOCK: usize = 1 << 16;

const HDF5_SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Whether a file is HDF5, perhaps after a block of MATLAB's.
pub(super) fn is_hdf5(bytes: &[u8]) -> bool {
    let mut at = 0;
    while at < MAX_USER_BLOCK.min(bytes.len()) {
        if bytes[at..].starts_with(HDF5_SIGNATURE) {
            return true;
        }
        at = if at == 0 { 512 } else { 2 * at };
    }
    false
}

/// A cursor over data elements.
struct Elements<'b> {
    bytes: &'b [u8],
    at: usize,
    is_little: bool,
}

/// Types of data elements.
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

impl<'b> Elements<'b> {
    fn number(&self, at: usize) -> Option<u32> {
        let four: [u8; 4] = self.bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
    }

    /// Type and bytes of the next element; `None` at the end.
    fn next(&mut self) -> Result<Option<(u32, &'b [u8])>, String> {
        if self.at >= self.bytes.len() {
            return Ok(None);
        }
        let cut = || format!("byte {}: the file is cut short", self.at);
        let tag = self.number(self.at).ok_or_else(cut)?;
        // An element of up to four bytes is within its tag.
        let (kind, length, from) = match tag >> 16 {
            0 => (tag, self.number(self.at + 4).ok_or_else(cut)? as usize, self.at + 8),
            short => (tag & 0xffff, short as usize, self.at + 4),
        };
        let data = from.checked_add(length).and_then(|end| self.bytes.get(from..end)).ok_or_else(cut)?;
        let end = if tag >> 16 == 0 { from + length } else { self.at + 8 };
        self.at = if kind == COMPRESSED { end } else { end.next_multiple_of(8) };
        Ok(Some((kind, data)))
    }

    fn needed(&mut self, what: &str) -> Result<(u32, &'b [u8]), String> {
        self.next()?.ok_or_else(|| format!("a variable has no {what}: the file is damaged"))
    }
}

/// The numbers of an element.
fn numbers(kind: u32, data: &[u8], is_little: bool) -> Option<Vec<f64>> {
    macro_rules! read {
        ($number:ty) => {{
            let one = |part: &[u8]| {
                let part = part.try_into().unwrap_or_default();
                (if is_little { <$number>::from_le_bytes(part) } else { <$number>::from_be_bytes(part) }) as f64
            };
            data.chunks_exact(size_of::<$number>()).map(one).collect()
        }};
    }
    Some(match kind {
        1 => read!(i8),
        2 => read!(u8),
        3 => read!(i16),
        4 => read!(u16),
        5 => read!(i32),
        6 => read!(u32),
        7 => read!(f32),
        9 => read!(f64),
        12 => read!(i64),
        13 => read!(u64),
        _ => return None,
    })
}

/// Parses a MAT file of version 5 to 7.
pub(super) fn parse(bytes: &[u8]) -> Result<Contents, String> {
    let is_little = match bytes.get(126..128) {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => return Err("byte 126: the mark of the byte order is missing: the file is damaged".into()),
    };
    let mut remarks = Vec::new();
    let mut columns = Vec::new();
    let mut elements = Elements { bytes, at: 128, is_little };
    while let Some((kind, data)) = elements.next()? {
        match kind {
            COMPRESSED => {
                let mut unpacked = Vec::new();
                ZlibDecoder::new(data)
                    .take(MAX_UNPACKED)
                    .read_to_end(&mut unpacked)
                    .map_err(|error| format!("byte {}: a variable cannot be unpacked: {error}", elements.at))?;
                let mut inner = Elements { bytes: &unpacked, at: 0, is_little };
                if let Some((MATRIX, data)) = inner.next()? {
                    variable(data, is_little, "", 0, &mut columns, &mut remarks)?;
                }
            }
            MATRIX => variable(data, is_little, "", 0, &mut columns, &mut remarks)?,
            _ => {}
        }
    }
    Ok(Contents { kind: "MATLAB file", signals: signals(columns, &mut remarks), remarks })
}

fn variable(
    data: &[u8],
    is_little: bool,
    parent: &str,
    depth: usize,
    columns: &mut Vec<FileColumn>,
    remarks: &mut Vec<String>,
) -> Result<(), String> {
    let mut parts = Elements { bytes: data, at: 0, is_little };
    let (_, flags) = parts.needed("flags")?;
    let flags = Elements { bytes: flags, at: 0, is_little }.number(0).unwrap_or_default();
    let (class, is_complex) = (flags & 0xff, flags & 0x0800 != 0);
    let (kind, shape) = parts.needed("dimensions")?;
    let shape = numbers(kind, shape, is_little).unwrap_or_default();
    let (_, name) = parts.needed("name")?;
    let own = String::from_utf8_lossy(name).into_owned();
    let name = if parent.is_empty() { own } else { parent.to_string() };
    match class {
        // Real and complex arrays of numbers.
        6..=15 => {
            let (kind, real) = parts.needed("values")?;
            let values = numbers(kind, real, is_little)
                .ok_or_else(|| format!("{name}: its values have the unknown type {kind}"))?;
            let imaginary = if is_complex {
                let (kind, imaginary) = parts.needed("imaginary values")?;
                numbers(kind, imaginary, is_little).filter(|imaginary| imaginary.len() == values.len())
            } else {
                None
            };
            let rows = if shape.len() == 2 && shape[0] > 1.0 { shape[0] as usize } else { values.len() };
            array(&name, rows, &values, imaginary.as_deref(), columns, remarks);
        }
        2 if depth < MAX_DEPTH && shape.iter().all(|size| *size == 1.0) => {
            let (kind, length) = parts.needed("length of its fields' names")?;
            let length =
                numbers(kind, length, is_little).and_then(|numbers| numbers.first().copied()).unwrap_or_default();
            let (_, names) = parts.needed("names of its fields")?;
            for field in names.chunks_exact((length as usize).max(1)) {
                let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
                let field = String::from_utf8_lossy(&field[..end]);
                if let (MATRIX, data) = parts.needed("field")? {
                    variable(data, is_little, &format!("{name}.{field}"), depth + 1, columns, remarks)?;
                }
            }
        }
        _ => remarks.push(format!("The variable {name:?} is not read: it is no array of numbers.")),
    }
    Ok(())
}

/// A column for each column of an array with at least two rows; single numbers are remarks.
fn array(
    name: &str,
    rows: usize,
    values: &[f64],
    imaginary: Option<&[f64]>,
    columns: &mut Vec<FileColumn>,
    remarks: &mut Vec<String>,
) {
    if let [only] = values {
        remarks.push(format!("{name} = {only}"));
    }
    if rows < 2 || values.len() < rows {
        return;
    }
    let (plain, unit_text) = of_column(name);
    let several = values.len() / rows > 1;
    for (n, column) in values.chunks_exact(rows).enumerate() {
        columns.push(FileColumn {
            name: if several { format!("{plain}(:,{})", n + 1) } else { plain.clone() },
            unit_text: unit_text.clone(),
            values: column.to_vec(),
            imaginary: imaginary.map(|imaginary| imaginary[n * rows..(n + 1) * rows].to_vec()),
        });
    }
}

/// Parses an HDF5 file.
pub(super) fn parse_hdf5(bytes: &[u8]) -> Result<Contents, String> {
    let damaged = |error: hdf5_pure::Error| format!("the HDF5 file cannot be read: {error}");
    let file = File::from_bytes(bytes.to_vec()).map_err(damaged)?;
    let (mut columns, mut remarks) = (Vec::new(), Vec::new());
    group(&file.root(), "", 0, &mut columns, &mut remarks).map_err(damaged)?;
    let kind = if bytes.starts_with(b"MATLAB 7.3") { "MATLAB 7.3 file (HDF5)" } else { "HDF5 file" };
    Ok(Contents { kind, signals: signals(columns, &mut remarks), remarks })
}

/// A complex number, which MATLAB keeps as `real` and `imag`, other programs as `r` and `i`.
struct Complex {
    real: f64,
    imaginary: f64,
}

impl CompoundType for Complex {
    fn datatype() -> Result<Datatype, FormatError> {
        <(f64, f64) as CompoundType>::datatype()
    }

    fn encode(&self, output: &mut Vec<u8>) {
        (self.real, self.imaginary).encode(output);
    }

    fn decode(datatype: &Datatype, bytes: &[u8]) -> Result<Self, FormatError> {
        let Datatype::Compound { members, .. } = datatype else {
            return Err(FormatError::CompoundFieldTypeMismatch("complex".into()));
        };
        let part = |names: [&str; 2]| {
            let missing = || FormatError::CompoundFieldTypeMismatch(names[0].into());
            let member = members.iter().find(|member| names.contains(&member.name.as_str())).ok_or_else(missing)?;
            let from = bytes.get(member.byte_offset as usize..).ok_or_else(missing)?;
            let of = |width: usize| from.get(..width).ok_or_else(missing);
            f64::decode_field(&member.datatype, of(8).unwrap_or_default())
                .or_else(|_| f32::decode_field(&member.datatype, of(4)?).map(f64::from))
        };
        match members.len() {
            2 => Ok(Self { real: part(["real", "r"])?, imaginary: part(["imag", "i"])? }),
            _ => Err(FormatError::CompoundFieldTypeMismatch("complex".into())),
        }
    }
}

/// Values of a dataset of numbers, with imaginary parts if they are complex.
fn numbers_of(dataset: &Dataset) -> Option<(Vec<f64>, Option<Vec<f64>>)> {
    if let Ok(values) = dataset.read_f64() {
        return Some((values, None));
    }
    let values = dataset.read_compound::<Complex>().ok()?;
    Some((values.iter().map(|c| c.real).collect(), Some(values.iter().map(|c| c.imaginary).collect())))
}

fn group(
    own: &Group,
    path: &str,
    depth: usize,
    columns: &mut Vec<FileColumn>,
    remarks: &mut Vec<String>,
) -> Result<(), hdf5_pure::Error> {
    for name in own.datasets()? {
        let dataset = own.dataset(&name)?;
        let shape = dataset.shape()?;
        let full = format!("{path}{name}");
        let Some((values, imaginary)) = numbers_of(&dataset) else {
            remarks.push(format!("The dataset {full:?} is not read: it is no array of numbers."));
            continue;
        };
        // A vector, or the columns of a matrix: MATLAB writes the first dimension last.
        let rows = shape.iter().copied().max().unwrap_or_default() as usize;
        let before = columns.len();
        array(&full, rows, &values, imaginary.as_deref(), columns, remarks);
        let unit = dataset.attrs()?.into_iter().find_map(|(key, value)| match value {
            AttrValue::String(value)
            | AttrValue::AsciiString(value)
            | AttrValue::VarLenString(value)
            | AttrValue::VarLenAsciiString(value)
            | AttrValue::StringSized { value, .. }
            | AttrValue::AsciiStringSized { value, .. }
                if key == "unit" || key == "units" =>
            {
                Some(value)
            }
            _ => None,
        });
        if let Some(unit) = unit {
            columns[before..].iter_mut().for_each(|column| column.unit_text.clone_from(&unit));
        }
    }
    if depth < MAX_DEPTH {
        for name in own.groups()? {
            // MATLAB keeps its references here.
            if name != "#refs#" {
                group(&own.group(&name)?, &format!("{path}{name}/"), depth + 1, columns, remarks)?;
            }
        }
    }
    Ok(())
}
