//! The second method compared with closed forms.

use super::Reference;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, FrictionDamper, Particle, Structure, Wall};
use damprig_structures::{Body, FrictionJoint, ImpactDamper, Mode, Modes, SetUp, State};
use std::f64::consts::TAU;

/// Two modes at one place.
fn two_modes() -> SetUp {
    let mode = |frequency_hz: f64, damping_ratio, shape, participation| Mode {
        angular_frequency_rad_per_s: TAU * frequency_hz,
        damping_ratio,
        shape: vec![shape],
        participation,
    };
    let modes = vec![mode(2.5, 0.01, 0.7, 1.2), mode(9.0, 0.03, -0.4, 0.5)];
    SetUp::bare(Modes { modes, influence: vec![1.0], coupling_per_s: Vec::new() })
}

/// A particle in a level cavity without friction.
fn particle(mass_kg: f64, clearance_m: f64, coefficient: f64) -> Particle {
    Particle {
        mass_kg,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient },
        cavity: Cavity::default(),
    }
}

/// q″ + 2ζω q′ + ω² q = Γ Z Ω² sin(Ωt + φ) from rest: the steady motion and the free motion that cancels it at t = 0.
fn forced_mode(mode: &Mode, amplitude: f64, turning: f64, phase: f64, t: f64) -> f64 {
    let (w, zeta) = (mode.angular_frequency_rad_per_s, mode.damping_ratio);
    let (real, imaginary) = (w * w - turning * turning, 2.0 * zeta * w * turning);
    let size = mode.participation * amplitude * turning * turning / real.hypot(imaginary);
    let lag = phase - imaginary.atan2(real);
    let damped = w * (1.0 - zeta * zeta).sqrt();
    let (q, v) = (-size * lag.sin(), -size * turning * lag.cos());
    let (sine, cosine) = (damped * t).sin_cos();
    size * (turning * t + lag).sin() + (-zeta * w * t).exp() * (q * cosine + (v + zeta * w * q) / damped * sine)
}

#[test]
fn modes_on_a_moving_base_follow_the_closed_form() {
    let set_up = two_modes();
    let (amplitude_m, turning, phase_rad) = (2e-3, TAU * 2.4, 0.7);
    let sine = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad };
    let start = State { modal: vec![0.0; 2], modal_rate: vec![0.0; 2], ..State::default() };
    let cycle_s = TAU / turning;
    let mut motion = Reference::new(&set_up, &sine, &start, cycle_s, amplitude_m).unwrap();
    for cycle in 1..=30 {
        motion.cycle().unwrap();
        let t = f64::from(cycle) * cycle_s;
        for (mode, q) in set_up.structure.modes.iter().zip(&motion.state().modal) {
            let expected = forced_mode(mode, amplitude_m, turning, phase_rad, t);
            assert!((q - expected).abs() < 3e-12 * motion.scale_m(), "cycle {cycle}: {:e}", q - expected);
        }
    }
}

/// Without damping each half period shortens the amplitude by 2F/k, until the spring can no longer overcome the friction.
#[test]
fn dry_friction_shortens_each_half_period_by_the_same_length() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0);
    let force_n = 0.9;
    let step_m = 2.0 * force_n / structure.stiffness_n_per_m;
    let joint = FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n } };
    let set_up = SetUp { friction_dampers: vec![joint], ..SetUp::bare(structure) };
    // 8.3 lengths: after 8 half periods it holds at 0.3 of one.
    let start = State { modal: vec![8.3 * step_m * 1.6_f64.sqrt()], modal_rate: vec![0.0], ..State::default() };
    let mut motion = Reference::new(&set_up, &Excitation::Fixed, &start, 0.2, step_m).unwrap();
    for half in 1..=12 {
        motion.cycle().unwrap();
        let left = if half < 8 { 8.3 - f64::from(half) } else { 0.3 };
        let expected = if half < 8 && half % 2 == 1 { -left } else { left } * step_m;
        let x = motion.state().modal[0] / 1.6_f64.sqrt();
        assert!((x - expected).abs() < 1e-12 * motion.scale_m(), "half period {half}: {:e}", x - expected);
    }
    assert_eq!(motion.state().modal_rate[0], 0.0);
}

/// A ball that falls from d bounces to e²d, e⁴d, …, and lies still after √(2d/g) (1 + e)/(1 − e).
#[test]
fn a_ball_on_a_node_bounces_as_in_the_textbook() {
    let mut set_up = two_modes();
    for mode in &mut set_up.structure.modes {
        mode.shape = vec![0.0];
    }
    let (d, e, g) = (0.02, 0.6, set_up.gravity_m_per_s2);
    let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
    set_up.impact_dampers = vec![ImpactDamper::new(0, Particle { cavity, ..particle(0.1, d, e) })];
    let fall_s = (2.0 * d / g).sqrt();
    let start =
        State { modal: vec![0.0; 2], modal_rate: vec![0.0; 2], particles: vec![Body::default()], ..State::default() };
    // Each cycle ends at the top of a flight.
    let mut motion = Reference::new(&set_up, &Excitation::Fixed, &start, fall_s * (1.0 + e), d).unwrap();
    motion.cycle().unwrap();
    let top = motion.state().particles[0];
    assert!((top.y_m + d - e * e * d).abs() < 1e-13 * d && top.u_m_per_s.abs() < 1e-13, "{top:?}");
    let rest_s = fall_s * (1.0 + e) / (1.0 - e);
    for (share, is_moving) in [(1.0 - 1e-5, true), (1.0 + 1e-5, false)] {
        let mut motion = Reference::new(&set_up, &Excitation::Fixed, &start, share * rest_s, d).unwrap();
        motion.cycle().unwrap();
        assert_eq!(motion.state().particles[0].u_m_per_s != 0.0, is_moving, "{share}");
    }
}

/// Two equal particles that meet the same wall at once: each impulse is (1 + e) v / (1/m + 2w), with w the compliance of the place.
#[test]
fn two_impacts_at_one_instant_share_the_recoil() {
    let mut set_up = two_modes();
    let (m, e, d, v) = (0.2, 0.5, 0.01, 0.3);
    set_up.impact_dampers = vec![ImpactDamper::new(0, particle(m, d, e)); 2];
    set_up.structure.influence = vec![0.0];
    let start = State {
        modal: vec![0.0; 2],
        modal_rate: vec![0.0; 2],
        particles: vec![Body { y_m: 0.0, u_m_per_s: v }; 2],
        ..State::default()
    };
    let touch_s = d / v;
    let mut motion = Reference::new(&set_up, &Excitation::Fixed, &start, touch_s * (1.0 + 1e-9), d).unwrap();
    motion.cycle().unwrap();
    assert_eq!((motion.counts.impacts, motion.counts.double_impacts), (2, 1));
    let shapes: Vec<f64> = set_up.structure.modes.iter().map(|mode| mode.shape[0]).collect();
    let compliance: f64 = shapes.iter().map(|shape| shape * shape).sum();
    let impulse = (1.0 + e) * v / (1.0 / m + 2.0 * compliance);
    let end = motion.state();
    for body in &end.particles {
        assert!((body.u_m_per_s - (v - impulse / m)).abs() < 1e-13, "{body:?}");
    }
    for (rate, shape) in end.modal_rate.iter().zip(shapes) {
        // The spring has acted for 1e-9 of the flight.
        assert!((rate - 2.0 * shape * impulse).abs() < 1e-7, "{rate}");
    }
}

/// Half the step leaves the motion within 1e-12: steps of this length are short enough.
#[test]
fn half_the_step_changes_nothing() {
    let mut set_up = two_modes();
    set_up.impact_dampers = vec![ImpactDamper::new(0, particle(0.2, 8e-3, 0.5))];
    let turning = TAU * 2.5;
    let sine = Excitation::Sine { amplitude_m: 2e-3, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
    let start =
        State { modal: vec![0.0; 2], modal_rate: vec![0.0; 2], particles: vec![Body::default()], ..State::default() };
    let mut whole = Reference::new(&set_up, &sine, &start, TAU / turning, 8e-3).unwrap();
    let mut half = whole.clone().with_steps_rad(0.1);
    for _ in 0..10 {
        whole.cycle().unwrap();
        half.cycle().unwrap();
        let apart = whole.apart_m(&whole.state(), &half.state());
        assert!(apart < 1e-12 * whole.scale_m(), "{apart:e}");
    }
    println!("after 10 cycles {:.1e} apart", whole.apart_m(&whole.state(), &half.state()) / whole.scale_m());
    assert!(whole.counts.impacts > 10, "{:?}", whole.counts);
}
