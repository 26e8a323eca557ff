//! Prints cycles a second of an impact damper, alone and with a friction damper, at the top of frames of 1 to 20 storeys driven at their
//! first natural frequency.

use std::f64::consts::TAU;
use std::time::Instant;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, FrictionDamper, Particle, Wall};
use damprig_structures::{
    FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, Refused, SetUp, Storey, base_at_start,
};

/// Cycles before the time is taken, and cycles of the measurement.
const CYCLES: (f64, f64) = (500.0, 2_000.0);

struct Count(u64);

impl Observer for Count {
    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

fn main() -> Result<(), Refused> {
    let storey = Storey { mass_kg: 2.0, stiffness_n_per_m: 1500.0, damping_n_s_per_m: 0.8 };
    for force_n in [0.0, 1.0] {
        for storeys in [1, 2, 5, 20] {
            let top = storeys - 1;
            let mut set_up = SetUp::bare(Modes::storeys(&vec![storey; storeys])?);
            let mass_kg = 0.1 * storey.mass_kg * storeys as f64;
            let wall = Wall::Restitution { coefficient: 0.3 };
            let cavity = Cavity::default();
            let particle = Particle { mass_kg, clearance_m: 25e-3, friction_coefficient: 0.0, wall, cavity };
            set_up.impact_dampers.push(ImpactDamper { place: top, particle });
            if force_n > 0.0 {
                set_up.friction_dampers.push(FrictionJoint {
                    place: top,
                    other: top.checked_sub(1),
                    damper: FrictionDamper { force_n },
                });
            }
            let omega = set_up.structure.modes[0].angular_frequency_rad_per_s;
            let excitation = Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: omega, phase_rad: 0.0 };
            let mut motion = Motion::new(&set_up, &excitation, &set_up.at_rest(base_at_start(&excitation)))?;
            motion.run(CYCLES.0 * TAU / omega, &mut ())?;
            let mut count = Count(0);
            let begun = Instant::now();
            motion.run((CYCLES.0 + CYCLES.1) * TAU / omega, &mut count)?;
            let rate = CYCLES.1 / begun.elapsed().as_secs_f64();
            println!(
                "{storeys} storeys, friction {force_n} N: {:.4} M cycles/s, {:.2} impacts a cycle",
                rate * 1e-6,
                count.0 as f64 / CYCLES.1
            );
        }
    }
    Ok(())
}
