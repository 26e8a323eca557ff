//! Simulated rig at the board's pins: shaker, structure, dampers and sensors, as specified in firmware/README.md.
//!
//! The motion is computed by the core's integrator in `f64` on a grid of [`GRID`], which is independent of the
//! program's ticks. The voltage at an analogue input is evaluated at the instant of its conversion by interpolation
//! between two grid points. Output changes take effect at the next grid point. At 3 Hz and 30 mm the error of the
//! linear interpolation is ω²A·GRID²/8 = 3 nm, a ten-thousandth of a converter step.

use std::collections::VecDeque;
use std::f64::consts::PI;

use damprig_core::integrator::base::{BaseSegment, BaseTrack};
use damprig_core::integrator::modes::Sign;
use damprig_core::integrator::polynomial::{Polynomial, increment};
use damprig_core::integrator::sampled::{Joined, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::{Calibration, Invalid, Sensor};
use damprig_core::model::Initial;
use damprig_core::settings::Settings;
use damprig_simulator::plant::faults::{Faults, Span};
use damprig_simulator::plant::spring::SimulatedSpring;
use damprig_simulator::plant::table::Table;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, InjectedFault, PlantConfig};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

use crate::time::Time;

/// Step of the integrator.
pub const GRID: Time = Time::from_us(50);

/// Reference voltage of the converters and the analogue output, V.
pub const REFERENCE_V: f64 = 3.3;

/// Full scale of a 12-bit code.
const FULL_SCALE: f64 = 4_095.0;

/// Conversions that the board adds to one sample of x, z and spring force; calibration counts refer to the sum.
const ADDED_UP: f64 = 16.0;

/// Smallest distance of a buffered output from the supply rails, V.
const BUFFER_HEADROOM_V: f64 = 0.2;

/// Number of grid points kept: 10 ms.
const KEPT: usize = 200;

/// Timing of the relay between the drive's output and the amplifier: an assumed signal relay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relay {
    /// Delay from coil on to contact closed.
    pub operate: Time,
    /// Delay from coil off to contact open.
    pub release: Time,
}

impl Default for Relay {
    fn default() -> Self {
        Self { operate: Time::from_ms(5), release: Time::from_ms(3) }
    }
}

/// True values at a grid point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Structure displacement, m.
    pub x_m: f64,
    /// Base displacement, m.
    pub z_m: f64,
    /// Force measured by the spring's sensor, N.
    pub spring_n: f64,
    /// Force of the soft walls at −d and +d, N; 0 for hard walls, whose impacts are pulses.
    pub walls_n: [f64; 2],
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
enum Moving {
    Prescribed(BaseTrack<f64>),
    Shaken(Table<f64>),
}

/// A half-sine force pulse at a wall's sensor.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    is_high: bool,
    start_s: f64,
    peak_n: f64,
}

/// The friction damper's drive and the lag of its force sensor.
#[derive(Clone, Debug)]
struct Spring {
    drive: SimulatedSpring,
    lag_s: f64,
    offset_n: f64,
    noise_rms_n: f64,
    lagged_n: f64,
}

/// First-order lags of a displacement channel: the sensor's response and the filter before the converter.
#[derive(Clone, Copy, Debug, Default)]
struct Lags {
    decay: [f64; 2],
    state: [f64; 2],
}

impl Lags {
    fn new(config: &PlantConfig) -> Self {
        let Some(sheet) = &config.data_sheet else { return Self::default() };
        let constants = [f64::from(sheet.response_s), 1.0 / (2.0 * PI * f64::from(sheet.anti_alias_hz))];
        let decay = constants.map(|constant| if constant > 0.0 { (-GRID.s() / constant).exp() } else { 0.0 });
        Self { decay, state: [0.0; 2] }
    }

    fn next(&mut self, mut value: f64) -> f64 {
        for (state, decay) in self.state.iter_mut().zip(self.decay) {
            *state = value + (*state - value) * decay;
            value = *state;
        }
        value
    }
}

/// The simulated rig.
#[derive(Clone, Debug)]
pub struct Plant {
    config: PlantConfig,
    calibration: Calibration,
    relay: Relay,
    motion: Joined<f64>,
    base: Moving,
    spring: Option<Spring>,
    faults: Faults,
    /// Supply of the converters, V.
    supply_v: f64,
    /// The structure is held here, m.
    held_m: Option<f64>,
    walls: Option<WallSensors>,
    pulses: VecDeque<Pulse>,
    lags: [Lags; 2],
    noise: Xoshiro128PlusPlus,
    /// The grid points that are kept; the last one is at `reached`.
    history: VecDeque<Truth>,
    reached: Time,
    /// Voltage at the drive's output.
    output_v: f64,
    /// The program demands the relay closed.
    closes: bool,
    /// The coil is supplied: the program demands it and the emergency stop's contact 1 is closed.
    coil: bool,
    contact: bool,
    contact_moves: Time,
    /// Impulse per change of the structure's velocity, N·s per unit of the integrator.
    impulse_per_kick: f64,
    /// Force of a soft wall per unit of the integrator's, N.
    force_per_unit_n: f64,
    /// Whether the walls are soft: their force is that of the contact, without pulses.
    has_soft_walls: bool,
    impacts: u32,
    limited: u32,
}

impl Plant {
    /// A rig at rest.
    ///
    /// # Errors
    /// Names a value that is not physical.
    pub fn new(config: &PlantConfig, relay: Relay) -> Result<Self, Invalid> {
        config.set_up.validate()?;
        config.sensors.validate()?;
        let units = Units::metres(GRID.s());
        let initial = Initial {
            x_m: config.structure_start_m,
            y_m: config.structure_start_m + config.particle_start_m,
            ..Initial::default()
        };
        let motion = Joined::joined(&config.set_up, units, &initial)?;
        let base = match &config.base {
            Base::Prescribed => Moving::Prescribed(BaseTrack::default()),
            Base::Shaker(shaker) => {
                shaker.validate()?;
                Moving::Shaken(Table::new(shaker, &config.set_up, &units))
            }
        };
        let spring = config.spring.map(|plant| {
            Ok(Spring {
                drive: SimulatedSpring::new(&plant)?,
                lag_s: f64::from(plant.lag_s),
                offset_n: f64::from(plant.offset_n),
                noise_rms_n: f64::from(plant.noise_rms_n),
                lagged_n: 0.0,
            })
        });
        let spring = spring.transpose()?;
        if let Some(walls) = &config.walls {
            walls.validate()?;
        }
        let mut rig = Self {
            config: *config,
            calibration: Settings::default().calibration,
            relay,
            motion,
            base,
            spring,
            faults: Faults::new(config.sensors.seed),
            supply_v: REFERENCE_V,
            held_m: None,
            walls: config.walls,
            pulses: VecDeque::new(),
            lags: [Lags::new(config); 2],
            noise: Xoshiro128PlusPlus::seed_from_u64(config.sensors.seed),
            history: VecDeque::from([Truth::default()]),
            reached: Time(0),
            output_v: 0.0,
            closes: false,
            coil: false,
            contact: false,
            contact_moves: Time::NEVER,
            impulse_per_kick: config.set_up.structure.mass_kg * units.velocity_m_per_s(),
            force_per_unit_n: config.set_up.structure.mass_kg * units.velocity_m_per_s() / units.step_s,
            has_soft_walls: config.set_up.has_soft_walls(),
            impacts: 0,
            limited: 0,
        };
        rig.press();
        rig.history[0].x_m = config.structure_start_m;
        Ok(rig)
    }

    /// Sets the friction damper's force to that given by its spring.
    fn press(&mut self) {
        if let Some(spring) = &self.spring {
            let friction_n = f64::from(spring.drive.friction_force_n());
            self.motion.set_damper_force_n(friction_n, &self.config.set_up);
        }
    }

    /// Sets the voltage of the drive's output. If `is_buffered`, the output buffer limits it to stay off the rails.
    pub fn set_output(&mut self, now: Time, output_v: f64, is_buffered: bool) {
        self.advance(now);
        let headroom = if is_buffered { BUFFER_HEADROOM_V } else { 0.0 };
        self.output_v = output_v.clamp(headroom, self.supply_v - headroom);
    }

    /// Changes the supply, which is the reference of the converters and of the output; the sensors have their own.
    pub fn set_supply(&mut self, now: Time, volts: f64) {
        self.advance(now);
        self.output_v *= volts / self.supply_v;
        self.supply_v = volts;
    }

    /// Supply of the converters and the output, V.
    #[must_use]
    pub fn supply_v(&self) -> f64 {
        self.supply_v
    }

    /// Injects a fault, or ends it.
    pub fn inject(&mut self, now: Time, fault: &InjectedFault) {
        self.advance(now);
        if let Some(broken) = self.faults.inject(fault)
            && let Some(spring) = &mut self.spring
        {
            spring.drive.broken = broken;
        }
        self.press();
        self.supply_coil(now);
    }

    /// A hand holds the structure at this displacement, m, or releases it.
    pub fn hold(&mut self, now: Time, at_m: Option<f64>) {
        self.advance(now);
        self.held_m = at_m;
    }

    /// Switches the relay's driver.
    pub fn set_coil(&mut self, now: Time, on: bool) {
        self.advance(now);
        self.closes = on;
        self.supply_coil(now);
    }

    /// Contact 1 of the emergency stop is in the supply of the coil.
    fn supply_coil(&mut self, now: Time) {
        let on = self.closes && !self.faults.emergency_stop;
        if on != self.coil {
            self.coil = on;
            self.contact_moves = now + if on { self.relay.operate } else { self.relay.release };
        }
    }

    /// Makes one motor step if the motor is on and has power: contact 1 of the emergency stop is in its supply.
    pub fn step_motor(&mut self, now: Time, towards_structure: bool, is_on: bool) {
        self.advance(now);
        let has_power = !self.faults.emergency_stop;
        if let Some(spring) = &mut self.spring {
            spring.drive.energise(is_on && has_power);
            spring.drive.step(towards_structure);
        }
        self.press();
    }

    /// Whether the limit switch is open. Without a friction damper a wire replaces the switch.
    #[must_use]
    pub fn at_limit(&self) -> bool {
        self.spring.as_ref().is_some_and(|spring| spring.drive.is_at_limit())
    }

    /// Whether the emergency stop is pressed.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.faults.emergency_stop
    }

    /// Position of the friction damper's seat, steps from the limit switch.
    #[must_use]
    pub fn seat_steps(&self) -> Option<i32> {
        self.spring.as_ref().map(|spring| spring.drive.steps())
    }

    /// Number of impacts so far.
    #[must_use]
    pub fn impacts(&self) -> u32 {
        self.impacts
    }

    /// Number of steps in which the shaker's amplifier or stroke was at its limit.
    #[must_use]
    pub fn limited(&self) -> u32 {
        self.limited
    }

    /// Demanded base displacement, m: the output's voltage on the drive's scale if the relay is closed.
    fn demand_m(&self) -> f64 {
        if !self.contact || self.faults.amplifier_off {
            return 0.0;
        }
        let counts = self.output_v / REFERENCE_V * FULL_SCALE;
        (counts - f64::from(self.calibration.drive.zero_counts)) * f64::from(self.calibration.drive.metres_per_count)
    }

    /// Advances the motion until the grid has passed `time`.
    pub fn advance(&mut self, time: Time) {
        while self.reached < time {
            self.step();
        }
    }

    fn step(&mut self) {
        if self.contact_moves <= self.reached {
            (self.contact, self.contact_moves) = (self.coil, Time::NEVER);
        }
        let drive = self.demand_m();
        let mut walls = WallsInStep::default();
        let end = match &mut self.base {
            Moving::Prescribed(track) => {
                let segment: BaseSegment<f64> = track.push(drive);
                self.motion.step(&segment, &mut walls);
                segment.end()
            }
            Moving::Shaken(table) => {
                let end = table.step(&mut self.motion, drive, &mut walls).end();
                self.limited = table.limited();
                end
            }
        };
        let start_s = self.reached.s();
        let walls_n = walls.forces.map(|force| force * self.force_per_unit_n);
        for hit in walls.impacts {
            self.impacts += 1;
            if let Some(walls) = self.walls.filter(|_| !self.has_soft_walls) {
                let contact_s = f64::from(walls.contact_s);
                let impulse_n_s = (hit.kick * self.impulse_per_kick).abs();
                self.pulses.push_back(Pulse {
                    is_high: hit.side > 0,
                    start_s: start_s + hit.at * GRID.s(),
                    peak_n: 0.5 * PI * impulse_n_s / contact_s,
                });
            }
        }
        if let Some(x_m) = self.held_m {
            let particle_m = self.config.particle_start_m;
            self.motion.reset(&Initial { x_m, y_m: x_m + particle_m, ..Initial::default() });
        }
        let spring_n = match &mut self.spring {
            Some(spring) => {
                let follow = GRID.s() / (spring.lag_s + GRID.s());
                spring.lagged_n += (f64::from(spring.drive.normal_force_n()) - spring.lagged_n) * follow;
                spring.lagged_n + spring.offset_n
            }
            None => 0.0,
        };
        let [x_lags, z_lags] = &mut self.lags;
        let truth = Truth { x_m: x_lags.next(self.motion.state().x), z_m: z_lags.next(end), spring_n, walls_n };
        self.history.push_back(truth);
        if self.history.len() > KEPT {
            self.history.pop_front();
        }
        self.reached += GRID;
        if let Some(walls) = &self.walls {
            let past_s = self.reached.s() - f64::from(walls.contact_s) - (GRID * KEPT as u64).s();
            while self.pulses.front().is_some_and(|pulse| pulse.start_s < past_s) {
                self.pulses.pop_front();
            }
        }
    }

    /// True values at a time within the last 10 ms.
    #[must_use]
    pub fn truth(&self, time: Time) -> Truth {
        let back = self.reached.since(time).0 as f64 / GRID.0 as f64;
        let last = self.history.len() - 1;
        let place = (last as f64 - back).clamp(0.0, last as f64);
        let (n, part) = (place as usize, place.fract());
        let (a, b) = (self.history[n], self.history[(n + 1).min(last)]);
        let between = |a: f64, b: f64| a + (b - a) * part;
        let walls_n = [0, 1].map(|wall| between(a.walls_n[wall], b.walls_n[wall]));
        Truth {
            x_m: between(a.x_m, b.x_m),
            z_m: between(a.z_m, b.z_m),
            spring_n: between(a.spring_n, b.spring_n),
            walls_n,
        }
    }

    /// Force on a wall, N.
    fn wall_n(&self, time: Time, is_high: bool) -> f64 {
        let Some(walls) = &self.walls else { return 0.0 };
        let contact_s = f64::from(walls.contact_s);
        let pressed_n = self.truth(time).walls_n[usize::from(is_high)];
        let pulses: f64 = self
            .pulses
            .iter()
            .filter(|pulse| pulse.is_high == is_high)
            .map(|pulse| (time.s() - pulse.start_s) / contact_s)
            .zip(self.pulses.iter().filter(|pulse| pulse.is_high == is_high))
            .filter(|(since, _)| (0.0..1.0).contains(since))
            .map(|(since, pulse)| pulse.peak_n * (PI * since).sin())
            .sum();
        (pressed_n + pulses + f64::from(walls.offset_n)).clamp(-f64::from(walls.range_n), f64::from(walls.range_n))
    }

    /// The 12-bit code of a sensor at a time: its voltage on the assumed scales with noise, rounded to the nearest code.
    /// Advances the motion to that time.
    pub fn code(&mut self, sensor: Sensor, time: Time) -> u16 {
        self.advance(time);
        let scale = &self.calibration;
        let noise = self.config.sensors.noise_rms_m;
        let [x_range_m, z_range_m] = self.config.sensors.range_m.map(f64::from);
        // The noise is scaled so that the mean of the added conversions has the sensor's noise.
        let displacement = |value_m: f64, range: f64, scale: &damprig_core::io::DisplacementScale| {
            let per_unit = ADDED_UP.sqrt() / f64::from(scale.metres_per_count) / ADDED_UP;
            let counts =
                value_m.clamp(-range, range) / f64::from(scale.metres_per_count) + f64::from(scale.zero_counts);
            (counts / ADDED_UP, f64::from(noise), per_unit)
        };
        let (code, rms, per_unit) = match sensor {
            Sensor::X => displacement(self.truth(time).x_m, x_range_m, &scale.x),
            Sensor::Z => displacement(self.truth(time).z_m, z_range_m, &scale.z),
            Sensor::SpringForce => {
                let per_count = f64::from(scale.spring.newtons_per_count);
                let counts = self.truth(time).spring_n / per_count + f64::from(scale.spring.zero_counts);
                let rms_n = self.spring.as_ref().map_or(0.0, |spring| spring.noise_rms_n);
                (counts / ADDED_UP, rms_n, ADDED_UP.sqrt() / per_count / ADDED_UP)
            }
            Sensor::WallLow | Sensor::WallHigh => {
                let per_count = f64::from(scale.walls.newtons_per_count);
                let force_n = self.wall_n(time, sensor == Sensor::WallHigh);
                let rms_n = self.walls.map_or(0.0, |walls| f64::from(walls.noise_rms_n));
                (force_n / per_count + f64::from(scale.walls.zero_counts), rms_n, 1.0 / per_count)
            }
        };
        let code = if rms > 0.0 { code + rms * per_unit * self.normal() } else { code };
        let code = if self.faults.has(sensor) {
            let span = Span { low: 0.0, high: FULL_SCALE as f32, per_unit: per_unit as f32 };
            f64::from(self.faults.apply(sensor, code as f32, span))
        } else {
            code
        };
        (code * REFERENCE_V / self.supply_v).round().clamp(0.0, FULL_SCALE) as u16
    }

    /// White noise of unit variance, approximately normal: the sum of four uniform 16-bit numbers.
    fn normal(&mut self) -> f64 {
        let (a, b) = (self.noise.next_u32(), self.noise.next_u32());
        let sum = i64::from(a & 0xffff) + i64::from(a >> 16) + i64::from(b & 0xffff) + i64::from(b >> 16);
        (sum - 2 * 65_535) as f64 / 37_837.227
    }
}

/// Impacts of a step, and the forces of soft walls at its end in the integrator's unit.
#[derive(Default)]
struct WallsInStep {
    impacts: Vec<SampledImpact<f64>>,
    forces: [f64; 2],
}

impl SampledObserver<f64> for WallsInStep {
    fn wall_force(&mut self, _: f64, length: f64, side: Sign, force: &Polynomial<f64>) {
        self.forces[usize::from(side > 0)] = force[0] + increment(force, length);
    }

    fn impact(&mut self, impact: &SampledImpact<f64>) {
        self.impacts.push(*impact);
    }

    fn contact_end(&mut self, _: f64, side: Sign, _: f64) {
        self.forces[usize::from(side > 0)] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use damprig_core::model::{SetUp, Structure};

    use super::*;

    fn plant() -> Plant {
        let structure = Structure::from_modal(1.6, 2.5, 0.0038);
        let mut config = PlantConfig::ideal(SetUp::bare(structure));
        config.sensors.noise_rms_m = 0.0;
        Plant::new(&config, Relay::default()).unwrap()
    }

    #[test]
    fn an_open_relay_moves_nothing() {
        let mut plant = plant();
        plant.set_output(Time(0), 3.0, true);
        plant.advance(Time::from_ms(100));
        assert_eq!(plant.truth(Time::from_ms(100)).z_m, 0.0);
        plant.set_coil(Time::from_ms(100), true);
        plant.advance(Time::from_ms(200));
        let expected_m = (3.0 / 3.3 - 0.5) * 0.01;
        assert!((plant.truth(Time::from_ms(200)).z_m - expected_m).abs() < 1e-6);
    }

    #[test]
    fn a_displacement_of_zero_is_the_middle_of_the_converter() {
        let mut plant = plant();
        assert_eq!(plant.code(Sensor::X, Time::from_us(10)), 2_048);
        assert_eq!(plant.code(Sensor::WallLow, Time::from_us(10)), 410);
    }
}
