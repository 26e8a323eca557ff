//! Branches of periodic orbits of any motion that the structures engine follows: single shooting.
//!
//! An orbit is a fixed point of the map of its start over whole periods of the sine. The motion is simulated, with its events wherever they are, and
//! has the exact derivative of the map through each ([`Returned`](damprig_structures::Returned)). So a branch goes on where events appear or vanish
//! smoothly, as a sticking phase does; it ends where an impact appears or vanishes, as the derivative has no bound there.

mod point;
mod trace;

use damprig_structures::{MotionCase, NoDerivatives, Section};
use nalgebra::Complex;

use crate::branch::{BranchEnd, Steps};
use crate::explore::Origin;
use crate::special::SpecialKind;
use point::{OrbitPoint, Shooter, Shot};
use trace::OrbitTrace;

/// Orbits repeat after at most so many drive periods.
const MAX_PERIODS: u32 = 16;

/// Drive periods of the simulations that look for an orbit, each of which goes on from the one before, and the number of the first.
const FIRST_PERIODS: u64 = 200;

/// A start beyond the end of a branch lies this far from it, as a share of the range, and further ones so far apart.
const BEYOND: f64 = 2e-3;
const GAP: f64 = 0.02;

/// Most branches; those that leave others multiply as motions become chaotic.
const MAX_BRANCHES: usize = 24;

/// Two branches end at one place within this share of the parameter: an end at a grazing is not located further.
const SAME_END: f64 = 1e-4;

/// Their fastest impacts are equal within this share, as the speeds change with the root of the distance to a grazing.
const SAME_SPEED: f64 = 0.02;

/// Shares of the motion tried as the first step on a branch that branches off.
const FIRST_STEPS: [f64; 4] = [0.01, 0.003, 0.001, 0.0003];

/// Motions over a parameter.
pub struct Family<'a> {
    /// The motion at a value of the parameter, from its own start; `None` where its set-up is refused.
    pub at: &'a dyn Fn(f64) -> Option<MotionCase>,
    /// Range of the parameter, without 0.
    pub range: (f64, f64),
    /// Told the value of the parameter that is being looked at; whether to go on.
    pub goes_on: &'a dyn Fn(f64) -> bool,
}

/// What is followed.
#[derive(Clone, Copy, Debug)]
pub struct StructureTask {
    /// Value of the parameter at which the first orbit is simulated.
    pub start_at: f64,
    /// Most drive periods of a simulation.
    pub most_periods: u64,
    /// Whether branches that branch off are followed.
    pub switch: bool,
    /// Most new starts by simulation where a branch ends within the range.
    pub most_restarts: usize,
    /// Steps.
    pub steps: Steps,
}

/// An orbit of a branch.
#[derive(Clone, Debug)]
pub struct StructureOrbit {
    /// Value of the parameter.
    pub parameter: f64,
    /// Where it begins.
    pub section: Section,
    /// Its motion over its periods.
    pub case: MotionCase,
    /// Floquet multipliers, the largest first.
    pub multipliers: Vec<Complex<f64>>,
    /// Approach speed of each impact, m/s.
    pub approach_speeds_m_per_s: Vec<f64>,
    /// Number of its events, of each kind up to [`MANY`](damprig_structures::Returned::MANY).
    pub events: usize,
}

impl StructureOrbit {
    /// Whether small disturbances decay: every multiplier is inside the unit circle. Not if they are not known.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        !self.multipliers.is_empty() && self.multipliers.iter().all(|m| m.norm() < 1.0)
    }
}

/// A special point of a branch.
#[derive(Clone, Debug)]
pub struct StructureSpecial {
    /// Kind.
    pub kind: SpecialKind,
    /// What happens there.
    pub meaning: String,
    /// Error of the parameter, from the last step of its location; of a grazing that ends a branch about how far from the orbit it is, not a number where
    /// that is not known.
    pub parameter_error: f64,
    /// The orbit there.
    pub orbit: StructureOrbit,
    shot: Shot,
}

/// Orbits in the order of a branch.
#[derive(Clone, Debug)]
pub struct StructureBranch {
    /// Where it comes from.
    pub origin: Origin,
    /// The orbits.
    pub orbits: Vec<StructureOrbit>,
    /// Special points in order, each with the number of orbits before it.
    pub specials: Vec<(usize, StructureSpecial)>,
    /// How it ends at its first and at its last orbit.
    pub ends: [BranchEnd; 2],
    /// Its last orbits on both sides with their sections, and in which direction of the parameter it ended.
    last: [((Shot, Section), f64); 2],
}

/// Branches over a range.
#[derive(Clone, Debug, Default)]
pub struct StructureDiagram {
    /// The branches in the order in which they were found.
    pub branches: Vec<StructureBranch>,
    /// Values of the parameter at which a new start failed, and why.
    pub gaps: Vec<(f64, NoDerivatives)>,
    /// Values of the parameter at which a new start was due when all were used up.
    pub not_started: Vec<f64>,
    /// Whether branches that leave others were left out, as there are many.
    pub is_cut_short: bool,
}

impl Family<'_> {
    /// Follows the orbits of a task.
    ///
    /// # Errors
    /// Why there is no orbit to start from, or that it was stopped.
    pub fn explore(&self, task: &StructureTask) -> Result<StructureDiagram, NoDerivatives> {
        let mut diagram = StructureDiagram::default();
        diagram.branches.push(self.follow_from(task, task.start_at, None)?);
        let (mut restarts, mut next) = (0, 0);
        while next < diagram.branches.len() {
            for side in [0, 1] {
                self.go_beyond(task, next, side, &mut diagram, &mut restarts)?;
            }
            if task.switch {
                self.switch(task, next, &mut diagram)?;
            }
            next += 1;
        }
        Ok(diagram)
    }

    /// Starts anew where a branch ends inside the range.
    fn go_beyond(
        &self,
        task: &StructureTask,
        number: usize,
        side: usize,
        diagram: &mut StructureDiagram,
        restarts: &mut usize,
    ) -> Result<(), NoDerivatives> {
        let branch = &diagram.branches[number];
        if !matches!(branch.ends[side], BranchEnd::Grazing | BranchEnd::NoConvergence) {
            return Ok(());
        }
        let orbit = if side == 0 { branch.orbits.first() } else { branch.orbits.last() };
        let Some(from) = orbit.map(|orbit| orbit.parameter) else { return Ok(()) };
        let (start, heading) = branch.last[side].clone();
        let width = self.range.1 - self.range.0;
        let mut at = from + heading * BEYOND * width;
        while at > self.range.0 && at < self.range.1 {
            if diagram.branches.iter().any(|branch| branch.covers(at)) {
                return Ok(());
            }
            if *restarts == task.most_restarts {
                diagram.not_started.push(at);
                return Ok(());
            }
            *restarts += 1;
            match self.follow_from(task, at, Some(&start)) {
                Ok(branch) => {
                    diagram.add(branch);
                    return Ok(());
                }
                Err(NoDerivatives::Stopped) => return Err(NoDerivatives::Stopped),
                Err(why) => diagram.gaps.push((at, why)),
            }
            at += heading * GAP * width;
        }
        Ok(())
    }

    /// Simulates the first orbit, from the start of another motion if one is given, and follows it in both directions.
    fn follow_from(
        &self,
        task: &StructureTask,
        value: f64,
        start: Option<&(Shot, Section)>,
    ) -> Result<StructureBranch, NoDerivatives> {
        let case = (self.at)(value).ok_or(NoDerivatives::NoCase)?;
        let (found, section) = self.settle(task, value, &case, start)?;
        let share = (value - self.range.0) / (self.range.1 - self.range.0);
        let returned = found.returned(&[])?;
        let shooter = Shooter::new(self, section, &found, &returned);
        let shot = shooter.correct_at(OrbitPoint { bodies: returned.start, share }, share)?;
        if !shot.is_alone() {
            return Err(NoDerivatives::NotIsolated);
        }
        let up = shooter.upwards(&shot).ok_or(NoDerivatives::NotIsolated)?;
        let down = up.clone().scaled(-1.0);
        let ahead = shooter.trace(&shot, &up, task.steps)?;
        let is_closed = ahead.end == BranchEnd::Closed;
        let steps_back = if is_closed { Steps { most_orbits: 0, ..task.steps } } else { task.steps };
        let back = shooter.trace(&shot, &down, steps_back)?;
        let mut branch = StructureBranch::joined(Origin::Simulation(value), back, shooter.orbit(&shot), ahead);
        if is_closed {
            branch.ends[0] = BranchEnd::Closed;
        }
        Ok(branch)
    }

    /// The orbit that a motion comes to, over its periods.
    fn settle(
        &self,
        task: &StructureTask,
        value: f64,
        case: &MotionCase,
        start: Option<&(Shot, Section)>,
    ) -> Result<(MotionCase, Section), NoDerivatives> {
        let (mut case, mut advance_rad) = (case.clone(), 0.0);
        if let Some((shot, section)) = start {
            // A particle may have no room there at another value of the parameter; then the case's own start is as good.
            let there = case.at_section(&shot.case, *section, shot.point.bodies.as_slice());
            if let Ok(there) = there.and_then(|there| there.bodies_after(0.0).map(|_| there)) {
                (case, advance_rad) = (there, section.advance_rad);
            }
        }
        let (mut simulated, mut periods) = (0, FIRST_PERIODS);
        loop {
            if !(self.goes_on)(value) {
                return Err(NoDerivatives::Stopped);
            }
            let run = case.over_periods(periods as u32);
            match run.settled(MAX_PERIODS) {
                Ok((found, section)) => {
                    let advance_rad = advance_rad + section.advance_rad;
                    return Ok((found, Section { advance_rad, ..section }));
                }
                Err(why @ NoDerivatives::Refused(_)) => return Err(why),
                Err(why) if simulated + periods >= task.most_periods => return Err(why),
                Err(_) => {}
            }
            // After whole periods the sine is where it was.
            let bodies = run.bodies_after(run.duration_s)?;
            case = run.at_section(&run, Section { periods: 1, advance_rad: 0.0 }, &bodies)?;
            simulated += periods;
            periods = (2 * periods).min(task.most_periods - simulated).max(1);
        }
    }

    /// Follows the branches that branch off at the special points of a branch.
    fn switch(&self, task: &StructureTask, number: usize, diagram: &mut StructureDiagram) -> Result<(), NoDerivatives> {
        let branch = diagram.branches[number].clone();
        for (place, (_, special)) in branch.specials.iter().enumerate() {
            if diagram.branches.len() >= MAX_BRANCHES {
                diagram.is_cut_short = true;
                break;
            }
            let periods = special.orbit.section.periods;
            let multiplier = match special.kind {
                SpecialKind::PeriodDoubling if 2 * periods <= MAX_PERIODS => -1.0,
                SpecialKind::SymmetryBreaking => 1.0,
                _ => continue,
            };
            let origin = Origin::BranchPoint { branch: number, special: place };
            if let Some(found) = self.branch_off(task, special, multiplier, origin)? {
                diagram.add(found);
            }
        }
        Ok(())
    }

    /// The branch that leaves a special point along its neutral direction: with a multiplier of −1 an orbit of twice the period.
    fn branch_off(
        &self,
        task: &StructureTask,
        special: &StructureSpecial,
        multiplier: f64,
        origin: Origin,
    ) -> Result<Option<StructureBranch>, NoDerivatives> {
        let section = special.orbit.section;
        let shot = &special.shot;
        let parent = Shooter::new(self, section, &shot.case, &shot.returned);
        let Some(along) = parent.neutral(shot, multiplier) else { return Ok(None) };
        let times = if multiplier < 0.0 { 2 } else { 1 };
        let longer = Section { periods: times * section.periods, ..section };
        let shooter = Shooter::new(self, longer, &shot.case, &shot.returned);
        for step in FIRST_STEPS {
            let there = shooter.correct(shot.point.plus(&along, step), &shot.point, &along, step);
            if matches!(there, Err(NoDerivatives::Stopped)) {
                return Err(NoDerivatives::Stopped);
            }
            let Ok(here) = shooter.shoot(shot.point.clone(), 0) else { continue };
            // Beside the special point the orbit has its events, and does not repeat sooner.
            let guess = shot.point.plus(&along, step);
            let is_of_it = |there: &Shot| {
                (0.0..=1.0).contains(&there.point.share)
                    && shooter.length(&there.point.minus(&guess)) <= step
                    && there.returned.events == here.returned.events
                    && shooter.half_apart(there, -multiplier) > 0.1 * step
            };
            let Some(there) = there.ok().filter(is_of_it) else { continue };
            let Some(outward) = shooter.tangent(&there, &along) else { continue };
            let first = shooter.orbit(&there);
            let ahead = shooter.trace(&there, &outward, task.steps)?;
            let end = if multiplier < 0.0 { BranchEnd::PeriodDoubling } else { BranchEnd::SymmetryBreaking };
            let back = OrbitTrace {
                orbits: vec![shooter.orbit(&here)],
                specials: Vec::new(),
                end,
                last: (here, along),
                section: longer,
            };
            return Ok(Some(StructureBranch::joined(origin, back, first, ahead)));
        }
        Ok(None)
    }
}

impl StructureDiagram {
    /// Adds a branch unless it or its mirror image is known: it may be found from its other end, or by a simulation from elsewhere.
    fn add(&mut self, found: StructureBranch) {
        if !self.branches.iter().any(|known| known.is_same(&found)) {
            self.branches.push(found);
        }
    }
}

impl StructureBranch {
    /// Both directions from an orbit.
    fn joined(origin: Origin, back: OrbitTrace, middle: StructureOrbit, ahead: OrbitTrace) -> Self {
        let count = back.orbits.len();
        let last = [&back, &ahead].map(|trace| ((trace.last.0.clone(), trace.section), trace.last.1.share.signum()));
        let mut orbits: Vec<StructureOrbit> = back.orbits.into_iter().rev().collect();
        orbits.push(middle);
        orbits.extend(ahead.orbits);
        let mut specials: Vec<(usize, StructureSpecial)> =
            back.specials.into_iter().rev().map(|(n, special)| (count - n, special)).collect();
        specials.extend(ahead.specials.into_iter().map(|(n, special)| (n + count + 1, special)));
        Self { origin, orbits, specials, ends: [back.end, ahead.end], last }
    }

    /// Whether the parameter passes `value` along the branch on stable orbits.
    fn covers(&self, value: f64) -> bool {
        self.orbits.windows(2).any(|pair| {
            (pair[0].parameter - value) * (pair[1].parameter - value) <= 0.0
                && pair.iter().all(StructureOrbit::is_stable)
        })
    }

    /// Whether two branches begin and end at the same orbits, or at their mirror images.
    fn is_same(&self, other: &Self) -> bool {
        let near = |a: &StructureOrbit, b: &StructureOrbit| {
            let same = |p: f64, q: f64| (p - q).abs() <= SAME_END * p.abs().max(q.abs());
            // Multipliers have no bound at a grazing.
            let fastest = |orbit: &StructureOrbit| orbit.approach_speeds_m_per_s.iter().copied().fold(0.0, f64::max);
            same(a.parameter, b.parameter)
                && a.events == b.events
                && a.section.periods == b.section.periods
                && (fastest(a) - fastest(b)).abs() <= SAME_SPEED * fastest(a)
        };
        let ends = |branch: &Self| Some((branch.orbits.first()?.clone(), branch.orbits.last()?.clone()));
        let (Some(own), Some(of_other)) = (ends(self), ends(other)) else { return false };
        (near(&own.0, &of_other.0) && near(&own.1, &of_other.1))
            || (near(&own.0, &of_other.1) && near(&own.1, &of_other.0))
    }
}
