//! The rates of the control tick and of the converters.

/// Control ticks per second.
pub const TICK_HZ: f32 = 1000.0;

/// Samples per tick of displacements and spring force: their converters run at 10 kHz.
pub const SUBSAMPLES: usize = 10;

/// Samples per tick and wall: their converter runs at 50 kHz, so that a block carries a pulse's peak.
pub const WALL_SUBSAMPLES: usize = 50;
