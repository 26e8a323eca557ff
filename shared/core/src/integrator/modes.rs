//! Mode machine: decides which set-valued forces stick, slip or press for a given state.
//!
//! Coulomb friction and wall forces are not functions of the state alone: while two bodies stick, the force is whatever
//! keeps them together, up to a limit. The motion is therefore a sequence of modes and linear within each. This module
//! contains what every driver needs: [`resolve`], the mode that is consistent with a state, and [`impact`], the law of
//! the hard wall. The drivers find the times of the events.
//!
//! Equations of motion (z is the base displacement; absolute coordinates):
//! `M x″ + c (x′ − z′) + k (x − z) = f_damper + f_particle`, and `m y″ = −f_particle − m w`, where w is the share of g along
//! the motion. x is measured from where the structure rests without the particle.

use super::units::Units;
use crate::model::{ImpactLaw, SetUp};
use crate::scalar::Scalar;

/// +1, 0 or −1: a direction, or a side of the cavity.
pub type Sign = i8;

/// State of the friction damper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// There is no friction damper, or its force is zero: there is no sticking and no slip event.
    Absent,
    /// The structure slips on the damper in the direction of the sign, +1 or −1: the force is −sign·F.
    Slip(Sign),
    /// The structure sticks to the base and moves with it.
    Stuck,
}

/// State of the particle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// There is no particle.
    Absent,
    /// The particle flies between the walls; the sign is that of y′ − x′ for internal friction.
    Free(Sign),
    /// The particle moves with the structure: held by internal friction (side 0), or resting on the wall of that side.
    Held(Sign),
}

/// The mode of the whole system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// State of structure against base.
    pub grip: Grip,
    /// State of particle against structure.
    pub contact: Contact,
}

/// The parameters of a set-up in the scalar of the calculation, as the equations of motion use them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients<S> {
    /// M, kg.
    pub mass: S,
    /// c, N·s/m.
    pub damping: S,
    /// k, N/m.
    pub stiffness: S,
    /// F of the friction damper, N; 0 without one.
    pub damper_force: S,
    /// m, kg; 0 without a particle.
    pub particle_mass: S,
    /// Distances of the walls at the negative and the positive side from y = x, m; 0 without a particle.
    ends: [S; 2],
    /// The larger of their magnitudes, m: y − x has a rounding of it.
    pub reach: S,
    /// The laws of impact of the hard walls.
    restitution: [ImpactLaw<S>; 2],
    /// μi·g times the cosine of the inclination, m/s²: the largest acceleration of the particle by internal friction.
    pub friction_acceleration: S,
    /// g times the sine of the inclination, m/s²: the acceleration of a free particle by its weight, along −y.
    pub weight: S,
}

impl<S: Scalar> Coefficients<S> {
    /// Computes the coefficients of a validated set-up. These equations do not include a soft wall or a tuned mass.
    #[must_use]
    pub fn new(set_up: &SetUp) -> Self {
        let particle = set_up.particle;
        let ends = ends_m(set_up).map(S::from_f64);
        Self {
            mass: S::from_f64(set_up.structure.mass_kg),
            damping: S::from_f64(set_up.structure.damping_n_s_per_m),
            stiffness: S::from_f64(set_up.structure.stiffness_n_per_m),
            damper_force: S::from_f64(set_up.friction_damper.map_or(0.0, |d| d.force_n)),
            particle_mass: S::from_f64(particle.map_or(0.0, |p| p.mass_kg)),
            ends,
            reach: ends[0].abs().max(ends[1].abs()),
            restitution: impact_laws(set_up, 1.0),
            friction_acceleration: S::from_f64(set_up.internal_friction_m_per_s2()),
            weight: S::from_f64(set_up.weight_m_per_s2()),
        }
    }

    /// The same system in other units: time and length as given, force per structure mass. Then M = 1, and every
    /// function of this module holds unchanged.
    #[must_use]
    pub fn in_units(set_up: &SetUp, units: &Units) -> Self {
        let structure = &set_up.structure;
        let (mass, step_s, length_m) = (structure.mass_kg, units.step_s, units.length_m);
        let acceleration = length_m / (step_s * step_s);
        let particle = set_up.particle;
        let ends = ends_m(set_up).map(|end_m| S::from_f64(end_m / length_m));
        Self {
            mass: S::ONE,
            damping: S::from_f64(structure.damping_n_s_per_m * step_s / mass),
            stiffness: S::from_f64(structure.stiffness_n_per_m * (step_s * step_s) / mass),
            damper_force: S::from_f64(set_up.friction_damper.map_or(0.0, |d| d.force_n) / mass / acceleration),
            particle_mass: S::from_f64(particle.map_or(0.0, |p| p.mass_kg) / mass),
            ends,
            reach: ends[0].abs().max(ends[1].abs()),
            restitution: impact_laws(set_up, length_m / step_s),
            friction_acceleration: S::from_f64(set_up.internal_friction_m_per_s2() / acceleration),
            weight: S::from_f64(set_up.weight_m_per_s2() / acceleration),
        }
    }

    /// Distance of the wall of `side` from y = x, towards that side, m.
    #[inline]
    #[must_use]
    pub fn end(&self, side: Sign) -> S {
        self.ends[of(side)]
    }

    /// y − x at the wall of `side`, m; 0 without a side.
    #[inline]
    #[must_use]
    pub fn wall(&self, side: Sign) -> S {
        signed(side, self.end(side))
    }

    /// Distance of the particle from the wall of `side`, m: negative beyond it.
    #[inline]
    #[must_use]
    pub fn gap(&self, side: Sign, offset: S) -> S {
        self.end(side) - signed(side, offset)
    }

    /// Side of the wall that the particle touches or has passed; 0 between the walls.
    #[inline]
    #[must_use]
    pub fn side(&self, offset: S) -> Sign {
        if offset >= self.wall(1) {
            1
        } else if offset <= self.wall(-1) {
            -1
        } else {
            0
        }
    }

    /// y − x in the middle of the cavity, m.
    #[must_use]
    pub fn middle(&self) -> S {
        (self.end(1) - self.end(-1)) * S::from_f64(0.5)
    }

    /// The law of impact of the hard wall of `side`.
    #[inline]
    #[must_use]
    pub fn restitution(&self, side: Sign) -> &ImpactLaw<S> {
        &self.restitution[of(side)]
    }

    /// Mass that moves with the structure in `contact`, kg.
    #[must_use]
    pub fn moving_mass(&self, contact: Contact) -> S {
        match contact {
            Contact::Held(_) => self.mass + self.particle_mass,
            Contact::Absent | Contact::Free(_) => self.mass,
        }
    }

    /// Constant force of the particle on what moves with the structure in `contact`, N: friction of a sliding particle, weight
    /// of a held one.
    #[must_use]
    pub fn drag(&self, contact: Contact) -> S {
        match contact {
            Contact::Free(direction) => signed(direction, self.particle_mass * self.friction_acceleration),
            Contact::Held(_) => S::ZERO - self.particle_mass * self.weight,
            Contact::Absent => S::ZERO,
        }
    }

    /// State of the friction damper at the slip velocity `slip` (x′ − z′, m/s), before the forces are known: at a slip
    /// of exactly zero it may stick.
    #[must_use]
    pub fn grip_at(&self, slip: S) -> Grip {
        if self.damper_force == S::ZERO {
            Grip::Absent
        } else if slip == S::ZERO {
            Grip::Stuck
        } else {
            Grip::Slip(sign(slip))
        }
    }

    /// Force of a slipping damper, N: positive against a slip along +x. The force of a sticking damper follows from the
    /// motion ([`Coefficients::holding_force`]).
    #[must_use]
    pub fn resistance(&self, grip: Grip) -> S {
        match grip {
            Grip::Slip(direction) => signed(direction, self.damper_force),
            Grip::Absent | Grip::Stuck => S::ZERO,
        }
    }

    /// Force that a sticking damper must supply, N: positive pushes the structure along +x.
    ///
    /// `stretch` is x − z, `base_acceleration` is z″. The damper holds while the magnitude of this force is at most F.
    #[must_use]
    pub fn holding_force(&self, contact: Contact, stretch: S, base_acceleration: S) -> S {
        self.moving_mass(contact) * base_acceleration + self.stiffness * stretch - self.drag(contact)
    }

    /// Lowest and highest structure acceleration at which a particle held on `side` stays held, m/s².
    ///
    /// Friction accelerates the particle by up to ±μi·g, its weight by −w. A hard wall pushes inwards without limit and cannot
    /// pull. A compressed soft wall pushes with the reaction to `joint_force`.
    #[must_use]
    pub fn held_limits(&self, side: Sign, joint_force: S) -> (Option<S>, Option<S>) {
        let g = self.friction_acceleration;
        let pushed = if joint_force == S::ZERO { S::ZERO } else { -joint_force / self.particle_mass };
        let w = self.weight;
        ((side <= 0).then_some(pushed - g - w), (side >= 0).then_some(pushed + g - w))
    }
}

/// Place of a side among two walls.
#[inline]
pub(crate) fn of(side: Sign) -> usize {
    usize::from(side > 0)
}

/// Distances of the walls from y = x, each towards its side, m.
fn ends_m(set_up: &SetUp) -> [f64; 2] {
    let [negative, positive] = set_up.particle.map_or([0.0; 2], |particle| particle.ends_m());
    [-negative, positive]
}

/// The laws of impact in a unit of velocity of this many m/s.
fn impact_laws<S: Scalar>(set_up: &SetUp, velocity_m_per_s: f64) -> [ImpactLaw<S>; 2] {
    let walls =
        set_up.particle.map_or([None; 2], |particle| particle.walls().map(|wall| wall.impact_law(velocity_m_per_s)));
    walls.map(Option::unwrap_or_default)
}

/// `value` with the sign of `direction`, or zero.
#[must_use]
pub fn signed<S: Scalar>(direction: Sign, value: S) -> S {
    match direction {
        1.. => value,
        0 => S::ZERO,
        _ => -value,
    }
}

/// Applies [`signed`] to each value.
#[must_use]
#[inline]
pub fn all_signed<S: Scalar, const N: usize>(direction: Sign, values: [S; N]) -> [S; N] {
    match direction {
        1.. => values,
        0 => [S::ZERO; N],
        _ => values.map(|value| -value),
    }
}

/// The sign of `value`.
#[must_use]
pub fn sign<S: Scalar>(value: S) -> Sign {
    if value > S::ZERO {
        1
    } else if value < S::ZERO {
        -1
    } else {
        0
    }
}

/// The part of a state that [`resolve`] needs.
#[derive(Clone, Copy, Debug)]
pub struct Situation<S> {
    /// x − z, m.
    pub stretch: S,
    /// x′ − z′, m/s; exactly zero when the damper may stick.
    pub slip: S,
    /// y′ − x′, m/s; exactly zero when the particle may be held.
    pub slide: S,
    /// Side of the cavity at which the particle touches a wall, 0 inside.
    pub side: Sign,
    /// z″, m/s².
    pub base_acceleration: S,
    /// Force of the spring and dashpot between structure and particle (soft wall, tuned mass) on the structure, N.
    pub joint_force: S,
    /// Any other force on the structure, N.
    pub applied_force: S,
    /// Rounding error of an acceleration, m/s²: an excess within it does not release a body.
    pub rounding: S,
}

/// The mode that follows from a state: the one in which every force is within its limit.
///
/// A relative velocity of exactly zero means that the two bodies may stick; any other value gives the direction of
/// slip. A particle without internal friction can be held only by a wall.
#[must_use]
pub fn resolve<S: Scalar>(c: &Coefficients<S>, has_particle: bool, s: &Situation<S>) -> Mode {
    if !has_particle {
        return Mode { grip: grip(c, Contact::Absent, s), contact: Contact::Absent };
    }
    let may_be_held = s.slide == S::ZERO && (s.side != 0 || c.friction_acceleration > S::ZERO);
    if !may_be_held {
        let contact = Contact::Free(sign(s.slide));
        return Mode { grip: grip(c, contact, s), contact };
    }
    let held = Contact::Held(s.side);
    let grip_held = grip(c, held, s);
    let acceleration = match grip_held {
        Grip::Stuck => s.base_acceleration,
        Grip::Absent | Grip::Slip(_) => structure_acceleration(c, held, grip_held, s),
    };
    let (low, high) = c.held_limits(s.side, s.joint_force);
    // If the structure accelerates more than friction and wall can transmit, the particle lags behind.
    let contact = if high.is_some_and(|high| acceleration > high + s.rounding) {
        Contact::Free(-1)
    } else if low.is_some_and(|low| acceleration < low - s.rounding) {
        Contact::Free(1)
    } else {
        return Mode { grip: grip_held, contact: held };
    };
    Mode { grip: grip(c, contact, s), contact }
}

fn grip<S: Scalar>(c: &Coefficients<S>, contact: Contact, s: &Situation<S>) -> Grip {
    let grip = c.grip_at(s.slip);
    if grip != Grip::Stuck {
        return grip;
    }
    let needed = c.holding_force(contact, s.stretch, s.base_acceleration) - joint_force(contact, s) - s.applied_force;
    if needed.abs() <= c.damper_force { Grip::Stuck } else { Grip::Slip(-sign(needed)) }
}

fn structure_acceleration<S: Scalar>(c: &Coefficients<S>, contact: Contact, grip: Grip, s: &Situation<S>) -> S {
    let force = c.drag(contact) - c.stiffness * s.stretch - c.damping * s.slip - c.resistance(grip);
    (force + joint_force(contact, s) + s.applied_force) / c.moving_mass(contact)
}

/// The joint force on the bodies that move as one with the structure: zero if the particle is one of them.
fn joint_force<S: Scalar>(contact: Contact, s: &Situation<S>) -> S {
    match contact {
        Contact::Held(_) => S::ZERO,
        Contact::Absent | Contact::Free(_) => s.joint_force,
    }
}

/// Velocities after an impact of the particle on a hard wall: `(x′, y′ − x′)` from those before.
///
/// Momentum `M x′ + m y′` is conserved and the relative velocity is multiplied by −e (thesis eq. 3.6 and 3.7). The
/// calculation uses the relative velocity, so that e is exact and a light particle's impulse is not lost in rounding.
#[must_use]
pub fn impact<S: Scalar>(c: &Coefficients<S>, restitution: S, v: S, slide: S) -> (S, S) {
    let impulse = (S::ONE + restitution) * slide * c.particle_mass;
    (v + impulse / (c.mass + c.particle_mass), -restitution * slide)
}
