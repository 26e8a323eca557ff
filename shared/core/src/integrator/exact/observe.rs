//! What a run shows of itself: smooth arcs and the events between them. Nothing is computed that is not asked for.

use core::cell::OnceCell;

use super::excitation::Wave;
use super::flow::{ExactState, Flows, Leg, Path, Span};
use super::series;
use crate::integrator::modes::{Mode, Sign};

/// A piece of motion without an event inside.
pub struct Arc<'a> {
    pub(super) flows: &'a Flows,
    pub(super) leg: &'a Leg,
    pub(super) wave: Wave,
    pub(super) end_wave: Wave,
    pub(super) span: OnceCell<Span>,
    /// When it starts, s.
    pub start_s: f64,
    /// How long it is, s.
    pub length_s: f64,
    /// The mode all along it.
    pub mode: Mode,
    /// The state at its start.
    pub start: ExactState,
    /// The state at its end.
    pub end: ExactState,
}

impl Arc<'_> {
    /// The motion as power series, computed when first asked for.
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

    /// The offset at which the spring between structure and second mass is at rest, m; none while nothing joins them.
    #[must_use]
    pub fn link_rest_m(&self) -> Option<f64> {
        let joined = matches!(self.leg.path, Path::Coupled | Path::CarriedCoupled);
        // A particle that friction holds against a pressed wall moves with the structure and keeps the wall pressed.
        (joined || self.leg.rest_offset != 0.0).then_some(self.leg.rest_offset)
    }

    /// The state `after_s` from its start, 0 to `length_s`.
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

/// The particle meets a wall at speed: an impact on a hard one, the first touch of a soft one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// When, s.
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

/// A soft wall lets go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEnd {
    /// When, s.
    pub time_s: f64,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// |x′ − y′| just after, m/s.
    pub separation_speed_m_per_s: f64,
}

/// Impacts accumulated: the particle has come to rest on a hard wall, and the impacts still to come were summed instead
/// of listed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulation {
    /// When the sum was taken, s: from here on the particle counts as resting.
    pub time_s: f64,
    /// When the last of the summed impacts would have been, s; right to first order in the length of what was summed.
    pub ended_s: f64,
    /// +1 where y − x = +d.
    pub side: Sign,
    /// The state just before the sum: the particle leaves the wall.
    pub before: ExactState,
    /// The state just after: the particle rests on it.
    pub after: ExactState,
    /// The part of the change of x′ that the structure's spring makes, m/s; the rest the impacts make.
    pub spring_m_per_s: f64,
}

/// Sees a run. Every method may be left out and then costs nothing.
pub trait Observer {
    /// Whether [`Observer::arc`] is wanted at all.
    const ARCS: bool = true;

    /// The motion starts at `time_s` from `state`; what happens at the same instant follows.
    fn start(&mut self, time_s: f64, state: &ExactState) {
        let _ = (time_s, state);
    }

    /// A smooth piece of the motion; pieces follow each other without gaps.
    fn arc(&mut self, arc: &Arc<'_>) {
        let _ = arc;
    }

    /// The particle met a wall at speed. A particle that starts to press on a soft wall from rest makes no impact.
    fn impact(&mut self, impact: &Impact) {
        let _ = impact;
    }

    /// A soft wall let go.
    fn contact_end(&mut self, end: &ContactEnd) {
        let _ = end;
    }

    /// The mode changed at `time_s`.
    fn mode(&mut self, time_s: f64, mode: Mode) {
        let _ = (time_s, mode);
    }

    /// Accumulating impacts ended in a particle resting on a hard wall.
    fn accumulation(&mut self, accumulation: &Accumulation) {
        let _ = accumulation;
    }

    /// Asked before each arc, `time_s` being where the motion is: `false` ends the run there.
    fn goes_on(&mut self, time_s: f64) -> bool {
        let _ = time_s;
        true
    }
}

impl Observer for () {
    const ARCS: bool = false;
}

/// Two observers at once.
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
