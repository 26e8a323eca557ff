//! The rates of the control tick and of the converters.

/// Control ticks per second.
pub const TICK_HZ: f32 = 1000.0;

/// Samples per tick of the displacements and the spring force. Their converters run at 10 kHz.
pub const SUBSAMPLES: usize = 10;

/// Samples per tick and wall. The walls' converter runs at 50 kHz, so that a block resolves a pulse's peak.
pub const WALL_SUBSAMPLES: usize = 50;
