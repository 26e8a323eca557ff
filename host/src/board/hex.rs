//! Writes flash contents as Intel HEX, which an ST-LINK checks line by line when the file is copied onto its drive.

use std::fmt::Write;

/// Bytes of a data record.
const WIDTH: usize = 16;

/// Record types (Intel, Hexadecimal Object File Format Specification, 1988).
const DATA: u8 = 0;
const END: u8 = 1;
const UPPER_ADDRESS: u8 = 4;

/// The file with these pieces of flash: addresses (below 2³²) and bytes.
#[must_use]
pub fn to_hex(pieces: &[(u64, Vec<u8>)]) -> String {
    let mut text = String::new();
    let mut upper = None;
    for (start, bytes) in pieces {
        let mut at = *start;
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            if upper != Some(at >> 16) {
                record(&mut text, 0, UPPER_ADDRESS, &((at >> 16) as u16).to_be_bytes());
                upper = Some(at >> 16);
            }
            // A record does not go beyond its 64 KiB.
            let room = (0x1_0000 - (at & 0xffff)) as usize;
            let (now, later) = rest.split_at(rest.len().min(WIDTH).min(room));
            record(&mut text, at as u16, DATA, now);
            (at, rest) = (at + now.len() as u64, later);
        }
    }
    record(&mut text, 0, END, &[]);
    text
}

fn record(text: &mut String, address: u16, kind: u8, bytes: &[u8]) {
    let [high, low] = address.to_be_bytes();
    let mut sum = 0_u8;
    text.push(':');
    for byte in [bytes.len() as u8, high, low, kind].iter().chain(bytes) {
        sum = sum.wrapping_add(*byte);
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02X}");
    }
    let _ = writeln!(text, "{:02X}", sum.wrapping_neg());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_records_are_written() {
        let bytes = [0x21, 0x46, 0x01, 0x36, 0x01, 0x21, 0x47, 0x01, 0x36, 0x00, 0x7e, 0xfe, 0x09, 0xd2, 0x19, 0x01];
        let text = to_hex(&[(0x0800_0100, bytes.to_vec())]);
        // The data record is the usual example of the format.
        assert_eq!(text, ":020000040800F2\n:10010000214601360121470136007EFE09D2190140\n:00000001FF\n");
    }

    #[test]
    fn a_piece_across_64_kib_and_a_gap_get_their_addresses() {
        let text = to_hex(&[(0x0800_fff8, vec![0xaa; 20]), (0x0801_0100, vec![0x55])]);
        let starts: Vec<&str> = text.lines().map(|line| &line[..9]).collect();
        assert_eq!(starts, [":02000004", ":08FFF800", ":02000004", ":0C000000", ":01010000", ":00000001"]);
    }
}
