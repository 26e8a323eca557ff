//! What the control loop needs of a board: samples, outputs, ticks, and a place for the settings.

use damprig_core::io::{Actuators, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::Settings;
use damprig_protocol::{Clock, NumberedRequest, PlantKind, Timing};

/// A board. The provided methods are those of a board with a real structure and a clock of its own.
pub trait Board {
    /// Real, or simulated in which precision.
    const PLANT: PlantKind = PlantKind::Real;

    /// Whose clock counts the ticks.
    const CLOCK: Clock = Clock::RealTime;

    /// The samples of the tick that is due; `None` while the clock stands.
    fn samples(&mut self, rig: &Rig) -> Option<Sensors>;

    /// Sets the outputs that the rig demands in this tick.
    fn set(&mut self, actuators: &Actuators, rig: &Rig);

    /// Saves the settings, or begins to.
    ///
    /// # Errors
    /// They cannot be saved.
    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected>;

    /// How a save that took longer has ended, once.
    fn saved(&mut self) -> Option<Result<(), Rejected>> {
        None
    }

    /// How well the ticks keep their time.
    fn timing(&self) -> Timing {
        Timing::default()
    }

    /// Whether an experiment can start.
    ///
    /// # Errors
    /// What is missing.
    fn can_start(&self) -> Result<(), Rejected> {
        Ok(())
    }

    /// An experiment has started: ticks count from 0.
    fn started(&mut self) {}

    /// A message to the simulator behind the board.
    ///
    /// # Errors
    /// The board has none, or the message is not valid.
    fn simulate(&mut self, _message: &[u8]) -> Result<(), Rejected> {
        Err(Rejected::not_here("this board drives a real structure: its plant cannot be set"))
    }

    /// Keeps a request for its tick.
    ///
    /// # Errors
    /// The board's clock is its own, or another request waits already.
    fn defer(&mut self, _request: &NumberedRequest) -> Result<(), Rejected> {
        Err(Rejected::not_here("only a simulated board lets a request wait for its tick"))
    }

    /// The kept request, once its tick has come.
    fn due(&mut self, _next_tick: u32) -> Option<NumberedRequest> {
        None
    }
}

/// State of a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saving {
    /// The settings are saved.
    Done,
    /// They are being saved; [`Board::saved`] reports the end.
    Begun,
}

/// Identity of the board and its firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// The firmware's version.
    pub firmware: &'static str,
    /// The board.
    pub board: &'static str,
    /// Revision of the source; empty if unknown.
    pub revision: &'static str,
    /// Build profile.
    pub profile: &'static str,
}

impl DeviceInfo {
    /// Without a revision and a profile.
    #[must_use]
    pub const fn new(firmware: &'static str, board: &'static str) -> Self {
        Self { firmware, board, revision: "", profile: "" }
    }
}
