//! What ended the firmware, kept in memory that a reset leaves alone. What the words mean is the device code's; this is
//! where they are, and who writes them: a panic, a fault of the processor, a crystal that stops, a task that stalls.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m_rt::{ExceptionFrame, exception};
use damprig_device::crash::Record;
use damprig_protocol::{CALLS_TOLD, Crash, CrashCause, Reset};
use embassy_stm32::pac;

use crate::boards::nucleo_g474re::settings;
use crate::{callers, tick};

/// The words, and the last tick.
struct Kept(UnsafeCell<MaybeUninit<(Record, u32)>>);

// SAFETY: written by what ends the program alone, with interrupts masked, and read before any task runs.
unsafe impl Sync for Kept {}

#[unsafe(link_section = ".uninit.crash")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

fn kept() -> (*mut Record, *mut u32) {
    let kept = KEPT.0.get().cast::<(Record, u32)>();
    // SAFETY: the addresses alone are taken.
    unsafe { (&raw mut (*kept).0, &raw mut (*kept).1) }
}

/// The rig's tick, for the record.
pub fn note_tick(next: u32) {
    tick::note(next);
    // SAFETY: the control tick alone writes it; whoever reads it has masked interrupts or runs before the tasks.
    unsafe { kept().1.write_volatile(next) };
}

/// At the start, before any task: what is to be told of earlier runs.
pub fn at_start(reset: Reset) -> Option<Crash> {
    let (record, tick) = kept();
    // SAFETY: no task runs yet. Whatever memory holds is a sound value of either type: plain words.
    unsafe {
        let last_tick = tick.read_volatile();
        let mut words = record.read_volatile();
        let crash = words.at_start(reset, last_tick);
        record.write_volatile(words);
        crash
    }
}

/// Records why, and leaves the rest to the watchdog.
pub fn note(cause: CrashCause, calls: [u32; CALLS_TOLD]) {
    cortex_m::interrupt::free(|_| {
        let record = kept().0;
        // SAFETY: interrupts are masked, and plain words are sound whatever they hold.
        unsafe {
            let mut words = record.read_volatile();
            words.write(cause, tick::now(), calls);
            record.write_volatile(words);
        }
    });
}

/// Records why, and starts again: every output is off from the reset on.
pub fn end(cause: CrashCause, calls: [u32; CALLS_TOLD]) -> ! {
    note(cause, calls);
    cortex_m::peripheral::SCB::sys_reset()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end(CrashCause::HardFault, [frame.pc(), frame.lr(), 0, 0, 0, 0])
}

/// A damaged word of the settings was read, which their checksum finds; the crystal stopped, and the hardware has gone back
/// to the internal oscillator, ten times too slow; the program itself is damaged.
#[exception]
unsafe fn NonMaskableInt() {
    if settings::was_misread() {
        return;
    }
    let cause = if pac::RCC.cifr().read().cssf() {
        CrashCause::ClockFailed
    } else if pac::FLASH.eccr().read().eccd() {
        CrashCause::ProgramDamaged
    } else {
        CrashCause::UnknownNmi
    };
    end(cause, [0; CALLS_TOLD])
}

/// A panic's text and place would take 8 KB of flash with them, paths of the machine that built the image among it: the calls
/// are enough, `addr2line` makes places of them.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    end(CrashCause::Panic, callers::of_here())
}
