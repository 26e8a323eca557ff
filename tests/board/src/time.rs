//! Device time and the periods of the chip's clocks.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

/// Units of time per microsecond. 4080 MHz is the least common multiple of the 16 MHz and 24 MHz oscillators and the
/// 170 MHz core clock, so the period of each is a whole number of units.
pub const UNITS_PER_US: u64 = 4_080;

/// A device time or a duration, in units of 1/4080 µs. 64 bits hold 143 years.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(pub u64);

impl Time {
    /// The latest time, for an event that does not occur.
    pub const NEVER: Self = Self(u64::MAX);

    /// Whole microseconds.
    #[must_use]
    pub const fn from_us(us: u64) -> Self {
        Self(us * UNITS_PER_US)
    }

    /// Whole milliseconds.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self::from_us(1_000 * ms)
    }

    /// Seconds, to the nearest unit; 0 or more.
    #[must_use]
    pub fn from_s(seconds: f64) -> Self {
        Self((seconds * 1e6 * UNITS_PER_US as f64).round() as u64)
    }

    /// Seconds.
    #[must_use]
    pub fn s(self) -> f64 {
        self.0 as f64 / (1e6 * UNITS_PER_US as f64)
    }

    /// Microseconds.
    #[must_use]
    pub fn us(self) -> f64 {
        self.0 as f64 / UNITS_PER_US as f64
    }

    /// The time since `earlier`, or 0 if `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl Add for Time {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl AddAssign for Time {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Time {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul<u64> for Time {
    type Output = Self;

    fn mul(self, times: u64) -> Self {
        Self(self.0.saturating_mul(times))
    }
}

impl Sum for Time {
    fn sum<I: Iterator<Item = Self>>(times: I) -> Self {
        times.fold(Self(0), |sum, time| sum + time)
    }
}

/// The periods of the chip's clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// SYSCLK, before the AHB prescaler.
    pub sysclk: Time,
    /// HCLK: the core, the memories, AHB.
    pub hclk: Time,
    /// PCLK1.
    pub pclk1: Time,
    /// PCLK2.
    pub pclk2: Time,
    /// The timers on APB1.
    pub timers1: Time,
    /// The timers on APB2.
    pub timers2: Time,
    /// The kernel clock of ADC1 and ADC2, before their own prescaler; `None` if CCIPR selects none.
    pub adc12: Option<Time>,
    /// The kernel clock of LPUART1.
    pub lpuart1: Time,
    /// The internal low-speed oscillator.
    pub lsi: Time,
}

/// Time and clocks of a register access.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// The present device time.
    pub now: Time,
    /// The chip's clocks.
    pub clocks: Clocks,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_clock_has_a_whole_period() {
        for hz in [16_000_000, 24_000_000, 48_000_000, 170_000_000, 32_000] {
            assert_eq!(UNITS_PER_US * 1_000_000 % hz, 0, "{hz} Hz");
        }
    }
}
