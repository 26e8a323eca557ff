//! The trait [`Board`]: samples, outputs, ticks and settings memory that the control loop needs.

use damprig_core::io::{Actuators, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::Settings;
use damprig_protocol::{Clock, NumberedRequest, PlantKind, StoredPart, Timing};

/// A board. The default methods suit a board with a real structure and its own clock.
pub trait Board {
    /// Whether the plant is real or simulated, and in which precision.
    const PLANT: PlantKind = PlantKind::Real;

    /// The clock that counts the ticks.
    fn clock(&self) -> Clock {
        Clock::RealTime
    }

    /// Returns the samples of the tick that is due; `None` while the clock is stopped.
    fn samples(&mut self, rig: &Rig) -> Option<Sensors>;

    /// Sets the outputs that the rig demands in this tick.
    fn set(&mut self, actuators: &Actuators, rig: &Rig);

    /// Saves the settings, or begins to save them.
    ///
    /// # Errors
    /// They cannot be saved.
    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected>;

    /// Returns once how a save that took longer has ended.
    fn saved(&mut self) -> Option<Result<(), Rejected>> {
        None
    }

    /// Bytes of a page of the settings memory, which may hold any layout. None if the board has no such memory.
    fn stored_settings(&mut self, _page: u8, _from: u16) -> StoredPart {
        StoredPart::NONE
    }

    /// Timing of the ticks.
    fn timing(&self) -> Timing {
        Timing::default()
    }

    /// Checks whether an experiment can start.
    ///
    /// # Errors
    /// Something that the experiment needs is missing.
    fn can_start(&self) -> Result<(), Rejected> {
        Ok(())
    }

    /// Called when an experiment has started: ticks count from 0.
    fn started(&mut self) {}

    /// Handles a message to the simulator behind the board. A plant is replaced only while the rig is idle.
    ///
    /// # Errors
    /// The board has no simulator, or the message is invalid or not possible in this state.
    fn simulate(&mut self, _message: &[u8], _rig: &Rig) -> Result<Simulated, Rejected> {
        Err(Rejected::not_here("this board drives a real structure: its plant cannot be set"))
    }

    /// Keeps a request until its tick.
    ///
    /// # Errors
    /// The board has its own clock, or its space for waiting requests is full.
    fn defer(&mut self, _request: &NumberedRequest) -> Result<(), Rejected> {
        Err(Rejected::not_here("only a simulated board lets a request wait for its tick"))
    }

    /// Returns the kept request, once its tick has come.
    fn due(&mut self, _next_tick: u32) -> Option<NumberedRequest> {
        None
    }
}

/// What a message to the simulator did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simulated {
    /// The plant was replaced, and with it the drive of the friction spring.
    PlantReplaced,
    /// The plant has a fault more or less.
    PlantChanged,
}

/// State of a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saving {
    /// The settings are saved.
    Done,
    /// The save has begun; [`Board::saved`] reports the end.
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
