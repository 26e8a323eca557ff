//! A motion as it is watched, whichever driver makes it: smooth pieces, and the impacts between them.
//!
//! Whatever is taken from a run (samples, a history in a file, a picture) is a [`Viewer`] and sees the exact driver's
//! arcs and the sampled driver's flights alike. A viewer keeps nothing that grows with the run unless it says so.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::{self, series};
use damprig_core::integrator::modes::{Contact, Grip, Mode};
use serde::Serialize;

/// Everything that moves, at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instant {
    /// When, s.
    pub t_s: f64,
    /// Structure and second mass.
    pub state: ExactState,
    /// Base displacement z, m.
    pub z_m: f64,
    /// Base velocity z′, m/s.
    pub base_velocity_m_per_s: f64,
}

/// A piece of motion without an event inside; pieces follow each other without gaps.
pub trait Piece {
    /// When it starts, s.
    fn start_s(&self) -> f64;
    /// How long it is, s.
    fn length_s(&self) -> f64;
    /// What is where `after_s` from its start, 0 to its length.
    fn at(&self, after_s: f64) -> Instant;
    /// What sticks and slips all along it.
    fn phase(&self) -> Phase;
}

/// One impact, or the first touch of a soft wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImpactRecord {
    /// When, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
    /// |x′ − y′| just before, m/s.
    pub approach_speed_m_per_s: f64,
    /// y then, m.
    #[serde(skip)]
    pub y_m: f64,
}

/// A chatter that came to rest on a wall: the impacts of its tail are summed and not listed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AccumulationRecord {
    /// When it ended, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
}

/// What sticks and slips, for people and tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// The drivers' mode.
    pub mode: Mode,
    /// The particle presses into a soft wall.
    pub pressing: bool,
}

impl Phase {
    /// What the structure does on the friction damper, in a word.
    #[must_use]
    pub fn structure(self) -> &'static str {
        match self.mode.grip {
            Grip::Absent => "free",
            Grip::Slip(_) => "slipping",
            Grip::Stuck => "stuck",
        }
    }

    /// What the particle does, in a word; empty without one.
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

/// Watches a motion. Every method may be left out.
pub trait Viewer {
    /// Whether pieces are wanted at all: making them costs time.
    fn wants_pieces(&self) -> bool {
        true
    }

    /// The motion goes on by `piece`.
    fn piece(&mut self, piece: &impl Piece) {
        let _ = piece;
    }

    /// The particle met a wall.
    fn impact(&mut self, impact: &ImpactRecord) {
        let _ = impact;
    }

    /// A chatter ended in a particle resting on a wall.
    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let _ = accumulation;
    }

    /// Nothing more can be taken (a disk is full): the run had better end.
    fn is_done(&self) -> bool {
        false
    }
}

impl Viewer for () {
    fn wants_pieces(&self) -> bool {
        false
    }
}

/// Both watch.
impl<A: Viewer, B: Viewer> Viewer for (A, B) {
    fn wants_pieces(&self) -> bool {
        self.0.wants_pieces() || self.1.wants_pieces()
    }

    fn piece(&mut self, piece: &impl Piece) {
        self.0.piece(piece);
        self.1.piece(piece);
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        self.0.impact(impact);
        self.1.impact(impact);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        self.0.accumulation(accumulation);
        self.1.accumulation(accumulation);
    }

    fn is_done(&self) -> bool {
        self.0.is_done() || self.1.is_done()
    }
}

impl<V: Viewer> Viewer for &mut V {
    fn wants_pieces(&self) -> bool {
        (**self).wants_pieces()
    }

    fn piece(&mut self, piece: &impl Piece) {
        (**self).piece(piece);
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        (**self).impact(impact);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        (**self).accumulation(accumulation);
    }

    fn is_done(&self) -> bool {
        (**self).is_done()
    }
}

/// It watches if it is there.
impl<V: Viewer> Viewer for Option<V> {
    fn wants_pieces(&self) -> bool {
        self.as_ref().is_some_and(Viewer::wants_pieces)
    }

    fn piece(&mut self, piece: &impl Piece) {
        if let Some(viewer) = self {
            viewer.piece(piece);
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if let Some(viewer) = self {
            viewer.impact(impact);
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

/// Shows the exact driver's motion to a viewer.
#[derive(Debug)]
pub(super) struct Shown<V>(pub V);

impl<V: Viewer> exact::Observer for Shown<V> {
    fn arc(&mut self, arc: &exact::Arc<'_>) {
        if self.0.wants_pieces() {
            self.0.piece(arc);
        }
    }

    fn impact(&mut self, impact: &exact::Impact) {
        self.0.impact(&ImpactRecord {
            t_s: impact.time_s,
            side: impact.side,
            approach_speed_m_per_s: impact.approach_speed_m_per_s,
            y_m: impact.before.y_m(),
        });
    }

    fn accumulation(&mut self, accumulation: &exact::Accumulation) {
        self.0.accumulation(&AccumulationRecord { t_s: accumulation.ended_s, side: accumulation.side });
    }
}

impl Piece for exact::Arc<'_> {
    fn start_s(&self) -> f64 {
        self.start_s
    }

    fn length_s(&self) -> f64 {
        self.length_s
    }

    fn at(&self, after_s: f64) -> Instant {
        let span = self.span();
        let fraction = after_s / span.step_s;
        let (z_m, slope) = series::value_and_slope(&span.base, fraction);
        let base_velocity_m_per_s = slope / span.step_s;
        Instant { t_s: self.start_s + after_s, state: span.state(fraction), z_m, base_velocity_m_per_s }
    }

    fn phase(&self) -> Phase {
        Phase { mode: self.mode, pressing: self.contact_force().is_some() }
    }
}

/// The states at given instants: asking for them changes nothing in the motion. Grows with the number asked for.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    times_s: Vec<f64>,
    /// The states so far, in the order of the times.
    pub states: Vec<ExactState>,
}

impl Samples {
    /// Wants the states at `times_s`, in rising order.
    #[must_use]
    pub fn at(times_s: Vec<f64>) -> Self {
        Self { states: Vec::with_capacity(times_s.len()), times_s }
    }

    /// The rest of the samples, which were asked for a rounding after the end.
    pub(super) fn fill(&mut self, state: ExactState) {
        self.states.resize(self.times_s.len(), state);
    }
}

impl Viewer for Samples {
    fn wants_pieces(&self) -> bool {
        self.states.len() < self.times_s.len()
    }

    fn piece(&mut self, piece: &impl Piece) {
        while let Some(time_s) = self.times_s.get(self.states.len()) {
            let after_s = time_s - piece.start_s();
            if after_s > piece.length_s() {
                break;
            }
            self.states.push(piece.at(after_s.max(0.0)).state);
        }
    }
}
