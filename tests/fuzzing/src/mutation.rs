//! Reproducible small mutations of an input, for a replay of the fuzz targets without a fuzzer.

use rand::RngExt;
use rand::rngs::StdRng;

/// `input` with one to four changes; `other` supplies bytes to insert.
#[must_use]
pub fn mutate(input: &[u8], other: &[u8], random: &mut StdRng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..random.random_range(1..5) {
        change(&mut bytes, other, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut StdRng) {
    if bytes.is_empty() {
        bytes.extend_from_slice(other);
        return;
    }
    let at = random.random_range(0..bytes.len());
    match random.random_range(0..7) {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes[at] = random.random(),
        // The frame end, the start of a long number, the largest values.
        2 => bytes[at] = [0x00, 0x01, 0x7f, 0x80, 0xff][random.random_range(0..5)],
        3 => bytes.insert(at, random.random()),
        4 => drop(bytes.remove(at)),
        5 => bytes.truncate(at),
        _ => {
            let from = random.random_range(0..=other.len());
            let to = random.random_range(from..=other.len());
            bytes.splice(at..at, other[from..to].iter().copied());
        }
    }
}
