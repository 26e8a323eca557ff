//! Reads the call stack. Functions of this target keep a chain of frames; each has the address of the caller's frame
//! and the return address.

use core::arch::asm;

use damprig_protocol::CALLS_TOLD;

unsafe extern "C" {
    /// Start of the stack, a linker symbol from cortex-m-rt. Only its address has a meaning.
    static _stack_start: u32;
}

/// Return addresses, innermost first, followed by 0.
#[inline(always)]
pub fn of_here() -> [u32; CALLS_TOLD] {
    let frame: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, r7", out(reg) frame, options(nomem, nostack, preserves_flags)) };
    of(frame, cortex_m::register::msp::read() as usize)
}

/// Return addresses from a frame on, which lies at `above` or higher.
pub fn of(mut frame: usize, mut above: usize) -> [u32; CALLS_TOLD] {
    let mut calls = [0; CALLS_TOLD];
    let end = &raw const _stack_start as usize;
    for call in &mut calls {
        // Each frame must be completely within the stack, at a higher address than the one before.
        if frame < above || !frame.is_multiple_of(4) || frame + 8 > end {
            break;
        }
        // SAFETY: two aligned words of the stack; nothing writes them meanwhile, because interrupts are off.
        let (outer, return_to) = unsafe { (*(frame as *const usize), *((frame + 4) as *const u32)) };
        *call = return_to;
        above = frame + 8;
        frame = outer;
    }
    calls
}
