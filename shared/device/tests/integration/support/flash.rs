//! A flash in memory with the controller's page and word size, whose supply fails at a chosen operation, or which gives wrong
//! data without an error.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Size of a page, bytes, as on the controller.
pub const PAGE: usize = 2048;
/// Size of a word, bytes: the unit of programming.
pub const WORD: usize = 8;
/// Size of the settings range, bytes.
pub const SIZE: usize = 2 * PAGE;

/// Result of the operation during which the supply fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The operation has no effect.
    Before,
    /// The first half of the bytes is changed.
    Half,
    /// Each bit has its old or its new value, chosen by a generator: cells change one by one.
    Mixed(u64),
    /// The word or page has arbitrary content, as after an uncorrectable error.
    Anything(u64),
    /// The operation is complete, but reports a failure.
    After,
}

/// The supply is off, or a word was programmed without having been erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed;

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// The flash.
#[derive(Clone)]
pub struct Flash {
    pub bytes: [u8; SIZE],
    /// Number of words programmed and pages erased.
    pub operations: usize,
    /// The operation during which the supply fails, counted from the present state.
    pub cut: Option<(usize, Cut)>,
    /// The operation, counted from the present state, that has no effect and reports success.
    pub ineffective: Option<usize>,
    /// A byte whose bits always read as these, whatever was written: its place, which bits, and their value.
    pub stuck: Option<(usize, u8, u8)>,
    is_off: bool,
}

impl Default for Flash {
    fn default() -> Self {
        Self { bytes: [0xff; SIZE], operations: 0, cut: None, ineffective: None, stuck: None, is_off: false }
    }
}

fn random(state: &mut u64) -> u8 {
    // Knuth's multiplier.
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 56) as u8
}

impl Flash {
    /// The flash after power has come back; it fails again at `cut`.
    pub fn restarted(&self, cut: Option<(usize, Cut)>) -> Self {
        Self { operations: 0, cut, ineffective: None, is_off: false, ..self.clone() }
    }

    /// Performs one operation on the bytes from `at` on; `done` is their content after it.
    fn operate(&mut self, at: usize, done: &[u8]) -> Result<(), Failed> {
        if self.is_off {
            return Err(Failed);
        }
        let place = &mut self.bytes[at..at + done.len()];
        let number = self.operations;
        self.operations += 1;
        if self.ineffective == Some(number) {
            return Ok(());
        }
        match self.cut {
            Some((last, cut)) if last == number => {
                self.is_off = true;
                match cut {
                    Cut::Before => {}
                    Cut::Half => place[..done.len() / 2].copy_from_slice(&done[..done.len() / 2]),
                    Cut::Mixed(seed) => {
                        let mut state = seed ^ at as u64;
                        for (byte, done) in place.iter_mut().zip(done) {
                            let changed = random(&mut state);
                            *byte = (*byte & !changed) | (done & changed);
                        }
                    }
                    Cut::Anything(seed) => {
                        let mut state = seed ^ at as u64;
                        place.fill_with(|| random(&mut state));
                    }
                    Cut::After => place.copy_from_slice(done),
                }
                Err(Failed)
            }
            _ => {
                place.copy_from_slice(done);
                Ok(())
            }
        }
    }
}

impl ErrorType for &mut Flash {
    type Error = Failed;
}

impl ReadNorFlash for &mut Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        if self.is_off {
            return Err(Failed);
        }
        let offset = offset as usize;
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        if let Some((at, bits, value)) = self.stuck
            && let Some(byte) = at.checked_sub(offset).and_then(|at| bytes.get_mut(at))
        {
            *byte = (*byte & !bits) | (value & bits);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for &mut Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        assert!((from as usize).is_multiple_of(PAGE) && (to as usize).is_multiple_of(PAGE));
        for page in (from as usize..to as usize).step_by(PAGE) {
            self.operate(page, &[0xff; PAGE])?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        let offset = offset as usize;
        assert!(offset.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        for (at, word) in (offset..).step_by(WORD).zip(bytes.chunks(WORD)) {
            // The controller programs erased words, and overwrites any word with zeros.
            let is_erased = self.bytes[at..at + WORD].iter().all(|byte| *byte == 0xff);
            if !is_erased && word.iter().any(|byte| *byte != 0) {
                return Err(Failed);
            }
            self.operate(at, word)?;
        }
        Ok(())
    }
}
