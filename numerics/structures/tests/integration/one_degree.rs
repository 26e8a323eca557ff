//! A structure of one mode moves as in the engine for one degree of freedom.

use damprig_core::integrator::exact::{Exact, ExactState, Excitation};
use damprig_core::model::{Cavity, FrictionDamper, Particle, Release, SetUp as One, Structure, Tmd, Wall};
use damprig_structures::{HarmonicForce, Motion, SetUp, State};
use nalgebra::Complex;

use crate::one_mode::set_up;

type C64 = Complex<f64>;

fn structure() -> Structure {
    Structure::from_modal(1.6, 2.5, 0.0038)
}

fn particle(clearance_m: f64, wall: Wall, friction_coefficient: f64) -> Particle {
    Particle { mass_kg: 0.16, clearance_m, friction_coefficient, wall, cavity: Default::default() }
}

/// Relative distance of the second motions, which tell how far nearby motions part.
const NEARBY: f64 = 1e-10;

/// Rounding of a cycle relative to the largest x. In the first cycles at resonance the forced motion is up to 40 times as large as the
/// whole motion; four events of a cycle, each with a few roundings of it, are 40·4·5·1.1e-16.
const PER_CYCLE: f64 = 1e-13;

/// A motion that left the exact one at the start of a cycle.
struct Nearby {
    motion: Exact,
    from_m: f64,
}

/// Compares x and y at the ends of `cycles`, relative to the largest x. The rounding of each cycle has grown as the distance of a motion
/// that started this cycle [`NEARBY`].
fn agrees(name: &str, one: &One, excitation: &Excitation, cycles: u32) {
    let start = State::of_one_degree(one, &one.neutral(), excitation);
    let motion = Motion::new(&set_up(one, excitation), excitation, &start).unwrap();
    moves_as(name, motion, one, excitation, cycles);
}

fn moves_as(name: &str, mut motion: Motion, one: &One, excitation: &Excitation, cycles: u32) {
    let mut exact = Exact::new(one, excitation, &one.neutral()).unwrap();
    let root = one.structure.mass_kg.sqrt();
    let omega = excitation.angular_frequency_rad_per_s();
    let has_body = one.particle.is_some() || one.tmd.is_some();
    let distance = |a: &ExactState, x_m: f64, y_m: f64| {
        (a.x_m - x_m).abs().max(if has_body { (a.y_m() - y_m).abs() } else { 0.0 })
    };
    let (mut most, mut worst) = (1e-4_f64, (0.0_f64, 0.0_f64));
    let mut others: Vec<Nearby> = Vec::new();
    for n in 1..=cycles {
        let until_s = f64::from(n) * std::f64::consts::TAU / omega;
        let from_m = NEARBY * most;
        let mut nearby = exact.clone();
        let start = ExactState { v_m_per_s: exact.state().v_m_per_s + from_m * omega, ..*exact.state() };
        nearby.resume(exact.time_s(), &start, exact.fastest_m_per_s());
        others.push(Nearby { motion: nearby, from_m });
        exact.run(until_s, &mut ());
        motion.run(until_s, &mut ()).unwrap();
        let now = exact.state();
        let growth = |other: &mut Nearby| {
            other.motion.run(until_s, &mut ());
            distance(other.motion.state(), now.x_m, now.y_m()) / other.from_m
        };
        let allowed = PER_CYCLE * others.iter_mut().map(growth).sum::<f64>().max(1.0);
        most = most.max(now.x_m.abs());
        let state: State = motion.state();
        let body = state.particles.first().or(state.tuned_masses.first()).map_or(0.0, |body| body.y_m);
        let off = distance(now, state.modal[0] / root + motion.base().0, body) / most;
        worst = (worst.0.max(off), worst.1.max(allowed));
        assert!(off < allowed, "{name}, cycle {n}: {off:e} apart, {allowed:e} allowed");
    }
    assert_eq!(motion.unresolved(), 0);
    println!("{name}: {:.1e} apart within {cycles} cycles, {:.1e} allowed", worst.0, worst.1);
    assert!(worst.0 < 1e-9, "{name}: {:e}", worst.0);
}

fn sine(frequency_hz: f64) -> Excitation {
    Excitation::Sine {
        amplitude_m: 3e-3,
        angular_frequency_rad_per_s: std::f64::consts::TAU * frequency_hz,
        phase_rad: 0.0,
    }
}

#[test]
fn a_bare_structure_moves_as_with_one_degree() {
    agrees("bare", &One::bare(structure()), &sine(2.4), 50);
}

#[test]
fn a_tuned_mass_moves_as_with_one_degree() {
    let tmd = Some(Tmd { mass_kg: 0.16, stiffness_n_per_m: 32.83, damping_n_s_per_m: 0.77 });
    agrees("tuned mass", &One { tmd, ..One::bare(structure()) }, &sine(2.4), 50);
}

#[test]
fn an_impact_damper_moves_as_with_one_degree() {
    for (e, d, cycles) in [(0.3, 30e-3, 100), (0.5, 30e-3, 100), (0.5, 15e-3, 12)] {
        let particle = Some(particle(d, Wall::Restitution { coefficient: e }, 0.0));
        agrees(&format!("e = {e}, d = {d}"), &One { particle, ..One::bare(structure()) }, &sine(2.5), cycles);
    }
}

#[test]
fn chatter_and_internal_friction_move_as_with_one_degree() {
    for (e, d, friction, cycles) in [(0.3, 60e-3, 0.0, 60), (0.3, 22.5e-3, 0.08, 60), (0.0, 22.5e-3, 0.18, 40)] {
        let particle = Some(particle(d, Wall::Restitution { coefficient: e }, friction));
        let name = format!("e = {e}, d = {d}, friction {friction}");
        agrees(&name, &One { particle, ..One::bare(structure()) }, &sine(2.5), cycles);
    }
}

#[test]
fn a_friction_damper_and_a_hybrid_move_as_with_one_degree() {
    let friction_damper = Some(FrictionDamper { force_n: 0.6 });
    agrees("friction damper", &One { friction_damper, ..One::bare(structure()) }, &sine(2.4), 60);
    let particle = Some(particle(15e-3, Wall::Restitution { coefficient: 0.47 }, 0.08));
    agrees("hybrid", &One { particle, friction_damper, ..One::bare(structure()) }, &sine(2.45), 40);
}

#[test]
fn an_inclined_cavity_off_its_centre_with_two_walls_moves_as_with_one_degree() {
    let wall = Wall::Restitution { coefficient: 0.5 };
    let soft = Wall::Voigt { stiffness_n_per_m: 1024.9, damping_n_s_per_m: 2.0, release: Release::ZeroForce };
    for (positive_wall, inclination_deg) in [(None, 10.0), (Some(soft), -20.0), (None, 90.0)] {
        let cavity = Cavity { positive_wall, offset_m: 2e-3, inclination_deg };
        let particle = Some(Particle { cavity, ..particle(10e-3, wall, 0.05) });
        agrees(&format!("{inclination_deg}°"), &One { particle, ..One::bare(structure()) }, &sine(2.5), 6);
    }
}

/// k z + c z′ + P sin(Ωt + φ) is what another base would exert, k z₂ + c z₂′.
#[test]
fn a_force_beside_a_moving_base_moves_as_the_base_that_exerts_both() {
    let particle = Some(particle(30e-3, Wall::Restitution { coefficient: 0.5 }, 0.05));
    let one = One { particle, ..One::bare(structure()) };
    let (omega, [amplitude_m, phase_rad], [amplitude_n, of_force_rad]) =
        (std::f64::consts::TAU * 2.5, [2e-3, 0.4], [0.5, -1.1]);
    let exerts = C64::new(one.structure.stiffness_n_per_m, one.structure.damping_n_s_per_m * omega);
    let other = C64::from_polar(amplitude_m, phase_rad) + C64::from_polar(amplitude_n, of_force_rad) / exerts;
    let sine = |amplitude_m, phase_rad| Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: omega, phase_rad };
    let (base, other) = (sine(amplitude_m, phase_rad), sine(other.norm(), other.arg()));
    let force = HarmonicForce { place: 0, amplitude_n, phase_rad: of_force_rad };
    let set_up = SetUp { force_beside_base: Some(force), ..SetUp::from(&one) };
    let start = State::of_one_degree(&one, &one.neutral(), &base);
    moves_as("force and base", Motion::new(&set_up, &base, &start).unwrap(), &one, &other, 60);
}

#[test]
fn a_driving_force_moves_as_with_one_degree() {
    let particle = Some(particle(22.5e-3, Wall::Restitution { coefficient: 0.4 }, 0.0));
    let friction_damper = Some(FrictionDamper { force_n: 0.2 });
    let one = One { particle, friction_damper, ..One::bare(structure()) };
    let excitation = Excitation::ForceSine {
        amplitude_n: 1.2,
        angular_frequency_rad_per_s: std::f64::consts::TAU * 2.45,
        phase_rad: 0.3,
    };
    agrees("force", &one, &excitation, 30);
}

#[test]
fn soft_walls_move_as_with_one_degree() {
    for release in [Release::ZeroForce, Release::ZeroPenetration] {
        let wall = Wall::Voigt { stiffness_n_per_m: 1024.9, damping_n_s_per_m: 2.0, release };
        let particle = Some(particle(22.5e-3, wall, 0.0));
        agrees(&format!("{release:?}"), &One { particle, ..One::bare(structure()) }, &sine(2.5), 6);
    }
}

/// Pulses end: there the closed form of the excitation changes, and the base's velocity jumps.
#[test]
fn pulses_move_as_with_one_degree() {
    let particle = Some(particle(10e-3, Wall::Restitution { coefficient: 0.4 }, 0.05));
    let friction_damper = Some(FrictionDamper { force_n: 0.4 });
    let one = One { particle, friction_damper, ..One::bare(structure()) };
    for excitation in [
        Excitation::HalfSine { amplitude_m: 20e-3, duration_s: 0.15 },
        Excitation::Versine { amplitude_m: 20e-3, duration_s: 0.3 },
        Excitation::ForceHalfSine { amplitude_n: 15.0, duration_s: 0.1 },
    ] {
        agrees(&format!("{excitation:?}"), &one, &excitation, 8);
    }
}

/// However many steps a pulse takes: its closed form is taken anew every 16 steps.
#[test]
fn a_pulse_in_any_number_of_parts_moves_as_with_one_degree() {
    let one = One::bare(structure());
    let excitation = Excitation::HalfSine { amplitude_m: 20e-3, duration_s: 0.3 };
    let mut exact = Exact::new(&one, &excitation, &one.neutral()).unwrap();
    exact.run(0.4, &mut ());
    for parts in 1..=40 {
        let start = State::of_one_degree(&one, &one.neutral(), &excitation);
        let mut motion = Motion::new(&set_up(&one, &excitation), &excitation, &start).unwrap();
        for part in 1..=parts {
            motion.run(0.3 * f64::from(part) / f64::from(parts), &mut ()).unwrap();
        }
        motion.run(0.4, &mut ()).unwrap();
        let x_m = motion.state().modal[0] / one.structure.mass_kg.sqrt();
        assert!((x_m - exact.state().x_m).abs() < PER_CYCLE * 20e-3, "{parts} parts: {x_m} {}", exact.state().x_m);
    }
}
