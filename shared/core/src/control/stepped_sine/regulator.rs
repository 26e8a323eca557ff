//! What sets the drive of a stepped sine: a constant amplitude, the loop of the base, or the loop of the response.

use super::DriveMode;
use crate::control::base_loop::{BaseLoop, RUNAWAY};
use crate::control::fault::{Fault, FaultCause};
use crate::control::outcome::TickInputs;
use crate::control::response_loop::ResponseControl;
use crate::io::{Rail, Readings, TICK_HZ};

/// The phase of the drive in a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrivePhase {
    /// Sine and cosine of it.
    pub wave: (f32, f32),
    /// The phase that the readings belong to, its increment to the next readings, and its sine and cosine.
    pub then: u32,
    pub increment_then: u32,
    pub wave_then: (f32, f32),
    /// Largest amplitude that the base was asked for in the last cycles, m.
    pub recent_m: f32,
}

/// Sets the drive's amplitude.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub(super) enum Regulator {
    Constant,
    Base(BaseLoop),
    /// With the loop by which the base follows on a shaker.
    Response(ResponseControl, Option<BaseLoop>),
}

impl Regulator {
    /// A regulator with no drive.
    pub fn new(mode: &DriveMode) -> Self {
        match mode {
            DriveMode::Constant => Self::Constant,
            DriveMode::ClosedLoop(parameters) => Self::Base(BaseLoop::new(parameters)),
            DriveMode::Response(parameters) => {
                Self::Response(ResponseControl::new(parameters), parameters.base.as_ref().map(BaseLoop::new))
            }
        }
    }

    /// Begins a point, with this amplitude of the kept response if it has one of its own.
    pub fn begin_point(&mut self, mode: &DriveMode, frequency_hz: f32, kept: Option<f32>) {
        match self {
            Self::Constant => {}
            Self::Base(own) => own.begin_point(),
            Self::Response(own, base) => {
                own.begin_point(kept);
                if let Some(base) = base {
                    base.begin_point();
                }
            }
        }
        self.tune(mode, frequency_hz);
    }

    /// Changes the frequency; the drive's amplitude and phase carry over.
    pub fn tune(&mut self, mode: &DriveMode, frequency_hz: f32) {
        match (self, mode) {
            (Self::Base(own), DriveMode::ClosedLoop(parameters)) => own.tune(parameters, frequency_hz, TICK_HZ),
            (Self::Response(own, base), DriveMode::Response(parameters)) => {
                own.tune(frequency_hz, TICK_HZ);
                if let (Some(base), Some(parameters)) = (base, &parameters.base) {
                    base.tune(parameters, frequency_hz, TICK_HZ);
                }
            }
            _ => {}
        }
    }

    /// The amplitude is within the loop's tolerance.
    pub fn is_held(&self) -> bool {
        match self {
            Self::Constant => true,
            Self::Base(own) => own.is_held(),
            Self::Response(own, _) => own.is_held(),
        }
    }

    /// A loop keeps the response's amplitude.
    pub fn keeps_response(&self) -> bool {
        matches!(self, Self::Response(..))
    }

    /// The loop's drive was at its limit.
    pub fn is_saturated(&self) -> bool {
        match self {
            Self::Constant => false,
            Self::Base(own) => own.is_saturated(),
            Self::Response(own, base) => own.is_saturated() || base.as_ref().is_some_and(BaseLoop::is_saturated),
        }
    }

    /// The drive without feedback, m; `amplitude_m` is that of a constant drive.
    pub fn open(&self, amplitude_m: f32, wave: (f32, f32)) -> f32 {
        match self {
            Self::Constant => amplitude_m * wave.0,
            Self::Base(own) => own.open(wave),
            Self::Response(own, base) => base.as_ref().map_or_else(|| own.open(wave), |base| base.open(wave)),
        }
    }

    /// Base amplitude that the response's loop demands next, m; 0 of other drives.
    pub fn base_foreseen_m(&self) -> f32 {
        if let Self::Response(own, _) = self { own.base_foreseen_m() } else { 0.0 }
    }

    /// The drive of this tick, m, at this height of the ramp, and a fault. `amplitude_m` is the demanded amplitude of the
    /// base. While a reading that a loop needs is no displacement, the drive continues at its last amplitude and phase.
    pub fn tick(&mut self, ramp: f32, amplitude_m: f32, now: &TickInputs, at: &DrivePhase) -> (f32, Option<Fault>) {
        let Readings { x, z, .. } = now.readings;
        let is_cycle_end = at.then.checked_add(at.increment_then).is_none();
        let (is_x_read, is_z_read) = (x.rail == Rail::Clear, z.rail == Rail::Clear);
        let ran_away = |base: &BaseLoop, demand_m: f32| {
            let value = base.runaway(demand_m)?;
            Some(Fault { cause: FaultCause::BaseRunaway, tick: now.tick, value, limit: RUNAWAY * demand_m })
        };
        match self {
            Self::Constant => (ramp * (amplitude_m * at.wave.0), None),
            Self::Base(own) => {
                if !is_z_read {
                    return (own.open(at.wave), None);
                }
                let drive = own.tick((ramp * amplitude_m, 0.0), z.mean_m, at.wave_then, at.wave);
                if !is_cycle_end {
                    return (drive, None);
                }
                own.end_cycle(amplitude_m);
                (drive, ran_away(own, at.recent_m))
            }
            Self::Response(own, base) => {
                let reading = (is_x_read && is_z_read).then_some((x.mean_m, z.mean_m));
                let demand = own.tick(ramp, reading, (at.then, at.increment_then, at.wave_then));
                let Some(base) = base else { return (own.open(at.wave), None) };
                if !is_z_read {
                    return (base.open(at.wave), None);
                }
                let drive = base.tick(demand, z.mean_m, at.wave_then, at.wave);
                if !is_cycle_end {
                    return (drive, None);
                }
                base.end_cycle(own.demanded_m());
                (drive, ran_away(base, amplitude_m.max(own.largest_demand_m())))
            }
        }
    }

    /// The largest amplitude that the base was asked for in the last cycles, m; `amplitude_m` is the least.
    pub fn demand_m(&self, amplitude_m: f32) -> f32 {
        let Self::Response(own, _) = self else { return amplitude_m };
        amplitude_m.max(own.largest_demand_m())
    }

    /// The amplitude that the response's loop demands now, m; `None` of other drives.
    pub fn demanded_m(&self) -> Option<f32> {
        if let Self::Response(own, _) = self { Some(own.demanded_m()) } else { None }
    }
}
