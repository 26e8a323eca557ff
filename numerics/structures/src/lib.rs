//! Linear structures of several degrees of freedom with impact, friction and tuned mass dampers.

mod set_up;
mod state;

pub use set_up::{FrictionJoint, ImpactDamper, Mode, Modes, SetUp, TunedMass};
pub use state::{Body, State};
