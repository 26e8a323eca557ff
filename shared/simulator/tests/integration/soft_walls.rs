//! Soft walls in the simulated rig: their force sensors read the force of spring and dashpot.

use damprig_core::io::{Actuators, ForceScale, TICK_HZ, WALL_SUBSAMPLES};
use damprig_core::model::{Cavity, Particle, Release, SetUp, Structure, Wall};
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Plant, PlantConfig};

const PARTICLE_KG: f64 = 0.16;

/// 0.5 mN a count.
const SCALE: ForceScale = ForceScale { newtons_per_count: 5e-4, zero_counts: 8000.0 };

fn plant(stiffness_n_per_m: f64, damping_n_s_per_m: f64, release: Release) -> Plant<f64> {
    let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release };
    with_walls(wall, wall)
}

fn with_walls(wall: Wall, positive: Wall) -> Plant<f64> {
    let particle = Particle {
        mass_kg: PARTICLE_KG,
        clearance_m: 7.5e-3,
        friction_coefficient: 0.0,
        wall,
        cavity: Cavity { positive_wall: Some(positive), ..Cavity::default() },
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) };
    // Pulses of hard walls that stay within the range of the converter.
    let walls = WallSensors {
        scale: SCALE,
        highest_counts: 0x7fff,
        noise_rms_n: 0.0,
        contact_s: 10e-3,
        ..WallSensors::default()
    };
    Plant::new(&PlantConfig { walls: Some(walls), structure_start_m: 0.005, ..PlantConfig::ideal(set_up) }).unwrap()
}

/// A soft wall gives its force and a hard one its pulses: both together are what the particle gains.
#[test]
fn a_hard_and_a_soft_wall_each_give_the_impulse_that_the_particle_gets() {
    let sample_s = 1.0 / f64::from(TICK_HZ) / WALL_SUBSAMPLES as f64;
    let soft = Wall::Voigt { stiffness_n_per_m: 1024.9, damping_n_s_per_m: 14.6, release: Release::ZeroForce };
    let mut plant = with_walls(soft, Wall::Restitution { coefficient: 0.6 });
    let momentum = |plant: &Plant<f64>| {
        let motion = plant.motion();
        PARTICLE_KG * (motion.state().v + motion.state().slide) * motion.units().velocity_m_per_s()
    };
    let start = momentum(&plant);
    let mut impulses_n_s = [0.0; 2];
    let mut is_pressed = true;
    for tick in 0..8_000 {
        // The sums are compared where no wall pushes.
        if tick > 6_000 && !is_pressed {
            break;
        }
        is_pressed = false;
        for pair in plant.tick(&Actuators::default()).walls {
            for (wall, impulse) in impulses_n_s.iter_mut().enumerate() {
                let force_n = f64::from(SCALE.to_force_n(f32::from(pair.of(wall))));
                *impulse += force_n * sample_s;
                is_pressed |= force_n != 0.0;
            }
        }
    }
    let [low, high] = impulses_n_s;
    let gained = momentum(&plant) - start;
    println!("{low} N s of the soft wall, {high} N s of the hard one, {gained} N s gained");
    // Half a count of each sample of a contact.
    assert!(low > 0.05 && high > 0.05, "{low} {high}");
    assert!((low - high - gained).abs() < 1e-3 * (low + high), "{low} {high} {gained}");
}

/// Without internal friction only the walls change the particle's velocity: the sum of the readings of a contact is its gain of
/// momentum. The sum misses at most a sample where the force jumps (it begins with the dashpot's), and half a count of each sample.
#[test]
fn the_readings_of_a_soft_walls_sensor_sum_up_to_the_particles_momentum() {
    let sample_s = 1.0 / f64::from(TICK_HZ) / WALL_SUBSAMPLES as f64;
    let half_count_n = 0.5 * f64::from(SCALE.newtons_per_count);
    for (stiffness, damping, release) in [
        (1024.9, 14.6, Release::ZeroForce),
        (43_436.0, 80.0, Release::ZeroForce),
        (1024.9, 14.6, Release::ZeroPenetration),
    ] {
        let mut plant = plant(stiffness, damping, release);
        let velocity = |plant: &Plant<f64>| {
            let motion = plant.motion();
            (motion.state().v + motion.state().slide) * motion.units().velocity_m_per_s()
        };
        let (mut impulse_n_s, mut allowed_n_s, mut last_n, mut contacts, mut worst) = (0.0, 0.0, 0.0_f64, 0, 0.0_f64);
        let mut start = velocity(&plant);
        for _ in 0..6_000 {
            for pair in plant.tick(&Actuators::default()).walls {
                let [low, high] = [0, 1].map(|wall| f64::from(SCALE.to_force_n(f32::from(pair.of(wall)))));
                // The wall at +d pushes the particle towards −d.
                let force_n = low - high;
                if (force_n == 0.0) != (last_n == 0.0) {
                    allowed_n_s += force_n.abs().max(last_n.abs()) * sample_s;
                }
                if force_n != 0.0 {
                    allowed_n_s += half_count_n * sample_s;
                }
                last_n = force_n;
                impulse_n_s += force_n * sample_s;
            }
            // Between two contacts.
            if last_n == 0.0 && impulse_n_s != 0.0 {
                let gained_n_s = PARTICLE_KG * (velocity(&plant) - start);
                let missed_n_s = (impulse_n_s - gained_n_s).abs();
                assert!(missed_n_s <= allowed_n_s, "{impulse_n_s} for {gained_n_s} ± {allowed_n_s}");
                worst = worst.max(allowed_n_s / gained_n_s.abs());
                (impulse_n_s, allowed_n_s, start) = (0.0, 0.0, velocity(&plant));
                contacts += 1;
            }
        }
        println!(
            "k1 = {stiffness}: {contacts} contacts, each known to {:.1} % of its impulse or better",
            100.0 * worst
        );
        assert!(contacts > 8, "{contacts} contacts");
    }
}
