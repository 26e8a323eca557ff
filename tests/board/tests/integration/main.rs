//! Integration tests of the controller image on the emulated board, in one binary so that it is linked once.
//!
//! Without an image (`tests/board/run` builds it) every test passes with a message that it was skipped;
//! `DAMPRIG_IMAGES=required` turns this into a failure.

mod boot;
mod campaign;
mod campaigns;
mod common;
mod cost;
mod faults;
mod hardware;
mod log;
mod outputs;
mod report;
mod response;
mod sensors;
mod settings;
mod timing;
