//! Fuzz target: arbitrary bytes as a measured file.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| damprig_fuzzing::file(data));
