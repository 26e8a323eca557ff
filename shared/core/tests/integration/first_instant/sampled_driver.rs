//! The first instant of the sampled driver, compared with the closed forms and with the exact driver.

use super::*;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{self, Joined, Joint, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::scalar::Scalar;

#[derive(Default)]
struct Count(usize);

impl<S: Scalar> sampled::SampledObserver<S> for Count {
    fn impact(&mut self, impact: &sampled::SampledImpact<S>) {
        assert!(impact.approach > S::ZERO, "an impact without approach speed");
        self.0 += 1;
    }
}

const STEP_S: f64 = 1e-3;

/// The sampled driver's state after some steps from `initial`, and its impacts.
fn sampled_state<S: Scalar, J: Joint<S>>(mut motion: Sampled<S, J>, drive: &Drive, steps: u32) -> (Phase, usize) {
    let units = *motion.units();
    let mut count = Count::default();
    for step in 0..steps {
        let (from_s, to_s) = (f64::from(step) * STEP_S, f64::from(step + 1) * STEP_S);
        let ((z0, v0), (z1, v1)) = (drive.base(from_s), drive.base(to_s));
        let [z0, z1] = [z0, z1].map(|z| S::from_f64(z / units.length_m));
        let [v0, v1] = [v0, v1].map(|v| S::from_f64(v / units.velocity_m_per_s()));
        motion.step(&BaseSegment::hermite(z0, z1, v0, v1), &mut count);
    }
    assert_eq!(motion.unresolved(), 0);
    let (state, velocity) = (motion.state(), units.velocity_m_per_s());
    let (x, v) = (state.x.to_f64() * units.length_m, state.v.to_f64() * velocity);
    let (offset, slide) = (state.offset.to_f64() * units.length_m, state.slide.to_f64() * velocity);
    ([x, v, x + offset, v + slide], count.0)
}

/// Impacts at the start with the sampled driver; `rounding` is a few units in the last place of a centimetre.
fn sampled_impacts_at_the_start<S: Scalar>(seed: u64, rounding: f64) {
    let mut draw = Draw::new(seed);
    let mut tested = 0;
    for n in 0..1500 {
        let any = draw.between(0.05, 0.95);
        let restitution = draw.one_of(&[1.0, any, any]);
        let mut set_up = draw.hard(restitution);
        set_up.friction_damper = draw.damper();
        let turning = set_up.structure.angular_frequency_rad_per_s() * draw.between(0.5, 1.6);
        let excitation = Excitation::Sine {
            amplitude_m: draw.maybe(0.5e-3, 5e-3),
            angular_frequency_rad_per_s: turning,
            phase_rad: draw.between(-3.0, 3.0),
        };
        let drive = Drive::of(&excitation);
        let first = FirstImpact::draw(&mut draw, &set_up, &drive);
        let holds = |t: f64| after_impact(&set_up, &drive, &first, t).1;
        let Some(steps) = undisturbed_s(0.05, holds).map(|end_s| (end_s / STEP_S) as u32) else { continue };
        let units = Units { step_s: STEP_S, length_m: 0.01 };
        let motion = Sampled::<S>::new(&set_up, units, &first.initial).expect("drawn within the ranges");
        let (found, impacts) = sampled_state(motion, &drive, steps);
        let (expected, _) = after_impact(&set_up, &drive, &first, f64::from(steps) * STEP_S);
        if steps == 0 {
            continue;
        }
        assert_eq!(impacts, 1, "{n}");
        // A velocity is a difference of displacements over a step.
        assert!(close(&found, &expected, rounding, 100.0), "{n}: {found:?} {expected:?}\n{set_up:?} {excitation:?}");
        tested += 1;
    }
    assert!(tested > 500, "only {tested} were tested");
}

#[test]
fn an_impact_at_the_start_of_the_sampled_driver_agrees_with_the_closed_form() {
    // Interpolation of the base: (Ωh)⁴/384 = 5·10⁻⁸ of 5 mm at 6 Hz.
    sampled_impacts_at_the_start::<f64>(36, 1e-9);
    // 50 steps, each with a rounding error of 6·10⁻⁸ of a centimetre.
    sampled_impacts_at_the_start::<f32>(37, 5e-8);
}

#[cfg(feature = "fixed-point")]
#[test]
fn an_impact_at_the_start_in_fixed_point_agrees_with_the_closed_form() {
    sampled_impacts_at_the_start::<damprig_core::fixed_point::Fixed>(38, 1e-9);
}

#[test]
fn the_sampled_driver_leaves_rest_at_a_soft_wall_without_an_impact() {
    let mut draw = Draw::new(40);
    for n in 0..600 {
        let mut set_up = draw.hard(0.5);
        set_up.friction_damper = draw.damper();
        let mut particle = set_up.particle.expect("a particle is mounted");
        particle.wall = draw.soft();
        set_up.particle = Some(particle);
        let turning = set_up.structure.angular_frequency_rad_per_s() * draw.between(0.5, 1.6);
        let excitation = Excitation::Sine {
            amplitude_m: draw.maybe(0.5e-3, 5e-3),
            angular_frequency_rad_per_s: turning,
            phase_rad: draw.between(-3.0, 3.0),
        };
        let drive = Drive::of(&excitation);
        let (x_m, v, side) = (draw.maybe(-20e-3, 20e-3), draw.maybe(-0.2, 0.2), draw.side());
        let initial = Initial { x_m, v_m_per_s: v, y_m: x_m + side * particle.clearance_m, u_m_per_s: v };
        let mut exact = Exact::new(&set_up, &excitation, &initial).expect("drawn within the ranges");
        exact.run(20.0 * STEP_S, &mut ());
        let motion = Joined::<f64>::joined(&set_up, Units::metres(STEP_S), &initial).expect("a soft wall");
        let (found, _) = sampled_state(motion, &drive, 20);
        let expected = phase(exact.state());
        assert!(close(&found, &expected, 1e-8, 100.0), "{n}: {found:?} {expected:?}\n{set_up:?} {excitation:?}");
    }
}
