//! Velocity of a displacement from its last samples, for display.
//!
//! The velocity is the difference over [`SPAN`] ticks, that is the mean velocity of that time. It is therefore late by
//! half of that time (4 ms). For a sine of frequency f the amplitude is low by (π f · 8 ms)²/6, 0.07 % at 2.5 Hz. Noise
//! of RMS σ in the displacement gives σ √2 / 8 ms.

use crate::io::TICK_HZ;

/// Ticks over which the difference is taken.
pub const SPAN: usize = 8;

/// Computes the velocity of one displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    past: [f32; SPAN],
    next: usize,
    taken: usize,
}

impl Velocity {
    /// Takes one tick's mean, m, and returns the velocity, m/s; 0 for the first [`SPAN`] ticks.
    pub fn push(&mut self, value_m: f32) -> f32 {
        let before = core::mem::replace(&mut self.past[self.next % SPAN], value_m);
        self.next = (self.next + 1) % SPAN;
        if self.taken < SPAN {
            self.taken += 1;
            return 0.0;
        }
        (value_m - before) * (TICK_HZ / SPAN as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_slope_from_the_ninth_tick_on() {
        let mut velocity = Velocity::default();
        for tick in 0..50 {
            let expected = if tick < 8 { 0.0 } else { 0.5 };
            // Displacements to 0.025 m are known to 1.9e-9 m.
            assert!((velocity.push(0.5e-3 * tick as f32) - expected).abs() < 4e-9 / 8e-3, "tick {tick}");
        }
    }
}
