//! The dampers' side of a tick: wall forces, the twin that expects them, and the friction damper's spring.

use super::{Brake, Readings, Sensors};
use crate::control::friction_spring::{Cause, Drive as Motor, FrictionSpring, Happening, Inputs, SpringCommand, Stage};
use crate::control::safety::rails::Verdict;
use crate::measure::amplitude::CycleAmplitude;
use crate::measure::impacts::{ImpactMeter, ImpactRecord};
use crate::twin::{Twin, TwinSignals};
use heapless::Deque;

/// Pieces of work of a twin that is late, at most: a sample of the fastest structure with an impact in every step is 16.
const PIECES_WHEN_LATE: u8 = 64;

/// Impacts that wait to be told.
pub const IMPACTS_WAITING: usize = 8;

/// Happenings of the spring that wait to be told.
pub const HAPPENINGS_WAITING: usize = 4;

/// Both dampers.
#[derive(Clone, Debug, Default)]
pub struct Dampers {
    pub(super) spring: FrictionSpring,
    pub(super) meter: ImpactMeter,
    pub(super) twin: Option<Twin>,
    amplitude: CycleAmplitude,
    pub(super) base_amplitude_m: Option<f32>,
    pub(super) impacts_in_cycle: u32,
    impacts: Deque<ImpactRecord, IMPACTS_WAITING>,
    happenings: Deque<Happening, HAPPENINGS_WAITING>,
    /// Pulses that ended before this tick are of a plant that has been put back.
    put_back_at: u32,
    lost: u32,
}

impl Dampers {
    /// Impacts since the last start.
    #[must_use]
    pub fn impacts(&self) -> u32 {
        self.meter.counts().total()
    }

    /// The ticks' count begins anew: counts from zero, the twin at rest; the spring stays where it is.
    pub fn restart(&mut self) {
        self.meter.reset();
        if let Some(twin) = &mut self.twin {
            twin.restart();
        }
        self.amplitude = CycleAmplitude::default();
        self.base_amplitude_m = None;
        self.impacts_in_cycle = 0;
        self.impacts.clear();
        self.put_back_at = 0;
    }

    /// The twin begins again with a simulated plant that is put back to its start after this tick.
    pub fn put_back(&mut self, tick: u32) {
        // A contact that the putting back has cut off ends in the tick after.
        self.put_back_at = tick.wrapping_add(2);
        if let Some(twin) = &mut self.twin {
            twin.put_back();
        }
    }

    /// What this tick's samples show; whether there was a force on a wall, which takes its time.
    pub fn measure(&mut self, tick: u32, sensors: &Sensors, readings: &Readings, frequency_hz: f32) -> bool {
        self.base_amplitude_m = self.amplitude.push(readings.z.mean_m, frequency_hz);
        let Self { meter, twin, impacts, lost, put_back_at, .. } = self;
        let pulses = meter.push(tick, &sensors.walls, |record| {
            if let Some(twin) = twin
                && record.tick >= *put_back_at
            {
                twin.detected(record);
            }
            *lost += u32::from(impacts.push_back(*record).is_err());
        });
        if let Some(twin) = twin {
            twin.take(tick, readings.x.mean_m, readings.z.mean_m);
        }
        pulses
    }

    /// The twin does what this tick leaves room for: one piece of its work. Before it would lose its place, as that of a fast
    /// structure or in a long chatter, it takes more than there is room for.
    pub fn follow(&mut self, has_time: bool) {
        let Some(twin) = &mut self.twin else { return };
        if has_time {
            twin.work();
        }
        for _ in 0..PIECES_WHEN_LATE {
            if !twin.is_late() {
                break;
            }
            twin.work();
        }
    }

    /// The twin has to make up for ticks that left it no time.
    #[must_use]
    pub fn twin_lags(&self) -> bool {
        self.twin.as_ref().is_some_and(Twin::lags)
    }

    /// What the twin shows; nothing without one.
    #[must_use]
    pub fn twin_signals(&self) -> &TwinSignals {
        self.twin.as_ref().map_or(&TwinSignals::NOTHING, Twin::signals)
    }

    /// A cycle of the drive has ended.
    pub fn end_cycle(&mut self) {
        self.impacts_in_cycle = self.meter.end_cycle();
    }

    /// The spring's tick; a fault's cause with the value that broke the limit, and the limit.
    pub fn tick_spring(
        &mut self,
        sensors: &Sensors,
        force_sensor: Verdict,
        is_busy: bool,
    ) -> (Motor, Option<(Cause, f32, f32)>) {
        let readings = &sensors.readings;
        let (motor, happening) = self.spring.tick(&Inputs {
            force_n: readings.spring_n,
            force_sensor,
            at_switch: sensors.at_limit,
            x_peak_m: readings.x.peak_m,
            base_amplitude_m: self.base_amplitude_m,
            is_busy,
            emergency_stop: sensors.emergency_stop,
        });
        let Some(happening) = happening else { return (motor, None) };
        self.lost += u32::from(self.happenings.push_back(happening).is_err());
        let fault = match happening {
            Happening::Fault(fault) => Some((fault.cause, fault.value, fault.limit)),
            _ => None,
        };
        (motor, fault)
    }

    /// Commands the brake until it closes, where one is wanted, N.
    pub fn brake(&mut self, wanted_n: Option<f32>) -> Brake {
        let Some(force_n) = wanted_n else { return Brake::Open };
        if !self.spring.is_braking() && !self.spring.brake(force_n) {
            return Brake::Waits;
        }
        if self.spring.stage() == Stage::Holding { Brake::Holds } else { Brake::Closes }
    }

    /// Lets go of what was pressed as a brake. A spring that cannot has let go already.
    pub fn let_go(&mut self) {
        if self.spring.is_braking() {
            let _ = self.spring.handle(SpringCommand::Release);
        }
    }

    /// There is something to tell, and time for it: a busy tick has none until half of what may wait does.
    #[must_use]
    pub fn is_to_tell(&self, busy: bool) -> bool {
        let waits = !(self.impacts.is_empty() && self.happenings.is_empty());
        waits && (!busy || self.impacts.len() + self.happenings.len() > HAPPENINGS_WAITING / 2)
    }

    /// The next thing to tell.
    pub fn pop(&mut self) -> Option<super::Event> {
        if let Some(happening) = self.happenings.pop_front() {
            return Some(super::Event::Spring(happening));
        }
        self.impacts.pop_front().map(super::Event::Impact)
    }

    /// Events that found no room.
    #[must_use]
    pub fn lost(&self) -> u32 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::impacts::Pair;
    use crate::model::{Particle, SetUp, Structure, Wall};
    use crate::rig::{Reading, TICK_HZ};
    use crate::sine::Phase;
    use crate::twin::TwinConfig;

    fn set_up(natural_frequency_hz: f64, clearance_m: f64) -> SetUp {
        let particle = Particle {
            mass_kg: 0.16,
            clearance_m,
            friction_coefficient: 0.05,
            wall: Wall::Restitution { coefficient: 0.3 },
        };
        SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, natural_frequency_hz, 0.0038)) }
    }

    #[test]
    fn a_pulse_of_a_plant_that_was_put_back_is_told_and_not_taught() {
        let set_up = set_up(2.5, 7.5e-3);
        let quiet = Sensors::default();
        let mut touched = quiet;
        // A half-sine of 0.4 ms in the middle of the tick's block, ended when the block is.
        for (n, pair) in touched.walls[10..30].iter_mut().enumerate() {
            let force = 800.0 * libm::sinf(core::f32::consts::PI * (n as f32 + 0.5) / 20.0);
            *pair = Pair::new(pair.of(0), pair.of(1) + force as u16);
        }
        for (put_back_at, taught) in [(None, 1), (Some(50), 0), (Some(49), 0), (Some(48), 1)] {
            let twin = Some(Twin::new(&TwinConfig::new(set_up)).unwrap());
            let mut dampers = Dampers { twin, ..Dampers::default() };
            for tick in 0..200 {
                let sensors = if tick == 50 { &touched } else { &quiet };
                dampers.measure(tick, sensors, &sensors.readings, 2.5);
                if put_back_at == Some(tick) {
                    dampers.put_back(tick);
                }
                dampers.follow(true);
            }
            assert_eq!((dampers.impacts(), dampers.impacts.len()), (1, 1), "{put_back_at:?}");
            assert_eq!(dampers.twin_signals().detected, taught, "{put_back_at:?}");
        }
    }

    #[test]
    fn a_twin_of_a_fast_structure_and_one_that_gets_no_time_keep_their_place() {
        for (frequency_hz, z_m, time_every) in [(30.0, 1e-4, 1), (30.0, 1e-4, 3), (2.5, 2e-3, u32::MAX)] {
            let set_up = set_up(f64::from(frequency_hz), 2e-3);
            let twin = Some(Twin::new(&TwinConfig { follow_hz: 0.0, ..TwinConfig::new(set_up) }).unwrap());
            let (mut dampers, mut phase) = (Dampers { twin, ..Dampers::default() }, Phase::default());
            for tick in 0..5000u32 {
                phase.advance(Phase::increment(frequency_hz, TICK_HZ));
                let sensors = Sensors {
                    readings: Readings { z: Reading::still(z_m * phase.sin_cos().0), ..Sensors::default().readings },
                    ..Sensors::default()
                };
                dampers.measure(tick, &sensors, &sensors.readings, frequency_hz);
                dampers.follow(tick % time_every == 0);
                assert_eq!(dampers.twin_signals().lost, 0, "{frequency_hz} Hz, time every {time_every}, tick {tick}");
            }
            assert!(dampers.twin_signals().predicted > 10, "{:?}", dampers.twin_signals());
        }
    }
}
