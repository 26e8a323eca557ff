//! Fuzz target: arbitrary bytes into a host's frame reader.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| damprig_fuzzing::host(data));
