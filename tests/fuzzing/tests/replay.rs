//! Replays the fuzz targets without a fuzzer: every seed, and a fixed set of mutations.

use damprig_fuzzing::crafted_run::crafted_run;
use damprig_fuzzing::mutation::mutate;
use damprig_fuzzing::seeds::{self, Seed};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// The seeds in the repository and those generated now; the protocol may have grown in between.
fn all(target: &str, made: Vec<Seed>) -> Vec<Seed> {
    let kept = seeds::kept(target).expect("fuzz/seeds");
    assert!(kept.len() > 10, "{target}: only {} seeds in fuzz/seeds", kept.len());
    let size: usize = kept.iter().map(|(_, bytes)| bytes.len()).sum();
    assert!(size < 100_000, "{target}: the seeds have grown to {size} bytes");
    kept.into_iter().chain(made).collect()
}

fn replay(target: &str, made: Vec<Seed>, mutations: usize, body: fn(&[u8])) {
    let seeds = all(target, made);
    // Stored for the failure message: the input that failed.
    let run = |name: &str, input: &[u8]| {
        let outcome = std::panic::catch_unwind(|| body(input));
        assert!(outcome.is_ok(), "{target}: {name}: {input:02x?}");
    };
    seeds.iter().for_each(|(name, input)| run(name, input));
    let mut random = StdRng::seed_from_u64(20_261_121);
    for n in 0..mutations {
        let (name, input) = &seeds[n % seeds.len()];
        let (_, other) = &seeds[random.random_range(0..seeds.len())];
        run(&format!("mutation {n}, of {name}"), &mutate(input, other, &mut random));
    }
    println!("{target}: {} seeds and {mutations} mutations", seeds.len());
}

#[test]
fn a_board_neither_panics_nor_stops_answering() {
    replay("device", seeds::device(), 4_000, damprig_fuzzing::device);
}

fn is_full() -> bool {
    std::env::var_os("DAMPRIG_FULL").is_some()
}

/// Number of whole runs: 60, or 2 000 in the full tests.
fn runs() -> u64 {
    if is_full() { 2_000 } else { 60 }
}

#[test]
fn a_run_over_a_link_that_changes_messages_ends_in_an_orderly_way() {
    let (mut opened, mut points, mut misfits, mut complete) = (0, 0, 0, 0);
    for seed in 0..runs() {
        let outcome = std::panic::catch_unwind(|| crafted_run(seed));
        let Ok(outcome) = outcome else { panic!("crafted run {seed}") };
        opened += u64::from(outcome.opened);
        points += outcome.points;
        misfits += outcome.misfits;
        complete += u64::from(outcome.opened && outcome.error.is_none());
    }
    println!("{} runs: {opened} opened, {complete} complete, {points} points, {misfits} misfits", runs());
    assert!(opened > runs() / 3 && points > 0 && misfits > 0 && complete > 0);
}

#[test]
fn a_host_reads_the_next_clean_frame_after_any_input() {
    replay("host", seeds::host(), 100_000, damprig_fuzzing::host);
}

#[test]
fn a_measured_file_of_any_kind_is_read_or_refused() {
    let mutations = if is_full() { 1_000_000 } else { 20_000 };
    replay("file", Vec::new(), mutations, damprig_fuzzing::file);
}
