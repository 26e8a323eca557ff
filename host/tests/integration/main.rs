//! Tests of the `damprig` command and library, one file for each capability. One binary, so that it links once.

mod analysis;
mod common;
mod controller;
mod disk;
mod exports;
mod faulty_link;
mod flash;
mod idle;
mod limits;
mod not_files;
mod refusals;
mod report;
mod resume;
mod run;
mod run_folder;
mod runs;
mod serial;
mod settings;
mod setup;
mod simulate;
mod simulate_cases;
mod simulate_refusals;
mod slips;
mod slow_disk;
mod transients;
