//! The first orbit of a branch, from a simulation: the sequence of its events and its states at them.

use std::f64::consts::TAU;

use damprig_core::analysis::section::{Section, period};
use damprig_core::integrator::exact::{Accumulation, Arc, Exact, ExactState, Excitation, Impact, Observer, Touch};
use damprig_core::integrator::modes::{Contact, Grip, Mode, Sign};
use damprig_core::io::Invalid;
use damprig_core::model::{Initial, SetUp};

use crate::boundary_problem::UNKNOWNS;
use crate::flow::{STATE, complete, dot};
use crate::parameter::Parameter;
use crate::sequence::{Guard, Phase, Segment, Sequence};
use crate::system::System;

/// Why a simulation gives no orbit to start from.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoStart {
    /// The set-up is not physical.
    #[error("{0}")]
    Invalid(Invalid),
    /// The motion does not repeat.
    #[error("the motion does not repeat within {periods} drive periods: it is chaotic, or settles too slowly")]
    NoRepetition {
        /// Drive periods that were simulated.
        periods: u64,
    },
    /// Impacts accumulate: an orbit with infinitely many events cannot be followed.
    #[error("the particle comes to rest on a wall after infinitely many impacts (chatter), which cannot be followed")]
    Chatter,
    /// The orbit has too many events.
    #[error("the orbit has {count} events; at most {most} can be followed")]
    TooManyEvents {
        /// Its events.
        count: usize,
        /// The most that are followed.
        most: usize,
    },
    /// A body moves without events, so its place is arbitrary.
    #[error(
        "the particle never meets a wall, or the structure always sticks: its place is arbitrary and the orbit not isolated"
    )]
    NotIsolated,
    /// Newton's method does not reach an orbit from the simulated motion.
    #[error("Newton's method finds no orbit near the simulated motion, or one with other events")]
    NoConvergence,
}

/// The motion to start from.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    pub sequence: Sequence,
    pub unknowns: Vec<f64>,
}

/// Most events of an orbit.
const MAX_EVENTS: usize = 60;

/// Most drive periods of an orbit.
const MAX_PERIODS: usize = 16;

/// States compared.
const COMPARED: usize = 2 * MAX_PERIODS;

/// Periods between two comparisons.
const BLOCK: u64 = 100;

/// Two states are equal within this fraction of the motion; Newton's method then gives the rest.
const EQUAL: f64 = 1e-9;

/// The same after the last block, for motions that settle slowly.
const NEARLY_EQUAL: f64 = 1e-5;

/// Place of the section after the start, in drive periods.
const SECTION: f64 = 0.37;

/// An offset within the clearance, but for rounding.
const INSIDE: f64 = 1.0 + 1e-9;

/// A piece of motion in one mode.
pub(crate) struct Piece {
    pub start_s: f64,
    pub start: ExactState,
    pub end: ExactState,
    pub phase: Phase,
    /// The impact that begins it.
    after_impact: Option<Sign>,
    /// The chatter that begins it, just after that impact: mode and state before the remaining impacts are summed.
    pub after_chatter: Option<(Phase, ExactState)>,
}

/// Joins the arcs of a motion into pieces.
pub(crate) struct Pieces {
    pub pieces: Vec<Piece>,
    /// y − x at the walls, m.
    ends_m: [f64; 2],
    has_friction: bool,
    is_soft: [bool; 2],
    mode: Option<Mode>,
    impact: Option<Sign>,
    chatter: Option<(Phase, ExactState)>,
}

impl Pieces {
    /// Of a motion of this set-up.
    pub fn new(set_up: &SetUp) -> Self {
        let particle = set_up.particle;
        Self {
            pieces: Vec::new(),
            ends_m: particle.map_or([0.0; 2], |p| p.ends_m()),
            has_friction: set_up.internal_friction_m_per_s2() > 0.0,
            is_soft: particle.map_or([false; 2], |p| p.walls().map(|wall| wall.is_soft())),
            mode: None,
            impact: None,
            chatter: None,
        }
    }

    /// Whether y − x is between the walls, but for rounding.
    fn is_inside(&self, offset_m: f64) -> bool {
        let [low, high] = self.ends_m;
        (offset_m - 0.5 * (low + high)).abs() <= 0.5 * (high - low) * INSIDE
    }

    fn phase(&self, mode: Mode, touch: Touch) -> Phase {
        let contact = match mode.contact {
            Contact::Free(_) if !self.has_friction => Contact::Free(0),
            contact => contact,
        };
        Phase { grip: mode.grip, contact, touch }
    }

    fn touch(&self, arc: &Arc<'_>) -> Touch {
        let middle = arc.state(0.5 * arc.length_s).offset_m;
        let [low, high] = self.ends_m;
        if arc.pressed_side() != 0 {
            Touch::Pressing(arc.pressed_side())
        } else if self.is_soft[0] && middle < low {
            Touch::Leaving(-1)
        } else if self.is_soft[1] && middle > high {
            Touch::Leaving(1)
        } else {
            Touch::Clear
        }
    }
}

impl Observer for Pieces {
    fn arc(&mut self, arc: &Arc<'_>) {
        let phase = self.phase(arc.mode, self.touch(arc));
        let impact = self.impact.take();
        match self.pieces.last_mut() {
            Some(last) if last.phase == phase && impact.is_none() => last.end = arc.end,
            _ => self.pieces.push(Piece {
                start_s: arc.start_s,
                start: arc.start,
                end: arc.end,
                phase,
                after_impact: impact,
                after_chatter: self.chatter.take(),
            }),
        }
    }

    fn impact(&mut self, impact: &Impact) {
        if !self.is_soft[usize::from(impact.side > 0)] {
            self.impact = Some(impact.side);
        }
    }

    fn mode(&mut self, _: f64, mode: Mode) {
        self.mode = Some(mode);
    }

    fn accumulation(&mut self, chatter: &Accumulation) {
        self.chatter = self.mode.map(|mode| (self.phase(mode, Touch::Clear), chatter.before));
    }
}

impl System {
    /// Runs the system until its motion repeats.
    pub(crate) fn settle(
        &self,
        settings: &[(Parameter, f64)],
        initial: &Initial,
        phase_rad: f64,
        most_periods: u64,
    ) -> Result<Start, NoStart> {
        let (set_up, mut excitation) = self.at(settings);
        let turning = excitation.angular_frequency_rad_per_s();
        if let Excitation::Sine { phase_rad: phase, .. } | Excitation::ForceSine { phase_rad: phase, .. } =
            &mut excitation
        {
            *phase = phase_rad;
        }
        let period_s = TAU / turning;
        let mut motion = Exact::new(&set_up, &excitation, initial).map_err(NoStart::Invalid)?;
        // A start at an event must not put the section on one.
        motion.run(SECTION * period_s, &mut ());
        let mut section = Section::new(motion, period_s);
        let mut taken = 0;
        let periods = loop {
            section.skip(BLOCK);
            let states: Vec<ExactState> = (0..COMPARED).map(|_| section.next(&mut ())).collect();
            taken += BLOCK + COMPARED as u64;
            let is_last = taken >= most_periods;
            if let Some(periods) = period(&states, if is_last { NEARLY_EQUAL } else { EQUAL }) {
                break periods;
            }
            if is_last {
                return Err(NoStart::NoRepetition { periods: taken });
            }
        };
        self.read(section.into_motion(), settings, (&set_up, turning, phase_rad), periods)
    }

    /// Reads the sequence of a motion that repeats after `periods`.
    fn read(
        &self,
        mut motion: Exact,
        settings: &[(Parameter, f64)],
        (set_up, turning, phase_rad): (&SetUp, f64, f64),
        periods: usize,
    ) -> Result<Start, NoStart> {
        let orbit_s = periods as f64 * TAU / turning;
        let mut seen = Pieces::new(set_up);
        let from_s = motion.time_s();
        motion.run(from_s + 3.25 * orbit_s, &mut seen);
        if seen.pieces.iter().any(|piece| piece.after_chatter.is_some()) {
            return Err(NoStart::Chatter);
        }
        let periods = periods as u32;
        let pieces = &seen.pieces;
        if pieces.len() < 2 {
            return self.without_events(pieces, (turning, phase_rad), periods);
        }
        // From a piece whose start is an event inside the cavity, where a run may start, to its repetition.
        let is_inside = |piece: &Piece| {
            !matches!(piece.phase.touch, Touch::Leaving(_)) && (seen.is_inside(piece.start.offset_m) || self.has_tmd)
        };
        let from = (1..pieces.len()).find(|n| is_inside(&pieces[*n])).ok_or(NoStart::NoConvergence)?;
        let first = &pieces[from];
        let repeated = (from + 1..pieces.len()).min_by(|a, b| {
            let off = |n: usize| (pieces[n].start_s - first.start_s - orbit_s).abs();
            off(*a).total_cmp(&off(*b))
        });
        let Some(last) = repeated.filter(|n| (pieces[*n].start_s - first.start_s - orbit_s).abs() < 1e-3 * orbit_s)
        else {
            return Err(NoStart::NoConvergence);
        };
        let count = last - from;
        if count > MAX_EVENTS {
            return Err(NoStart::TooManyEvents { count, most: MAX_EVENTS });
        }
        let unit = (self.length_m, self.length_m / self.time_s);
        let start_s = first.start_s;
        let turns = (turning * start_s + phase_rad).div_euclid(TAU) * TAU;
        let mut segments = Vec::with_capacity(count);
        let mut unknowns = Vec::with_capacity(UNKNOWNS * count);
        for n in from..last {
            let (piece, next) = (&pieces[n], &pieces[n + 1]);
            let phase = turning * piece.start_s + phase_rad - turns;
            let state = self.state(&piece.start, phase, unit);
            let end_phase = turning * next.start_s + phase_rad - turns;
            let end = self.state(&piece.end, end_phase, unit);
            segments.push(Segment { phase: piece.phase, end: self.event(piece, next, &end, settings)? });
            unknowns.extend(state);
            unknowns.push((next.start_s - piece.start_s) / self.time_s);
        }
        // Friction alone does not determine the particle's place.
        let meets_wall = |s: &Segment| matches!(s.end, Guard::Wall(_) | Guard::LetGo(_) | Guard::Inside(_));
        if self.has_particle && !segments.iter().any(meets_wall) {
            return Err(NoStart::NotIsolated);
        }
        Ok(Start { sequence: Sequence { segments, periods }, unknowns })
    }

    fn without_events(
        &self,
        pieces: &[Piece],
        (turning, phase_rad): (f64, f64),
        periods: u32,
    ) -> Result<Start, NoStart> {
        let piece = pieces.first().ok_or(NoStart::NoConvergence)?;
        if self.has_particle || piece.phase.grip == Grip::Stuck {
            return Err(NoStart::NotIsolated);
        }
        let unit = (self.length_m, self.length_m / self.time_s);
        let mut state = self.state(&piece.start, turning * piece.start_s + phase_rad, unit);
        state[4] = 0.0;
        let mut unknowns = state.to_vec();
        unknowns.push(f64::from(periods) * TAU / (turning * self.time_s));
        let segments = vec![Segment { phase: piece.phase, end: Guard::Turn(periods) }];
        Ok(Start { sequence: Sequence { segments, periods }, unknowns })
    }

    pub(crate) fn state(&self, state: &ExactState, phase: f64, (length, speed): (f64, f64)) -> [f64; STATE] {
        let joined = f64::from(u8::from(self.has_particle || self.has_tmd));
        [
            state.x_m / length,
            state.v_m_per_s / speed,
            joined * (state.offset_m - self.middle_m()) / length,
            joined * state.slide_m_per_s / speed,
            phase,
        ]
    }

    /// The event between two pieces: of the guards that explain the change, the one nearest to zero.
    pub(crate) fn event(
        &self,
        piece: &Piece,
        next: &Piece,
        end: &[f64; STATE],
        settings: &[(Parameter, f64)],
    ) -> Result<Guard, NoStart> {
        if let Some(side) = next.after_impact {
            return Ok(Guard::Wall(side));
        }
        let equations = self.equations::<f64>(settings);
        let end = complete(end);
        let (before, after) = (&piece.phase, &next.phase);
        let explains = |guard: &Guard| match *guard {
            Guard::Wall(side) => before.touch != after.touch && after.touch == Touch::Pressing(side),
            Guard::LetGo(side) => before.touch == Touch::Pressing(side) && after.touch != before.touch,
            Guard::Inside(side) => before.touch == Touch::Leaving(side) && after.touch != before.touch,
            Guard::SlideStops(_) => before.contact != after.contact,
            // Without friction the direction of a free particle is 0.
            Guard::HoldBreaks(direction) => [Contact::Free(direction), Contact::Free(0)].contains(&after.contact),
            Guard::SlipStops(_) => before.grip != after.grip,
            Guard::GripBreaks(direction) => after.grip == Grip::Slip(direction),
            Guard::Turn(_) => false,
        };
        let size = |guard: &Guard| {
            let row = equations.guard(before, *guard);
            let terms: f64 = row.iter().zip(&end).map(|(r, w)| (r * w).abs()).sum();
            dot(&row, &end).abs() / terms.max(f64::MIN_POSITIVE)
        };
        before
            .guards()
            .into_iter()
            .filter(explains)
            .min_by(|a, b| size(a).total_cmp(&size(b)))
            .ok_or(NoStart::NoConvergence)
    }
}
