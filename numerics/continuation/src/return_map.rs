//! The Poincaré map of a set-up under a sine, and its exact derivative.
//!
//! The motion is core's ([`Exact`]). Its derivative is the product of the transition matrices of its segments and the
//! saltations of their events, as of a followed orbit; the end is the return of the drive's phase. A sequence may be of any length,
//! and chatter may end with the particle at rest.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::{Exact, ExactState, Excitation, Observer, Touch};
use damprig_core::integrator::modes::Contact;
use damprig_core::io::Invalid;
use damprig_core::model::{Initial, SetUp};
use nalgebra::DMatrix;

use crate::dual::Real;
use crate::equations::Equations;
use crate::flow::{STATE, Vector, complete};
use crate::parameter::Ties;
use crate::passage::Passage;
use crate::sequence::{Guard, Phase};
use crate::start::Pieces;
use crate::system::System;

/// Rounding of a step of the product, relative to the sizes of its factors.
const ROUNDING: f64 = 1e-14;

/// The Poincaré map over a whole number of drive periods.
#[derive(Clone, Debug)]
pub struct ReturnMap {
    system: System,
    motion: Exact,
    phase_rad: f64,
    end_s: f64,
}

/// The derivative of the map at a state, without units: displacements per amplitude, velocities per amplitude × Ω.
#[derive(Clone, Debug)]
pub struct Variation {
    /// Derivative by x, x′, y − x and y′ − x′; of a structure alone by the first two.
    pub matrix: DMatrix<f64>,
    /// Error of the matrix by rounding, to first order, as a norm.
    pub error: f64,
    /// The smallest disturbance that removes an impact on a hard wall, to first order, relative to the amplitude: it is near zero
    /// where the motion grazes a wall, and the derivative then holds for smaller disturbances only. Infinite if none does.
    pub smallest_grazing: f64,
}

/// An event of the simulated motion was not found among the guards of its mode, or too many events fell on one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an event of the motion is not resolved")]
pub struct UnresolvedEvent;

/// A part of a motion in one mode, without units.
pub(crate) struct Leg {
    pub phase: Phase,
    pub start: [f64; STATE],
    pub duration: f64,
    pub end: LegEnd,
}

/// What ends a leg.
pub(crate) enum LegEnd {
    /// An event, after which a mode begins.
    Event(Guard, Phase),
    /// The impacts that are left of a chatter, after which the particle rests on its wall.
    Rest(Phase),
    /// The return of the drive's phase.
    Return,
}

impl LegEnd {
    pub fn event(&self) -> Option<Guard> {
        if let Self::Event(guard, _) = self { Some(*guard) } else { None }
    }
}

impl Leg {
    /// The state after the leg from the completed one before its end, as rows.
    pub fn reset<T: Real>(&self, equations: &Equations<T>, end: &Vector<T>) -> [Vector<T>; STATE] {
        match &self.end {
            LegEnd::Event(guard, after) => equations.reset(*guard, after, end),
            LegEnd::Rest(next) => equations.rest(next),
            LegEnd::Return => equations.regain(&self.phase),
        }
    }

    /// Whether it ends at a hard wall.
    pub fn hits_hard_wall(&self, system: &System) -> bool {
        matches!(self.end, LegEnd::Event(Guard::Wall(side), _) if system.is_hard(side))
    }
}

impl ReturnMap {
    /// The map over `periods` periods of a sine of the base or of a force, from the phase of that sine.
    ///
    /// # Errors
    /// Names a value that is not physical, or an excitation that is not a sine.
    pub fn new(set_up: &SetUp, excitation: &Excitation, periods: u32) -> Result<Self, Invalid> {
        let system = System::new(set_up, excitation, Ties::default())?;
        let phase_rad = match *excitation {
            Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } => phase_rad,
            _ => 0.0,
        };
        let end_s = f64::from(periods) * TAU * system.time_s;
        Ok(Self { motion: Exact::new(set_up, excitation, &set_up.neutral())?, system, phase_rad, end_s })
    }

    /// The system and its drive.
    #[must_use]
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Phase of the drive at the start, rad.
    #[must_use]
    pub fn phase_rad(&self) -> f64 {
        self.phase_rad
    }

    /// The image of a state.
    #[must_use]
    pub fn image(&self, start: &Initial) -> ExactState {
        *self.watch(start, &mut ()).state()
    }

    /// The motion from a state to its image, while `observer` sees it.
    pub fn watch(&self, start: &Initial, observer: &mut impl Observer) -> Exact {
        let mut motion = self.motion.clone();
        motion.reset(0.0, start);
        motion.run(self.end_s, observer);
        motion
    }

    /// The parts of the motion from `start` without events and without contact of the particle with a wall, longest first: when each
    /// begins and ends, s.
    ///
    /// # Errors
    /// An event that is not resolved.
    pub fn quiet_parts_s(&self, start: &Initial) -> Result<Vec<(f64, f64)>, UnresolvedEvent> {
        let pieces = self.pieces(start)?.pieces;
        let ends = pieces.iter().skip(1).map(|next| next.start_s).chain([self.end_s]);
        let mut parts: Vec<_> = pieces
            .iter()
            .zip(ends)
            .filter(|(piece, _)| piece.phase.touch == Touch::Clear)
            .filter(|(piece, _)| !matches!(piece.phase.contact, Contact::Held(side) if side != 0))
            .map(|(piece, end_s)| (piece.start_s, end_s))
            .collect();
        parts.sort_by(|a, b| (b.1 - b.0).total_cmp(&(a.1 - a.0)));
        Ok(parts)
    }

    fn pieces(&self, start: &Initial) -> Result<Pieces, UnresolvedEvent> {
        let mut seen = Pieces::new(self.system.set_up());
        let motion = self.watch(start, &mut seen);
        if motion.unresolved() > 0 { Err(UnresolvedEvent) } else { Ok(seen) }
    }

    /// The motion from `start` to its image, leg by leg.
    pub(crate) fn legs(&self, start: &Initial) -> Result<Vec<Leg>, UnresolvedEvent> {
        let seen = self.pieces(start)?;
        let (system, unit) = (&self.system, (self.system.length_m, self.system.length_m / self.system.time_s));
        let state = |state: &ExactState, at_s: f64| {
            let phase_rad = self.phase_rad + at_s / system.time_s;
            system.state(state, phase_rad, unit)
        };
        let mut legs = Vec::with_capacity(seen.pieces.len());
        for (n, piece) in seen.pieces.iter().enumerate() {
            let next = seen.pieces.get(n + 1);
            let end_s = next.map_or(self.end_s, |next| next.start_s);
            let end = match next {
                None => LegEnd::Return,
                Some(next) => {
                    let end = state(&piece.end, end_s);
                    let guard = system.event(piece, next, &end, &[]).map_err(|_| UnresolvedEvent)?;
                    let after = next.after_chatter.as_ref().map_or(next.phase, |(flying, _)| *flying);
                    LegEnd::Event(guard, after)
                }
            };
            legs.push(Leg {
                phase: piece.phase,
                start: state(&piece.start, piece.start_s),
                duration: (end_s - piece.start_s) / system.time_s,
                end,
            });
            if let Some((next, (flying, before))) = next.and_then(|next| Some((next, next.after_chatter.as_ref()?))) {
                let start = state(before, end_s);
                legs.push(Leg { phase: *flying, start, duration: 0.0, end: LegEnd::Rest(next.phase) });
            }
        }
        if legs.is_empty() { Err(UnresolvedEvent) } else { Ok(legs) }
    }

    /// The derivative of the map.
    ///
    /// # Errors
    /// An event that is not resolved.
    pub fn variation(&self, start: &Initial) -> Result<Variation, UnresolvedEvent> {
        let legs = self.legs(start)?;
        let system = &self.system;
        let equations = system.equations::<f64>(&[]);
        let turn = equations.guard(&legs[0].phase, Guard::Turn(0));
        let mut hits = Vec::new();
        let passages: Vec<Passage> = legs
            .iter()
            .enumerate()
            .map(|(n, leg)| {
                let a = equations.matrix(&leg.phase);
                let from = complete(&leg.start);
                if leg.hits_hard_wall(system) {
                    hits.push(n);
                }
                let guard = leg.end.event().map_or(turn, |event| equations.guard(&leg.phase, event));
                Passage::new(&a, &from, leg.duration, &guard, |end| leg.reset(&equations, end))
            })
            .collect();
        let regain = equations.regain(&legs[0].phase);
        Ok(self.product(DMatrix::from_fn(STATE, system.size(), |row, k| regain[row][k]), &passages, &hits))
    }

    /// The product of the passages, and its rounding: a rounding of one is magnified by those before and after it.
    fn product(&self, start: DMatrix<f64>, passages: &[Passage], hits: &[usize]) -> Variation {
        let mut roundings = Vec::with_capacity(passages.len());
        let mut smallest_grazing = f64::INFINITY;
        let mut product = start;
        for (n, passage) in passages.iter().enumerate() {
            let shift = (&passage.delay * &product).norm();
            // An impact that happens while the gap curves away from the wall does not when the wall is too far off by
            // speed²/(2 bend).
            if hits.contains(&n) && passage.bend > 0.0 {
                let least = passage.speed.abs() / (2.0 * passage.bend * shift);
                smallest_grazing = smallest_grazing.min(if least.is_nan() { 0.0 } else { least });
            }
            // The speed of the guard has a rounding of the motion.
            let shifted = passage.rate * shift * passage.size / passage.speed.abs();
            roundings.push(ROUNDING * (passage.matrix.norm() * product.norm() + shifted));
            product = &passage.matrix * product;
        }
        let mut after = DMatrix::identity(STATE, STATE);
        let mut error = 0.0;
        for (passage, rounding) in passages.iter().zip(&roundings).rev() {
            error += after.norm() * rounding;
            after *= &passage.matrix;
        }
        let size = self.system.size();
        Variation { matrix: product.rows(0, size).into_owned(), error, smallest_grazing }
    }
}
