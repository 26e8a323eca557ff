//! Compares the scalar types `f32` and fixed point with `f64` in the same integrator, and checks the stated errors.
//!
//! Run with `--nocapture` to print the tables in the documentation of `integrator::sampled` and `fixed_point`.
#![cfg(feature = "fixed-point")]

use damprig_core::fixed_point::Fixed;
use damprig_core::fixed_point::reference::{CASES, Case, ReferenceMotion, START_M, STEPS};
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{Sampled, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Initial, SetUp, Structure};
use damprig_core::scalar::Scalar;

const STEP_S: f64 = 1e-3;

#[derive(Default)]
struct Trace {
    step: f64,
    impacts: Vec<f64>,
    /// x, x′/ω, y − x and (y′ − x′)/ω, in units of length.
    states: Vec<[f64; 4]>,
}

impl<S: Scalar> SampledObserver<S> for Trace {
    fn impact(&mut self, impact: &SampledImpact<S>) {
        self.impacts.push((self.step + impact.at.to_f64()) * STEP_S);
    }
}

impl Trace {
    fn rms(&self) -> f64 {
        (self.states.iter().map(|[x, ..]| x * x).sum::<f64>() / self.states.len() as f64).sqrt()
    }

    /// Largest difference of the first `parts` components of the state up to each step.
    fn running_difference(&self, other: &Self, parts: usize) -> Vec<f64> {
        let differences = self
            .states
            .iter()
            .zip(&other.states)
            .map(|(a, b)| a.iter().zip(b).take(parts).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        differences
            .scan(0.0, |most: &mut f64, difference| {
                *most = most.max(difference);
                Some(*most)
            })
            .collect()
    }
}

/// A change of the state: the step, and the changes of the structure's x and x′/ω and of the particle's y and y′/ω.
type Disturbance = (u32, [f64; 4]);

fn run_disturbed<S: Scalar>(case: &Case, steps: u32, disturbance: Option<Disturbance>) -> Trace {
    let mut motion = ReferenceMotion::<S>::new(case).unwrap();
    let omega = case.set_up().structure.angular_frequency_rad_per_s() * STEP_S;
    let mut trace = Trace::default();
    for step in 0..steps {
        if let Some((at, [x, v, y, u])) = disturbance
            && at == step
        {
            let [structure, particle] = [[x, v * omega], [y, u * omega]].map(|pair| pair.map(S::from_f64));
            motion.disturb(structure, particle);
        }
        trace.step = f64::from(step);
        motion.step(case.base_counts(step), &mut trace);
        let state = motion.state();
        let (v, slide) = (state.v.to_f64() / omega, state.slide.to_f64() / omega);
        trace.states.push([state.x.to_f64(), v, state.offset.to_f64(), slide]);
    }
    trace
}

fn run<S: Scalar>(case: &Case, steps: u32) -> Trace {
    run_disturbed::<S>(case, steps, None)
}

/// Largest error of fixed point per second without impacts, in units of length: x, x′/ω, and with internal friction
/// y, y′/ω. Derived in `fixed_point`.
const LOSS_PER_SECOND: [f64; 4] = [2e-9, 2e-9, 6e-9, 8e-10];

/// Estimates the effect of an error in every second: it grows like the same change at the start of that second in
/// `f64`.
fn estimate(case: &Case, exact: &Trace) -> Vec<f64> {
    let mut sum = vec![0.0; exact.states.len()];
    for second in 0..STEPS / 1_000 {
        for part in 0..if case.friction > 0.0 { 4 } else { 2 } {
            let mut changes = [0.0; 4];
            changes[part] = LOSS_PER_SECOND[part];
            let disturbed = run_disturbed::<f64>(case, STEPS, Some((1_000 * second, changes)));
            let grown = exact.running_difference(&disturbed, 4);
            for (sum, grown) in sum.iter_mut().zip(grown) {
                *sum += grown;
            }
        }
    }
    sum
}

#[test]
fn the_error_of_fixed_point_is_within_its_estimate_and_within_1e_4_over_ten_seconds_of_impacts() {
    println!("largest error of x, x'/w, y-x, (y'-x')/w in units of length; its estimate");
    for case in &CASES {
        let (exact, fixed) = (run::<f64>(case, STEPS), run::<Fixed>(case, STEPS));
        assert!(exact.impacts.len() > 4, "{}: {} impacts", case.name, exact.impacts.len());
        let (error, estimate) = (exact.running_difference(&fixed, 4), estimate(case, &exact));
        let (whole_error, whole_estimate) = (error[error.len() - 1], estimate[estimate.len() - 1]);
        println!("{:<34} {whole_error:.1e}   {whole_estimate:.1e}   {} impacts", case.name, exact.impacts.len());
        for (step, (error, estimate)) in error.iter().zip(&estimate).enumerate() {
            assert!(error <= estimate, "{} at step {step}: {error:.1e}, estimated {estimate:.1e}", case.name);
        }
        // Ten seconds are before the motion diverges; after that the estimate is not valid.
        assert!(whole_estimate < 1e-4, "{}: {whole_estimate}", case.name);
        assert!(whole_error < 1e-4, "{}: {whole_error}", case.name);
    }
}

#[test]
fn single_precision_keeps_the_displacement_of_free_vibrations() {
    println!("case                              | scalar  x        impact, s  RMS");
    for case in CASES.iter().filter(|case| case.drive.is_none()) {
        let steps = STEPS + 2_000;
        let exact = run::<f64>(case, steps);
        for (name, small) in [("f32", run::<f32>(case, steps)), ("fixed", run::<Fixed>(case, steps))] {
            let displacement = exact.running_difference(&small, 1)[STEPS as usize - 1];
            let pairs = exact.impacts.iter().zip(&small.impacts).take(10);
            let impact_s = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let rms = (small.rms() / exact.rms() - 1.0).abs();
            println!("{:<33} | {name:<6}  {displacement:.1e}   {impact_s:.1e}    {rms:.1e}", case.name);
            // The conditioning of the cases (output change over input change) is up to 4100, multiplied by 6e-8 of
            // f32.
            assert!(displacement < 2.5e-4, "{}, {name}: {displacement}", case.name);
        }
    }
}

fn effective_damping<S: Scalar>() -> f64 {
    let zeta = 0.0038;
    let bare = SetUp::bare(Structure::from_modal(1.6, 2.5, zeta));
    let units = Units { step_s: STEP_S, length_m: START_M };
    let initial = Initial { x_m: START_M, ..Initial::default() };
    let mut sampled = Sampled::<S>::new(&bare, units, &initial).unwrap();
    let omega = bare.structure.angular_frequency_rad_per_s() * STEP_S;
    let amplitude = |sampled: &Sampled<S>| {
        let (x, v) = (sampled.state().x.to_f64(), sampled.state().v.to_f64() / omega);
        (x * x + (v + zeta * x).powi(2) / (1.0 - zeta * zeta)).sqrt()
    };
    let (steps, before) = (12_000, amplitude(&sampled));
    for _ in 0..steps {
        sampled.step(&BaseSegment::at_rest(S::ZERO), &mut ());
    }
    (before / amplitude(&sampled)).ln() / (omega * f64::from(steps))
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
