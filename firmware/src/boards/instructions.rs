//! Counts instructions with SysTick in the emulator.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Counts instructions. Under QEMU's `-icount shift=10` each instruction takes 1 024 ns, which is 25.6 counts of the
/// 25 MHz SysTick, so the number of instructions is exact.
pub struct InstructionCounter {
    _timer: SYST,
}

const SYSTEM_CLOCK_HZ: u64 = 25_000_000;
const INSTRUCTION_NS: u64 = 1 << 10;
const COUNTER_MASK: u32 = (1 << 24) - 1;

impl InstructionCounter {
    /// Starts SysTick over its full range, without interrupts.
    pub fn start(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(COUNTER_MASK);
        timer.clear_current();
        timer.enable_counter();
        Self { _timer: timer }
    }

    /// Runs `work`; returns its result and the number of its instructions, at most 650 000. The number includes the
    /// call of the counter itself (about ten instructions).
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        let before = SYST::get_current();
        let result = work();
        let counts = before.wrapping_sub(SYST::get_current()) & COUNTER_MASK;
        (result, (u64::from(counts) * 1_000_000_000 / (SYSTEM_CLOCK_HZ * INSTRUCTION_NS)) as u32)
    }

    /// Checks the counter with a known number of instructions.
    ///
    /// # Panics
    /// The count is wrong, because the emulator runs without `-icount shift=10`.
    pub fn check(&self) {
        // SAFETY: a thousand `nop` instructions have no effect.
        let ((), count) = self.count(|| unsafe { core::arch::asm!(".rept 1000", "nop", ".endr") });
        assert!((1000..1020).contains(&count), "1000 instructions counted as {}: run with -icount shift=10", count);
    }
}
