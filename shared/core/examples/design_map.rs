//! Computes a design map with the exact integrator: X/Z of an impact damper at resonance over clearance and
//! restitution.
//!
//! `cargo run --release -p damprig-core --example design_map`

use std::f64::consts::TAU;

use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::io::Invalid;
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};

/// Mean of the cycle maxima of |x| over the last 50 of 200 cycles, divided by Z.
fn amplitude_ratio(clearance_over_z: f64, restitution: f64) -> Result<f64, Invalid> {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: clearance_over_z,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: restitution },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) };
    let turning = TAU * 2.5;
    let base = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
    let mut motion = Exact::new(&set_up, &base, &Initial::default())?;
    let cycle_s = TAU / turning;
    let mut response = Response::new(Wanted { cycle_s: Some(cycle_s), steady_from_cycle: Some(150), whole_run: false });
    motion.run(200.0 * cycle_s, &mut response);
    response.finish(200.0 * cycle_s);
    Ok(response.steady_m().map_or(f64::NAN, |(_, mean)| mean))
}

fn main() -> Result<(), Invalid> {
    let restitutions = [0.1, 0.3, 0.5, 0.7, 0.9];
    print!("d/Z    e =");
    restitutions.iter().for_each(|e| print!("{e:>8}"));
    println!();
    for d in [5.0, 7.5, 10.0, 12.5, 15.0, 20.0] {
        print!("{d:<10}");
        for e in restitutions {
            print!("{:>8.2}", amplitude_ratio(d, e)?);
        }
        println!();
    }
    Ok(())
}
