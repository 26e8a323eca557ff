//! The simulated rig: a plant and its sensors behind the same [`Sensors`] and [`Actuators`] as a real one.
//!
//! The base follows the drive exactly, one tick late (prescribed motion). The sensors are ideal: range,
//! resolution and white noise with a seed. The virtual rig runs it in `f64`, the emulated board in `f32`.

use crate::integrator::base::{Segment, Track};
use crate::integrator::polynomial;
use crate::integrator::sampled::{Flight, Observer, Sampled, Units};
use crate::model::{Initial, Invalid, SetUp, not_negative, positive, require};
use crate::rig::{Actuators, SUBSAMPLES, Sensors, TICK_HZ};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;
use serde::{Deserialize, Serialize};

/// An ideal displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SensorModel {
    /// Readings stop at ± this, m; greater than 0.
    pub range_m: f32,
    /// Readings are multiples of this, m; 0 for none.
    pub resolution_m: f32,
    /// RMS of the white noise of one 10 kHz sample, m.
    pub noise_rms_m: f32,
    /// Seed of the noise; every point of an experiment draws its own stream from it.
    pub seed: u64,
}

impl Default for SensorModel {
    /// The source document's laser: ±80 mm; 10 µm resolution and 5 µm RMS noise are assumed.
    fn default() -> Self {
        Self { range_m: 0.08, resolution_m: 1e-5, noise_rms_m: 5e-6, seed: 1 }
    }
}

impl SensorModel {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("sensors.range_m", f64::from(self.range_m))?;
        not_negative("sensors.resolution_m", f64::from(self.resolution_m))?;
        not_negative("sensors.noise_rms_m", f64::from(self.noise_rms_m))?;
        let counts = if self.resolution_m > 0.0 { self.range_m / self.resolution_m } else { 0.0 };
        require(
            counts < 4e6,
            "sensors.resolution_m",
            f64::from(self.resolution_m),
            "0, or at least sensors.range_m / 4,000,000",
        )
    }
}

/// What a simulated plant is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PlantConfig {
    /// The mechanical set-up.
    pub set_up: SetUp,
    /// The particle's starting place relative to the middle of its cavity, m; |start| ≤ clearance.
    pub particle_start_m: f64,
    /// Both displacement sensors.
    pub sensors: SensorModel,
}

impl PlantConfig {
    fn initial(&self) -> Initial {
        Initial { y_m: self.particle_start_m, ..Initial::default() }
    }
}

/// The simulated rig.
#[derive(Clone, Debug)]
pub struct Plant<S> {
    config: PlantConfig,
    motion: Sampled<S>,
    steps: u8,
    track: Track<S>,
    noise: Noise,
    impacts: u32,
}

impl<S: Scalar> Plant<S> {
    /// A plant at rest.
    ///
    /// # Errors
    /// Names a value that is not physical, or too fast for the tick.
    pub fn new(config: &PlantConfig) -> Result<Self, Invalid> {
        config.set_up.validate()?;
        config.sensors.validate()?;
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let steps = Sampled::<S>::steps_per_sample(&config.set_up, tick_s)?;
        let motion = Sampled::new(&config.set_up, Units::metres(tick_s / f64::from(steps)), &config.initial())?;
        let noise = Noise::new(config.sensors.seed, 0);
        Ok(Self { config: *config, motion, steps, track: Track::default(), noise, impacts: 0 })
    }

    /// Puts everything back to its start. `stream` chooses among independent noises of the same seed: a point's
    /// noise is its own, whatever was measured before it.
    pub fn restart(&mut self, stream: u16) {
        self.motion.reset(&self.config.initial());
        self.track = Track::default();
        self.noise = Noise::new(self.config.sensors.seed, stream);
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

    /// One tick: what the actuators ask for in, what the sensors then read out.
    pub fn tick(&mut self, actuators: &Actuators) -> Sensors {
        let (x, z) = self.advance(actuators);
        let sensor = Sensor::new(&self.config.sensors);
        let mut sensors = Sensors::default();
        for n in 0..SUBSAMPLES {
            sensors.x_m[n] = sensor.read(x[n].to_f64() as f32, &mut self.noise);
            sensors.z_m[n] = sensor.read(z[n].to_f64() as f32, &mut self.noise);
        }
        sensors
    }

    /// One tick of motion: x and z at the sub-sample instants, m.
    pub fn advance(&mut self, actuators: &Actuators) -> ([S; SUBSAMPLES], [S; SUBSAMPLES]) {
        if let Some(point) = actuators.put_plant_back {
            self.restart(point);
        }
        let drive = if actuators.drive_enabled { actuators.drive_m } else { 0.0 };
        let whole = self.track.push(S::from_f64(f64::from(drive)));
        let tenth = S::ONE / S::from_u8(SUBSAMPLES as u8);
        let z = core::array::from_fn(|n| displacement(&whole, S::from_u8(n as u8 + 1) * tenth));
        let mut sampler =
            Sampler { x: [S::ZERO; SUBSAMPLES], taken: 0, step: S::ZERO, steps: S::from_u8(self.steps), impacts: 0 };
        for part in 0..self.steps {
            sampler.step = S::from_u8(part);
            self.motion.step(&whole.part(part, self.steps), &mut sampler);
        }
        // Rounding of the instants can leave the last sample just past the last flight.
        for sample in &mut sampler.x[sampler.taken..] {
            *sample = self.motion.state().x;
        }
        self.impacts = self.impacts.wrapping_add(sampler.impacts);
        (sampler.x, z)
    }
}

fn displacement<S: Scalar>(segment: &Segment<S>, t: S) -> S {
    segment.0[0] + polynomial::increment(&segment.0, t)
}

/// Reads x off the flights at the sub-sample instants.
struct Sampler<S> {
    x: [S; SUBSAMPLES],
    taken: usize,
    step: S,
    steps: S,
    impacts: u32,
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

    fn impact(&mut self, _: &crate::integrator::sampled::Impact<S>) {
        self.impacts += 1;
    }
}

/// The sensor model with its divisions done.
struct Sensor {
    range: f32,
    resolution: f32,
    per_resolution: f32,
    noise: f32,
}

impl Sensor {
    fn new(model: &SensorModel) -> Self {
        let per_resolution = if model.resolution_m > 0.0 { 1.0 / model.resolution_m } else { 0.0 };
        Self { range: model.range_m, resolution: model.resolution_m, per_resolution, noise: model.noise_rms_m }
    }

    fn read(&self, truth: f32, noise: &mut Noise) -> f32 {
        let mut reading = truth;
        if self.noise > 0.0 {
            reading += self.noise * noise.next();
        }
        if self.per_resolution > 0.0 {
            // Adding 1.5 · 2²³ leaves no bits for a fraction: what remains is rounded to nearest, without a branch
            // that noise would make unpredictable.
            const NO_FRACTION: f32 = 12_582_912.0;
            reading = (reading * self.per_resolution + NO_FRACTION - NO_FRACTION) * self.resolution;
        }
        Scalar::min(Scalar::max(reading, -self.range), self.range)
    }
}

/// White noise of unit variance: the sum of four uniform 16-bit numbers, so within ±3.46 and nearly normal
/// (excess kurtosis −0.3), the same bits everywhere.
#[derive(Clone, Debug)]
struct Noise(Xoshiro128PlusPlus);

impl Noise {
    fn new(seed: u64, stream: u16) -> Self {
        // The seed is hashed (SplitMix64) on its way into the state, so neighbours are independent.
        Self(Xoshiro128PlusPlus::seed_from_u64(seed.wrapping_add(u64::from(stream) << 48)))
    }

    fn next(&mut self) -> f32 {
        let (a, b) = (self.0.next_u32(), self.0.next_u32());
        let sum = ((a & 0xffff) + (a >> 16) + (b & 0xffff) + (b >> 16)) as i32 - 2 * 65_535;
        // Variance of the sum: 4 · (65536² − 1)/12.
        const SCALE: f32 = 1.0 / 37_837.227;
        sum as f32 * SCALE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_multiples_of_the_resolution_within_the_range() {
        let model = SensorModel { noise_rms_m: 0.0, ..SensorModel::default() };
        let (sensor, mut noise) = (Sensor::new(&model), Noise::new(1, 0));
        for (truth, reading) in [(0.000_123_6, 0.000_12), (-0.000_125_5, -0.000_13), (0.2, 0.08), (-3e9, -0.08)] {
            assert!((sensor.read(truth, &mut noise) - reading).abs() < 1e-9, "{truth}");
        }
    }

    #[test]
    fn the_noise_has_unit_variance_and_no_mean() {
        let mut noise = Noise::new(7, 0);
        let n = 100_000;
        let values: heapless::Vec<f64, 100_000> = (0..n).map(|_| f64::from(noise.next())).collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let variance = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
        // Standard errors: 1/√n = 0.0032, and about √(1.7/n) = 0.0041.
        assert!(mean.abs() < 0.013 && (variance - 1.0).abs() < 0.017, "{mean} {variance}");
    }
}
