//! What the rig does: experiments, the friction spring, and the interlocks that end a drive.
//!
//! [`friction_spring`] and [`safety`] are complete in themselves and not yet part of [`crate::rig::Rig`]'s tick.

pub mod base_loop;
pub mod friction_spring;
pub mod limits;
pub mod safety;
pub mod stepped_sine;
