//! Calibrates the channels of a rig: measures them at known references, fits their scales with uncertainties, and makes
//! settings of them.
//!
//! [`guide`] leads a person through the points, [`rig`] measures, [`fit`] and [`solve`] compute, [`readings`] reads and keeps the points,
//! [`record`] turns the result into settings and text. [`rehearsal`] is a simulated operator on a virtual rig whose true
//! scales are known.

pub mod channel;
pub mod fit;
pub mod guide;
mod moving;
pub mod readings;
pub mod record;
pub mod rehearsal;
pub mod rig;
pub mod solve;
mod walls;

pub use channel::Channel;
pub use readings::CalibrationPoint;
pub use solve::Solved;
