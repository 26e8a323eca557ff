//! Follows a branch in one direction, with the special points on it.

use damprig_structures::{NoDerivatives, Returned, Section};

use super::point::{Crossing, Direction, OrbitPoint, OrbitTests, Shooter, Shot};
use super::{StructureOrbit, StructureSpecial};
use crate::branch::{BranchEnd, Steps};
use crate::special::SpecialKind;

/// Shortest step, as a share of the range. Near a grazing the bend of the branch grows without bound.
const SHORTEST: f64 = 1e-5;

/// So many orbits in a row whose steps are below this share of the longest are the approach to an end.
const MAX_SHORT: usize = 60;
const SHORT: f64 = 0.02;

/// Most divisions of a step to locate a special point, and its accuracy in arc length.
const MAX_DIVISIONS: usize = 40;
const LOCATED: f64 = 1e-9;

/// The orbits beside a change of events are within this share of a step, or there is a gap between them.
const GAP: f64 = 1e-3;

/// A test function below this share of its values beside is zero there.
const ZERO: f64 = 1e-3;

/// An orbit is within this share of a step of where its tangent leads.
const NEAR: f64 = 0.3;

/// Orbits that are their own mirror image are so within this share of the motion: the last step of Newton's method.
const SYMMETRIC: f64 = 1e-6;

/// Two mirrored or repeated states are equal within this share of the motion. A fold is located to the root of its parameter's error.
const SAME: f64 = 1e-3;

/// An impact slower than this share of the fastest one is about to vanish.
const SLOW: f64 = 0.05;

/// Largest multiplier at which a motion a little beside an orbit still tells of its neighbours.
const MAX_GROWTH: f64 = 100.0;

/// A test function.
type Test = fn(&OrbitTests) -> f64;

/// The orbits in one direction from a start.
pub(super) struct OrbitTrace {
    pub orbits: Vec<StructureOrbit>,
    /// Each with the number of orbits before it.
    pub specials: Vec<(usize, StructureSpecial)>,
    pub end: BranchEnd,
    /// The last orbit, and the direction in which it was reached.
    pub last: (Shot, Direction),
    /// Its section.
    pub section: Section,
}

/// An orbit on a branch, with the direction of the branch there.
struct Here {
    shot: Shot,
    along: Direction,
    tests: OrbitTests,
}

/// The next orbit, with what lies between.
struct Next {
    there: Here,
    /// It is at the end of the range.
    is_over: bool,
    specials: Vec<StructureSpecial>,
    /// The branch ends there on the one that it branches off from.
    meeting: Option<(Shot, BranchEnd)>,
}

impl Shooter<'_> {
    /// Follows the branch from `start` along `tangent`.
    ///
    /// # Errors
    /// It was stopped.
    pub fn trace(&self, start: &Shot, tangent: &Direction, steps: Steps) -> Result<OrbitTrace, NoDerivatives> {
        let mut shooter = self.clone();
        let tests = self.tests(start, tangent);
        let mut here = Here { shot: start.clone(), along: tangent.clone(), tests };
        let (mut orbits, mut specials) = (Vec::new(), Vec::new());
        let (mut end, mut step, mut short) = (BranchEnd::TooLong, 0.1 * steps.longest, 0);
        while orbits.len() < steps.most_orbits {
            let next = if short < MAX_SHORT { shooter.next(&here, step)? } else { None };
            let Some(Next { there, is_over, specials: found, meeting }) = next else {
                step *= 0.5;
                if step < SHORTEST || short == MAX_SHORT {
                    let special = shooter.end_of_orbits(&here, &orbits);
                    end = if special.is_some() { BranchEnd::Grazing } else { BranchEnd::NoConvergence };
                    specials.extend(special.map(|special| (orbits.len(), special)));
                    break;
                }
                continue;
            };
            specials.extend(found.into_iter().map(|special| (orbits.len(), special)));
            if let Some((shot, met)) = meeting {
                orbits.push(shooter.orbit(&shot));
                end = met;
                break;
            }
            orbits.push(shooter.orbit(&there.shot));
            let gap = there.shot.point.minus(&start.point);
            let is_back = shooter.section == self.section
                && orbits.len() > 20
                && shooter.length(&gap) < step
                && shooter.inner(&there.along, tangent) > 0.9;
            short = if step < SHORT * steps.longest { short + 1 } else { 0 };
            step = match there.shot.steps {
                0..=3 => (1.5 * step).min(steps.longest),
                4..=5 => step,
                _ => 0.5 * step,
            };
            let last = here.shot.point;
            here = there;
            if is_over || is_back {
                end = if is_back { BranchEnd::Closed } else { BranchEnd::Range };
                break;
            }
            if let Some((moved, last, shot)) = shooter.moved(&last, &here.shot)
                && let Some(along) = moved.tangent(&shot, &shot.point.minus(&last))
            {
                shooter = moved;
                here = Here { shot, along, ..here };
            }
        }
        Ok(OrbitTrace { orbits, specials, end, last: (here.shot, here.along), section: shooter.section })
    }

    /// The orbit a step further, at most at the end of the range; `None` if the step is too long.
    fn next(&self, here: &Here, step: f64) -> Result<Option<Next>, NoDerivatives> {
        let guess = here.shot.point.plus(&here.along, step);
        let found = unless_stopped(self.correct(guess.clone(), &here.shot.point, &here.along, step))?;
        // An orbit that is far from the guess is another branch's, or lies behind.
        let is_of_branch =
            |shot: &Shot, guess: &OrbitPoint| self.length(&shot.point.minus(guess)) <= NEAR * step && shot.is_alone();
        let Some(mut shot) = found.filter(|shot| is_of_branch(shot, &guess)) else { return Ok(None) };
        let mut is_over = false;
        if !(0.0..=1.0).contains(&shot.point.share) {
            let edge = if shot.point.share < 0.0 { 0.0 } else { 1.0 };
            let moved = shot.point.minus(&here.shot.point);
            let share = ((edge - here.shot.point.share) / moved.share).clamp(0.0, 1.0);
            let guess = here.shot.point.plus(&moved, share);
            let last = unless_stopped(self.correct_at(guess.clone(), edge))?;
            let Some(last) = last.filter(|last| is_of_branch(last, &guess)) else { return Ok(None) };
            (shot, is_over) = (last, true);
        }
        let Some(along) = self.tangent(&shot, &here.along) else { return Ok(None) };
        // A sharp bend is followed in shorter steps.
        if self.inner(&along, &here.along) < 0.9 && step > 1e3 * SHORTEST {
            return Ok(None);
        }
        let tests = self.tests(&shot, &along);
        let there = Here { shot, along, tests };
        let is_turning = here.tests.fold * there.tests.fold < 0.0;
        let [was, is] = [here, &there].map(|of| self.half_apart(&of.shot, -1.0) < SYMMETRIC);
        if was != is && !is_turning {
            return Ok(None);
        }
        let mut specials = Vec::new();
        if here.shot.returned.events != there.shot.returned.events {
            // Orbits on both sides of a gap are of two branches.
            let Some(change) = self.change_of_events(here, &there)? else { return Ok(None) };
            specials.push(change);
        }
        let meeting = self.between(here, &there, &mut specials)?;
        Ok(Some(Next { there, is_over, specials, meeting }))
    }

    /// Finds the special points between two orbits, and where the branch meets the one that it branches off from: it turns back there on the same orbits,
    /// mirrored or shifted by half their period.
    fn between(
        &self,
        from: &Here,
        to: &Here,
        found: &mut Vec<StructureSpecial>,
    ) -> Result<Option<(Shot, BranchEnd)>, NoDerivatives> {
        let changes = |value: Test| value(&from.tests) * value(&to.tests) < 0.0;
        let is_symmetric = |shot: &Shot| self.half_apart(shot, -1.0) < SAME;
        let mut kinds: Vec<(Test, SpecialKind)> = Vec::new();
        if changes(|tests| tests.fold) {
            kinds.push((|tests| tests.fold, SpecialKind::Fold));
        } else if changes(|tests| tests.plus) {
            let kind = if is_symmetric(&from.shot) { SpecialKind::SymmetryBreaking } else { SpecialKind::BranchPoint };
            kinds.push((|tests| tests.plus, kind));
        }
        if changes(|tests| tests.minus) {
            kinds.push((|tests| tests.minus, SpecialKind::PeriodDoubling));
        }
        if from.tests.outside.abs_diff(to.tests.outside) == 2 && changes(|tests| tests.circle) {
            kinds.push((|tests| tests.circle, SpecialKind::NeimarkSacker));
        }
        for (value, kind) in kinds {
            let is_crossing = matches!(kind, SpecialKind::SymmetryBreaking | SpecialKind::BranchPoint);
            // A determinant may, where the events change.
            let may_jump = kind != SpecialKind::Fold;
            let Some((shot, error)) = self.locate((from, to), value, (is_crossing, may_jump))? else { continue };
            if kind == SpecialKind::Fold {
                let is_doubled =
                    |shot: &Shot| self.section.periods.is_multiple_of(2) && self.half_apart(shot, 1.0) < SAME;
                if is_symmetric(&shot) && !is_symmetric(&from.shot) {
                    return Ok(Some((shot, BranchEnd::SymmetryBreaking)));
                }
                if is_doubled(&shot) && !is_doubled(&from.shot) {
                    return Ok(Some((shot, BranchEnd::PeriodDoubling)));
                }
            }
            found.push(self.special(kind.clone(), kind.what().into(), &shot, error));
        }
        Ok(None)
    }

    /// The zero of a test function between two orbits, by a secant inside a bracket: the orbit, and the error of the parameter; `None` if it
    /// jumps over zero.
    fn locate(
        &self,
        (from, to): (&Here, &Here),
        value: Test,
        (is_crossing, may_jump): (bool, bool),
    ) -> Result<Option<(Shot, f64)>, NoDerivatives> {
        let nearest = if value(&from.tests).abs() < value(&to.tests).abs() { from } else { to };
        let crossing = if is_crossing { self.crossing(&nearest.shot) } else { None };
        let arc = self.inner(&from.along, &to.shot.point.minus(&from.shot.point));
        let (mut low, mut high) = ((0.0, value(&from.tests)), (arc, value(&to.tests)));
        let (mut best, mut moved, mut last_side, mut least) = (to.shot.clone(), f64::INFINITY, 0, f64::INFINITY);
        let most = low.1.abs().max(high.1.abs());
        for _ in 0..MAX_DIVISIONS {
            // Illinois: the end that stays twice counts half.
            let at = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let Some(here) = self.orbit_between(from, to, at / arc, crossing.as_ref())? else { break };
            moved = (self.value(here.shot.point.share) - self.value(best.point.share)).abs();
            let found = value(&here.tests);
            (best, least) = (here.shot, found.abs());
            let rounding = f64::EPSILON * self.value(best.point.share).abs();
            if found == 0.0 || (high.0 - low.0).abs() <= LOCATED * arc.abs() || moved <= rounding {
                break;
            }
            if found * low.1 < 0.0 {
                high = (at, found);
                low.1 *= if last_side == 1 { 0.5 } else { 1.0 };
                last_side = 1;
            } else {
                low = (at, found);
                high.1 *= if last_side == -1 { 0.5 } else { 1.0 };
                last_side = -1;
            }
        }
        let error = moved.max(10.0 * f64::EPSILON * self.value(best.point.share).abs());
        Ok((!may_jump || least <= ZERO * most).then_some((best, error)))
    }

    /// The orbit at a share of the arc between two.
    fn orbit_between(
        &self,
        from: &Here,
        to: &Here,
        share: f64,
        crossing: Option<&Crossing>,
    ) -> Result<Option<Here>, NoDerivatives> {
        let (anchor, whole) = (&from.shot.point, to.shot.point.minus(&from.shot.point));
        let arc = share * self.inner(&from.along, &whole);
        let found = self.correct_beside(anchor.plus(&whole, share), (anchor, &from.along, arc), crossing);
        let Some(shot) = unless_stopped(found)? else { return Ok(None) };
        let along = match crossing {
            Some(_) => Some(from.along.clone()),
            None => self.tangent(&shot, &from.along),
        };
        let Some(along) = along else { return Ok(None) };
        let tests = self.tests(&shot, &along);
        Ok(Some(Here { shot, along, tests }))
    }

    /// Where the events of an orbit change between two orbits, by halving; `None` if there is no orbit between some of them.
    fn change_of_events(&self, from: &Here, to: &Here) -> Result<Option<StructureSpecial>, NoDerivatives> {
        let (mut low, mut high) = (0.0, 1.0);
        let [mut before, mut after] = [from, to].map(|here| here.shot.clone());
        for _ in 0..MAX_DIVISIONS {
            let middle = 0.5 * (low + high);
            let Some(here) = self.orbit_between(from, to, middle, None)? else { break };
            if here.shot.returned.events == from.shot.returned.events {
                (low, before) = (middle, here.shot);
            } else {
                (high, after) = (middle, here.shot);
            }
            if high - low <= LOCATED {
                break;
            }
        }
        let length = |a: &Shot, b: &Shot| self.length(&a.point.minus(&b.point));
        if length(&before, &after) > GAP * length(&from.shot, &to.shot) {
            return Ok(None);
        }
        let error = 0.5 * (self.value(after.point.share) - self.value(before.point.share)).abs();
        let counts = |shot: &Shot, event: &String| shot.returned.events.get(event).copied().unwrap_or(0);
        let all = before.returned.events.keys().chain(after.returned.events.keys());
        let mut changes: Vec<String> = all
            .filter(|event| counts(&before, event) != counts(&after, event))
            .map(|event| format!("{event}: {} and {}", number(counts(&before, event)), number(counts(&after, event))))
            .collect();
        changes.sort();
        changes.dedup();
        let meaning = format!("on its two sides: {}", changes.join("; "));
        Ok(Some(self.special(SpecialKind::Grazing(Vec::new()), meaning, &before, error)))
    }

    /// The grazing that a branch ends before, at its last orbit, if there is one. Its error is how far away the grazing is: where an impact vanishes, to
    /// where the square of its speed is zero on the line through the last two `orbits`; else not a number.
    fn end_of_orbits(&self, here: &Here, orbits: &[StructureOrbit]) -> Option<StructureSpecial> {
        let speeds = &here.shot.returned.approach_speeds_m_per_s;
        let fastest = speeds.iter().copied().fold(0.0, f64::max);
        let slowest = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        let mut error = f64::NAN;
        if let [.., before, last] = orbits {
            let [earlier, later] = [before, last]
                .map(|orbit| orbit.approach_speeds_m_per_s.iter().copied().fold(f64::INFINITY, f64::min).powi(2));
            if slowest < SLOW * fastest && later < earlier {
                error = (last.parameter - before.parameter).abs() * later / (earlier - later);
            }
        }
        let meaning = if slowest < SLOW * fastest {
            "an impact loses its approach speed and vanishes"
        } else if self.grazes(here) {
            "a further event begins: a wall is just reached, or a body just stops"
        } else {
            return None;
        };
        Some(self.special(SpecialKind::Grazing(Vec::new()), meaning.into(), &here.shot, error))
    }

    /// Whether the motion a little further has other events. It is beside an orbit, so this says nothing where disturbances grow much.
    fn grazes(&self, here: &Here) -> bool {
        if here.shot.returned.multipliers().first().is_none_or(|largest| largest.norm() > MAX_GROWTH) {
            return false;
        }
        let further = here.shot.point.plus(&here.along, 1e2 * SHORTEST);
        match self.shoot(further, 0) {
            Ok(shot) => shot.returned.events != here.shot.returned.events,
            Err(why) => matches!(why, NoDerivatives::Together { .. } | NoDerivatives::UnresolvedEvent),
        }
    }

    fn special(&self, kind: SpecialKind, meaning: String, shot: &Shot, error: f64) -> StructureSpecial {
        StructureSpecial { kind, meaning, parameter_error: error, orbit: self.orbit(shot), shot: shot.clone() }
    }

    pub fn orbit(&self, shot: &Shot) -> StructureOrbit {
        StructureOrbit {
            parameter: self.value(shot.point.share),
            section: self.section,
            case: shot.case.clone(),
            multipliers: shot.returned.multipliers(),
            approach_speeds_m_per_s: shot.returned.approach_speeds_m_per_s.clone(),
            events: shot.returned.events.values().map(|count| *count as usize).sum(),
        }
    }
}

/// A number of events in words.
fn number(count: u32) -> String {
    if count < Returned::MANY { count.to_string() } else { format!("{count} or more") }
}

/// What was found; nothing where Newton's method or a motion does not lead to an orbit.
fn unless_stopped<T>(found: Result<T, NoDerivatives>) -> Result<Option<T>, NoDerivatives> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(NoDerivatives::Stopped) => Err(NoDerivatives::Stopped),
        Err(_) => Ok(None),
    }
}
