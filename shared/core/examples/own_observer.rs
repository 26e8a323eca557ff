//! Example of a user-defined observer: the impulse of each impact on the structure, and the structure's displacement
//! then.
//!
//! `cargo run -p damprig-core --example own_observer`

use std::f64::consts::TAU;

use damprig_core::integrator::exact::{Exact, Excitation, Impact, Observer};
use damprig_core::io::Invalid;
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};

struct Impulses {
    mass_kg: f64,
    count: u32,
}

impl Observer for Impulses {
    // This observer ignores arcs, so the integrator need not compute them for it.
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.count += 1;
        let impulse = self.mass_kg * (impact.after.v_m_per_s - impact.before.v_m_per_s);
        println!(
            "{:8.5} s  {}  {:+.5} N·s  x = {:+.2} mm",
            impact.time_s,
            if impact.side > 0 { "+" } else { "-" },
            impulse,
            impact.before.x_m * 1e3
        );
    }
}

fn main() -> Result<(), Invalid> {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 15e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.47 },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
    let base = Excitation::Sine { amplitude_m: 1.5e-3, angular_frequency_rad_per_s: TAU * 2.5, phase_rad: 0.0 };
    let mut motion = Exact::new(&set_up, &base, &Initial::default())?;
    let mut impulses = Impulses { mass_kg: structure.mass_kg, count: 0 };
    motion.run(4.0, &mut impulses);
    println!("{} impacts in 4 s", impulses.count);
    Ok(())
}
