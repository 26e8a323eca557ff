//! See `damprig_fuzzing::crafted_run`.
#![no_main]

libfuzzer_sys::fuzz_target!(|seed: u64| {
    let _ = damprig_fuzzing::crafted_run::crafted_run(seed);
});
