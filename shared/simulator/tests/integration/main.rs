//! Tests of the simulated rig and of the control loop around it, through the protocol's messages.

mod base_loop;
mod dampers;
mod device;
mod drive;
mod emergency_stop;
mod friction_spring;
mod impacts;
mod interlocks;
mod limits;
mod resonance;
mod response_loop;
mod sensors;
mod shaker;
mod soft_walls;
mod steadiness;
mod support;
mod transient;
mod twin;
mod uploads;
