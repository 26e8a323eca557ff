//! Reference runs of the sampled driver, identical for every scalar and machine.
//!
//! They serve two comparisons. `tests/integration/scalars.rs` of this crate compares the numbers with `f64`. The
//! whole-system tests compare the bits of a controller without floating point.

use crate::integrator::base::{BaseSegment, BaseTrack};
use crate::integrator::modes::Contact;
use crate::integrator::sampled::{Sampled, SampledObserver, SampledState};
use crate::integrator::units::Units;
use crate::model::{Cavity, FrictionDamper, GRAVITY_M_PER_S2, Initial, Particle, SetUp, Structure, Wall};
use crate::scalar::Scalar;
use crate::sine::Phase;

/// Steps per second.
pub const STEP_HZ: f32 = 1000.0;

/// Steps of a run: ten seconds.
pub const STEPS: u32 = 10_000;

/// Initial displacement of a free vibration, m: structure and particle together.
pub const START_M: f64 = 0.035;

/// Displacement per count of the laser's converter, m: ±80 mm over the sum of sixteen 12-bit conversions.
const M_PER_COUNT: f64 = 0.16 / 65_520.0;

/// A driven run's unit of length in counts of the base's sensor: a power of two, so a sample is exact in fixed point.
const COUNTS_PER_LENGTH: u16 = 1 << 13;

/// One run. Structure: 1.6 kg, 2.50 Hz, ζ = 0.0038; particle: a tenth of that mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Description.
    pub name: &'static str,
    /// d, m.
    pub clearance_m: f64,
    /// e.
    pub restitution: f64,
    /// μi.
    pub friction: f64,
    /// The motion of the base; without one the structure starts from [`START_M`].
    pub drive: Option<Sine>,
}

/// A sinusoidal base motion, quantised by the sensor to whole counts, under a structure with a friction damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// Amplitude, counts of 2.4 µm.
    pub amplitude_counts: i16,
    /// Hz.
    pub frequency_hz: f32,
    /// F of the friction damper, N.
    pub damper_force_n: f64,
}

const fn free(name: &'static str, clearance_over_start: f64, restitution: f64, friction: f64) -> Case {
    Case { name, clearance_m: clearance_over_start * START_M, restitution, friction, drive: None }
}

/// Well-conditioned free vibrations, and a driven run that sticks, slips and impacts in every cycle.
pub const CASES: [Case; 5] = [
    free("free, d/x0 0.4, e 0.4", 0.4, 0.4, 0.0),
    free("free, d/x0 0.8, e 0.4, mu_i 0.08", 0.8, 0.4, 0.08),
    free("free, d/x0 0.85, e 0.55", 0.85, 0.55, 0.0),
    free("free, d/x0 1.2, e 0.3, mu_i 0.05", 1.2, 0.3, 0.05),
    Case {
        name: "driven, hybrid",
        clearance_m: 0.0075,
        restitution: 0.47,
        friction: 0.08,
        drive: Some(Sine { amplitude_counts: 614, frequency_hz: 2.5, damper_force_n: 0.2 }),
    },
];

impl Case {
    /// The mechanical set-up.
    #[must_use]
    pub fn set_up(&self) -> SetUp {
        SetUp {
            structure: Structure::from_modal(1.6, 2.5, 0.0038),
            particle: Some(Particle {
                mass_kg: 0.16,
                clearance_m: self.clearance_m,
                friction_coefficient: self.friction,
                wall: Wall::Restitution { coefficient: self.restitution },
                cavity: Cavity::default(),
            }),
            friction_damper: self.drive.map(|sine| FrictionDamper { force_n: sine.damper_force_n }),
            tmd: None,
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            is_force_driven: false,
        }
    }

    /// The units of the states: the initial displacement of a free vibration, 20 mm for a driven run.
    #[must_use]
    pub fn units(&self) -> Units {
        let length_m = if self.drive.is_some() { f64::from(COUNTS_PER_LENGTH) * M_PER_COUNT } else { START_M };
        Units { step_s: 1.0 / f64::from(STEP_HZ), length_m }
    }

    /// The initial state: displaced for a free vibration, at rest for a driven run.
    #[must_use]
    pub fn initial(&self) -> Initial {
        let start_m = if self.drive.is_some() { 0.0 } else { START_M };
        Initial { x_m: start_m, y_m: start_m, ..Initial::default() }
    }

    /// Counts of the base's sensor from its middle at step `step`.
    #[must_use]
    pub fn base_counts(&self, step: u32) -> i16 {
        self.drive.map_or(0, |sine| {
            let increment = Phase::increment(sine.frequency_hz, STEP_HZ);
            let (value, _) = Phase(increment.wrapping_mul(step)).sin_cos();
            (value * f32::from(sine.amplitude_counts)) as i16
        })
    }
}

/// A case in motion.
#[derive(Clone, Debug)]
pub struct ReferenceMotion<S> {
    sampled: Sampled<S>,
    track: BaseTrack<S>,
    per_count: S,
}

impl<S: Scalar> ReferenceMotion<S> {
    /// The motion at its start. `None` for a case that is not physical, which none of [`CASES`] is.
    #[must_use]
    pub fn new(case: &Case) -> Option<Self> {
        let sampled = Sampled::new(&case.set_up(), case.units(), &case.initial()).ok()?;
        let per_count = S::from_f64(1.0 / f64::from(COUNTS_PER_LENGTH));
        Some(Self { sampled, track: BaseTrack::at_rest(S::ZERO), per_count })
    }

    /// Advances by one step with the base's next sample, as a controller does in its tick.
    pub fn step(&mut self, base_counts: i16, observer: &mut impl SampledObserver<S>) {
        let base: BaseSegment<S> = self.track.push(whole::<S>(base_counts) * self.per_count);
        self.sampled.step(&base, observer);
    }

    /// Adds displacements and velocities to the structure and to a particle in flight, each in the laboratory frame, in
    /// units. Shows how a small change grows.
    pub fn disturb(&mut self, structure: [S; 2], particle: [S; 2]) {
        let SampledState { offset, slide, .. } = *self.sampled.state();
        let flies = matches!(self.sampled.mode().map(|mode| mode.contact), Some(Contact::Free(_)));
        self.sampled.nudge(structure[0], structure[1]);
        if flies {
            self.sampled.place_particle(offset + particle[0] - structure[0], slide + particle[1] - structure[1]);
        }
    }

    /// The state after the last step.
    #[must_use]
    pub fn state(&self) -> &SampledState<S> {
        self.sampled.state()
    }
}

/// Counts as a number, exactly.
fn whole<S: Scalar>(counts: i16) -> S {
    let [high, low] = counts.unsigned_abs().to_be_bytes();
    let sixteen = S::from_u8(16);
    let magnitude = S::from_u8(high) * sixteen * sixteen + S::from_u8(low);
    if counts < 0 { -magnitude } else { magnitude }
}
