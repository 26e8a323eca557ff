//! The virtual rig: a simulated board in this process, behind the same bytes as a real one.

use std::io;
use std::time::Duration;

use damprig_core::settings::{Settings, Source};
use damprig_device::control::Name;
use damprig_device::simulated::{Progress, Simulated, VirtualBoard};

use super::Link;

/// Device ticks between two looks at the host's side, so that Ctrl-C and progress are prompt.
const TICKS_PER_TURN: u32 = 1000;

/// A simulated board and the bytes on their way from it.
#[derive(Debug)]
pub struct VirtualRig {
    board: Box<VirtualBoard>,
}

impl VirtualRig {
    /// An idle board without a plant, in single or double precision, that has kept these settings; as delivered for none.
    #[must_use]
    pub fn new(single: bool, settings: Option<&Settings>) -> Self {
        let name = Name::new(env!("CARGO_PKG_VERSION"), "virtual");
        let mut board = Box::new(if single {
            VirtualBoard::Single(Simulated::new(name))
        } else {
            VirtualBoard::Double(Simulated::new(name))
        });
        settings.into_iter().for_each(|settings| board.start_with(settings, Source::Stored));
        Self { board }
    }
}

impl Link for VirtualRig {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.receive(bytes);
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        // Runs until the board sends something. Without ticks to run it sends nothing, so waiting would not help.
        let before = into.len();
        while self.board.run(TICKS_PER_TURN, &mut |bytes| into.extend_from_slice(bytes)) == Progress::Running
            && into.len() == before
        {}
        Ok(())
    }
}
