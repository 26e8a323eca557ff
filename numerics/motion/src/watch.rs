//! Watches a motion of the sampled engine: the largest |x| between its steps, and its impacts as the board would measure them.
//!
//! The board counts the pulses of the walls' force sensors. A pulse begins above a threshold; one that overlaps with the pulse
//! before it on the same wall is part of it, and a much weaker one shortly after it counts as ringing
//! ([`damprig_core::measure::impacts`]). So a chatter has more impacts than are counted.

use std::f64::consts::PI;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::Sign;
use damprig_core::integrator::polynomial::{Polynomial, derivative_increment, increment};
use damprig_core::integrator::sampled::{Flight, SampledImpact, SampledObserver};
use damprig_core::io::Invalid;
use damprig_core::model::Initial;

use super::rig_model::{RigModel, RigMotion};

/// How the board tells pulses on the walls apart, and how long those of a hard wall last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// A pulse is counted from this force on, N.
    pub threshold_n: f64,
    /// Time after a pulse in which a weaker one counts as ringing, s.
    pub refractory_s: f64,
    /// Share of a pulse's peak below which a later one is weaker.
    pub ringing: f64,
    /// Contact time with a hard wall, which turns an impulse into a force, s.
    pub contact_s: f64,
}

/// A set-up in motion, stepped by the sampled integrator under its watch.
pub struct WatchedMotion {
    /// The motion.
    pub motion: RigMotion,
    /// Its watch.
    pub watch: MotionWatch,
}

impl WatchedMotion {
    /// `model` in steps of `step_s` from `initial`.
    ///
    /// # Errors
    /// Names a parameter that the integrator cannot take.
    pub fn new(model: &RigModel, step_s: f64, initial: &Initial, detection: &Detection) -> Result<Self, Invalid> {
        let motion = model.motion(step_s, initial)?;
        Ok(Self { motion, watch: MotionWatch::new(detection, model.set_up.structure.mass_kg, step_s) })
    }

    /// Makes a step; gives the largest |x| in it, m.
    pub fn step(&mut self, base: &BaseSegment<f64>) -> f64 {
        self.motion.step(base, &mut self.watch);
        self.watch.end_step(self.motion.x_m())
    }

    /// x, m.
    pub fn x_m(&self) -> f64 {
        self.motion.x_m()
    }
}

/// Steps of the search for a turning point: halving brings it to the last bit.
const HALVINGS: u32 = 50;

/// A pulse that was counted, or the present one of a soft wall: from when to when (steps), and its peak.
#[derive(Clone, Copy)]
struct Pulse {
    from: f64,
    until: f64,
    peak_n: f64,
}

/// A pulse as the board counts it, or would count it with a lower threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchedPulse {
    /// When it began, steps.
    pub from: f64,
    /// +1 where y − x = +d.
    pub side: i8,
    /// Its peak, N.
    pub peak_n: f64,
    /// Whether the board counts it.
    pub is_counted: bool,
}

/// The observer of a motion.
pub struct MotionWatch {
    step: u64,
    x_m: f64,
    threshold_n: f64,
    /// Steps after a pulse in which a weaker one counts as ringing.
    refractory: f64,
    ringing: f64,
    /// Steps of a contact with a hard wall.
    contact: f64,
    /// The last pulse that was counted, of the walls at −d and +d.
    last: [Option<Pulse>; 2],
    /// The present pulse of a soft wall.
    pressing: Option<Pulse>,
    /// Impacts that the board would count.
    pub measurable: u32,
    /// The others.
    pub weak: u32,
    /// The largest force on the walls at −d and +d, N; 0 without an impact.
    pub largest_force_n: [f64; 2],
    /// All pulses, if they are kept.
    pulses: Option<Vec<WatchedPulse>>,
    /// Peak of the pulse of an impact with a unit of `kick`, N.
    force_per_kick_n: f64,
    /// Force of a soft wall per unit of the integrator's, N.
    force_per_unit_n: f64,
}

impl MotionWatch {
    /// For a structure of `mass_kg` and steps of `step_s`.
    pub fn new(detection: &Detection, mass_kg: f64, step_s: f64) -> Self {
        Self {
            step: 0,
            x_m: 0.0,
            threshold_n: detection.threshold_n,
            refractory: detection.refractory_s / step_s,
            ringing: detection.ringing,
            contact: detection.contact_s / step_s,
            last: [None; 2],
            pressing: None,
            measurable: 0,
            weak: 0,
            largest_force_n: [0.0; 2],
            pulses: None,
            // Of a half-sine pulse.
            force_per_kick_n: 0.5 * PI * (mass_kg / step_s) / detection.contact_s,
            force_per_unit_n: mass_kg / (step_s * step_s),
        }
    }

    /// The same, which keeps its pulses: memory grows with their number.
    pub fn with_pulses(self) -> Self {
        Self { pulses: Some(Vec::new()), ..self }
    }

    /// The pulses kept so far.
    pub fn into_pulses(self) -> Vec<WatchedPulse> {
        self.pulses.unwrap_or_default()
    }

    /// Ends a step at x (m); returns the largest |x| in it, m.
    pub fn end_step(&mut self, x_m: f64) -> f64 {
        self.step += 1;
        std::mem::take(&mut self.x_m).max(x_m.abs())
    }

    /// Forgets the impacts counted so far.
    pub fn restart_count(&mut self) {
        (self.measurable, self.weak) = (0, 0);
    }

    /// Counts a pulse as the board does.
    fn count(&mut self, side: i8, new: Pulse) {
        let wall = usize::from(side > 0);
        self.largest_force_n[wall] = self.largest_force_n[wall].max(new.peak_n);
        let last = &mut self.last[wall];
        let is_own_pulse = last.is_none_or(|last| {
            new.from >= last.until + self.refractory
                || new.from >= last.until && new.peak_n >= self.ringing * last.peak_n
        });
        let is_counted = new.peak_n >= self.threshold_n && is_own_pulse;
        if let Some(pulses) = &mut self.pulses {
            pulses.push(WatchedPulse { from: new.from, side, peak_n: new.peak_n, is_counted });
        }
        if is_counted {
            self.measurable = self.measurable.saturating_add(1);
            *last = Some(new);
        } else {
            self.weak = self.weak.saturating_add(1);
        }
    }
}

impl SampledObserver<f64> for MotionWatch {
    fn flight(&mut self, _: f64, length: f64, flight: &Flight<f64>) {
        let p = &flight.x;
        // The first terms of the rate tell whether it changes its sign; a flight ends where the next begins, or with the step.
        let end_rate = p[1] + length * (2.0 * p[2] + 3.0 * length * p[3]);
        let has_turning_point = (p[1] > 0.0) != (end_rate > 0.0);
        self.x_m = self.x_m.max(if has_turning_point { largest_abs(p, length) } else { p[0].abs() });
    }

    fn impact(&mut self, impact: &SampledImpact<f64>) {
        // A soft wall gives no kick, but a force.
        if impact.kick != 0.0 {
            let from = self.step as f64 + impact.at;
            let peak_n = self.force_per_kick_n * impact.kick.abs();
            self.count(impact.side, Pulse { from, until: from + self.contact, peak_n });
        }
    }

    fn contact_start(&mut self, at: f64, _: Sign) {
        let from = self.step as f64 + at;
        self.pressing = Some(Pulse { from, until: from, peak_n: 0.0 });
    }

    fn wall_force(&mut self, _: f64, length: f64, _: Sign, force: &Polynomial<f64>) {
        // A flight in contact is a twentieth of a radian at most: its ends have its peak within 3e-4.
        let largest = force[0].max(force[0] + increment(force, length));
        if let Some(pulse) = &mut self.pressing {
            pulse.peak_n = pulse.peak_n.max(self.force_per_unit_n * largest);
        }
    }

    fn contact_end(&mut self, at: f64, side: Sign, _: f64) {
        if let Some(pulse) = self.pressing.take() {
            self.count(side, Pulse { until: self.step as f64 + at, ..pulse });
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
