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

/// Whether a stream is as its checksums say, as far as they go; a last line that was cut off, and lines about bytes that are not there,
/// are of a kill.
#[must_use]
pub fn agree(stream: &[u8], sums: &[u8]) -> bool {
    let whole = sums.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let (lines, rest) = sums.split_at(whole);
    let mut sum = RunningSum::default();
    for line in lines.split_inclusive(|byte| *byte == b'\n') {
        let Some(bytes) = length(line) else { return false };
        if bytes > stream.len() {
            return true;
        }
        let Some(next) = stream.get(sum.bytes as usize..bytes) else { return false };
        sum.push(next);
        if sum.line().as_bytes() != line {
            return false;
        }
    }
    // A line is written at once: what is left of one is the beginning of a line.
    rest.len() < LONGEST && rest.iter().all(|byte| byte.is_ascii_hexdigit() || *byte == b' ')
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
    fn a_flipped_bit_of_stream_or_checksums_is_found_and_a_cut_is_none() {
        let stream: Vec<u8> = (0..200).map(|n| (n * 7) as u8).collect();
        let (mut sum, mut sums) = (RunningSum::default(), String::new());
        for batch in stream.chunks(50) {
            sum.push(batch);
            sums += &sum.line();
        }
        let sums = sums.into_bytes();
        for cut in 0..=stream.len() {
            assert!(agree(&stream[..cut], &sums));
        }
        for cut in 0..=sums.len() {
            assert!(agree(&stream, &sums[..cut]), "{cut}");
        }
        for n in 0..8 * stream.len() {
            let mut changed = stream.clone();
            changed[n / 8] ^= 1 << (n % 8);
            assert!(!agree(&changed, &sums), "bit {n} of the stream");
        }
        for n in 0..8 * sums.len() {
            let mut changed = sums.clone();
            changed[n / 8] ^= 1 << (n % 8);
            assert!(!agree(&stream, &changed), "bit {n} of the checksums");
        }
    }
}
