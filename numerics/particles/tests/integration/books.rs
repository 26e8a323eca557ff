//! Momentum and energy are accounted for, and a motion is repeatable.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper, Motion, Start};

use crate::{rig, spheres, spring};

fn bed(steps_per_contact: f64, seed: u64) -> Motion<Excitation> {
    let cavity = Cavity { length_m: 0.06, width_m: 0.025, height_m: 0.04 };
    let damper = Damper { friction_coefficient: 0.3, steps_per_contact, seed, ..spheres(40, 0.008, cavity) };
    let sine = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: 15.7, phase_rad: 0.3 };
    Motion::new(rig(), &damper, sine, Start { x_m: 0.01, v_m_per_s: 0.1 }).expect("physical")
}

#[test]
fn the_momentum_changes_by_the_impulse_of_the_outer_forces() {
    let mut motion = bed(25.0, 1);
    let (start, mut impulse, mut largest, mut impacts) = (motion.momentum_n_s(), 0.0, 0.0_f64, 0);
    while motion.state().t_s < 1.0 {
        let before = motion.outer_force_n();
        motion.step(&mut |_| impacts += 1);
        impulse += 0.5 * motion.step_s() * (before + motion.outer_force_n());
        largest = largest.max(motion.momentum_n_s().abs());
    }
    assert!(impacts > 100, "{impacts}");
    let error = (motion.momentum_n_s() - start - impulse).abs();
    // Roundings of some ten thousand steps.
    assert!(error < 1e-11 * largest, "{error} of {largest}");
}

/// Share of the energy lost in contacts that the book misses after a second.
fn missing(steps_per_contact: f64) -> f64 {
    let mut motion = bed(steps_per_contact, 1);
    let start_j = motion.energies().book_j();
    let mut lost_j = 0.0;
    while motion.state().t_s < 1.0 {
        let next_s = motion.state().t_s + 0.02;
        while motion.state().t_s < next_s {
            motion.step(&mut |_| ());
        }
        let energies = motion.energies();
        let book_j = (energies.book_j() - start_j).abs();
        assert!(energies.lost_in_contacts_j() > lost_j - 2.0 * book_j, "losses never fall");
        lost_j = energies.lost_in_contacts_j();
    }
    let energies = motion.energies();
    assert!(energies.lost_in_impacts_j > 0.0 && energies.lost_in_friction_j > 0.0, "{energies:?}");
    ((energies.book_j() - start_j) / lost_j).abs()
}

#[test]
fn the_energy_book_closes_to_the_second_order_of_the_step() {
    let found = [12.0, 24.0, 48.0, 96.0].map(missing);
    println!("{found:?}");
    assert!(found[3] < 1e-3, "{found:?}");
    assert!(found[3] < found[0] / 16.0, "{found:?}");
}

#[test]
fn two_runs_have_the_same_bits_and_another_seed_other_ones() {
    let run = |seed: u64| {
        let mut motion = bed(20.0, seed);
        let mut impacts = 0_u64;
        while motion.state().t_s < 0.5 {
            motion.step(&mut |impact| {
                impacts = impacts.rotate_left(5) ^ impact.t_s.to_bits() ^ impact.approach_speed_m_per_s.to_bits();
            });
        }
        let centres = motion.centres_m().iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
        (centres, motion.state().x_m.to_bits(), impacts)
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1).1, run(2).1);
}

#[test]
fn the_book_closes_with_contacts_slower_than_the_structure_and_with_heavy_dampers() {
    let cavity = Cavity { length_m: 0.06, width_m: 0.025, height_m: 0.04 };
    let bed = spheres(40, 0.008, cavity);
    // A contact of a second, a structure with ζ = 200, spheres of 50 times the structure's mass.
    let soft = Damper { elasticity: spring(0.02), gravity_m_per_s2: 0.0, ..bed };
    let stiff = Structure::from_modal(1.6, 2.5, 200.0);
    let heavy = Damper { mass_kg: 80.0, elasticity: spring(1e6), ..bed };
    for (structure, damper) in [(rig(), soft), (stiff, bed), (rig(), heavy)] {
        let start = Start { x_m: 0.01, v_m_per_s: 0.1 };
        let sine = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: 15.7, phase_rad: 0.3 };
        let mut motion = Motion::new(structure, &damper, sine, start).expect("physical");
        let start_j = motion.energies().book_j();
        let mut largest_j = 0.0_f64;
        while motion.state().t_s < 1.0 {
            motion.step(&mut |_| ());
            largest_j = largest_j.max(motion.energies().held_j());
        }
        let energies = motion.energies();
        let turned_over_j = largest_j + energies.lost_in_contacts_j() + energies.lost_in_structure_j;
        let missing = ((energies.book_j() - start_j) / turned_over_j).abs();
        println!("{missing:e} of {turned_over_j} J, step {:e} s", motion.step_s());
        // 25 steps of the fastest half period: (ωΔt)² = (π/25)².
        assert!(missing < 0.016, "{damper:?}: {missing} of {turned_over_j} J");
    }
}
