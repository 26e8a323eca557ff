//! The crash record: words in memory that survive a reset, with a checksum.
//!
//! The checksum tells a record from the random content of the memory after power-on.

use damprig_protocol::{CALLS_TOLD, Crash, CrashCause, Reset};

const MAGIC: u32 = 0x6461_6d70;

/// The words of the crash record. Any content is valid memory; content without a matching checksum reads as no
/// record.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CrashRecord {
    magic: u32,
    cause: u32,
    tick: u32,
    calls: [u32; CALLS_TOLD],
    count: u32,
    /// 1 until the next start has read the record.
    is_new: u32,
    checksum: u32,
}

const CAUSES: [CrashCause; 10] = [
    CrashCause::Panic,
    CrashCause::HardFault,
    CrashCause::ControlStalled,
    CrashCause::CommunicationStalled,
    CrashCause::Watchdog,
    CrashCause::ClockFailed,
    CrashCause::SupplyLow,
    CrashCause::ProgramDamaged,
    CrashCause::UnknownNmi,
    CrashCause::StackOverflow,
];

impl CrashRecord {
    /// An empty record.
    #[must_use]
    pub const fn none() -> Self {
        Self { magic: 0, cause: 0, tick: 0, calls: [0; CALLS_TOLD], count: 0, is_new: 0, checksum: 0 }
    }

    fn sum(&self) -> u32 {
        let words = [self.magic, self.cause, self.tick, self.count, self.is_new];
        words
            .iter()
            .chain(&self.calls)
            .fold(0x9e37_79b9, |sum: u32, word| (sum ^ word).rotate_left(5).wrapping_mul(0x0100_0193))
    }

    /// Decodes the record; `None` if there is none.
    #[must_use]
    pub fn read(&self) -> Option<Crash> {
        let cause = CAUSES.get(self.cause as usize)?;
        let sound = self.magic == MAGIC && self.checksum == self.sum();
        let Self { tick, calls, count, .. } = *self;
        sound.then_some(Crash { cause: *cause, tick, calls, count })
    }

    /// Records a crash and increments the number of crashes; `calls` as in [`Crash`].
    pub fn write(&mut self, cause: CrashCause, tick: u32, calls: [u32; CALLS_TOLD]) {
        let count = self.read().map_or(0, |crash| crash.count).saturating_add(1);
        let cause = CAUSES.iter().position(|known| *known == cause).unwrap_or_default() as u32;
        *self = Self { magic: MAGIC, cause, tick, calls, count, is_new: 1, checksum: 0 };
        self.checksum = self.sum();
    }

    /// Updates the record at a start and returns the crash to report, if any. `last_tick` is the last tick of the
    /// earlier run. A watchdog reset without a recorded cause is recorded as a crash too.
    pub fn at_start(&mut self, reset: Reset, last_tick: u32) -> Option<Crash> {
        if reset == Reset::Power {
            *self = Self::none();
        }
        let new = self.read().filter(|_| self.is_new == 1);
        let stalled =
            |crash: Crash| matches!(crash.cause, CrashCause::ControlStalled | CrashCause::CommunicationStalled);
        if reset != Reset::Watchdog && new.is_some_and(stalled) {
            // The stalled task continued before the watchdog reset the board: there was no crash.
            *self = Self::none();
        }
        let said_why = new.is_some();
        if reset == Reset::Watchdog && !said_why {
            self.write(CrashCause::Watchdog, last_tick, [0; CALLS_TOLD]);
        }
        let crash = self.read();
        if crash.is_some() {
            self.is_new = 0;
            self.checksum = self.sum();
        }
        crash
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALLS: [u32; CALLS_TOLD] = [0x0800_1235, 0x0800_2345, 0, 0, 0, 0];

    #[test]
    fn a_record_survives_resets_and_counts_crashes_until_power_off() {
        let mut record = CrashRecord::none();
        assert_eq!(record.at_start(Reset::Power, 7), None);
        record.write(CrashCause::HardFault, 123, CALLS);
        let told = record.at_start(Reset::Software, 0).unwrap();
        assert_eq!(told, Crash { cause: CrashCause::HardFault, tick: 123, calls: CALLS, count: 1 });
        assert_eq!(record.at_start(Reset::Pin, 0), Some(told), "reported until power-off");
        record.write(CrashCause::Panic, 5, CALLS);
        assert_eq!(record.at_start(Reset::Software, 0).unwrap().count, 2);
        assert_eq!(record.at_start(Reset::Power, 0), None);
    }

    #[test]
    fn a_watchdog_reset_without_a_cause_is_recorded_with_the_last_tick() {
        let mut record = CrashRecord::none();
        let told = record.at_start(Reset::Watchdog, 99).unwrap();
        assert_eq!((told.cause, told.tick, told.count), (CrashCause::Watchdog, 99, 1));
        record.write(CrashCause::CommunicationStalled, 200, CALLS);
        let told = record.at_start(Reset::Watchdog, 201).unwrap();
        assert_eq!((told.cause, told.tick, told.count), (CrashCause::CommunicationStalled, 200, 2));
        assert_eq!(
            record.at_start(Reset::Watchdog, 300).unwrap().cause,
            CrashCause::Watchdog,
            "a later watchdog reset is a new crash"
        );
    }

    #[test]
    fn a_stall_that_ended_before_the_watchdog_is_not_a_crash() {
        let mut record = CrashRecord::none();
        record.write(CrashCause::ControlStalled, 7, CALLS);
        assert_eq!(record.at_start(Reset::Pin, 900), None);
        record.write(CrashCause::ControlStalled, 7, CALLS);
        assert_eq!(record.at_start(Reset::Watchdog, 7).map(|told| told.cause), Some(CrashCause::ControlStalled));
        assert!(record.at_start(Reset::Pin, 0).is_some(), "reported until power-off");
    }

    #[test]
    fn a_record_with_a_flipped_bit_is_rejected() {
        let mut record = CrashRecord::none();
        record.write(CrashCause::Panic, 1, CALLS);
        for bit in 0..32 {
            let mut damaged = record;
            damaged.tick ^= 1 << bit;
            assert_eq!(damaged.read(), None);
            let mut damaged = record;
            damaged.cause ^= 1 << bit;
            assert_eq!(damaged.read(), None);
            let mut damaged = record;
            damaged.calls[CALLS_TOLD - 1] ^= 1 << bit;
            assert_eq!(damaged.read(), None);
        }
    }
}
