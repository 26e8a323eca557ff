//! The dampers' part of a tick: wall forces, the friction damper's spring, and the twin.

use super::Brake;
use super::event_queue::EventQueue;
use crate::control::friction_spring::{FrictionSpring, SpringCommand, SpringEvent, SpringInputs, SpringStage};
use crate::control::safety::rails::SensorVerdict;
use crate::io::{Motor, Readings, Sensors};
use crate::measure::amplitude::CycleAmplitude;
use crate::measure::impacts::ImpactMeter;
use crate::measure::running::{DriveReference, RunningLockIn, RunningMotion};
use crate::measure::velocity::Velocity;
use crate::twin::{Twin, TwinSignals};

/// State of both dampers and of their measurements.
#[derive(Clone, Debug, Default)]
pub struct Dampers {
    pub(super) spring: FrictionSpring,
    pub(super) meter: ImpactMeter,
    pub(super) twin: Option<Twin>,
    amplitude: CycleAmplitude,
    running: RunningLockIn,
    velocity: Velocity,
    pub(super) x_velocity_m_per_s: f32,
    pub(super) base_amplitude_m: Option<f32>,
    pub(super) impacts_in_cycle: u32,
    /// Pulses that ended before this tick belong to a plant that has been reset.
    put_back_at: u32,
}

impl Dampers {
    /// Impacts since the last start.
    #[must_use]
    pub fn impacts(&self) -> u32 {
        self.meter.counts().total()
    }

    /// Restarts the tick count: counts at zero, the twin at rest. The spring keeps its position.
    pub fn restart(&mut self) {
        self.meter.reset();
        if let Some(twin) = &mut self.twin {
            twin.restart();
        }
        self.amplitude = CycleAmplitude::default();
        self.running = RunningLockIn::default();
        self.velocity = Velocity::default();
        self.x_velocity_m_per_s = 0.0;
        self.base_amplitude_m = None;
        self.impacts_in_cycle = 0;
        self.put_back_at = 0;
    }

    /// Restarts the twin and the walls' offsets, because a simulated plant is reset to its start after this tick.
    pub fn put_back(&mut self, tick: u32) {
        self.meter.restart();
        // A contact that the reset has cut off ends in the next tick.
        self.put_back_at = tick.wrapping_add(2);
        self.velocity = Velocity::default();
        if let Some(twin) = &mut self.twin {
            twin.put_back();
        }
    }

    /// Measures this tick's base amplitude and impacts. The impacts are added to `events`.
    pub(super) fn measure(&mut self, tick: u32, sensors: &Sensors, frequency_hz: f32, events: &mut EventQueue) {
        self.base_amplitude_m = self.amplitude.push(sensors.readings.z.mean_m, frequency_hz);
        let Self { meter, twin, put_back_at, .. } = self;
        meter.push(tick, &sensors.walls, |record| {
            if let Some(twin) = twin
                && record.tick >= *put_back_at
            {
                twin.detected(record);
            }
            events.push_impact(record);
        });
    }

    /// Updates the twin with this tick's readings.
    pub(super) fn update_twin(&mut self, tick: u32, readings: &Readings) {
        if let Some(twin) = &mut self.twin {
            twin.tick(tick, readings.x.mean_m, readings.z.mean_m);
        }
    }

    /// Updates the displayed motion of structure and base with this tick's readings.
    pub(super) fn update_motion(&mut self, readings: &Readings, reference: Option<DriveReference>) {
        self.running.push(readings.x.mean_m, readings.z.mean_m, reference);
        self.x_velocity_m_per_s = self.velocity.push(readings.x.mean_m);
    }

    /// Amplitudes and phases of the last whole cycle of the drive.
    pub(super) fn motion(&self) -> &RunningMotion {
        self.running.motion()
    }

    /// Signals of the twin; [`TwinSignals::NOTHING`] without one.
    #[must_use]
    pub fn twin_signals(&self) -> &TwinSignals {
        self.twin.as_ref().map_or(&TwinSignals::NOTHING, Twin::signals)
    }

    /// Closes a cycle of the drive.
    pub fn end_cycle(&mut self) {
        self.impacts_in_cycle = self.meter.end_cycle();
    }

    /// Runs the spring's tick: returns the motor's demand and an event, if any.
    pub(super) fn tick_spring(
        &mut self,
        tick: u32,
        sensors: &Sensors,
        force_sensor: SensorVerdict,
    ) -> (Motor, Option<SpringEvent>) {
        self.spring.tick(&SpringInputs {
            tick,
            force_n: sensors.readings.spring_n,
            force_sensor,
            at_switch: sensors.at_limit,
            max_abs_x_m: sensors.readings.x.peak_m,
            base_amplitude_m: self.base_amplitude_m,
            emergency_stop: sensors.emergency_stop,
        })
    }

    /// Commands the brake until it closes, if a braking force (N) is required.
    pub fn brake(&mut self, wanted_n: Option<f32>) -> Brake {
        let Some(force_n) = wanted_n else { return Brake::Open };
        if !self.spring.is_braking() && !self.spring.brake(force_n) {
            return Brake::Waits;
        }
        if self.spring.stage() == SpringStage::Holding { Brake::Holds } else { Brake::Closes }
    }

    /// Releases the brake. A spring that rejects the release has already let go.
    pub fn let_go(&mut self) {
        if self.spring.is_braking() {
            let _ = self.spring.handle(SpringCommand::Release);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::WallCounts;
    use crate::model::{Cavity, Particle, SetUp, Structure, Wall};
    use crate::twin::TwinConfig;

    fn set_up(natural_frequency_hz: f64, clearance_m: f64) -> SetUp {
        let particle = Particle {
            mass_kg: 0.16,
            clearance_m,
            friction_coefficient: 0.05,
            wall: Wall::Restitution { coefficient: 0.3 },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, natural_frequency_hz, 0.0038)) }
    }

    #[test]
    fn a_pulse_from_before_a_plants_reset_is_reported_but_not_passed_to_the_twin() {
        let set_up = set_up(2.5, 7.5e-3);
        let quiet = Sensors::default();
        let mut touched = quiet;
        // A half-sine of 0.4 ms in the middle of the tick's block; it ends before the block does.
        for (n, pair) in touched.walls[10..30].iter_mut().enumerate() {
            let force = 800.0 * libm::sinf(core::f32::consts::PI * (n as f32 + 0.5) / 20.0);
            *pair = WallCounts::new(pair.of(0), pair.of(1) + force as u16);
        }
        for (put_back_at, taught) in [(None, 1), (Some(50), 0), (Some(49), 0), (Some(48), 1)] {
            let twin = Some(Twin::new(&TwinConfig::new(set_up)).unwrap());
            let (mut dampers, mut events) = (Dampers { twin, ..Dampers::default() }, EventQueue::default());
            for tick in 0..200 {
                let sensors = if tick == 50 { &touched } else { &quiet };
                dampers.measure(tick, sensors, 2.5, &mut events);
                dampers.update_twin(tick, &sensors.readings);
                if put_back_at == Some(tick) {
                    dampers.put_back(tick);
                }
            }
            assert_eq!((dampers.impacts(), events.iter().count()), (1, 1), "{put_back_at:?}");
            assert_eq!(dampers.twin_signals().detected, taught, "{put_back_at:?}");
        }
    }
}
