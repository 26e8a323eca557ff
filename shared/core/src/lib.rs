//! Every decision of the damprig rig: the models, the integrators, measurement and control.
//!
//! No standard library, no allocation, no `unsafe`, no clock: a caller hands in samples and commands and
//! gets actuator values and replies. The same code runs on the controller board, in the emulator and on a
//! computer. Byte formats live in `damprig-protocol`; pins and registers in the firmware.

#![no_std]
#![forbid(unsafe_code)]

pub mod analysis;
pub mod control;
#[cfg(feature = "fixed-point")]
pub mod fixed_point;
pub mod integrator;
pub mod io;
pub mod measure;
pub mod model;
pub mod rig;
pub mod scalar;
pub mod settings;
pub mod sine;
pub mod twin;
