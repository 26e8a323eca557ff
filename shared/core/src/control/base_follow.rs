//! Whether the base does at all what the drive asks of it.
//!
//! Over every whole cycle of a drive at its full amplitude, the amplitude of z at the drive frequency is compared with the
//! demanded one. They may differ by much on a sound rig: the structure pulls the base down near its resonance (to 0.16 of the
//! demand on the default shaker, `tests/integration/base_loop.rs`), and a shaker that is a source of velocity moves further below
//! the frequency at which it is calibrated. So the bounds are wide, and outside them something is broken or wired wrongly: an
//! amplifier that is off, a relay that stays open, a z sensor that looks elsewhere, a scale that is off by a power of ten.

use crate::control::fault::FaultCause;
use crate::scalar::Scalar;

/// Below this share of the demand the base does not follow.
pub const LEAST: f32 = 0.01;

/// Above this multiple of the demand the base is overdriven.
pub const MOST: f32 = 10.0;

/// Sums over the present cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct BaseFollow {
    z: (f32, f32),
    drive: (f32, f32),
    ticks: u32,
    disturbed: bool,
}

impl BaseFollow {
    /// Takes a tick: z and drive, m, and the drive's sine and cosine.
    pub fn push(&mut self, z_m: f32, drive_m: f32, (sine, cosine): (f32, f32)) {
        self.z = (self.z.0 + z_m * sine, self.z.1 + z_m * cosine);
        self.drive = (self.drive.0 + drive_m * sine, self.drive.1 + drive_m * cosine);
        self.ticks += 1;
    }

    /// The present cycle tells nothing: the drive is not at its full amplitude, or z cannot be believed.
    pub fn disturb(&mut self) {
        self.disturbed = true;
    }

    /// Closes a cycle in which the base was asked for this amplitude, m. What is wrong with it, with the amplitude of z and its
    /// limit, m.
    pub fn end_cycle(&mut self, demand_m: f32) -> Option<(FaultCause, f32, f32)> {
        let Self { z, drive, ticks, disturbed } = core::mem::take(self);
        if disturbed || ticks == 0 {
            return None;
        }
        let amplitude = |(sine, cosine): (f32, f32)| Scalar::sqrt(sine * sine + cosine * cosine) * 2.0 / ticks as f32;
        let (z_m, drive_m) = (amplitude(z), amplitude(drive));
        // A closed loop may have to rise first; the bound is half, as a sum over a cycle is off by a tick of it.
        if z_m < LEAST * demand_m && drive_m > 0.5 * demand_m {
            return Some((FaultCause::BaseStill, z_m, LEAST * demand_m));
        }
        (z_m > MOST * demand_m).then_some((FaultCause::BaseOverdriven, z_m, MOST * demand_m))
    }
}
