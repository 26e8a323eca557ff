//! Points of the tests.

use std::f64::consts::TAU;

use damprig_batch::Point;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, Particle, SetUp, Structure, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// An impact damper with a mass ratio of 0.1 on a structure of 2.5 Hz with 0.38 % damping, from rest; Z = 1.
pub fn impact_damper(ratio: f64, restitution: f64, clearance_m: f64, cycles: u64) -> Point {
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
        cycles,
        steady_from_cycle: cycles / 2,
    }
}

/// Draws points of all kinds: regular, chaotic and with chatter, at drive frequencies on both sides of resonance.
pub fn drawn(seed: u64, count: usize, cycles: u64) -> Vec<Point> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut draw = |from: f64, to: f64| from + (to - from) * f64::from(rng.next_u32()) / f64::from(u32::MAX);
    (0..count)
        .map(|_| {
            let mut point = impact_damper(draw(0.4, 1.7), draw(0.0, 1.0), draw(0.5, 30.0), cycles);
            point.set_up.structure = Structure::from_modal(1.0, 2.5, draw(0.0, 0.1));
            if let Some(particle) = &mut point.set_up.particle {
                particle.mass_kg = draw(0.01, 0.5);
                point.initial = Initial {
                    x_m: draw(-1.0, 1.0),
                    v_m_per_s: draw(-10.0, 10.0),
                    y_m: 0.0,
                    u_m_per_s: draw(-10.0, 10.0),
                };
                point.initial.y_m = point.initial.x_m + particle.clearance_m * draw(-1.0, 1.0);
            }
            if let Excitation::Sine { phase_rad, .. } = &mut point.excitation {
                *phase_rad = draw(-4.0, 4.0);
            }
            point
        })
        .collect()
}
