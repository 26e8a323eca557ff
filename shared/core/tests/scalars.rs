//! The small scalars against `f64`: one source, three number types, and what each loses.
//!
//! Run with `--nocapture` for the table that stands in the documentation of `integrator::sampled`.
#![cfg(feature = "fixed-point")]

use damprig_core::fixed_point::Fixed;
use damprig_core::integrator::base::Segment;
use damprig_core::integrator::sampled::{Impact, Observer, Sampled, Units};
use damprig_core::model::{Initial, Particle, SetUp, Structure, Wall};
use damprig_core::scalar::Scalar;

const STEP_S: f64 = 1e-3;
const START_M: f64 = 0.035;

fn set_up(clearance_over_start: f64, restitution: f64, friction: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: clearance_over_start * START_M,
        friction_coefficient: friction,
        wall: Wall::Restitution { coefficient: restitution },
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

#[derive(Default)]
struct Trace {
    step: f64,
    impacts: Vec<f64>,
    x: Vec<f64>,
    v: Vec<f64>,
}

impl<S: Scalar> Observer<S> for Trace {
    fn impact(&mut self, impact: &Impact<S>) {
        self.impacts.push((self.step + impact.at.to_f64()) * STEP_S);
    }
}

/// Free vibration from x = y = 35 mm; displacements over the start, velocities over ω·start.
fn free<S: Scalar>(set_up: &SetUp, steps: usize) -> Trace {
    let units = Units { step_s: STEP_S, length_m: START_M };
    let initial = Initial { x_m: START_M, y_m: START_M, ..Initial::default() };
    let mut sampled = Sampled::<S>::new(set_up, units, &initial).unwrap();
    let per_omega = 1.0 / (set_up.structure.angular_frequency_rad_per_s() * STEP_S);
    let mut trace = Trace::default();
    for step in 0..steps {
        trace.step = step as f64;
        sampled.step(&Segment::at_rest(S::ZERO), &mut trace);
        trace.x.push(sampled.state().x.to_f64());
        trace.v.push(sampled.state().v.to_f64() * per_omega);
    }
    trace
}

struct Loss {
    /// Largest error of x, over the start.
    displacement: f64,
    /// The same with v over ω·start: large for one sample where an impact falls on the other side of it.
    state: f64,
    impact_s: f64,
    rms: f64,
}

fn loss<S: Scalar>(set_up: &SetUp) -> Loss {
    let (exact, small) = (free::<f64>(set_up, 12_000), free::<S>(set_up, 12_000));
    let displacement = |n: usize| (exact.x[n] - small.x[n]).abs();
    let state = |n: usize| displacement(n).max((exact.v[n] - small.v[n]).abs());
    let rms = |trace: &Trace| (trace.x.iter().map(|x| x * x).sum::<f64>() / trace.x.len() as f64).sqrt();
    let pairs = exact.impacts.iter().zip(&small.impacts).take(10);
    Loss {
        displacement: (0..10_000).map(displacement).fold(0.0, f64::max),
        state: (0..10_000).map(state).fold(0.0, f64::max),
        impact_s: pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        rms: (rms(&small) / rms(&exact) - 1.0).abs(),
    }
}

fn effective_damping<S: Scalar>() -> f64 {
    let bare = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
    let zeta = 0.0038;
    let trace = free::<S>(&bare, 12_000);
    let amplitude = |n: usize| {
        let (x, v) = (trace.x[n], trace.v[n]);
        (x * x + (v + zeta * x).powi(2) / (1.0 - zeta * zeta)).sqrt()
    };
    let cycles = (trace.x.len() - 1) as f64 / 400.0;
    (amplitude(0) / amplitude(trace.x.len() - 1)).ln() / (2.0 * std::f64::consts::PI * cycles)
}

/// d/x0, e and μi of cases whose conditioning is moderate: 1300, 10, 4100, 52.
const CASES: [(f64, f64, f64); 4] = [(0.4, 0.4, 0.0), (0.8, 0.4, 0.08), (0.85, 0.55, 0.0), (1.2, 0.3, 0.05)];

#[test]
fn fixed_point_stays_within_1e_4_of_the_start_over_ten_seconds_of_impacts() {
    println!("d/x0   e    mu_i | scalar  x        x and v  impact, s  RMS");
    for (d, e, mu) in CASES {
        let set_up = set_up(d, e, mu);
        let (single, fixed) = (loss::<f32>(&set_up), loss::<Fixed>(&set_up));
        for (name, loss) in [("f32", &single), ("fixed", &fixed)] {
            let Loss { displacement, state, impact_s, rms } = loss;
            println!(
                "{d:<6} {e:<4} {mu:<4} | {name:<6}  {displacement:.1e}   {state:.1e}   {impact_s:.1e}    {rms:.1e}"
            );
        }
        assert!(fixed.state < 1e-4, "d/x0 = {d}, e = {e}: {}", fixed.state);
        // The cases' conditioning (output change over input change) is up to 4100: times f32's 6e-8.
        assert!(single.displacement < 2.5e-4, "d/x0 = {d}, e = {e}: {}", single.displacement);
    }
}

#[test]
fn every_scalar_keeps_the_damping_ratio() {
    for (name, measured) in [
        ("f64", effective_damping::<f64>()),
        ("f32", effective_damping::<f32>()),
        ("fixed", effective_damping::<Fixed>()),
    ] {
        println!("{name:<6} effective damping ratio off by {:.1e}", measured / 0.0038 - 1.0);
        assert!((measured / 0.0038 - 1.0).abs() < 1e-3, "{name}: {measured}");
    }
}
