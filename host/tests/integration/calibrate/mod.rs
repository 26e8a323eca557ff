//! `damprig calibrate`: what it finds against the truth of the virtual rig, what it refuses, what it keeps and writes.

mod command;
mod lab_guide;
mod person;
mod truth;
