//! `damprig calibrate`: what it finds against the truth of the virtual rig, what it refuses, what it keeps and writes.

mod command;
mod lab_guide;
mod person;
mod truth;

/// Whether the long ensembles are run.
fn is_full() -> bool {
    std::env::var_os("DAMPRIG_FULL").is_some()
}
