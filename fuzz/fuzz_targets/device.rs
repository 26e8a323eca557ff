//! Fuzz target: arbitrary bytes into a board.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| damprig_fuzzing::device(data));
