//! The dampers' side of a tick: wall forces, the twin that expects them, and the friction damper's spring.

use super::{Readings, Sensors};
use crate::control::friction_spring::{Cause, Drive as Motor, FrictionSpring, Happening, Inputs, SpringCommand};
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
    pub(super) twin_signals: TwinSignals,
    pub(super) impacts_in_cycle: u32,
    impacts: Deque<ImpactRecord, IMPACTS_WAITING>,
    happenings: Deque<Happening, HAPPENINGS_WAITING>,
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
    }

    /// The twin begins again with a simulated plant that was put back to its start.
    pub fn put_back(&mut self) {
        if let Some(twin) = &mut self.twin {
            twin.put_back();
        }
    }

    /// What this tick's samples show; whether there was a force on a wall, which takes its time.
    pub fn measure(&mut self, tick: u32, sensors: &Sensors, readings: &Readings, frequency_hz: f32) -> bool {
        self.base_amplitude_m = self.amplitude.push(readings.z.mean_m, frequency_hz);
        let Self { meter, twin, impacts, lost, .. } = self;
        let pulses = meter.push(tick, &sensors.walls, |record| {
            if let Some(twin) = twin {
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
        self.twin_signals = *twin.signals();
    }

    /// A cycle of the drive has ended.
    pub fn end_cycle(&mut self) {
        self.impacts_in_cycle = self.meter.end_cycle();
    }

    /// The spring's tick; a fault's cause with the value that broke the limit, and the limit.
    pub fn tick_spring(&mut self, sensors: &Sensors, readings: &Readings) -> (Motor, Option<(Cause, f32, f32)>) {
        let (motor, happening) = self.spring.tick(&Inputs {
            force_n: readings.spring_n,
            at_switch: sensors.at_limit,
            x_peak_m: readings.x.peak_m,
            base_amplitude_m: self.base_amplitude_m,
        });
        let Some(happening) = happening else { return (motor, None) };
        self.lost += u32::from(self.happenings.push_back(happening).is_err());
        let fault = match happening {
            Happening::Fault(fault) => Some((fault.cause, fault.value, fault.limit)),
            _ => None,
        };
        (motor, fault)
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
        let waiting = self.impacts.len() + self.happenings.len();
        waiting > if busy { HAPPENINGS_WAITING / 2 } else { 0 }
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
    use crate::model::{Particle, SetUp, Structure, Wall};
    use crate::rig::{Reading, TICK_HZ};
    use crate::sine::Phase;
    use crate::twin::TwinConfig;

    #[test]
    fn a_twin_of_a_fast_structure_and_one_that_gets_no_time_keep_their_place() {
        let particle = Particle {
            mass_kg: 0.16,
            clearance_m: 2e-3,
            friction_coefficient: 0.05,
            wall: Wall::Restitution { coefficient: 0.3 },
        };
        for (frequency_hz, z_m, time_every) in [(30.0, 1e-4, 1), (30.0, 1e-4, 3), (2.5, 2e-3, u32::MAX)] {
            let structure = Structure::from_modal(1.6, f64::from(frequency_hz), 0.0038);
            let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
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
                assert_eq!(dampers.twin_signals.lost, 0, "{frequency_hz} Hz, time every {time_every}, tick {tick}");
            }
            assert!(dampers.twin_signals.predicted > 10, "{:?}", dampers.twin_signals);
        }
    }
}
