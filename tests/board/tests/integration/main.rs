//! Integration tests of the controller image on the emulated board, in one binary so that it is linked once.
//!
//! Without an image (`tests/board/run` builds it) every test passes with a message that it was skipped;
//! `DAMPRIG_IMAGES=required` turns this into a failure.

mod boot;
mod campaign;
mod common;
mod faults;
mod settings;
mod timing;
