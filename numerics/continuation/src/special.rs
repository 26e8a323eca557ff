//! Special points of a branch: their kinds, and what they mean.

use damprig_core::integrator::exact::Touch;
use damprig_core::integrator::modes::{Contact, Grip};

use crate::boundary_problem::{Condition, When};
use crate::orbit::Orbit;
use crate::sequence::{Guard, Sequence};

/// Kind of a special point.
#[derive(Clone, Debug, PartialEq)]
pub enum SpecialKind {
    /// A multiplier is +1 and the branch turns back in the parameter.
    Fold,
    /// A multiplier is −1: an orbit of twice the period branches off.
    PeriodDoubling,
    /// A pair of complex multipliers crosses the unit circle: quasi-periodic motion begins.
    NeimarkSacker,
    /// A multiplier is +1 and the orbit is its own mirror image: two orbits without that symmetry branch off.
    SymmetryBreaking,
    /// A multiplier is +1 without a fold, on an orbit without symmetry.
    BranchPoint,
    /// The sequence of events changes.
    Grazing(Vec<Condition>),
}

impl SpecialKind {
    /// Name in tables.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::PeriodDoubling => "period doubling",
            Self::NeimarkSacker => "Neimark-Sacker",
            Self::SymmetryBreaking => "symmetry breaking",
            Self::BranchPoint => "branch point",
            Self::Grazing(_) => "grazing",
        }
    }

    /// What it means, in one sentence.
    #[must_use]
    pub fn meaning(&self, sequence: &Sequence) -> String {
        match self {
            Self::Grazing(conditions) => conditions.first().map_or_else(String::new, |c| grazing(c, sequence)),
            _ => self.what().into(),
        }
    }

    /// What happens there, whatever the sequence.
    #[must_use]
    pub fn what(&self) -> &'static str {
        match self {
            Self::Fold => "the branch turns back: two orbits, one of them unstable, meet and vanish",
            Self::PeriodDoubling => "an orbit of twice the period branches off",
            Self::NeimarkSacker => "a slow modulation starts to grow: quasi-periodic motion",
            Self::SymmetryBreaking => "two orbits that mirror each other branch off",
            Self::BranchPoint => "another branch of orbits crosses",
            Self::Grazing(_) => "the sequence of events changes",
        }
    }
}

fn wall(side: i8) -> &'static str {
    if side > 0 { "+ wall" } else { "− wall" }
}

fn grazing(condition: &Condition, sequence: &Sequence) -> String {
    match *condition {
        Condition::Empty(n) => {
            let phase = &sequence.segments[n].phase;
            match (phase.grip, phase.contact, phase.touch) {
                (Grip::Stuck, _, _) => "a sticking phase of the friction damper vanishes".into(),
                (_, Contact::Held(_), _) => "a phase in which the particle is held vanishes".into(),
                (_, _, Touch::Pressing(side)) => format!("a contact with the {} vanishes", wall(side)),
                _ => "two events of the orbit coincide".into(),
            }
        }
        Condition::Zero(_, guard, When::Start | When::End) => match guard {
            Guard::HoldBreaks(_) => "friction or wall can just hold the particle".into(),
            Guard::GripBreaks(_) => {
                "the friction damper can just hold the structure: sticking appears or vanishes".into()
            }
            _ => "two events of the orbit coincide".into(),
        },
        Condition::Flat(_, guard, When::End) => match guard {
            Guard::Wall(side) => format!("an impact on the {} loses its approach speed and vanishes", wall(side)),
            Guard::SlideStops(_) => "the particle stops sliding with zero relative acceleration".into(),
            Guard::SlipStops(_) => "the structure stops slipping with zero relative acceleration".into(),
            Guard::HoldBreaks(_) | Guard::GripBreaks(_) => "a force just reaches its friction limit".into(),
            Guard::LetGo(_) | Guard::Inside(_) | Guard::Turn(_) => "the end of a contact becomes tangential".into(),
        },
        Condition::Flat(_, guard, When::Start) => match guard {
            Guard::SlipStops(_) => "a sticking phase of the friction damper appears at a reversal".into(),
            Guard::SlideStops(_) => "a phase in which the particle is held appears at a reversal".into(),
            Guard::Wall(side) => format!("the particle no longer leaves the {}", wall(side)),
            _ => "an event begins tangentially".into(),
        },
        Condition::Zero(_, guard, When::Inside) | Condition::Flat(_, guard, When::Inside) => match guard {
            Guard::Wall(side) => format!("the particle just reaches the {}: a new impact appears", wall(side)),
            Guard::SlideStops(_) => "the particle just stops relative to the structure".into(),
            Guard::SlipStops(_) => "the structure just stops relative to the base".into(),
            Guard::HoldBreaks(_) => "the held particle just starts to slide".into(),
            Guard::GripBreaks(_) => "the stuck structure just starts to slip".into(),
            Guard::LetGo(_) | Guard::Inside(_) | Guard::Turn(_) => "a contact is just interrupted".into(),
        },
    }
}

/// A located special point.
#[derive(Clone, Debug)]
pub struct Special {
    /// Kind.
    pub kind: SpecialKind,
    /// What it means.
    pub meaning: String,
    /// Value of the parameter.
    pub parameter: f64,
    /// Error of that value, from the last step of its location.
    pub parameter_error: f64,
    /// The orbit there. At a grazing its multipliers may be without bound.
    pub orbit: Orbit,
    /// Unknowns of the orbit, for curves and other branches from here.
    pub(crate) unknowns: Vec<f64>,
    /// Time of a touch within its segment.
    pub(crate) touch_time: f64,
}
