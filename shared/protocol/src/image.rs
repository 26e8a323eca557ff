//! Identity of a firmware image: a section of the ELF file with protocol version, schema hash, board, firmware version and
//! revision of the source.
//!
//! The section is not loaded onto the board, so it costs no flash. A host reads it from the file before flashing. It
//! decodes to an [`Identity`] and a revision, as a running board sends them ([`crate::Description::revision`]).

use heapless::String;

use crate::{Identity, SCHEMA, VERSION};

/// Name of the section.
pub const SECTION: &str = ".damprig.identity";

/// Length of the section, bytes: mark, version, schema, board, firmware, revision.
pub const LENGTH: usize = 8 + 2 + 8 + 2 * NAME + REVISION;

/// Space for a name, bytes; the rest is filled with zeros.
const NAME: usize = 32;

/// Space for the revision, bytes.
const REVISION: usize = 16;

/// The first bytes of the section; the last of them is the version of the layout.
const MARK: [u8; 8] = *b"damprig\x02";

/// Content of the section for `board`, firmware version `firmware` and revision `revision` of its source (empty if unknown), with this
/// protocol's version and schema hash.
///
/// # Panics
/// At compile time, when a name is longer than 32 bytes or the revision longer than 16.
#[must_use]
pub const fn to_bytes(board: &str, firmware: &str, revision: &str) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    put(&mut bytes, 0, &MARK);
    put(&mut bytes, 8, &VERSION.to_le_bytes());
    put(&mut bytes, 10, &SCHEMA);
    assert!(board.len() <= NAME && firmware.len() <= NAME, "a name has at most 32 bytes");
    assert!(revision.len() <= REVISION, "a revision has at most 16 bytes");
    put(&mut bytes, 18, board.as_bytes());
    put(&mut bytes, 18 + NAME, firmware.as_bytes());
    put(&mut bytes, 18 + 2 * NAME, revision.as_bytes());
    bytes
}

const fn put(to: &mut [u8; LENGTH], at: usize, from: &[u8]) {
    let mut n = 0;
    while n < from.len() {
        to[at + n] = from[n];
        n += 1;
    }
}

/// Decodes a section; `None` when it was not made by [`to_bytes`].
#[must_use]
pub fn from_bytes(bytes: &[u8]) -> Option<(Identity, String<REVISION>)> {
    let rest = bytes.strip_prefix(&MARK)?;
    let (protocol, rest) = rest.split_first_chunk()?;
    let (schema, rest) = rest.split_first_chunk()?;
    let (board, rest) = rest.split_at_checked(NAME)?;
    let (firmware, rest) = rest.split_at_checked(NAME)?;
    let identity = Identity {
        protocol: u16::from_le_bytes(*protocol),
        schema: *schema,
        firmware: name(firmware)?,
        board: name(board)?,
    };
    Some((identity, name(rest.get(..REVISION)?)?))
}

fn name<const LONGEST: usize>(bytes: &[u8]) -> Option<String<LONGEST>> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::try_from(core::str::from_utf8(bytes.get(..end)?).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_decodes_to_the_identity_that_was_encoded() {
        let (it, revision) = from_bytes(&to_bytes("board", "1.2.3", "0123456789abcdef")).expect("a section");
        assert_eq!((it.protocol, it.schema, &*it.board, &*it.firmware), (VERSION, SCHEMA, "board", "1.2.3"));
        assert_eq!(revision, "0123456789abcdef");
        let longest = "abcdefghijklmnopqrstuvwxyzabcdef";
        let (it, revision) = from_bytes(&to_bytes(longest, longest, "")).expect("a section");
        assert_eq!((&*it.firmware, &*revision), (longest, ""));
    }

    #[test]
    fn a_section_of_another_layout_or_a_truncated_one_is_rejected() {
        let whole = to_bytes("board", "1.2.3", "abc");
        for length in 0..LENGTH {
            assert_eq!(from_bytes(&whole[..length]), None, "{length} bytes");
        }
        let mut other = whole;
        other[7] = 1;
        assert_eq!(from_bytes(&other), None);
        let mut no_text = whole;
        no_text[18] = 0xff;
        assert_eq!(from_bytes(&no_text), None);
    }
}
