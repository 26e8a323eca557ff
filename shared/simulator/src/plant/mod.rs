//! The simulated rig: a plant and its sensors behind the same [`Sensors`] and [`Actuators`] as a real one.
//!
//! The base follows the drive exactly (prescribed motion) or is the table of a [`shaker`] that feels its load
//! ([`table`]); the [`sensors`] are ideal or have a data sheet; the [`walls`] have force sensors and the friction damper
//! its stepper and [`spring`] if so configured. The virtual rig runs it in `f64`, the emulated board in `f32`. What moves
//! on the base is [`damprig_core::integrator`]'s business.

pub mod faults;
mod noise;
pub mod sensors;
pub mod shaker;
pub mod spring;
pub mod table;
pub mod walls;

pub use faults::{End, InjectedFault, SensorFault, Supply};
pub use sensors::{DataSheet, SensorModel};
pub use shaker::{Amplifier, Shaker};

use damprig_core::integrator::base::{BaseSegment, BaseTrack};
use damprig_core::integrator::polynomial;
use damprig_core::integrator::sampled::{Flight, Impact, Observer, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::io::{
    Actuators, Invalid, Reading, Readings, SUBSAMPLES, Sensor, Sensors, TICK_HZ, Usable, WallCounts,
};
use damprig_core::model::{Initial, SetUp};
use damprig_core::scalar::Scalar;
use faults::{Faults, Span};
use heapless::Vec;
use noise::Noise;
use postcard_schema::Schema;
use sensors::Channel;
use serde::{Deserialize, Serialize};
use spring::{SimulatedSpring, SpringPlant};
use table::Table;
use walls::{WallSensors, Walls};

/// Impacts of one tick that the force sensors see; a chatter may have more, each weaker than the last.
const MOST_IMPACTS: usize = 8;

/// What moves the structure's base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Base {
    /// It follows the drive exactly, one tick late, whatever the structure does.
    #[default]
    Prescribed,
    /// A shaker whose table the structure pulls on; the drive is held over each tick.
    Shaker(Shaker),
}

/// What a simulated plant is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PlantConfig {
    /// The mechanical set-up.
    pub set_up: SetUp,
    /// The structure's starting place x0, from which it is released, m.
    pub structure_start_m: f64,
    /// The particle's starting place relative to the middle of its cavity, m; |start| ≤ clearance.
    pub particle_start_m: f64,
    /// What moves the base.
    pub base: Base,
    /// Both displacement sensors.
    pub sensors: SensorModel,
    /// What their data sheet admits; none for ideal sensors.
    pub data_sheet: Option<DataSheet>,
    /// The walls' force sensors; none for walls that nobody listens to.
    pub walls: Option<WallSensors>,
    /// What presses the friction damper's block; its force takes the place of the set-up's. None for a constant force.
    pub spring: Option<SpringPlant>,
}

impl PlantConfig {
    /// A set-up with ideal sensors on a base that follows the drive, the particle in the middle of its cavity.
    #[must_use]
    pub fn ideal(set_up: SetUp) -> Self {
        Self {
            set_up,
            structure_start_m: 0.0,
            particle_start_m: 0.0,
            base: Base::Prescribed,
            sensors: SensorModel::default(),
            data_sheet: None,
            walls: None,
            spring: None,
        }
    }

    fn initial(&self) -> Initial {
        Initial {
            x_m: self.structure_start_m,
            y_m: self.structure_start_m + self.particle_start_m,
            ..Initial::default()
        }
    }
}

/// The simulated rig.
#[derive(Clone, Debug)]
pub struct Plant<S> {
    config: PlantConfig,
    motion: Sampled<S>,
    steps: u8,
    base: Moving<S>,
    channels: [Channel; 2],
    noise: Noise,
    impacts: u32,
    walls: Option<Walls>,
    spring: Option<SimulatedSpring>,
    faults: Faults,
    /// N·s per unit of the structure's change of velocity.
    impulse_per_kick: f32,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
enum Moving<S> {
    Prescribed(BaseTrack<S>),
    Shaken(Table<S>),
}

impl<S: Scalar> Plant<S> {
    /// A plant at rest.
    ///
    /// # Errors
    /// Names a value that is not physical, or too fast for the tick.
    pub fn new(config: &PlantConfig) -> Result<Self, Invalid> {
        config.set_up.validate()?;
        config.sensors.validate()?;
        if let Some(sheet) = &config.data_sheet {
            sheet.validate()?;
        }
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let mut steps = Sampled::<S>::steps_per_sample(&config.set_up, tick_s)?;
        if let Base::Shaker(shaker) = &config.base {
            shaker.validate()?;
            steps = steps.max(Table::<S>::steps_per_sample(shaker, tick_s)?);
        }
        let units = Units::metres(tick_s / f64::from(steps));
        let motion = Sampled::new(&config.set_up, units, &config.initial())?;
        let base = match &config.base {
            Base::Prescribed => Moving::Prescribed(BaseTrack::default()),
            Base::Shaker(shaker) => Moving::Shaken(Table::new(shaker, &config.set_up, &units)),
        };
        let sheet = config.data_sheet.as_ref();
        let channels = [false, true].map(|late| Channel::new(&config.sensors, sheet, late));
        let noise = Noise::new(config.sensors.seed, 0);
        let seed = config.sensors.seed;
        let mut plant = Self {
            config: *config,
            motion,
            steps,
            base,
            channels,
            noise,
            impacts: 0,
            walls: config.walls.as_ref().map(|walls| Walls::new(walls, seed)).transpose()?,
            spring: config.spring.as_ref().map(SimulatedSpring::new).transpose()?,
            faults: Faults::new(seed),
            impulse_per_kick: (config.set_up.structure.mass_kg * units.velocity_m_per_s()) as f32,
        };
        plant.press();
        Ok(plant)
    }

    /// The friction damper's force becomes what its spring gives.
    fn press(&mut self) {
        if let Some(spring) = &self.spring {
            self.motion.set_damper_force_n(f64::from(spring.friction_force_n()), &self.config.set_up);
        }
    }

    /// The friction damper's drive and spring.
    pub fn spring_mut(&mut self) -> Option<&mut SimulatedSpring> {
        self.spring.as_mut()
    }

    /// Injects a fault, or ends it.
    pub fn inject(&mut self, fault: &InjectedFault) {
        match *fault {
            InjectedFault::Sensor { sensor, fault } => self.faults.set(sensor, fault),
            InjectedFault::Supply { supply, on } => self.faults.set_supply(supply, on),
            InjectedFault::EmergencyStop { pressed } => self.faults.emergency_stop = pressed,
            InjectedFault::SpringDrive(broken) => {
                if let Some(spring) = &mut self.spring {
                    spring.broken = broken;
                }
            }
        }
    }

    /// Puts the motion back to its start; the friction damper's seat stays where it is. `stream` chooses among
    /// independent noises of the same seed: a point's noise is its own, whatever was measured before it.
    pub fn restart(&mut self, stream: u16) {
        self.motion.reset(&self.config.initial());
        match &mut self.base {
            Moving::Prescribed(track) => *track = BaseTrack::default(),
            Moving::Shaken(table) => table.reset(),
        }
        for channel in &mut self.channels {
            channel.reset();
        }
        self.noise = Noise::new(self.config.sensors.seed, stream);
        if let Some(walls) = &mut self.walls {
            walls.restart(self.config.sensors.seed, stream);
        }
        self.impacts = 0;
    }

    /// Impacts since the last restart.
    #[must_use]
    pub fn impacts(&self) -> u32 {
        self.impacts
    }

    /// The motion itself, for tests and predictions.
    #[must_use]
    pub fn motion(&self) -> &Sampled<S> {
        &self.motion
    }

    /// Steps since the last restart in which the shaker's amplifier or stroke was at its limit.
    #[must_use]
    pub fn limited(&self) -> u32 {
        match &self.base {
            Moving::Prescribed(_) => 0,
            Moving::Shaken(table) => table.limited(),
        }
    }

    /// One tick: what the actuators ask for in, what the sensors then read out.
    pub fn tick(&mut self, actuators: &Actuators) -> Sensors {
        let (x, z) = self.advance(actuators);
        let mut sensors = Sensors { emergency_stop: self.faults.emergency_stop, ..Sensors::default() };
        let (mut x_m, mut z_m, mut spring_n) = ([0.0; SUBSAMPLES], [0.0; SUBSAMPLES], [0.0; SUBSAMPLES]);
        let mut span_n = (SpringPlant::default().lowest_n, SpringPlant::default().highest_n);
        if let Some(spring) = &mut self.spring {
            span_n = spring.sensor_span_n();
            (spring_n, sensors.at_limit) = spring.tick(actuators.motor);
            if actuators.motor.steps != 0 {
                self.press();
            }
        }
        if let Some(walls) = &mut self.walls {
            sensors.walls = walls.read();
        }
        let [x_channel, z_channel] = &mut self.channels;
        for n in 0..SUBSAMPLES {
            x_m[n] = x_channel.read(x[n].to_f64() as f32, &mut self.noise);
            z_m[n] = z_channel.read(z[n].to_f64() as f32, &mut self.noise);
        }
        let [x_range_m, z_range_m] = self.config.sensors.range_m;
        let si = |low, high| Span { low, high, per_unit: 1.0 };
        for (sensor, block, span) in [
            (Sensor::X, &mut x_m, si(-x_range_m, x_range_m)),
            (Sensor::Z, &mut z_m, si(-z_range_m, z_range_m)),
            (Sensor::SpringForce, &mut spring_n, si(span_n.0, span_n.1)),
        ] {
            if self.faults.has(sensor) {
                block.iter_mut().for_each(|sample| *sample = self.faults.apply(sensor, *sample, span));
            }
        }
        let walls = self.config.walls.unwrap_or_default();
        let counts =
            Span { low: 0.0, high: f32::from(walls.highest_counts), per_unit: 1.0 / walls.scale.newtons_per_count };
        for (wall, sensor) in [Sensor::WallLow, Sensor::WallHigh].into_iter().enumerate() {
            if self.faults.has(sensor) {
                for pair in &mut sensors.walls {
                    let mut both = [pair.of(0), pair.of(1)];
                    both[wall] = self.faults.apply(sensor, f32::from(both[wall]), counts) as u16;
                    *pair = WallCounts::new(both[0], both[1]);
                }
            }
        }
        let [x, z] = [(&x_m, x_range_m), (&z_m, z_range_m)]
            .map(|(block, range_m)| Reading::within(block, &Usable::of_span(-range_m, range_m)));
        sensors.readings = Readings::new(x, z, &spring_n, &Usable::of_span(span_n.0, span_n.1));
        sensors
    }

    /// One tick of motion: x and z at the sub-sample instants, m.
    pub fn advance(&mut self, actuators: &Actuators) -> ([S; SUBSAMPLES], [S; SUBSAMPLES]) {
        let is_driven = actuators.drive_enabled && !self.faults.amplifier_off;
        let drive = if is_driven { actuators.drive_m } else { 0.0 };
        let drive = S::from_f64(f64::from(drive));
        let tenth = S::ONE / S::from_u8(SUBSAMPLES as u8);
        let mut sampler = Sampler {
            x: [S::ZERO; SUBSAMPLES],
            taken: 0,
            step: S::ZERO,
            steps: S::from_u8(self.steps),
            impacts: 0,
            hits: Vec::new(),
        };
        let z = match &mut self.base {
            Moving::Prescribed(track) => {
                let whole = track.push(drive);
                for part in 0..self.steps {
                    sampler.step = S::from_u8(part);
                    self.motion.step(&whole.part(part, self.steps), &mut sampler);
                }
                core::array::from_fn(|n| displacement(&whole, S::from_u8(n as u8 + 1) * tenth))
            }
            Moving::Shaken(table) => {
                let (mut z, mut taken) = ([table.z(); SUBSAMPLES], 0);
                for part in 0..self.steps {
                    sampler.step = S::from_u8(part);
                    let segment = table.step(&mut self.motion, drive, &mut sampler);
                    while taken < SUBSAMPLES {
                        let since = S::from_u8(taken as u8 + 1) * tenth * sampler.steps - sampler.step;
                        if since > S::ONE && part + 1 < self.steps {
                            break;
                        }
                        z[taken] = displacement(&segment, since);
                        taken += 1;
                    }
                }
                z
            }
        };
        // Rounding of the instants can leave the last sample just past the last flight.
        for sample in &mut sampler.x[sampler.taken..] {
            *sample = self.motion.state().x;
        }
        self.impacts = self.impacts.wrapping_add(sampler.impacts);
        if let Some(walls) = &mut self.walls {
            for hit in &sampler.hits {
                let at = (hit.at / sampler.steps).to_f64() as f32;
                walls.hit(at, hit.side, hit.kick.to_f64() as f32 * self.impulse_per_kick);
            }
        }
        (sampler.x, z)
    }
}

fn displacement<S: Scalar>(segment: &BaseSegment<S>, t: S) -> S {
    segment.0[0] + polynomial::increment(&segment.0, t)
}

/// Reads x off the flights at the sub-sample instants.
struct Sampler<S> {
    x: [S; SUBSAMPLES],
    taken: usize,
    step: S,
    steps: S,
    impacts: u32,
    hits: Vec<Impact<S>, MOST_IMPACTS>,
}

impl<S: Scalar> Observer<S> for Sampler<S> {
    fn flight(&mut self, start: S, length: S, flight: &Flight<S>) {
        let tenth = S::ONE / S::from_u8(SUBSAMPLES as u8);
        while self.taken < SUBSAMPLES {
            let instant = S::from_u8(self.taken as u8 + 1) * tenth * self.steps - self.step;
            let since = instant - start;
            if since > length {
                return;
            }
            self.x[self.taken] = flight.x[0] + polynomial::increment(&flight.x, since);
            self.taken += 1;
        }
    }

    fn impact(&mut self, impact: &Impact<S>) {
        self.impacts += 1;
        let _ = self.hits.push(Impact { at: self.step + impact.at, ..*impact });
    }
}
