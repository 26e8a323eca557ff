//! The shaker that feels its load: closed form of the coupled system, momentum and energy balances, and limits.

use damprig_core::integrator::sampled::Joined;
use damprig_core::integrator::units::Units;
use damprig_core::io::Actuators;
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, Release, SetUp, Structure, Tmd, Tuning, Wall};
use damprig_core::scalar::Scalar;
use damprig_simulator::plant::table::Table;
use damprig_simulator::plant::{Amplifier, Base, Plant, PlantConfig, SensorModel, Shaker};
use std::f64::consts::TAU;

const TICK_S: f64 = 1e-3;

fn bare() -> SetUp {
    SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038))
}

fn hybrid(friction_n: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 7.5e-3,
        friction_coefficient: 0.08,
        wall: Wall::Restitution { coefficient: 0.47 },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), friction_damper: Some(FrictionDamper { force_n: friction_n }), ..bare() }
}

fn soft(stiffness_n_per_m: f64) -> SetUp {
    let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m: 15.0, release: Release::ZeroForce };
    let hybrid = hybrid(0.5);
    SetUp { particle: hybrid.particle.map(|particle| Particle { wall, ..particle }), ..hybrid }
}

fn tuned() -> SetUp {
    let bare = bare();
    SetUp { tmd: Some(Tmd::tuned(&bare.structure, 0.16, Tuning::DenHartog)), ..bare }
}

type Complex = (f64, f64);

fn divide(a: Complex, b: Complex) -> Complex {
    let square = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / square, (a.1 * b.0 - a.0 * b.1) / square)
}

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn modulus(a: Complex) -> f64 {
    a.0.hypot(a.1)
}

/// Steady z and x per demanded displacement, for a drive held over each tick: x = T z and (k − mΩ² + jΩc − MΩ² T) z =
/// force. A tuned mass m on k1 and c1 moves with the structure as M + m (k1 + jΩc1)/(k1 − mΩ² + jΩc1).
fn closed_form(set_up: &SetUp, shaker: &Shaker, frequency_hz: f64) -> (Complex, Complex) {
    let omega = TAU * frequency_hz;
    let s = &set_up.structure;
    let spring = (s.stiffness_n_per_m, omega * s.damping_n_s_per_m);
    let tuned = set_up.tmd.map_or((0.0, 0.0), |tmd| {
        let own = (tmd.stiffness_n_per_m, omega * tmd.damping_n_s_per_m);
        let moved = divide(own, (own.0 - tmd.mass_kg * omega * omega, own.1));
        (tmd.mass_kg * moved.0, tmd.mass_kg * moved.1)
    });
    let load = ((s.mass_kg + tuned.0) * omega * omega, tuned.1 * omega * omega);
    let transmitted = divide(spring, (spring.0 - load.0, spring.1 - load.1));
    let table = shaker.dynamic_stiffness_n_per_m(omega);
    let reaction = times(load, transmitted);
    let total = (table.0 - reaction.0, table.1 - reaction.1);
    // Zero-order hold over a tick: factor sin(Ωh/2)/(Ωh/2), delay of half a tick.
    let half = omega * TICK_S / 2.0;
    let force = shaker.force_per_drive_n_per_m() * half.sin() / half;
    let z = divide((force * half.cos(), -force * half.sin()), total);
    (z, times(transmitted, z))
}

/// Simulated z and x per demanded displacement at the drive frequency, by correlation over 40 cycles after 80 s.
fn simulated<S: Scalar>(set_up: &SetUp, shaker: &Shaker, frequency_hz: f64, steps: u8) -> (Complex, Complex) {
    let units = Units::metres(TICK_S / f64::from(steps));
    let mut motion = Joined::<S>::joined(set_up, units, &Initial::default()).unwrap();
    let mut table = Table::<S>::new(shaker, set_up, &units);
    let (settle, ticks) = (80_000, (40.0 / frequency_hz / TICK_S).round() as usize);
    let mut sums = [0.0; 4];
    for tick in 0..settle + ticks {
        let angle = TAU * frequency_hz * TICK_S * tick as f64;
        if tick >= settle {
            let (z, x) = (table.z().to_f64(), motion.state().x.to_f64());
            for (sum, value) in
                sums.iter_mut().zip([z * angle.sin(), z * angle.cos(), x * angle.sin(), x * angle.cos()])
            {
                *sum += value;
            }
        }
        let drive = S::from_f64(1e-3 * angle.sin());
        for _ in 0..steps {
            table.step(&mut motion, drive, &mut ());
        }
    }
    let [a, b, c, d] = sums.map(|sum| sum * 2.0 / ticks as f64 / 1e-3);
    ((a, b), (c, d))
}

fn error(found: Complex, exact: Complex) -> f64 {
    modulus((found.0 - exact.0, found.1 - exact.1)) / modulus(exact)
}

/// At these frequencies 40 cycles are a whole number of ticks, so the correlation is exact.
const FREQUENCIES_HZ: [f64; 5] = [2.0, 2.5, 3.125, 4.0, 8.0];

/// The parabola's error at the drive frequency is (Ωh)²/12; the remaining transient is below 1e-9. `f32` rounds the
/// momentum that passes between structure and table at the size of the structure's velocity, X/Z times the table's.
#[test]
fn drive_to_base_and_structure_follow_the_closed_form_of_the_coupled_system() {
    let shaker = Shaker::default();
    for (frequency, set_up) in FREQUENCIES_HZ.into_iter().flat_map(|f| [(f, bare()), (f, tuned())]) {
        let exact = closed_form(&set_up, &shaker, frequency);
        let step_error = (TAU * frequency * TICK_S / 3.0).powi(2) / 12.0;
        let found = simulated::<f64>(&set_up, &shaker, frequency, 3);
        let single = simulated::<f32>(&set_up, &shaker, frequency, 3);
        for (name, f64_value, f32_value, exact) in
            [("z", found.0, single.0, exact.0), ("x", found.1, single.1, exact.1)]
        {
            let errors = (error(f64_value, exact), error(f32_value, exact));
            println!("{frequency} Hz {name}: {:.4} of the drive, errors {errors:?}", modulus(exact));
            assert!(errors.0 < 1.05 * step_error, "{frequency} Hz {name}: {errors:?}");
            assert!(errors.1 < 1.05 * step_error + 2e-5, "{frequency} Hz {name}: {errors:?}");
        }
    }
}

#[test]
fn a_current_amplifier_leaves_the_coupled_resonance_undamped() {
    // Four times the suspension's damping, so that the transient has faded when it is measured.
    let shaker = Shaker { amplifier: Amplifier::Current, suspension_damping_n_s_per_m: 20.0, ..Shaker::default() };
    for frequency in [2.5, 3.125] {
        let exact = closed_form(&bare(), &shaker, frequency).0;
        let found = simulated::<f64>(&bare(), &shaker, frequency, 2).0;
        assert!(error(found, exact) < 1e-4, "{frequency} Hz: {found:?} for {exact:?}");
    }
}

#[test]
fn halving_the_step_quarters_the_error() {
    let shaker = Shaker::default();
    let exact = closed_form(&bare(), &shaker, 4.0).0;
    let errors = [1, 2, 4, 8].map(|steps| error(simulated::<f64>(&bare(), &shaker, 4.0, steps).0, exact));
    for pair in errors.windows(2) {
        assert!((3.5..4.5).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// A shaker without drive, damping and suspension.
fn free_table() -> Shaker {
    Shaker {
        amplifier: Amplifier::Current,
        suspension_stiffness_n_per_m: 0.0,
        suspension_damping_n_s_per_m: 0.0,
        half_stroke_m: 1.0,
        ..Shaker::default()
    }
}

/// Total momentum over the structure's mass, m/s.
fn momentum(motion: &Joined<f64>, table: &Table<f64>, shaker: &Shaker, units: &Units) -> f64 {
    let state = motion.state();
    // The particle and the tuned mass of these set-ups have 0.16 kg.
    let second = 0.16 / 1.6 * (state.v + state.slide);
    (state.v + second + table.v() * shaker.moving_mass_kg / 1.6) * units.velocity_m_per_s()
}

#[test]
fn momentum_is_conserved_through_impacts_and_friction_without_external_forces() {
    let (shaker, units) = (free_table(), Units::metres(TICK_S / 3.0));
    let start = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    for set_up in [hybrid(0.5), soft(1e3), soft(1e5), tuned()] {
        let mut motion = Joined::<f64>::joined(&set_up, units, &start).unwrap();
        let mut table = Table::new(&shaker, &set_up, &units);
        let mut fastest: f64 = 0.0;
        for _ in 0..30_000 {
            table.step(&mut motion, 0.0, &mut ());
            fastest = fastest.max(motion.state().v.abs() * units.velocity_m_per_s());
            let total = momentum(&motion, &table, &shaker, &units);
            // The iteration stops at 4e-11 of the velocities; there are 30 000 steps.
            assert!(total.abs() < 1e-6 * fastest, "{total} with {fastest}: {set_up:?}");
        }
        assert!(fastest > 0.3, "nothing moved");
    }
}

/// Two masses on an undamped spring: the energy keeps its initial value, to second order in the step.
#[test]
fn an_undamped_pair_keeps_its_energy() {
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0));
    let (shaker, units) = (free_table(), Units::metres(TICK_S / 3.0));
    let mut motion = Joined::<f64>::joined(&set_up, units, &Initial { x_m: 0.035, ..Initial::default() }).unwrap();
    let mut table = Table::new(&shaker, &set_up, &units);
    let energy = |motion: &Joined<f64>, table: &Table<f64>| {
        let (v, w) = (motion.state().v * units.velocity_m_per_s(), table.v() * units.velocity_m_per_s());
        let stretch = motion.state().x - table.z();
        1.6 * v * v + 5.0 * w * w + set_up.structure.stiffness_n_per_m * stretch * stretch
    };
    let start = energy(&motion, &table);
    let mut worst: f64 = 0.0;
    for _ in 0..30_000 {
        table.step(&mut motion, 0.0, &mut ());
        worst = worst.max((energy(&motion, &table) / start - 1.0).abs());
    }
    // ωh = 0.006: an energy error of (ωh)² = 3.6e-5 that grew with every radian would reach 6e-3 over 29 cycles; it
    // does not grow.
    assert!(worst < 4e-5, "{worst}");
}

/// With a stuck friction damper structure and table move as one body.
#[test]
fn a_stuck_damper_moves_structure_and_table_as_one() {
    let (set_up, units) = (SetUp { particle: None, ..hybrid(1e3) }, Units::metres(TICK_S / 3.0));
    let shaker = Shaker { amplifier: Amplifier::Current, ..Shaker::default() };
    let mut motion = Joined::<f64>::joined(&set_up, units, &Initial::default()).unwrap();
    let mut table = Table::new(&shaker, &set_up, &units);
    let drive = 1e-3;
    for _ in 0..300 {
        table.step(&mut motion, drive, &mut ());
    }
    assert!((motion.state().x - table.z()).abs() < 1e-15);
    // A mass of 6.6 kg on the suspension after 0.1 s of constant force.
    let (mass, t) = (6.6, 0.1);
    let rate = shaker.suspension_damping_n_s_per_m / (2.0 * mass);
    let omega = (shaker.suspension_stiffness_n_per_m / mass - rate * rate).sqrt();
    let still = shaker.force_per_drive_n_per_m() * drive / shaker.suspension_stiffness_n_per_m;
    let exact = still * (1.0 - (-rate * t).exp() * ((omega * t).cos() + rate / omega * (omega * t).sin()));
    assert!((table.z() / exact - 1.0).abs() < 1e-5, "{} for {exact}", table.z());
}

#[test]
fn limits_of_the_amplifier_and_the_stroke_act_and_are_counted() {
    let config = |shaker| PlantConfig {
        base: Base::Shaker(shaker),
        sensors: SensorModel { noise_rms_m: 0.0, resolution_m: 0.0, ..SensorModel::default() },
        ..PlantConfig::ideal(bare())
    };
    let push = |shaker: Shaker, drive_m: f32| {
        let mut plant = Plant::<f64>::new(&config(shaker)).unwrap();
        let actuators = Actuators { drive_m, drive_enabled: true, ..Actuators::default() };
        let z = (0..2000).map(|_| plant.tick(&actuators).readings.z.mean_m).collect::<Vec<_>>();
        (z, plant.limited())
    };
    // A drive of 1 mm reaches no limit; the amplifier's 20 V correspond to 20/(30 · 2π · 2.5) = 42 mm.
    assert_eq!(push(Shaker::default(), 1e-3).1, 0);
    let (z, limited) = push(Shaker::default(), 0.3);
    assert!(limited > 0);
    assert!(z.iter().all(|&z| z <= 0.079 + 1e-6) && z.last() > Some(&0.0789), "{:?}", z.last());
    // With 20 V the table is limited to 20/30 m/s.
    assert!(z.windows(2).all(|pair| pair[1] - pair[0] < 0.67e-3));
}

#[test]
fn an_unphysical_value_of_a_shaker_is_rejected_by_name() {
    let refused = |shaker: Shaker| {
        let config = PlantConfig { base: Base::Shaker(shaker), ..PlantConfig::ideal(bare()) };
        Plant::<f64>::new(&config).unwrap_err().parameter
    };
    assert_eq!(refused(Shaker { moving_mass_kg: 0.0, ..Shaker::default() }), "shaker.moving_mass_kg");
    assert_eq!(refused(Shaker { force_factor_n_per_a: f64::NAN, ..Shaker::default() }), "shaker.force_factor_n_per_a");
    assert_eq!(refused(Shaker { half_stroke_m: -1.0, ..Shaker::default() }), "shaker.half_stroke_m");
    // The table is so light that the back-emf stops it within microseconds.
    assert_eq!(refused(Shaker { moving_mass_kg: 1e-3, ..Shaker::default() }), "shaker.moving_mass_kg");
}
