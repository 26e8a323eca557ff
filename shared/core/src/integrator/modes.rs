//! The mode machine: which of the set-valued forces stick, slip or press right now.
//!
//! Coulomb friction and a wall are not functions of the state but of what follows from it: while two bodies
//! stick, the force is whatever keeps them together, up to a limit. So the motion is a sequence of modes,
//! linear in each, and this module holds the two things every driver needs: [`resolve`], the mode that is
//! consistent with a state, and [`impact`], the law of the hard wall. When events happen is the drivers'
//! business.
//!
//! The structure's equation (u is the base displacement z here, absolute coordinates):
//! `M x″ + c (x′ − z′) + k (x − z) = f_damper + f_particle`, and `m y″ = −f_particle`.

use super::units::Units;
use crate::model::{SetUp, Wall};
use crate::scalar::Scalar;

/// +1, 0 or −1: a direction, or a side of the cavity.
pub type Sign = i8;

/// What the friction damper does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// There is none, or its force is zero: nothing slips or sticks, so no slip can end.
    Absent,
    /// The structure slips on the damper in the direction of the sign, +1 or −1: the force is −sign·F.
    Slip(Sign),
    /// The structure moves with the base.
    Stuck,
}

/// What the particle does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// There is none.
    Absent,
    /// It flies between the walls; the sign of y′ − x′ as far as internal friction is concerned.
    Free(Sign),
    /// It moves with the structure: held by internal friction (side 0), or resting on the wall of that side.
    Held(Sign),
}

/// The mode of the whole system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// Structure against base.
    pub grip: Grip,
    /// Particle against structure.
    pub contact: Contact,
}

/// The set-up's parameters in the scalar of the calculation, as the equations use them.
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
    /// d, m; 0 without a particle.
    pub clearance: S,
    /// e of a hard wall.
    pub restitution: S,
    /// μi·g, m/s²: the largest acceleration that internal friction gives the particle.
    pub friction_acceleration: S,
}

impl<S: Scalar> Coefficients<S> {
    /// From a validated set-up. A soft wall or a tuned mass is not part of these equations.
    #[must_use]
    pub fn new(set_up: &SetUp) -> Self {
        let particle = set_up.particle;
        let restitution = match particle.map(|p| p.wall) {
            Some(Wall::Restitution { coefficient }) => coefficient,
            _ => 0.0,
        };
        Self {
            mass: S::from_f64(set_up.structure.mass_kg),
            damping: S::from_f64(set_up.structure.damping_n_s_per_m),
            stiffness: S::from_f64(set_up.structure.stiffness_n_per_m),
            damper_force: S::from_f64(set_up.friction_damper.map_or(0.0, |d| d.force_n)),
            particle_mass: S::from_f64(particle.map_or(0.0, |p| p.mass_kg)),
            clearance: S::from_f64(particle.map_or(0.0, |p| p.clearance_m)),
            restitution: S::from_f64(restitution),
            friction_acceleration: S::from_f64(
                particle.map_or(0.0, |p| p.friction_coefficient * set_up.gravity_m_per_s2),
            ),
        }
    }

    /// The same system in other units: time and length as given, force per structure mass. So M = 1, and every
    /// function of this module holds unchanged.
    #[must_use]
    pub fn in_units(set_up: &SetUp, units: &Units) -> Self {
        let structure = &set_up.structure;
        let (mass, step_s, length_m) = (structure.mass_kg, units.step_s, units.length_m);
        let acceleration = length_m / (step_s * step_s);
        let particle = set_up.particle;
        let friction = particle.map_or(0.0, |p| p.friction_coefficient) * set_up.gravity_m_per_s2;
        Self {
            mass: S::ONE,
            damping: S::from_f64(structure.damping_n_s_per_m * step_s / mass),
            stiffness: S::from_f64(structure.stiffness_n_per_m * (step_s * step_s) / mass),
            damper_force: S::from_f64(set_up.friction_damper.map_or(0.0, |d| d.force_n) / mass / acceleration),
            particle_mass: S::from_f64(particle.map_or(0.0, |p| p.mass_kg) / mass),
            clearance: S::from_f64(particle.map_or(0.0, |p| p.clearance_m) / length_m),
            friction_acceleration: S::from_f64(friction / acceleration),
            ..Self::new(set_up)
        }
    }

    /// Mass that moves with the structure in `contact`, kg.
    #[must_use]
    pub fn moving_mass(&self, contact: Contact) -> S {
        match contact {
            Contact::Held(_) => self.mass + self.particle_mass,
            Contact::Absent | Contact::Free(_) => self.mass,
        }
    }

    /// Force of the particle on the structure in `contact` as far as it is known beforehand, N.
    #[must_use]
    pub fn drag(&self, contact: Contact) -> S {
        match contact {
            Contact::Free(direction) => signed(direction, self.particle_mass * self.friction_acceleration),
            Contact::Absent | Contact::Held(_) => S::ZERO,
        }
    }

    /// How the friction damper stands in a structure that moves at `slip` (x′ − z′, m/s) relative to the base, before the
    /// forces are known: a slip of exactly zero may stick.
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

    /// Force with which a slipping damper resists, N: positive against a slip along +x. What a stuck one supplies follows
    /// from the motion ([`Coefficients::holding_force`]).
    #[must_use]
    pub fn resistance(&self, grip: Grip) -> S {
        match grip {
            Grip::Slip(direction) => signed(direction, self.damper_force),
            Grip::Absent | Grip::Stuck => S::ZERO,
        }
    }

    /// Force that a stuck damper must supply, N: positive pushes the structure along +x.
    ///
    /// `stretch` is x − z, `base_acceleration` is z″. The damper holds while its magnitude is at most F.
    #[must_use]
    pub fn holding_force(&self, contact: Contact, stretch: S, base_acceleration: S) -> S {
        self.moving_mass(contact) * base_acceleration + self.stiffness * stretch - self.drag(contact)
    }

    /// Lowest and highest structure acceleration with which a particle held on `side` stays held, m/s².
    ///
    /// Friction gives it ±μi·g; a hard wall pushes inwards without limit and cannot pull; a soft one that is pressed
    /// pushes with the reaction of `joint_force`.
    #[must_use]
    pub fn held_limits(&self, side: Sign, joint_force: S) -> (Option<S>, Option<S>) {
        let g = self.friction_acceleration;
        let pushed = if joint_force == S::ZERO { S::ZERO } else { -joint_force / self.particle_mass };
        ((side <= 0).then_some(pushed - g), (side >= 0).then_some(pushed + g))
    }
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

/// As [`signed`], of each of them.
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

/// What [`resolve`] needs to know of a state.
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
    /// Force on the structure by a spring and dashpot between it and the particle (soft wall, tuned mass), N.
    pub joint_force: S,
    /// Any other force on the structure, N.
    pub applied_force: S,
    /// What rounding may make of an acceleration of zero, m/s²: a body is not let go by that little.
    pub rounding: S,
}

/// The mode that follows from a state: the one in which every force is within its limit.
///
/// A relative velocity of exactly zero asks whether the two bodies stick; any other says how they slip.
/// A particle without internal friction is held by a wall only.
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
    // The particle lags behind a structure that accelerates more than friction and wall can follow.
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

/// The joint's force on what moves as one body with the structure: none once the particle is part of it.
fn joint_force<S: Scalar>(contact: Contact, s: &Situation<S>) -> S {
    match contact {
        Contact::Held(_) => S::ZERO,
        Contact::Absent | Contact::Free(_) => s.joint_force,
    }
}

/// Velocities after the particle hits a hard wall: `(x′, y′ − x′)` from those before.
///
/// Momentum `M x′ + m y′` is kept and the relative velocity is scaled by −e (thesis eq. 3.6 and 3.7). In
/// relative terms, so that e is exact and a light particle's impulse is not lost in rounding.
#[must_use]
pub fn impact<S: Scalar>(c: &Coefficients<S>, restitution: S, v: S, slide: S) -> (S, S) {
    let impulse = (S::ONE + restitution) * slide * c.particle_mass;
    (v + impulse / (c.mass + c.particle_mass), -restitution * slide)
}
