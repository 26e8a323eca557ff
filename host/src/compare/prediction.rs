//! Simulates the models of a set-up on a base motion, and gives the values in its measured windows with their standard uncertainties.

use std::ops::Range;

use rayon::prelude::*;

use damprig_motion::read_run::{SimulatedMotion, TICK_S, simulate};
use damprig_motion::watch::Detection;

use super::base::BaseMotion;
use super::ensemble::{self, Member, Models};
use super::metric::MetricValues;
use super::spring::SpringForce;
use super::{COVERAGE_FACTOR, ComparedMetric, PredictedQuantity, UncertainValue, Verdict};
use crate::identify::sensors::rectangular;
use crate::quantity::Quantity;

/// Values of a prediction with their standard uncertainties, and whether nearby trajectories diverge.
#[derive(Clone, Debug, Default)]
pub(super) struct PredictedValues {
    pub(super) values: MetricValues,
    pub(super) uncertainties: MetricValues,
    pub(super) is_sensitive: bool,
}

impl PredictedValues {
    /// Adds what the reading of x contributes: values of the same motion read at both ends of the reading's error.
    pub(super) fn add_reading(&mut self, [low, high]: &[Option<MetricValues>; 2]) {
        let (Some(low), Some(high)) = (low, high) else { return };
        for (metric, u) in &mut self.uncertainties {
            if let (Some(low), Some(high)) = (low.get(metric), high.get(metric)) {
                *u = u.hypot(rectangular(0.5 * (high - low)));
            }
        }
    }
}

/// The predictions for the windows of one simulation.
pub(super) struct WindowPredictions {
    /// The motion of the set-up as stated.
    pub(super) motion: SimulatedMotion,
    /// One for each window; none where the window does not fit.
    pub(super) predictions: Vec<Option<PredictedValues>>,
}

/// Two motions part when their difference is this share of the motion.
const PARTED: f64 = 0.1;

/// Relative standard uncertainty of a simulation: interpolation of the base, and the board's measurement in single precision.
const NUMERICAL: f64 = 1e-5;

/// Standard uncertainty of a value on a friction damper's measured base, in differences between two readings of the base. On the
/// virtual rig, with noise and a shaker, the error was up to 3.6 of them.
const BY_READING: f64 = 2.0;

/// What to simulate: the models on a base motion, measured in windows of it.
pub(super) struct Question<'a, M> {
    pub(super) models: &'a Models,
    pub(super) start_m: f64,
    pub(super) base: &'a BaseMotion,
    /// The force of the friction damper's spring.
    pub(super) spring: &'a SpringForce,
    pub(super) detection: &'a Detection,
    /// The measured parts of the motion.
    pub(super) windows: Vec<Window>,
    /// The values of a motion in the window of this place.
    pub(super) measure: M,
}

impl<M: Fn(&SimulatedMotion, usize) -> Option<MetricValues> + Sync> Question<'_, M> {
    fn motion(&self, member: &Member) -> Option<SimulatedMotion> {
        let scaled = (member.base_factor != 1.0).then(|| self.base.scaled(member.base_factor));
        let base = scaled.as_ref().unwrap_or(self.base);
        simulate(&member.model, &member.initial, &base.ends_m, self.spring.shares(), self.detection).ok()
    }

    /// The motion on the base read with a parabola of another width.
    fn base_otherwise(&self, member: &Member) -> Option<SimulatedMotion> {
        let scaled = (member.base_factor != 1.0).then(|| self.base.scaled(member.base_factor));
        let base = scaled.as_ref().unwrap_or(self.base);
        simulate(&member.model, &member.initial, base.otherwise_m.as_ref()?, self.spring.shares(), self.detection).ok()
    }

    /// The values in all windows. Ratios refer to the run's own z.
    fn measured(&self, motion: &SimulatedMotion, member: &Member) -> Vec<Option<MetricValues>> {
        let to_own_z = self.models.force_factor(&member.model.set_up);
        let values = |window: usize| {
            let mut values = (self.measure)(motion, window)?;
            for metric in [Quantity::XOverZ, Quantity::XOverZLockIn] {
                values.entry(metric).and_modify(|ratio| *ratio *= to_own_z);
            }
            Some(values)
        };
        (0..self.windows.len()).map(values).collect()
    }

    /// The predictions; `None` for a set-up that cannot be simulated.
    pub(super) fn answer(&self) -> Option<WindowPredictions> {
        let stated = self.models.stated(self.start_m);
        let neighbour = || self.models.neighbour(self.start_m).and_then(|member| self.motion(&member));
        let (motion, neighbour) = rayon::join(|| self.motion(&stated), neighbour);
        let motion = motion?;
        let parts = |window: &Window| neighbour.as_ref().is_some_and(|other| parted(&motion, other, &window.ticks));
        let are_sensitive: Vec<bool> = self.windows.iter().map(parts).collect();
        drop(neighbour);
        let otherwise = self.base_otherwise(&stated).map(|motion| self.measured(&motion, &stated));
        let members = self.models.members(self.start_m, self.spring.uncertainty);
        let of_members: Vec<Vec<Option<MetricValues>>> =
            members.par_iter().filter_map(|member| Some(self.measured(&self.motion(member)?, member))).collect();
        let predictions = self.measured(&motion, &stated).into_iter().enumerate().map(|(window, stated)| {
            let own: Vec<MetricValues> = of_members.iter().filter_map(|all| all[window].clone()).collect();
            let otherwise = otherwise.as_ref().and_then(|all| all[window].as_ref());
            let stated = stated?;
            let (values, mut uncertainties) = ensemble::summary(&stated, &own);
            for (metric, u) in &mut uncertainties {
                let of_base = otherwise.and_then(|other| Some(metric.difference(*other.get(metric)?, stated[metric])));
                let own = self.numerical(*metric, values[metric], &motion, &self.windows[window]);
                let of_noise = self.of_noise(*metric, &values, &self.windows[window]);
                *u = u.hypot(own).hypot(of_noise).hypot(BY_READING * of_base.unwrap_or(0.0));
            }
            Some(PredictedValues { values, uncertainties, is_sensitive: are_sensitive[window] })
        });
        let predictions = predictions.collect();
        Some(WindowPredictions { motion, predictions })
    }

    /// Standard uncertainty of a simulated value besides that of its inputs.
    fn numerical(&self, metric: Quantity, value: f64, motion: &SimulatedMotion, window: &Window) -> f64 {
        match metric {
            Quantity::PhaseRad => NUMERICAL,
            Quantity::Impacts | Quantity::ImpactsPerCycle => {
                let cycles = if metric == Quantity::Impacts { 1.0 } else { window.cycles };
                self.near_threshold(motion, window) / 3.0_f64.sqrt() / cycles
            }
            Quantity::MaxAbsXTimeS => 0.5 * TICK_S,
            _ => value.abs() * NUMERICAL,
        }
    }

    /// Pulses near the threshold, which may be counted or not: the number above it or below it, whichever is larger. The noise of the
    /// sensor acts longer on the contacts of a soft wall.
    fn near_threshold(&self, motion: &SimulatedMotion, window: &Window) -> f64 {
        let near = if self.models.set_up.model().has_soft_walls() { 0.4 } else { 0.2 };
        let threshold_n = self.detection.threshold_n;
        let is_near = |peak_n: f64| (peak_n / threshold_n - 1.0).abs() < near;
        let own = || motion.pulses.iter().filter(|pulse| window.ticks.contains(&pulse.tick) && is_near(pulse.peak_n));
        let counted = own().filter(|pulse| pulse.is_counted).count();
        counted.max(own().count() - counted) as f64
    }

    /// Standard uncertainty by the noise of a measured base: it excites the structure's free vibration.
    fn of_noise(&self, metric: Quantity, values: &MetricValues, window: &Window) -> f64 {
        let structure = self.models.set_up.model().structure;
        let (omega, zeta) = (structure.angular_frequency_rad_per_s(), structure.damping_ratio());
        let excited = (0.5 * omega * window.ticks.end as f64 * TICK_S).min(0.25 / zeta);
        let moved_m = window.z_noise_m * (excited * omega * TICK_S).sqrt();
        if moved_m == 0.0 {
            return 0.0;
        }
        match metric {
            Quantity::XOverZ | Quantity::XOverZLockIn => moved_m / window.z_m,
            Quantity::PhaseRad => {
                moved_m / (window.z_m * values.get(&Quantity::XOverZLockIn).copied().unwrap_or(f64::NAN))
            }
            Quantity::MaxAbsXM | Quantity::RmsXM | Quantity::MaxAbsXMinusZM => moved_m,
            // Of a base at rest, or not by the structure's free vibration.
            _ => 0.0,
        }
    }
}

/// A measured part of a motion, and what the noise of its base is compared with.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    /// Its ticks.
    pub(super) ticks: Range<usize>,
    /// Cycles of the drive.
    pub(super) cycles: f64,
    /// RMS noise of a reading of z, m; 0 of an ideal base.
    pub(super) z_noise_m: f64,
    /// Amplitude of z at a point, m.
    pub(super) z_m: f64,
}

/// Whether two motions differ by more than [`PARTED`] of their size in these ticks.
fn parted(a: &SimulatedMotion, b: &SimulatedMotion, ticks: &Range<usize>) -> bool {
    let square = |x: f32| f64::from(x) * f64::from(x);
    let [a, b] = [a, b].map(|motion| motion.readings.get(ticks.clone()).unwrap_or_default());
    let difference: f64 = a.iter().zip(b).map(|(a, b)| square(a.x_m - b.x_m)).sum();
    difference > PARTED * PARTED * a.iter().map(|a| square(a.x_m)).sum::<f64>()
}

/// The compared quantities of a point.
pub(super) fn metrics(
    measured: &MetricValues,
    of_measured: &MetricValues,
    on_measured: Option<&PredictedValues>,
    on_ideal: Option<&PredictedValues>,
) -> Vec<ComparedMetric> {
    let compared = |(metric, value): (&Quantity, &f64)| {
        let own = UncertainValue {
            value: *value,
            expanded: COVERAGE_FACTOR * of_measured.get(metric).copied().unwrap_or(f64::NAN),
        };
        let beside = |prediction: Option<&PredictedValues>| predicted(*metric, own, prediction?);
        let (on_measured_base, on_ideal_base) = (beside(on_measured), beside(on_ideal));
        ComparedMetric {
            metric: *metric,
            unit: metric.unit(),
            measured: own,
            on_measured_base,
            on_ideal_base,
            verdict: Verdict::of(on_measured_base.as_ref().or(on_ideal_base.as_ref())),
        }
    };
    measured.iter().filter(|(_, value)| value.is_finite()).map(compared).collect()
}

fn predicted(metric: Quantity, measured: UncertainValue, prediction: &PredictedValues) -> Option<PredictedQuantity> {
    let (value, u) = (*prediction.values.get(&metric)?, *prediction.uncertainties.get(&metric)?);
    let expanded = COVERAGE_FACTOR * u;
    let normalised_error = metric.difference(measured.value, value) / measured.expanded.hypot(expanded);
    (value.is_finite() && normalised_error.is_finite())
        .then_some(PredictedQuantity { value: UncertainValue { value, expanded }, normalised_error })
}
