//! The virtual rig: a simulated board in this process, behind the same bytes as a real one.

use std::io;
use std::time::Duration;

use damprig_core::settings::{Settings, Source};
use damprig_device::control::Name;
use damprig_device::simulated::{PlantScalar, Progress, Simulated};

use super::Link;

/// Device ticks between two looks at the host's side, so that Ctrl-C and progress are prompt.
const TICKS_PER_TURN: u32 = 1000;

/// A simulated board and the bytes on their way from it.
#[derive(Debug)]
pub struct VirtualRig<S> {
    board: Box<Simulated<S>>,
}

impl<S: PlantScalar> VirtualRig<S> {
    /// An idle board without a plant, its settings as delivered.
    #[must_use]
    pub fn new() -> Self {
        Self::of(None)
    }

    /// An idle board without a plant that has kept these settings; none are as delivered.
    #[must_use]
    pub fn of(settings: Option<&Settings>) -> Self {
        let name = Name::new(env!("CARGO_PKG_VERSION"), "virtual");
        let mut board = Box::new(Simulated::new(name));
        settings.into_iter().for_each(|settings| board.start_with(settings, Source::Stored));
        Self { board }
    }
}

impl<S: PlantScalar> Default for VirtualRig<S> {
    fn default() -> Self {
        Self::new()
    }
}

impl<S: PlantScalar> Link for VirtualRig<S> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.receive(bytes);
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        // The board runs until it has said something; standing, it has nothing to say, however long one waits.
        let before = into.len();
        while self.board.run(TICKS_PER_TURN, |bytes| into.extend_from_slice(bytes)) == Progress::Running
            && into.len() == before
        {}
        Ok(())
    }
}
