//! Compares the exact driver with an independent method on random systems with fixed seeds: an adaptive Runge–Kutta
//! method of order 8 from a crate, separately written equations of motion, and impacts by bisection.

use damprig_core::integrator::exact::{Exact, ExactState, Excitation};
use damprig_core::model::{Cavity, Dissipation, Hertz, Initial, Particle, Release, SetUp, Structure, Tmd, Wall};
use differential_equations::prelude::{ExplicitRungeKutta, IVP, ODE};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Tolerance of one step, relative and in m.
const TOLERANCE: f64 = 1e-11;
const TOLERANCE_M: f64 = 1e-13;

const MAX_IMPACTS: u32 = 200;

/// x, x′, y, y′.
type Phase = [f64; 4];

#[derive(Clone, Copy)]
struct Equations {
    set_up: SetUp,
    amplitude_m: f64,
    turning: f64,
}

impl Equations {
    /// Force of the second mass on the structure, N.
    fn joint(&self, s: &Phase) -> f64 {
        let (apart, closing) = (s[2] - s[0], s[3] - s[1]);
        if let Some(tmd) = self.set_up.tmd {
            return tmd.stiffness_n_per_m * apart + tmd.damping_n_s_per_m * closing;
        }
        if let Some((particle, hertz)) = self.set_up.particle.and_then(|p| p.wall.hertz().map(|hertz| (p, hertz))) {
            let Dissipation::HuntCrossley { coefficient_s_per_m } = hertz.dissipation else { return f64::NAN };
            let past = (apart.abs() - particle.clearance_m).max(0.0);
            let bracket = 1.0 + 1.5 * coefficient_s_per_m * closing * apart.signum();
            return apart.signum() * hertz.stiffness_n_per_m15 * past.powf(1.5) * bracket.max(0.0);
        }
        let Some(Particle { clearance_m, wall: Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. }, .. }) =
            self.set_up.particle
        else {
            return 0.0;
        };
        let past = apart.abs() - clearance_m;
        if past <= 0.0 {
            return 0.0;
        }
        // A wall cannot pull. This is equivalent to a contact that ends when its force is zero.
        let side = apart.signum();
        side * (stiffness_n_per_m * past + damping_n_s_per_m * side * closing).max(0.0)
    }
}

impl ODE<f64, Phase> for Equations {
    fn diff(&self, t: f64, s: &Phase, rate: &mut Phase) {
        let structure = &self.set_up.structure;
        let (sine, cosine) = (self.turning * t).sin_cos();
        let stretch = s[0] - self.amplitude_m * sine;
        let slip = s[1] - self.amplitude_m * self.turning * cosine;
        let joint = self.joint(s);
        let second = self.set_up.particle.map(|p| p.mass_kg).or(self.set_up.tmd.map(|t| t.mass_kg)).unwrap_or(1.0);
        rate[0] = s[1];
        rate[1] =
            (joint - structure.stiffness_n_per_m * stretch - structure.damping_n_s_per_m * slip) / structure.mass_kg;
        rate[2] = s[3];
        rate[3] = -joint / second;
    }
}

fn integrate(equations: &Equations, from: f64, to: f64, start: Phase) -> Phase {
    let method = ExplicitRungeKutta::dop853().rtol(TOLERANCE).atol(TOLERANCE_M);
    let solution = IVP::ode(equations, from, to, start).method(method).solve().expect("the method reaches the end");
    *solution.last().expect("the solution has a last point").1
}

/// The state at `end_s`. For hard walls the instant of impact is found by bisection, and the law of impact is
/// applied. `None` where impacts accumulate: this method has no resting contact.
fn run(equations: &Equations, initial: &Initial, end_s: f64) -> Option<Phase> {
    let mut s = [initial.x_m, initial.v_m_per_s, initial.y_m, initial.u_m_per_s];
    let hard = equations.set_up.particle.and_then(|p| match p.wall {
        Wall::Restitution { coefficient } => Some((p.clearance_m, p.mass_kg, coefficient)),
        _ => None,
    });
    let step = 0.002;
    let (mut t, mut impacts) = (0.0, 0);
    while t < end_s {
        let to = (t + step).min(end_s);
        let end = integrate(equations, t, to, s);
        let Some((clearance_m, light, coefficient)) = hard.filter(|(d, ..)| (end[2] - end[0]).abs() > *d) else {
            (t, s) = (to, end);
            continue;
        };
        let (mut early, mut late) = (t, to);
        let (mut at_early, mut hit) = (s, end);
        while late - early > 1e-15 * late.max(1.0) {
            let middle = 0.5 * (early + late);
            if middle <= early || middle >= late {
                break;
            }
            let there = integrate(equations, early, middle, at_early);
            if (there[2] - there[0]).abs() > clearance_m {
                (late, hit) = (middle, there);
            } else {
                (early, at_early) = (middle, there);
            }
        }
        let mass = equations.set_up.structure.mass_kg;
        let (v, u) = (hit[1], hit[3]);
        let common = (mass * v + light * u) / (mass + light);
        let relative = -coefficient * (u - v);
        hit[1] = common - light / (mass + light) * relative;
        hit[3] = common + mass / (mass + light) * relative;
        // Start slightly inside the cavity; otherwise rounding causes the same impact again.
        hit[2] = hit[0] + (hit[2] - hit[0]).signum() * clearance_m * (1.0 - 1e-14);
        impacts += 1;
        if impacts > MAX_IMPACTS {
            return None;
        }
        (t, s) = (late, hit);
    }
    Some(s)
}

fn apart(exact: &ExactState, other: &Phase) -> f64 {
    (exact.x_m - other[0]).abs() + (exact.y_m() - other[2]).abs()
}

/// Compares `wanted` systems that do not amplify a small change too much; returns the largest error.
fn compare(seed: u64, wanted: usize, allowed: f64, mut system: impl FnMut(&mut dyn FnMut(f64, f64) -> f64) -> SetUp) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| low + (high - low) * (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (mut compared, mut drawn, mut worst) = (0, 0, 0.0_f64);
    while compared < wanted {
        drawn += 1;
        assert!(drawn < 6 * wanted, "only {compared} of {drawn} systems could be compared");
        let set_up = system(&mut draw);
        let natural = (set_up.structure.stiffness_n_per_m / set_up.structure.mass_kg).sqrt();
        let (amplitude_m, turning) = (draw(1e-3, 4e-3), natural * draw(0.6, 1.5));
        let initial = Initial { x_m: draw(-8e-3, 8e-3), v_m_per_s: draw(-0.1, 0.1), ..Initial::default() };
        let initial = Initial { y_m: initial.x_m, ..initial };
        let base = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
        let exact = |initial: &Initial| {
            let mut motion = Exact::new(&set_up, &base, initial).expect("drawn within the ranges");
            motion.run(3.0, &mut ());
            *motion.state()
        };
        let end = exact(&initial);
        let nudged = exact(&Initial { x_m: initial.x_m + 1e-9, ..initial });
        let growth = ((end.x_m - nudged.x_m).abs() + (end.y_m() - nudged.y_m()).abs()) / 1e-9;
        if growth > 1e3 {
            continue;
        }
        let Some(other) = run(&Equations { set_up, amplitude_m, turning }, &initial, 3.0) else {
            continue;
        };
        let error = apart(&end, &other);
        assert!(error <= allowed * growth.max(1.0), "{error:e}, growth {growth}: {set_up:?}");
        worst = worst.max(error);
        compared += 1;
    }
    println!("seed {seed}: {compared} systems, largest difference {worst:.1e} m");
}

// Error of the other method: 1500 steps and some restarts, each within 10⁻¹³ m; it determines the tolerance.

#[test]
fn hard_walls_agree_with_an_adaptive_method() {
    compare(21, 40, 2e-10, |draw| {
        let structure = Structure::from_modal(draw(0.5, 3.0), draw(1.0, 5.0), draw(0.0, 0.05));
        let particle = Particle {
            mass_kg: structure.mass_kg * draw(0.02, 0.3),
            clearance_m: draw(5e-3, 30e-3),
            friction_coefficient: 0.0,
            wall: Wall::Restitution { coefficient: draw(0.3, 1.0) },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(structure) }
    });
}

#[test]
fn tuned_masses_agree_with_an_adaptive_method() {
    compare(22, 40, 2e-10, |draw| {
        let structure = Structure::from_modal(draw(0.5, 3.0), draw(1.0, 5.0), draw(0.0, 0.05));
        let mass_kg = structure.mass_kg * draw(0.02, 0.3);
        let tmd = Tmd {
            mass_kg,
            stiffness_n_per_m: mass_kg * draw(30.0, 900.0),
            damping_n_s_per_m: mass_kg * draw(0.0, 6.0),
        };
        SetUp { tmd: Some(tmd), ..SetUp::bare(structure) }
    });
}

#[test]
fn soft_walls_agree_with_an_adaptive_method() {
    // The method steps across the kinks of the contact force, so its error is limited by its tolerance only.
    compare(23, 30, 1e-9, |draw| {
        let structure = Structure::from_modal(draw(0.5, 3.0), draw(1.0, 5.0), draw(0.0, 0.05));
        let particle = Particle {
            mass_kg: structure.mass_kg * draw(0.02, 0.3),
            clearance_m: draw(5e-3, 20e-3),
            friction_coefficient: 0.0,
            wall: Wall::Voigt {
                stiffness_n_per_m: draw(300.0, 20_000.0),
                damping_n_s_per_m: draw(0.0, 10.0),
                release: Release::ZeroForce,
            },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(structure) }
    });
}

#[test]
fn hertz_walls_agree_with_an_adaptive_method() {
    compare(24, 30, 1e-9, |draw| {
        let structure = Structure::from_modal(draw(0.5, 3.0), draw(1.0, 5.0), draw(0.0, 0.05));
        let particle = Particle {
            mass_kg: structure.mass_kg * draw(0.02, 0.3),
            clearance_m: draw(5e-3, 20e-3),
            friction_coefficient: 0.0,
            wall: Wall::Hertz(Hertz {
                stiffness_n_per_m15: draw(1e4, 1e6),
                dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: draw(0.0, 3.0) },
            }),
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(structure) }
    });
}
