//! Sequences of modes and events: what stays the same along a branch.

use damprig_core::integrator::exact::Touch;
use damprig_core::integrator::modes::{Contact, Grip, Sign};

/// The mode during a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Structure against base.
    pub grip: Grip,
    /// Particle against structure. Without internal friction the direction of a free particle is 0.
    pub contact: Contact,
    /// Particle against a soft wall.
    pub touch: Touch,
}

/// The event that ends a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// The particle reaches the wall of that side.
    Wall(Sign),
    /// The soft wall of that side releases the particle.
    LetGo(Sign),
    /// The particle is back inside the clearance.
    Inside(Sign),
    /// The particle that slides in that direction stops.
    SlideStops(Sign),
    /// The structure that slips in that direction stops on the base.
    SlipStops(Sign),
    /// A held particle starts to slide in that direction.
    HoldBreaks(Sign),
    /// A stuck structure starts to slip in that direction.
    GripBreaks(Sign),
    /// The drive has turned this often: the end of an orbit without events.
    Turn(u32),
}

/// A segment of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Its mode.
    pub phase: Phase,
    /// Its end.
    pub end: Guard,
}

/// The sequence of an orbit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// The segments; after the last one comes the first.
    pub segments: Vec<Segment>,
    /// Drive periods after which the orbit repeats.
    pub periods: u32,
}

impl Sequence {
    /// The mode after segment `n`.
    #[must_use]
    pub fn next(&self, n: usize) -> &Phase {
        &self.segments[(n + 1) % self.segments.len()].phase
    }

    /// The same orbit passed twice.
    #[must_use]
    pub fn doubled(&self) -> Self {
        let mut segments = self.segments.clone();
        segments.extend(&self.segments);
        Self { segments, periods: 2 * self.periods }
    }
}

impl Phase {
    /// Every guard of the mode.
    pub(crate) fn guards(&self) -> Vec<Guard> {
        let mut guards = Vec::new();
        match self.contact {
            Contact::Absent => {}
            Contact::Free(direction) => {
                match self.touch {
                    Touch::Pressing(side) => guards.push(Guard::LetGo(side)),
                    Touch::Leaving(side) => guards.extend([Guard::Inside(side), Guard::Wall(-side)]),
                    Touch::Clear => guards.extend([Guard::Wall(1), Guard::Wall(-1)]),
                }
                if direction != 0 {
                    guards.push(Guard::SlideStops(direction));
                }
            }
            Contact::Held(side) => {
                // A hard wall pushes without limit and cannot pull.
                if side >= 0 {
                    guards.push(Guard::HoldBreaks(-1));
                }
                if side <= 0 {
                    guards.push(Guard::HoldBreaks(1));
                }
            }
        }
        match self.grip {
            Grip::Absent => {}
            Grip::Slip(direction) => guards.push(Guard::SlipStops(direction)),
            Grip::Stuck => guards.extend([Guard::GripBreaks(-1), Guard::GripBreaks(1)]),
        }
        guards
    }
}
