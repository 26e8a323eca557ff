//! Spring and dashpot between structure and second mass: the soft walls of a particle, or a tuned mass.
//!
//! The joint is a type parameter of [`Sampled`]. With [`Rigid`] (the twin's choice) none of this code is compiled in.
//! [`Joined`] takes every set-up; without soft walls and tuned mass it gives the same bits as `Rigid`. The flights in which
//! the joint acts are shorter than a step where the joint is stiff, so that their polynomials stay exact. The joint costs
//! nothing while the particle is away from the walls.

use super::{Flight, Impact, LARGEST_RATE_PER_STEP, Observer, Sampled, SampledState};
use crate::integrator::base::BaseSegment;
use crate::integrator::modes::{Coefficients, Contact, Grip, Mode, Sign, sign, signed};
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
    fn link(&self) -> Option<&Link<S>>;

    /// The joint, mutable.
    fn link_mut(&mut self) -> Option<&mut Link<S>>;
}

/// No joint: hard walls, or no second mass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rigid;

impl<S> Joint<S> for Rigid {
    #[inline]
    fn link(&self) -> Option<&Link<S>> {
        None
    }

    #[inline]
    fn link_mut(&mut self) -> Option<&mut Link<S>> {
        None
    }
}

/// The sampled driver for every set-up, with the joint if it has soft walls or a tuned mass.
pub type Joined<S> = Sampled<S, Option<Link<S>>>;

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
pub struct Link<S> {
    stiffness: S,
    damping: S,
    /// m/M.
    second_mass: S,
    clearance: S,
    /// Longest flight in which the joint acts, steps.
    longest: S,
    /// `None` for a tuned mass.
    release: Option<Release>,
    pub(super) touch: WallTouch,
    /// The particle has just touched the wall: its penetration starts from zero and grows by definition, regardless of
    /// rounding.
    pub(super) touched: bool,
}

impl<S: Scalar> Joint<S> for Option<Link<S>> {
    #[inline]
    fn link(&self) -> Option<&Link<S>> {
        self.as_ref()
    }

    #[inline]
    fn link_mut(&mut self) -> Option<&mut Link<S>> {
        self.as_mut()
    }
}

impl<S: Scalar> Link<S> {
    /// The joint of a validated set-up; `None` without one.
    fn new(set_up: &SetUp, c: &Coefficients<S>, units: &Units) -> Result<Option<Self>, Invalid> {
        let soft = set_up.particle.and_then(|p| {
            let (stiffness, damping) = p.wall.spring_and_dashpot()?;
            Some((p.mass_kg, stiffness, damping, p.wall.release()))
        });
        let tuned = set_up.tmd.map(|t| (t.mass_kg, t.stiffness_n_per_m, t.damping_n_s_per_m, None));
        let Some((second_kg, k1, c1, release)) = soft.or(tuned) else { return Ok(None) };
        let structure = &set_up.structure;
        let mass_kg = structure.mass_kg;
        // In the coordinates (√M x, √m y) the matrices are symmetric; their row sums bound every rate.
        let cross = libm::sqrt(mass_kg / second_kg);
        let row = |own: f64, joint: f64| {
            (own / mass_kg + joint / mass_kg * (1.0 + cross)).max(joint / second_kg * (1.0 + 1.0 / cross))
        };
        let half = 0.5 * row(structure.damping_n_s_per_m, c1);
        let fastest = half + libm::sqrt(half * half + row(structure.stiffness_n_per_m, k1));
        let longest = LARGEST_RATE_PER_FLIGHT / (fastest * units.step_s);
        let (name, damper) = match release {
            Some(_) => ("particle.wall.stiffness_n_per_m", "particle.wall.damping_n_s_per_m"),
            None => ("tmd.stiffness_n_per_m", "tmd.damping_n_s_per_m"),
        };
        let (parameter, value) =
            if half * half > row(structure.stiffness_n_per_m, k1) { (damper, c1) } else { (name, k1) };
        let allowed = "low enough for the sampling rate (fastest rate × step at most 500)";
        require(longest >= SHORTEST_FLIGHT, parameter, value, allowed)?;
        Ok(Some(Self {
            stiffness: S::from_f64(k1 * (units.step_s * units.step_s) / mass_kg),
            damping: S::from_f64(c1 * units.step_s / mass_kg),
            second_mass: S::from_f64(second_kg / mass_kg),
            clearance: c.clearance,
            longest: S::from_f64(longest.min(1.0)),
            release,
            touch: WallTouch::Clear,
            touched: false,
        }))
    }

    /// Whether the joint connects a tuned mass.
    pub(super) fn is_tuned(&self) -> bool {
        self.release.is_none()
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

    /// The offset at which the joint is unloaded.
    fn rest_offset(&self) -> S {
        match self.touch {
            WallTouch::Pressing(side) => signed(side, self.clearance),
            WallTouch::Clear | WallTouch::Leaving(_) => S::ZERO,
        }
    }

    /// The joint's force on the structure.
    pub(super) fn force(&self, offset: S, slide: S) -> S {
        if self.is_tuned() || matches!(self.touch, WallTouch::Pressing(_)) {
            self.stiffness * (offset - self.rest_offset()) + self.damping * slide
        } else {
            S::ZERO
        }
    }

    /// The joint's force on the structure along a flight.
    pub(super) fn force_along(&self, offset: &Polynomial<S>) -> Polynomial<S> {
        let mut force = polynomial::derivative(offset).map(|rate| self.damping * rate);
        for (f, w) in force.iter_mut().zip(offset) {
            *f += self.stiffness * *w;
        }
        force[0] -= self.stiffness * self.rest_offset();
        force
    }

    /// The side of the contact with a soft wall, and its force along a flight: positive pushes the particle inwards.
    pub(super) fn wall_force(&self, offset: &Polynomial<S>) -> Option<(Sign, Polynomial<S>)> {
        let WallTouch::Pressing(side) = self.touch else { return None };
        Some((side, self.force_along(offset).map(|force| signed(side, force))))
    }

    /// The side of the contact and the guard that ends it.
    pub(super) fn contact(&self, offset: &Polynomial<S>) -> Option<(Sign, Polynomial<S>)> {
        let WallTouch::Pressing(side) = self.touch else { return None };
        let mut press = offset.map(|w| signed(side, w));
        press[0] -= self.clearance;
        if self.touched {
            press[0] = S::ZERO;
            press[1] = press[1].max(S::ZERO);
            if press[1] == S::ZERO {
                press[2] = press[2].max(S::ZERO);
            }
        }
        if self.release == Some(Release::ZeroPenetration) {
            return Some((side, press));
        }
        let mut force = polynomial::derivative(&press).map(|rate| self.damping * rate);
        for (f, p) in force.iter_mut().zip(&press) {
            *f += self.stiffness * *p;
        }
        Some((side, force))
    }
}

impl<S: Scalar> Joined<S> {
    /// Any set-up in `units`, starting from `initial`; see [`Sampled::new`].
    ///
    /// # Errors
    /// Names a value that is not physical, or a joint too stiff for the step.
    pub fn joined(set_up: &SetUp, units: Units, initial: &Initial) -> Result<Self, Invalid> {
        set_up.validate()?;
        set_up.validate_initial(initial)?;
        let link = Link::new(set_up, &Coefficients::in_units(set_up, &units), &units)?;
        Ok(Self::with_joint(set_up, units, initial, link))
    }

    /// The same motion of the same set-up, counted in other `units`: positions, velocities and the contact with a soft wall stay. What
    /// sticks and what slips is decided anew, because the base may move at another velocity.
    ///
    /// # Errors
    /// As [`Joined::joined`].
    pub fn counted_in(&self, set_up: &SetUp, units: Units) -> Result<Self, Invalid> {
        let mut other = Self::joined(set_up, units, &Initial::default())?;
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
    pub(super) fn joined_flight(&self, link: &Link<S>, mode: Mode, base: &BaseSegment<S>) -> Flight<S> {
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
            Contact::Free(direction) => signed(direction, self.c.friction_acceleration),
            Contact::Absent | Contact::Held(_) => S::ZERO,
        };
        let from_rest = offset[0] - link.rest_offset();
        for n in 0..COEFFICIENTS - 2 {
            let next = S::from_u8(n as u8 + 1);
            let w = if n == 0 { from_rest } else { offset[n] };
            let joint = link.stiffness * w + link.damping * next * offset[n + 1];
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
        observer: &mut (impl Observer<S> + ?Sized),
    ) {
        let approach = signed(side, self.state.slide);
        if approach > S::ZERO {
            observer.impact(&Impact { at, side, approach, kick: S::ZERO });
        }
        if approach >= S::ZERO {
            self.press(side, at, observer);
        }
        self.mode = Some(self.resolve(base, slip));
    }

    /// A particle that friction held starts to slide in `direction`. If a soft wall is there, the particle starts to
    /// press on it.
    pub(super) fn press_from_rest(&mut self, direction: Sign, at: S, observer: &mut (impl Observer<S> + ?Sized)) {
        let at_wall = signed(direction, self.state.offset) >= self.c.clearance;
        if at_wall && self.joint.link().is_some_and(|link| link.touch == WallTouch::Clear) {
            self.press(direction, at, observer);
        }
    }

    fn press(&mut self, side: Sign, at: S, observer: &mut (impl Observer<S> + ?Sized)) {
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
        observer: &mut (impl Observer<S> + ?Sized),
    ) {
        let past = signed(side, self.state.offset) - self.c.clearance;
        if let Some(link) = self.joint.link_mut() {
            if link.release == Some(Release::ZeroForce) && past > S::ZERO {
                link.touch = WallTouch::Leaving(side);
            } else {
                link.touch = WallTouch::Clear;
                self.state.offset = signed(side, self.c.clearance);
            }
        }
        observer.contact_end(at, side, self.state.slide.abs());
        self.mode = Some(self.resolve(base, slip));
    }

    /// Handles the return of the particle into the clearance after an early release.
    pub(super) fn inside(&mut self, side: Sign) {
        if let Some(link) = self.joint.link_mut() {
            link.touch = WallTouch::Clear;
            self.state.offset = signed(side, self.c.clearance);
        }
    }

    /// Whether the particle presses into a soft wall.
    #[must_use]
    pub fn is_pressing(&self) -> bool {
        self.joint.link().is_some_and(|link| matches!(link.touch, WallTouch::Pressing(_)))
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
