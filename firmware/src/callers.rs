//! The calls that led to a place, read off the stack: this target's functions keep a chain of frames, each the address of
//! the next one out and the address to return to.

use core::arch::asm;

use damprig_protocol::CALLS_TOLD;

unsafe extern "C" {
    /// Where the stack begins: the linker's, from cortex-m-rt. Only its address means anything.
    static _stack_start: u32;
}

/// Return addresses, the innermost first; 0 behind the last.
#[inline(always)]
pub fn of_here() -> [u32; CALLS_TOLD] {
    let mut frame: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, r7", out(reg) frame, options(nomem, nostack, preserves_flags)) };
    let mut calls = [0; CALLS_TOLD];
    let mut above = cortex_m::register::msp::read() as usize;
    let end = &raw const _stack_start as usize;
    for call in &mut calls {
        // Each frame lies further out than the one before it, whole within the stack; what does not is none.
        if frame < above || !frame.is_multiple_of(4) || frame + 8 > end {
            break;
        }
        // SAFETY: two words of the stack, aligned; nothing writes it meanwhile, interrupts are off.
        let (outer, return_to) = unsafe { (*(frame as *const usize), *((frame + 4) as *const u32)) };
        *call = return_to;
        above = frame + 8;
        frame = outer;
    }
    calls
}
