//! The quantities that are compared, and their values in a run and in a simulation. A simulated motion is measured by the board's own
//! code, over the same ticks.

use std::collections::BTreeMap;
use std::ops::Range;

use damprig_core::control::outcome::{Outcome, TickInputs};
use damprig_core::control::transient::free_vibration::{FreeVibrationPlan, FreeVibrationRunner};
use damprig_core::io::{Reading, Readings, SensorSet, TICK_HZ};
use damprig_core::measure::point::{Place, PointMeter};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::measure::transient::{TransientMeter, TransientResult};
use damprig_core::sine::Phase;
use damprig_motion::read_run::{SimulatedMotion, TICK_S, TickReading, WallPulse};

use crate::campaign::FreeVibration;
use crate::prediction::contact_s;
use crate::quantity::Quantity;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::transients::TransientRow;

/// Values of several quantities.
pub(super) type MetricValues = BTreeMap<Quantity, f64>;

/// Impacts and the largest force on a wall, as the board measured them or a simulation has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Walls {
    /// Impacts that are counted.
    pub(super) impacts: u32,
    /// Largest force of a soft wall, N.
    pub(super) force_n: f64,
    /// Largest impulse on a hard wall, N·s.
    pub(super) impulse_n_s: f64,
}

impl Walls {
    /// Of a simulated motion, in these ticks of it.
    pub(super) fn of(pulses: &[WallPulse], ticks: &Range<usize>) -> Self {
        let own = || pulses.iter().filter(|pulse| ticks.contains(&pulse.tick));
        // A pulse just below the threshold may have been counted in the run.
        let force_n = own().map(|pulse| pulse.peak_n).fold(0.0, f64::max);
        // A half-sine of the contact's length has the impulse 2 F τ/π.
        let impulse_n_s = force_n * 2.0 * contact_s() / std::f64::consts::PI;
        Self { impacts: own().filter(|pulse| pulse.is_counted).count() as u32, force_n, impulse_n_s }
    }

    fn add_to(self, values: &mut MetricValues, is_soft: bool, cycles: Option<u32>) {
        match cycles {
            Some(cycles) => {
                values.insert(Quantity::ImpactsPerCycle, f64::from(self.impacts) / f64::from(cycles.max(1)))
            }
            None => values.insert(Quantity::Impacts, f64::from(self.impacts)),
        };
        // There is no largest impact without one.
        if self.force_n > 0.0 {
            // A hard wall beside a soft one is compared by the impulse of its pulses.
            let (metric, value) = if is_soft {
                (Quantity::PeakContactForceN, self.force_n)
            } else {
                (Quantity::MaxImpulseNS, self.impulse_n_s)
            };
            values.insert(metric, value);
        }
    }
}

/// What is known about the walls of a set-up: whether they are soft, `None` without a particle.
pub(super) type WallKind = Option<bool>;

/// The measured values of a point.
pub(super) fn of_result(row: &ResultRow, walls: Walls, kind: WallKind) -> MetricValues {
    let mut values = MetricValues::from([
        (Quantity::XOverZ, row.x_over_z()),
        (Quantity::XOverZLockIn, row.x_over_z_lock_in()),
        (Quantity::PhaseRad, f64::from(row.phase_rad)),
        (Quantity::MaxAbsXM, f64::from(row.max_abs_x_m)),
        (Quantity::RmsXM, f64::from(row.rms_x_m)),
    ]);
    if let Some(is_soft) = kind {
        walls.add_to(&mut values, is_soft, Some(row.cycles));
    }
    values
}

/// The window of a point in a simulated motion.
#[derive(Clone, Debug)]
pub(super) struct PointWindow<'a> {
    /// Ticks of the motion.
    pub(super) ticks: Range<usize>,
    /// Phase of the drive in each tick of the motion.
    pub(super) phases: &'a [Phase],
    /// Drive frequency, Hz.
    pub(super) frequency_hz: f64,
    /// Whole cycles.
    pub(super) cycles: u32,
}

fn readings(of: &TickReading) -> Readings {
    let reading = |mean_m, peak_m| Reading { mean_m, peak_m, inside_peak_m: peak_m, ..Reading::default() };
    Readings { x: reading(of.x_m, of.max_abs_x_m), z: reading(of.z_m, of.max_abs_z_m), ..Readings::default() }
}

/// The simulated values of a point; `None` if the window has another number of cycles than the measured one.
pub(super) fn of_simulated_point(
    motion: &SimulatedMotion,
    window: &PointWindow,
    kind: WallKind,
) -> Option<MetricValues> {
    let increment = Phase::increment(window.frequency_hz as f32, TICK_HZ);
    let over = |phase: Phase| phase.0 as f32 / increment as f32;
    let own = motion.readings.get(window.ticks.clone())?;
    let phases = window.phases.get(window.ticks.clone())?;
    let mut meter = PointMeter::new(window.cycles, over(*phases.first()?));
    for (reading, phase) in own.iter().zip(phases) {
        meter.push(&readings(reading), 0.0, phase.sin_cos());
        let mut next = *phase;
        if next.advance(increment) {
            meter.end_cycle(over(next));
        }
    }
    if meter.cycles() != window.cycles {
        return None;
    }
    let place = Place { frequency_hz: window.frequency_hz as f32, ..Place::default() };
    let result = meter.result(&place, &SteadyLimits::default());
    let z = f64::from(result.z_amplitude_m);
    let mut values = MetricValues::from([
        (Quantity::XOverZ, f64::from(result.mean_cycle_max_m) / z),
        (Quantity::XOverZLockIn, f64::from(result.x_amplitude_m) / z),
        (Quantity::PhaseRad, f64::from(result.phase_rad)),
        (Quantity::MaxAbsXM, f64::from(result.max_abs_x_m)),
        (Quantity::RmsXM, f64::from(result.rms_x_m)),
    ]);
    if let Some(is_soft) = kind {
        Walls::of(&motion.pulses, &window.ticks).add_to(&mut values, is_soft, Some(window.cycles));
    }
    Some(values)
}

/// The measured values of a record, a pulse or a free vibration. `x_m`: the readings of x in its ticks, if they were recorded.
pub(super) fn of_transient(row: &TransientRow, x_m: Option<&[f32]>, walls: Walls, kind: WallKind) -> MetricValues {
    let mut values = MetricValues::from([(Quantity::RmsXM, f64::from(row.rms_x_m))]);
    if row.kind == "free_vibration" {
        if row.cycles > 0 {
            values
                .extend([(Quantity::DampingRatio, row.damping_ratio), (Quantity::DecayFrequencyHz, row.frequency_hz)]);
        }
    } else {
        values.extend([
            (Quantity::MaxAbsXM, f64::from(row.max_abs_x_m)),
            (Quantity::MaxAbsXMinusZM, f64::from(row.max_abs_x_minus_z_m)),
        ]);
        values
            .extend(x_m.and_then(|x_m| time_of_largest(x_m.iter().copied())).map(|t_s| (Quantity::MaxAbsXTimeS, t_s)));
    }
    if let Some(is_soft) = kind {
        walls.add_to(&mut values, is_soft, None);
    }
    values
}

/// When |x| is largest, s after the first.
fn time_of_largest(x_m: impl Iterator<Item = f32>) -> Option<f64> {
    let largest = x_m.enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(largest.0 as f64 * TICK_S)
}

/// The simulated values of a playback, in these ticks of the motion.
pub(super) fn of_simulated_playback(
    motion: &SimulatedMotion,
    ticks: &Range<usize>,
    kind: WallKind,
) -> Option<MetricValues> {
    let own = motion.readings.get(ticks.clone())?;
    let mut meter = TransientMeter::default();
    own.iter().for_each(|reading| meter.push(&readings(reading), 0.0));
    let result = meter.result();
    let mut values = MetricValues::from([
        (Quantity::RmsXM, f64::from(result.rms_x_m)),
        (Quantity::MaxAbsXM, f64::from(result.max_abs_x_m)),
        (Quantity::MaxAbsXMinusZM, f64::from(result.max_abs_x_minus_z_m)),
    ]);
    values.extend(time_of_largest(own.iter().map(|reading| reading.x_m)).map(|t_s| (Quantity::MaxAbsXTimeS, t_s)));
    if let Some(is_soft) = kind {
        Walls::of(&motion.pulses, ticks).add_to(&mut values, is_soft, None);
    }
    Some(values)
}

/// What the board measures of a simulated release that it read as `held_m` before, and the tick of the motion in which it detects the
/// release; `None` if it detects none, or the motion is too short.
pub(super) fn release(motion: &SimulatedMotion, free: &FreeVibration, held_m: f32) -> Option<(TransientResult, usize)> {
    let order = free.order();
    let held_ticks = (f64::from(order.hold_s) * f64::from(TICK_HZ)).ceil() as u32 + 2;
    let mut runner = FreeVibrationRunner::new(&FreeVibrationPlan::new(order).ok()?);
    let held = Readings { x: Reading::still(held_m), ..Readings::default() };
    let mut tick = 0;
    let mut pass = |readings: &Readings| {
        let outcome = runner.tick(&TickInputs { tick, readings, impacts: 0, clipped: SensorSet::default() });
        tick += 1;
        outcome
    };
    for _ in 0..held_ticks {
        pass(&held);
    }
    for reading in &motion.readings {
        if let Outcome::Transient(result) = pass(&readings(reading)) {
            return Some((result, (result.start_tick.checked_sub(held_ticks)?) as usize));
        }
    }
    None
}

/// The simulated values of a release.
pub(super) fn of_simulated_release(
    motion: &SimulatedMotion,
    (result, detected): &(TransientResult, usize),
    kind: WallKind,
) -> MetricValues {
    let mut values = MetricValues::from([(Quantity::RmsXM, f64::from(result.rms_x_m))]);
    let decay = &result.decay;
    if decay.cycles > 0 {
        let cycles = f64::from(decay.cycles);
        let decrement = (f64::from(decay.start_m) / f64::from(decay.end_m)).ln() / cycles;
        values.insert(Quantity::DampingRatio, decrement / std::f64::consts::TAU.hypot(decrement));
        values.insert(Quantity::DecayFrequencyHz, cycles / f64::from(decay.span_s));
    }
    if let Some(is_soft) = kind {
        let ticks = *detected..*detected + (result.end_tick - result.start_tick) as usize;
        Walls::of(&motion.pulses, &ticks).add_to(&mut values, is_soft, None);
    }
    values
}
