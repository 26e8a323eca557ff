//! Follows the periodic orbits of a structure with several places over a number of its case.

use std::sync::Arc;

use damprig_continuation::{Family, StructureOrbit, StructureTask};
use damprig_structures::{Drive, Motion, NoDerivatives, Observer, Piece};

use super::found::{FoundBranches, FoundOrbit};
use crate::failure::Failure;
use crate::simulation::Case;
use crate::simulation::analysis::WrittenCase;
use crate::simulation::multi_degree::MultiDegree;
use crate::simulation::multi_degree::driver::cycles;

/// What is followed: a number of a case.
#[derive(Clone, Debug)]
pub(super) struct OverKey {
    /// Its key, with the numbers of tables in lists.
    pub key: String,
    pub range: (f64, f64),
    pub task: StructureTask,
}

impl OverKey {
    /// Follows the orbits of a case, which is `written`, while `goes_on` is true, which sees the value that is looked at.
    ///
    /// # Errors
    /// Why there is no orbit to start from; a value that is refused within the range; that it was stopped.
    pub(super) fn follow(
        &self,
        case: &Case,
        written: &WrittenCase,
        goes_on: &dyn Fn(f64) -> bool,
    ) -> Result<FoundBranches, NotFollowed> {
        let files = Arc::default();
        let at = |value: f64| written.motion(&self.key, value, &files);
        let family = Family { at: &at, range: self.range, goes_on };
        let diagram = family.explore(&self.task)?;
        let orbit = |orbit: &StructureOrbit| {
            let there = written.case(&self.key, orbit.parameter, &files);
            let there =
                there.ok_or_else(|| Failure::Input(format!("{} = {} is refused", self.key, orbit.parameter)))?;
            measured(there, orbit)
        };
        Ok(FoundBranches::of_structure(case, &self.key, &diagram, &orbit)?)
    }
}

/// Why orbits were not followed.
#[derive(Debug)]
pub(super) enum NotFollowed {
    /// There is no orbit to start from, or it was stopped.
    NoOrbit(NoDerivatives),
    /// An orbit could not be measured.
    Failure(Failure),
}

impl From<NoDerivatives> for NotFollowed {
    fn from(why: NoDerivatives) -> Self {
        Self::NoOrbit(why)
    }
}

impl From<Failure> for NotFollowed {
    fn from(failure: Failure) -> Self {
        Self::Failure(failure)
    }
}

/// The orbit as tables show it, at the observed place of its case.
fn measured(mut case: Case, orbit: &StructureOrbit) -> Result<FoundOrbit, Failure> {
    let Drive::ClosedForm(excitation) = &orbit.case.drive else {
        return Err(Failure::Input("an orbit needs a sine".into()));
    };
    case.excitation = *excitation;
    let of = case.multi_degree.take().ok_or_else(|| Failure::Input("the case has no structure with places".into()))?;
    let of = MultiDegree { set_up: orbit.case.set_up.clone(), ..of };
    let refused = |why: &dyn std::fmt::Display| Failure::Input(format!("an orbit cannot be simulated: {why}"));
    let mut maxima = Vec::new();
    let count = orbit.section.periods;
    cycles(&case, &of, &orbit.case.start, (0, count), &mut |_, largest_m| maxima.push(largest_m))
        .map_err(|why| refused(&why))?;
    let mut stroke = Stroke { of: &of, most_m: 0.0 };
    let mut motion = Motion::new(&of.set_up, excitation, &orbit.case.start).map_err(|why| refused(&why))?;
    motion.run(orbit.case.duration_s, &mut stroke).map_err(|why| refused(&why))?;
    let speeds = &orbit.approach_speeds_m_per_s;
    Ok(FoundOrbit {
        parameter: orbit.parameter,
        is_stable: orbit.is_stable(),
        max_abs_x_m: maxima.iter().copied().fold(0.0, f64::max),
        mean_cycle_max_m: maxima.iter().sum::<f64>() / f64::from(count),
        max_abs_y_minus_x_m: stroke.most_m,
        impacts: speeds.len() as u32,
        fastest_impact_m_per_s: speeds.iter().copied().fold(0.0, f64::max),
        multipliers: orbit.multipliers.iter().map(|m| [m.re, m.im]).collect(),
    })
}

/// Largest |y − x| of all particles and tuned masses against their places, m.
struct Stroke<'a> {
    of: &'a MultiDegree,
    most_m: f64,
}

impl Observer for Stroke<'_> {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        let set_up = &self.of.set_up;
        let particles = set_up.impact_dampers.iter().enumerate().map(|(n, of)| (piece.particle(n), of.place));
        let masses = set_up.tuned_masses.iter().enumerate().map(|(n, of)| (piece.tuned_mass(n), of.place));
        for (body, place) in particles.chain(masses) {
            let apart = body.minus(&piece.place(place));
            self.most_m = apart.largest_abs((0.0, piece.length_s), self.most_m);
        }
    }
}
