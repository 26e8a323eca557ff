//! Motions and modes that are known in closed form.

use std::f64::consts::{PI, TAU};

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{FrictionDamper, Particle, Release, Structure, Tmd, Wall};
use damprig_structures::{
    Beam, Damping, FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, SetUp, State, Storey, Support,
    TunedMass, base_at_start,
};

const STOREY: Storey = Storey { mass_kg: 2.0, stiffness_n_per_m: 1500.0, damping_n_s_per_m: 0.8 };

fn sine(frequency_hz: f64) -> Excitation {
    Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: TAU * frequency_hz, phase_rad: 0.0 }
}

/// ω of n equal storeys without damping: 2 √(k/m) sin((2i − 1) π/(2 (2n + 1))).
#[test]
fn equal_storeys_have_their_known_frequencies() {
    for n in [1, 2, 5, 20] {
        let modes = Modes::storeys(&vec![STOREY; n]).unwrap().modes;
        for (i, mode) in modes.iter().enumerate() {
            let angle = (2 * i + 1) as f64 * PI / (2.0 * (2 * n + 1) as f64);
            let omega = 2.0 * (STOREY.stiffness_n_per_m / STOREY.mass_kg).sqrt() * angle.sin();
            assert!((mode.angular_frequency_rad_per_s / omega - 1.0).abs() < 1e-12);
        }
        // Participations of all modes: their squares add up to the mass.
        let mass: f64 = modes.iter().map(|mode| mode.participation.powi(2)).sum();
        assert!((mass / (STOREY.mass_kg * n as f64) - 1.0).abs() < 1e-12);
    }
}

/// β of a cantilever: 1.87510, 4.69409, 7.85476 (Blevins, table 8-1); with a tip mass as large as the beam's 1.24792.
#[test]
fn a_cantilever_has_the_tabled_frequencies_and_modal_masses() {
    let beam = |tip_mass_kg: f64, modes: usize| {
        let beam = Beam {
            support: Support::Cantilever,
            bending_stiffness_n_m2: 1.0,
            mass_per_length_kg_per_m: 1.0,
            length_m: 1.0,
            tip_mass_kg,
            modes,
            damping_ratio: 0.01,
            places_m: vec![0.5, 1.0],
        };
        Modes::beam(&beam).unwrap()
    };
    let modes = beam(0.0, 60).modes;
    for (mode, beta) in modes.iter().zip([1.875_104_068_711_961_f64, 4.694_091_132_974_175, 7.854_757_438_237_613]) {
        assert!((mode.angular_frequency_rad_per_s / (beta * beta) - 1.0).abs() < 1e-13);
    }
    // At the free end the shape is ±2 where ∫φ² = 1, in every mode.
    for (n, mode) in modes.iter().enumerate() {
        assert!((mode.shape[1].abs() - 2.0).abs() < 1e-6, "mode {}: {}", n + 1, mode.shape[1]);
    }
    // 0.6131 of the mass takes part in the first mode, all of it in all modes.
    assert!((modes[0].participation.powi(2) - 0.6131).abs() < 1e-4);
    let mass: f64 = modes.iter().map(|mode| mode.participation.powi(2)).sum();
    assert!((0.99..1.0).contains(&mass), "{mass}");
    let beta = beam(1.0, 1).modes[0].angular_frequency_rad_per_s.sqrt();
    assert!((beta - 1.247_917).abs() < 1e-5, "{beta}");
}

/// A structure with a tuned mass, and the same two masses as one structure of two degrees.
#[test]
fn a_tuned_mass_is_a_structure_of_two_degrees() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let tmd = Tmd { mass_kg: 0.16, stiffness_n_per_m: 32.83, damping_n_s_per_m: 0.77 };
    let with = SetUp { tuned_masses: vec![TunedMass { place: 0, tmd }], ..SetUp::bare(structure) };
    let (k, c) = (tmd.stiffness_n_per_m, tmd.damping_n_s_per_m);
    let pair = |first: f64, second: f64| vec![first + second, -second, -second, second];
    let two = Modes::from_matrices(
        &[structure.mass_kg, 0.0, 0.0, tmd.mass_kg],
        &pair(structure.stiffness_n_per_m, k),
        &Damping::Matrix(pair(structure.damping_n_s_per_m, c)),
        &[1.0, 1.0],
    )
    .unwrap();
    let two = SetUp::bare(two);
    let excitation = sine(2.4);
    let mut one = Motion::new(&with, &excitation, &with.at_rest(base_at_start(&excitation))).unwrap();
    let mut other = Motion::new(&two, &excitation, &two.at_rest(base_at_start(&excitation))).unwrap();
    let mut most = 0.0_f64;
    for n in 1..200 {
        let until_s = f64::from(n) * 0.1;
        one.run(until_s, &mut ()).unwrap();
        other.run(until_s, &mut ()).unwrap();
        let (a, b) = (one.state(), other.state());
        most = most.max(with.displacement_m(&a, 0).abs());
        assert!((with.displacement_m(&a, 0) - two.displacement_m(&b, 0)).abs() < 1e-12 * most.max(1e-2));
        let y = two.displacement_m(&b, 1) + other.base().0;
        assert!((a.tuned_masses[0].y_m - y).abs() < 1e-12 * most.max(1e-2));
    }
}

/// Amplitude of a floor under a base motion, by solving the equations of motion at the drive's frequency.
#[test]
fn floors_swing_with_the_amplitudes_of_the_frequency_response() {
    // Two storeys with damping that is not modal: (K − Ω²M + iΩC) X = Ω² M 1 Z.
    let storeys = [STOREY, Storey { damping_n_s_per_m: 9.0, ..STOREY }];
    let set_up = SetUp::bare(Modes::storeys(&storeys).unwrap());
    for frequency_hz in [1.0, 2.7, 5.0, 7.1, 12.0] {
        let omega = TAU * frequency_hz;
        let mut motion =
            Motion::new(&set_up, &sine(frequency_hz), &set_up.at_rest(base_at_start(&sine(frequency_hz)))).unwrap();
        // Decays are 0.1/s at least: the start has decayed to 1e-17.
        let cycles = (400.0 * frequency_hz).ceil();
        let amplitude = |motion: &mut Motion, place: usize| {
            let mut at = |quarter: f64| {
                motion.run((cycles + 0.25 * quarter + place as f64) / frequency_hz, &mut ()).unwrap();
                set_up.displacement_m(&motion.state(), place)
            };
            at(0.0).hypot(at(1.0))
        };
        let (k, m) = (STOREY.stiffness_n_per_m, STOREY.mass_kg);
        let (c1, c2) = (storeys[0].damping_n_s_per_m, storeys[1].damping_n_s_per_m);
        let complex = |re: f64, im: f64| nalgebra::Complex::new(re, im);
        let d = [
            complex(2.0 * k - omega * omega * m, omega * (c1 + c2)),
            complex(-k, -omega * c2),
            complex(k - omega * omega * m, omega * c2),
        ];
        let force = complex(omega * omega * m * 3e-3, 0.0);
        let determinant = d[0] * d[2] - d[1] * d[1];
        let expected = [((d[2] - d[1]) * force / determinant).norm(), ((d[0] - d[1]) * force / determinant).norm()];
        for (place, expected) in expected.into_iter().enumerate() {
            let found = amplitude(&mut motion, place);
            assert!((found / expected - 1.0).abs() < 1e-11, "{frequency_hz} Hz, floor {place}: {found} {expected}");
        }
    }
}

/// Approach speeds of all impacts.
#[derive(Default)]
struct Speeds(Vec<f64>);

impl Observer for Speeds {
    fn impact(&mut self, impact: &Impact) {
        self.0.push(impact.approach_speed_m_per_s);
    }
}

/// Two impacts a cycle at equal distances (Masri 1973, for a structure of several degrees of freedom).
///
/// Impulses ±J half a cycle apart give each mode a motion that changes its sign every half cycle; with the speed u of the particle,
/// J = 2 m u, the law of impact and the flight from wall to wall give a quadratic equation for u.
#[test]
fn two_impacts_a_cycle_have_the_speed_of_the_closed_form() {
    let storeys = [STOREY, STOREY, STOREY];
    let modes = Modes::storeys(&storeys).unwrap();
    let place = 2;
    let mut compared = 0;
    for (e, d, ratio) in [
        (0.3, 25e-3, 1.0),
        (0.5, 25e-3, 1.0),
        (0.2, 25e-3, 1.0),
        (0.1, 25e-3, 1.0),
        (0.25, 25e-3, 1.005),
        (0.3, 26e-3, 1.0),
    ] {
        let omega = modes.modes[0].angular_frequency_rad_per_s * ratio;
        let half_s = PI / omega;
        let mass = 0.4;
        // Place's motion per J just before and after an impact, and the amplitude A of the forced motion.
        let (mut alpha, mut before, mut after) = (0.0, 0.0, 0.0);
        let mut forced = nalgebra::Complex::new(3e-3, 0.0);
        for mode in &modes.modes {
            let (w, zeta, shape) = (mode.angular_frequency_rad_per_s, mode.damping_ratio, mode.shape[place]);
            let (decay, turning) = (zeta * w, w * (1.0 - zeta * zeta).sqrt());
            let (fade, sine, cosine) = ((-decay * half_s).exp(), (turning * half_s).sin(), (turning * half_s).cos());
            // q = e^{−σt}(a cos + b sin) with q(h) = −q(0) and q′(0+) + q′(h−) = φ.
            let rows = nalgebra::Matrix2::new(
                1.0 + fade * cosine,
                fade * sine,
                -decay - fade * (decay * cosine + turning * sine),
                turning + fade * (turning * cosine - decay * sine),
            );
            let solved = rows.try_inverse().unwrap() * nalgebra::Vector2::new(0.0, shape);
            let rate_after = turning * solved.y - decay * solved.x;
            alpha += shape * solved.x;
            after += shape * rate_after;
            before += shape * (rate_after - shape);
            let dynamic = nalgebra::Complex::new(w * w - omega * omega, 2.0 * zeta * w * omega);
            forced += nalgebra::Complex::from(shape * mode.participation * omega * omega * 3e-3) / dynamic;
        }
        let impulse = 2.0 * mass;
        let c1 = ((e - 1.0) - impulse * (after + e * before)) / (omega * (1.0 + e));
        let c2 = PI / (2.0 * omega) - impulse * alpha;
        let amplitude = forced.norm();
        let (a, b, c) = (c1 * c1 + c2 * c2, -2.0 * c2 * d, d * d - amplitude * amplitude);
        let u = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
        let v_before = c1 * u * omega + before * impulse * u;
        let approach = u - v_before;

        let wall = Wall::Restitution { coefficient: e };
        let particle =
            Particle { mass_kg: mass, clearance_m: d, friction_coefficient: 0.0, wall, cavity: Default::default() };
        let set_up = SetUp { impact_dampers: vec![ImpactDamper::new(place, particle)], ..SetUp::bare(modes.clone()) };
        let excitation = Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: omega, phase_rad: 0.0 };
        let mut motion = Motion::new(&set_up, &excitation, &set_up.at_rest(base_at_start(&excitation))).unwrap();
        motion.run(3_000.0 * TAU / omega, &mut ()).unwrap();
        let mut speeds = Speeds::default();
        motion.run(3_100.0 * TAU / omega, &mut speeds).unwrap();
        let off = speeds.0.iter().map(|speed| (speed / speeds.0[0] - 1.0).abs()).fold(0.0, f64::max);
        println!("e = {e}, d = {d}: {} impacts, {} m/s, apart by {off:.1e}; {approach}", speeds.0.len(), speeds.0[0]);
        // Others are not symmetric, or not periodic.
        if speeds.0.len() == 200 && off < 1e-11 {
            assert!((speeds.0[0] / approach - 1.0).abs() < 1e-11, "{} {approach}", speeds.0[0]);
            compared += 1;
        }
    }
    assert!(compared >= 3, "only {compared} motions with two impacts a cycle");
}

/// With a soft wall and a friction damper, whose forces are finite. (An instantaneous impact moves every mode of its place at once,
/// however stiff.)
#[test]
fn a_second_mode_of_great_stiffness_changes_nothing() {
    let one = Structure::from_modal(1.6, 2.5, 0.0038);
    let wall = Wall::Voigt { stiffness_n_per_m: 1024.9, damping_n_s_per_m: 2.0, release: Release::ZeroForce };
    let particle =
        Particle { mass_kg: 0.16, clearance_m: 22.5e-3, friction_coefficient: 0.0, wall, cavity: Default::default() };
    let dampers = vec![ImpactDamper::new(0, particle)];
    let joint = FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n: 0.1 } };
    let excitation = sine(2.5);
    let end = |structure: Modes| {
        let set_up = SetUp { impact_dampers: dampers.clone(), friction_dampers: vec![joint], ..SetUp::bare(structure) };
        let mut motion = Motion::new(&set_up, &excitation, &set_up.at_rest(base_at_start(&excitation))).unwrap();
        motion.run(3.0, &mut ()).unwrap();
        set_up.displacement_m(&motion.state(), 0)
    };
    let alone = end(one.into());
    let mut last = f64::INFINITY;
    for frequency_hz in [100.0, 1_000.0, 10_000.0] {
        let mut two = Modes::from(one);
        let mut second = two.modes[0].clone();
        second.angular_frequency_rad_per_s = TAU * frequency_hz;
        second.damping_ratio = 0.2;
        second.participation = 0.0;
        two.modes.push(second);
        let off = (end(two) / alone - 1.0).abs();
        println!("second mode at {frequency_hz} Hz: {off:.1e}");
        // The second mode's static compliance falls with the square of its frequency.
        assert!(off < 0.03 * last);
        last = off;
    }
    assert!(last < 1e-5);
}

/// A mode on a base whose acceleration is a + bt, from rest: its response to a ramp, z included.
#[test]
fn a_mode_follows_a_linear_acceleration_of_the_base() {
    let (omega, zeta, a, b) = (15.7, 0.03, 2.0, -7.0);
    let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: omega * omega, damping_n_s_per_m: 2.0 * zeta * omega };
    let set_up = SetUp::bare(structure);
    let start = State { modal: vec![0.0], modal_rate: vec![0.0], ..State::default() };
    let mut motion = Motion::on_base(&set_up, [0.0, 0.0, a / 2.0, b / 6.0], &start).expect("it starts");
    for n in 1..=20 {
        let t = 0.1 * f64::from(n);
        motion.run(t, &mut ()).expect("it goes on");
        // u″ + 2ζω u′ + ω² u = −(a + bt): u = A + Bt and the free motion that starts from its opposite.
        let slope = -b / (omega * omega);
        let value = (-a - 2.0 * zeta * omega * slope) / (omega * omega);
        let turning = omega * (1.0 - zeta * zeta).sqrt();
        let (sine, cosine) = (turning * t).sin_cos();
        let free = -value * cosine + (-slope - zeta * omega * value) / turning * sine;
        let expected = value + slope * t + (-zeta * omega * t).exp() * free;
        let (z, rate) = motion.base();
        assert!((motion.state().modal[0] - expected).abs() < 1e-14, "{t} s");
        assert!((z - t * t * (a / 2.0 + b * t / 6.0)).abs() < 1e-13 && (rate - t * (a + b * t / 2.0)).abs() < 1e-12);
    }
}
