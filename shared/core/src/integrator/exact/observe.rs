//! Observers of a run: smooth arcs and the events between them. Only requested values are computed.

use core::cell::OnceCell;

use super::excitation::Wave;
use super::flow::{ExactState, Flows, Leg, Path, Span};
use super::series;
use super::squeeze::Squeeze;
use crate::integrator::modes::{Mode, Sign};
use crate::model::Hertz;

/// A piece of motion without an event inside.
pub struct Arc<'a> {
    pub(super) flows: &'a Flows,
    /// The law of the Hertz wall that the particle presses into, and the contact.
    pub(super) squeeze: Option<(&'a Hertz, &'a Squeeze)>,
    pub(super) leg: &'a Leg,
    pub(super) wave: Wave,
    pub(super) end_wave: Wave,
    pub(super) span: OnceCell<Span>,
    /// Start time, s.
    pub start_s: f64,
    /// Duration, s.
    pub length_s: f64,
    /// The mode during the arc.
    pub mode: Mode,
    /// The state at the start.
    pub start: ExactState,
    /// The state at the end.
    pub end: ExactState,
}

impl Arc<'_> {
    /// The motion as power series, computed on first use.
    #[inline]
    pub fn span(&self) -> &Span {
        self.span.get_or_init(|| self.flows.span(self.leg, &self.start, &self.wave))
    }

    /// The fraction of the series' interval that the arc covers.
    #[must_use]
    pub fn end_fraction(&self) -> f64 {
        self.length_s / self.leg.step_s
    }

    /// The force applied to the structure at `fraction` of the series' interval, N; 0 when the base moves instead.
    #[must_use]
    pub fn applied_force_n(&self, fraction: f64) -> f64 {
        let share = 1.0 - self.flows.base_share;
        if share > 0.0 { share * self.wave.turned(self.flows.turning * self.leg.step_s * fraction).sine } else { 0.0 }
    }

    /// The offset at which the spring between structure and second mass is unloaded, m; `None` while nothing joins
    /// them.
    #[must_use]
    pub fn link_rest_m(&self) -> Option<f64> {
        let joined = matches!(self.leg.path, Path::Coupled | Path::CarriedCoupled);
        // A particle that friction holds against a pressed wall moves with the structure and keeps the wall compressed.
        (joined || self.leg.pressed != 0).then_some(self.leg.rest_offset)
    }

    /// The law of the Hertz wall that the particle presses into, and β of the contact, s/m; `None` without one.
    #[must_use]
    pub fn hertz_contact(&self) -> Option<(&Hertz, f64)> {
        self.squeeze.map(|(law, squeeze)| (law, squeeze.rate_s_per_m))
    }

    /// The side of the soft wall that the particle compresses; 0 without one.
    #[must_use]
    pub fn pressed_side(&self) -> Sign {
        self.leg.pressed
    }

    /// The state at time `after_s` after the start, 0 to `length_s`.
    #[must_use]
    pub fn state(&self, after_s: f64) -> ExactState {
        self.span().state(after_s / self.leg.step_s)
    }
}

impl Span {
    /// The state at `fraction` of the interval.
    #[inline]
    #[must_use]
    pub fn state(&self, fraction: f64) -> ExactState {
        let (x_m, v) = series::value_and_slope(&self.x, fraction);
        let (offset_m, slide) = series::value_and_slope(&self.offset, fraction);
        ExactState { x_m, v_m_per_s: v / self.step_s, offset_m, slide_m_per_s: slide / self.step_s }
    }
}

/// The particle meets a wall at a non-zero speed: an impact on a hard wall, the first touch of a soft wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Time, s.
    pub time_s: f64,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// |x′ − y′| just before, m/s; greater than 0.
    pub approach_speed_m_per_s: f64,
    /// The state just before.
    pub before: ExactState,
    /// The state just after (the same at a soft wall).
    pub after: ExactState,
}

/// A contact with a Hertz wall that has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzContact {
    /// Time of the first touch, s.
    pub touch_s: f64,
    /// |x′ − y′| at the first touch, m/s; 0 where the particle began to press from rest.
    pub approach_speed_m_per_s: f64,
    /// From the first touch until the penetration has returned to zero, s; without the rounding of the times.
    pub duration_s: f64,
    /// Largest force, N.
    pub peak_force_n: f64,
}

/// A soft wall releases the particle; a Hertz wall where the penetration has returned to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEnd {
    /// Time, s.
    pub time_s: f64,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// |x′ − y′| just after, m/s.
    pub separation_speed_m_per_s: f64,
    /// The contact, of a Hertz wall.
    pub hertz: Option<HertzContact>,
}

/// Accumulation of impacts: the particle has come to rest on a hard wall, and the remaining impacts were summed instead
/// of listed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulation {
    /// Time at which the sum was taken, s: from then on the particle counts as resting.
    pub time_s: f64,
    /// Time of the last summed impact, s; correct to first order in the duration of the summed part.
    pub ended_s: f64,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// The state just before the sum: the particle leaves the wall.
    pub before: ExactState,
    /// The state just after the sum: the particle rests on the wall.
    pub after: ExactState,
    /// The part of the change of x′ caused by the structure's spring, m/s; the impacts cause the rest.
    pub spring_m_per_s: f64,
}

/// Receives the events and arcs of a run. Every method is optional; an omitted one costs nothing.
pub trait Observer {
    /// Whether [`Observer::arc`] is called at all.
    const ARCS: bool = true;

    /// The motion starts at `time_s` from `state`; events at the same instant follow.
    fn start(&mut self, time_s: f64, state: &ExactState) {
        let _ = (time_s, state);
    }

    /// A smooth piece of the motion; consecutive pieces leave no gap.
    fn arc(&mut self, arc: &Arc<'_>) {
        let _ = arc;
    }

    /// The particle met a wall at a non-zero speed. A particle that starts from rest to press on a soft wall makes no
    /// impact.
    fn impact(&mut self, impact: &Impact) {
        let _ = impact;
    }

    /// A soft wall released the particle.
    fn contact_end(&mut self, end: &ContactEnd) {
        let _ = end;
    }

    /// The mode changed at `time_s`.
    fn mode(&mut self, time_s: f64, mode: Mode) {
        let _ = (time_s, mode);
    }

    /// Accumulating impacts ended with the particle at rest on a hard wall.
    fn accumulation(&mut self, accumulation: &Accumulation) {
        let _ = accumulation;
    }

    /// Called before each arc with the present time of the motion: `false` ends the run there.
    fn goes_on(&mut self, time_s: f64) -> bool {
        let _ = time_s;
        true
    }
}

impl Observer for () {
    const ARCS: bool = false;
}

/// Passes every call to both observers.
impl<A: Observer, B: Observer> Observer for (A, B) {
    const ARCS: bool = A::ARCS || B::ARCS;

    fn start(&mut self, time_s: f64, state: &ExactState) {
        self.0.start(time_s, state);
        self.1.start(time_s, state);
    }

    fn arc(&mut self, arc: &Arc<'_>) {
        self.0.arc(arc);
        self.1.arc(arc);
    }

    fn impact(&mut self, impact: &Impact) {
        self.0.impact(impact);
        self.1.impact(impact);
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        self.0.contact_end(end);
        self.1.contact_end(end);
    }

    fn mode(&mut self, time_s: f64, mode: Mode) {
        self.0.mode(time_s, mode);
        self.1.mode(time_s, mode);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.0.accumulation(accumulation);
        self.1.accumulation(accumulation);
    }

    fn goes_on(&mut self, time_s: f64) -> bool {
        let first = self.0.goes_on(time_s);
        self.1.goes_on(time_s) && first
    }
}

impl<O: Observer> Observer for &mut O {
    const ARCS: bool = O::ARCS;

    fn start(&mut self, time_s: f64, state: &ExactState) {
        (**self).start(time_s, state);
    }

    fn arc(&mut self, arc: &Arc<'_>) {
        (**self).arc(arc);
    }

    fn impact(&mut self, impact: &Impact) {
        (**self).impact(impact);
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        (**self).contact_end(end);
    }

    fn mode(&mut self, time_s: f64, mode: Mode) {
        (**self).mode(time_s, mode);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        (**self).accumulation(accumulation);
    }

    fn goes_on(&mut self, time_s: f64) -> bool {
        (**self).goes_on(time_s)
    }
}
