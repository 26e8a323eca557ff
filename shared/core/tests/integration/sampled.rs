//! The sampled driver compared with exact results, in both precisions, at the controller's tick.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::{Contact, Mode};
use damprig_core::integrator::sampled::{Flight, Sampled, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, SetUp, Structure, Wall};
use damprig_core::scalar::Scalar;
use std::f64::consts::PI;

const STEP_S: f64 = 1e-3;
const MASS_KG: f64 = 1.6;

fn bare(zeta: f64) -> SetUp {
    SetUp::bare(Structure::from_modal(MASS_KG, 2.5, zeta))
}

fn with_particle(zeta: f64, mass_ratio: f64, clearance_m: f64, restitution: f64, friction: f64) -> SetUp {
    let particle = Particle {
        mass_kg: mass_ratio * MASS_KG,
        clearance_m,
        friction_coefficient: friction,
        wall: Wall::Restitution { coefficient: restitution },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..bare(zeta) }
}

/// A sine base of amplitude `z_m` and angular frequency `omega`, as the cubic segments of its samples.
fn sine_segment<S: Scalar>(z_m: f64, omega: f64, step: usize) -> BaseSegment<S> {
    let (t0, t1) = (step as f64 * STEP_S, (step + 1) as f64 * STEP_S);
    let velocity = |t: f64| z_m * omega * STEP_S * libm::cos(omega * t);
    BaseSegment::hermite(
        S::from_f64(z_m * libm::sin(omega * t0)),
        S::from_f64(z_m * libm::sin(omega * t1)),
        S::from_f64(velocity(t0)),
        S::from_f64(velocity(t1)),
    )
}

/// max |x| over the last `cycles` cycles of a forced run.
fn forced_maximum<S: Scalar>(set_up: &SetUp, z_m: f64, omega: f64, cycles: usize, last: usize) -> f64 {
    let mut sampled = Sampled::<S>::new(set_up, Units::metres(STEP_S), &Initial::default()).unwrap();
    let per_cycle = 2.0 * PI / omega / STEP_S;
    let (steps, from) = ((cycles as f64 * per_cycle) as usize, ((cycles - last) as f64 * per_cycle) as usize);
    let mut maximum: f64 = 0.0;
    for step in 0..steps {
        sampled.step(&sine_segment(z_m, omega, step), &mut ());
        if step >= from {
            maximum = maximum.max(sampled.state().x.to_f64().abs());
        }
    }
    assert_eq!(sampled.unresolved(), 0);
    maximum
}

/// Steady amplitude ratio of the bare structure: √((1+(2ζr)²)/((1−r²)²+(2ζr)²)).
#[test]
fn the_bare_structure_settles_at_its_transmissibility() {
    for r in [0.9, 1.0, 1.1] {
        let zeta = 0.0038;
        let two_zeta_r: f64 = 2.0 * zeta * r;
        let exact = ((1.0 + two_zeta_r.powi(2)) / ((1.0 - r * r).powi(2) + two_zeta_r.powi(2))).sqrt();
        let omega = r * 2.0 * PI * 2.5;
        let maximum = forced_maximum::<f32>(&bare(zeta), 1e-3, omega, 1000, 5) / 1e-3;
        // Remaining transient after n cycles (e^(−ζ2πn/r) = 1e-9), the peak between two samples (1 − cos(ωh/2) =
        // 3.4e-5), and the rounding of f32.
        assert!((maximum / exact - 1.0).abs() < 5e-5, "r = {r}: {maximum} against {exact}");
    }
}

/// The free decay is 2πζ/√(1−ζ²) per cycle; `f32` must not add damping.
#[test]
fn f32_keeps_a_damping_ratio_of_0_0038_to_a_thousandth() {
    let zeta = 0.0038;
    let mut sampled =
        Sampled::<f32>::new(&bare(zeta), Units::metres(STEP_S), &Initial { x_m: 0.035, ..Initial::default() }).unwrap();
    let cycles = 40;
    // A damped cycle is not a whole number of steps, so energies at whole nominal cycles are compared instead of
    // amplitudes.
    let energy = |s: &Sampled<f32>| {
        let (x, v) = (f64::from(s.state().x), f64::from(s.state().v) / STEP_S);
        let omega = 2.0 * PI * 2.5;
        // Invariant of the damped oscillation: x² + ((v + ζωx)/ωd)².
        let damped = omega * libm::sqrt(1.0 - zeta * zeta);
        x * x + libm::pow((v + zeta * omega * x) / damped, 2.0)
    };
    let before = energy(&sampled);
    for _ in 0..cycles * 400 {
        sampled.step(&BaseSegment::at_rest(0.0), &mut ());
    }
    let decay = libm::log(before / energy(&sampled)) / 2.0;
    let measured = decay / (2.0 * PI * cycles as f64);
    assert!((measured / zeta - 1.0).abs() < 1e-3, "{measured}");
}

/// The symmetric orbit with two impacts per cycle (Masri & Caughey 1966): its speed V over ZΩ.
fn symmetric_orbit_speed(r: f64, e: f64, d: f64, mu: f64, zeta: f64) -> f64 {
    let (omega, drive) = (1.0, r);
    let damped = omega * libm::sqrt(1.0 - zeta * zeta);
    let two_zeta_r = 2.0 * zeta * r;
    let a = libm::sqrt((1.0 + two_zeta_r * two_zeta_r) / (libm::pow(1.0 - r * r, 2.0) + two_zeta_r * two_zeta_r));
    let h = libm::exp(-zeta * omega * PI / drive);
    let (c, s) = (libm::cos(damped * PI / drive), libm::sin(damped * PI / drive));
    // [h S, h C + 1; h(−ζωS + ωd C) + ωd, h(−ωd S − ζωC) − ζω] [b1 b2]ᵀ = [0 2μ]ᵀ
    let (m11, m12) = (h * s, h * c + 1.0);
    let m21 = h * (-zeta * omega * s + damped * c) + damped;
    let m22 = h * (-damped * s - zeta * omega * c) - zeta * omega;
    let determinant = m11 * m22 - m12 * m21;
    let (b1, b2) = (-m12 * 2.0 * mu / determinant, m11 * 2.0 * mu / determinant);
    let s1 = PI / (2.0 * drive) - b2;
    let s2 = ((2.0 * mu * e - 1.0 + e) / (1.0 + e) + zeta * omega * b2 - damped * b1) / drive;
    let square = s1 * s1 + s2 * s2;
    let root = libm::sqrt(s1 * s1 * d * d - square * (d * d - a * a));
    (s1 * d + root) / square / drive
}

struct LastApproach<S>(S);

impl<S: Scalar> SampledObserver<S> for LastApproach<S> {
    fn impact(&mut self, impact: &SampledImpact<S>) {
        self.0 = impact.approach;
    }
}

/// The particle crosses the cavity with speed V; after an impact it leaves the structure at the relative speed e·w.
#[test]
fn the_impact_damper_settles_on_the_symmetric_orbit() {
    for (r, e, d_over_z) in [(1.0, 0.3, 10.0), (1.0, 0.5, 10.0), (1.1, 0.5, 5.0)] {
        let (zeta, mu, z_m) = (0.0038, 0.1, 1.5e-3);
        let drive = r * 2.0 * PI * 2.5;
        let speed = symmetric_orbit_speed(r, e, d_over_z, mu, zeta) * z_m * drive;
        // Before an impact the particle has V and the structure −… : w = V − x′(0−) with x′(0−) = −V(1−e+2μ)/(1+e).
        let approach = speed * (1.0 + (1.0 - e + 2.0 * mu) / (1.0 + e));
        let set_up = with_particle(zeta, mu, d_over_z * z_m, e, 0.0);
        check_orbit::<f64>(&set_up, z_m, drive, approach, 1e-8);
        check_orbit::<f32>(&set_up, z_m, drive, approach, 1e-5);
    }
}

fn check_orbit<S: Scalar>(set_up: &SetUp, z_m: f64, drive: f64, approach: f64, tolerance: f64) {
    let mut sampled = Sampled::<S>::new(set_up, Units::metres(STEP_S), &Initial::default()).unwrap();
    let mut last = LastApproach(S::ZERO);
    for step in 0..300_000 {
        sampled.step(&sine_segment(z_m, drive, step), &mut last);
    }
    let measured = last.0.to_f64() / STEP_S;
    assert!((measured / approach - 1.0).abs() < tolerance, "{measured} against {approach}");
}

/// Free Coulomb decay: the amplitude falls by 2F/k per half cycle, and the structure stops inside ±F/k.
#[test]
fn coulomb_friction_reduces_the_amplitude_equally_in_every_half_cycle_and_then_holds() {
    let mut set_up = bare(0.0);
    let reach_m = 1e-3;
    set_up.friction_damper = Some(FrictionDamper { force_n: reach_m * set_up.structure.stiffness_n_per_m });
    let mut sampled =
        Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &Initial { x_m: 10.3e-3, ..Initial::default() }).unwrap();
    let mut turning_points = vec![];
    for half_cycle in 1..=5 {
        (0..200).for_each(|_| sampled.step(&BaseSegment::at_rest(0.0), &mut ()));
        turning_points.push(sampled.state().x * 1e3);
        let expected = (10.3 - 2.0 * f64::from(half_cycle)) * if half_cycle % 2 == 0 { 1.0 } else { -1.0 };
        assert!((turning_points[half_cycle as usize - 1] - expected).abs() < 1e-9, "{turning_points:?}");
    }
    (0..10_000).for_each(|_| sampled.step(&BaseSegment::at_rest(0.0), &mut ()));
    assert!((sampled.state().x * 1e3 + 0.3).abs() < 1e-9 && sampled.state().v == 0.0);
}

/// Checks every impact: momentum is conserved, the relative speed is multiplied by e, and the particle stays in its
/// cavity.
struct Laws<'a> {
    set_up: &'a SetUp,
    impacts: usize,
    outside: f64,
}

impl SampledObserver<f64> for Laws<'_> {
    fn flight(&mut self, _: f64, length: f64, flight: &Flight<f64>) {
        let d = self.set_up.particle.unwrap().clearance_m;
        for n in 0..=4 {
            let t = length * f64::from(n) / 4.0;
            let offset = flight.offset.iter().rev().fold(0.0, |sum, c| sum * t + c);
            self.outside = self.outside.max(offset.abs() / d - 1.0);
        }
    }

    fn impact(&mut self, impact: &SampledImpact<f64>) {
        let particle = self.set_up.particle.unwrap();
        let (m, mm) = (particle.mass_kg, self.set_up.structure.mass_kg);
        let Wall::Restitution { coefficient } = particle.wall else { unreachable!() };
        let expected = m / (m + mm) * (1.0 + coefficient) * impact.approach;
        // The last bounce of a chatter sticks: its impulse is between 1 and 1 + e times the plastic impulse.
        let plastic = m / (m + mm) * impact.approach;
        let kick = impact.kick * f64::from(impact.side);
        // The kick is a difference of velocities of up to 1e-3 m/step, each with a rounding error.
        let rounding = 4.0 * f64::EPSILON * 1e-3;
        assert!(kick <= expected + rounding && kick >= plastic - rounding, "{kick} of {expected}");
        self.impacts += 1;
    }
}

#[test]
fn random_dampers_obey_the_laws_of_impact_and_stay_in_their_cavity() {
    let mut random = 12345u64;
    let mut uniform = |low: f64, high: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (random >> 11) as f64 / (1u64 << 53) as f64
    };
    for case in 0..60 {
        let restitution = if case % 7 == 0 { 0.0 } else { uniform(0.0, 1.0) };
        let friction = if case % 2 == 0 { 0.0 } else { uniform(0.0, 0.3) };
        let z_m = 1e-3;
        let mut set_up =
            with_particle(uniform(0.0, 0.05), uniform(0.01, 1.0), z_m * uniform(0.5, 20.0), restitution, friction);
        if case % 3 == 0 {
            let force_n = uniform(0.1, 1.2) * z_m * set_up.structure.stiffness_n_per_m;
            set_up.friction_damper = Some(FrictionDamper { force_n });
        }
        let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &Initial::default()).unwrap();
        let mut laws = Laws { set_up: &set_up, impacts: 0, outside: 0.0 };
        let omega = uniform(10.0, 20.0);
        for step in 0..20_000 {
            sampled.step(&sine_segment(z_m, omega, step), &mut laws);
        }
        assert_eq!(sampled.unresolved(), 0, "case {case}: {set_up:?}");
        assert!(laws.outside < 1e-12, "case {case}: outside by {}", laws.outside);
    }
}

/// Without dissipation the energy of structure and particle stays constant over thousands of impacts.
#[test]
fn a_conservative_damper_conserves_its_energy() {
    let set_up = with_particle(0.0, 0.1, 0.02, 1.0, 0.0);
    let initial = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &initial).unwrap();
    let k = set_up.structure.stiffness_n_per_m;
    let energy = |s: &Sampled<f64>| {
        let state = s.state();
        let (v, u) = (state.v / STEP_S, (state.v + state.slide) / STEP_S);
        0.5 * (MASS_KG * v * v + 0.1 * MASS_KG * u * u + k * state.x * state.x)
    };
    let before = energy(&sampled);
    (0..60_000).for_each(|_| sampled.step(&BaseSegment::at_rest(0.0), &mut ()));
    assert!((energy(&sampled) / before - 1.0).abs() < 1e-10, "{}", energy(&sampled) / before);
}

/// Counts the flights of a step.
#[derive(Default)]
struct Flights(u32);

impl<S> SampledObserver<S> for Flights {
    fn mode(&mut self, _: Mode) {
        self.0 += 1;
    }
}

/// A base with constant acceleration brings the particle to rest at the wall behind it, by a chatter whose last
/// bounces are all in one step: from v = a(1−e)/2 in lengths per step down to the resolution, √(2a·16ε·d), 47 bounces
/// for e = 0.8.
#[test]
fn a_particle_comes_to_rest_within_the_bound_on_the_events_of_a_step() {
    let acceleration = 2.0 * STEP_S * STEP_S;
    let structure = Structure::from_modal(MASS_KG, 10.0, 0.3);
    let set_up = SetUp { structure, ..with_particle(0.3, 0.1, 2e-3, 0.8, 0.0) };
    let run = |most_events: Option<u8>| {
        let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &Initial::default()).unwrap();
        let mut most_flights = 0;
        for step in 0..3000 {
            let t = f64::from(step);
            let base = [0.5 * acceleration * t * t, acceleration * t, 0.5 * acceleration, 0.0];
            let mut flights = Flights::default();
            match most_events {
                Some(most) => sampled.step_bounded(&BaseSegment(base), most, &mut flights),
                None => sampled.step(&BaseSegment(base), &mut flights),
            }
            most_flights = most_flights.max(flights.0);
        }
        (sampled, most_flights)
    };
    let (free, flights) = run(None);
    assert!(flights > 40 && free.unresolved() == 0, "{flights}");
    for most_events in [2, 4, 8] {
        let (bounded, flights) = run(Some(most_events));
        assert!(flights <= u32::from(most_events) + 1, "{flights} flights with {most_events} events");
        assert!(bounded.unresolved() > 0);
        for sampled in [&free, &bounded] {
            assert_eq!(sampled.mode().map(|mode| mode.contact), Some(Contact::Held(-1)), "{most_events}");
            assert_eq!(sampled.state().offset, -2e-3);
        }
    }
}
