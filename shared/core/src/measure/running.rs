//! Running amplitude and phase of x and z at the drive frequency, for display.
//!
//! Each value is a lock-in over the last whole cycle of the drive and changes once per cycle. Noise of RMS σ gives the
//! amplitude an uncertainty of σ √(2/n), with n ticks in a cycle. The values are meaningless in a cycle in which the
//! frequency changes.

use super::lock_in::LockIn;
use crate::scalar::Scalar;

/// The drive's sine and cosine in a tick, and whether a cycle ends with that tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveReference {
    /// Sine and cosine of the drive's phase.
    pub wave: (f32, f32),
    /// The cycle ends with this tick.
    pub cycle_ended: bool,
}

/// Amplitudes and phases over the last whole cycle. All are 0 before the first whole cycle and without a drive
/// frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunningMotion {
    /// Amplitude of x, m.
    pub x_amplitude_m: f32,
    /// Phase of x relative to z, −π to π, positive where x leads, rad; within [`PHASE_ERROR_RAD`].
    pub x_phase_rad: f32,
    /// Amplitude of z, m.
    pub z_amplitude_m: f32,
    /// Phase of z relative to the drive, −π to π, positive where z leads, rad; within [`PHASE_ERROR_RAD`].
    pub z_phase_rad: f32,
    /// Ratio of the two lock-in amplitudes. A result's X/Z has the mean of the cycle maxima of |x| over the same z.
    pub x_over_z: f32,
}

/// Largest error of a displayed phase, rad: the error of `micromath`'s `atan2`.
pub const PHASE_ERROR_RAD: f32 = 6e-3;

/// Measures [`RunningMotion`], one tick at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunningLockIn {
    x: LockIn,
    z: LockIn,
    samples: u32,
    motion: RunningMotion,
}

impl RunningLockIn {
    /// Takes one tick's means of x and z, m, with the drive's reference. Without a reference every value becomes 0.
    pub fn push(&mut self, x_m: f32, z_m: f32, reference: Option<DriveReference>) {
        let Some(DriveReference { wave, cycle_ended }) = reference else {
            *self = Self::default();
            return;
        };
        self.x.push(x_m, wave);
        self.z.push(z_m, wave);
        self.samples += 1;
        if cycle_ended {
            self.x.end_cycle(0.0);
            self.z.end_cycle(0.0);
            let samples = self.samples as f32;
            let motion = motion(self.x.components(samples), self.z.components(samples));
            *self = Self { motion, ..Self::default() };
        }
    }

    /// The present values.
    #[must_use]
    pub fn motion(&self) -> &RunningMotion {
        &self.motion
    }
}

/// Amplitudes and phases from the sine and cosine components of x and z.
fn motion(x: (f32, f32), z: (f32, f32)) -> RunningMotion {
    let amplitude = |(sine, cosine): (f32, f32)| Scalar::sqrt(sine * sine + cosine * cosine);
    let (x_amplitude_m, z_amplitude_m) = (amplitude(x), amplitude(z));
    RunningMotion {
        x_amplitude_m,
        x_phase_rad: displayed_angle(x.1 * z.0 - x.0 * z.1, x.0 * z.0 + x.1 * z.1),
        z_amplitude_m,
        z_phase_rad: displayed_angle(z.1, z.0),
        x_over_z: if z_amplitude_m > 0.0 { x_amplitude_m / z_amplitude_m } else { 0.0 },
    }
}

/// atan2 for display, within [`PHASE_ERROR_RAD`]; 0 if both arguments are 0.
fn displayed_angle(sine: f32, cosine: f32) -> f32 {
    if sine == 0.0 && cosine == 0.0 { 0.0 } else { micromath::F32Ext::atan2(sine, cosine) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sine::Phase;

    #[test]
    fn a_displayed_angle_is_within_its_stated_error_in_every_direction() {
        let mut largest: f32 = 0.0;
        for n in 0..100_000 {
            let angle = core::f32::consts::TAU * (n as f32 / 100_000.0 - 0.5);
            for size in [1e-12, 1e-3, 1.0, 1e6] {
                let (sine, cosine) = (size * libm::sinf(angle), size * libm::cosf(angle));
                let error = displayed_angle(sine, cosine) - libm::atan2f(sine, cosine);
                largest = largest.max(libm::fabsf(error));
            }
        }
        assert!(largest < PHASE_ERROR_RAD && largest > 1e-3, "{largest}");
        assert_eq!(displayed_angle(0.0, 0.0), 0.0);
    }

    #[test]
    fn the_motion_of_the_last_whole_cycle_is_reported_until_the_drive_ends() {
        let increment = Phase::increment(2.5, 1000.0);
        let (mut phase, mut running) = (Phase::default(), RunningLockIn::default());
        for tick in 0..1000 {
            // x lags the drive by 0.9 rad, z by 0.1 rad.
            let delayed = |radians: f32| {
                let turn = (f64::from(radians) / core::f64::consts::TAU * 4_294_967_296.0) as u32;
                Phase(phase.0.wrapping_sub(turn)).sin_cos().0
            };
            let (x, z, wave) = (0.03 * delayed(0.9), 0.003 * delayed(0.1), phase.sin_cos());
            let cycle_ended = phase.advance(increment);
            running.push(x, z, Some(DriveReference { wave, cycle_ended }));
            // The increment is rounded, so a cycle has 400 or 401 ticks.
            if !(399..=401).contains(&tick) {
                assert_eq!(*running.motion() == RunningMotion::default(), tick < 399, "tick {tick}");
            }
        }
        let RunningMotion { x_amplitude_m, x_phase_rad, z_amplitude_m, z_phase_rad, x_over_z } = *running.motion();
        // The end of a cycle is known to one tick of 400: the error of amplitude and angle is at most 1/400.
        let tick = 1.0 / 400.0;
        assert!((x_amplitude_m / 0.03 - 1.0).abs() < tick && (z_amplitude_m / 0.003 - 1.0).abs() < tick);
        assert!((x_over_z / 10.0 - 1.0).abs() < 2.0 * tick, "{x_over_z}");
        assert!((x_phase_rad + 0.8).abs() < PHASE_ERROR_RAD + 2.0 * tick, "{x_phase_rad}");
        assert!((z_phase_rad + 0.1).abs() < PHASE_ERROR_RAD + tick, "{z_phase_rad}");
        running.push(0.03, 0.003, None);
        assert_eq!(*running.motion(), RunningMotion::default());
    }
}
