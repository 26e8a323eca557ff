//! Control of the rig: experiments, the friction spring, and the interlocks that end a drive. [`crate::rig`] combines
//! them.

pub mod base_follow;
pub mod base_loop;
pub mod experiment;
pub mod fault;
pub mod friction_spring;
pub mod outcome;
pub mod phase_lock;
pub mod response_loop;
mod rest;
pub mod safety;
pub mod stepped_sine;
pub mod transient;
