//! The controller's own image on the emulated board: one program, so that it is linked once.
//!
//! Without an image (`tests/board/run` builds it) nothing is tested, and each test says so; `DAMPRIG_IMAGES=required` makes
//! that a failure.

mod boot;
mod campaign;
mod common;
mod faults;
mod settings;
mod timing;
