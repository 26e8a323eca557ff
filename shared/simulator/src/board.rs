//! A simulated board: the control loop's outputs drive a simulated plant. Its ticks pass under the host's tick credit, or at
//! the pace of a clock.
//!
//! With a clock of its own ([`SimulatedBoard::real_time`]) a tick passes at every step of the control loop; who calls it sets the
//! pace. Without, device time advances only as far as the host has granted ([`ToDevice::Grant`](damprig_protocol::ToDevice::Grant)).
//! Without credit the clock is stopped: requests are served at once, and all queued messages are sent. So nothing
//! that a host can observe depends on how fast either side runs, and a run repeats bit for bit.

use damprig_core::io::{Actuators, Readings, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::scalar::Scalar;
use damprig_core::settings::Settings;
use damprig_device::board::{Board, Saving, Simulated};
use damprig_device::settings_store::Records;
use damprig_protocol::{Clock, NumberedRequest, PlantKind, StoredPart, Timing};

use crate::messages::ToSimulator;
use damprig_core::integrator::sampled::Joined;

use crate::plant::{Load, Plant, PlantConfig};

/// A scalar type that a simulated plant can use.
pub trait PlantScalar: Scalar {
    /// Kind of plant that is announced to the host.
    const KIND: PlantKind;
}

impl PlantScalar for f32 {
    const KIND: PlantKind = PlantKind::SimulatedF32;
}

impl PlantScalar for f64 {
    const KIND: PlantKind = PlantKind::SimulatedF64;
}

/// The simulated board; by default it has no plant, a granted clock and no credit. `L` is what stands on the base of its plant.
#[derive(Debug)]
pub struct SimulatedBoard<S, L = Joined<S>> {
    clock: Clock,
    timing: Timing,
    plant: Option<Plant<S, L>>,
    sensors: Sensors,
    /// The first tick that may not run yet.
    until_tick: u32,
    /// Whether the host has been told that the credit is used up.
    clock_told: bool,
    /// A request that waits for its tick.
    deferred: Option<NumberedRequest>,
    /// The settings memory, which lasts as long as the board.
    records: Records,
}

impl<S, L> Default for SimulatedBoard<S, L> {
    fn default() -> Self {
        Self {
            clock: Clock::Granted,
            timing: Timing::default(),
            plant: None,
            sensors: Sensors::default(),
            until_tick: 0,
            clock_told: true,
            deferred: None,
            records: Records::ERASED,
        }
    }
}

impl<S: PlantScalar, L: Load<S>> SimulatedBoard<S, L> {
    /// A board with its own clock, at the idle rig of the source document.
    #[must_use]
    pub fn real_time() -> Self {
        // Cannot fail: a test makes this plant.
        let plant = Plant::with_load(&PlantConfig::source_document()).ok();
        Self { clock: Clock::RealTime, plant, ..Self::default() }
    }

    /// Counts ticks that a board with its own clock has lost, because they came too late.
    pub fn lose_ticks(&mut self, ticks: u32) {
        self.timing.overruns = self.timing.overruns.saturating_add(ticks);
    }

    /// Allows the clock to run up to, not including, this tick.
    pub fn grant(&mut self, until_tick: u32) {
        self.until_tick = until_tick;
        self.clock_told = false;
    }

    /// Whether the clock is granted and its credit is used up.
    #[must_use]
    pub fn stands(&self, next_tick: u32) -> bool {
        self.clock == Clock::Granted && next_tick >= self.until_tick
    }

    /// Whether the host must still be told that the credit is used up; true once for each grant.
    pub fn tells_clock(&mut self) -> bool {
        !core::mem::replace(&mut self.clock_told, true)
    }

    /// The simulated plant.
    #[must_use]
    pub fn plant(&self) -> Option<&Plant<S, L>> {
        self.plant.as_ref()
    }

    fn change(&mut self, change: impl FnOnce(&mut Plant<S, L>)) -> Result<Simulated, Rejected> {
        match &mut self.plant {
            Some(plant) => {
                change(plant);
                Ok(Simulated::PlantChanged)
            }
            None => Err(Rejected::not_here("set the simulated plant before a change of it")),
        }
    }

    /// The simulated plant, to inject faults.
    pub fn plant_mut(&mut self) -> Option<&mut Plant<S, L>> {
        self.plant.as_mut()
    }
}

impl<S: PlantScalar, L: Load<S>> Board for SimulatedBoard<S, L> {
    const PLANT: PlantKind = S::KIND;

    fn clock(&self) -> Clock {
        self.clock
    }

    fn samples(&mut self, rig: &Rig) -> Option<Sensors> {
        (!self.stands(rig.next_tick())).then_some(self.sensors)
    }

    fn set(&mut self, actuators: &Actuators, rig: &Rig) {
        let Some(plant) = &mut self.plant else { return };
        if let Some(point) = rig.begins_from_rest() {
            plant.restart(point);
        }
        self.sensors = plant.tick_on(actuators, &rig.settings().calibration);
    }

    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected> {
        let saved = self.records.hold(settings).map(|()| Saving::Done);
        saved.ok_or(Rejected::not_here("the settings are longer than a record"))
    }

    fn stored_settings(&mut self, page: u8, from: u16) -> StoredPart {
        self.records.part(page, from)
    }

    fn can_start(&self) -> Result<(), Rejected> {
        match self.plant {
            Some(_) => Ok(()),
            None => Err(Rejected::not_here("this board is simulated: set its plant before starting")),
        }
    }

    /// Resets the plant. Credit and a deferred request refer to the earlier count of ticks and are dropped.
    fn started(&mut self) {
        if let Some(plant) = &mut self.plant {
            plant.restart(0);
        }
        self.deferred = None;
        self.until_tick = 0;
        self.clock_told = true;
        // The friction damper's seat keeps its position.
        let Sensors { readings: Readings { spring_n, spring_rail, .. }, at_limit, emergency_stop, .. } = self.sensors;
        self.sensors = Sensors { at_limit, emergency_stop, ..Sensors::default() };
        (self.sensors.readings.spring_n, self.sensors.readings.spring_rail) = (spring_n, spring_rail);
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn simulate(&mut self, message: &[u8], rig: &Rig) -> Result<Simulated, Rejected> {
        match ToSimulator::decode(message)? {
            ToSimulator::SetPlant(config) => {
                rig.must_be_idle()?;
                self.plant = Some(Plant::with_load(&config)?);
                Ok(Simulated::PlantReplaced)
            }
            ToSimulator::Inject(fault) => self.change(|plant| plant.inject(&fault)),
            ToSimulator::Place(bench) => self.change(|plant| plant.place(&bench)),
            ToSimulator::Blow(blow) => self.change(|plant| plant.blow(&blow)),
        }
    }

    fn defer(&mut self, request: &NumberedRequest) -> Result<(), Rejected> {
        if self.clock == Clock::RealTime {
            return Err(Rejected::not_here("only a board with a granted clock lets a request wait for its tick"));
        }
        match &self.deferred {
            // A copy of the deferred request.
            Some(waiting) if waiting.seq == request.seq => {}
            Some(_) => return Err(Rejected::not_here("another request already waits for its tick")),
            None => self.deferred = Some(request.clone()),
        }
        Ok(())
    }

    fn due(&mut self, next_tick: u32) -> Option<NumberedRequest> {
        self.deferred.take_if(|request| request.at_tick.is_none_or(|at| at <= next_tick))
    }
}
