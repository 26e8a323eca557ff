//! Checks the device's reports and results against the plan of a segment, before anything uses them.
//!
//! A frame with a correct checksum may still hold what was not asked for: a defective board, or one with another experiment.
//! What does not fit is dropped and counted (`misfit_messages`).

use std::ops::{Range, RangeInclusive};

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::response_loop::ResponseLoop;
use damprig_core::control::stepped_sine::DriveMode;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_core::measure::transient::TransientResult;
use damprig_protocol::{Event, Telemetry};

use crate::campaign::{Experiment, ExperimentKind, SteppedSine, TrackedResonance};
use crate::client::session::DeviceReport;

/// Longest wait for rest before a point, s, with some room; the device ends a longer one itself.
const LONGEST_REST_S: f64 = 660.0;

/// Most impacts in a tick: more than a particle can make in a millisecond.
const MAX_IMPACTS_PER_TICK: u64 = 8;

/// What may arrive in a segment.
#[derive(Clone, Debug)]
pub(super) struct PlanCheck {
    /// Signals in a row.
    width: usize,
    every_ticks: u16,
    points: Range<usize>,
    /// Of its points; none without a stepped sine.
    frequencies_hz: Option<PlannedFrequencies>,
    has_impacts: bool,
    last_tick: u32,
    /// Longest duration of the segment without a hold, ticks.
    longest_ticks: u32,
    impacts: u64,
}

/// The frequencies that results may have, Hz.
#[derive(Clone, Debug)]
enum PlannedFrequencies {
    /// Of each point.
    Known(Vec<f32>),
    /// Of the resonance that is tracked.
    Within(RangeInclusive<f32>),
}

/// A mean frequency over whole cycles is within this of the frequencies in it, relative: it is counted in ticks.
const OF_TICKS: f32 = 1e-3;

impl PlanCheck {
    /// For these points of an experiment; `width` signals every `every_ticks`.
    pub(super) fn new(
        experiment: &Experiment,
        points: Range<usize>,
        width: usize,
        every_ticks: u16,
        has_impacts: bool,
    ) -> Self {
        let sine = experiment.stepped_sine();
        let frequencies_hz = sine.map(|sine| match &sine.tracked {
            Some(TrackedResonance { lock, .. }) => {
                PlannedFrequencies::Within(lock.low_hz * (1.0 - OF_TICKS)..=lock.high_hz * (1.0 + OF_TICKS))
            }
            None => PlannedFrequencies::Known(sine.frequencies_hz[points.clone()].iter().map(|f| *f as f32).collect()),
        });
        let longest_s = match &experiment.kind {
            ExperimentKind::SteppedSine(sine) => points.len() as f64 * longest_point_s(sine),
            _ => LONGEST_REST_S + experiment.expected_s() + experiment.free_vibration().map_or(0.0, |f| f.timeout_s),
        };
        // Rounds to the largest tick where it is longer.
        let longest_ticks = (1.01 * (LONGEST_REST_S + longest_s) * f64::from(TICK_HZ)) as u32;
        let last_tick = longest_ticks;
        Self { width, every_ticks, points, frequencies_hz, has_impacts, last_tick, longest_ticks, impacts: 0 }
    }

    /// The experiment is held at its present point in this tick: the whole duration may follow.
    pub(super) fn held_in(&mut self, tick: u32) {
        self.last_tick = self.last_tick.max(tick.saturating_add(self.longest_ticks));
    }

    /// Whether a report can be one of this segment. Faults always are: they stop the rig.
    pub(super) fn admits(&mut self, report: &DeviceReport) -> bool {
        match report {
            DeviceReport::Telemetry(message) => self.admits_rows(message),
            DeviceReport::Event { event: Event::Fault(_) | Event::Spring(_), .. } => true,
            DeviceReport::Event { tick, .. } if *tick > self.last_tick => false,
            DeviceReport::Event { event: Event::Finished { points, .. }, .. } => {
                usize::from(*points) <= self.points.len()
            }
            DeviceReport::Event { event: Event::Point(result), .. } => self.admits_point(result, result.index),
            DeviceReport::Event { event: Event::Transient(result), .. } => self.admits_transient(result, result.index),
            DeviceReport::Event { tick, event: Event::Impact(impact) } => self.admits_impact(*tick, impact),
        }
    }

    /// The last tick that the segment can have.
    pub(super) fn last_tick(&self) -> u32 {
        self.last_tick
    }

    fn admits_rows(&self, message: &Telemetry) -> bool {
        let count = message.values.len();
        let rows = count.checked_div(self.width).unwrap_or(0);
        let last = u64::from(message.first_tick) + (rows as u64).saturating_sub(1) * u64::from(message.every_ticks);
        rows > 0
            && usize::from(message.width) == self.width
            && count.is_multiple_of(self.width)
            && message.every_ticks == self.every_ticks
            && message.first_tick.is_multiple_of(u32::from(self.every_ticks).max(1))
            && last <= u64::from(self.last_tick)
    }

    /// Whether a result can be that of the point `index`.
    pub(super) fn admits_point(&self, result: &PointResult, index: u16) -> bool {
        let is_planned = match &self.frequencies_hz {
            Some(PlannedFrequencies::Known(list)) => {
                let place = usize::from(index).checked_sub(self.points.start);
                place.and_then(|place| list.get(place)).is_some_and(|planned| *planned == result.frequency_hz)
            }
            Some(PlannedFrequencies::Within(range)) => {
                self.points.contains(&usize::from(index)) && range.contains(&result.frequency_hz)
            }
            None => false,
        };
        result.index == index && is_planned && self.admits_ticks(result.start_tick, result.end_tick)
    }

    /// Whether a result can be that of the record or free vibration `index`.
    pub(super) fn admits_transient(&self, result: &TransientResult, index: u16) -> bool {
        result.index == index
            && self.frequencies_hz.is_none()
            && self.points.contains(&usize::from(index))
            && self.admits_ticks(result.start_tick, result.end_tick)
    }

    fn admits_ticks(&self, start: u32, end: u32) -> bool {
        start <= end && end <= self.last_tick.saturating_add(1)
    }

    fn admits_impact(&mut self, tick: u32, impact: &ImpactRecord) -> bool {
        let numbers = [impact.centre_ticks, impact.peak_n, impact.impulse_n_s, impact.contact_s];
        self.impacts += 1;
        self.has_impacts
            && matches!(impact.side, -1 | 1)
            && impact.tick <= tick
            && numbers.iter().all(|number| number.is_finite())
            && self.impacts <= MAX_IMPACTS_PER_TICK * (u64::from(tick) + 1)
    }
}

/// Longest duration of a point, s: the wait for rest, the drive's rise and fall, settling, and in closed loop the wait for the
/// base and a dwell that is started again.
fn longest_point_s(sine: &SteppedSine) -> f64 {
    let wait_s = match sine.drive {
        DriveMode::Constant => 0.0,
        DriveMode::ClosedLoop(ClosedLoop { wait_s, .. }) | DriveMode::Response(ResponseLoop { wait_s, .. }) => {
            f64::from(wait_s)
        }
    };
    let wait_s = sine.tracked.as_ref().map_or(wait_s, |tracked| wait_s.max(f64::from(tracked.lock.wait_s)));
    let lowest_hz = sine.drive_range_hz().into_iter().fold(f64::INFINITY, f64::min);
    LONGEST_REST_S + 2.0 * sine.ramp_s + sine.settle_s + wait_s + 2.0 * sine.longest_dwell_s() + 4.0 / lowest_hz
}

#[cfg(test)]
mod tests {
    use damprig_core::io::SensorSet;
    use damprig_core::measure::steadiness::Steadiness;

    use super::*;

    fn check() -> PlanCheck {
        PlanCheck {
            width: 3,
            every_ticks: 10,
            points: 4..6,
            frequencies_hz: Some(PlannedFrequencies::Known(vec![2.4, 2.5])),
            has_impacts: true,
            last_tick: 10_000,
            longest_ticks: 10_000,
            impacts: 0,
        }
    }

    fn rows(width: u8, values: usize, first_tick: u32) -> DeviceReport {
        let values = (0..values).map(|n| n as f32).collect();
        DeviceReport::Telemetry(Box::new(Telemetry { seq: 0, first_tick, every_ticks: 10, width, values }))
    }

    fn point(index: u16, frequency_hz: f32, start_tick: u32, end_tick: u32) -> DeviceReport {
        let result = PointResult {
            index,
            frequency_hz,
            start_tick,
            end_tick,
            z_amplitude_m: 1e-3,
            z_distortion: 0.0,
            drive_amplitude_m: 1e-3,
            drive_saturated: false,
            clipped: SensorSet::default(),
            x_amplitude_m: 1e-3,
            phase_rad: 0.0,
            rms_x_m: 1e-3,
            mean_cycle_max_m: 1e-3,
            max_abs_x_m: 1e-3,
            last_cycle_max_m: 1e-3,
            change_per_cycle: 0.0,
            scatter: 0.0,
            cycles: 10,
            x_noise_rms_m: 0.0,
            deviation: 0.0,
            deviation_uncertainty: 0.0,
            interval: 0.0,
            steadiness: Steadiness::Steady,
            impacts_per_cycle: 0.0,
        };
        DeviceReport::Event { tick: end_tick.saturating_sub(1), event: Event::Point(result) }
    }

    fn impact(change: impl FnOnce(&mut ImpactRecord)) -> DeviceReport {
        let mut impact = ImpactRecord {
            tick: 5,
            centre_ticks: -0.5,
            side: 1,
            peak_n: 3.0,
            impulse_n_s: 0.01,
            contact_s: 0.002,
            clipped: false,
            held: false,
        };
        change(&mut impact);
        DeviceReport::Event { tick: 6, event: Event::Impact(impact) }
    }

    #[test]
    fn what_the_plan_asks_for_fits() {
        let reports =
            [rows(3, 63, 0), rows(3, 3, 10_000), point(4, 2.4, 0, 100), point(5, 2.5, 9_000, 10_001), impact(|_| {})];
        for report in reports {
            assert!(check().admits(&report), "{report:?}");
        }
    }

    #[test]
    fn a_hold_extends_the_time_of_the_plan() {
        let mut check = check();
        check.held_in(9_000);
        assert!(check.admits(&rows(3, 3, 19_000)) && check.admits(&point(4, 2.4, 18_000, 19_000)));
        assert!(!check.admits(&rows(3, 3, 19_010)));
    }

    #[test]
    fn rows_of_another_width_spacing_or_time_do_not_fit() {
        let misfits = [rows(0, 63, 0), rows(1, 63, 0), rows(2, 62, 0), rows(3, 64, 0), rows(3, 0, 0), rows(3, 63, 5)];
        for report in misfits.into_iter().chain([rows(3, 3, 10_010), rows(3, 63, u32::MAX - 5)]) {
            assert!(!check().admits(&report), "{report:?}");
        }
        assert!(!PlanCheck { every_ticks: 0, ..check() }.admits(&rows(3, 3, 0)), "nothing was asked for");
    }

    #[test]
    fn results_of_another_point_frequency_or_time_do_not_fit() {
        let misfits =
            [point(3, 2.4, 0, 100), point(6, 2.5, 0, 100), point(u16::MAX, 2.4, 0, 100), point(4, 2.5, 0, 100)];
        let late = [point(4, 2.4, 200, 100), point(4, f32::NAN, 0, 100), point(4, 2.4, 0, u32::MAX)];
        for report in misfits.into_iter().chain(late) {
            assert!(!check().admits(&report), "{report:?}");
        }
        let finished = |points| DeviceReport::Event { tick: 9, event: Event::Finished { points, rows_dropped: 0 } };
        assert!(check().admits(&finished(2)) && !check().admits(&finished(3)));
    }

    #[test]
    fn a_tracked_resonance_may_have_any_frequency_of_its_range() {
        let check = || PlanCheck { frequencies_hz: Some(PlannedFrequencies::Within(2.0..=3.0)), ..check() };
        assert!(check().admits(&point(4, 2.345, 0, 100)) && check().admits(&point(5, 3.0, 0, 100)));
        for misfit in [point(4, 1.9, 0, 100), point(4, f32::NAN, 0, 100), point(6, 2.5, 0, 100)] {
            assert!(!check().admits(&misfit), "{misfit:?}");
        }
    }

    #[test]
    fn an_impact_that_is_no_number_or_too_many_of_them_do_not_fit() {
        let damaged: [fn(&mut ImpactRecord); 5] = [
            |i| i.contact_s = f32::NAN,
            |i| i.peak_n = f32::INFINITY,
            |i| i.side = 0,
            |i| i.tick = 7,
            |i| i.centre_ticks = f32::NEG_INFINITY,
        ];
        for change in damaged {
            assert!(!check().admits(&impact(change)));
        }
        let mut check = check();
        let admitted = (0..1000).filter(|_| check.admits(&impact(|_| {}))).count();
        assert_eq!(admitted, 7 * MAX_IMPACTS_PER_TICK as usize);
    }
}
