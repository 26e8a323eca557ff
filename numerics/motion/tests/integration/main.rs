//! Checks of motions on a rig.

mod placed_motion;
