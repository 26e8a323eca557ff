//! Makes char arrays of the arrays of `uint16` in a `.mat` file: the library writes no text but ASCII.
//!
//! The format (MathWorks, "MAT-File Format", level 5): an element is a tag, its type and length in bytes, and its data, padded to
//! 8 bytes; up to 4 bytes are in the tag itself. A variable is an element `miMATRIX` of elements: flags with the class,
//! dimensions, name, then the data. A struct has the length of its fields' names, the names and a variable for each field; a cell
//! array has a variable for each cell. A char array may have its text as UTF-16: class `mxCHAR`, data of the type `miUTF16`.

use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Seek, SeekFrom, Write};

/// Length of a file's header.
const HEADER: u64 = 128;

/// Types of elements.
const MATRIX: u32 = 14;
const UTF16: u8 = 17;

/// Classes of variables.
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const UINT16: u8 = 11;

/// Makes char arrays of UTF-16 of all arrays of the class `uint16` in a whole, uncompressed file.
///
/// # Errors
/// The file cannot be read or written, or has another form.
pub(super) fn mark(path: &str) -> std::io::Result<()> {
    let mut file = OpenOptions::new().read(true).write(true).open(path)?;
    let end = file.metadata()?.len();
    variables(&mut file, HEADER, end)?;
    file.flush()
}

/// Marks the variables from one place in the file to another.
fn variables(file: &mut File, from: u64, end: u64) -> std::io::Result<()> {
    let mut place = from;
    while place < end {
        let (kind, length) = tag(file, place)?;
        if kind != MATRIX {
            return Err(Error::new(ErrorKind::InvalidData, format!("an element of type {kind} at byte {place}")));
        }
        let flags = place + 8;
        place = flags + u64::from(length);
        // The flags of a variable take 16 bytes; the class is the first byte of their data.
        let class_at = flags + 8;
        let name = after(file, flags + 16)?;
        let data = after(file, name)?;
        match byte(file, class_at)? {
            CELL => variables(file, data, place)?,
            STRUCT => {
                let names = after(file, data)?;
                let fields = after(file, names)?;
                variables(file, fields, place)?;
            }
            UINT16 => {
                put(file, class_at, CHAR)?;
                put(file, data, UTF16)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Type and length of an element whose data are not in its tag.
fn tag(file: &mut File, place: u64) -> std::io::Result<(u32, u32)> {
    let mut bytes = [0; 8];
    file.seek(SeekFrom::Start(place))?;
    file.read_exact(&mut bytes)?;
    let [a, b, c, d, e, f, g, h] = bytes;
    Ok((u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])))
}

/// The place after an element. One with its data in its tag has its length in the upper half of its type.
fn after(file: &mut File, place: u64) -> std::io::Result<u64> {
    let (kind, length) = tag(file, place)?;
    let is_small = kind >> 16 != 0;
    Ok(place + 8 + if is_small { 0 } else { u64::from(length).next_multiple_of(8) })
}

fn byte(file: &mut File, place: u64) -> std::io::Result<u8> {
    let mut byte = [0];
    file.seek(SeekFrom::Start(place))?;
    file.read_exact(&mut byte)?;
    Ok(byte[0])
}

fn put(file: &mut File, place: u64, byte: u8) -> std::io::Result<()> {
    file.seek(SeekFrom::Start(place))?;
    file.write_all(&[byte])
}
