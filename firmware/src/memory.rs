//! Copying, moving and clearing of memory, eight words at a time. The compiler's own loops for this processor take five
//! instructions a word, and much of what a tick does is moving samples, rows and messages.
//!
//! Stands in for the functions that the compiler calls (Run-time ABI for the Arm Architecture, section 4.3.4); its own are
//! weak and give way.

use core::arch::global_asm;

global_asm!(
    ".syntax unified",
    ".section .text.damprig_memcpy, \"ax\", %progbits",
    ".balign 4",
    ".global memcpy, __aeabi_memcpy, __aeabi_memcpy4, __aeabi_memcpy8",
    ".type memcpy, %function",
    ".type __aeabi_memcpy, %function",
    ".type __aeabi_memcpy4, %function",
    ".type __aeabi_memcpy8, %function",
    ".thumb_func",
    "memcpy:",
    ".thumb_func",
    "__aeabi_memcpy:",
    ".thumb_func",
    "__aeabi_memcpy4:",
    ".thumb_func",
    "__aeabi_memcpy8:",
    // r0 to, r1 from, r2 bytes; the first is what memcpy returns.
    "push {{r0, r4-r9, lr}}",
    "orr r3, r0, r1",
    "lsls r3, r3, #30",
    "bne 4f",
    "subs r2, r2, #32",
    "blo 2f",
    "1:",
    "ldmia r1!, {{r3-r9, r12}}",
    "stmia r0!, {{r3-r9, r12}}",
    "subs r2, r2, #32",
    "bhs 1b",
    "2:",
    // Less than 32 are left: bits 4 and 3 of the count, then 2 and 1, then 0.
    "lsls r3, r2, #28",
    "itt cs",
    "ldmiacs r1!, {{r4-r7}}",
    "stmiacs r0!, {{r4-r7}}",
    "itt mi",
    "ldmiami r1!, {{r4-r5}}",
    "stmiami r0!, {{r4-r5}}",
    "3:",
    "lsls r3, r2, #30",
    "itt cs",
    "ldrcs r3, [r1], #4",
    "strcs r3, [r0], #4",
    "itt mi",
    "ldrhmi r3, [r1], #2",
    "strhmi r3, [r0], #2",
    "lsls r3, r2, #31",
    "itt mi",
    "ldrbmi r3, [r1]",
    "strbmi r3, [r0]",
    "pop {{r0, r4-r9, pc}}",
    // Not both at whole words: the processor reads and writes single words anywhere.
    "4:",
    "subs r2, r2, #4",
    "blo 6f",
    "5:",
    "ldr r3, [r1], #4",
    "str r3, [r0], #4",
    "subs r2, r2, #4",
    "bhs 5b",
    "6:",
    // The count's lowest bits are what they were; bit 2 is to be none.
    "and r2, r2, #3",
    "b 3b",
    ".size memcpy, . - memcpy",
    ".section .text.damprig_memmove, \"ax\", %progbits",
    ".balign 4",
    ".global memmove, __aeabi_memmove, __aeabi_memmove4, __aeabi_memmove8",
    ".type memmove, %function",
    ".type __aeabi_memmove, %function",
    ".type __aeabi_memmove4, %function",
    ".type __aeabi_memmove8, %function",
    ".thumb_func",
    "memmove:",
    ".thumb_func",
    "__aeabi_memmove:",
    ".thumb_func",
    "__aeabi_memmove4:",
    ".thumb_func",
    "__aeabi_memmove8:",
    // memcpy reads before it writes and goes upwards: right unless the place begins within what is moved.
    "subs r3, r0, r1",
    "cmp r3, r2",
    "bhs memcpy",
    "push {{r0, lr}}",
    "add r0, r0, r2",
    "add r1, r1, r2",
    "orr r3, r0, r1",
    "orr r3, r3, r2",
    "lsls r3, r3, #30",
    "bne 2f",
    "1:",
    "subs r2, r2, #4",
    "blo 3f",
    "ldr r3, [r1, #-4]!",
    "str r3, [r0, #-4]!",
    "b 1b",
    "2:",
    "subs r2, r2, #1",
    "blo 3f",
    "ldrb r3, [r1, #-1]!",
    "strb r3, [r0, #-1]!",
    "b 2b",
    "3:",
    "pop {{r0, pc}}",
    ".size memmove, . - memmove",
    ".section .text.damprig_memclr, \"ax\", %progbits",
    ".balign 4",
    ".global __aeabi_memclr4, __aeabi_memclr8",
    ".type __aeabi_memclr4, %function",
    ".type __aeabi_memclr8, %function",
    ".thumb_func",
    "__aeabi_memclr4:",
    ".thumb_func",
    "__aeabi_memclr8:",
    // r0 at, r1 bytes.
    "push {{r4-r6, lr}}",
    "movs r2, #0",
    "movs r3, #0",
    "movs r4, #0",
    "movs r5, #0",
    "subs r1, r1, #16",
    "blo 2f",
    "1:",
    "stmia r0!, {{r2-r5}}",
    "subs r1, r1, #16",
    "bhs 1b",
    "2:",
    "lsls r6, r1, #29",
    "it cs",
    "stmiacs r0!, {{r2-r3}}",
    "it mi",
    "strmi r2, [r0], #4",
    "lsls r6, r1, #31",
    "it cs",
    "strhcs r2, [r0], #2",
    "it mi",
    "strbmi r2, [r0]",
    "pop {{r4-r6, pc}}",
    ".size __aeabi_memclr4, . - __aeabi_memclr4",
);

#[cfg(feature = "count-instructions")]
unsafe extern "C" {
    fn memcpy(to: *mut u8, from: *const u8, bytes: usize) -> *mut u8;
    fn memmove(to: *mut u8, from: *const u8, bytes: usize) -> *mut u8;
    fn __aeabi_memclr4(at: *mut u8, bytes: usize);
}

/// Copies, moves and clears every length up to 100 bytes, at every place within a word, and looks at every byte.
///
/// # Panics
/// One is wrong.
#[cfg(feature = "count-instructions")]
pub fn check() {
    #[repr(align(4))]
    struct Words([u8; 112]);
    const MARK: u8 = 0xee;
    let from = Words(core::array::from_fn(|n| n as u8));
    for length in 0..=100 {
        for (at, start) in (0..4).flat_map(|at| (0..4).map(move |start| (at, start))) {
            let mut to = Words([MARK; 112]);
            let place = to.0[at + 4..].as_mut_ptr();
            // SAFETY: 4 + 3 + 100 bytes lie within both.
            let returned = unsafe { memcpy(place, from.0[start..].as_ptr(), length) };
            assert!(returned == place);
            for (n, byte) in to.0.iter().enumerate() {
                let copied = (at + 4..at + 4 + length).contains(&n);
                assert!(*byte == if copied { (n - at - 4 + start) as u8 } else { MARK }, "copy of {} bytes", length);
            }
        }
        for (from, at) in (0..12).flat_map(|from| (0..12).map(move |at| (from, at))) {
            let mut both = Words(core::array::from_fn(|n| n as u8));
            let first = both.0.as_mut_ptr();
            // SAFETY: 11 + 100 bytes lie within it.
            let (place, returned) = unsafe { (first.add(at), memmove(first.add(at), first.add(from), length)) };
            assert!(returned == place);
            for (n, byte) in both.0.iter().enumerate() {
                let moved = (at..at + length).contains(&n);
                assert!(*byte == if moved { n - at + from } else { n } as u8, "move of {} bytes", length);
            }
        }
        let mut to = Words([MARK; 112]);
        // SAFETY: 4 + 100 bytes lie within it, from a whole word on.
        unsafe { __aeabi_memclr4(to.0[4..].as_mut_ptr(), length) };
        for (n, byte) in to.0.iter().enumerate() {
            assert!(*byte == if (4..4 + length).contains(&n) { 0 } else { MARK }, "clearing of {} bytes", length);
        }
    }
}
