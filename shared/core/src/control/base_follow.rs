//! Check that the base follows the drive.
//!
//! In every whole cycle of a drive at full amplitude, the amplitude of z at the drive frequency is compared with the
//! demanded amplitude. The two may differ widely on a sound rig. Near its resonance the structure pulls the base down
//! (to 0.16 of the demand on the default shaker, `shared/simulator/tests/integration/base_loop.rs`), and a
//! velocity-source shaker moves further below the frequency at which it is calibrated. The bounds are therefore wide.
//! Outside them something is broken or wired wrongly: an amplifier that is off, a relay that stays open, a z sensor
//! that points elsewhere, a scale that is wrong by a power of ten.

use crate::control::fault::FaultCause;
use crate::scalar::Scalar;

/// Least amplitude of z as a share of the demand; below it the base does not follow.
pub const MIN: f32 = 0.01;

/// Largest amplitude of z as a multiple of the demand; above it the base is overdriven.
pub const MAX: f32 = 10.0;

/// Sums over the present cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct BaseFollow {
    z: (f32, f32),
    drive: (f32, f32),
    ticks: u32,
    disturbed: bool,
}

impl BaseFollow {
    /// Takes one tick: z and drive, m, and the drive's sine and cosine.
    pub fn push(&mut self, z_m: f32, drive_m: f32, (sine, cosine): (f32, f32)) {
        self.z = (self.z.0 + z_m * sine, self.z.1 + z_m * cosine);
        self.drive = (self.drive.0 + drive_m * sine, self.drive.1 + drive_m * cosine);
        self.ticks += 1;
    }

    /// Excludes the present cycle: the drive is not at its full amplitude, or the reading of z is unreliable.
    pub fn disturb(&mut self) {
        self.disturbed = true;
    }

    /// Closes a cycle. Returns the amplitudes of z and of the drive in it, m; `None` if it was disturbed.
    pub fn end_cycle(&mut self) -> Option<Followed> {
        let Self { z, drive, ticks, disturbed } = core::mem::take(self);
        if disturbed || ticks == 0 {
            return None;
        }
        let amplitude = |(sine, cosine): (f32, f32)| Scalar::sqrt(sine * sine + cosine * cosine) * 2.0 / ticks as f32;
        Some(Followed { z_m: amplitude(z), drive_m: amplitude(drive) })
    }
}

/// Amplitudes over a cycle at the drive frequency, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Of z.
    pub z_m: f32,
    /// Of the drive.
    pub drive_m: f32,
}

impl Followed {
    /// Compares them with the demanded amplitude, m. Returns the fault cause, if any, with the amplitude of z and its limit,
    /// m.
    #[must_use]
    pub fn fault(self, demand_m: f32) -> Option<(FaultCause, f32, f32)> {
        let Self { z_m, drive_m } = self;
        // A closed loop may still be rising. The bound is half the demand because a sum over a cycle is uncertain by
        // one tick of it.
        if z_m < MIN * demand_m && drive_m > 0.5 * demand_m {
            return Some((FaultCause::BaseStill, z_m, MIN * demand_m));
        }
        (z_m > MAX * demand_m).then_some((FaultCause::BaseOverdriven, z_m, MAX * demand_m))
    }
}
