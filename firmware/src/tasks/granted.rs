//! The emulated board: the whole simulated rig under the host's tick credit, in one loop.
//!
//! Ticks run back to back while there is credit, without a timer: an interrupt costs the emulator more than a tick.

use damprig_device::control::Name;
use damprig_device::simulated::{Progress, Simulated};
use static_cell::StaticCell;

use crate::board::mps2_an386::{self, Line};
use crate::tick;

/// Ticks between two looks at the line.
const TICKS_BETWEEN_LOOKS: u32 = 100;

/// The board with its simulated plant, in static memory: it is too large for a stack frame to be moved about.
pub fn device() -> &'static mut Simulated<f32> {
    static DEVICE: StaticCell<Simulated<f32>> = StaticCell::new();
    DEVICE.init_with(|| Simulated::new(Name::new(env!("CARGO_PKG_VERSION"), mps2_an386::NAME)))
}

/// Owns the line and the simulated rig.
#[embassy_executor::task]
pub async fn run(mut line: Line, device: &'static mut Simulated<f32>) -> ! {
    loop {
        while let Some(byte) = line.try_read() {
            device.receive(&[byte]);
        }
        let progress = device.run(TICKS_BETWEEN_LOOKS, |bytes| line.write(bytes));
        tick::note(device.control().next_tick());
        if progress == Progress::Standing {
            let byte = line.read().await;
            device.receive(&[byte]);
        }
    }
}
