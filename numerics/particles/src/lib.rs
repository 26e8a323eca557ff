//! Simulates spheres in a box on a vibrating structure: a many-particle impact damper as a discrete-element model.
//!
//! The structure has one degree of freedom, horizontal; gravity acts downwards. The box is fixed to the structure. Spheres of
//! one size touch each other and the six walls of the box. A contact is a spring and a dashpot along the line of centres that
//! never pulls, and a spring and a dashpot across it whose force Coulomb's law limits ([`ContactLaw`]); with friction the
//! spheres rotate. Nothing resists rolling. [`Damper`] states spheres and box, [`Motion`] follows the motion.
//!
//! # Steps
//! The steps are those of the velocity form of Verlet's scheme. Forces that depend on velocities take them from a
//! prediction; the velocities are corrected once. A step is the shortest contact's duration, or half a
//! period of the structure if that is shorter, over [`Damper::steps_per_contact`]. Momentum is kept to the last bits. The scheme is of second order where forces are smooth;
//! a dashpot's force is not where a contact starts, which leaves errors of first order.
//!
//! # The same bits
//! Everything is computed in one thread in a fixed order, and the packing is drawn from a seed: two runs have the same bits.

mod cavity;
mod contact;
mod energy;
mod excitation;
mod forces;
mod motion;
mod neighbours;
mod vector;

pub use cavity::{Cavity, packing};
pub use contact::{ContactLaw, Elasticity, FAST_M_PER_S, SpringAndDashpot, damping_ratio, restitution};
pub use energy::Energies;
pub use excitation::{Drive, Excitation};
pub use forces::WallImpact;
pub use motion::{Damper, MAX_SPHERES, MIN_RESTITUTION, MIN_STEPS, Motion, Start, State};
