//! Stores the crash record in memory that survives a reset. Its writers are panics, processor faults, a stopped
//! crystal and stalled tasks. [`damprig_device::crash`] defines its content.

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m_rt::exception;
use damprig_device::crash::CrashRecord;
use damprig_protocol::{CALLS_TOLD, Crash, CrashCause, Reset};
use embassy_stm32::pac;

use crate::boards::nucleo_g474re::settings;
use crate::{callers, tick};

/// The record and the last tick.
struct Kept(UnsafeCell<MaybeUninit<(CrashRecord, u32)>>);

// SAFETY: written only by code that ends the program, with interrupts masked, and read before any task runs.
unsafe impl Sync for Kept {}

#[unsafe(link_section = ".uninit.crash")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

fn kept() -> (*mut CrashRecord, *mut u32) {
    let kept = KEPT.0.get().cast::<(CrashRecord, u32)>();
    // SAFETY: only takes the addresses.
    unsafe { (&raw mut (*kept).0, &raw mut (*kept).1) }
}

/// Stores the rig's tick for the record.
pub fn note_tick(next: u32) {
    tick::note(next);
    // SAFETY: only the control tick writes it; readers have masked interrupts or run before the tasks.
    unsafe { kept().1.write_volatile(next) };
}

/// Called at the start, before any task; returns the crash to report, if any.
pub fn at_start(reset: Reset) -> Option<Crash> {
    let (record, tick) = kept();
    // SAFETY: no task runs yet. Both types are plain words, so any content of the memory is a valid value.
    unsafe {
        let last_tick = tick.read_volatile();
        let mut words = record.read_volatile();
        let crash = words.at_start(reset, last_tick);
        record.write_volatile(words);
        crash
    }
}

/// Records a cause without a reset; the watchdog resets the board.
pub fn note(cause: CrashCause, calls: [u32; CALLS_TOLD]) {
    cortex_m::interrupt::free(|_| {
        let record = kept().0;
        // SAFETY: interrupts are masked, and any content of plain words is valid.
        unsafe {
            let mut words = record.read_volatile();
            words.write(cause, tick::now(), calls);
            record.write_volatile(words);
        }
    });
}

/// Records a cause and resets the board; the reset switches every output off.
pub fn end(cause: CrashCause, calls: [u32; CALLS_TOLD]) -> ! {
    note(cause, calls);
    cortex_m::peripheral::SCB::sys_reset()
}

unsafe extern "C" {
    /// Lowest address of the stack, a linker symbol from `memory.x`. Only its address has a meaning.
    static _stack_end: u32;
}

/// Goes on with a fresh stack, because there may be none left; the interrupted code does not continue. Passes the stack pointer and
/// the frame of the interrupted code.
///
/// # Safety
/// Called by the processor.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "mov r1, r7",
        "movw r2, #:lower16:_stack_start",
        "movt r2, #:upper16:_stack_start",
        "msr msp, r2",
        "b {}",
        sym faulted,
    )
}

/// The processor has pushed the interrupted registers at `stack`, unless that is below the stack.
unsafe extern "C" fn faulted(stack: *const [u32; 8], frame: usize) -> ! {
    if stack.addr() < (&raw const _stack_end).addr() {
        end(CrashCause::StackOverflow, callers::of(frame, stack.addr()))
    }
    // SAFETY: the eight words are within the stack.
    let [.., lr, pc, _] = unsafe { stack.read() };
    end(CrashCause::HardFault, [pc, lr, 0, 0, 0, 0])
}

/// Possible causes: a damaged word of the settings was read, which their checksum detects; the crystal stopped, and
/// the hardware has switched to the internal oscillator, ten times too slow; the program itself is damaged.
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

/// Records the call stack only. The text and location of a panic would need 8 KB of flash and would include paths of
/// the build machine. `addr2line` finds the source lines.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    end(CrashCause::Panic, callers::of_here())
}
