//! Identity of a firmware image: a section of the ELF file with protocol version, schema hash, board and firmware
//! version.
//!
//! The section is not loaded onto the board, so it costs no flash. A host reads it from the file before flashing. It
//! decodes to an [`Identity`], the same type that a running board sends.

use heapless::String;

use crate::{Identity, SCHEMA, VERSION};

/// Name of the section.
pub const SECTION: &str = ".damprig.identity";

/// Length of the section, bytes: mark, version, schema, board, firmware.
pub const LENGTH: usize = 8 + 2 + 8 + 2 * NAME;

/// Space for a name, bytes; the rest is filled with zeros.
const NAME: usize = 32;

/// The first bytes of the section; the last of them is the version of the layout.
const MARK: [u8; 8] = *b"damprig\x01";

/// Content of the section for `board` and firmware version `firmware`, with this protocol's version and schema hash.
///
/// # Panics
/// At compile time, when a name is longer than 32 bytes.
#[must_use]
pub const fn to_bytes(board: &str, firmware: &str) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    put(&mut bytes, 0, &MARK);
    put(&mut bytes, 8, &VERSION.to_le_bytes());
    put(&mut bytes, 10, &SCHEMA);
    assert!(board.len() <= NAME && firmware.len() <= NAME, "a name has at most 32 bytes");
    put(&mut bytes, 18, board.as_bytes());
    put(&mut bytes, 18 + NAME, firmware.as_bytes());
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
pub fn from_bytes(bytes: &[u8]) -> Option<Identity> {
    let rest = bytes.strip_prefix(&MARK)?;
    let (protocol, rest) = rest.split_first_chunk()?;
    let (schema, rest) = rest.split_first_chunk()?;
    let (board, firmware) = rest.split_at_checked(NAME)?;
    Some(Identity {
        protocol: u16::from_le_bytes(*protocol),
        schema: *schema,
        firmware: name(firmware.get(..NAME)?)?,
        board: name(board)?,
    })
}

fn name(bytes: &[u8]) -> Option<String<NAME>> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::try_from(core::str::from_utf8(bytes.get(..end)?).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_decodes_to_the_identity_that_was_encoded() {
        let it = from_bytes(&to_bytes("board", "1.2.3")).expect("a section");
        assert_eq!((it.protocol, it.schema, &*it.board, &*it.firmware), (VERSION, SCHEMA, "board", "1.2.3"));
        let longest = "abcdefghijklmnopqrstuvwxyzabcdef";
        assert_eq!(&*from_bytes(&to_bytes(longest, longest)).expect("a section").firmware, longest);
    }

    #[test]
    fn a_section_of_another_layout_or_a_truncated_one_is_rejected() {
        let whole = to_bytes("board", "1.2.3");
        for length in 0..LENGTH {
            assert_eq!(from_bytes(&whole[..length]), None, "{length} bytes");
        }
        let mut other = whole;
        other[7] = 2;
        assert_eq!(from_bytes(&other), None);
        let mut no_text = whole;
        no_text[18] = 0xff;
        assert_eq!(from_bytes(&no_text), None);
    }
}
