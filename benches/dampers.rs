//! Speed of a simulation with each damper, with everything that `damprig simulate` prints: `cargo bench -p damprig-benches --bench dampers`.
//!
//! Millions of cycles of the base in a second on one thread, the best of several interleaved rounds; compare the ratios.

use std::time::Instant;

use damprig::input::Source;
use damprig::simulation::{Case, RunOptions, simulate};

/// Rounds, and cycles of each in a round.
const ROUNDS: usize = 15;
const CYCLES: f64 = 20_000.0;

/// A structure at its resonance with a damper.
const DAMPERS: [(&str, &str); 8] = [
    ("impact damper, two impacts a cycle", "particle = { mass_ratio = 0.1, clearance_ratio = 10, @ }"),
    ("impact damper, chatter", "particle = { mass_ratio = 0.1, clearance_ratio = 3, friction_coefficient = 0.05, @ }"),
    (
        "impact damper, particle friction",
        "particle = { mass_ratio = 0.1, clearance_ratio = 10, friction_coefficient = 0.05, @ }",
    ),
    (
        "impact damper, e over the speed",
        "particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = \"restitution\", coefficient = 0.5, reference_speed_m_per_s = 0.1, exponent = 0.1, maximum = 0.9 } }",
    ),
    ("friction damper", "friction_damper = { friction_ratio = 0.5 }"),
    ("hybrid", "friction_damper = { friction_ratio = 0.5 }\nparticle = { mass_ratio = 0.1, clearance_ratio = 10, @ }"),
    ("tuned mass damper", "tmd = { mass_ratio = 0.1, tuning = \"den_hartog\" }"),
    (
        "impact damper, soft walls",
        "particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = \"voigt\", stiffness_n_per_m = 16000, damping_n_s_per_m = 20, release = \"zero_force\" } }",
    ),
];

fn case(damper: &str) -> Case {
    let damper = damper.replace('@', "wall = { kind = \"restitution\", coefficient = 0.5 }");
    let text = format!(
        "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
         base = {{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }}\nrun = {{ duration_s = {} }}\n{damper}\n",
        CYCLES / 2.5
    );
    Case::parse(&Source::new(damper, text), "damper").unwrap_or_else(|wrong| panic!("{wrong}"))
}

fn main() {
    // `cargo test --benches` only checks that the benchmark runs.
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 1 };
    let cases = DAMPERS.map(|(name, damper)| (name, case(damper)));
    let mut best = [0.0_f64; DAMPERS.len()];
    let mut impacts = [0; DAMPERS.len()];
    for _ in 0..rounds {
        for (n, (_, case)) in cases.iter().enumerate() {
            let start = Instant::now();
            let options = RunOptions { keep: false, longest_part_s: f64::INFINITY, go_on: &mut |_| true };
            let result = simulate(case, &mut (), options).unwrap_or_else(|wrong| panic!("{wrong}"));
            best[n] = best[n].max(CYCLES / start.elapsed().as_secs_f64());
            impacts[n] = result.summary.impact_count;
        }
    }
    println!("{:<38} {:>14} {:>18}", "damper", "10⁶ cycles/s", "impacts a cycle");
    for ((name, _), (rate, impacts)) in cases.iter().zip(best.iter().zip(impacts)) {
        println!("{name:<38} {:>14.2} {:>18.2}", rate / 1e6, impacts as f64 / CYCLES);
    }
}
