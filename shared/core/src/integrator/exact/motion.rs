//! Motion of a set-up in the exact driver: state, present mode, and the quantities derived from them.
//!
//! The main loop is in [`super::driver`]; it uses the guards, the end-point proofs and the event handling, which all
//! work on this state.

use core::cell::OnceCell;

use super::excitation::{Excitation, Wave};
use super::flow::{ExactState, Flows, Leg, Path, Span};
use super::observe::{Arc, Observer};
use super::squeeze::Squeeze;
use super::time::Time;
use crate::integrator::modes::{self, Coefficients, Contact, Grip, Mode, Sign, Situation, signed};
use crate::model::Release;

/// Arcs after which the rotating pair is computed afresh from the time, so that its rounding error cannot accumulate.
pub(super) const ARCS_PER_ANCHOR: u32 = 64;

/// State of the contact with a soft wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Touch {
    /// No contact: the particle is between the walls, or there is no soft wall.
    #[default]
    Clear,
    /// The particle presses into the wall on that side.
    Pressing(Sign),
    /// The wall does not push the particle, which is not yet back inside the clearance.
    Leaving(Sign),
}

/// Roundings that may remain in a sum of five cancelling terms, each the result of a few operations.
pub(super) const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// For guards that start an arc at their limit: the number of leading coefficients that are zero by definition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fresh {
    pub gap_side: Sign,
    pub gap: usize,
    pub slide: usize,
    pub slip: usize,
    pub press: usize,
    /// Of 1 + β δ′ in a Hertz wall.
    pub lag: usize,
}

/// Counters of the computing effort of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Arcs decided by the end-point proof.
    pub arcs_proved: u64,
    /// Arcs decided by walking along their guards.
    pub arcs_walked: u64,
    /// Impacts located by Newton's method.
    pub impacts_located: u64,
    /// Evaluations of a series for those impacts.
    pub newton_steps: u64,
    /// Evaluations of a sine and cosine pair.
    pub sines: u64,
}

/// A set-up in motion under an excitation in closed form.
///
/// ```
/// use damprig_core::integrator::exact::{Exact, Excitation};
/// use damprig_core::model::{Initial, SetUp, Structure};
///
/// let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0));
/// let initial = Initial { x_m: 0.035, ..Initial::default() };
/// let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial)?;
/// motion.run(0.2, &mut ()); // half a period
/// assert!((motion.state().x_m + 0.035).abs() < 1e-15);
/// # Ok::<(), damprig_core::io::Invalid>(())
/// ```
#[derive(Clone, Debug)]
pub struct Exact {
    pub(super) c: Coefficients<f64>,
    pub(super) has_particle: bool,
    pub(super) has_tmd: bool,
    /// When the soft walls at the negative and the positive side release the particle; `None` of a hard wall.
    pub(super) soft: [Option<Release>; 2],
    /// The Hertz walls, and the contact with one of them.
    pub(super) squeeze: Squeeze,
    pub(super) flows: Flows,
    pub(super) excitation: Excitation,
    pub(super) state: ExactState,
    pub(super) wave: Wave,
    pub(super) time: Time,
    pub(super) mode: Mode,
    pub(super) touch: Touch,
    /// Penetration at which the soft wall that the particle leaves let it go, m.
    pub(super) left_past_m: f64,
    pub(super) leg: Leg,
    pub(super) fresh: Fresh,
    /// Approach speed of the fastest impact since the start, m/s.
    pub(super) fastest_m_per_s: f64,
    pub(super) next_break_s: f64,
    pub(super) started: bool,
    pub(super) arcs_since_anchor: u32,
    pub(super) events_at_once: u32,
    pub(super) unresolved: u32,
    pub(super) work: Work,
}

impl Exact {
    /// The present time, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time.seconds()
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &ExactState {
        &self.state
    }

    /// The present mode; valid after the first call of [`Exact::run`].
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The present contact with a soft wall.
    #[must_use]
    pub fn touch(&self) -> Touch {
        self.touch
    }

    /// How far the particle is beyond a soft wall that it has left and passed, m: further than where the wall let it go, and by more than the width of
    /// its cavity. With [`Release::ZeroForce`] a wall does not act again until the particle is back inside, so one that turns round before goes on.
    #[must_use]
    pub fn passed_wall_by_m(&self) -> Option<f64> {
        let Touch::Leaving(side) = self.touch else { return None };
        if !self.gives_way(side) {
            return None;
        }
        let past_m = signed(side, self.state.offset_m) - self.c.end(side);
        (past_m > self.left_past_m.max(self.c.end(1) + self.c.end(-1))).then_some(past_m)
    }

    /// Number of times that more than 64 events fell on one instant and a millionth of an arc was taken without guards.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.unresolved
    }

    /// Computing effort since [`Exact::new`].
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Present z and z′, m and m/s.
    #[must_use]
    pub fn base(&self) -> (f64, f64) {
        (self.wave.offset + self.flows.base_share * self.wave.sine, self.base_velocity())
    }

    /// The shortest full arc of this set-up, s. A stiff wall or a fast excitation shortens it and so raises the
    /// computing effort.
    #[must_use]
    pub fn shortest_arc_s(&self) -> f64 {
        [Path::Alone, Path::Together, Path::Coupled, Path::CarriedCoupled]
            .into_iter()
            .flat_map(|path| [-1, 1].map(|side| self.flows.step_s(path, side)))
            .fold(f64::INFINITY, f64::min)
    }

    /// Computes the rotating pair from the time.
    pub(super) fn anchor(&mut self) {
        self.wave = self.excitation.wave(self.time);
        self.arcs_since_anchor = 0;
        self.work.sines += 1;
    }

    pub(super) fn base_velocity(&self) -> f64 {
        self.flows.base_share * self.flows.turning * self.wave.cosine
    }

    /// x′ − z′, exactly zero when stuck, m/s.
    pub(super) fn slip(&self) -> f64 {
        match self.mode.grip {
            Grip::Stuck => 0.0,
            Grip::Absent | Grip::Slip(_) => self.state.v_m_per_s - self.base_velocity(),
        }
    }

    /// Side of the hard wall that the particle touches.
    pub(super) fn wall_side(&self) -> Sign {
        let side = self.end_of_travel();
        if self.soft(side).is_some() { 0 } else { side }
    }

    /// When the soft wall of `side` releases the particle; `None` if that wall is hard.
    #[inline]
    pub(super) fn soft(&self, side: Sign) -> Option<Release> {
        self.soft[modes::of(side)]
    }

    /// Side of the cavity whose wall, hard or soft, the particle touches or presses into; 0 between the walls.
    pub(super) fn end_of_travel(&self) -> Sign {
        if self.has_particle { self.c.side(self.state.offset_m) } else { 0 }
    }

    pub(super) fn situation(&self, slip: f64) -> Situation<f64> {
        let joint = |pressed: Sign, rest: f64| {
            if self.squeeze.law(pressed).is_some() && !self.has_tmd {
                let (depth, rate) =
                    (signed(pressed, self.state.offset_m - rest), signed(pressed, self.state.slide_m_per_s));
                return signed(pressed, self.squeeze.force_n(pressed, depth, rate));
            }
            let link = self.flows.link(pressed);
            link.stiffness * (self.state.offset_m - rest) + link.damping * self.state.slide_m_per_s
        };
        let (state, share) = (&self.state, self.flows.base_share);
        let spring_size = state.x_m.abs() + self.wave.offset.abs() + share * self.wave.sine.abs();
        let dashpot_size = state.v_m_per_s.abs() + share * self.flows.turning * self.wave.cosine.abs();
        Situation {
            stretch: self.state.x_m - (self.wave.offset + self.flows.base_share * self.wave.sine),
            slip,
            slide: self.state.slide_m_per_s,
            side: self.wall_side(),
            base_acceleration: -self.flows.base_share * self.flows.turning * self.flows.turning * self.wave.sine,
            joint_force: match self.touch {
                _ if self.has_tmd => joint(0, 0.0),
                Touch::Pressing(side) => joint(side, self.c.wall(side)),
                Touch::Clear | Touch::Leaving(_) => 0.0,
            },
            applied_force: (1.0 - self.flows.base_share) * self.wave.sine,
            rounding: ROUNDINGS * (self.c.stiffness * spring_size + self.c.damping * dashpot_size) / self.c.mass,
        }
    }

    /// Switches to the mode that follows from the state; `slip` is zero when the damper may stick.
    pub(super) fn resolve<O: Observer>(&mut self, slip: f64, observer: &mut O) {
        let before = self.mode;
        let mode = modes::resolve(&self.c, self.has_particle, &self.situation(slip));
        let released = before.contact != mode.contact && self.state.slide_m_per_s == 0.0;
        if released
            && let Contact::Free(direction) = mode.contact
            && direction != 0
        {
            self.fresh.slide = self.fresh.slide.max(1);
            let side = self.wall_side();
            if side != 0 {
                (self.fresh.gap_side, self.fresh.gap) = (side, 2);
            }
        }
        if slip == 0.0 && matches!(mode.grip, Grip::Slip(_)) {
            self.fresh.slip = self.fresh.slip.max(1);
        }
        self.set_mode(mode, observer);
    }

    pub(super) fn set_mode<O: Observer>(&mut self, mode: Mode, observer: &mut O) {
        if mode != self.mode {
            observer.mode(self.time.seconds(), mode);
        }
        self.mode = mode;
        self.set_leg();
        self.depart();
    }

    /// Derives the equations of motion from the mode.
    #[inline]
    pub(super) fn set_leg(&mut self) {
        let mode = self.mode;
        let held = matches!(mode.contact, Contact::Held(_));
        let pressed = if let Touch::Pressing(side) = self.touch { side } else { 0 };
        let joined = self.has_tmd || (pressed != 0 && !held);
        let squeezed = joined && self.squeeze.law(pressed).is_some();
        let (path, force) = match mode.grip {
            Grip::Stuck if squeezed => (Path::CarriedSqueezed, 0.0),
            Grip::Stuck if joined => (Path::CarriedCoupled, 0.0),
            Grip::Stuck => (Path::Carried, 0.0),
            Grip::Absent | Grip::Slip(_) => {
                let force =
                    self.c.drag(mode.contact) - self.c.resistance(mode.grip) + self.c.stiffness * self.wave.offset;
                (
                    if squeezed {
                        Path::Squeezed
                    } else if joined {
                        Path::Coupled
                    } else if held {
                        Path::Together
                    } else {
                        Path::Alone
                    },
                    force,
                )
            }
        };
        self.leg = Leg {
            path,
            sliding: matches!(mode.contact, Contact::Free(_)),
            structure_acceleration: force / self.c.moving_mass(mode.contact),
            particle_acceleration: match mode.contact {
                Contact::Free(direction) => -signed(direction, self.c.friction_acceleration) - self.c.weight,
                Contact::Absent | Contact::Held(_) => 0.0,
            },
            pressed,
            rest_offset: self.c.wall(pressed),
            step_s: self.flows.step_s(path, pressed),
        };
    }

    /// Reports an arc that starts at `time` to the observer, with state and wave at both ends.
    #[inline]
    pub(super) fn report<O: Observer>(
        &self,
        (start, wave): (&ExactState, &Wave),
        (end, end_wave): (&ExactState, &Wave),
        (time, length_s): (Time, f64),
        span: Option<Span>,
        observer: &mut O,
    ) {
        if O::ARCS {
            observer.arc(&Arc {
                flows: &self.flows,
                squeeze: self.squeeze.law(self.leg.pressed).map(|law| (law, &self.squeeze)),
                leg: &self.leg,
                wave: *wave,
                end_wave: *end_wave,
                span: span.map_or_else(OnceCell::new, OnceCell::from),
                start_s: time.seconds(),
                length_s,
                mode: self.mode,
                start: *start,
                end: *end,
            });
        }
    }
}
