//! Excitation in closed form: motion of the base, or a force on the structure.
//!
//! Between breakpoints every excitation is the sum of a constant and one rotating pair, [`Wave`]. The driver rotates
//! the pair, so its loop evaluates no sine or cosine. Recorded motions are handled by [`crate::integrator::sampled`].

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use super::time::Time;
use crate::io::{Invalid, finite, not_negative, positive};

/// A base motion z(t), or a force on the structure over a fixed base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Excitation {
    /// z = 0.
    #[default]
    Fixed,
    /// z = Z sin(Ωt + φ).
    Sine {
        /// Z, m; 0 or greater.
        amplitude_m: f64,
        /// Ω, rad/s; greater than 0.
        angular_frequency_rad_per_s: f64,
        /// φ, rad.
        phase_rad: f64,
    },
    /// z = Z sin(πt/T) up to T, then 0.
    HalfSine {
        /// Z, m.
        amplitude_m: f64,
        /// T, s; greater than 0.
        duration_s: f64,
    },
    /// z = Z/2 (1 − cos 2πt/T) up to T, then 0.
    Versine {
        /// Z, m.
        amplitude_m: f64,
        /// T, s; greater than 0.
        duration_s: f64,
    },
    /// z = 0 and a force P sin(Ωt + φ) on the structure.
    ForceSine {
        /// P, N; 0 or greater.
        amplitude_n: f64,
        /// Ω, rad/s; greater than 0.
        angular_frequency_rad_per_s: f64,
        /// φ, rad.
        phase_rad: f64,
    },
    /// z = 0 and a force P sin(πt/T) on the structure up to T, then 0.
    ForceHalfSine {
        /// P, N.
        amplitude_n: f64,
        /// T, s; greater than 0.
        duration_s: f64,
    },
}

/// The excitation at an instant: `offset + sine`, with `sine′ = Ω·cosine` and `cosine′ = −Ω·sine`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wave {
    /// Constant part, m.
    pub offset: f64,
    /// Rotating part, m (N for a force).
    pub sine: f64,
    /// The rotating part a quarter of a turn ahead, m (N for a force).
    pub cosine: f64,
}

impl Excitation {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first parameter outside its range, spelled as in case files.
    pub fn validate(&self) -> Result<(), Invalid> {
        match *self {
            Self::Fixed => Ok(()),
            Self::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad } => {
                not_negative("base.amplitude_m", amplitude_m)?;
                positive("base.angular_frequency_rad_per_s", angular_frequency_rad_per_s)?;
                finite("base.phase_rad", phase_rad)
            }
            Self::HalfSine { amplitude_m, duration_s } | Self::Versine { amplitude_m, duration_s } => {
                finite("base.amplitude_m", amplitude_m)?;
                positive("base.duration_s", duration_s)
            }
            Self::ForceSine { amplitude_n, angular_frequency_rad_per_s, phase_rad } => {
                not_negative("force.amplitude_n", amplitude_n)?;
                positive("force.angular_frequency_rad_per_s", angular_frequency_rad_per_s)?;
                finite("force.phase_rad", phase_rad)
            }
            Self::ForceHalfSine { amplitude_n, duration_s } => {
                finite("force.amplitude_n", amplitude_n)?;
                positive("force.duration_s", duration_s)
            }
        }
    }

    /// Ω, rad/s; 0 for a fixed base.
    #[must_use]
    pub fn angular_frequency_rad_per_s(&self) -> f64 {
        match *self {
            Self::Fixed => 0.0,
            Self::Sine { angular_frequency_rad_per_s, .. } | Self::ForceSine { angular_frequency_rad_per_s, .. } => {
                angular_frequency_rad_per_s
            }
            Self::HalfSine { duration_s, .. } | Self::ForceHalfSine { duration_s, .. } => PI / duration_s,
            Self::Versine { duration_s, .. } => TAU / duration_s,
        }
    }

    /// Whether the excitation moves the base (otherwise it is a force on the structure).
    #[must_use]
    pub fn moves_base(&self) -> bool {
        !matches!(self, Self::ForceSine { .. } | Self::ForceHalfSine { .. })
    }

    /// The next instant after `t_s` at which the closed form changes; infinite if there is none.
    #[must_use]
    pub fn next_break_s(&self, t_s: f64) -> f64 {
        match self.ends_s() {
            Some(end_s) if t_s < end_s => end_s,
            _ => f64::INFINITY,
        }
    }

    /// End of a pulse, s.
    fn ends_s(&self) -> Option<f64> {
        match *self {
            Self::HalfSine { duration_s, .. }
            | Self::Versine { duration_s, .. }
            | Self::ForceHalfSine { duration_s, .. } => Some(duration_s),
            Self::Fixed | Self::Sine { .. } | Self::ForceSine { .. } => None,
        }
    }

    /// The wave at `time`. The phase is reduced with twice the digits of an `f64` before its sine and cosine are
    /// evaluated.
    #[must_use]
    pub fn wave(&self, time: Time) -> Wave {
        if self.ends_s().is_some_and(|end_s| time.seconds() >= end_s) {
            return Wave::default();
        }
        let (offset, amplitude, phase) = match *self {
            Self::Fixed => return Wave::default(),
            Self::Sine { amplitude_m, phase_rad, .. } => (0.0, amplitude_m, phase_rad),
            Self::ForceSine { amplitude_n, phase_rad, .. } => (0.0, amplitude_n, phase_rad),
            Self::HalfSine { amplitude_m, .. } => (0.0, amplitude_m, 0.0),
            Self::ForceHalfSine { amplitude_n, .. } => (0.0, amplitude_n, 0.0),
            Self::Versine { amplitude_m, .. } => (0.5 * amplitude_m, 0.5 * amplitude_m, -FRAC_PI_2),
        };
        let angle = time.phase_rad(self.angular_frequency_rad_per_s()) + phase;
        let (sine, cosine) = libm::sincos(angle);
        Wave { offset, sine: amplitude * sine, cosine: amplitude * cosine }
    }
}

impl Wave {
    /// The wave `angle_rad` later, for `|angle_rad|` up to 0.8; error below 10⁻¹⁷ of the amplitude plus one rounding.
    #[inline]
    #[must_use]
    pub fn turned(self, angle_rad: f64) -> Self {
        let square = angle_rad * angle_rad;
        let fourth = square * square;
        // Two interleaved sums each: this shortens the chain of dependent operations.
        let sum = |c: &[f64; 8]| {
            let (mut even, mut odd) = (c[0], c[1]);
            for n in (2..8).step_by(2) {
                even = even * fourth + c[n];
                odd = odd * fourth + c[n + 1];
            }
            even * square + odd
        };
        self.turned_by(sum(&COSINE) * square, sum(&SINE) * angle_rad)
    }

    /// The wave `angle_rad` later, for `|angle_rad|` up to 10⁻³.
    #[inline]
    #[must_use]
    pub(super) fn nudged(self, angle_rad: f64) -> Self {
        let square = angle_rad * angle_rad;
        let cosine_less_one = square * (square * (1.0 / 24.0) - 0.5);
        self.turned_by(cosine_less_one, angle_rad * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0))))
    }

    /// The wave after a rotation by the angle with the given cosine minus one and sine.
    #[inline]
    #[must_use]
    pub fn turned_by(self, cosine_less_one: f64, sine: f64) -> Self {
        Self {
            offset: self.offset,
            sine: self.sine + (self.sine * cosine_less_one + self.cosine * sine),
            cosine: self.cosine + (self.cosine * cosine_less_one - self.sine * sine),
        }
    }
}

/// Taylor coefficients of (cos a − 1)/a² in a², highest first: −1/2!, 1/4!, …, up to a¹⁶.
const COSINE: [f64; 8] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
];

/// Taylor coefficients of sin a/a in a², highest first, up to a¹⁵.
const SINE: [f64; 8] = [
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_agrees_with_sine_and_cosine() {
        for n in -80..=80 {
            let angle = f64::from(n) / 100.0;
            let wave = Wave { offset: 0.1, sine: libm::sin(1.0), cosine: libm::cos(1.0) }.turned(angle);
            assert!((wave.sine - libm::sin(1.0 + angle)).abs() < 3e-16, "{angle}");
            assert!((wave.cosine - libm::cos(1.0 + angle)).abs() < 3e-16, "{angle}");
        }
    }

    #[test]
    fn a_versine_starts_and_ends_at_rest() {
        let pulse = Excitation::Versine { amplitude_m: 0.05, duration_s: 0.2 };
        let start = pulse.wave(Time::at(0.0));
        assert!((start.offset + start.sine).abs() < 1e-17 && start.cosine.abs() < 1e-17);
        let middle = pulse.wave(Time::at(0.1));
        assert!((middle.offset + middle.sine - 0.05).abs() < 1e-16);
        assert_eq!(pulse.wave(Time::at(0.2)), Wave::default());
    }
}
