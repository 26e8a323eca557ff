//! Cases with a many-particle damper: spheres in a box on the structure ([`damprig_particles`]).
//!
//! `read` reads the table `many_particles`, `driver` runs the case, `cycles` has the figures that only this damper has.

pub mod cycles;
pub(super) mod driver;
pub(super) mod read;

pub use cycles::{SpheresCycle, SpheresFigures};
pub use driver::{SpheresResult, counted};
