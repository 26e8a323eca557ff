//! Compares the speed of the exact integrator with that of other methods, in one run: `cargo bench --manifest-path benches/peers/Cargo.toml --bench engine`.
//!
//! Every line is the best of several short, interleaved rounds, because other processes on the machine slow some
//! rounds down. Compare the ratios. Figures are cycles of the base per second on a single thread. Units: Z = 1.
//!
//! Peers: an adaptive Runge–Kutta method with root finding from a crate ([`peers::diffsol`]), and the fixed-step
//! Runge–Kutta method with a step of 10⁻⁴ s that the source document used ([`peers::fixed_step`]).

mod cases;
mod peers;

use std::hint::black_box;
use std::time::{Duration, Instant};

use cases::Case;

/// Number of rounds, and minimum time per line in each round.
const ROUNDS: usize = 60;
const MIN: Duration = Duration::from_millis(4);

/// One line: the function to run, and the number of cycles (or seconds of a record) in one run.
struct Line {
    name: String,
    unit: &'static str,
    amount: f64,
    run: Box<dyn FnMut() -> f64>,
    result: f64,
    rate: f64,
}

impl Line {
    fn new(name: &str, unit: &'static str, amount: f64, run: impl FnMut() -> f64 + 'static) -> Self {
        Self { name: name.to_owned(), unit, amount, run: Box::new(run), result: 0.0, rate: 0.0 }
    }

    fn round(&mut self) {
        let (start, mut runs) = (Instant::now(), 0);
        while runs == 0 || start.elapsed() < MIN {
            self.result = black_box((self.run)());
            runs += 1;
        }
        self.rate = self.rate.max(f64::from(runs) * self.amount / start.elapsed().as_secs_f64());
    }
}

fn main() {
    // `cargo test --benches` only checks that the benchmark runs.
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 1 };
    let mut groups = groups();
    for _ in 0..rounds {
        for line in groups.iter_mut().flat_map(|(_, lines)| lines) {
            line.round();
        }
    }
    for (title, lines) in &groups {
        println!("\n{title}");
        let slowest = lines.iter().map(|line| line.rate).fold(f64::INFINITY, f64::min);
        for line in lines {
            let rate = line.rate;
            println!(
                "  {:<34} {:>12.0} {:<9} {:>8.1} ×   result {:.12}",
                line.name,
                rate,
                line.unit,
                rate / slowest,
                line.result
            );
        }
    }
    accuracy();
    spread();
    cost();
}

fn groups() -> Vec<(String, Vec<Line>)> {
    let mut groups = Vec::new();
    for case in Case::ALL {
        let cycles = case.cycles();
        let mut lines = vec![Line::new("damprig, exact", "cycles/s", cycles, move || case.exact())];
        if case.peers_finish() {
            lines.push(Line::new("diffsol tsit45 with roots, 1e-10", "cycles/s", cycles, move || {
                case.sum(|set| peers::diffsol(set, 1e-10))
            }));
        }
        lines.push(Line::new("Runge–Kutta, step 1e-4 s", "cycles/s", cycles, move || case.sum(peers::fixed_step)));
        groups.push((case.title(), lines));
    }
    let (set_up, samples) = cases::record();
    let seconds = samples.len() as f64 * cases::RECORD_STEP_S;
    groups.push((
        format!("Record, {seconds:.0} s at {:.0} Hz, hybrid, sampled driver", 1.0 / cases::RECORD_STEP_S),
        vec![Line::new("damprig, sampled", "× real", seconds, move || cases::sampled(&set_up, &samples))],
    ));
    groups
}

/// Prints the accuracy for case A, whose orbit is known in closed form.
fn accuracy() {
    let (last, closed_form) = (Case::A.exact(), cases::orbit_approach_speed());
    println!("\nAccuracy, case A: last impact speed against the closed form of the orbit it settles on");
    for (name, value) in [
        ("damprig, exact", last),
        ("diffsol tsit45 with roots, 1e-10", Case::A.sum(|set| peers::diffsol(set, 1e-10))),
        ("Runge–Kutta, step 1e-4 s", Case::A.sum(peers::fixed_step)),
    ] {
        println!("  {name:<34} {:.1e}", (value / closed_form - 1.0).abs());
    }
}

/// Prints the spread of case B over 200 nearby starts: it is chaotic, so a single run is one sample.
fn spread() {
    let mut means: Vec<f64> = (0..200).map(|n| Case::B.mean_cycle_maximum(1e-9 * f64::from(n))).collect();
    means.sort_by(f64::total_cmp);
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let within = means.iter().filter(|m| (5.6..=5.95).contains(*m)).count();
    println!("\nCase B, mean cycle maximum of cycles 200 to 400, of 200 starts 1e-9 apart");
    println!("  mean {mean:.3}, from {:.3} to {:.3}; {within} of 200 between 5.6 and 5.95", means[0], means[199]);
}

/// Prints the work of the engine per impact: arcs, Newton steps and sine evaluations.
fn cost() {
    println!("\nPer impact: arcs proved by their ends, arcs walked, Newton steps, sine–cosine pairs; impacts a cycle");
    for case in Case::ALL {
        let (work, impacts, cycles) = case.work();
        let per = |n: u64| n as f64 / impacts as f64;
        println!(
            "  {:<34} {:>6.2} {:>6.3} {:>6.2} {:>6.3} {:>8.2}",
            case.title(),
            per(work.arcs_proved),
            per(work.arcs_walked),
            per(work.newton_steps),
            per(work.sines),
            impacts as f64 / cycles
        );
    }
}
