//! Parquet files that carry their own SHA-256.
//!
//! The digest lies between the last row group and the footer, where readers look for nothing: every Parquet reader reads such a file. A
//! key of the schema says that there is one, so that a file which lost it is told from one of an older version.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use sha2::{Digest, Sha256};

use super::checksum::{HashWriter, of_bytes};
use crate::failure::Failure;
use crate::table::parquet_properties::properties;

/// Key of the schema's metadata that says that a file has a digest.
const KEY: &str = "damprig.sha256";

/// What that key says.
const MEANING: &str = "of the file without the 40 bytes before the footer, which are `sha-256:` and the digest";

/// Before the digest.
const MARK: &[u8; 8] = b"sha-256:";

/// Mark and digest.
const SEAL_BYTES: usize = MARK.len() + 32;

/// Length of the footer, and the closing mark of Parquet.
const TAIL_BYTES: usize = 8;

/// The schema of a file with a digest.
#[must_use]
pub fn schema(of: &Schema) -> SchemaRef {
    let mut metadata = of.metadata().clone();
    metadata.insert(KEY, MEANING);
    Arc::new(of.clone().with_metadata(metadata))
}

/// A table as a whole Parquet file with a digest.
///
/// # Errors
/// When it cannot be encoded.
pub fn bytes(table: &RecordBatch) -> Result<Vec<u8>, Failure> {
    let schema = schema(&table.schema());
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, schema.clone(), Some(properties(&schema)))?;
    writer.write(&table.clone().with_schema(schema)?)?;
    writer.close()?;
    let digest = Sha256::digest(&bytes);
    let footer = footer(&bytes).ok_or_else(|| Failure::Storage("the footer is not at the end".into()))?;
    bytes.splice(footer..footer, MARK.iter().copied().chain(digest));
    Ok(bytes)
}

/// Key of the identity in the metadata of a file.
pub const IDENTITY: &str = "damprig.identity";

/// The beginning of an identity, as figures state it.
#[must_use]
pub fn short(identity: &str) -> &str {
    identity.get(..12).unwrap_or(identity)
}

/// A table with the identity of its content in its metadata, and that identity: figures of the table state it too.
///
/// # Errors
/// When the table cannot be encoded.
pub fn identified(table: &RecordBatch) -> Result<(RecordBatch, String), Failure> {
    let identity = of_bytes(&bytes(table)?);
    let mut about = table.schema().metadata().clone();
    about.insert(IDENTITY, identity.as_str());
    let schema = Arc::new(table.schema().as_ref().clone().with_metadata(about));
    Ok((table.clone().with_schema(schema)?, identity))
}

/// Adds the digest to a whole Parquet file whose schema is that of [`schema`].
///
/// # Errors
/// When the file cannot be read or written.
pub fn seal(file: &mut File) -> io::Result<()> {
    let mut hash = Sha256::new();
    file.rewind()?;
    let length = io::copy(file, &mut HashWriter(&mut hash))?;
    let mut tail = [0; TAIL_BYTES];
    file.seek(SeekFrom::End(-(TAIL_BYTES as i64)))?;
    file.read_exact(&mut tail)?;
    let end = TAIL_BYTES + footer_length(&tail);
    let from = length.checked_sub(end as u64).ok_or_else(|| io::Error::other("the footer is not at the end"))?;
    let mut footer = Vec::with_capacity(end);
    file.seek(SeekFrom::Start(from))?;
    file.read_to_end(&mut footer)?;
    file.seek(SeekFrom::Start(from))?;
    file.write_all(MARK)?;
    file.write_all(&hash.finalize())?;
    file.write_all(&footer)
}

/// Whether a file is as it was written; `None` for one of an older version, which has no digest. `schema` is that of the file.
#[must_use]
pub fn is_as_written(bytes: &[u8], schema: &Schema) -> Option<bool> {
    let footer = footer(bytes);
    let seal = footer.and_then(|footer| Some((footer.checked_sub(SEAL_BYTES)?, footer)));
    let is_same = seal.is_some_and(|(from, to)| {
        let mut hash = Sha256::new_with_prefix(&bytes[..from]);
        hash.update(&bytes[to..]);
        bytes[from..to] == [&MARK[..], &hash.finalize()[..]].concat()
    });
    let has_mark = seal.is_some_and(|(from, _)| bytes[from..].starts_with(MARK));
    (has_mark || schema.metadata().contains_key(KEY)).then_some(is_same)
}

/// Where the footer of a whole file begins.
fn footer(bytes: &[u8]) -> Option<usize> {
    let tail = bytes.last_chunk::<TAIL_BYTES>()?;
    bytes.len().checked_sub(TAIL_BYTES)?.checked_sub(footer_length(tail))
}

fn footer_length(&[a, b, c, d, ..]: &[u8; TAIL_BYTES]) -> usize {
    u32::from_le_bytes([a, b, c, d]) as usize
}
