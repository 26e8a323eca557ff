//! The virtual rig: a simulated device in this process, behind the same bytes as a real one.

use std::io;
use std::time::Duration;

use damprig_core::settings::Settings;
use damprig_device::board::DeviceInfo;
use damprig_motion::virtual_device::VirtualDevice;
use damprig_simulator::device::Progress;

use super::Link;

/// Most device ticks between two looks at Ctrl-C and the progress display.
const TICKS_PER_TURN: u32 = 1000;

/// A simulated device.
#[derive(Debug)]
pub struct VirtualRig {
    device: Box<VirtualDevice>,
}

impl VirtualRig {
    /// An idle device without a plant, in single or double precision; with these stored settings, or as delivered.
    #[must_use]
    pub fn new(single: bool, settings: Option<&Settings>) -> Self {
        let info = DeviceInfo::new(env!("CARGO_PKG_VERSION"), "virtual");
        let mut device = Box::new(VirtualDevice::granted(single, info));
        settings.into_iter().for_each(|settings| device.start_with(settings));
        Self { device }
    }
}

impl Link for VirtualRig {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.device.receive(bytes);
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        // The device runs until it has sent something. While its clock stands it sends nothing, however long one waits.
        let before = into.len();
        while self.device.run(TICKS_PER_TURN, &mut |bytes| into.extend_from_slice(bytes)) == Progress::Running
            && into.len() == before
        {}
        Ok(())
    }
}
