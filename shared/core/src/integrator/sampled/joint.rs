//! Spring and dashpot between structure and second mass: the soft walls of a particle, or a tuned mass.
//!
//! The joint is a type parameter of [`Sampled`]. With [`Rigid`] (the twin's choice) none of this code is compiled in.
//! [`Joined`] takes every set-up; without soft walls and tuned mass it gives the same bits as `Rigid`. The flights in which
//! the joint acts are shorter than a step where the joint is stiff, so that their polynomials stay exact. The joint costs
//! nothing while the particle is away from the walls.

use super::{Flight, LARGEST_RATE_PER_STEP, Sampled, SampledImpact, SampledObserver, SampledState};
use crate::integrator::base::BaseSegment;
use crate::integrator::modes::{self, Coefficients, Contact, Grip, Mode, Sign, sign, signed};
use crate::integrator::polynomial::{self, COEFFICIENTS, Polynomial};
use crate::integrator::units::Units;
use crate::io::{Invalid, require};
use crate::model::{Initial, Release, SetUp};
use crate::scalar::Scalar;

/// The largest (fastest rate × flight) in which a joint acts: the neglected terms of such a flight are below 0.05⁷/7! =
/// 2·10⁻¹³ of its amplitude. A contact with a stiff wall takes hundreds of flights.
const LARGEST_RATE_PER_FLIGHT: f64 = 0.5 * LARGEST_RATE_PER_STEP;

/// The shortest of these flights, steps: the start of each must differ from that of the next in every scalar.
const SHORTEST_FLIGHT: f64 = 1e-4;

/// Whether a joint connects structure and second mass.
pub trait Joint<S>: Clone + core::fmt::Debug {
    /// The joint, if there is one.
    fn link(&self) -> Option<&SampledLink<S>>;

    /// The joint, mutable.
    fn link_mut(&mut self) -> Option<&mut SampledLink<S>>;
}

/// No joint: hard walls, or no second mass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rigid;

impl<S> Joint<S> for Rigid {
    #[inline]
    fn link(&self) -> Option<&SampledLink<S>> {
        None
    }

    #[inline]
    fn link_mut(&mut self) -> Option<&mut SampledLink<S>> {
        None
    }
}

/// The sampled driver for every set-up, with the joint if it has soft walls or a tuned mass.
pub type Joined<S> = Sampled<S, Option<SampledLink<S>>>;

/// State of the contact with a soft wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallTouch {
    /// No contact: the particle is between the walls.
    Clear,
    /// The particle presses into the wall on that side.
    Pressing(Sign),
    /// The wall has released the particle, which is not yet back inside the clearance.
    Leaving(Sign),
}

/// A spring and a dashpot in parallel, in the driver's units.
#[derive(Clone, Copy, Debug)]
struct Spring<S> {
    stiffness: S,
    damping: S,
    /// y − x at which it is unloaded.
    rest: S,
    /// `None` for a tuned mass.
    release: Option<Release>,
}

/// The springs that may join structure and second mass.
#[derive(Clone, Copy, Debug)]
pub struct SampledLink<S> {
    /// The soft walls at the negative and the positive side; a tuned mass is the first.
    springs: [Option<Spring<S>>; 2],
    /// m/M.
    second_mass: S,
    /// Longest flight in which the joint acts, steps.
    longest: S,
    pub(super) touch: WallTouch,
    /// The particle has just touched the wall: its penetration starts from zero and grows by definition, regardless of
    /// rounding.
    pub(super) touched: bool,
}

impl<S: Scalar> Joint<S> for Option<SampledLink<S>> {
    #[inline]
    fn link(&self) -> Option<&SampledLink<S>> {
        self.as_ref()
    }

    #[inline]
    fn link_mut(&mut self) -> Option<&mut SampledLink<S>> {
        self.as_mut()
    }
}

impl<S: Scalar> SampledLink<S> {
    /// The joint of a validated set-up; `None` without one.
    fn new(set_up: &SetUp, c: &Coefficients<S>, units: &Units) -> Result<Option<Self>, Invalid> {
        let soft = set_up.particle.map_or([None; 2], |p| {
            p.walls().map(|wall| wall.spring_and_dashpot().map(|(k1, c1)| (p.mass_kg, k1, c1, wall.release())))
        });
        let tuned = set_up.tmd.map(|t| (t.mass_kg, t.stiffness_n_per_m, t.damping_n_s_per_m, None));
        let joints = [soft[0].or(tuned), soft[1]];
        let Some(second_kg) = joints.iter().flatten().map(|joint| joint.0).next() else { return Ok(None) };
        let structure = &set_up.structure;
        let mass_kg = structure.mass_kg;
        // In the coordinates (√M x, √m y) the matrices are symmetric; their row sums bound every rate.
        let cross = libm::sqrt(mass_kg / second_kg);
        let row = |own: f64, joint: f64| {
            (own / mass_kg + joint / mass_kg * (1.0 + cross)).max(joint / second_kg * (1.0 + 1.0 / cross))
        };
        let mut longest = 1.0;
        for (place, joint) in joints.iter().enumerate() {
            let Some((_, k1, c1, release)) = *joint else { continue };
            let half = 0.5 * row(structure.damping_n_s_per_m, c1);
            let fastest = half + libm::sqrt(half * half + row(structure.stiffness_n_per_m, k1));
            let own = LARGEST_RATE_PER_FLIGHT / (fastest * units.step_s);
            let (name, damper) = match (release, place) {
                (None, _) => ("tmd.stiffness_n_per_m", "tmd.damping_n_s_per_m"),
                (_, 0) => ("particle.wall.stiffness_n_per_m", "particle.wall.damping_n_s_per_m"),
                _ => ("particle.positive_wall.stiffness_n_per_m", "particle.positive_wall.damping_n_s_per_m"),
            };
            let (parameter, value) =
                if half * half > row(structure.stiffness_n_per_m, k1) { (damper, c1) } else { (name, k1) };
            let allowed = "low enough for the sampling rate (fastest rate × step at most 500)";
            require(own >= SHORTEST_FLIGHT, parameter, value, allowed)?;
            longest = own.min(longest);
        }
        let spring = |side: Sign| {
            joints[modes::of(side)].map(|(_, k1, c1, release)| Spring {
                stiffness: S::from_f64(k1 * (units.step_s * units.step_s) / mass_kg),
                damping: S::from_f64(c1 * units.step_s / mass_kg),
                rest: if release.is_some() { c.wall(side) } else { S::ZERO },
                release,
            })
        };
        Ok(Some(Self {
            springs: [spring(-1), spring(1)],
            second_mass: S::from_f64(second_kg / mass_kg),
            longest: S::from_f64(longest),
            touch: WallTouch::Clear,
            touched: false,
        }))
    }

    /// Whether the joint connects a tuned mass.
    pub(super) fn is_tuned(&self) -> bool {
        self.springs[0].is_some_and(|spring| spring.release.is_none())
    }

    /// Whether the wall of `side` is soft.
    pub(super) fn is_soft(&self, side: Sign) -> bool {
        self.springs[modes::of(side)].is_some_and(|spring| spring.release.is_some())
    }

    /// The spring of the tuned mass, or of the soft wall that the particle presses into.
    fn spring(&self) -> Option<&Spring<S>> {
        match self.touch {
            _ if self.is_tuned() => self.springs[0].as_ref(),
            WallTouch::Pressing(side) => self.springs[modes::of(side)].as_ref(),
            WallTouch::Clear | WallTouch::Leaving(_) => None,
        }
    }

    /// Whether the joint affects the motion in `mode`. While the particle is held, the joint force acts between parts
    /// of one body.
    pub(super) fn acts(&self, mode: Mode) -> bool {
        match mode.contact {
            Contact::Held(_) => false,
            Contact::Absent | Contact::Free(_) => self.is_tuned() || matches!(self.touch, WallTouch::Pressing(_)),
        }
    }

    /// The longest flight in `mode` within `rest`.
    pub(super) fn longest(&self, mode: Mode, rest: S) -> S {
        if self.acts(mode) { rest.min(self.longest) } else { rest }
    }

    /// The joint's force on the structure.
    pub(super) fn force(&self, offset: S, slide: S) -> S {
        self.spring().map_or(S::ZERO, |spring| spring.stiffness * (offset - spring.rest) + spring.damping * slide)
    }

    /// The joint's force on the structure along a flight, in which it acts.
    pub(super) fn force_along(&self, offset: &Polynomial<S>) -> Polynomial<S> {
        let Some(spring) = self.spring() else { return [S::ZERO; COEFFICIENTS] };
        let mut force = polynomial::derivative(offset).map(|rate| spring.damping * rate);
        for (f, w) in force.iter_mut().zip(offset) {
            *f += spring.stiffness * *w;
        }
        force[0] -= spring.stiffness * spring.rest;
        force
    }

    /// The side of the contact with a soft wall, and its force along a flight: positive pushes the particle inwards.
    pub(super) fn wall_force(&self, offset: &Polynomial<S>) -> Option<(Sign, Polynomial<S>)> {
        let WallTouch::Pressing(side) = self.touch else { return None };
        Some((side, self.force_along(offset).map(|force| signed(side, force))))
    }

    /// The side of the contact and the guard that ends it.
    pub(super) fn contact(&self, offset: &Polynomial<S>) -> Option<(Sign, Polynomial<S>)> {
        let (WallTouch::Pressing(side), Some(spring)) = (self.touch, self.spring()) else { return None };
        let mut press = offset.map(|w| signed(side, w));
        press[0] -= signed(side, spring.rest);
        if self.touched {
            press[0] = S::ZERO;
            press[1] = press[1].max(S::ZERO);
            if press[1] == S::ZERO {
                press[2] = press[2].max(S::ZERO);
            }
        }
        if spring.release == Some(Release::ZeroPenetration) {
            return Some((side, press));
        }
        let mut force = polynomial::derivative(&press).map(|rate| spring.damping * rate);
        for (f, p) in force.iter_mut().zip(&press) {
            *f += spring.stiffness * *p;
        }
        Some((side, force))
    }
}

impl<S: Scalar> Joined<S> {
    /// Any set-up in `units`, starting from `initial`; see [`Sampled::new`].
    ///
    /// # Errors
    /// Names a value that is not physical, a wall with Hertz contact, or a joint too stiff for the step.
    pub fn joined(set_up: &SetUp, units: Units, initial: &Initial) -> Result<Self, Invalid> {
        set_up.validate()?;
        set_up.validate_without_hertz()?;
        set_up.validate_initial(initial)?;
        let link = SampledLink::new(set_up, &Coefficients::in_units(set_up, &units), &units)?;
        Ok(Self::with_joint(set_up, units, initial, link))
    }

    /// The same motion of the same set-up, counted in other `units`: positions, velocities and the contact with a soft wall stay. What
    /// sticks and what slips is decided anew, because the base may move at another velocity.
    ///
    /// # Errors
    /// As [`Joined::joined`].
    pub fn counted_in(&self, set_up: &SetUp, units: Units) -> Result<Self, Invalid> {
        let mut other = Self::joined(set_up, units, &set_up.neutral())?;
        let length = S::from_f64(self.units.length_m / units.length_m);
        let velocity = S::from_f64(self.units.velocity_m_per_s() / units.velocity_m_per_s());
        let SampledState { x, v, offset, slide } = self.state;
        other.state = SampledState { x: x * length, v: v * velocity, offset: offset * length, slide: slide * velocity };
        if let Some((link, before)) = other.joint.link_mut().zip(self.joint.link()) {
            (link.touch, link.touched) = (before.touch, before.touched);
        }
        Ok(other)
    }

    /// Momentum of structure and second mass over the structure's mass.
    #[must_use]
    pub fn momentum(&self) -> S {
        self.state.v + self.second_mass() * (self.state.v + self.state.slide)
    }

    /// Mass of the particle or the tuned mass over the structure's mass; 0 without one.
    #[must_use]
    pub fn second_mass(&self) -> S {
        match &self.joint {
            Some(link) if link.is_tuned() => link.second_mass,
            _ => self.c.particle_mass,
        }
    }
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// The motion from the present state in a mode in which the joint acts.
    pub(super) fn joined_flight(&self, link: &SampledLink<S>, mode: Mode, base: &BaseSegment<S>) -> Flight<S> {
        let z = &base.0;
        let ground = self.ground(base).0;
        let mut x = [S::ZERO; COEFFICIENTS];
        let mut stretch = [S::ZERO; COEFFICIENTS];
        let mut offset = [S::ZERO; COEFFICIENTS];
        x[0] = self.state.x;
        stretch[0] = self.state.x - z[0];
        (offset[0], offset[1]) = (self.state.offset, self.state.slide);
        let (stuck, force) = match mode.grip {
            Grip::Stuck => (true, S::ZERO),
            Grip::Absent | Grip::Slip(_) => (false, self.c.drag(mode.contact) - self.c.resistance(mode.grip)),
        };
        if stuck {
            x[1..4].copy_from_slice(&ground[1..4]);
        } else {
            x[1] = self.state.v;
        }
        stretch[1] = x[1] - z[1];
        let dragged = match mode.contact {
            Contact::Free(direction) => signed(direction, self.c.friction_acceleration) + self.c.weight,
            Contact::Absent | Contact::Held(_) => S::ZERO,
        };
        let Some(spring) = link.spring() else { return Flight { x, offset, stretch } };
        let from_rest = offset[0] - spring.rest;
        for n in 0..COEFFICIENTS - 2 {
            let next = S::from_u8(n as u8 + 1);
            let w = if n == 0 { from_rest } else { offset[n] };
            let joint = spring.stiffness * w + spring.damping * next * offset[n + 1];
            let constant = |value: S| if n == 0 { value } else { S::ZERO };
            let scale = S::ONE / (next * S::from_u8(n as u8 + 2));
            if !stuck {
                let moved = if self.is_force_driven { x[n + 1] } else { stretch[n + 1] };
                let spring = self.c.damping * next * moved + self.c.stiffness * stretch[n];
                x[n + 2] = (joint - spring + constant(force)) / self.c.mass * scale;
            }
            stretch[n + 2] = x[n + 2] - if n < 2 { z[n + 2] } else { S::ZERO };
            offset[n + 2] = -(joint / link.second_mass + constant(dragged)) * scale - x[n + 2];
        }
        Flight { x, offset, stretch }
    }

    /// Handles the particle reaching a soft wall.
    pub(super) fn touch(
        &mut self,
        side: Sign,
        slip: S,
        base: &BaseSegment<S>,
        at: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let approach = signed(side, self.state.slide);
        if approach > S::ZERO {
            observer.impact(&SampledImpact { at, side, approach, kick: S::ZERO });
        }
        if approach >= S::ZERO {
            self.press(side, at, observer);
        }
        self.mode = Some(self.resolve(base, slip));
    }

    /// A particle that friction held starts to slide in `direction`. If a soft wall is there, the particle starts to
    /// press on it.
    pub(super) fn press_from_rest(
        &mut self,
        direction: Sign,
        at: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let at_wall = signed(direction, self.state.offset) >= self.c.end(direction) && self.is_soft(direction);
        if at_wall && self.joint.link().is_some_and(|link| link.touch == WallTouch::Clear) {
            self.press(direction, at, observer);
        }
    }

    fn press(&mut self, side: Sign, at: S, observer: &mut (impl SampledObserver<S> + ?Sized)) {
        if let Some(link) = self.joint.link_mut() {
            link.touch = WallTouch::Pressing(side);
            link.touched = true;
            observer.contact_start(at, side);
        }
    }

    /// Ends the contact with the soft wall of `side`.
    pub(super) fn let_go(
        &mut self,
        side: Sign,
        slip: S,
        base: &BaseSegment<S>,
        at: S,
        observer: &mut (impl SampledObserver<S> + ?Sized),
    ) {
        let wall = self.c.wall(side);
        let past = signed(side, self.state.offset) - self.c.end(side);
        if let Some(link) = self.joint.link_mut() {
            let release = link.springs[modes::of(side)].and_then(|spring| spring.release);
            if release == Some(Release::ZeroForce) && past > S::ZERO {
                link.touch = WallTouch::Leaving(side);
            } else {
                link.touch = WallTouch::Clear;
                self.state.offset = wall;
            }
        }
        observer.contact_end(at, side, self.state.slide.abs());
        self.mode = Some(self.resolve(base, slip));
    }

    /// Handles the return of the particle into the clearance after an early release.
    pub(super) fn inside(&mut self, side: Sign) {
        let wall = self.c.wall(side);
        if let Some(link) = self.joint.link_mut() {
            link.touch = WallTouch::Clear;
            self.state.offset = wall;
        }
    }

    /// The direction in which the structure starts to slip when the damper reaches its limit.
    pub(super) fn breaking_direction(&self, mode: Mode, base: &BaseSegment<S>) -> Sign {
        let mut needed = self.c.holding_force(mode.contact, self.state.x - base.0[0], self.ground(base).acceleration());
        if let Some(link) = self.joint.link().filter(|link| link.acts(mode)) {
            needed -= link.force(self.state.offset, self.state.slide);
        }
        -sign(needed)
    }
}
