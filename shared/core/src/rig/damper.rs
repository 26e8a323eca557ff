//! The dampers' side of a tick: wall forces, the twin that expects them, and the friction damper's spring.

use super::{Readings, Sensors};
use crate::control::friction_spring::{Cause, Drive as Motor, FrictionSpring, Happening, Inputs, SpringCommand};
use crate::measure::amplitude::CycleAmplitude;
use crate::measure::impacts::{ImpactMeter, ImpactRecord};
use crate::twin::{Twin, TwinSignals, Work};
use heapless::Deque;

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

    /// The twin does what this tick leaves room for: one piece of its work, and one more if that was a quiet one and it is
    /// late.
    pub fn follow(&mut self, has_time: bool) {
        let Some(twin) = &mut self.twin else { return };
        if has_time && twin.work() == Work::Quiet && twin.is_late() && !twin.is_near() {
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
