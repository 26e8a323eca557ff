//! Finds how much of a damaged Arrow stream can be read: up to the first message that is cut off or has contradictory
//! lengths.
//!
//! A machine that loses power may leave anything at the end of a file. The reader of arrow-ipc 60.1 trusts the lengths in
//! a message and panics when they are wrong, so they are checked first. The layout is that of an open part of the samples:
//! numbers in plain columns without missing values.

use arrow_ipc::root_as_message;
use arrow_schema::DataType;

const CONTINUATION: [u8; 4] = [0xff; 4];

/// Bytes from the beginning of the stream that a reader can read.
pub(super) fn sound_length(stream: &[u8]) -> usize {
    let mut sound = 0;
    let mut widths: Option<Vec<usize>> = None;
    while let Some(length) = message(&stream[sound..], &mut widths) {
        sound += length;
    }
    sound
}

/// Length of the message that `bytes` begin with, if it is whole and sound. The first one is the schema, which sets
/// `widths`.
fn message(bytes: &[u8], widths: &mut Option<Vec<usize>>) -> Option<usize> {
    let (marker, rest) = bytes.split_first_chunk::<4>()?;
    let (header_length, rest) = rest.split_first_chunk::<4>()?;
    let header_length = usize::try_from(i32::from_le_bytes(*header_length)).ok().filter(|n| *n > 0)?;
    let header = rest.get(..header_length).filter(|_| *marker == CONTINUATION)?;
    let message = root_as_message(header).ok()?;
    let body_length = usize::try_from(message.bodyLength()).ok()?;
    rest.get(header_length..)?.get(..body_length)?;
    match widths {
        None => {
            let schema = arrow_ipc::convert::try_fb_to_schema(message.header_as_schema()?).ok()?;
            let width = |kind: &DataType| kind.primitive_width();
            *widths = Some(schema.fields().iter().map(|f| width(f.data_type())).collect::<Option<_>>()?);
        }
        Some(widths) => is_valid(message.header_as_record_batch()?, body_length, widths).then_some(())?,
    }
    Some(8 + header_length + body_length)
}

fn is_valid(batch: arrow_ipc::RecordBatch, body_length: usize, widths: &[usize]) -> bool {
    let (Some(nodes), Some(buffers)) = (batch.nodes(), batch.buffers()) else { return false };
    let Ok(rows) = usize::try_from(batch.length()) else { return false };
    let is_whole = |node: &arrow_ipc::FieldNode| node.length() == batch.length() && node.null_count() == 0;
    // Two buffers a column: the validity bits, and the values.
    let lies_within = |buffer: &arrow_ipc::Buffer, least: Option<usize>| {
        let (offset, length) = (usize::try_from(buffer.offset()).ok(), usize::try_from(buffer.length()).ok());
        let end = offset.zip(length).and_then(|(offset, length)| offset.checked_add(length));
        end.is_some_and(|end| end <= body_length) && least.is_some_and(|least| length >= Some(least))
    };
    let least = widths.iter().flat_map(|width| [Some(0), rows.checked_mul(*width)]);
    batch.compression().is_none()
        && nodes.len() == widths.len()
        && buffers.len() == 2 * widths.len()
        && nodes.iter().all(is_whole)
        && buffers.iter().zip(least).all(|(buffer, least)| lies_within(buffer, least))
}
