//! Simulated drive of the friction spring: stepper, screw, spring, force sensor and limit switch, with their
//! failures.

use super::Noise;
use damprig_core::io::{Invalid, Motor, SUBSAMPLES, finite, not_negative, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// True properties of the drive; the controller's constants may differ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpringPlant {
    /// Travel per step, m.
    pub step_m: f32,
    /// Position of the seat at power-on, m from the limit switch.
    pub start_m: f32,
    /// Seat position at which the block touches the structure, m from the limit switch.
    pub touch_m: f32,
    /// Spring stiffness k_s, N/m.
    pub stiffness_n_per_m: f32,
    /// Coefficient of friction μ_e between block and structure.
    pub friction_coefficient: f32,
    /// Force reading without contact, N.
    pub offset_n: f32,
    /// Lowest reading, N.
    pub lowest_n: f32,
    /// Highest reading, N.
    pub highest_n: f32,
    /// RMS of the white noise of one 10 kHz sample, N.
    pub noise_rms_n: f32,
    /// Time constant of the force sensor's first-order lag, s; 0 for none.
    pub lag_s: f32,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for SpringPlant {
    /// Assumed values: the spring is a little stiffer than its data sheet says; the sensor measures 0 N to 50 N over
    /// nine tenths of its converter's span.
    fn default() -> Self {
        Self {
            step_m: 5e-6,
            start_m: 3.3e-3,
            touch_m: 12.3456e-3,
            stiffness_n_per_m: 537.0,
            friction_coefficient: 0.3,
            offset_n: 0.35,
            lowest_n: -50.0 / 9.0,
            highest_n: 50.0,
            noise_rms_n: 0.01,
            lag_s: 2e-3,
            seed: 1,
        }
    }
}

impl SpringPlant {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("spring_plant.step_m", f64::from(self.step_m))?;
        positive("spring_plant.stiffness_n_per_m", f64::from(self.stiffness_n_per_m))?;
        positive("spring_plant.friction_coefficient", f64::from(self.friction_coefficient))?;
        let (lowest, highest) = (f64::from(self.lowest_n), f64::from(self.highest_n));
        finite("spring_plant.highest_n", highest)?;
        require(lowest < highest, "spring_plant.lowest_n", lowest, "below spring_plant.highest_n")?;
        not_negative("spring_plant.start_m", f64::from(self.start_m))?;
        not_negative("spring_plant.touch_m", f64::from(self.touch_m))?;
        not_negative("spring_plant.noise_rms_n", f64::from(self.noise_rms_n))?;
        not_negative("spring_plant.lag_s", f64::from(self.lag_s))
    }
}

/// Failures of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Breakage {
    /// The motor makes no steps.
    pub jammed: bool,
    /// The motor turns in the wrong direction.
    pub reversed: bool,
    /// The motor stalls while the spring presses back with more than this, N.
    pub stalls_above_n: Option<f32>,
    /// One step in every so many is lost; 0 for none.
    pub loses_every: u32,
    /// The limit switch always reads this value.
    pub switch_stuck: Option<bool>,
    /// There is no structure to touch.
    pub nothing_there: bool,
}

/// The simulated drive.
#[derive(Clone, Debug)]
pub struct SimulatedSpring {
    plant: SpringPlant,
    /// True position of the seat, steps from the limit switch.
    steps: i32,
    steps_asked: u32,
    lagged_n: f32,
    energised: bool,
    noise: Noise,
    /// Force of weights on the sensor, N, in place of the spring's.
    hung_n: Option<f32>,
    /// The present failures.
    pub broken: Breakage,
}

impl SimulatedSpring {
    /// Makes a drive at its starting position.
    ///
    /// # Errors
    /// Names a value that is not physical.
    pub fn new(plant: &SpringPlant) -> Result<Self, Invalid> {
        plant.validate()?;
        Ok(Self {
            plant: *plant,
            steps: (plant.start_m / plant.step_m) as i32,
            steps_asked: 0,
            lagged_n: 0.0,
            energised: false,
            noise: Noise::new(plant.seed, 0),
            hung_n: None,
            broken: Breakage::default(),
        })
    }

    /// True position of the seat, m from the limit switch.
    #[must_use]
    pub fn position_m(&self) -> f32 {
        self.steps as f32 * self.plant.step_m
    }

    /// Changes the stiffness of the spring, N/m.
    pub fn set_stiffness(&mut self, stiffness_n_per_m: f32) {
        self.plant.stiffness_n_per_m = stiffness_n_per_m;
    }

    /// Hangs weights of this force on the sensor, N; `None` gives it back to the spring.
    pub fn hang(&mut self, force_n: Option<f32>) {
        self.hung_n = force_n;
    }

    /// Lowest and highest reading of the force sensor, N.
    #[must_use]
    pub fn sensor_span_n(&self) -> (f32, f32) {
        (self.plant.lowest_n, self.plant.highest_n)
    }

    /// Whether the motor's driver was switched on in the last tick.
    #[must_use]
    pub fn is_energised(&self) -> bool {
        self.energised
    }

    /// True normal force, N.
    #[must_use]
    pub fn normal_force_n(&self) -> f32 {
        let deflection_m = self.position_m() - self.plant.touch_m;
        if self.broken.nothing_there { 0.0 } else { self.plant.stiffness_n_per_m * deflection_m.max(0.0) }
    }

    /// True friction force on the structure while it slips, N.
    #[must_use]
    pub fn friction_force_n(&self) -> f32 {
        self.plant.friction_coefficient * self.normal_force_n()
    }

    /// Advances one tick: makes the steps and returns the block of force readings, N, and whether the limit switch is
    /// closed.
    pub fn tick(&mut self, drive: Motor) -> ([f32; SUBSAMPLES], bool) {
        self.energised = drive.enabled;
        for _ in 0..drive.steps.unsigned_abs() {
            self.step(drive.steps > 0);
        }
        let truth = self.hung_n.unwrap_or_else(|| self.normal_force_n());
        let sample_s = 1.0 / (damprig_core::io::TICK_HZ * SUBSAMPLES as f32);
        let follow = sample_s / (self.plant.lag_s + sample_s);
        let block = core::array::from_fn(|_| {
            self.lagged_n += (truth - self.lagged_n) * follow;
            let reading = self.lagged_n + self.plant.offset_n + self.plant.noise_rms_n * self.noise.next();
            reading.max(self.plant.lowest_n).min(self.plant.highest_n)
        });
        (block, self.is_at_limit())
    }

    /// The motor's driver is switched on or off.
    pub fn energise(&mut self, energised: bool) {
        self.energised = energised;
    }

    /// One step, which the motor makes unless something is broken or it is off.
    pub fn step(&mut self, towards_structure: bool) {
        self.steps_asked = self.steps_asked.wrapping_add(1);
        let direction = if towards_structure != self.broken.reversed { 1 } else { -1 };
        let stalled = direction > 0 && self.broken.stalls_above_n.is_some_and(|most| self.normal_force_n() > most);
        let lost = self.broken.loses_every > 0 && self.steps_asked.is_multiple_of(self.broken.loses_every);
        if self.energised && !self.broken.jammed && !stalled && !lost {
            self.steps += direction;
        }
    }

    /// True position of the seat, steps from the limit switch.
    #[must_use]
    pub fn steps(&self) -> i32 {
        self.steps
    }

    /// Whether the limit switch tells that the seat is at its limit.
    #[must_use]
    pub fn is_at_limit(&self) -> bool {
        self.broken.switch_stuck.unwrap_or(self.steps <= 0)
    }
}
