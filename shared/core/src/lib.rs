//! The core of damprig: models, integrators, measurement, control and interlocks of the rig.
//!
//! It uses no standard library, no allocation, no `unsafe` and no clock. A caller passes in samples and commands and
//! receives actuator values and replies. The same code runs on the controller board, in the emulator and on a computer.
//! Byte formats are in `damprig-protocol`; pins and registers are in the firmware.

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

/// Compiles and runs the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
