//! Why a set-up or a motion is refused.

use damprig_core::io::Invalid;

/// Why a set-up or a motion is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// A value out of range.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// A list has a wrong length, or a place does not exist.
    #[error("{what}: {found} found, {expected} expected")]
    Count {
        /// What is counted, spelled as in files.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A place that the structure does not have.
    #[error("{what}: there is no place {place}; the structure has {places} places, counted from 0")]
    Place {
        /// The damper or force, spelled as in files.
        what: &'static str,
        /// The number given.
        place: usize,
        /// How many places there are.
        places: usize,
    },
    /// A damper between a place and itself.
    #[error("friction_dampers: a damper joins place {0} with itself; give two places, or one place and the base")]
    SamePlace(usize),
    /// A damper at a place that no mode moves.
    #[error("friction_dampers: no mode moves the damper's two ends against each other")]
    NoMotion,
    /// A force without a place to act at.
    #[error("force.place: the excitation is a force; name the place at which it acts")]
    NoDrivenPlace,
    /// A driven place of an excitation that moves the base.
    #[error("force.place: the excitation moves the base; leave the place out, or give a force")]
    BaseMoves,
    /// A force beside something else than a sine of the base.
    #[error("force: beside a moving base there is a force only if the base moves as a sine with an amplitude above 0")]
    NoSineBeside,
    /// A particle that starts outside its cavity.
    #[error(
        "initial: y − x of the particle of impact damper {number} is {offset_m} m, its walls are at {from_m} m and {to_m} m",
        number = damper + 1
    )]
    Outside {
        /// Number of the impact damper, counted from 0.
        damper: usize,
        /// y − x, m.
        offset_m: f64,
        /// y − x at the wall on the negative side, m.
        from_m: f64,
        /// y − x at the wall on the positive side, m.
        to_m: f64,
    },
    /// A wall with Hertz contact, of which no derivatives are known.
    #[error("impact_dampers: a wall with Hertz contact has no derivatives; state its restitution")]
    Hertz,
    /// The damping couples two motions of nearly the same rate so that the closed form loses its digits.
    #[error("a natural motion is critically damped to within rounding: change its damping by one part in a million")]
    Critical,
    /// An undamped mode is driven at its natural frequency.
    #[error(
        "the excitation has the natural frequency of an undamped motion: add damping or change the frequency by one part in a million"
    )]
    Resonance,
    /// Bodies that nothing holds.
    #[error("a part of the structure is not held by any spring: its stiffness matrix must be positive definite")]
    Unsupported,
    /// A matrix that is not symmetric.
    #[error(
        "{what}: row {row}, column {column} is {one}, the entry across the diagonal is {other}: the matrix must be symmetric"
    )]
    NotSymmetric {
        /// The matrix, spelled as in files.
        what: &'static str,
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// The entry.
        one: f64,
        /// The entry across the diagonal.
        other: f64,
    },
    /// A matrix that must be positive definite.
    #[error("{0}: the matrix must be positive definite: a direction of motion has no mass, or a negative one")]
    NotDefinite(&'static str),
    /// Damping with a negative part.
    #[error("structure: the damping has a negative part, so that a motion would grow by itself")]
    NegativeDamping,
    /// Joints that stick together depend on each other.
    #[error(
        "joints that stick together have no unique forces: two friction dampers between the same places are one with the sum of their forces"
    )]
    Redundant,
}

impl From<Refused> for Invalid {
    /// What a motion in progress is refused for, in the words of a simulation.
    fn from(refused: Refused) -> Self {
        match refused {
            Refused::Invalid(invalid) => invalid,
            _ => Self {
                parameter: "the structure with its dampers",
                value: f64::NAN,
                allowed: "one whose contacts have a motion in closed form: joints that stick together depend on each other, or a motion is \
                          critically damped or driven at its natural frequency",
            },
        }
    }
}
