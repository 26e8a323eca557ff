//! Any bytes into a host's reader.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| damprig_fuzzing::host(data));
