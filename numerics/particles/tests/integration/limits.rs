//! Limits in which the damper is a damper with an exact solution.

use core::f64::consts::TAU;

use damprig_core::integrator::exact::{Exact, Excitation, Impact, Observer};
use damprig_core::model::{Initial, Particle, SetUp, Wall};
use damprig_particles::{Cavity, Damper, Motion, Start};

use crate::{rig, spheres, spring};

const DIAMETER_M: f64 = 0.01;
const START_M: f64 = 0.035;

/// Largest |x| of each of the first cycles of a free vibration, m.
fn maxima(cycles: usize, mut next: impl FnMut() -> (f64, f64)) -> Vec<f64> {
    let period_s = TAU / rig().angular_frequency_rad_per_s();
    let mut maxima = vec![0.0_f64; cycles];
    loop {
        let (t_s, x_m) = next();
        let Some(largest) = maxima.get_mut((t_s / period_s) as usize) else { return maxima };
        *largest = largest.max(x_m.abs());
    }
}

/// Spheres at rest in the box of a structure that is let go.
fn sphere_motion(damper: &Damper, centres: Vec<[f64; 3]>) -> Motion<Excitation> {
    let start = Start { x_m: START_M, v_m_per_s: 0.0 };
    let still = vec![[0.0; 3]; centres.len()];
    Motion::placed(rig(), damper, Excitation::Fixed, start, (centres, still)).expect("physical")
}

fn of_spheres(damper: &Damper, cycles: usize, centres: Vec<[f64; 3]>) -> Vec<f64> {
    let mut motion = sphere_motion(damper, centres);
    maxima(cycles, || {
        motion.step(&mut |_| ());
        (motion.state().t_s, motion.state().x_m)
    })
}

/// The exact engine, with a particle in the middle of a cavity of this clearance.
fn exact_motion(clearance_m: f64, coefficient: f64) -> Exact {
    let wall = Wall::Restitution { coefficient };
    let cavity = damprig_core::model::Cavity::default();
    let particle = Particle { mass_kg: 0.16, clearance_m, friction_coefficient: 0.0, wall, cavity };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(rig()) };
    let initial = Initial { x_m: START_M, y_m: START_M, ..Initial::default() };
    Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical")
}

fn of_particle(clearance_m: f64, coefficient: f64, cycles: usize) -> Vec<f64> {
    let mut motion = exact_motion(clearance_m, coefficient);
    let mut step = 0;
    maxima(cycles, || {
        step += 1;
        // Between two samples |x| is at most (ω·0.1 ms)²/8 above them: 3·10⁻⁷ of it.
        motion.run(f64::from(step) * 1e-4, &mut ());
        (motion.time_s(), motion.state().x_m)
    })
}

/// A box that is as high and as wide as a sphere and leaves it this clearance.
fn room(clearance_m: f64) -> Cavity {
    Cavity { length_m: 2.0 * clearance_m + DIAMETER_M, width_m: DIAMETER_M, height_m: DIAMETER_M }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |largest, (a, b)| largest.max((a - b).abs() / START_M))
}

/// Times of the first four impacts on the walls, s.
struct Impacts(Vec<f64>);

impl Observer for Impacts {
    fn impact(&mut self, impact: &Impact) {
        self.0.push(impact.time_s);
    }
}

#[test]
fn one_sphere_tends_to_the_exact_impact_damper_as_its_contacts_get_shorter() {
    let clearance_m = 0.8 * START_M;
    let mut exact = Impacts(vec![]);
    exact_motion(clearance_m, 0.5).run(0.7, &mut exact);
    let errors = [1e6, 4e6, 1.6e7].map(|stiffness_n_per_m| {
        let damper = Damper {
            elasticity: spring(stiffness_n_per_m),
            steps_per_contact: 800.0,
            ..spheres(1, DIAMETER_M, room(clearance_m))
        };
        let mut motion = sphere_motion(&damper, vec![[START_M, 0.0, 0.5 * DIAMETER_M]]);
        let mut times_s = vec![];
        while times_s.len() < 4 && motion.state().t_s < 0.7 {
            motion.step(&mut |impact| times_s.push(impact.t_s));
        }
        assert_eq!(times_s.len(), 4);
        times_s.iter().zip(&exact.0).fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()))
    });
    println!("contacts of 1.2, 0.6 and 0.3 ms: {errors:?} s");
    // Four times the stiffness halves the contact and so the error.
    assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");
    assert!(errors[2] < 0.001, "{errors:?}");
}

#[test]
fn a_sphere_of_very_lossy_contacts_is_a_perfectly_inelastic_particle() {
    let clearance_m = 0.6 * START_M;
    let exact = of_particle(clearance_m, 0.0, 5);
    let damper = Damper { elasticity: spring(1.6e7), restitution: 0.01, ..spheres(1, DIAMETER_M, room(clearance_m)) };
    let found = largest_difference(&of_spheres(&damper, 5, vec![[START_M, 0.0, 0.5 * DIAMETER_M]]), &exact);
    println!("{found}");
    // A rebound at 0.01 of a speed of some X·ω moves the next impact by about 0.01 of the amplitude.
    assert!(found < 0.01, "{found}");
}

#[test]
fn spheres_side_by_side_are_one_particle_of_their_mass() {
    let clearance_m = 0.8 * START_M;
    let one = room(clearance_m);
    let four = Cavity { width_m: 4.0 * DIAMETER_M, ..one };
    let single = Damper { elasticity: spring(4e6), ..spheres(1, DIAMETER_M, one) };
    let side_by_side = Damper { elasticity: spring(1e6), ..spheres(4, DIAMETER_M, four) };
    let height_m = 0.5 * DIAMETER_M;
    let row = (0..4).map(|n| [START_M, (f64::from(n) - 1.5) * DIAMETER_M, height_m]).collect();
    let a = of_spheres(&single, 5, vec![[START_M, 0.0, height_m]]);
    let b = of_spheres(&side_by_side, 5, row);
    // Each has the dashpot of 0.04 kg against 1.6 kg, together they are 0.16 kg: e is 0.49 instead of 0.5.
    assert!(largest_difference(&a, &b) < 0.02, "{a:?} {b:?}");
}

#[test]
fn a_bed_that_fills_the_box_is_an_added_mass() {
    let cavity = Cavity { length_m: 4.0 * DIAMETER_M, width_m: 4.0 * DIAMETER_M, height_m: 4.0 * DIAMETER_M };
    let damper = Damper { elasticity: spring(2e4), restitution: 0.3, ..spheres(64, DIAMETER_M, cavity) };
    let start = Start { x_m: START_M, v_m_per_s: 0.0 };
    let mut motion = Motion::new(rig(), &damper, Excitation::Fixed, start).expect("it holds 64");
    let mut crossings = vec![];
    while crossings.len() < 11 {
        let before = *motion.state();
        motion.step(&mut |_| ());
        let after = motion.state();
        if before.x_m > 0.0 && after.x_m <= 0.0 {
            crossings.push(before.t_s + motion.step_s() * before.x_m / (before.x_m - after.x_m));
        }
    }
    let frequency_hz = 10.0 / (crossings[10] - crossings[0]);
    let expected_hz = 2.5 / 1.1_f64.sqrt();
    // The bed presses against its walls with m·ω²·X = 1.3 N and gives way by some 10 µm of 35 mm: 3·10⁻⁴ of β/2.
    assert!((frequency_hz / expected_hz - 1.0).abs() < 1e-4, "{frequency_hz} Hz, expected {expected_hz} Hz");
}
