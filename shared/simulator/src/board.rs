//! A simulated board: the control loop's outputs drive a simulated plant, and its ticks pass under the host's tick credit.
//!
//! Device time advances only as far as the host has granted ([`ToDevice::Grant`](damprig_protocol::ToDevice::Grant)).
//! Without credit the clock is stopped: requests are served at once, and all queued messages are sent. So nothing
//! that a host can observe depends on how fast either side runs, and a run repeats bit for bit.

use damprig_core::io::{Actuators, Readings, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::scalar::Scalar;
use damprig_core::settings::Settings;
use damprig_device::board::{Board, Saving};
use damprig_protocol::{Clock, NumberedRequest, PlantKind};

use crate::messages::ToSimulator;
use crate::plant::Plant;

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

/// The simulated board; new, it has no plant and no credit.
#[derive(Debug)]
pub struct SimulatedBoard<S> {
    plant: Option<Plant<S>>,
    sensors: Sensors,
    /// The first tick that may not run yet.
    until_tick: u32,
    /// Whether the host has been told that the credit is used up.
    clock_told: bool,
    /// A request that waits for its tick.
    deferred: Option<NumberedRequest>,
}

impl<S> Default for SimulatedBoard<S> {
    fn default() -> Self {
        Self { plant: None, sensors: Sensors::default(), until_tick: 0, clock_told: true, deferred: None }
    }
}

impl<S: PlantScalar> SimulatedBoard<S> {
    /// Allows the clock to run up to, not including, this tick.
    pub fn grant(&mut self, until_tick: u32) {
        self.until_tick = until_tick;
        self.clock_told = false;
    }

    /// Whether the credit is used up.
    #[must_use]
    pub fn stands(&self, next_tick: u32) -> bool {
        next_tick >= self.until_tick
    }

    /// Whether the host must still be told that the credit is used up; true once for each grant.
    pub fn tells_clock(&mut self) -> bool {
        !core::mem::replace(&mut self.clock_told, true)
    }

    /// The simulated plant.
    #[must_use]
    pub fn plant(&self) -> Option<&Plant<S>> {
        self.plant.as_ref()
    }

    /// The simulated plant, to inject faults.
    pub fn plant_mut(&mut self) -> Option<&mut Plant<S>> {
        self.plant.as_mut()
    }
}

impl<S: PlantScalar> Board for SimulatedBoard<S> {
    const PLANT: PlantKind = S::KIND;
    const CLOCK: Clock = Clock::Granted;

    fn samples(&mut self, rig: &Rig) -> Option<Sensors> {
        (!self.stands(rig.next_tick())).then_some(self.sensors)
    }

    fn set(&mut self, actuators: &Actuators, rig: &Rig) {
        let Some(plant) = &mut self.plant else { return };
        if let Some(point) = rig.begins_from_rest() {
            plant.restart(point);
        }
        self.sensors = plant.tick(actuators);
    }

    /// The settings stay in use while the board exists: the controller holds them.
    fn save(&mut self, _: &Settings) -> Result<Saving, Rejected> {
        Ok(Saving::Done)
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

    fn simulate(&mut self, message: &[u8]) -> Result<(), Rejected> {
        match ToSimulator::decode(message)? {
            ToSimulator::SetPlant(config) => self.plant = Some(Plant::new(&config)?),
            ToSimulator::Inject(fault) => match &mut self.plant {
                Some(plant) => plant.inject(&fault),
                None => return Err(Rejected::not_here("set the simulated plant before a fault in it")),
            },
        }
        Ok(())
    }

    fn defer(&mut self, request: &NumberedRequest) -> Result<(), Rejected> {
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
