//! Measures the time of a branch of 200 orbits with multipliers and special points, and of a grazing curve in two parameters.
//! `cargo run --release -p damprig-continuation --example pace`

use std::time::Instant;

use damprig_continuation::{Parameter, SpecialKind, Steps, System, Task, Ties};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let turning = std::f64::consts::TAU * 2.5;
    let wall = Wall::Restitution { coefficient: 0.5 };
    let particle =
        Particle { mass_kg: 0.1, clearance_m: 10.0, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.0, 2.5, 0.0038)) };
    let excitation = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
    let known = SymmetricOrbit::new(&set_up, 1.0, turning).ok_or("no symmetric orbit")?;
    let system = System::new(&set_up, &excitation, Ties::default())?;
    let task = Task {
        parameter: Parameter::Clearance,
        range: (2.0, 40.0),
        start_at: 10.0,
        initial: known.initial(),
        phase_rad: known.drive_phase_rad,
        most_periods: 6_000,
        switch: false,
        most_restarts: 0,
        steps: Steps { longest: 0.02, ..Steps::default() },
    };
    let start = Instant::now();
    let found = system.explore(&task)?;
    let branch = &found.branches[0];
    let (orbits, points) = (branch.orbits.len(), branch.specials.len());
    println!("branch: {orbits} orbits, {points} special points, {:.3} s", start.elapsed().as_secs_f64());
    let grazing = branch.specials.iter().find(|(_, s)| matches!(s.kind, SpecialKind::Grazing(_)));
    let (_, grazing) = grazing.ok_or("no grazing")?;
    let start = Instant::now();
    let parameters = [Parameter::Clearance, Parameter::Restitution];
    let curve = system.curve(&branch.sequence, grazing, parameters, [task.range, (0.2, 0.9)], Steps::default());
    let count = curve.map_or(0, |curve| curve.orbits.len());
    println!("grazing curve: {count} orbits, {:.3} s", start.elapsed().as_secs_f64());
    Ok(())
}
