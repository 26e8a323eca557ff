//! The simulated rig: a plant and its sensors, with the same [`Sensors`] and [`Actuators`] as a real rig.
//!
//! The base either follows the drive exactly (prescribed motion) or is the table of a [`shaker`] that feels its load
//! ([`table`]). The displacement [`sensors`] are ideal or have a data sheet. If so configured, the [`walls`] have
//! force sensors and the friction damper has its stepper and [`spring`]. The virtual rig runs the plant in `f64`, the
//! emulated board in `f32`. [`damprig_core::integrator`] integrates the motion of structure and damper; a host may put another structure
//! on the base ([`load`]).

pub mod bench;
pub mod faults;
pub mod load;
mod noise;
mod sampler;
pub mod sensors;
pub mod shaker;
pub mod spring;
pub mod table;
pub mod walls;

pub use bench::{Bench, Blow, Target, TrueScales};
pub use faults::{End, InjectedFault, SensorFault, Supply};
pub use load::Load;
pub use sensors::{DataSheet, SensorModel};
pub use shaker::{Amplifier, Shaker};

use damprig_core::integrator::base::{BaseSegment, BaseTrack};
use damprig_core::integrator::polynomial;
use damprig_core::integrator::sampled::Joined;
use damprig_core::integrator::units::Units;
use damprig_core::io::{
    Actuators, Calibration, Invalid, Reading, Readings, SUBSAMPLES, Sensor, Sensors, TICK_HZ, Usable, WALL_SUBSAMPLES,
    WallCounts, require,
};
use damprig_core::model::{Initial, SetUp, Structure};
use damprig_core::scalar::Scalar;
use faults::{Faults, Span};
use heapless::Vec;
use noise::Noise;
use postcard_schema::Schema;
use sampler::{Pressed, Sampler};
use sensors::Channel;
use serde::{Deserialize, Serialize};
use spring::{SimulatedSpring, SpringPlant};
use table::Table;
use walls::{WallSensors, Walls};

/// What moves the structure's base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum Base {
    /// The base follows the drive exactly, one tick late, whatever force the structure exerts.
    #[default]
    Prescribed,
    /// A shaker that feels the structure's load. The drive is held over each tick.
    Shaker(Shaker),
}

/// Configuration of a simulated plant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PlantConfig {
    /// The mechanical set-up.
    pub set_up: SetUp,
    /// Initial displacement x0 of the structure, from which it is released, m.
    pub structure_start_m: f64,
    /// Initial y − x of the particle, m; between the walls.
    pub particle_start_m: f64,
    /// What moves the base.
    pub base: Base,
    /// Both displacement sensors.
    pub sensors: SensorModel,
    /// Imperfections of the displacement sensors; `None` for ideal sensors.
    pub data_sheet: Option<DataSheet>,
    /// Force sensors of the walls; `None` if the walls have none.
    pub walls: Option<WallSensors>,
    /// Drive and spring of the friction damper, whose force replaces that of the set-up; `None` for a constant force.
    pub spring: Option<SpringPlant>,
    /// True scales of the sensors and of the drive; `None` if every board's settings are right.
    pub scales: Option<TrueScales>,
    /// Number of a structure that stands on the base in place of the set-up's, where the host and the simulated rig share one process; the
    /// set-up is then what the board knows of it. `None` for the set-up's.
    pub other_structure: Option<u32>,
}

impl PlantConfig {
    /// A set-up with ideal sensors on a base that follows the drive, with the particle in the middle of its cavity.
    #[must_use]
    pub fn ideal(set_up: SetUp) -> Self {
        Self {
            set_up,
            structure_start_m: 0.0,
            particle_start_m: set_up.neutral().y_m,
            base: Base::Prescribed,
            sensors: SensorModel::default(),
            data_sheet: None,
            walls: None,
            spring: None,
            scales: None,
            other_structure: None,
        }
    }

    /// The rig of the source document without a damper, at rest: structure and shaker, sensors as their data sheets say,
    /// force sensors at the walls, and the drive of the friction spring.
    #[must_use]
    pub fn source_document() -> Self {
        Self {
            base: Base::Shaker(Shaker::default()),
            data_sheet: Some(DataSheet::default()),
            walls: Some(WallSensors::default()),
            spring: Some(SpringPlant::default()),
            ..Self::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)))
        }
    }

    /// Where structure and particle start.
    #[must_use]
    pub fn initial(&self) -> Initial {
        Initial {
            x_m: self.structure_start_m,
            y_m: self.structure_start_m + self.particle_start_m,
            ..Initial::default()
        }
    }
}

/// The simulated rig; `L` is what stands on its base.
#[derive(Clone, Debug)]
pub struct Plant<S, L = Joined<S>> {
    config: PlantConfig,
    motion: L,
    steps: u8,
    base: Moving<S>,
    channels: [Channel; 2],
    noise: Noise,
    impacts: u32,
    walls: Option<Walls>,
    spring: Option<SimulatedSpring>,
    faults: Faults,
    bench: Bench,
    /// Impulse per unit of the structure's change of velocity, N·s.
    impulse_per_kick: f32,
    /// Force of a soft wall per unit of the integrator's, N; `None` for hard walls.
    force_per_unit_n: Option<f32>,
    /// Forces of soft walls in the last tick, N.
    pressed_n: Option<[[f32; 2]; WALL_SUBSAMPLES]>,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
enum Moving<S> {
    Prescribed(BaseTrack<S>),
    Shaken(Table<S>),
}

impl<S: Scalar> Plant<S> {
    /// Makes a plant at rest, whose structure has one degree of freedom.
    ///
    /// # Errors
    /// As [`Plant::with_load`].
    pub fn new(config: &PlantConfig) -> Result<Self, Invalid> {
        Self::with_load(config)
    }
}

impl<S: Scalar, L: Load<S>> Plant<S, L> {
    /// Makes a plant at rest.
    ///
    /// # Errors
    /// A value is not physical, or its motion is too fast for the tick; the error names it.
    pub fn with_load(config: &PlantConfig) -> Result<Self, Invalid> {
        config.set_up.validate()?;
        config.sensors.validate()?;
        if let Some(sheet) = &config.data_sheet {
            sheet.validate()?;
        }
        if let Some(scales) = &config.scales {
            scales.validate()?;
        }
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let mut steps = L::steps_per_sample(config, tick_s)?;
        if let Base::Shaker(shaker) = &config.base {
            shaker.validate()?;
            let allowed = "left out with a force drive, whose base rests";
            require(!config.set_up.is_force_driven, "shaker.moving_mass_kg", shaker.moving_mass_kg, allowed)?;
            steps = steps.max(Table::<S>::steps_per_sample(shaker, tick_s)?);
        }
        let units = Units::metres(tick_s / f64::from(steps));
        let motion = L::mounted(config, units)?;
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
            bench: Bench::default(),
            impulse_per_kick: (config.set_up.structure.mass_kg * units.velocity_m_per_s()) as f32,
            pressed_n: None,
            force_per_unit_n: config
                .set_up
                .has_soft_walls()
                .then(|| (config.set_up.structure.mass_kg * units.velocity_m_per_s() / units.step_s) as f32),
        };
        if let (Some(walls), Some(scales)) = (&mut plant.walls, &config.scales) {
            walls.set_scales(scales.walls);
        }
        plant.press();
        Ok(plant)
    }

    /// Sets the friction damper's force to that of its spring.
    fn press(&mut self) {
        if let Some(spring) = &self.spring {
            self.motion.set_friction_n(f64::from(spring.friction_force_n()), &self.config.set_up);
        }
    }

    /// The friction damper's drive and spring.
    pub fn spring_mut(&mut self) -> Option<&mut SimulatedSpring> {
        self.spring.as_mut()
    }

    /// Injects a fault, or ends it.
    pub fn inject(&mut self, fault: &InjectedFault) {
        if let Some(broken) = self.faults.inject(fault)
            && let Some(spring) = &mut self.spring
        {
            spring.broken = broken;
        }
    }

    /// Puts targets before the displacement sensors and weights on the force sensor.
    pub fn place(&mut self, bench: &Bench) {
        self.bench = *bench;
        if let Some(spring) = &mut self.spring {
            spring.hang(bench.spring_n);
        }
    }

    /// Hits a wall at the start of the next tick.
    pub fn blow(&mut self, blow: &Blow) {
        if let Some(walls) = &mut self.walls {
            walls.hit(0.0, blow.side, blow.impulse_n_s);
        }
    }

    /// Resets the motion to its start; the friction damper's seat keeps its position. `stream` selects one of several
    /// independent noises of the same seed, so that a point's noise does not depend on what was measured before it.
    pub fn restart(&mut self, stream: u16) {
        self.motion.restart(&self.config.initial());
        match &mut self.base {
            Moving::Prescribed(track) => *track = BaseTrack::default(),
            Moving::Shaken(table) => table.reset(),
        }
        let [x_channel, z_channel] = &mut self.channels;
        x_channel.reset(self.config.initial().x_m as f32);
        z_channel.reset(0.0);
        self.noise = Noise::new(self.config.sensors.seed, stream);
        if let Some(walls) = &mut self.walls {
            walls.restart(self.config.sensors.seed, stream);
        }
        self.impacts = 0;
        self.pressed_n = None;
    }

    /// Number of impacts since the last restart.
    #[must_use]
    pub fn impacts(&self) -> u32 {
        self.impacts
    }

    /// What stands on the base, for tests and predictions.
    #[must_use]
    pub fn motion(&self) -> &L {
        &self.motion
    }

    /// Number of steps since the last restart in which the shaker's amplifier or stroke was at its limit.
    #[must_use]
    pub fn limited(&self) -> u32 {
        match &self.base {
            Moving::Prescribed(_) => 0,
            Moving::Shaken(table) => table.limited(),
        }
    }

    /// Advances one tick under the actuators' demands and returns what the sensors then read.
    pub fn tick(&mut self, actuators: &Actuators) -> Sensors {
        let (mut sensors, Samples { x_m, z_m, spring_n }) = self.sample(actuators);
        let [x_range_m, z_range_m] = self.config.sensors.range_m;
        let [x, z] = [(&x_m, x_range_m), (&z_m, z_range_m)]
            .map(|(block, range_m)| Reading::within(block, &Usable::of_span(-range_m, range_m)));
        let span_n = self.spring_span_n();
        sensors.readings = Readings::new(x, z, &spring_n, &Usable::of_span(span_n.0, span_n.1));
        sensors
    }

    /// As [`Plant::tick`] on a board with these settings, which act on the counts of sensors with true scales.
    pub fn tick_on(&mut self, actuators: &Actuators, settings: &Calibration) -> Sensors {
        let Some(scales) = self.config.scales else { return self.tick(actuators) };
        let driven = Actuators { drive_m: scales.driven_m(actuators.drive_m, settings), ..*actuators };
        let (mut sensors, Samples { x_m, z_m, spring_n }) = self.sample(&driven);
        sensors.readings = settings.readings(&scales.counts(&x_m, &z_m, &spring_n));
        sensors
    }

    /// Lowest and highest reading of the spring's force sensor, N.
    fn spring_span_n(&self) -> (f32, f32) {
        let assumed = || (SpringPlant::default().lowest_n, SpringPlant::default().highest_n);
        self.spring.as_ref().map_or_else(assumed, SimulatedSpring::sensor_span_n)
    }

    /// Advances one tick and returns what the sensors give, before it is reduced to readings.
    fn sample(&mut self, actuators: &Actuators) -> (Sensors, Samples) {
        let (x, z) = self.advance(actuators);
        let of_m = |position_m: f32| S::from_f64(f64::from(position_m));
        let (x, z) = (self.bench.x.seen(x, z, of_m), self.bench.z.seen(z, z, of_m));
        let mut sensors = Sensors { emergency_stop: self.faults.emergency_stop, ..Sensors::default() };
        let (mut x_m, mut z_m, mut spring_n) = ([0.0; SUBSAMPLES], [0.0; SUBSAMPLES], [0.0; SUBSAMPLES]);
        let span_n = self.spring_span_n();
        if let Some(spring) = &mut self.spring {
            (spring_n, sensors.at_limit) = spring.tick(actuators.motor);
            if actuators.motor.steps != 0 {
                self.press();
            }
        }
        if let Some(walls) = &mut self.walls {
            sensors.walls = walls.read(self.pressed_n.as_ref());
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
        (sensors, Samples { x_m, z_m, spring_n })
    }

    /// Advances the motion by one tick; returns x and z at the sub-sample instants, m.
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
            pressed: self.force_per_unit_n.map(|_| Pressed { forces: [[S::ZERO; 2]; WALL_SUBSAMPLES], taken: 0 }),
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
        // Rounding of the instants can leave the last sample just after the end of the last flight.
        for sample in &mut sampler.x[sampler.taken..] {
            *sample = self.motion.x();
        }
        self.impacts = self.impacts.wrapping_add(sampler.impacts);
        if let Some(walls) = &mut self.walls {
            for hit in &sampler.hits {
                let at = (hit.at / sampler.steps).to_f64() as f32;
                walls.hit(at, hit.side, hit.kick.to_f64() as f32 * self.impulse_per_kick);
            }
            if let Some((pressed, per_unit_n)) = sampler.pressed.as_ref().zip(self.force_per_unit_n) {
                let forces = pressed.forces.map(|pair| pair.map(|force| force.to_f64() as f32 * per_unit_n));
                self.pressed_n = Some(forces);
            }
        }
        (sampler.x, z)
    }
}

/// One tick's samples of the slow sensors.
struct Samples {
    x_m: [f32; SUBSAMPLES],
    z_m: [f32; SUBSAMPLES],
    spring_n: [f32; SUBSAMPLES],
}

fn displacement<S: Scalar>(segment: &BaseSegment<S>, t: S) -> S {
    segment.0[0] + polynomial::increment(&segment.0, t)
}
