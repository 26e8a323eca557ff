//! Prints cycles a second of the engine: an impact damper in steady motion with two impacts a cycle on structures of 1 to 20 modes.

use std::time::Instant;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{FrictionDamper, Particle, Wall};
use damprig_structures::{FrictionJoint, Impact, ImpactDamper, Mode, Modes, Motion, Observer, SetUp};

struct Count(u64);
impl Observer for Count {
    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

fn main() {
    for (n, friction) in [(1, 0.0), (2, 0.0), (5, 0.0), (20, 0.0), (1, 0.6), (5, 0.6)] {
        let modes = (0..n)
            .map(|i| {
                let k = f64::from(i) + 0.5;
                let ratio = (k / 0.5) * (k / 0.5);
                Mode {
                    angular_frequency_rad_per_s: std::f64::consts::TAU * 2.5 * ratio,
                    damping_ratio: 0.0038,
                    shape: vec![if i % 2 == 0 { 1.0 } else { -1.0 } / 1.6_f64.sqrt()],
                    participation: 1.6_f64.sqrt() / k / 2.0,
                }
            })
            .collect();
        let structure = Modes { modes, influence: vec![1.0], coupling_per_s: Vec::new() };
        let wall = Wall::Restitution { coefficient: 0.3 };
        let particle =
            Particle { mass_kg: 0.16, clearance_m: 30e-3, friction_coefficient: 0.0, wall, cavity: Default::default() };
        let mut set_up = SetUp { impact_dampers: vec![ImpactDamper { place: 0, particle }], ..SetUp::bare(structure) };
        if friction > 0.0 {
            set_up.friction_dampers.push(FrictionJoint {
                place: 0,
                other: None,
                damper: FrictionDamper { force_n: friction },
            });
        }
        let excitation = Excitation::Sine {
            amplitude_m: 3e-3,
            angular_frequency_rad_per_s: std::f64::consts::TAU * 2.5,
            phase_rad: 0.0,
        };
        let start = set_up.at_rest(3e-3 * std::f64::consts::TAU * 2.5);
        let mut motion = Motion::new(&set_up, &excitation, &start).unwrap();
        let mut count = Count(0);
        motion.run(400.0, &mut count).unwrap();
        count.0 = 0;
        let begun = Instant::now();
        let cycles = 2_000.0;
        motion.run(400.0 + cycles * 0.4, &mut count).unwrap();
        let rate = cycles / begun.elapsed().as_secs_f64();
        println!(
            "{n} modes, friction {friction} N: {:.4} M cycles/s, {:.2} impacts a cycle, unresolved {}",
            rate * 1e-6,
            count.0 as f64 / cycles,
            motion.unresolved()
        );
    }
}
