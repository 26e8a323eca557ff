//! The emulated board without floating point: QEMU's mps2-an385, a Cortex-M3.
//!
//! It has no rig and no serial line. It shows that the fixed-point integrator runs on such a controller, and what a
//! step costs there. The runs are in `tasks::fixed_point`.

use cortex_m_semihosting::{debug, hprintln};

use crate::boards::instructions::InstructionCounter;

/// Takes the peripherals; returns the emulator's instruction counter. Call once.
pub fn init() -> InstructionCounter {
    let core = cortex_m::Peripherals::take().expect("the board is initialised once");
    InstructionCounter::start(core.SYST)
}

/// Ends the emulator with an exit status of success or failure. Needs semihosting.
pub fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    exit(false)
}
