//! Checksums of an open part, in a file beside it: a line for each batch with the bytes of the stream up to its end, the beginning of
//! their SHA-256, and that of the line so far. The stream itself is in Arrow's format, which has none.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Hexadecimal digits of a checksum.
const DIGITS: usize = 16;

/// The file of the checksums of an open part.
#[must_use]
pub fn sums_path(stream: &Path) -> PathBuf {
    stream.with_extension("sums")
}

/// Bytes so far, and their SHA-256.
#[derive(Clone, Debug, Default)]
pub struct RunningSum {
    bytes: u64,
    hash: Sha256,
}

impl RunningSum {
    /// Takes the next bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        self.hash.update(bytes);
    }

    /// The line for the bytes so far.
    #[must_use]
    pub fn line(&self) -> String {
        let text = format!("{} {}", self.bytes, digits(self.hash.clone()));
        format!("{text} {}\n", digits(Sha256::new_with_prefix(&text)))
    }
}

fn digits(hash: Sha256) -> String {
    let mut text: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    text.truncate(DIGITS);
    text
}

/// How a stream differs from its checksums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// One of them ends before the other: a kill or a power cut, or it was cut.
    Length,
    /// A byte of one of them has changed.
    Content,
}

/// Compares a stream with its checksums: the bytes that agree, and the difference behind them, if there is one.
#[must_use]
pub fn compare(stream: &[u8], sums: &[u8]) -> (usize, Option<Difference>) {
    let mut sound = RunningSum::default();
    for line in sums.split_inclusive(|byte| *byte == b'\n') {
        let so_far = sound.bytes as usize;
        let Some(bytes) = length(line) else {
            return (so_far, Some(if is_torn(line) { Difference::Length } else { Difference::Content }));
        };
        if bytes > stream.len() {
            return (so_far, Some(Difference::Length));
        }
        let mut sum = sound.clone();
        sum.push(stream.get(so_far..bytes).unwrap_or_default());
        if sum.line().as_bytes() != line {
            return (so_far, Some(Difference::Content));
        }
        sound = sum;
    }
    let so_far = sound.bytes as usize;
    (so_far, (so_far < stream.len()).then_some(Difference::Length))
}

/// Whether it is the beginning of a line.
fn is_torn(line: &[u8]) -> bool {
    line.len() < LONGEST && line.iter().all(|byte| byte.is_ascii_hexdigit() || *byte == b' ')
}

/// Longest line, bytes.
const LONGEST: usize = 20 + 2 * (1 + DIGITS) + 1;

/// The bytes that a line is about, if it is sound.
fn length(line: &[u8]) -> Option<usize> {
    let (text, sum) = std::str::from_utf8(line).ok()?.strip_suffix('\n')?.rsplit_once(' ')?;
    if sum != digits(Sha256::new_with_prefix(text)) {
        return None;
    }
    text.split_once(' ')?.0.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flipped_bit_and_a_cut_of_stream_or_checksums_are_found_and_the_bytes_before_are_sound() {
        let stream: Vec<u8> = (0..200).map(|n| (n * 7) as u8).collect();
        let (mut sum, mut sums) = (RunningSum::default(), String::new());
        for batch in stream.chunks(50) {
            sum.push(batch);
            sums += &sum.line();
        }
        let sums = sums.into_bytes();
        assert_eq!(compare(&stream, &sums), (200, None));
        let cut_off = |sound| (sound, Some(Difference::Length));
        for cut in 0..stream.len() {
            assert_eq!(compare(&stream[..cut], &sums), cut_off(cut / 50 * 50), "{cut}");
        }
        for cut in 0..sums.len() {
            let whole = sums[..cut].iter().filter(|byte| **byte == b'\n').count();
            assert_eq!(compare(&stream, &sums[..cut]), cut_off(50 * whole), "{cut}");
        }
        for n in 0..8 * stream.len() {
            let mut changed = stream.clone();
            changed[n / 8] ^= 1 << (n % 8);
            assert_eq!(compare(&changed, &sums), (n / 400 * 50, Some(Difference::Content)), "bit {n} of the stream");
        }
        for n in 0..8 * sums.len() {
            let mut changed = sums.clone();
            changed[n / 8] ^= 1 << (n % 8);
            let (sound, difference) = compare(&stream, &changed);
            assert!(sound < 200 && difference.is_some(), "bit {n} of the checksums");
        }
    }
}
