//! The emulated board without floating point: QEMU's mps2-an385, a Cortex-M3.
//!
//! It has no rig and no line. It shows that the sampled integrator runs on such a controller and what a step costs there;
//! what it runs is `tasks::fixed_point`'s.

use cortex_m_semihosting::{debug, hprintln};

use crate::boards::instructions::InstructionCounter;

/// Takes the peripherals; the emulator's instruction counter is all there is. To be called once.
pub fn init() -> InstructionCounter {
    let core = cortex_m::Peripherals::take().expect("the board is initialised once");
    InstructionCounter::start(core.SYST)
}

/// Ends the emulator, with success or failure as its exit status. Needs its semihosting switched on.
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
