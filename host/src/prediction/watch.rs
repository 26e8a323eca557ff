//! Watches a predicted motion: the largest |x| between its steps, and its impacts as the board would measure them.
//!
//! The board counts the pulses of the walls' force sensors. A pulse begins above a threshold; one that overlaps with the pulse
//! before it on the same wall is part of it, and a much weaker one shortly after it counts as ringing
//! ([`damprig_core::measure::impacts`]). So a chatter has more impacts than are counted.

use std::f64::consts::PI;

use damprig_core::integrator::polynomial::{Polynomial, derivative_increment, increment};
use damprig_core::integrator::sampled::{Flight, Impact, Observer};
use damprig_core::measure::impacts::ImpactConfig;
use damprig_simulator::plant::walls::WallSensors;

use crate::settings::number_of;

/// Steps of the search for a turning point: halving brings it to the last bit.
const HALVINGS: u32 = 50;

/// Contact time that turns an impulse into a force: that of the simulated rig, s.
#[must_use]
pub fn contact_s() -> f64 {
    number_of(WallSensors::default().contact_s)
}

/// Peak of the half-sine pulse of an impulse, N.
pub(super) fn force_n(impulse_n_s: f64) -> f64 {
    0.5 * PI * impulse_n_s / contact_s()
}

/// An impact that was counted: time in steps, side, impulse in the motion's own unit.
#[derive(Clone, Copy)]
struct Counted {
    at: f64,
    side: i8,
    kick: f64,
}

/// The observer of a motion.
pub(super) struct MotionWatch {
    step: u64,
    x_m: f64,
    least_kick: f64,
    largest_kick: f64,
    /// Steps in which a pulse overlaps with the next, and in which a weaker one counts as ringing.
    overlap: f64,
    ringing_for: f64,
    ringing: f64,
    last: [Option<Counted>; 2],
    /// Impacts that the board would count.
    pub(super) measurable: u32,
    /// The others.
    pub(super) weak: u32,
    /// Impulse of a unit of `kick`, N·s.
    impulse_n_s: f64,
}

impl MotionWatch {
    /// For a structure of `mass_kg` and steps of `step_s`.
    pub(super) fn new(detection: &ImpactConfig, mass_kg: f64, step_s: f64) -> Self {
        let impulse_n_s = mass_kg / step_s;
        let pulse_s = contact_s();
        Self {
            step: 0,
            x_m: 0.0,
            least_kick: number_of(detection.threshold_n) / force_n(impulse_n_s),
            largest_kick: 0.0,
            overlap: pulse_s / step_s,
            ringing_for: (pulse_s + number_of(detection.refractory_s)) / step_s,
            ringing: number_of(detection.ringing),
            last: [None; 2],
            measurable: 0,
            weak: 0,
            impulse_n_s,
        }
    }

    /// Ends a step at x (m); returns the largest |x| in it, m.
    pub(super) fn end_step(&mut self, x_m: f64) -> f64 {
        self.step += 1;
        std::mem::take(&mut self.x_m).max(x_m.abs())
    }

    /// The largest impulse of an impact, N·s; 0 without one.
    pub(super) fn largest_impulse_n_s(&self) -> f64 {
        self.largest_kick * self.impulse_n_s
    }

    /// Forgets the impacts counted so far.
    pub(super) fn restart_count(&mut self) {
        (self.measurable, self.weak) = (0, 0);
    }

    fn is_measurable(&self, new: &Counted) -> bool {
        let last = self.last[usize::from(new.side > 0)];
        let is_own_pulse = last.is_none_or(|last| {
            let later = new.at - last.at;
            later >= self.ringing_for || later >= self.overlap && new.kick >= self.ringing * last.kick
        });
        new.kick >= self.least_kick && is_own_pulse
    }
}

impl Observer<f64> for MotionWatch {
    fn flight(&mut self, _: f64, length: f64, flight: &Flight<f64>) {
        let p = &flight.x;
        // The first terms of the rate tell whether it changes its sign; a flight ends where the next begins, or with the step.
        let end_rate = p[1] + length * (2.0 * p[2] + 3.0 * length * p[3]);
        let has_turning_point = (p[1] > 0.0) != (end_rate > 0.0);
        self.x_m = self.x_m.max(if has_turning_point { largest_abs(p, length) } else { p[0].abs() });
    }

    fn impact(&mut self, impact: &Impact<f64>) {
        let new = Counted { at: self.step as f64 + impact.at, side: impact.side, kick: impact.kick.abs() };
        self.largest_kick = self.largest_kick.max(new.kick);
        if self.is_measurable(&new) {
            self.measurable = self.measurable.saturating_add(1);
            self.last[usize::from(new.side > 0)] = Some(new);
        } else {
            self.weak = self.weak.saturating_add(1);
        }
    }
}

/// The largest magnitude of a polynomial from 0 to `length`, which has at most one turning point there.
fn largest_abs(p: &Polynomial<f64>, length: f64) -> f64 {
    let value = |at: f64| (p[0] + increment(p, at)).abs();
    let rate = |at: f64| p[1] + derivative_increment(p, at);
    let ends = p[0].abs().max(value(length));
    let rises = rate(0.0) > 0.0;
    if rises == (rate(length) > 0.0) {
        return ends;
    }
    let (mut low, mut high) = (0.0, length);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if (rate(middle) > 0.0) == rises { low = middle } else { high = middle }
    }
    ends.max(value(low))
}
