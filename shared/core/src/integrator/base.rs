//! Base motion between samples: Catmull–Rom interpolation with continuous velocity.
//!
//! Over each step the motion is the cubic whose end values are the samples and whose end velocities are central
//! differences. It passes through every sample exactly. For a sine of angular frequency Ω sampled every h, the error
//! between samples is at most (Ωh)³/50 of the amplitude. The interpolation delays the motion by one step, because the
//! velocity at a sample needs the next sample.

use super::polynomial;
use crate::scalar::Scalar;

/// Base displacement over one step, time from 0 to 1: `z(t) = z[0] + z[1] t + z[2] t² + z[3] t³`, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseSegment<S>(pub [S; 4]);

impl<S: Scalar> BaseSegment<S> {
    /// A base at rest at `z_m`.
    #[must_use]
    pub fn at_rest(z_m: S) -> Self {
        Self([z_m, S::ZERO, S::ZERO, S::ZERO])
    }

    /// The cubic with these end displacements (m) and end velocities (m/step).
    #[must_use]
    pub fn hermite(z0: S, z1: S, velocity0: S, velocity1: S) -> Self {
        let rise = z1 - z0;
        let two = S::from_u8(2);
        Self([z0, velocity0, S::from_u8(3) * rise - two * velocity0 - velocity1, velocity0 + velocity1 - two * rise])
    }

    /// The same motion with its origin `by` later.
    #[must_use]
    pub fn from(mut self, by: S) -> Self {
        polynomial::shift(&mut self.0, by);
        self
    }

    /// Part `index` of `parts` equal parts, as a step of its own.
    #[must_use]
    pub fn part(self, index: u8, parts: u8) -> Self {
        if parts == 1 {
            return self;
        }
        let width = S::ONE / S::from_u8(parts);
        let mut part = self.from(S::from_u8(index) * width);
        let mut scale = width;
        for coefficient in &mut part.0[1..] {
            *coefficient = *coefficient * scale;
            scale = scale * width;
        }
        part
    }

    /// Displacement at its end, m.
    #[must_use]
    pub fn end(&self) -> S {
        self.0[0] + (self.0[1] + (self.0[2] + self.0[3]))
    }

    /// Velocity at its start, m/step.
    #[must_use]
    pub fn velocity(&self) -> S {
        self.0[1]
    }

    /// Acceleration at its start, m/step².
    #[must_use]
    pub fn acceleration(&self) -> S {
        self.0[2] + self.0[2]
    }
}

/// Converts a stream of samples to segments.
#[derive(Clone, Copy, Debug, Default)]
pub struct BaseTrack<S> {
    samples: [S; 4],
}

impl<S: Scalar> BaseTrack<S> {
    /// A base that has always been at rest at `z_m`.
    #[must_use]
    pub fn at_rest(z_m: S) -> Self {
        Self { samples: [z_m; 4] }
    }

    /// Takes the next sample, m; returns the segment that ends at the sample before it.
    pub fn push(&mut self, z_m: S) -> BaseSegment<S> {
        self.samples.rotate_left(1);
        self.samples[3] = z_m;
        let [before, start, end, after] = self.samples;
        let half = S::from_f64(0.5);
        BaseSegment::hermite(start, end, half * (end - before), half * (after - start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sampled_sine_is_interpolated_within_the_stated_error() {
        let step = 2.0 * core::f64::consts::PI * 3.0 / 1000.0;
        let mut track = BaseTrack::at_rest(0.0);
        for n in 0..3 {
            track.push(libm::sin(step * f64::from(n)));
        }
        let mut worst: f64 = 0.0;
        for n in 3..1000 {
            let segment = track.push(libm::sin(step * f64::from(n)));
            for t in [0.0, 0.25, 0.5, 1.0] {
                let z = segment.0[0] + polynomial::increment(&segment.0, t);
                worst = worst.max((z - libm::sin(step * (f64::from(n - 2) + t))).abs());
            }
        }
        assert!(worst < step * step * step / 50.0, "{worst}");
    }

    #[test]
    fn velocity_is_continuous_across_samples() {
        let mut track = BaseTrack::at_rest(0.0);
        let samples = [0.0, 0.3, -0.2, 0.9, 1.0, 0.1];
        let mut last: Option<BaseSegment<f64>> = None;
        for z in samples {
            let segment = track.push(z);
            if let Some(last) = last {
                assert!((last.from(1.0).velocity() - segment.velocity()).abs() < 1e-12);
            }
            last = Some(segment);
        }
    }

    #[test]
    fn the_last_part_of_a_segment_ends_like_the_whole() {
        let whole = BaseSegment([0.1, -0.2, 0.3, 0.4]);
        let last = whole.part(2, 3);
        assert!((last.from(1.0).0[0] - whole.from(1.0).0[0]).abs() < 1e-15);
        assert!((last.from(1.0).velocity() * 3.0 - whole.from(1.0).velocity()).abs() < 1e-15);
    }
}
