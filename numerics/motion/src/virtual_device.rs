//! The device of the virtual rig, whose plant may have a structure with several places.

use std::sync::{Arc, Mutex, PoisonError};

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{Joined, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::{Invalid, require};
use damprig_core::model::{Initial, SetUp};
use damprig_core::settings::Settings;
use damprig_device::board::DeviceInfo;
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::plant::{Load, PlantConfig};

use super::placed_motion::PlacedStructure;
use super::rig_model::{RigModel, RigMotion};

/// Structures that set-ups of this process have, by number: messages to the simulated rig have no room for one.
static STRUCTURES: Mutex<Vec<Arc<PlacedStructure>>> = Mutex::new(Vec::new());

/// The number by which a virtual rig of this process finds a structure.
#[must_use]
pub fn number_of_structure(placed: &Arc<PlacedStructure>) -> u32 {
    // No thread leaves the list in disorder when it panics.
    let mut all = STRUCTURES.lock().unwrap_or_else(PoisonError::into_inner);
    let known = all.iter().position(|other| other == placed);
    let number = known.unwrap_or_else(|| {
        all.push(Arc::clone(placed));
        all.len() - 1
    });
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// The model of a plant.
fn model_of(config: &PlantConfig) -> Result<RigModel, Invalid> {
    let Some(number) = config.other_structure else { return Ok(config.set_up.into()) };
    let all = STRUCTURES.lock().unwrap_or_else(PoisonError::into_inner);
    let placed = usize::try_from(number).ok().and_then(|number| all.get(number)).cloned();
    require(placed.is_some(), "plant", f64::from(number), "the number of a structure of this process")?;
    Ok(RigModel { set_up: config.set_up, placed })
}

impl Load<f64> for RigMotion {
    fn steps_per_sample(config: &PlantConfig, sample_s: f64) -> Result<u8, Invalid> {
        model_of(config)?.steps_per_sample(sample_s)
    }

    fn mounted(config: &PlantConfig, units: Units) -> Result<Self, Invalid> {
        model_of(config)?.motion(units.step_s, &config.initial())
    }

    fn restart(&mut self, initial: &Initial) {
        Self::restart(self, initial);
    }

    fn set_friction_n(&mut self, force_n: f64, set_up: &SetUp) {
        Self::set_friction_n(self, force_n, set_up);
    }

    fn step(&mut self, base: &BaseSegment<f64>, observer: &mut impl SampledObserver<f64>) {
        Self::step(self, base, observer);
    }

    fn x(&self) -> f64 {
        self.x_m()
    }

    fn momentum(&self) -> f64 {
        match self {
            Self::OneDegree(motion) => motion.momentum(),
            Self::Placed(motion) => motion.momentum(),
        }
    }

    fn momentum_after(&mut self, base: &BaseSegment<f64>) -> f64 {
        match self {
            Self::OneDegree(motion) => motion.momentum_after(base),
            Self::Placed(motion) => motion.momentum_after(base),
        }
    }

    fn mass(&self) -> f64 {
        match self {
            Self::OneDegree(motion) => motion.mass(),
            Self::Placed(motion) => motion.mass(),
        }
    }

    fn stuck_mass(&self) -> Option<f64> {
        if let Self::OneDegree(motion) = self { Joined::stuck_mass(motion) } else { None }
    }
}

/// A device in single or double precision. Its functions are compiled with this crate, so that a debug build of the
/// host still runs it optimised.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // The caller boxes it.
pub enum VirtualDevice {
    /// Single precision, as on the emulated board.
    Single(SimulatedDevice<f32>),
    /// Double precision.
    Double(SimulatedDevice<f64, RigMotion>),
}

impl VirtualDevice {
    /// An idle device without a plant, whose clock is granted.
    #[must_use]
    pub fn granted(single: bool, info: DeviceInfo) -> Self {
        if single { Self::Single(SimulatedDevice::granted(info)) } else { Self::Double(SimulatedDevice::granted(info)) }
    }

    /// An idle device at the rig of the source document, with its own clock.
    #[must_use]
    pub fn real_time(single: bool, info: DeviceInfo) -> Self {
        if single {
            Self::Single(SimulatedDevice::with_clock(info))
        } else {
            Self::Double(SimulatedDevice::with_clock(info))
        }
    }

    /// See [`SimulatedDevice::start_with`].
    pub fn start_with(&mut self, settings: &Settings) {
        match self {
            Self::Single(device) => device.start_with(settings),
            Self::Double(device) => device.start_with(settings),
        }
    }

    /// See [`SimulatedDevice::lose_ticks`].
    pub fn lose_ticks(&mut self, ticks: u32) {
        match self {
            Self::Single(device) => device.lose_ticks(ticks),
            Self::Double(device) => device.lose_ticks(ticks),
        }
    }

    /// See [`SimulatedDevice::receive`].
    pub fn receive(&mut self, bytes: &[u8]) {
        match self {
            Self::Single(device) => device.receive(bytes),
            Self::Double(device) => device.receive(bytes),
        }
    }

    /// See [`SimulatedDevice::run`].
    pub fn run(&mut self, most_ticks: u32, out: &mut dyn FnMut(&[u8])) -> Progress {
        match self {
            Self::Single(device) => device.run(most_ticks, out),
            Self::Double(device) => device.run(most_ticks, out),
        }
    }
}
