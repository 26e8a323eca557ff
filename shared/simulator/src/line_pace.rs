//! Limits a simulated board to the serial line's rate in device time, so that it sends as late as a real board.

use damprig_core::io::TICK_HZ;
use damprig_device::control_loop::Step;
use damprig_device::outbox::BAUD;

/// Bytes that the line carries per tick, with ten bits per byte.
const BYTES_PER_TICK: f32 = BAUD as f32 / 10.0 / TICK_HZ;

/// Allowance of the line in bytes. A frame may start when those before it have been sent.
#[derive(Clone, Copy, Debug, Default)]
pub struct LinePace {
    allowance: f32,
}

impl LinePace {
    /// An idle line.
    #[must_use]
    pub const fn new() -> Self {
        Self { allowance: 0.0 }
    }

    /// Follows a step of the control loop; `next_tick` is the tick after it. A start resets the line to idle.
    pub fn follow(&mut self, step: Step, next_tick: u32) {
        if next_tick == 0 {
            *self = Self::default();
        } else if step == Step::Ticked {
            self.tick();
        }
    }

    /// Adds the allowance of a tick. An idle line accumulates at most one tick's allowance.
    pub fn tick(&mut self) {
        let allowance = self.allowance + BYTES_PER_TICK;
        self.allowance = if allowance > BYTES_PER_TICK { BYTES_PER_TICK } else { allowance };
    }

    /// Whether a frame may start.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.allowance > 0.0
    }

    /// Charges a frame of this many bytes, which has started.
    pub fn charge(&mut self, bytes: usize) {
        self.allowance -= bytes as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_carries_exactly_its_rate() {
        let (mut pace, mut sent) = (LinePace::default(), 0);
        for _ in 0..1000 {
            pace.tick();
            while pace.is_clear() {
                pace.charge(300);
                sent += 300;
            }
        }
        let capacity = BYTES_PER_TICK * 1000.0;
        assert!((sent as f32 - capacity).abs() <= 300.0, "{sent} of {capacity}");
    }
}
