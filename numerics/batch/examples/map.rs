//! A map of an impact damper over clearance and drive frequency, as CSV: 100 × 100 points of 1 000 cycles each, on all cores.
//!
//! `cargo run --release -p damprig-batch --example map > map.csv`

use std::f64::consts::TAU;

use damprig_batch::{InvalidPoint, Point, simulate};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, Particle, SetUp, Structure, Wall};

const COUNT: u32 = 100;
const AMPLITUDE_M: f64 = 0.003;

fn point(clearance_ratio: f64, frequency_ratio: f64) -> Point {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: clearance_ratio * AMPLITUDE_M,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
    };
    Point {
        set_up: SetUp { particle: Some(particle), ..SetUp::bare(structure) },
        excitation: Excitation::Sine {
            amplitude_m: AMPLITUDE_M,
            angular_frequency_rad_per_s: frequency_ratio * TAU * 2.5,
            phase_rad: 0.0,
        },
        initial: Initial::default(),
        cycles: 1_000,
        steady_from_cycle: 500,
    }
}

fn main() -> Result<(), InvalidPoint> {
    let share = |n: u32| f64::from(n) / f64::from(COUNT - 1);
    let axes: Vec<(f64, f64)> =
        (0..COUNT * COUNT).map(|n| (5.0 + 25.0 * share(n / COUNT), 0.8 + 0.4 * share(n % COUNT))).collect();
    let points: Vec<Point> = axes.iter().map(|(clearance, frequency)| point(*clearance, *frequency)).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let outcomes = simulate(&points, threads)?;
    println!("clearance_ratio,frequency_ratio,x_over_z,impacts_per_cycle");
    for ((clearance, frequency), (outcome, point)) in axes.iter().zip(outcomes.iter().zip(&points)) {
        let x_over_z = outcome.steady_mean_m.unwrap_or(f64::NAN) / AMPLITUDE_M;
        println!("{clearance},{frequency},{x_over_z},{}", outcome.impacts as f64 / point.cycles as f64);
    }
    Ok(())
}
