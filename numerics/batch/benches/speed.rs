//! Speed of the lanes beside the exact engine, in one run on one thread: `cargo bench -p damprig-batch`.
//!
//! Every line is the best of several short, interleaved rounds, because other processes on the machine slow some rounds
//! down. Compare the ratios. Figures are cycles of the base per second. All lines compute the same outcomes, except "motion
//! alone", which is the exact engine with an observer that only counts impacts.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

use damprig_batch::{InstructionSet, Point, simulate_on};
use damprig_core::integrator::exact::{Exact, Excitation, Impact, Observer};
use damprig_core::model::{Initial, Particle, SetUp, Structure, Wall};

/// Number of rounds, and minimum time per line in each round.
const ROUNDS: usize = 10;
const LEAST: Duration = Duration::from_millis(10);

/// An impact damper with a mass ratio of 0.1 on a structure of 2.5 Hz with 0.38 % damping, Z = 1.
fn point(ratio: f64, restitution: f64, clearance_m: f64) -> Point {
    let structure = Structure::from_modal(1.0, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 0.1,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: restitution },
    };
    Point {
        set_up: SetUp { particle: Some(particle), ..SetUp::bare(structure) },
        excitation: Excitation::Sine {
            amplitude_m: 1.0,
            angular_frequency_rad_per_s: ratio * TAU * 2.5,
            phase_rad: 0.0,
        },
        initial: Initial::default(),
        cycles: 1000,
        steady_from_cycle: 500,
    }
}

/// An 8 × 8 grid between two corners (clearance ratio, restitution).
fn grid(clearance: (f64, f64), restitution: (f64, f64)) -> Vec<Point> {
    let between = |(from, to): (f64, f64), n: i32| from + (to - from) * f64::from(n) / 7.0;
    (0..64).map(|n| point(1.0, between(restitution, n / 8), between(clearance, n % 8))).collect()
}

struct Count(u64);

impl Observer for Count {
    const ARCS: bool = false;

    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

fn motion_alone(points: &[Point]) -> f64 {
    let mut count = Count(0);
    for point in points {
        let mut motion = Exact::new(&point.set_up, &point.excitation, &point.initial).expect("a physical set-up");
        motion.run(point.cycles as f64 * point.cycle_s(), &mut count);
    }
    count.0 as f64
}

fn mean(outcomes: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = outcomes.collect();
    all.iter().sum::<f64>() / all.len() as f64
}

fn exact(points: &[Point]) -> f64 {
    mean(points.iter().map(|p| p.by_exact_engine().expect("a physical set-up").steady_mean_m.unwrap_or(0.0)))
}

fn lanes(points: &[Point], set: InstructionSet) -> f64 {
    let outcomes = simulate_on(points, 1, set).expect("physical set-ups");
    mean(outcomes.iter().map(|o| o.steady_mean_m.unwrap_or(0.0)))
}

/// One line: what to run, the best rate so far, cycles/s, and the result.
struct Line<'a> {
    name: String,
    run: Box<dyn Fn() -> f64 + 'a>,
    rate: f64,
    result: f64,
}

impl<'a> Line<'a> {
    fn new(name: String, run: impl Fn() -> f64 + 'a) -> Self {
        Self { name, run: Box::new(run), rate: 0.0, result: 0.0 }
    }

    fn round(&mut self, cycles: u64) {
        let (start, mut runs) = (Instant::now(), 0);
        while runs == 0 || start.elapsed() < LEAST {
            self.result = black_box((self.run)());
            runs += 1;
        }
        self.rate = self.rate.max(f64::from(runs) * cycles as f64 / start.elapsed().as_secs_f64());
    }
}

fn main() {
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 1 };
    let studies = [
        ("64 regular points around case A: r 1, e 0.45–0.55, d/Z 9.5–10.5", grid((9.5, 10.5), (0.45, 0.55))),
        ("64 chaotic points around case B: r 1, e 0.45–0.55, d/Z 14–17", grid((14.0, 17.0), (0.45, 0.55))),
    ];
    for (title, points) in &studies {
        let cycles: u64 = points.iter().map(|p| p.cycles).sum();
        let mut lines = vec![
            Line::new("exact engine".into(), || exact(points)),
            Line::new("exact engine, motion alone".into(), || motion_alone(points)),
        ];
        for set in InstructionSet::available() {
            lines.push(Line::new(format!("lanes, {set:?}"), move || lanes(points, set)));
        }
        for _ in 0..rounds {
            lines.iter_mut().for_each(|line| line.round(cycles));
        }
        let outcomes = simulate_on(points, 1, InstructionSet::fastest()).expect("physical set-ups");
        let (lane, exact) = outcomes.iter().fold((0, 0), |sum, o| (sum.0 + o.lane_steps, sum.1 + o.exact_steps));
        println!("\n{title}; {:.1} % of the steps by the exact engine", 100.0 * exact as f64 / (lane + exact) as f64);
        let first = lines[0].rate;
        for Line { name, rate, result, .. } in &lines {
            println!("  {name:<28} {rate:>12.0} cycles/s {:>6.2} ×   result {result:.12}", rate / first);
        }
    }
}
