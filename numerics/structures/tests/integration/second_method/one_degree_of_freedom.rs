//! The second method compared with the exact integrator of the core, on random set-ups with one degree of freedom.

use super::Reference;
use crate::one_mode::set_up;
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{
    Cavity, FrictionDamper, Initial, Particle, Release, Restitution, SetUp as Single, SpeedTable, Structure, Tmd, Wall,
};
use damprig_structures::State;
use fastrand::Rng;
use std::f64::consts::TAU;

/// A uniform random number.
fn between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

/// Compares 24 random set-ups with dampers that `mount` draws over 30 cycles, as far as they do not amplify a change of 1e-10 by more
/// than 1000.
fn compare(name: &str, seed: u64, mount: impl Fn(&mut Rng, Structure) -> Single) {
    let mut rng = Rng::with_seed(seed);
    let (mut worst, mut cycles, mut whole, mut events) = (0.0_f64, 0, 0, [0; 4]);
    for number in 0..24 {
        let natural_hz = between(&mut rng, 1.0, 5.0);
        let damping_ratio = between(&mut rng, 0.003, 0.03);
        let structure = Structure::from_modal(between(&mut rng, 0.5, 3.0), natural_hz, damping_ratio);
        let single = mount(&mut rng, structure);
        let turning = TAU * natural_hz * between(&mut rng, 0.8, 1.2);
        let (amplitude_m, phase_rad) = (between(&mut rng, 1e-3, 4e-3), between(&mut rng, -3.0, 3.0));
        let excitation = match number % 3 {
            0 => Excitation::ForceSine {
                amplitude_n: amplitude_m * structure.stiffness_n_per_m,
                angular_frequency_rad_per_s: turning,
                phase_rad,
            },
            _ => Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad },
        };
        let x_m = between(&mut rng, -8e-3, 8e-3);
        let y_m = x_m + single.particle.map_or(0.0, |particle| particle.cavity.offset_m);
        let initial = Initial { x_m, y_m, v_m_per_s: between(&mut rng, -0.1, 0.1), u_m_per_s: 0.0 };
        let cycle_s = TAU / turning;
        let clearance_m = single.particle.map_or(0.0, |particle| particle.clearance_m);
        let mut reference = Reference::new(
            &set_up(&single, &excitation),
            &excitation,
            &State::of_one_degree(&single, &initial, &excitation),
            cycle_s,
            clearance_m.max(amplitude_m),
        )
        .unwrap();
        let mut exact = Exact::new(&single, &excitation, &initial).unwrap();
        let nudged = Initial { x_m: x_m + 1e-10 * reference.scale_m(), ..initial };
        let mut beside = Exact::new(&single, &excitation, &nudged).unwrap();
        let (mut growth, mut is_whole) = (1.0_f64, true);
        for cycle in 1..=30 {
            reference.cycle().unwrap_or_else(|error| panic!("{name} {number}, cycle {cycle}: {error}: {single:?}"));
            let at = |exact: &mut Exact| {
                exact.run(f64::from(cycle) * cycle_s, &mut ());
                let now = exact.state();
                let initial =
                    Initial { x_m: now.x_m, v_m_per_s: now.v_m_per_s, y_m: now.y_m(), u_m_per_s: now.u_m_per_s() };
                State::of_one_degree(&single, &initial, &excitation)
            };
            let (expected, changed) = (at(&mut exact), at(&mut beside));
            growth = growth.max(reference.apart_m(&expected, &changed) / (1e-10 * reference.scale_m()));
            if growth > 1e3 {
                is_whole = false;
                break;
            }
            let apart = reference.apart_m(&reference.state(), &expected) / reference.scale_m();
            assert!(
                apart <= 1e-10 * growth,
                "{name} {number}, cycle {cycle}: {apart:e}, growth {growth:.0}, {:?}: {single:?} {excitation:?} {initial:?}",
                reference.counts
            );
            worst = worst.max(apart / growth);
            cycles += 1;
        }
        whole += u32::from(is_whole);
        let counts = reference.counts;
        for (sum, count) in events.iter_mut().zip([counts.impacts, counts.soft_contacts, counts.rests, counts.sticks]) {
            *sum += count;
        }
    }
    println!(
        "{name}: {whole} of 24 whole, {cycles} cycles, largest difference {worst:.1e} of the displacements times the growth; {} impacts, {} soft contacts, {} rests, {} sticks",
        events[0], events[1], events[2], events[3]
    );
    assert!(cycles > 200, "{name}: only {cycles} cycles could be compared");
}

fn particle(rng: &mut Rng, structure: Structure, wall: Wall) -> Particle {
    Particle {
        mass_kg: structure.mass_kg * between(rng, 0.02, 0.2),
        clearance_m: between(rng, 4e-3, 20e-3),
        friction_coefficient: if rng.bool() { between(rng, 0.01, 0.15) } else { 0.0 },
        wall,
        cavity: Cavity {
            inclination_deg: if rng.bool() { between(rng, -30.0, 30.0) } else { 0.0 },
            offset_m: if rng.bool() { between(rng, -5e-3, 5e-3) } else { 0.0 },
            positive_wall: None,
        },
    }
}

#[test]
fn impact_dampers_agree_with_the_core() {
    compare("impact dampers", 1, |rng, structure| {
        let wall = match rng.u8(0..3) {
            0 => Wall::SpeedRestitution(Restitution {
                coefficient: between(rng, 0.3, 0.6),
                reference_speed_m_per_s: 0.1,
                exponent: between(rng, 0.05, 0.25),
                maximum: 0.8,
            }),
            1 => Wall::TableRestitution(SpeedTable::new(&[[0.05, 0.7], [0.2, 0.55], [0.6, 0.5]]).unwrap()),
            _ => Wall::Restitution { coefficient: between(rng, 0.2, 0.7) },
        };
        Single { particle: Some(particle(rng, structure, wall)), ..Single::bare(structure) }
    });
}

#[test]
fn hybrid_dampers_agree_with_the_core() {
    compare("hybrid dampers", 2, |rng, structure| {
        let wall = Wall::Restitution { coefficient: between(rng, 0.2, 0.7) };
        let force_n = structure.stiffness_n_per_m * between(rng, 0.5e-3, 4e-3);
        Single {
            particle: Some(particle(rng, structure, wall)),
            friction_damper: Some(FrictionDamper { force_n }),
            ..Single::bare(structure)
        }
    });
}

#[test]
fn soft_walls_agree_with_the_core() {
    compare("soft walls", 3, |rng, structure| {
        let release = if rng.bool() { Release::ZeroForce } else { Release::ZeroPenetration };
        let (stiffness_n_per_m, damping_n_s_per_m) = (between(rng, 300.0, 5000.0), between(rng, 0.0, 5.0));
        let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release };
        let force_n = structure.stiffness_n_per_m * between(rng, 0.5e-3, 3e-3);
        Single {
            particle: Some(particle(rng, structure, wall)),
            friction_damper: rng.bool().then_some(FrictionDamper { force_n }),
            ..Single::bare(structure)
        }
    });
}

#[test]
fn tuned_masses_agree_with_the_core() {
    compare("tuned masses", 4, |rng, structure| {
        let mass_kg = structure.mass_kg * between(rng, 0.02, 0.2);
        let force_n = structure.stiffness_n_per_m * between(rng, 0.5e-3, 3e-3);
        let tmd = Tmd {
            mass_kg,
            stiffness_n_per_m: mass_kg * between(rng, 30.0, 900.0),
            damping_n_s_per_m: mass_kg * between(rng, 0.0, 6.0),
        };
        let friction_damper = rng.bool().then_some(FrictionDamper { force_n });
        Single { tmd: Some(tmd), friction_damper, ..Single::bare(structure) }
    });
}
