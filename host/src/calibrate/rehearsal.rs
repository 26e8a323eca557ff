//! A rehearsal on the virtual rig: sensors whose true scales differ from the settings, and an operator who places targets, hangs
//! weights and gives blows with small errors. All of it follows from a seed.

use damprig_core::io::{DisplacementScale, ForceScale};
use damprig_core::model::{SetUp, Structure};
use damprig_core::settings::Settings;
use damprig_simulator::messages::{ToSimulator, set_plant};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Bench, Blow, DataSheet, PlantConfig, SensorModel, Target, TrueScales};

use super::Channel;
use super::guide::{Ask, GuideReply, Operator, question};
use super::rig::CalibratedRig;
use crate::failure::Failure;

/// Standard error of placing a target, m: a gauge block against a stop.
const PLACING_M: f64 = 10e-6;

/// Repeatability of the force sensor under a weight, also under none, N.
const WEIGHING_N: f64 = 5e-3;

/// Relative standard error of an impulse by the hammer's own sensor.
const HAMMERING: f64 = 0.01;

/// What is true on the virtual rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Scales of sensors and drive.
    pub scales: TrueScales,
    /// Stiffness of the friction damper's spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Time by which z leads x, s.
    pub lead_s: f64,
    seed: u64,
}

impl Truth {
    /// The truth that a seed draws: of the channel alone, all others are as set.
    #[must_use]
    pub fn draw(channel: Channel, seed: u64, settings: &Settings) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let mut scales = TrueScales::as_set(&settings.calibration);
        let (gain, zero) = (between(0.97, 1.03) as f32, between(-1.0, 1.0) as f32);
        let displacement = |scale: DisplacementScale| DisplacementScale {
            metres_per_count: scale.metres_per_count * gain,
            // ±0.5 % of the span.
            zero_counts: scale.zero_counts + 330.0 * zero,
        };
        let force = |scale: ForceScale, zero: f32| ForceScale {
            newtons_per_count: scale.newtons_per_count * gain,
            zero_counts: scale.zero_counts + zero,
        };
        match channel {
            Channel::X => scales.x = displacement(scales.x),
            Channel::Z => scales.z = displacement(scales.z),
            Channel::Match => scales.z.metres_per_count *= gain,
            Channel::Spring => scales.spring = force(scales.spring, 330.0 * zero),
            Channel::Walls => scales.walls = scales.walls.map(|scale| force(scale, 0.0)),
            Channel::Drive => {
                scales.drive.metres_per_count *= gain;
                scales.drive.zero_counts += 20.0 * zero;
            }
            Channel::FrictionSpring => {}
        }
        let spring = f64::from(settings.spring.stiffness_n_per_m);
        let stiffness_n_per_m = if channel == Channel::FrictionSpring { spring * between(0.9, 1.1) } else { spring };
        Self { scales, stiffness_n_per_m, lead_s: between(1e-5, 1e-4), seed }
    }

    /// The plant with this truth: a stiff structure on a base that follows the drive.
    #[must_use]
    pub fn plant(&self, settings: &Settings) -> PlantConfig {
        let walls = WallSensors { scale: settings.calibration.walls, ..WallSensors::default() };
        let spring = SpringPlant {
            step_m: settings.spring.step_m,
            stiffness_n_per_m: self.stiffness_n_per_m as f32,
            offset_n: 0.0,
            seed: self.seed,
            ..SpringPlant::default()
        };
        let range_m = [settings.calibration.x.range_m(), settings.calibration.z.range_m()];
        PlantConfig {
            sensors: SensorModel { range_m, seed: self.seed, ..SensorModel::default() },
            // The counts are the only steps: those of the data sheet's own converter would beat with them.
            data_sheet: Some(DataSheet {
                linearity: 0.0,
                skew_s: self.lead_s as f32,
                bits: 20,
                ..DataSheet::default()
            }),
            walls: Some(walls),
            spring: Some(spring),
            scales: Some(self.scales),
            ..PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 25.0, 0.05)))
        }
    }
}

/// The operator of a rehearsal.
#[derive(Debug)]
pub struct SimulatedOperator {
    truth: Truth,
    rng: fastrand::Rng,
    tell: fn(&str),
    impulse_n_s: f64,
    /// Where the target truly stands, or what truly hangs, in SI units.
    placed: f64,
}

impl SimulatedOperator {
    /// Puts the truth into the virtual rig. `tell` gets what is asked and answered.
    ///
    /// # Errors
    /// The rig is no virtual one, or refuses the plant.
    pub fn new(truth: Truth, rig: &mut CalibratedRig<'_>, tell: fn(&str)) -> Result<Self, Failure> {
        let settings = rig.session.settings;
        rig.session.execute("take the plant of the rehearsal", set_plant(truth.plant(&settings)))?;
        // Apart from the draws of the truth.
        let rng = fastrand::Rng::with_seed(!truth.seed);
        Ok(Self { truth, rng, tell, impulse_n_s: 0.0, placed: 0.0 })
    }

    /// Where the target truly stands, m, what truly hangs, N, or the true impulse of the last blow, N·s.
    #[must_use]
    pub fn placed(&self) -> f64 {
        self.placed
    }

    /// What is true.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// A nearly normal number of unit variance: the sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.rng.f64()).sum::<f64>() - 6.0
    }

    fn place(&mut self, rig: &mut CalibratedRig<'_>, bench: Bench) -> Result<(), Failure> {
        Ok(rig.session.execute("place a target", ToSimulator::Place(bench).request())?)
    }

    fn say(&self, line: &str) {
        (self.tell)(line);
    }
}

impl Operator for SimulatedOperator {
    fn ask(&mut self, rig: &mut CalibratedRig<'_>, ask: &Ask<'_>) -> Result<GuideReply, Failure> {
        rig.go_on()?;
        match *ask {
            Ask::Reference { channel, reference, .. } => {
                self.say(&format!("{}: done by the simulated operator", question(ask)));
                let error = self.normal() * if channel == Channel::Spring { WEIGHING_N } else { PLACING_M };
                self.placed = reference + error;
                let at = Target::At(self.placed as f32);
                let bench = match channel {
                    Channel::X => Bench { x: at, ..Bench::default() },
                    Channel::Z => Bench { z: at, ..Bench::default() },
                    _ => Bench { spring_n: Some(self.placed as f32), ..Bench::default() },
                };
                self.place(rig, bench)?;
                Ok(GuideReply::Done)
            }
            Ask::Ready(_) => {
                self.say(&format!("{}: done by the simulated operator", question(ask)));
                self.place(rig, Bench { x: Target::Base, ..Bench::default() })?;
                Ok(GuideReply::Done)
            }
            Ask::Blow { side, .. } => {
                self.say(&format!("{}: done by the simulated operator", question(ask)));
                self.placed = 0.08 + 0.06 * self.rng.f64();
                self.impulse_n_s = self.placed * (1.0 + HAMMERING * self.normal());
                let blow = Blow { side, impulse_n_s: self.placed as f32 };
                rig.session.execute("hit a wall", ToSimulator::Blow(blow).request())?;
                Ok(GuideReply::Done)
            }
            Ask::Impulse { measured_n_s } => {
                self.say(&format!("the hammer: {:.5} N·s; measured: {measured_n_s:.5} N·s", self.impulse_n_s));
                Ok(GuideReply::At(self.impulse_n_s))
            }
        }
    }

    fn tell(&mut self, line: &str) {
        self.say(line);
    }
}
