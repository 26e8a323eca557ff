//! A simulated motion as pieces without events and the events between them, for either driver.
//!
//! A [`Viewer`] takes output from a run (states, a time history, a figure). It sees the exact driver's arcs and the sampled
//! driver's flights in the same way. Its memory does not grow with the run unless its description says so.
//! Pieces are seen through a pointer, so that the runs ([`stop`], [`sampled_run`], [`read_run`], [`watch`]) and the meters ([`statistics`], [`cycle_maxima`]) are
//! compiled once, in this crate.

pub mod cosines;
pub mod cycle_maxima;
pub mod placed_motion;
pub mod read_run;
pub mod rig_model;
pub mod sampled_run;
pub mod statistics;
pub mod stop;
pub mod virtual_device;
pub mod watch;

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::{self, series};
use damprig_core::integrator::modes::{Contact, Grip, Mode};
use serde::Serialize;

/// State of structure, second mass and base at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionState {
    /// Time, s.
    pub t_s: f64,
    /// Structure and second mass.
    pub state: ExactState,
    /// Base displacement z, m.
    pub z_m: f64,
    /// Base velocity z′, m/s.
    pub base_velocity_m_per_s: f64,
}

/// A displacement whose largest magnitude is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Displacement {
    /// x.
    X,
    /// x − z.
    XMinusZ,
}

impl Displacement {
    /// Its value, m, and rate, m/s, in a state.
    #[must_use]
    pub fn of(self, at: &MotionState) -> (f64, f64) {
        let (z_m, base_velocity_m_per_s) = match self {
            Self::X => (0.0, 0.0),
            Self::XMinusZ => (at.z_m, at.base_velocity_m_per_s),
        };
        (at.state.x_m - z_m, at.state.v_m_per_s - base_velocity_m_per_s)
    }
}

/// A piece of motion without an event inside. Pieces follow each other without gaps.
pub trait Piece {
    /// Start, s.
    fn start_s(&self) -> f64;
    /// Length, s.
    fn length_s(&self) -> f64;
    /// State at `after_s` from its start, 0 to its length.
    fn at(&self, after_s: f64) -> MotionState;
    /// Stick, slip and contact along it.
    fn phase(&self) -> Phase;
    /// Adds what a structure with several places has besides at `after_s` from its start: x, m, and x″, m/s², of every place, then y, m, of
    /// every particle and of every tuned mass.
    fn places_at(&self, _after_s: f64, _values: &mut Vec<f64>) {}
    /// ∫ of a displacement's square over it, m²·s: by a quadrature that is exact for pieces without fast parts, unless the piece knows better.
    fn square_m2_s(&self, of: Displacement) -> f64 {
        statistics::square_m2_s(self, of)
    }
    /// The largest magnitude of a displacement between two times after its start, s, if above `least_m`. The interval is divided into
    /// `parts` with at most one extremum each, unless the piece knows better.
    fn largest_abs_m(&self, of: Displacement, window_s: (f64, f64), parts: u32, least_m: f64) -> f64 {
        statistics::largest_abs_m(self, of, window_s, parts, least_m)
    }
}

/// An impact, or the first touch of a soft wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImpactRecord {
    /// Time, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
    /// |x′ − y′| before the impact, m/s.
    pub approach_speed_m_per_s: f64,
    /// y at the impact, m; not a number if it is not of the second mass that is shown.
    #[serde(skip)]
    pub y_m: f64,
    /// Number of the impact damper, from 1, on a structure with several places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damper: Option<u32>,
}

/// A chatter that ended with the particle at rest on a wall. The impacts of its tail are summed, not listed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AccumulationRecord {
    /// End of the chatter, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
}

/// A contact with a Hertz wall, from the first touch until the penetration has returned to zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContactRecord {
    /// First touch, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
    /// |x′ − y′| at the first touch, m/s; 0 where the particle began to press from rest.
    pub approach_speed_m_per_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Largest force, N.
    pub peak_force_n: f64,
    /// Separation speed over approach speed; `None` of a contact that began from rest.
    pub restitution: Option<f64>,
    /// Number of the impact damper, from 1, on a structure with several places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damper: Option<u32>,
}

/// Stick, slip and contact, as tables name them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// The driver's mode.
    pub mode: Mode,
    /// Whether the particle is in contact with a soft wall.
    pub pressing: bool,
}

impl Phase {
    /// State of the friction damper, as tables name it.
    #[must_use]
    pub fn structure(self) -> &'static str {
        match self.mode.grip {
            Grip::Absent => "free",
            Grip::Slip(_) => "slipping",
            Grip::Stuck => "stuck",
        }
    }

    /// State of the particle, as tables name it; empty without one.
    #[must_use]
    pub fn particle(self) -> &'static str {
        match self.mode.contact {
            Contact::Absent => "",
            _ if self.pressing => "in the wall",
            Contact::Free(_) => "between the walls",
            Contact::Held(0) => "held by friction",
            Contact::Held(_) => "resting on a wall",
        }
    }
}

/// Receives a motion. Every method is optional.
pub trait Viewer {
    /// Time from which it needs pieces, s: it need not be shown those that end before. Infinite if it needs none; they
    /// take time to compute.
    fn pieces_from_s(&self) -> f64 {
        0.0
    }

    /// Next piece of the motion.
    fn piece(&mut self, piece: &dyn Piece) {
        let _ = piece;
    }

    /// The particle hit a wall.
    fn impact(&mut self, impact: &ImpactRecord) {
        let _ = impact;
    }

    /// A contact with a Hertz wall ended.
    fn contact(&mut self, contact: &ContactRecord) {
        let _ = contact;
    }

    /// A chatter ended with the particle at rest on a wall.
    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let _ = accumulation;
    }

    /// Whether it can take no more (disk full), so that the run should stop.
    fn is_done(&self) -> bool {
        false
    }
}

impl Viewer for () {
    fn pieces_from_s(&self) -> f64 {
        f64::INFINITY
    }
}

/// Both receive the motion.
impl<A: Viewer, B: Viewer> Viewer for (A, B) {
    fn pieces_from_s(&self) -> f64 {
        self.0.pieces_from_s().min(self.1.pieces_from_s())
    }

    fn piece(&mut self, piece: &dyn Piece) {
        self.0.piece(piece);
        self.1.piece(piece);
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        self.0.impact(impact);
        self.1.impact(impact);
    }

    fn contact(&mut self, contact: &ContactRecord) {
        self.0.contact(contact);
        self.1.contact(contact);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        self.0.accumulation(accumulation);
        self.1.accumulation(accumulation);
    }

    fn is_done(&self) -> bool {
        self.0.is_done() || self.1.is_done()
    }
}

impl<V: Viewer + ?Sized> Viewer for &mut V {
    fn pieces_from_s(&self) -> f64 {
        (**self).pieces_from_s()
    }

    fn piece(&mut self, piece: &dyn Piece) {
        (**self).piece(piece);
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        (**self).impact(impact);
    }

    fn contact(&mut self, contact: &ContactRecord) {
        (**self).contact(contact);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        (**self).accumulation(accumulation);
    }

    fn is_done(&self) -> bool {
        (**self).is_done()
    }
}

/// Receives the motion if it is there.
impl<V: Viewer> Viewer for Option<V> {
    fn pieces_from_s(&self) -> f64 {
        self.as_ref().map_or(f64::INFINITY, Viewer::pieces_from_s)
    }

    fn piece(&mut self, piece: &dyn Piece) {
        if let Some(viewer) = self {
            viewer.piece(piece);
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if let Some(viewer) = self {
            viewer.impact(impact);
        }
    }

    fn contact(&mut self, contact: &ContactRecord) {
        if let Some(viewer) = self {
            viewer.contact(contact);
        }
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        if let Some(viewer) = self {
            viewer.accumulation(accumulation);
        }
    }

    fn is_done(&self) -> bool {
        self.as_ref().is_some_and(Viewer::is_done)
    }
}

/// Passes the exact driver's motion to a viewer.
#[derive(Debug)]
pub struct ExactObserver<V> {
    viewer: V,
    pieces_from_s: f64,
}

impl<V: Viewer> ExactObserver<V> {
    /// For a viewer, which is asked here from when on it needs pieces.
    pub fn new(viewer: V) -> Self {
        Self { pieces_from_s: viewer.pieces_from_s(), viewer }
    }
}

impl<V: Viewer> exact::Observer for ExactObserver<V> {
    #[inline]
    fn arc(&mut self, arc: &exact::Arc<'_>) {
        if arc.start_s + arc.length_s >= self.pieces_from_s {
            self.viewer.piece(arc);
        }
    }

    fn impact(&mut self, impact: &exact::Impact) {
        self.viewer.impact(&ImpactRecord {
            t_s: impact.time_s,
            side: impact.side,
            approach_speed_m_per_s: impact.approach_speed_m_per_s,
            y_m: impact.before.y_m(),
            damper: None,
        });
    }

    fn contact_end(&mut self, end: &exact::ContactEnd) {
        let Some(contact) = end.hertz else { return };
        let approach_speed_m_per_s = contact.approach_speed_m_per_s;
        self.viewer.contact(&ContactRecord {
            t_s: contact.touch_s,
            side: end.side,
            approach_speed_m_per_s,
            duration_s: contact.duration_s,
            peak_force_n: contact.peak_force_n,
            restitution: (approach_speed_m_per_s > 0.0).then(|| end.separation_speed_m_per_s / approach_speed_m_per_s),
            damper: None,
        });
    }

    fn accumulation(&mut self, accumulation: &exact::Accumulation) {
        self.viewer.accumulation(&AccumulationRecord { t_s: accumulation.ended_s, side: accumulation.side });
    }
}

impl Piece for exact::Arc<'_> {
    fn start_s(&self) -> f64 {
        self.start_s
    }

    fn length_s(&self) -> f64 {
        self.length_s
    }

    fn at(&self, after_s: f64) -> MotionState {
        let span = self.span();
        let fraction = after_s / span.step_s;
        let (z_m, slope) = series::value_and_slope(&span.base, fraction);
        let base_velocity_m_per_s = slope / span.step_s;
        MotionState { t_s: self.start_s + after_s, state: span.state(fraction), z_m, base_velocity_m_per_s }
    }

    fn phase(&self) -> Phase {
        Phase { mode: self.mode, pressing: self.contact_force().is_some() }
    }
}

/// States at given times. Memory grows with their number; the motion does not depend on them.
#[derive(Clone, Debug, Default)]
pub struct StateSamples {
    times_s: Vec<f64>,
    /// States so far, in order of time.
    pub states: Vec<ExactState>,
}

impl StateSamples {
    /// For `times_s`, in rising order.
    #[must_use]
    pub fn at(times_s: Vec<f64>) -> Self {
        Self { states: Vec::with_capacity(times_s.len()), times_s }
    }

    /// Fills in the times that lie after the end of the run by rounding.
    pub fn fill(&mut self, state: ExactState) {
        self.states.resize(self.times_s.len(), state);
    }
}

impl Viewer for StateSamples {
    fn pieces_from_s(&self) -> f64 {
        self.times_s.get(self.states.len()).copied().unwrap_or(f64::INFINITY)
    }

    fn piece(&mut self, piece: &dyn Piece) {
        while let Some(time_s) = self.times_s.get(self.states.len()) {
            let after_s = time_s - piece.start_s();
            if after_s > piece.length_s() {
                break;
            }
            self.states.push(piece.at(after_s.max(0.0)).state);
        }
    }
}
