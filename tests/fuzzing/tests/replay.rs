//! Replays the fuzz targets without a fuzzer: every seed, and a fixed set of mutations.

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

#[test]
fn a_host_reads_the_next_clean_frame_after_any_input() {
    replay("host", seeds::host(), 100_000, damprig_fuzzing::host);
}
