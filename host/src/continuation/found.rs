//! The result of a continuation, for tables, figures and JSON.

use damprig_continuation::{
    Branch, BranchEnd, Curve, Diagram, Orbit, Origin, Special, SpecialKind, StructureBranch, StructureDiagram,
    StructureOrbit, StructureSpecial,
};
use damprig_structures::NoDerivatives;
use serde::Serialize;

use crate::failure::Failure;
use crate::simulation::Case;
use crate::simulation::parameters::ParameterKey;

/// Branches of periodic orbits.
#[derive(Clone, Debug, Serialize)]
pub struct FoundBranches {
    /// Name of the case.
    pub case: String,
    /// Text of the case.
    #[serde(skip)]
    pub case_text: String,
    /// What acts in place of walls with Hertz contact; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walls: Option<String>,
    /// Key of the parameter.
    pub parameter: String,
    /// Symbol of the case's reference length: `Z`, `(P/k)` or `x0`.
    #[serde(skip)]
    pub reference: &'static str,
    /// The branches.
    pub branches: Vec<FoundBranch>,
    /// Parts of the range of the parameter, from and to, in which no orbit was found.
    pub not_covered: Vec<[f64; 2]>,
    /// Values of the parameter at which a new start found no periodic orbit, and why.
    pub gaps: Vec<FoundGap>,
    /// Values of the parameter at which a new start was due when all `restarts` were used up.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_started: Vec<f64>,
    /// Whether branches that leave others were left out, as there are many.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_cut_short: bool,
    /// Key of the second parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_parameter: Option<String>,
    /// Curves of special points in both parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub curves: Vec<FoundCurve>,
}

/// A curve of special points in two parameters.
#[derive(Clone, Debug, Serialize)]
pub struct FoundCurve {
    /// Number of the branch with the special point.
    pub branch: usize,
    /// Kind.
    pub kind: &'static str,
    /// What it means.
    pub meaning: String,
    /// How it ends at its first and last point.
    pub ends: [&'static str; 2],
    /// Both parameters and max |x|, m.
    pub points: Vec<[f64; 3]>,
}

impl FoundCurve {
    pub(super) fn of(branch: usize, curve: &Curve) -> Self {
        let of_end = |end| match end {
            BranchEnd::Range => "end of a range",
            BranchEnd::Grazing => "another grazing",
            // Curves do not branch.
            BranchEnd::Closed | BranchEnd::SymmetryBreaking | BranchEnd::PeriodDoubling => "its own start",
            BranchEnd::NoConvergence => "no convergence",
            BranchEnd::TooLong => "largest number of points",
        };
        Self {
            branch,
            kind: curve.kind.name(),
            meaning: curve.meaning.clone(),
            ends: curve.ends.map(of_end),
            points: curve.orbits.iter().map(|o| [o.parameters[0], o.parameters[1], o.max_abs_x_m]).collect(),
        }
    }
}

/// A start without an orbit.
#[derive(Clone, Debug, Serialize)]
pub struct FoundGap {
    /// The parameter.
    pub parameter: f64,
    /// Why.
    pub why: String,
}

/// A branch.
#[derive(Clone, Debug, Serialize)]
pub struct FoundBranch {
    /// Number, from 1.
    pub number: usize,
    /// Where it comes from.
    pub origin: String,
    /// Drive periods of its orbits.
    pub periods: u32,
    /// How it ends at its first and last orbit.
    pub ends: [&'static str; 2],
    /// Its special points.
    pub special_points: Vec<FoundSpecial>,
    /// Its orbits.
    pub orbits: Vec<FoundOrbit>,
}

/// A special point.
#[derive(Clone, Debug, Serialize)]
pub struct FoundSpecial {
    /// Kind.
    pub kind: &'static str,
    /// What it means.
    pub meaning: String,
    /// The parameter.
    pub parameter: f64,
    /// Error of the parameter by the last step of its location; of a grazing before which a branch of a structure ends about how far it is, `null` where
    /// that is not known.
    pub parameter_error: f64,
    /// max |x| there, m.
    pub max_abs_x_m: f64,
    /// Number of orbits of the branch before it.
    pub after_orbits: usize,
}

/// An orbit.
#[derive(Clone, Debug, Serialize)]
pub struct FoundOrbit {
    /// The parameter.
    pub parameter: f64,
    /// Whether it is stable.
    pub is_stable: bool,
    /// max |x|, m.
    pub max_abs_x_m: f64,
    /// Mean over the drive periods of max |x| in each, m.
    pub mean_cycle_max_m: f64,
    /// max |y − x|, m.
    pub max_abs_y_minus_x_m: f64,
    /// Impacts in an orbit.
    pub impacts: u32,
    /// The fastest approach speed, m/s.
    pub fastest_impact_m_per_s: f64,
    /// Floquet multipliers, real and imaginary part.
    pub multipliers: Vec<[f64; 2]>,
}

impl FoundBranches {
    /// The branches of a system of one degree of freedom over this parameter of a case.
    pub(super) fn of(case: &str, parameter: &ParameterKey, reference: &'static str, diagram: &Diagram) -> Self {
        let branches = diagram.branches.iter().enumerate().map(|(n, branch)| FoundBranch::of(n, branch)).collect();
        let gaps = diagram.gaps.iter().map(|(at, why)| FoundGap { parameter: *at, why: why.to_string() }).collect();
        let not_started = diagram.not_started.clone();
        Self { branches, gaps, not_started, ..Self::none(case, parameter.key, reference) }
    }

    /// The branches of a structure; `orbit` measures its orbits.
    pub(super) fn of_structure(
        case: &Case,
        parameter: &str,
        diagram: &StructureDiagram,
        orbit: &dyn Fn(&StructureOrbit) -> Result<FoundOrbit, Failure>,
    ) -> Result<Self, Failure> {
        let branches = diagram.branches.iter().enumerate();
        let branches = branches.map(|(n, branch)| FoundBranch::of_structure(n, branch, orbit));
        let gap = |(at, why): &(f64, NoDerivatives)| FoundGap { parameter: *at, why: no_orbit(why) };
        let gaps = diagram.gaps.iter().map(gap).collect();
        Ok(Self {
            branches: branches.collect::<Result<_, Failure>>()?,
            gaps,
            not_started: diagram.not_started.clone(),
            is_cut_short: diagram.is_cut_short,
            ..Self::none(&case.name, parameter, case.reference_m().map_or("Z", |(_, symbol)| symbol))
        })
    }

    fn none(case: &str, parameter: &str, reference: &'static str) -> Self {
        Self {
            case: case.into(),
            case_text: String::new(),
            walls: None,
            parameter: parameter.into(),
            reference,
            branches: Vec::new(),
            not_covered: Vec::new(),
            gaps: Vec::new(),
            not_started: Vec::new(),
            is_cut_short: false,
            second_parameter: None,
            curves: Vec::new(),
        }
    }
}

/// Parts of a range up to this share of it are no gap between branches: orbits beside a special point are a step away from it.
const NO_PART: f64 = 1e-3;

impl FoundBranches {
    /// Parts of a range of the parameter that no branch covers.
    pub(super) fn parts_not_covered(&self, (low, high): (f64, f64)) -> Vec<[f64; 2]> {
        let mut covered: Vec<[f64; 2]> = self.branches.iter().filter_map(FoundBranch::range).collect();
        covered.sort_by(|a, b| a[0].total_cmp(&b[0]));
        covered.push([high, high]);
        let (mut parts, mut up_to) = (Vec::new(), low);
        for [from, to] in covered {
            if from - up_to > NO_PART * (high - low) {
                parts.push([up_to, from]);
            }
            up_to = up_to.max(to);
        }
        parts
    }
}

impl FoundBranch {
    /// The smallest and the largest parameter of its orbits; `None` without orbits.
    #[must_use]
    pub fn range(&self) -> Option<[f64; 2]> {
        let all = self.orbits.iter().map(|orbit| orbit.parameter);
        let range = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], own| [low.min(own), high.max(own)]);
        (!self.orbits.is_empty()).then_some(range)
    }
}

/// Why there is no orbit.
pub(super) fn no_orbit(why: &NoDerivatives) -> String {
    why.to_string().trim_start_matches("no derivatives: ").to_string()
}

fn origin(of: Origin) -> String {
    match of {
        Origin::Simulation(at) => format!("simulation at {at}"),
        Origin::BranchPoint { branch, special } => format!("special point {} of branch {}", special + 1, branch + 1),
    }
}

fn end(of: BranchEnd) -> &'static str {
    match of {
        BranchEnd::Range => "end of the range",
        BranchEnd::Grazing => "grazing",
        BranchEnd::Closed => "its own start",
        BranchEnd::SymmetryBreaking => "symmetry breaking",
        BranchEnd::PeriodDoubling => "period doubling",
        BranchEnd::NoConvergence => "no convergence",
        BranchEnd::TooLong => "largest number of orbits",
    }
}

impl FoundBranch {
    fn of(place: usize, branch: &Branch) -> Self {
        Self {
            number: place + 1,
            origin: origin(branch.origin.clone()),
            periods: branch.sequence.periods,
            ends: branch.ends.map(end),
            special_points: branch.specials.iter().map(|(n, special)| FoundSpecial::of(*n, special)).collect(),
            orbits: branch.orbits.iter().map(FoundOrbit::of).collect(),
        }
    }

    fn of_structure(
        place: usize,
        branch: &StructureBranch,
        orbit: &dyn Fn(&StructureOrbit) -> Result<FoundOrbit, Failure>,
    ) -> Result<Self, Failure> {
        let special = |(after_orbits, special): &(usize, StructureSpecial)| {
            Ok(FoundSpecial {
                kind: special.kind.name(),
                meaning: special.meaning.clone(),
                parameter: special.orbit.parameter,
                parameter_error: special.parameter_error,
                max_abs_x_m: orbit(&special.orbit)?.max_abs_x_m,
                after_orbits: *after_orbits,
            })
        };
        let first = branch.orbits.first();
        Ok(Self {
            number: place + 1,
            origin: origin(branch.origin.clone()),
            periods: first.map_or(0, |orbit| orbit.section.periods),
            ends: branch.ends.map(end),
            special_points: branch.specials.iter().map(special).collect::<Result<_, Failure>>()?,
            orbits: branch.orbits.iter().map(orbit).collect::<Result<_, Failure>>()?,
        })
    }
}

impl FoundSpecial {
    fn of(after_orbits: usize, special: &Special) -> Self {
        Self {
            kind: special.kind.name(),
            meaning: special.meaning.clone(),
            parameter: special.parameter,
            parameter_error: special.parameter_error,
            max_abs_x_m: special.orbit.max_abs_x_m,
            after_orbits,
        }
    }

    /// Whether the branch ends here.
    #[must_use]
    pub fn is_grazing(&self) -> bool {
        self.kind == SpecialKind::Grazing(Vec::new()).name()
    }
}

impl FoundOrbit {
    fn of(orbit: &Orbit) -> Self {
        Self {
            parameter: orbit.parameters[0],
            is_stable: orbit.is_stable(),
            max_abs_x_m: orbit.max_abs_x_m,
            mean_cycle_max_m: orbit.mean_cycle_max_m,
            max_abs_y_minus_x_m: orbit.max_abs_y_minus_x_m,
            impacts: orbit.impacts,
            fastest_impact_m_per_s: orbit.fastest_impact_m_per_s,
            multipliers: orbit.multipliers.iter().map(|m| [m.re, m.im]).collect(),
        }
    }
}
