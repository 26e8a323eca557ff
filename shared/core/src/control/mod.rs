//! What the rig does: experiments and the interlocks that end them.

pub mod base_loop;
pub mod limits;
pub mod stepped_sine;
