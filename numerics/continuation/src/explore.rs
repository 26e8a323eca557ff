//! Branches over a parameter range: from a simulated orbit in both directions, beyond grazings, and into the branches that
//! cross.

use damprig_core::model::Initial;

use crate::boundary_problem::BoundaryProblem;
use crate::branch::{BranchEnd, Steps};
use crate::follower::{Follower, Point};
use crate::orbit::Orbit;
use crate::parameter::Parameter;
use crate::sequence::Sequence;
use crate::special::{Special, SpecialKind};
use crate::start::{NoStart, Start};
use crate::system::System;

/// What is followed.
#[derive(Clone, Debug)]
pub struct Task {
    /// The parameter.
    pub parameter: Parameter,
    /// Its range, from the lower to the upper value.
    pub range: (f64, f64),
    /// Value at which the first orbit is simulated, within the range.
    pub start_at: f64,
    /// Initial state of that simulation.
    pub initial: Initial,
    /// Phase of the drive there, rad.
    pub phase_rad: f64,
    /// Most drive periods of a simulation.
    pub most_periods: u64,
    /// Whether branches that branch off are followed.
    pub switch: bool,
    /// Most new starts by simulation where a branch ends at a grazing within the range.
    pub most_restarts: usize,
    /// Steps.
    pub steps: Steps,
}

/// Where a branch comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Origin {
    /// A simulation at this value of the parameter.
    Simulation(f64),
    /// A special point of another branch, by its number.
    BranchPoint {
        /// Number of the branch.
        branch: usize,
        /// Number of the special point on it.
        special: usize,
    },
}

/// Orbits with one sequence of events, in the order of the branch.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The sequence.
    pub sequence: Sequence,
    /// Where it comes from.
    pub origin: Origin,
    /// The orbits.
    pub orbits: Vec<Orbit>,
    /// Special points in order, each with the number of orbits before it.
    pub specials: Vec<(usize, Special)>,
    /// How it ends at its first and at its last orbit.
    pub ends: [BranchEnd; 2],
}

/// Branches over a range.
#[derive(Clone, Debug, Default)]
pub struct Diagram {
    /// The branches in the order in which they were found.
    pub branches: Vec<Branch>,
    /// Values of the parameter at which a new start failed, and why.
    pub gaps: Vec<(f64, NoStart)>,
    /// Values of the parameter at which a new start was due when all were used up.
    pub not_started: Vec<f64>,
}

/// A start beyond a grazing lies this far from it, as a share of the range.
const BEYOND: f64 = 2e-3;

/// Steps between further starts where the first one finds no periodic motion, as a share of the range.
const GAP: f64 = 0.02;

/// Shares of the unknowns tried as the first step on a branch that branches off.
const FIRST_STEPS: [f64; 4] = [0.01, 0.003, 0.03, 0.001];

impl System {
    /// Follows the orbits of a task.
    ///
    /// # Errors
    /// Why there is no orbit to start from.
    pub fn explore(&self, task: &Task) -> Result<Diagram, NoStart> {
        let mut diagram = Diagram::default();
        let first = self.follow_from(task, task.start_at, &task.initial, task.phase_rad)?;
        diagram.branches.push(first);
        let mut restarts = 0;
        let mut next = 0;
        while next < diagram.branches.len() {
            for side in [0, 1] {
                self.go_beyond(task, next, side, &mut diagram, &mut restarts);
            }
            if task.switch {
                self.switch(task, next, &mut diagram);
            }
            next += 1;
        }
        Ok(diagram)
    }

    /// Starts anew where a branch ends at a grazing inside the range.
    fn go_beyond(&self, task: &Task, number: usize, side: usize, diagram: &mut Diagram, restarts: &mut usize) {
        let branch = &diagram.branches[number];
        if branch.ends[side] != BranchEnd::Grazing || branch.orbits.len() < 2 {
            return;
        }
        let special = if side == 0 { branch.specials.first() } else { branch.specials.last() };
        let Some((_, special)) = special else { return };
        let inner = if side == 0 { branch.orbits.get(1) } else { branch.orbits.iter().rev().nth(1) };
        let Some(inner) = inner else { return };
        let width = task.range.1 - task.range.0;
        let heading = (special.parameter - inner.parameters[0]).signum();
        let (initial, phase_rad) = (special.orbit.initial(), special.orbit.start_phase_rad);
        let mut at = special.parameter + heading * BEYOND * width;
        while at > task.range.0 && at < task.range.1 {
            if diagram.branches.iter().any(|branch| branch.covers(at)) {
                return;
            }
            if *restarts == task.most_restarts {
                diagram.not_started.push(at);
                return;
            }
            *restarts += 1;
            match self.follow_from(task, at, &self.inside(task.parameter, at, initial), phase_rad) {
                Ok(branch) => {
                    diagram.add(branch);
                    return;
                }
                Err(why) => diagram.gaps.push((at, why)),
            }
            at += heading * GAP * width;
        }
    }

    /// The initial state with the particle inside its cavity at another value of the parameter.
    fn inside(&self, parameter: Parameter, value: f64, initial: Initial) -> Initial {
        let (set_up, _) = self.at(&[(parameter, value)]);
        let Some(particle) = set_up.particle else { return initial };
        let (most, middle) = (particle.clearance_m * (1.0 - 1e-9), initial.x_m + particle.cavity.offset_m);
        Initial { y_m: middle + (initial.y_m - middle).clamp(-most, most), ..initial }
    }

    /// Simulates the first orbit and follows it in both directions.
    fn follow_from(&self, task: &Task, at: f64, initial: &Initial, phase_rad: f64) -> Result<Branch, NoStart> {
        let settings = [(task.parameter, at)];
        let start = self.settle(&settings, initial, phase_rad, task.most_periods)?;
        self.follow_start(task, &start, at)
    }

    fn follow_start(&self, task: &Task, start: &Start, at: f64) -> Result<Branch, NoStart> {
        let parameters = [task.parameter];
        let problem = BoundaryProblem { system: self, sequence: &start.sequence, parameters: &parameters };
        let follower = Follower::new(problem, &start.unknowns, task.range);
        let guess = follower.point(&start.unknowns, at);
        let solution = follower.correct_at(guess, at).ok_or(NoStart::NoConvergence)?;
        let point = solution.unknowns;
        if !follower.violations(&point).is_empty() {
            return Err(NoStart::NoConvergence);
        }
        let up = follower.first_tangent(&point, 1.0).ok_or(NoStart::NoConvergence)?;
        Ok(follower.both_ways(&point, &up, task.steps, Origin::Simulation(at)))
    }

    /// Follows the branches that branch off at the special points of a branch.
    fn switch(&self, task: &Task, number: usize, diagram: &mut Diagram) {
        let branch = diagram.branches[number].clone();
        if !matches!(branch.origin, Origin::Simulation(_)) && branch.sequence.periods > 8 {
            return;
        }
        for (place, (_, special)) in branch.specials.iter().enumerate() {
            let origin = Origin::BranchPoint { branch: number, special: place };
            let found = match special.kind {
                SpecialKind::PeriodDoubling if branch.sequence.periods <= 8 => {
                    self.branch_off(task, &branch.sequence, special, -1.0, origin)
                }
                SpecialKind::SymmetryBreaking => self.branch_off(task, &branch.sequence, special, 1.0, origin),
                _ => None,
            };
            if let Some(found) = found {
                diagram.add(found);
            }
        }
    }

    /// The branch that leaves a special point along its neutral direction: with `twist` −1 an orbit of twice the period.
    fn branch_off(
        &self,
        task: &Task,
        sequence: &Sequence,
        special: &Special,
        twist: f64,
        origin: Origin,
    ) -> Option<Branch> {
        let parameters = [task.parameter];
        let problem = BoundaryProblem { system: self, sequence, parameters: &parameters };
        let parent = Follower::new(problem, &special.unknowns, task.range);
        let point = parent.point(&special.unknowns, special.parameter);
        let direction = parent.neutral_direction(&point, twist)?;
        let size = problem.len();
        let doubled = if twist < 0.0 { sequence.doubled() } else { sequence.clone() };
        let (unknowns, direction) = if twist < 0.0 {
            let once = direction.rows(0, size);
            let both: Vec<f64> = once.iter().copied().chain(once.iter().map(|d| -d)).collect();
            (parent.doubled(&point), both)
        } else {
            (special.unknowns.clone(), direction.rows(0, size).iter().copied().collect())
        };
        let problem = BoundaryProblem { system: self, sequence: &doubled, parameters: &parameters };
        let follower = Follower::new(problem, &unknowns, task.range);
        let point = follower.point(&unknowns, special.parameter);
        let mut along = Point::from_vec(direction).push(0.0);
        along /= follower.inner(&along, &along).sqrt();
        let mut first = FIRST_STEPS.iter().filter_map(|step| {
            let there = follower.correct(&point + &along * *step, &point, &along, *step)?.unknowns;
            let is_inside = (0.0..=1.0).contains(&there[follower.problem.len()]);
            (is_inside && follower.violations(&there).is_empty()).then_some(there)
        });
        let there = first.next()?;
        let outward = follower.tangent(&there, &along)?;
        let trace = follower.trace(&there, &outward, task.steps);
        let mut orbits = vec![follower.orbit(&point), follower.orbit(&there)];
        let before = orbits.len();
        orbits.extend(trace.orbits);
        let specials = trace.specials.into_iter().map(|(n, special)| (n + before, special)).collect();
        let first = if twist < 0.0 { BranchEnd::PeriodDoubling } else { BranchEnd::SymmetryBreaking };
        Some(Branch { sequence: doubled, origin, orbits, specials, ends: [first, trace.end] })
    }
}

impl Diagram {
    /// Adds a branch unless it or its mirror image is known: it may be found from its other end, or by a simulation from elsewhere.
    fn add(&mut self, found: Branch) {
        if !self.branches.iter().any(|known| known.is_same(&found)) {
            self.branches.push(found);
        }
    }
}

impl Branch {
    /// Whether the parameter passes `value` along the branch on stable orbits.
    fn covers(&self, value: f64) -> bool {
        self.orbits.windows(2).any(|pair| {
            let (a, b) = (pair[0].parameters[0], pair[1].parameters[0]);
            (a - value) * (b - value) <= 0.0 && pair.iter().all(Orbit::is_stable)
        })
    }

    /// Whether two branches begin and end at the same orbits, or at their mirror images.
    fn is_same(&self, other: &Self) -> bool {
        let near = |a: Option<&Orbit>, b: Option<&Orbit>| match (a, b) {
            (Some(a), Some(b)) => {
                let same = |p: f64, q: f64| (p - q).abs() <= 1e-6 * p.abs().max(q.abs());
                same(a.parameters[0], b.parameters[0]) && same(a.max_abs_x_m, b.max_abs_x_m)
            }
            _ => false,
        };
        self.sequence.periods == other.sequence.periods
            && self.sequence.segments.len() == other.sequence.segments.len()
            && ((near(self.orbits.first(), other.orbits.first()) && near(self.orbits.last(), other.orbits.last()))
                || (near(self.orbits.first(), other.orbits.last()) && near(self.orbits.last(), other.orbits.first())))
    }
}

impl Follower<'_> {
    /// Follows a branch in both directions and joins them.
    fn both_ways(&self, point: &Point, up: &Point, steps: Steps, origin: Origin) -> Branch {
        let ahead = self.trace(point, up, steps);
        let is_closed = ahead.end == BranchEnd::Closed;
        let steps_back = if is_closed { Steps { most_orbits: 0, ..steps } } else { steps };
        let back = self.trace(point, &-up, steps_back);
        let count = back.orbits.len();
        let mut orbits: Vec<Orbit> = back.orbits.into_iter().rev().collect();
        orbits.push(self.orbit(point));
        orbits.extend(ahead.orbits);
        let mut specials: Vec<(usize, Special)> =
            back.specials.into_iter().rev().map(|(n, special)| (count - n, special)).collect();
        specials.extend(ahead.specials.into_iter().map(|(n, special)| (n + count + 1, special)));
        let first = if is_closed { BranchEnd::Closed } else { back.end };
        Branch { sequence: self.problem.sequence.clone(), origin, orbits, specials, ends: [first, ahead.end] }
    }
}
